//! Key frames by the path tracer, each kept on disk under a name made of what determines it: a bake that was stopped goes on where it was.

use std::{
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::Vec3;
use manylight_gpu::Gpu;
use manylight_graph::library::Library;
use manylight_passes::{
    Baked, Documents, Renderer, SceneSource, Settings,
    baked::{FACE_BORDER, Lookup},
    plan_input,
};
use manylight_scene::{
    Scene,
    gpu_data::NO_TRIANGLE,
    motion::{CameraPose, Track},
};

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
    /// Six faces of a cube, each of so many texels along a side, round a camera that turns.
    Cube {
        /// Width and height of a face.
        side: u32,
    },
    /// Both sides of all surfaces that stand still, for a camera that moves.
    Atlas {
        /// The most there may be.
        texels: u32,
    },
}

impl Domain {
    /// How its light is found.
    pub fn lookup(self) -> Lookup {
        match self {
            Self::Picture { .. } => Lookup::Image,
            Self::Cube { .. } => Lookup::Cube,
            Self::Atlas { .. } => Lookup::Atlas,
        }
    }
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
    /// Width and height of a key frame, and of each of the pictures that it is put together from.
    size: (u32, u32),
    picture: (u32, u32),
    atlas: Option<Arc<Baked>>,
    /// Share of the texels that stand for a surface.
    used_share: f64,
    /// Cameras of the pictures, with what renders them.
    eyes: Vec<(Track<CameraPose>, Option<Renderer>)>,
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
        let cameras = cameras(&scene, task.domain)?;
        let is_atlas = matches!(task.domain, Domain::Atlas { .. });
        let deforms: Vec<bool> = scene.meshes.iter().map(|mesh| mesh.deformation.is_some()).collect();
        scene.objects.retain(|object| !(object.pose.moves() || is_atlas && deforms[object.mesh]));
        if scene.objects.is_empty() {
            return Err(BakeError::Input(format!("every object of `{}` moves: there is nothing to bake", scene.name)));
        }
        let of_pictures = "pipelines/bake/image.ron";
        let (pipeline, size, atlas, used_share) = match task.domain {
            Domain::Picture { size } => (of_pictures, size, None, 1.0),
            Domain::Cube { side } => (of_pictures, (3 * side, 2 * side), None, 1.0),
            Domain::Atlas { texels } => {
                let atlas = super::atlas(&scene, texels)?;
                let texels = manylight_passes::atlas::texels(&scene, &scene.sample(0.0), &atlas);
                let used = texels.iter().filter(|texel| texel.triangle != NO_TRIANGLE).count() as f64 / texels.len() as f64;
                ("pipelines/bake/atlas.ron", (atlas.header.width as u32, atlas.header.height as u32), Some(Arc::new(atlas)), used)
            }
        };
        let picture = if let Domain::Cube { side } = task.domain { (side, side) } else { size };
        let documents = Documents::load(task.library.clone(), Path::new(pipeline))?;
        let eyes = cameras.into_iter().map(|camera| (camera, None)).collect();
        Ok(Self { gpu, task, documents, scene, size, picture, atlas, used_share, eyes, traced: 0, found: 0 })
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
        self.scene.sample(time).lights.iter().all(|light| light.strength == Vec3::ZERO)
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
        let plan = self.documents.plan(&plan_input(self.documents.pipeline(), &settings, &self.scene))?;
        let version = env!("CARGO_PKG_VERSION");
        let corners = self.atlas.as_ref().map(|atlas| &atlas.corners);
        // Faces of a cube are pictures as well: their number is in the size.
        let inputs = format!("{:016x} {time:?} {frames} {seed} {version} {width}×{height} {corners:?}", self.scene.hash);
        let name = facts::hash(&[&facts::fingerprint(&plan), &inputs]);
        let file = self.task.work.join(format!("{name}.exr"));
        if let Some(picture) = kept(&file, width as usize, height as usize) {
            self.found += 1;
            return Ok(picture);
        }
        let picture = self.pictures(&settings, "composed", (time, frames))?;
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
        self.pictures(&settings, "gbuffer_depth", (0.0, 1))
    }

    /// What all cameras see at a time after so many frames, put together in two rows if they are several.
    fn pictures(&mut self, settings: &Settings, resource: &str, (time, frames): (f64, u32)) -> Result<Picture, BakeError> {
        let mut pictures = Vec::with_capacity(self.eyes.len());
        for eye in 0..self.eyes.len() {
            let renderer = self.renderer(eye, settings.clone())?;
            for _ in 0..frames {
                renderer.render_frame(time)?;
                // Without waiting, all frames would be queued before the first is done.
                renderer.wait_timings();
            }
            pictures.push(read(renderer, resource)?);
        }
        Ok(if pictures.len() == 1 { pictures.remove(0) } else { in_two_rows(&pictures) })
    }

    fn settings(&self, light: Light, paths: u32, seed: u32) -> Settings {
        let set = [("component", light.component().to_owned()), ("paths", paths.to_string())];
        Settings {
            size: self.picture,
            set: set.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            keep: self.atlas.is_none().then(|| "gbuffer_depth".to_owned()).into_iter().collect(),
            seed,
            baked: self.atlas.clone(),
            ..Settings::default()
        }
    }

    /// The renderer of a camera, whose next frame is its first.
    fn renderer(&mut self, eye: usize, settings: Settings) -> Result<&mut Renderer, BakeError> {
        let (camera, known) = &mut self.eyes[eye];
        let renderer = match known.take() {
            Some(mut renderer) => {
                if renderer.settings().set != settings.set || renderer.settings().seed != settings.seed {
                    renderer.set(settings)?;
                }
                renderer.restart();
                renderer
            }
            None => {
                let mut scene = self.scene.clone();
                scene.camera = camera.clone();
                Renderer::with(self.gpu, self.documents.clone(), self.task.source.clone(), scene, settings)?
            }
        };
        Ok(known.insert(renderer))
    }
}

/// The cameras whose pictures are a key frame.
fn cameras(scene: &Scene, domain: Domain) -> Result<Vec<Track<CameraPose>>, BakeError> {
    let keys = scene.camera.keys();
    let origin = keys[0].1.origin;
    match domain {
        Domain::Picture { .. } if scene.camera.moves() => Err(BakeError::Input(format!(
            "the camera of `{}` moves, and a picture is for one that stands still: bake with --lookup cube for one that only turns, or with --lookup atlas",
            scene.name
        ))),
        Domain::Cube { .. } if keys.iter().any(|key| key.1.origin != origin) => Err(BakeError::Input(format!(
            "the camera of `{}` goes from place to place, and a cube is for one that only turns: bake with --lookup atlas",
            scene.name
        ))),
        Domain::Cube { side } => {
            Ok([Vec3::X, Vec3::Y, Vec3::Z].into_iter().flat_map(|axis| [axis, -axis]).map(|axis| face(origin, axis, side)).collect())
        }
        _ => Ok(vec![scene.camera.clone()]),
    }
}

/// The camera of a cube's face. `precomputed/cube` finds directions on it.
fn face(origin: Vec3, axis: Vec3, side: u32) -> Track<CameraPose> {
    let side = f64::from(side);
    let fov_x_deg = (2.0 * (side / (side - 2.0 * FACE_BORDER)).atan()).to_degrees() as f32;
    let up = if axis.y == 0.0 { Vec3::Y } else { Vec3::Z };
    Track::fixed(CameraPose { origin, target: origin + axis, up, fov_x_deg })
}

/// Pictures of one size side by side, half of them below the others.
fn in_two_rows(pictures: &[Picture]) -> Picture {
    let (width, height, channels) = (pictures[0].width, pictures[0].height, pictures[0].channels());
    let columns = pictures.len() / 2;
    let rows = pictures.chunks(columns).flat_map(|row| {
        (0..height).flat_map(move |y| row.iter().flat_map(move |picture| &picture.data[y * width * channels..(y + 1) * width * channels]))
    });
    Picture { width: columns * width, height: 2 * height, data: rows.copied().collect(), ..pictures[0].clone() }
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
