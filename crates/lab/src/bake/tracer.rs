//! Key frames by the path tracer, each kept on disk under a name made of what determines it: a bake that was stopped goes on where it was.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use manylight_gpu::Gpu;
use manylight_graph::library::Library;
use manylight_passes::{Baked, Documents, Renderer, SceneSource, Settings, plan_input};
use manylight_scene::{Scene, gpu_data::NO_TRIANGLE};

use super::BakeError;
use crate::{
    facts,
    files::{FileError, Picture, read_exr, write_exr},
};

/// Seed of all key frames. They share their random numbers, so that noise changes as slowly over time as light does and little of it is taken for a change.
pub const SEED: u32 = 0x6b65_7966;
/// Most paths a texel and frame that the pipeline takes.
const MOST_PATHS_A_FRAME: u32 = 256;

/// What is traced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Light {
    /// Of the lights, over two and more surfaces.
    Indirect,
    /// Of the sky, over any number of surfaces.
    Sky,
}

impl Light {
    fn component(self) -> &'static str {
        match self {
            Self::Indirect => "indirect",
            Self::Sky => "sky",
        }
    }
}

/// What the texels of key frames are spread over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// The pixels of one picture, for a camera that stands still.
    Picture {
        /// Width and height.
        size: (u32, u32),
    },
    /// Both sides of all surfaces that stand still, for a camera that moves.
    Atlas {
        /// The most there may be.
        texels: u32,
    },
}

/// What is baked, and from what.
#[derive(Debug, Clone)]
pub struct Task<'a> {
    /// Shaders and pipelines.
    pub library: &'a Library,
    /// The scene. Objects that move are left out: they are not there in the key frames.
    pub source: &'a SceneSource,
    /// What is seen of it.
    pub domain: Domain,
    /// Paths a texel of each key frame.
    pub paths: u32,
    /// Folder of finished key frames.
    pub work: &'a Path,
}

/// Traces key frames, or finds them on disk.
#[derive(Debug)]
pub struct Tracer<'a> {
    gpu: &'a Gpu,
    task: Task<'a>,
    documents: Documents,
    scene: Scene,
    size: (u32, u32),
    atlas: Option<Arc<Baked>>,
    /// Share of the texels that stand for a surface.
    used_share: f64,
    renderer: Option<Renderer>,
    /// Frames that were traced, and frames that were there.
    pub traced: usize,
    /// Frames that were on disk.
    pub found: usize,
}

impl<'a> Tracer<'a> {
    /// Loads scene and pipeline.
    ///
    /// # Errors
    /// They have faults, or the scene cannot be baked.
    pub fn new(gpu: &'a Gpu, task: Task<'a>) -> Result<Self, BakeError> {
        let mut scene = task.source.load()?;
        let is_atlas = matches!(task.domain, Domain::Atlas { .. });
        if scene.camera.moves() && !is_atlas {
            let message = format!(
                "the camera of `{}` moves, and baked light of a picture is for one that stands still: bake it over the surfaces by --lookup atlas",
                scene.name
            );
            return Err(BakeError::Input(message));
        }
        let deforms: Vec<bool> = scene.meshes.iter().map(|mesh| mesh.deformation.is_some()).collect();
        scene.objects.retain(|object| !(object.pose.moves() || is_atlas && deforms[object.mesh]));
        if scene.objects.is_empty() {
            return Err(BakeError::Input(format!("every object of `{}` moves: there is nothing to bake", scene.name)));
        }
        let (pipeline, size, atlas, used_share) = match task.domain {
            Domain::Picture { size } => ("pipelines/bake/image.ron", size, None, 1.0),
            Domain::Atlas { texels } => {
                let atlas = super::atlas(&scene, texels)?;
                let texels = manylight_passes::atlas::texels(&scene, &scene.sample(0.0), &atlas);
                let used = texels.iter().filter(|texel| texel.triangle != NO_TRIANGLE).count() as f64 / texels.len() as f64;
                ("pipelines/bake/atlas.ron", (atlas.header.width as u32, atlas.header.height as u32), Some(Arc::new(atlas)), used)
            }
        };
        let documents = Documents::load(task.library.clone(), Path::new(pipeline))?;
        Ok(Self { gpu, task, documents, scene, size, atlas, used_share, renderer: None, traced: 0, found: 0 })
    }

    /// The scene without what moves. Its hash is that of the whole scene.
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Width and height of key frames.
    pub fn size(&self) -> (u32, u32) {
        self.size
    }

    /// Where triangles are in key frames, if these are no pictures.
    pub fn atlas(&self) -> Option<&Baked> {
        self.atlas.as_deref()
    }

    /// Share of the texels of a key frame that stand for a surface.
    pub fn used_share(&self) -> f64 {
        self.used_share
    }

    /// What is baked.
    pub fn task(&self) -> &Task<'a> {
        &self.task
    }

    /// Whether no light shines at a time: its key frame is black and is not traced.
    pub fn is_dark(&self, time: f64) -> bool {
        self.scene.sample(time).lights.iter().all(|light| light.strength == glam::Vec3::ZERO)
    }

    /// Light at a time. `paths` and `seed` are those of key frames but for comparisons.
    ///
    /// # Errors
    /// The frame cannot be rendered or kept.
    pub fn frame(&mut self, light: Light, time: f64, paths: u32, seed: u32) -> Result<Picture, BakeError> {
        let (width, height) = self.size;
        if light == Light::Indirect && self.is_dark(time) {
            return Ok(Picture::linear(width as usize, height as usize, 3, vec![0.0; 3 * width as usize * height as usize]));
        }
        let frames = paths.div_ceil(MOST_PATHS_A_FRAME);
        let settings = self.settings(light, paths.div_ceil(frames), seed);
        let plan = self.documents.plan(&plan_input(&settings, &self.scene))?;
        let version = env!("CARGO_PKG_VERSION");
        let corners = self.atlas.as_ref().map(|atlas| &atlas.corners);
        let inputs = format!("{:016x} {time:?} {frames} {seed} {version} {corners:?}", self.scene.hash);
        let name = facts::hash(&[&facts::fingerprint(&plan), &inputs]);
        let file = self.task.work.join(format!("{name}.exr"));
        if let Some(picture) = kept(&file, width as usize, height as usize) {
            self.found += 1;
            return Ok(picture);
        }
        let renderer = self.renderer(settings)?;
        for _ in 0..frames {
            renderer.render_frame(time)?;
            // Without waiting, all frames would be queued before the first is done.
            renderer.wait_timings();
        }
        let picture = read(renderer, "composed")?;
        write_exr(&file, &picture)?;
        self.traced += 1;
        Ok(picture)
    }

    /// Distances of surfaces from the camera; 0 where there is none.
    ///
    /// # Errors
    /// The frame cannot be rendered.
    pub fn distance(&mut self) -> Result<Picture, BakeError> {
        let settings = self.settings(Light::Sky, 1, SEED);
        let renderer = self.renderer(settings)?;
        renderer.render_frame(0.0)?;
        read(renderer, "gbuffer_depth")
    }

    fn settings(&self, light: Light, paths: u32, seed: u32) -> Settings {
        let set = [("component", light.component().to_owned()), ("paths", paths.to_string())];
        Settings {
            size: self.size,
            set: set.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            keep: self.atlas.is_none().then(|| "gbuffer_depth".to_owned()).into_iter().collect(),
            seed,
            baked: self.atlas.clone(),
            ..Settings::default()
        }
    }

    /// A renderer whose next frame is its first.
    fn renderer(&mut self, settings: Settings) -> Result<&mut Renderer, BakeError> {
        let renderer = match self.renderer.take() {
            Some(mut renderer) => {
                if renderer.settings().set != settings.set || renderer.settings().seed != settings.seed {
                    renderer.set(settings)?;
                }
                renderer.restart();
                renderer
            }
            None => Renderer::with(self.gpu, self.documents.clone(), self.task.source.clone(), self.scene.clone(), settings)?,
        };
        Ok(self.renderer.insert(renderer))
    }
}

fn read(renderer: &Renderer, name: &str) -> Result<Picture, BakeError> {
    renderer.read(name).map(|image| Picture::from(image).without_alpha()).map_err(|e| BakeError::Render(e.to_string()))
}

/// A frame on disk; `None` if it is not there or damaged: then it is traced anew.
fn kept(file: &Path, width: usize, height: usize) -> Option<Picture> {
    let picture = read_exr(file).ok()?.layer("")?;
    let whole = (picture.width, picture.height, picture.channels()) == (width, height, 3) && picture.data.iter().all(|v| v.is_finite());
    whole.then_some(picture)
}

/// Makes the folder of key frames.
///
/// # Errors
/// It cannot be made.
pub fn make_work(folder: &Path) -> Result<PathBuf, FileError> {
    std::fs::create_dir_all(folder).map_err(|e| FileError::write(folder, &e))?;
    Ok(folder.to_owned())
}

impl From<manylight_graph::diagnostics::Diagnostics> for BakeError {
    fn from(diagnostics: manylight_graph::diagnostics::Diagnostics) -> Self {
        Self::Documents(diagnostics)
    }
}

impl From<manylight_passes::RenderError> for BakeError {
    fn from(error: manylight_passes::RenderError) -> Self {
        match error {
            manylight_passes::RenderError::Documents(diagnostics) => Self::Documents(diagnostics),
            error => Self::Render(error.to_string()),
        }
    }
}
