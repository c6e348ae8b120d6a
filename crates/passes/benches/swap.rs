//! How long a user waits after choosing another option of a running pipeline, and what of it is kept.
//!
//! `cargo bench -p manylight-passes --bench swap [-- PIPELINE…]` in the repository; without names, every pipeline. A document that sets the
//! option is saved, as in `watch`: times are from there to the new picture at 128² with an RSM of 256², for each option of each choice and switch, one at a
//! time, when its shaders are first compiled and when they are known. Asserts nothing, because times depend on the machine.

mod common;

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use common::{Outcome, library_copy, report};
use manylight_gpu::{Gpu, GpuOptions, watch::Watcher};
use manylight_graph::{library::Library, value::ParamKind};
use manylight_passes::{Documents, ReloadReport, Renderer, SceneSource, Settings};

const SIDE: u32 = 128;
/// Side of the reflective shadow map, where there is one.
const RSM: &str = "256";
/// Frames before the first swap: clusters have settled somewhat, all memory is there.
const FRAMES: usize = 3;
/// No change takes longer to be told.
const PATIENCE: Duration = Duration::from_secs(10);

fn main() -> Outcome<()> {
    let (root, copy) = library_copy()?;
    let wanted: Vec<String> = std::env::args().skip(1).filter(|arg| !arg.starts_with('-')).collect();
    let scene = SceneSource::file(root.join("assets/cornell.ron"));
    let library = Library::new(Some(copy.path().to_owned()), Vec::new());
    let part = |path: &String| path["pipelines/".len()..].contains('/');
    let paths = library.list("pipelines", "ron").into_iter().filter(|path| !part(path));
    let names: Vec<String> = paths.filter_map(|path| Some(Path::new(&path).file_stem()?.to_string_lossy().into_owned())).collect();
    println!(
        "milliseconds from the saved document to the new picture at {SIDE}², RSM {RSM}²; kept and compiled: nodes; reset and kept: histories"
    );
    for name in names.iter().filter(|name| wanted.is_empty() || wanted.contains(name)) {
        // A device of its own: another pipeline's shaders are no help.
        let gpu = Gpu::new(&GpuOptions::default())?;
        let mut swaps = Swaps::new(&gpu, &library, copy.path(), name, scene.clone())?;
        println!("{name} on {} ({}), a frame of it takes {:.0} ms", gpu.adapter_info().name, gpu.kind(), millis(swaps.frame()?));
        swaps.all()?;
        report(&format!("{name}, to a new frame that is ready to run"), &mut swaps.ready);
        report(&format!("{name}, to a new picture, first"), &mut swaps.first);
        report(&format!("{name}, to a new picture, again"), &mut swaps.again);
    }
    Ok(())
}

struct Swaps {
    renderer: Renderer,
    watcher: Watcher,
    /// The document that is edited, and what it extends.
    document: PathBuf,
    pipeline: String,
    first: Vec<Duration>,
    again: Vec<Duration>,
    ready: Vec<Duration>,
}

impl Swaps {
    fn new(gpu: &Gpu, library: &Library, root: &Path, pipeline: &str, scene: SceneSource) -> Outcome<Self> {
        let document = root.join("pipelines/swap.ron");
        fs::write(&document, text(pipeline, ""))?;
        let documents = Documents::load(library.clone(), Path::new("swap"))?;
        let has_map = documents.pipeline().params.contains_key("rsm_size");
        let set = has_map.then(|| ("rsm_size".to_owned(), RSM.to_owned())).into_iter().collect();
        let settings = Settings { size: (SIDE, SIDE), set, ..Settings::default() };
        let loaded = scene.load()?;
        let renderer = Renderer::with(gpu, documents, scene, loaded, settings)?;
        let watcher = Watcher::new(renderer.watch_set())?;
        let (first, again, ready) = (Vec::new(), Vec::new(), Vec::new());
        let mut swaps = Self { renderer, watcher, document, pipeline: pipeline.to_owned(), first, again, ready };
        for _ in 0..FRAMES {
            swaps.frame()?;
        }
        Ok(swaps)
    }

    /// Time of a frame until its picture can be seen.
    fn frame(&mut self) -> Outcome<Duration> {
        let start = Instant::now();
        self.renderer.render_frame(0.0)?;
        let presents = self.renderer.pipeline().presents.text.clone();
        self.renderer.read(&presents)?;
        Ok(start.elapsed())
    }

    /// Saves values in the document and waits for the picture. `None` where they are refused.
    fn swap(&mut self, set: &str) -> Outcome<Option<(Duration, Duration, ReloadReport)>> {
        let saved = Instant::now();
        fs::write(&self.document, text(&self.pipeline, set))?;
        let mut changed: Vec<PathBuf> = Vec::new();
        while changed.is_empty() && saved.elapsed() < PATIENCE {
            changed = self.watcher.recv_timeout(Duration::from_secs(1));
        }
        match self.renderer.reload(&changed) {
            Ok(report) => {
                let frame = self.frame()?;
                Ok(Some((saved.elapsed(), frame, report)))
            }
            Err(faults) => {
                println!("  {set} is refused: {}", faults.0.first().map_or("", |fault| fault.message.as_str()));
                Ok(None)
            }
        }
    }

    /// To each option and back, twice.
    fn all(&mut self) -> Outcome<()> {
        let now = self.renderer.plan().params.clone();
        let options: Vec<String> = now
            .iter()
            .flat_map(|(name, value)| {
                let all = match &self.renderer.pipeline().params[name].kind {
                    ParamKind::Choice { options, .. } => options.iter().map(|option| (option.clone(), format!("{option:?}"))).collect(),
                    ParamKind::Bool { .. } => ["false", "true"].map(|on| (on.to_owned(), on.to_owned())).to_vec(),
                    _ => Vec::new(),
                };
                let current = value.to_string();
                let others = all.into_iter().filter(move |(option, _)| *option != current);
                others.map(|(_, literal)| format!("{name:?}: {literal}")).collect::<Vec<_>>()
            })
            .collect();
        for option in options {
            let Some((first, frame, report)) = self.swap(&option)? else { continue };
            self.swap("")?;
            let Some((again, _, _)) = self.swap(&option)? else { continue };
            self.swap("")?;
            let build = &report.build;
            println!(
                "  {option}: {:.0}, again {:.0}, of it a frame {:.0}; {} kept, {} compiled ({}); {} reset, {} kept",
                millis(first),
                millis(again),
                millis(frame),
                build.kept.len(),
                build.rebuilt.len(),
                build.rebuilt.join(", "),
                build.reset.len(),
                build.history_kept.len(),
            );
            self.first.push(first);
            self.again.push(again);
            self.ready.push(first.saturating_sub(frame));
        }
        Ok(())
    }
}

fn text(pipeline: &str, set: &str) -> String {
    format!("Pipeline(doc: \"A pipeline with one option changed.\", extends: \"{pipeline}.ron\", set: {{{set}}})\n")
}

fn millis(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
