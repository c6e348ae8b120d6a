//! What runs are compared with: a file, or the pipeline `reference`, rendered once and kept by the hash of what it was made from.

use std::{
    fs,
    path::{Path, PathBuf},
};

use manylight_gpu::{Gpu, Image};
use manylight_graph::plan::Plan;
use manylight_passes::{Documents, Renderer, SceneSource, Settings, plan_input};
use manylight_scene::Scene;
use serde_json::json;

use super::{SweepError, document::PathTraced};
use crate::{
    facts,
    files::{FileError, Picture, read_exr, write_exr, write_text},
    record::ReferenceFacts,
};

/// Its paths must not be those of a variant that traces paths as well.
const SEED: u32 = 0x7265_6665;
/// Frames are independent batches, whose spread gives the standard error. Few of many paths: those of one frame are spread evenly over the pixel.
const BATCHES: u32 = 8;
/// Most paths a pixel and frame that the pipeline takes.
const MOST_PATHS_A_FRAME: u32 = 256;

/// A picture to compare with.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    /// Linear radiance, R, G and B.
    pub picture: Picture,
    /// Standard error of each of its values, where known.
    pub standard_error: Option<Picture>,
    /// Batches that it is from, where known.
    pub batches: Option<u32>,
    pub facts: ReferenceFacts,
}

/// A reference that is to be path-traced, or is in the cache.
pub(super) struct Task<'a> {
    pub documents: &'a Documents,
    pub source: &'a SceneSource,
    pub scene: &'a Scene,
    pub size: (u32, u32),
    pub what: &'a PathTraced,
    /// Scene time in seconds.
    pub time: f64,
}

impl Task<'_> {
    /// Frames, and paths a pixel of each.
    fn batches(&self) -> (u32, u32) {
        let frames = self.what.paths.min(BATCHES).max(self.what.paths.div_ceil(MOST_PATHS_A_FRAME)).max(2);
        (frames, self.what.paths.div_ceil(frames))
    }

    fn settings(&self) -> Settings {
        let (_, paths) = self.batches();
        let set = [("component", self.what.component.text.clone()), ("paths", paths.to_string())];
        Settings {
            size: self.size,
            set: set.map(|(name, value)| (name.to_owned(), value)).to_vec(),
            keep: vec!["standard_error".to_owned()],
            seed: SEED,
            ..Settings::default()
        }
    }

    fn plan(&self) -> Result<Plan, SweepError> {
        Ok(self.documents.plan(&plan_input(self.documents.pipeline(), &self.settings(), self.scene))?)
    }

    /// Hash of everything that the picture depends on but the adapter, which changes only its rounding.
    pub fn hash(&self) -> Result<String, SweepError> {
        let (frames, _) = self.batches();
        let time = self.time;
        Ok(facts::hash(&[
            &facts::fingerprint(&self.plan()?),
            &format!("{:016x} {frames} {time:?} {SEED} {}", self.scene.hash, env!("CARGO_PKG_VERSION")),
        ]))
    }

    /// From the cache, or rendered and put there. `progress` is told the batches that are done and all of them.
    pub fn obtain(&self, gpu: &Gpu, cache: &Path, progress: &mut dyn FnMut(u32, u32)) -> Result<Reference, SweepError> {
        let hash = self.hash()?;
        let files = Files::new(cache, &hash);
        if let Some(kept) = files.read(self.size) {
            return Ok(self.reference(hash, kept));
        }
        let (frames, _) = self.batches();
        let documents = self.documents.clone();
        let mut renderer = Renderer::with(gpu, documents, self.source.clone(), self.scene.clone(), self.settings())?;
        for frame in 0..frames {
            progress(frame, frames);
            renderer.render_frame(self.time)?;
            // Without waiting, all frames would be queued before the first is done.
            renderer.wait_timings();
        }
        progress(frames, frames);
        let read = |name: &str| renderer.read(name).map(rgb).map_err(|e| SweepError::Render(e.to_string()));
        let pictures = (read("composed")?, read("standard_error")?);
        fs::create_dir_all(cache).map_err(|e| FileError::write(cache, &e))?;
        files.write(&pictures, &self.scene.name, &self.what.component.text, self.paths())?;
        Ok(self.reference(hash, pictures))
    }

    fn paths(&self) -> u64 {
        let (frames, paths) = self.batches();
        u64::from(frames) * u64::from(paths)
    }

    fn reference(&self, hash: String, (picture, standard_error): (Picture, Picture)) -> Reference {
        let facts = ReferenceFacts {
            name: self.what.component.text.clone(),
            hash,
            paths: Some(self.paths()),
            relative_standard_error: relative(&picture, &standard_error),
        };
        Reference { picture, standard_error: Some(standard_error), batches: Some(self.batches().0), facts }
    }
}

/// A texture's red, green and blue.
pub(super) fn rgb(image: Image) -> Picture {
    Picture::from(image).without_alpha()
}

/// Reads a reference from files.
pub(super) fn from_file(file: &Path, standard_error: Option<&Path>, size: (u32, u32)) -> Result<Reference, SweepError> {
    let picture = colours(file, size)?;
    let bytes = |file: &Path| fs::read(file).map_err(|e| FileError::read(file, e));
    let hash = facts::hash(&[&bytes(file)?, &standard_error.map(bytes).transpose()?.unwrap_or_default()]);
    // manylight's own have the number of batches in alpha.
    let batches = standard_error.map(read_exr).transpose()?.and_then(|error| error.layer("")).and_then(|error| batches_of(&error));
    let standard_error = standard_error.map(|file| colours(file, size)).transpose()?;
    let facts = ReferenceFacts {
        name: file.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        hash,
        paths: None,
        relative_standard_error: standard_error.as_ref().and_then(|error| relative(&picture, error)),
    };
    Ok(Reference { picture, standard_error, batches, facts })
}

/// The largest value of alpha, if there is one: the number of batches of a standard error.
pub(super) fn batches_of(error: &Picture) -> Option<u32> {
    let alpha = error.names.iter().position(|name| name == "A")?;
    let most = error.data.iter().skip(alpha).step_by(error.channels()).fold(0.0_f32, |most, n| most.max(*n));
    Some(most as u32)
}

fn colours(file: &Path, size: (u32, u32)) -> Result<Picture, FileError> {
    let picture = read_exr(file)?;
    let picture = picture.layer("").filter(|p| p.names.starts_with(&["R".into(), "G".into(), "B".into()]));
    let picture = picture.ok_or_else(|| FileError::read(file, "it has no channels R, G and B"))?.without_alpha();
    if (picture.width, picture.height) != (size.0 as usize, size.1 as usize) {
        let reason =
            format!("it is {}×{}, the runs are {}×{}: give a reference of that size", picture.width, picture.height, size.0, size.1);
        return Err(FileError::read(file, reason));
    }
    Ok(picture)
}

/// Root of the mean squared standard error over the mean.
fn relative(picture: &Picture, standard_error: &Picture) -> Option<f64> {
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, n) = values.filter(|v| v.is_finite()).fold((0.0, 0.0), |(sum, n), v| (sum + v, n + 1.0));
        sum / f64::max(n, 1.0)
    };
    let mean_picture = mean(&mut picture.data.iter().map(|v| f64::from(*v)));
    let squares = mean(&mut standard_error.data.iter().map(|v| f64::from(*v).powi(2)));
    (mean_picture > 0.0).then(|| squares.sqrt() / mean_picture)
}

/// Files of the cache.
struct Files {
    picture: PathBuf,
    standard_error: PathBuf,
    about: PathBuf,
}

impl Files {
    fn new(cache: &Path, hash: &str) -> Self {
        let file = |end: &str| cache.join(format!("{hash}{end}"));
        Self { picture: file(".exr"), standard_error: file("_stderr.exr"), about: file(".json") }
    }

    /// What is kept; `None` if it is not there or damaged: then it is made anew.
    fn read(&self, size: (u32, u32)) -> Option<(Picture, Picture)> {
        Some((colours(&self.picture, size).ok()?, colours(&self.standard_error, size).ok()?))
    }

    fn write(&self, pictures: &(Picture, Picture), scene: &str, component: &str, paths: u64) -> Result<(), FileError> {
        let about = json!({"scene": scene, "component": component, "paths": paths, "manylight": env!("CARGO_PKG_VERSION")});
        write_text(&self.about, &format!("{about:#}\n"))?;
        write_exr(&self.standard_error, &pictures.1)?;
        // Last: where this one is, the others are.
        write_exr(&self.picture, &pictures.0)
    }
}
