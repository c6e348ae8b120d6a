//! Precomputed indirect light ([PCA]): key frames by the path tracer, their principal components, and the file of both.
//!
//! `tracer` makes key frames and keeps them on disk, `schedule` says when they are, [`Pca`] finds their components, `encode` puts all into a
//! [`Baked`]; `study` measures what components and intervals cost.

mod atlas;
mod encode;
mod pca;
mod schedule;
mod study;
mod tracer;

use manylight_graph::diagnostics::Diagnostics;
use manylight_passes::Baked;
use thiserror::Error;

pub use atlas::atlas;
pub use encode::{Keep, decode};
pub use pca::Pca;
pub use schedule::{Criterion, Schedule, bisect, uniform};
pub use study::{Study, Table, study};
pub use tracer::{Domain, Light, SEED, Task, Tracer, make_work};

use crate::{
    files::{FileError, Picture, Tone},
    metrics::{CompareError, compare, display, exposure_of},
};
use encode::{Parts, encode, header};

/// Why light could not be baked.
#[derive(Debug, Error)]
pub enum BakeError {
    /// Documents, shaders or the scene are at fault.
    #[error("{0}")]
    Documents(Diagnostics),
    /// The scene or the options do not fit.
    #[error("{0}")]
    Input(String),
    /// A frame could not be run.
    #[error("{0}")]
    Render(String),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Two frames could not be compared.
    #[error(transparent)]
    Compare(#[from] CompareError),
}

/// How light is put into a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// When key frames are.
    pub schedule: Schedule,
    /// After this time everything repeats, seconds.
    pub period_s: f64,
    /// How many components are kept.
    pub keep: Keep,
    /// Whether the mean of the key frames is taken off before their components are found.
    pub subtract_mean: bool,
}

/// What happens while light is baked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A key frame is about to be traced or found; of all, where their number is known.
    Frame {
        /// Its time in seconds.
        time: f64,
        /// Frames before it.
        index: usize,
        /// All frames of a uniform schedule.
        of: Option<usize>,
    },
    /// The components are about to be found.
    Components,
}

/// Traces key frames and puts them into a file's contents.
///
/// # Errors
/// A frame could not be traced or kept; a scene whose light cannot be baked.
pub fn bake(tracer: &mut Tracer<'_>, options: &Options, tell: &mut dyn FnMut(Event)) -> Result<Baked, BakeError> {
    let keys = keys(tracer, options, tell)?;
    let (mut frames, mut lit) = (Vec::new(), Vec::new());
    for (index, time) in keys.iter().enumerate() {
        tell(Event::Frame { time: *time, index, of: Some(keys.len()) });
        let dark = tracer.is_dark(*time);
        lit.push((!dark).then_some(frames.len()));
        if !dark {
            frames.push(tracer.frame(Light::Indirect, *time, tracer.task().paths, SEED)?);
        }
    }
    tell(Event::Components);
    let slices: Vec<&[f32]> = frames.iter().map(|frame| frame.data.as_slice()).collect();
    if slices.is_empty() {
        return Err(BakeError::Input(format!("no light of `{}` shines at any key frame", tracer.scene().name)));
    }
    let pca = Pca::of(&slices, options.subtract_mean);
    encoded(tracer, options, &pca, &keys, &lit)
}

/// Times of the key frames; a bisection looks at frames to find them.
fn keys(tracer: &mut Tracer<'_>, options: &Options, tell: &mut dyn FnMut(Event)) -> Result<Vec<f64>, BakeError> {
    match options.schedule {
        Schedule::Uniform { interval_s } => Ok(uniform(options.period_s, interval_s)),
        Schedule::Bisection { shortest_s, longest_s, threshold, criterion } => {
            let paths = tracer.task().paths;
            let exposure = exposure_of(&tracer.frame(Light::Indirect, 0.5 * options.period_s, paths, SEED)?);
            let eye = Eye { exposure, used: tracer.used_share() };
            let mut index = 0;
            let frame = |time: f64| {
                tell(Event::Frame { time, index, of: None });
                index += 1;
                tracer.frame(Light::Indirect, time, paths, SEED)
            };
            bisect(
                options.period_s,
                (shortest_s, longest_s, threshold, criterion),
                frame,
                |a, b| mixed(a, b, 0.5),
                |a, b| eye.difference(a, b),
            )
        }
    }
}

/// The file's contents from components of the lit key frames.
fn encoded(tracer: &mut Tracer<'_>, options: &Options, pca: &Pca, keys: &[f64], lit: &[Option<usize>]) -> Result<Baked, BakeError> {
    let paths = tracer.task().paths;
    // At noon the sky is brightest; its light by day is what is stored.
    let noon = 0.5 * options.period_s;
    let daylight = tracer.scene().daylight(noon) as f32;
    let mut sky = tracer.frame(Light::Sky, noon, paths, SEED)?;
    if daylight > 0.0 {
        sky.data.iter_mut().for_each(|v| *v /= daylight);
    }
    let distance = if tracer.atlas().is_none() { Some(tracer.distance()?) } else { None };
    let header = header(tracer.scene(), tracer.task().domain.lookup(), options.period_s, options.subtract_mean, paths);
    let corners = tracer.atlas().map_or(&[][..], |atlas| &atlas.corners);
    let parts = Parts { keys, lit, sky: &sky, distance: distance.as_ref(), corners, header };
    Ok(encode(pca, options.keep, parts))
}

/// A frame between two.
fn mixed(a: &Picture, b: &Picture, alpha: f32) -> Picture {
    let data = a.data.iter().zip(&b.data).map(|(a, b)| (1.0 - alpha) * a + alpha * b).collect();
    Picture { data, ..a.clone() }
}

/// How frames are looked at.
#[derive(Debug, Clone, Copy)]
struct Eye {
    /// One for the whole day: the eye does not adapt from frame to frame.
    exposure: f32,
    /// Share of the texels that stand for a surface; the others are black in all frames.
    used: f64,
}

impl Eye {
    /// Mean FLIP of two frames over the texels that are used.
    fn difference(&self, image: &Picture, reference: &Picture) -> Result<f64, BakeError> {
        let shown = |picture: &Picture| {
            let data = display(picture, self.exposure).iter().map(|v| f32::from(*v) / 255.0).collect();
            Picture { tone: Tone::Display, data, ..picture.clone() }
        };
        Ok(compare(&shown(image), &shown(reference))?.flip.unwrap_or(0.0) / self.used)
    }
}
