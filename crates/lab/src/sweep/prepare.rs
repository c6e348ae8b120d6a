//! Everything that a sweep needs, loaded and checked before the first run.

use std::{
    collections::{HashMap, hash_map::Entry},
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
    refused::Refused,
    run::STANDARD_ERROR,
};

/// Faults of single runs are told until there are so many.
const MOST_FAULTS: usize = 20;

/// A sweep with its pipelines and scenes.
#[derive(Debug)]
pub struct Prepared {
    /// The sweep.
    pub sweep: Sweep,
    /// Its runs, without those that are refused.
    pub runs: Vec<Run>,
    /// Runs that their pipelines refuse.
    pub refused: Vec<Refused>,
    /// What was mended in scenes.
    pub warnings: Diagnostics,
    /// By variant.
    pub(super) documents: Vec<Documents>,
    pub(super) scenes: Vec<LoadedScene>,
    pub(super) reference: Documents,
    /// Those that are files, by scene and size.
    references: HashMap<(usize, (u32, u32)), Reference>,
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
/// Faults of the sweep, of its pipelines and scenes, and of runs that cannot be planned; every run is refused.
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
                out.extend(scene.warnings.clone());
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
    let (runs, reference) = (sweep.runs(), open(Path::new(REFERENCE))?);
    let mut prepared =
        Prepared { sweep, runs, refused: Vec::new(), warnings: out, documents, scenes, reference, references: HashMap::new() };
    prepared.plan_all()?;
    prepared.read_references()?;
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

    /// Plans every run, and sets those apart that are refused.
    fn plan_all(&mut self) -> Result<(), SweepError> {
        let (mut faults, mut refusals) = (Diagnostics::default(), Diagnostics::default());
        for run in std::mem::take(&mut self.runs) {
            let scene = &self.scenes[run.scene].scene;
            let documents = &self.documents[run.variant];
            let input = plan_input(documents.pipeline(), &self.settings(&run), scene);
            let own = documents.refusals(&input);
            if !own.is_empty() {
                self.refused.push(Refused::new(&self.sweep, &run.name, &own));
                refusals.extend(own);
                continue;
            }
            match documents.plan(&input) {
                Ok(plan) => {
                    let wanted =
                        std::iter::once(self.sweep.image_of(run.variant)).chain(self.sweep.mask.as_ref().map(|mask| &mask.resource));
                    for name in wanted.filter(|name| plan.resource(&name.text).is_none()) {
                        let fault =
                            Diagnostic::error(format!("no node writes `{}` in the run `{}`", name.text, run.name), name.span.clone());
                        faults.push(fault.help("its conditions switch all nodes off that would: change the variant's settings"));
                    }
                }
                Err(own) => {
                    faults.push(Diagnostic::error_nowhere(format!("the run `{}` cannot be planned", run.name)));
                    faults.extend(own);
                }
            }
            if faults.0.len() > MOST_FAULTS {
                break;
            }
            self.runs.push(run);
        }
        if self.runs.is_empty() && faults.is_empty() {
            faults.push(Diagnostic::error_nowhere(format!("every run of the sweep `{}` is refused", self.sweep.name)));
            faults.extend(refusals.0.into_iter().next().map(Diagnostics::from).unwrap_or_default());
        }
        if faults.is_empty() { Ok(()) } else { Err(faults.into()) }
    }

    fn read_references(&mut self) -> Result<(), SweepError> {
        for run in &self.runs {
            let Some((file, standard_error)) = &self.scenes[run.scene].files else { continue };
            if let Entry::Vacant(entry) = self.references.entry((run.scene, run.size)) {
                entry.insert(reference::from_file(file, standard_error.as_deref(), run.size)?);
            }
        }
        Ok(())
    }

    /// The reference that a file holds, if the scene names one.
    pub(super) fn reference_file(&self, run: &Run) -> Option<&Reference> {
        self.references.get(&(run.scene, run.size))
    }
}
