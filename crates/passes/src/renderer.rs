//! [`Renderer`]: a pipeline that renders a scene, and goes on while its files change.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    sync::Arc,
    time::{Duration, Instant},
};

use manylight_gpu::{
    BuildOptions, BuildReport, Externals, Fault, Frame, FrameTimings, Gpu, HostData, HostNodes, Image, MemoryReport, ReadError, RunError,
    Subresource, WatchSet, format::byte_size, memory::Holding,
};
use manylight_graph::{
    diagnostics::{Diagnostic, Diagnostics},
    library::Library,
    pipeline::Pipeline,
    plan::{Debug, Lifetime, Plan, PlanInput},
};
use manylight_scene::{Scene, gpu_data};

use crate::{
    baked::{Baked, Lookup},
    documents::Documents,
    externals::{SceneUpload, descriptions},
    host::{self, HostScene},
    scene_source::SceneSource,
};

mod error;

pub use error::RenderError;

/// How to render.
#[derive(Debug, Clone, Default)]
pub struct Settings {
    /// Width and height of the picture in pixels.
    pub size: (u32, u32),
    /// Values of parameters: of the pipeline (`clusters`) or of a node (`map.window`). The last one of a name wins.
    pub set: Vec<(String, String)>,
    /// Resources to keep for [`Renderer::read`] besides the picture and the radiance.
    pub keep: Vec<String>,
    /// Skip nodes whose inputs are as they were, for the memory of keeping all that nodes write; the picture is the same. What is measured
    /// to be compared is measured without.
    pub skip_unchanged: bool,
    /// Debug switches; none changes the picture.
    pub debug: Debug,
    /// Seed of everything random.
    pub seed: u32,
    /// Precomputed light for pipelines that read it.
    pub baked: Option<Arc<Baked>>,
}

/// What a change of files or parameters did.
#[derive(Debug, Clone, Default)]
pub struct ReloadReport {
    /// Nodes and histories that were kept, rebuilt and reset.
    pub build: BuildReport,
    /// Whether another scene, or one with other baked light, is rendered now.
    pub scene_changed: bool,
    /// Faults of nodes that the pipeline does not use, and warnings.
    pub warnings: Diagnostics,
    /// Time it took.
    pub took: Duration,
}

/// A pipeline bound to a device and a scene.
///
/// Everything that can fail is built beside the running frame: after an error the renderer goes on as before.
#[derive(Debug)]
pub struct Renderer {
    gpu: Gpu,
    documents: Documents,
    hosts: HostNodes,
    settings: Settings,
    scene: LoadedScene,
    frame: Frame,
    last_time: Option<f64>,
    /// Frames run before the last restart.
    first: u64,
    /// Frames run before the plan was made.
    built_at: u64,
}

/// A scene with its data on the GPU.
#[derive(Debug)]
struct LoadedScene {
    source: SceneSource,
    host: HostScene,
    upload: SceneUpload,
    externals: Externals,
    /// Whether the plan is made for less geometry than there is room for now.
    outgrown: bool,
}

impl LoadedScene {
    /// A scene as it is at a time.
    fn new(source: SceneSource, mut scene: Scene, settings: &Settings, time: f64) -> Self {
        let state = scene.sample(time);
        scene.make_room(&state);
        let host = HostScene { scene: Arc::new(scene), seed: settings.seed, baked: settings.baked.clone(), state };
        Self { source, host, upload: SceneUpload::new(), externals: Externals::new(), outgrown: false }
    }

    /// Goes to another time.
    fn go_to(&mut self, time: f64) {
        self.host.state = self.host.scene.sample(time);
        let HostScene { scene, state, .. } = &mut self.host;
        if !scene.has_room(state) {
            self.outgrown = Arc::make_mut(scene).make_room(state);
        }
    }

    fn upload(&mut self, gpu: &Gpu, size: (u32, u32), frame: &gpu_data::Frame) -> Result<(), Fault> {
        let aspect = size.0 as f32 / size.1 as f32;
        self.upload.upload(gpu, &mut self.externals, &self.host.scene, &self.host.state, frame, aspect)?;
        self.upload.upload_baked(gpu, &mut self.externals, self.host.baked.as_deref(), &self.host.scene, &self.host.state)
    }

    /// Changes with the scene and with the seed.
    fn stamp(&self) -> u64 {
        self.host.scene.hash ^ u64::from(self.host.seed).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    }
}

/// Fails where a plan needs baked light and has none that fits scene and picture.
fn check_baked(plan: &Plan, settings: &Settings, scene: &Scene) -> Result<(), Diagnostics> {
    let fault = |message: String, help: &str| Diagnostics(vec![Diagnostic::error_nowhere(message).help(help)]);
    if plan.resource("baked_weights").is_none() {
        return Ok(());
    }
    let Some(baked) = &settings.baked else {
        let help = "make it by `manylight bake SCENE --out FILE.baked`, and give it by `--baked FILE.baked`";
        return Err(fault("the pipeline shows precomputed light, and there is none".to_owned(), help));
    };
    baked.check_scene(scene).map_err(|e| fault(format!("the baked light cannot be used: {e}"), "the command is `manylight bake`"))?;
    let ((width, height), header) = (settings.size, &baked.header);
    if header.lookup != Lookup::Image {
        return Ok(());
    }
    let (own, other) = (f64::from(width) / f64::from(height), header.width as f64 / header.height as f64);
    if (own / other - 1.0).abs() > ASPECT_TOLERANCE {
        let message = format!("the light was baked for a picture of {}×{}, not for one of {width}×{height}", header.width, header.height);
        return Err(fault(message, "render in the same proportions, or bake it again with another --size"));
    }
    Ok(())
}

/// By so much the proportions of a picture may differ from those that light was baked for: rounding of sides.
const ASPECT_TOLERANCE: f64 = 0.02;

/// What a plan of a pipeline depends on besides its documents; needs no GPU. Where the pipeline asks for something that is measured of scenes, the
/// scene is measured now if it has not been before, which takes some tenths of a second ([`Scene::measured`]).
pub fn plan_input(pipeline: &Pipeline, settings: &Settings, scene: &Scene) -> PlanInput {
    let (width, height) = settings.size;
    let is_asked = !pipeline.measured_features().is_empty() && width > 0 && height > 0;
    let measured = if is_asked { scene.measured(width as f32 / height as f32).features.clone() } else { BTreeMap::new() };
    PlanInput {
        output: settings.size,
        set: settings.set.clone(),
        features: features(settings, scene),
        measured,
        externals: descriptions(scene, settings.baked.as_deref()),
        keep: settings.keep.clone(),
        keep_unchanged: settings.skip_unchanged,
        debug: settings.debug,
    }
}

/// What the scene has, and what the light that was baked for it has.
fn features(settings: &Settings, scene: &Scene) -> BTreeMap<String, bool> {
    let is = |lookup| settings.baked.as_ref().is_some_and(|baked| baked.header.lookup == lookup);
    let of_light = [("baked_atlas", is(Lookup::Atlas)), ("baked_cube", is(Lookup::Cube))];
    scene.features().into_iter().chain(of_light.map(|(name, has)| (name.to_owned(), has))).collect()
}

impl Renderer {
    /// Loads a pipeline (a path, or a name in the library) and a scene, and builds the first frame.
    ///
    /// # Errors
    /// Every fault of the pipeline, of the nodes that it uses, of the scene and of the parameters; a plan that the device cannot run.
    pub fn new(
        gpu: &Gpu,
        library: Library,
        pipeline: impl AsRef<Path>,
        scene: SceneSource,
        settings: Settings,
    ) -> Result<Self, RenderError> {
        let documents = Documents::load(library, pipeline.as_ref())?;
        let loaded = scene.load()?;
        Self::with(gpu, documents, scene, loaded, settings)
    }

    /// As [`Renderer::new`], from what is loaded already.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn with(gpu: &Gpu, documents: Documents, source: SceneSource, scene: Scene, settings: Settings) -> Result<Self, RenderError> {
        let hosts = host::nodes();
        let mut scene = LoadedScene::new(source, scene, &settings, 0.0);
        let plan = documents.plan(&plan_input(documents.pipeline(), &settings, &scene.host.scene))?;
        check_baked(&plan, &settings, &scene.host.scene)?;
        scene.upload(gpu, settings.size, &gpu_data::Frame { seed: settings.seed, ..Default::default() })?;
        let (frame, _) = build(gpu, &plan, &scene, &hosts, None, &settings)?;
        Ok(Self { gpu: gpu.clone(), documents, hosts, settings, scene, frame, last_time: None, first: 0, built_at: 0 })
    }

    /// The same pipeline, scene and settings on another device, from its first frame: for when the device was lost.
    ///
    /// # Errors
    /// The plan does not fit the device.
    pub fn on(&self, gpu: &Gpu) -> Result<Self, RenderError> {
        Self::with(gpu, self.documents.clone(), self.scene.source.clone(), Scene::clone(self.scene()), self.settings.clone())
    }

    /// Renders the scene at a time in seconds. Returns when the frame is submitted, not when it is done.
    ///
    /// Where objects that deform have more triangles than was foreseen, buffers grow and the plan is made anew, which takes as long as the
    /// change of a parameter.
    ///
    /// # Errors
    /// A host node failed, the scene outgrew the device, or the device is lost. With [`Debug::watch_numbers`] also that the frame has bad numbers;
    /// for this alone it waits for the GPU.
    pub fn render_frame(&mut self, time: f64) -> Result<(), RenderError> {
        let rendered = self.try_frame(time);
        // What fails on a lost device, and that nothing seems to fail, follows from that.
        match self.gpu.lost() {
            Some(reason) => Err(RunError::Lost(reason).into()),
            None => rendered,
        }
    }

    fn try_frame(&mut self, time: f64) -> Result<(), RenderError> {
        let frame = gpu_data::Frame {
            index: (self.frame.index() - self.first.min(self.frame.index())) as u32,
            seed: self.settings.seed,
            time: time as f32,
            delta_time: self.last_time.map_or(0.0, |last| (time - last) as f32),
        };
        self.scene.go_to(f64::from(frame.time));
        self.scene.upload(&self.gpu, self.settings.size, &frame)?;
        if self.scene.outgrown {
            self.change(None, None, None)?;
            self.scene.outgrown = false;
        }
        let data = HostData::new(&self.scene.host, self.scene.stamp());
        self.frame.record_and_submit(&self.gpu, &self.scene.externals, data)?;
        self.last_time = Some(time);
        if self.settings.debug.watch_numbers {
            let found = self.frame.bad_numbers(&self.gpu).map_err(|e| RunError::Gpu(e.to_string()))?;
            if !found.is_empty() {
                return Err(RenderError::Numbers { frame: frame.index, found });
            }
        }
        Ok(())
    }

    /// Counts frames from 0 again: what is accumulated over frames starts anew, and everything random is as it was in the first frame.
    pub fn restart(&mut self) {
        self.first = self.frame.index();
        self.last_time = None;
        self.frame.forget();
    }

    /// Lets every node run in the next frame, whether what it reads has changed or not.
    pub fn forget(&mut self) {
        self.frame.forget();
    }

    /// Reads a texture of the latest frame: the picture, the radiance, a history, or one named in [`Settings::keep`]. Waits for the GPU.
    ///
    /// # Errors
    /// There is no such texture in the plan.
    pub fn read(&self, resource: &str) -> Result<Image, ReadError> {
        self.frame.read_image(&self.gpu, &self.scene.externals, resource, Subresource::default())
    }

    /// Reads a buffer of the latest frame as JSON with the field names of its structure. Waits for the GPU.
    ///
    /// # Errors
    /// There is no such buffer in the plan.
    pub fn read_json(&self, resource: &str) -> Result<serde_json::Value, ReadError> {
        self.frame.read_json(&self.gpu, &self.scene.externals, resource)
    }

    /// Measures GPU times by submitting node after node and waiting for each, instead of by timestamps ([`Frame::measure_serially`]).
    pub fn measure_serially(&mut self, on: bool) {
        self.frame.measure_serially(on);
    }

    /// Times of the newest frame whose timestamps have arrived. Never waits.
    pub fn timings(&self) -> Option<&FrameTimings> {
        self.frame.timings()
    }

    /// Waits for the GPU and returns the times of the latest frame.
    pub fn wait_timings(&mut self) -> Option<&FrameTimings> {
        self.frame.wait_timings(&self.gpu)
    }

    /// What runs.
    pub fn plan(&self) -> &Plan {
        self.frame.plan()
    }

    /// What would run under other settings; needs no GPU and changes nothing.
    ///
    /// # Errors
    /// The settings do not fit the pipeline, or it refuses them.
    pub fn plan_for(&self, settings: &Settings) -> Result<Plan, Diagnostics> {
        self.documents.plan(&plan_input(self.pipeline(), settings, self.scene()))
    }

    /// Index of the first frame of the plan, in which every node runs: with each change of documents, scene or settings a later one.
    pub fn built_at(&self) -> u64 {
        self.built_at
    }

    /// The frame, for those who draw its textures elsewhere.
    pub fn frame(&self) -> &Frame {
        &self.frame
    }

    /// The pipeline.
    pub fn pipeline(&self) -> &Pipeline {
        self.documents.pipeline()
    }

    /// The pipeline with its nodes.
    pub fn documents(&self) -> &Documents {
        &self.documents
    }

    /// The scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene.host.scene
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// How it renders.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Scene and frame data on the GPU.
    pub fn externals(&self) -> &Externals {
        &self.scene.externals
    }

    /// Memory of the frame by resource.
    pub fn memory_report(&self) -> MemoryReport {
        self.frame.memory_report()
    }

    /// Bytes that [`Settings::skip_unchanged`] takes, or would take: what sharing memory saves, which it forgoes.
    pub fn memory_for_skipping(&self) -> u64 {
        let report = self.frame.memory_report();
        let settings = Settings { skip_unchanged: false, debug: Debug { no_reuse: false, ..self.settings.debug }, ..self.settings.clone() };
        let Ok(shared) = self.plan_for(&settings) else { return 0 };
        let pooled = |name: &str| report.resources.iter().any(|r| r.name == name && matches!(r.holding, Holding::Pool { .. }));
        let slots = shared.resources.iter().filter(|r| pooled(&r.name)).filter_map(|r| match r.lifetime {
            Lifetime::Transient { slot, .. } => Some((slot, byte_size(&r.desc))),
            _ => None,
        });
        report.pool_unshared - slots.collect::<BTreeMap<_, _>>().values().sum::<u64>().min(report.pool_unshared)
    }

    /// What to watch: `shaders/` and `pipelines/` of the library's root, the pipeline's documents, the scene's files.
    pub fn watch_set(&self) -> WatchSet {
        let mut set = self.documents.watch_set();
        set.files.extend(self.scene.host.scene.sources.iter().cloned());
        set
    }

    /// Takes over changed files. Without any given, everything is looked at.
    ///
    /// # Errors
    /// The faults; the renderer goes on with what it had.
    pub fn reload(&mut self, changed: &[PathBuf]) -> Result<ReloadReport, Diagnostics> {
        let start = Instant::now();
        let of_scene = |path: &PathBuf| self.scene.host.scene.sources.iter().any(|source| same_file(source, path));
        let documents = if changed.is_empty() || !changed.iter().all(of_scene) { Some(self.documents.reload()) } else { None };
        let scene = if changed.is_empty() || changed.iter().any(of_scene) { Some(self.scene.source.load()) } else { None };
        let (documents, scene) = match (documents.transpose(), scene.transpose()) {
            (Ok(documents), Ok(scene)) => (documents, scene.filter(|s| s.hash != self.scene.host.scene.hash)),
            (documents, scene) => {
                let mut faults = documents.err().unwrap_or_default();
                faults.extend(scene.err().unwrap_or_default());
                return Err(faults);
            }
        };
        let mut report = self.change(documents, scene, None)?;
        report.took = start.elapsed();
        Ok(report)
    }

    /// Sets a parameter of the pipeline (`clusters`) or of a node (`map.window`).
    ///
    /// # Errors
    /// There is no such parameter, or the value is not one of its values; everything stays as it was.
    pub fn set_parameter(&mut self, name: &str, value: &str) -> Result<ReloadReport, Diagnostics> {
        let mut settings = self.settings.clone();
        settings.set.retain(|(known, _)| known != name);
        settings.set.push((name.to_owned(), value.to_owned()));
        self.set(settings)
    }

    /// Changes size, parameters, kept resources or debug switches all at once.
    ///
    /// # Errors
    /// The settings do not fit the pipeline or the device; everything stays as it was.
    pub fn set(&mut self, settings: Settings) -> Result<ReloadReport, Diagnostics> {
        let start = Instant::now();
        let mut report = self.change(None, None, Some(settings))?;
        report.took = start.elapsed();
        Ok(report)
    }

    /// Plans and builds beside the running frame and swaps when all went well.
    fn change(
        &mut self,
        documents: Option<Documents>,
        scene: Option<Scene>,
        settings: Option<Settings>,
    ) -> Result<ReloadReport, Diagnostics> {
        if let Some(reason) = self.gpu.lost() {
            return Err(Diagnostics(vec![Diagnostic::error_nowhere(Fault::Lost { reason }.to_string())]));
        }
        let new_settings = settings.as_ref().unwrap_or(&self.settings);
        let new_documents = documents.as_ref().unwrap_or(&self.documents);
        let time = self.last_time.unwrap_or(0.0) as f32;
        // Light that was baked is on the GPU with the scene.
        let baked_changed = match (&new_settings.baked, &self.scene.host.baked) {
            (Some(new), Some(old)) => !Arc::ptr_eq(new, old),
            (new, old) => new.is_some() != old.is_some(),
        };
        let scene = scene.or_else(|| baked_changed.then(|| Scene::clone(&self.scene.host.scene)));
        let mut new_scene = scene.map(|scene| LoadedScene::new(self.scene.source.clone(), scene, new_settings, time.into()));
        let described = new_scene.as_ref().map_or(&self.scene.host.scene, |s| &s.host.scene);
        let plan = new_documents.plan(&plan_input(new_documents.pipeline(), new_settings, described))?;
        check_baked(&plan, new_settings, described)?;
        if let Some(scene) = &mut new_scene {
            let frame = gpu_data::Frame { seed: new_settings.seed, time, ..Default::default() };
            scene.upload(&self.gpu, new_settings.size, &frame).map_err(|f| Diagnostics(vec![Diagnostic::error_nowhere(f.to_string())]))?;
        }
        let on_gpu = new_scene.as_ref().unwrap_or(&self.scene);
        let (frame, build) = build(&self.gpu, &plan, on_gpu, &self.hosts, Some(&self.frame), new_settings)?;
        self.frame = frame;
        self.built_at = self.frame.index();
        let scene_changed = new_scene.is_some();
        if let Some(scene) = new_scene {
            self.scene = scene;
        }
        if let Some(documents) = documents {
            self.documents = documents;
        }
        if let Some(settings) = settings {
            self.scene.host.seed = settings.seed;
            self.settings = settings;
        }
        Ok(ReloadReport { build, scene_changed, warnings: self.documents.registry_faults().clone(), took: Duration::ZERO })
    }
}

fn build(
    gpu: &Gpu,
    plan: &Plan,
    scene: &LoadedScene,
    hosts: &HostNodes,
    previous: Option<&Frame>,
    settings: &Settings,
) -> Result<(Frame, BuildReport), Diagnostics> {
    let options = BuildOptions {
        poison: settings.debug.poison,
        watch_numbers: settings.debug.watch_numbers,
        skip_unchanged: settings.skip_unchanged,
        ..Default::default()
    };
    Frame::build(gpu, plan, &scene.externals, hosts, previous, options).map_err(|e| e.diagnostics())
}

/// Whether two paths name one file. A deleted file has no canonical path: then its absolute path must do.
fn same_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.to_owned());
    a == b || place(a) == place(b)
}
