//! What is known of a scene already, in memory and on disk.

use std::{
    fmt,
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError},
};

use super::{MeasureOptions, Measures};
use crate::{files::fnv, scene::Scene};

/// Proportions of pictures are rounded to so many steps a doubling, so that a window that is dragged does not measure anew at each pixel.
const STEPS: f32 = 16.0;

/// Measures of a scene that were asked for, which all its clones share, and where they are kept.
#[derive(Clone, Default)]
pub(crate) struct Memo {
    folder: Option<PathBuf>,
    known: Arc<Mutex<Vec<Known>>>,
}

/// Measures, and what they were measured from.
type Known = (Fingerprint, MeasureOptions, Arc<Measures>);

/// Tells scenes apart that were changed after they were loaded: all but the vertices of their meshes counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Fingerprint(pub(super) u64);

impl Fingerprint {
    pub(super) fn of(scene: &Scene) -> Self {
        let parts = (&scene.objects, &scene.materials, &scene.lights, &scene.sun, &scene.camera, scene.meshes.len());
        Self(fnv(scene.hash, format!("{parts:?}").as_bytes()))
    }
}

/// Scenes are equal whatever is known of them.
impl PartialEq for Memo {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Memo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Memo").field("folder", &self.folder).finish_non_exhaustive()
    }
}

impl Scene {
    /// From now on keeps what is [measured](Scene::measured) in a folder, which is made when there is something to keep. Nothing there is needed: any of it may
    /// be deleted at any time.
    pub fn keep_measures_in(&mut self, folder: PathBuf) {
        self.memo.folder = Some(folder);
    }

    /// The measured features for pictures of width / height = `aspect` (to a sixteenth of a doubling), as [`Scene::measure`] has them by default. Measured when
    /// asked for the first time, then known.
    pub fn measured(&self, aspect: f32) -> Arc<Measures> {
        // A picture without a side has no proportions.
        let aspect = Some(aspect.log2()).filter(|log| log.is_finite()).map_or(1.0, |log| ((log * STEPS).round() / STEPS).exp2());
        let options = MeasureOptions { aspect, cache: self.memo.folder.clone(), ..MeasureOptions::default() };
        let fingerprint = Fingerprint::of(self);
        // Who else asks for the same waits for it; a thread that panicked left what was there.
        let mut known = self.memo.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, _, measures)) = known.iter().find(|(of, with, _)| *of == fingerprint && *with == options) {
            return Arc::clone(measures);
        }
        let measures = Arc::new(self.measure(&options));
        known.push((fingerprint, options, Arc::clone(&measures)));
        measures
    }
}
