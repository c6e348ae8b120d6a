//! Everything that a sweep needs, loaded and checked before the first run.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use manylight_graph::{
    Spanned,
    diagnostics::{Diagnostic, Diagnostics},
    library::Library,
};
use manylight_passes::{Documents, SceneSource, Settings, load_registry, plan_input};
use manylight_scene::Scene;

use super::{
    SweepError,
    check::{REFERENCE, SceneFinder},
    document::Sweep,
    plan::Run,
    reference::{self, Reference, Task},
    run::STANDARD_ERROR,
};

/// A sweep with its pipelines and scenes.
#[derive(Debug)]
pub struct Prepared {
    /// The sweep.
    pub sweep: Sweep,
    /// Its runs.
    pub runs: Vec<Run>,
    /// By variant.
    pub(super) documents: Vec<Documents>,
    pub(super) scenes: Vec<LoadedScene>,
    pub(super) reference: Documents,
}

#[derive(Debug)]
pub(super) struct LoadedScene {
    pub source: SceneSource,
    pub scene: Scene,
    /// Reference and its standard error on disk.
    pub files: Option<(PathBuf, Option<PathBuf>)>,
}

/// Loads pipelines and scenes and plans every run; needs no GPU. Faults are those of all of them.
///
/// # Errors
/// Faults of the sweep, of its pipelines and scenes, and of runs that cannot be planned.
pub fn prepare(sweep: Sweep, library: &Library, find: &SceneFinder<'_>) -> Result<Prepared, SweepError> {
    let (registry, faults) = load_registry(library);
    let mut out = sweep.check(library, &registry, find);
    let mut scenes = Vec::new();
    for entry in &sweep.scenes {
        let Ok(source) = sweep.scene(&entry.scene, find) else { continue };
        let path = |name: &Spanned| sweep.beside(&name.text);
        let files = entry.reference.as_ref().map(|reference| (path(reference), entry.standard_error.as_ref().map(path)));
        match source.load() {
            Ok(mut scene) => {
                if !sweep.light_path.is_empty()
                    && let Err(why) = scene.move_light(&sweep.light_path)
                {
                    out.push(Diagnostic::error(format!("the light cannot be moved: {why}"), entry.scene.span.clone()));
                }
                scenes.push(LoadedScene { source, scene, files });
            }
            Err(faults) => out.extend(faults),
        }
    }
    if out.has_errors() {
        return Err(out.sorted().into());
    }
    let open = |name: &Path| Documents::with(library.clone(), registry.clone(), faults.clone(), name);
    let documents = sweep.variants.iter().map(|v| open(&sweep.beside(&v.pipeline.text))).collect::<Result<Vec<_>, _>>()?;
    let prepared = Prepared { runs: sweep.runs(), documents, scenes, reference: open(Path::new(REFERENCE))?, sweep };
    prepared.plan_all()?;
    prepared.check_reference_files()?;
    Ok(prepared)
}

impl Prepared {
    /// Settings of a run.
    pub(super) fn settings(&self, run: &Run) -> Settings {
        let mut keep = vec![self.sweep.image_of(run.variant).text.clone()];
        keep.extend(self.sweep.mask.as_ref().map(|mask| mask.resource.text.clone()));
        let knows_its_noise = self.documents[run.variant].pipeline().resources.contains_key(STANDARD_ERROR);
        keep.extend(knows_its_noise.then(|| STANDARD_ERROR.to_owned()));
        keep.dedup();
        let set = run.set.iter().map(|(name, value)| (name.clone(), value.clone())).collect();
        Settings { size: run.size, set, keep, seed: run.seed, ..Settings::default() }
    }

    /// The path-traced reference of a run at a scene time.
    pub(super) fn task(&self, run: &Run, time: f64) -> Task<'_> {
        let LoadedScene { source, scene, .. } = &self.scenes[run.scene];
        Task { documents: &self.reference, source, scene, size: run.size, what: &self.sweep.reference, time }
    }

    fn plan_all(&self) -> Result<(), SweepError> {
        let mut faults = Diagnostics::default();
        for run in &self.runs {
            let input = plan_input(&self.settings(run), &self.scenes[run.scene].scene);
            match self.documents[run.variant].plan(&input) {
                Ok(plan) => {
                    let absent = |name: &&String| plan.resource(name).is_none();
                    if let Some(name) = self.settings(run).keep.iter().find(absent) {
                        let fault = Diagnostic::error(
                            format!("no node writes `{name}` in the run `{}`", run.name),
                            self.sweep.image_of(run.variant).span.clone(),
                        );
                        faults.push(fault.help("its conditions switch all nodes off that would: change the variant's settings"));
                    }
                }
                Err(own) => {
                    faults.push(Diagnostic::error_nowhere(format!("the run `{}` cannot be planned", run.name)));
                    faults.extend(own);
                    break;
                }
            }
        }
        if faults.is_empty() { Ok(()) } else { Err(faults.into()) }
    }

    fn check_reference_files(&self) -> Result<(), SweepError> {
        let mut seen = BTreeSet::new();
        for run in self.runs.iter().filter(|run| seen.insert((run.scene, run.size))) {
            self.reference_file(run).transpose()?;
        }
        Ok(())
    }

    /// The reference that a file holds, if the scene names one.
    pub(super) fn reference_file(&self, run: &Run) -> Option<Result<Reference, SweepError>> {
        let (file, standard_error) = self.scenes[run.scene].files.as_ref()?;
        Some(reference::from_file(file, standard_error.as_deref(), run.size))
    }
}
