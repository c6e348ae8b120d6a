//! What a scene is like, measured: how much light is blocked on its way, how much comes after many bounces, and so on. Pipelines leave out effects
//! that are known to be small.
//!
//! ```
//! use manylight_scene::{MeasureOptions, Scene};
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets");
//!
//! let scene = Scene::load(format!("{folder}/cornell_empty.ron"))?;
//! let measures = scene.measure(&MeasureOptions { samples: 1024, ..Default::default() });
//! let blocked = &measures["indirect_occlusion"];
//! assert!(blocked.value < 1e-3, "nothing blocks light in an empty box");
//! assert!(blocked.standard_error > 0.0, "no estimate is exact");
//! # Ok::<(), manylight_graph::diagnostics::Diagnostics>(())
//! ```
//!
//! | feature | what |
//! |---|---|
//! | `indirect_occlusion` | of the light of one bounce towards what the camera sees, the share that is blocked on its way from the lit surface |
//! | `direct_occlusion` | of the light of the lights that what the camera sees would reflect to it, the share that is blocked |
//! | `second_bounce` | of all light in the picture, the share of two and more bounces |
//! | `specular_energy` | of all light in the picture, the share that met a specular lobe at least once |
//! | `unseen_light` | of the flux that lit surfaces reflect by their matt part, the share that reaches nothing that the camera sees, or leaves the scene |
//! | `depth_spread` | standard deviation of the logarithm of the distance of what the camera sees |
//! | `lit_share` | of the texels of the reflective shadow map, the share that reflects light by its matt part |
//!
//! All light here is that of the lights, not of the sky, in the picture as the path tracer (`pipelines/reference.ron`) has it: Lambert and Blinn at
//! each surface, and a colour's light is the sum of red, green and blue. A share of nothing is 0 with error 0.
//!
//! In a scene that moves each feature is measured at several times, and counts where its value and twice its standard error come to most: a
//! pipeline is planned once for all times.
//!
//! # Errors
//!
//! Samples come in independent batches, each spread evenly over the picture, the lights and the directions. The standard error is the
//! jackknife's over the batches, and not less than what so many samples can tell from nothing: rarer things may not have been met. A ratio of
//! two estimates is off by about the square of its relative error, which is far below the error itself.
//!
//! Cost: some 15 rays a sample; by default 75 ms of processor time for a box of some tens of triangles, 400 ms for an atrium of 66,000, of which the
//! hierarchy takes 67 (`cargo bench -p manylight-scene --bench measure`). The same options give the same bits on the same machine,
//! whatever the number of threads.

mod cache;
mod light;
mod memo;
mod random;
mod sums;
mod times;
mod walk;
mod world;

use std::{
    collections::BTreeMap,
    ops::Index,
    path::PathBuf,
    sync::{
        Arc, OnceLock,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

use manylight_graph::features::Measured;

pub(crate) use self::memo::Memo;
use self::{
    sums::{Formula, Quantity, Sums},
    world::{Geometry, World},
};
use crate::{random::hash2, scene::Scene};

/// The features at each time in seconds.
type AtTimes = Vec<(f64, BTreeMap<String, Measured>)>;

/// How a measured feature follows from the samples; `manylight_graph::features::MEASURED` says what each is.
struct Feature {
    name: &'static str,
    formula: Formula,
}

const fn feature(name: &'static str, formula: Formula) -> Feature {
    Feature { name, formula }
}

/// All of them. Who changes what one of them means changes [`VERSION`].
const FEATURES: &[Feature] = &[
    feature("indirect_occlusion", Formula::Rest(Quantity::BounceReaching, Quantity::BounceSent)),
    feature("direct_occlusion", Formula::Rest(Quantity::DirectReaching, Quantity::DirectSent)),
    feature("second_bounce", Formula::Share(Quantity::Later, Quantity::All)),
    feature("specular_energy", Formula::Rest(Quantity::Matt, Quantity::All)),
    feature("unseen_light", Formula::Rest(Quantity::FluxSeen, Quantity::Flux)),
    feature("depth_spread", Formula::Spread),
    feature("lit_share", Formula::Share(Quantity::TexelsLit, Quantity::Texels)),
];

/// Of the estimators: measures in the cache are of one version.
const VERSION: u32 = 1;

/// Independent batches that the samples of a time come in.
const BATCHES: u32 = 32;
/// Of a scene that moves, each time has so much less samples than a scene that stands still.
const LESS_IN_MOTION: u32 = 2;

/// How a scene is measured.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasureOptions {
    /// Width over height of the picture that the camera sees.
    pub aspect: f32,
    /// Samples at the one time of a scene that stands still, and twice as many as at each time of one that moves. Rounded so that each
    /// of 32 batches has a power of two.
    pub samples: u32,
    /// Times of a scene that moves, from its first to its last key frame.
    pub times: u32,
    /// Of everything random.
    pub seed: u32,
    /// How many threads work; all that the machine has if it does not say.
    pub threads: Option<usize>,
    /// Folder where measures are kept by what they were measured from; not kept without one. Nothing there is needed: it may be deleted at any time.
    pub cache: Option<PathBuf>,
}

impl Default for MeasureOptions {
    /// A square picture, 16,384 samples (8192 at each of 8 times), no cache.
    fn default() -> Self {
        Self { aspect: 1.0, samples: 16_384, times: 8, seed: 0, threads: None, cache: None }
    }
}

/// The measured features of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Measures {
    /// By name, of the time at which the value and twice its standard error come to most.
    pub features: BTreeMap<String, Measured>,
    /// At each time in seconds.
    pub at_times: Vec<(f64, BTreeMap<String, Measured>)>,
}

impl Index<&str> for Measures {
    type Output = Measured;

    /// # Panics
    /// There is no such feature.
    fn index(&self, name: &str) -> &Measured {
        &self.features[name]
    }
}

impl Measures {
    fn of_times(at_times: AtTimes) -> Self {
        let mut features: BTreeMap<String, Measured> = BTreeMap::new();
        for (name, measured) in at_times.iter().flat_map(|(_, features)| features) {
            let most = features.entry(name.clone()).or_insert(*measured);
            if measured.at_most() > most.at_most() {
                *most = *measured;
            }
        }
        Self { features, at_times }
    }
}

impl Scene {
    /// Measures what the scene is like, or takes it from the cache. No scene makes it fail, and no cache: what cannot be read is measured, and what
    /// cannot be written is measured again the next time.
    pub fn measure(&self, options: &MeasureOptions) -> Measures {
        if let Some(kept) = cache::read(self, options) {
            return Measures::of_times(kept);
        }
        let measures = Measures::of_times(self.measure_now(options));
        cache::write(self, options, &measures.at_times);
        measures
    }

    fn measure_now(&self, options: &MeasureOptions) -> AtTimes {
        let times = times::of(self, options.times);
        let samples = if times.len() > 1 { options.samples / LESS_IN_MOTION } else { options.samples };
        let count = (samples / BATCHES).max(1).next_power_of_two();
        let mut geometry: Option<Arc<Geometry>> = None;
        let mut measure = |(number, time): (usize, f64)| {
            let state = self.sample(time);
            let now = geometry.take().filter(|geometry| geometry.holds_at(&state)).unwrap_or_else(|| Arc::new(Geometry::new(self, &state)));
            geometry = Some(Arc::clone(&now));
            let world = World::new(self, &state, now, options.aspect);
            let batches = all_batches(options.threads, |batch| {
                let seed = hash2(options.seed, number as u32 * BATCHES + batch);
                walk::batch(&world, seed, count)
            });
            (time, sums::estimate(&batches, world.is_glossy()))
        };
        times.into_iter().enumerate().map(&mut measure).collect()
    }
}

/// The sums of all batches, by as many threads as asked for: each batch is the work of one, whichever is free.
fn all_batches(threads: Option<usize>, batch: impl Fn(u32) -> Sums + Sync) -> Vec<Sums> {
    let threads = threads.unwrap_or_else(|| thread::available_parallelism().map_or(1, usize::from)).clamp(1, BATCHES as usize);
    let sums: Vec<OnceLock<Sums>> = (0..BATCHES).map(|_| OnceLock::new()).collect();
    let next = AtomicUsize::new(0);
    let work = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(slot) = sums.get(index) else { return };
            slot.get_or_init(|| batch(index as u32));
        }
    };
    thread::scope(|scope| {
        (1..threads).for_each(|_| {
            scope.spawn(work);
        });
        work();
    });
    sums.into_iter().map(|slot| slot.into_inner().unwrap_or(Sums::ZERO)).collect()
}
