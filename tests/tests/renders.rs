//! Rendering through the library, for tests that look at pixels and buffers.

use std::{
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
};

use half::f16;
use manylight_gpu::{Gpu, GpuOptions, Image};
use manylight_graph::{library::Library, params::Literal, pipeline::Pipeline, plan::Debug, registry::Param, value::Value};
use manylight_passes::{
    Baked, Documents, Renderer, SceneSource, Settings,
    baked::{CORNERS, Header, Lookup, NOWHERE, hash_of},
};
use manylight_scene::Scene;

use crate::support::root;

/// One device for all tests of the binary. No adapter is a failure that says what to install.
pub fn gpu() -> &'static Gpu {
    static GPU: OnceLock<Gpu> = OnceLock::new();
    GPU.get_or_init(|| Gpu::new(&GpuOptions::default()).unwrap_or_else(|e| panic!("{e}")))
}

/// What to render; the pipeline is `acrsm` unless said otherwise.
pub struct Job {
    /// Folder with `shaders/` and `pipelines/`.
    pub root: PathBuf,
    pub pipeline: String,
    pub scene: PathBuf,
    pub size: (u32, u32),
    pub frames: u32,
    pub set: Vec<(String, String)>,
    pub keep: Vec<String>,
    pub skip_unchanged: bool,
    pub debug: Debug,
    pub seed: u32,
    pub baked: Option<Arc<Baked>>,
}

impl Job {
    /// A scene of `assets/` by its name.
    pub fn asset(name: &str) -> Self {
        Self::scene(&root().join("assets").join(name).with_extension("ron"))
    }

    /// A scene by its path. 256² pixels, 24 frames: the clusters have settled then.
    pub fn scene(path: &Path) -> Self {
        Self {
            root: root(),
            pipeline: root().join("pipelines/acrsm.ron").to_string_lossy().into_owned(),
            scene: path.to_owned(),
            size: (256, 256),
            frames: 24,
            set: Vec::new(),
            keep: Vec::new(),
            skip_unchanged: false,
            debug: Debug::default(),
            seed: 0,
            baked: None,
        }
    }

    /// A small picture with a small RSM and few points, for claims that do not need quality.
    pub fn small(self) -> Self {
        Self { size: (64, 64), frames: 6, ..self }.set("rsm_size", 128).set("point_count", 8000)
    }

    pub fn set(mut self, name: &str, value: impl ToString) -> Self {
        self.set.push((name.to_owned(), value.to_string()));
        self
    }

    pub fn keep(mut self, resources: &[&str]) -> Self {
        self.keep.extend(resources.iter().map(ToString::to_string));
        self
    }

    /// Precomputed light for pipelines that read it.
    pub fn baked(self, baked: &Arc<Baked>) -> Self {
        Self { baked: Some(Arc::clone(baked)), ..self }
    }

    pub fn frames(self, frames: u32) -> Self {
        Self { frames, ..self }
    }

    /// A renderer that has rendered nothing yet.
    #[track_caller]
    pub fn renderer(&self) -> Renderer {
        let settings = Settings {
            size: self.size,
            set: self.set.clone(),
            keep: self.keep.clone(),
            skip_unchanged: self.skip_unchanged,
            debug: self.debug,
            seed: self.seed,
            baked: self.baked.clone(),
        };
        let library = Library::new(Some(self.root.clone()), Vec::new());
        // What is measured of a scene is the same for all tests.
        let measures = Path::new(env!("CARGO_TARGET_TMPDIR")).join("measures");
        let scene = SceneSource::file(&self.scene).keeping_measures_in(Some(measures));
        Renderer::new(gpu(), library, &self.pipeline, scene, settings).unwrap_or_else(|e| panic!("{e}"))
    }

    /// A renderer after `frames` frames at time 0.
    #[track_caller]
    pub fn render(&self) -> Renderer {
        let mut renderer = self.renderer();
        for _ in 0..self.frames {
            renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
        }
        renderer
    }
}

/// Reads a texture.
#[track_caller]
pub fn read(renderer: &Renderer, resource: &str) -> Image {
    renderer.read(resource).unwrap_or_else(|e| panic!("{e}"))
}

/// Settings of a pipeline that leave nothing out: `on` for each switch that would be decided from the scene.
pub fn nothing_left_out(pipeline: &Pipeline) -> Vec<(String, String)> {
    let by_itself = |name: &str, param: &Param| match pipeline.set.get(name) {
        Some(preset) => preset.value == Literal::Text("auto".to_owned()),
        None => param.kind.default_value() == Value::Choice("auto".to_owned()),
    };
    let switches = pipeline.params.iter().filter(|(name, param)| param.kind.is_switch() && by_itself(name, param));
    switches.map(|(name, _)| (name.clone(), "on".to_owned())).collect()
}

/// Whether a pipeline shows light that was traced before: then its picture is what the file says.
pub fn shows_baked_light(documents: &Documents) -> bool {
    documents.pipeline().nodes.values().any(|node| node.node.text.starts_with("precomputed/"))
}

/// What a pipeline is to be given as precomputed light of a scene: nothing, or, where it shows such, light of each way of look-up.
pub fn lights_to_show(documents: &Documents, scene: &Scene, size: (u32, u32)) -> Vec<Option<Arc<Baked>>> {
    if shows_baked_light(documents) {
        [Lookup::Image, Lookup::Cube, Lookup::Atlas].map(|lookup| Some(Arc::new(made_up(lookup, scene, size)))).into()
    } else {
        vec![None]
    }
}

/// Light that nobody traced: of the brightness of a bright room, and far away in every other texel. In an atlas, every third triangle is not there.
fn made_up(lookup: Lookup, scene: &Scene, size: (u32, u32)) -> Baked {
    let (width, height) = if lookup == Lookup::Cube { (24, 16) } else { size };
    let still = scene.objects.iter().filter(|object| lookup == Lookup::Atlas && scene.stands_still(object));
    let triangles: usize = still.map(|object| scene.meshes[object.mesh].triangles.len()).sum();
    let header = serde_json::json!({
        "scene": scene.name, "scene_hash": hash_of(scene), "lookup": lookup, "triangles": triangles, "width": width, "height": height, "components": 1,
        "keys": [0.0], "period_s": 10.0, "kept_variance": [1.0], "mean_subtracted": true, "dark_keys": 0, "sky_scale": 1.0, "paths": 1,
        "manylight": "",
    });
    let header: Header = serde_json::from_value(header).expect("a header");
    let texel = |i: usize| if i % 8 == 3 { NOWHERE } else { 2.5 };
    let texels = (0..header.layers() * header.width * header.height * 4).map(|i| f16::from_f32(texel(i))).collect();
    let place = |i: usize| [(7 * i % header.width) as f32 + 0.5, (5 * i % header.height) as f32 + 0.5];
    let corners = (0..header.corners()).map(|i| if (i / CORNERS).is_multiple_of(3) { [0.0; 2] } else { place(i) }).collect();
    Baked { weights: vec![1.0; header.keys.len() * header.columns()], texels, corners, header }
}

/// A cluster as the graph's buffer holds it.
#[derive(Debug, Clone)]
pub struct Cluster {
    pub position: [f64; 3],
    pub normal: [f64; 3],
    pub flux: [f64; 3],
    pub area: f64,
    pub importance: f64,
    pub texel: [f64; 2],
    pub count: u64,
    pub state: u64,
    pub generation: u32,
}

/// Reads a buffer of clusters.
#[track_caller]
pub fn read_clusters(renderer: &Renderer, resource: &str) -> Vec<Cluster> {
    let json = renderer.read_json(resource).unwrap_or_else(|e| panic!("{e}"));
    fn numbers<const N: usize>(value: &serde_json::Value) -> [f64; N] {
        std::array::from_fn(|i| value[i].as_f64().expect("a finite number"))
    }
    json.as_array()
        .expect("an array of clusters")
        .iter()
        .map(|c| Cluster {
            position: numbers(&c["position"]),
            normal: numbers(&c["normal"]),
            flux: numbers(&c["flux"]),
            area: c["area"].as_f64().expect("area"),
            importance: c["importance"].as_f64().expect("importance"),
            texel: numbers(&c["texel"]),
            count: c["count"].as_u64().expect("count"),
            state: c["state"].as_u64().expect("state"),
            generation: c["generation"].as_u64().and_then(|g| g.try_into().ok()).expect("generation"),
        })
        .collect()
}
