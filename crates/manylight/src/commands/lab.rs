//! What `sweep` and `tune` share: loading, progress, the files that they write.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

use indicatif::ProgressBar;
use manylight::{
    SceneSource,
    fault::Fault,
    files::write_text,
    graph::{Spanned, diagnostics::Span, library::Library},
    lab::{
        metrics::Known,
        record::Record,
        report,
        sheet::Sheet,
        sweep::{Event, Options, Outcome, Prepared, Refused, Sweep, SweepError, execute, prepare},
    },
    library,
};

use super::{note, of_file};
use crate::{cli::LabArgs, progress};

/// The cache folder given, or `manylight/NAME` in the user's.
pub fn cache(given: Option<&PathBuf>, name: &str) -> Result<PathBuf, Fault> {
    if let Some(folder) = given {
        return Ok(folder.clone());
    }
    library::cache(name).ok_or_else(|| Fault::Input("there is no cache folder; name one with --cache or --records".to_owned()))
}

/// The sweep of that name, in the size and for the pictures that the command line asks for.
pub fn read(library: &Library, name: &str, args: &LabArgs) -> Result<Sweep, Fault> {
    let mut sweep = Sweep::read(&library::sweep(library, name)?, args.small)?;
    if let Some(size) = args.size {
        sweep.sizes = vec![size];
    }
    Ok(sweep)
}

/// Finds the scenes that sweeps name as the command line does.
pub fn find_scene(library: &Library) -> impl Fn(&str) -> Result<SceneSource, String> + '_ {
    |name| library::scene(library, name).map_err(|fault| fault.to_string())
}

/// Loads everything that a sweep names, and tells what of it is refused.
pub fn load(sweep: Sweep, library: &Library) -> Result<Prepared, Fault> {
    let prepared = prepare(sweep, library, &find_scene(library)).map_err(of_sweep)?;
    super::warn(&prepared.warnings);
    for Refused { run, reason, .. } in &prepared.refused {
        note(&format!("left out: {run}: {reason}"));
    }
    Ok(prepared)
}

/// A path of the command line: from the current folder, not from the sweep's.
pub fn given(sweep: &Sweep, name: &str) -> Spanned {
    let path = Path::new(name);
    let text =
        path.is_file().then(|| path.canonicalize().ok()).flatten().map_or_else(|| name.to_owned(), |p| p.to_string_lossy().into_owned());
    Spanned { text, span: Span::new(&sweep.source, 0..0) }
}

/// Does the runs and tells what happens.
pub fn run(prepared: &Prepared, out: &Path, shard: Option<(usize, usize)>, args: &LabArgs) -> Result<Outcome, Fault> {
    let cache = cache(args.cache.as_ref(), "references")?;
    let gpu = super::open_gpu(args.adapter.as_ref())?;
    note(&format!("adapter: {}", super::adapter_line(&gpu)));
    let mut teller = Teller { bar: progress::spinner("starting"), metric: prepared.sweep.metric.text.clone() };
    let outcome = execute(&gpu, prepared, Options { out, cache: &cache, shard }, &mut |event| teller.tell(&event)).map_err(of_sweep)?;
    teller.bar.finish_and_clear();
    Ok(outcome)
}

/// Tells what happens: a line a run, and between them on a terminal what is under way.
struct Teller {
    bar: ProgressBar,
    metric: String,
}

impl Teller {
    fn tell(&mut self, event: &Event<'_>) {
        match event {
            Event::Damaged(damage) => self.line(&format!("{damage}; its run is done again")),
            Event::Start { run, index, of, kept, left } => {
                if *index == 0 && *kept > 0 {
                    self.line(&format!("{kept} runs are done already"));
                }
                let left = left.map(|left| format!(", {} left", in_words(left))).unwrap_or_default();
                self.bar.set_message(format!("{}/{of} {}{left}", index + 1, run.name));
            }
            Event::Reference { run, done, of } => self.bar.set_message(format!("reference of {}: batch {done} of {of}", run.name)),
            Event::Done { record, index, of } => {
                let error = record.metrics.get(&self.metric).map_or("undefined".to_owned(), |value| format!("{value:.4}"));
                let title = Known::find(&self.metric).map_or(self.metric.as_str(), |known| known.title);
                let time = record.times.frame();
                let left_out = match record.not_finite {
                    0 => String::new(),
                    n => format!(" ({n} pixels are not finite in the image or the reference and do not count)"),
                };
                self.line(&format!("[{}/{of}] {}: {title} {error}, {time:.1} ms a frame{left_out}", index + 1, record.run));
            }
            Event::Failed { run, reason } => self.line(&format!("failed: {}\n{reason}", run.name)),
        }
    }

    fn line(&self, text: &str) {
        self.bar.suspend(|| note(text));
    }
}

fn in_words(time: Duration) -> String {
    let seconds = time.as_secs();
    if seconds < 90 { format!("{seconds} s") } else { format!("{} min", (seconds + 30) / 60) }
}

/// What the report says besides the records of a folder.
pub fn sheet(sweep: &Sweep, out: &Path) -> Result<Sheet, Fault> {
    let refused = manylight::lab::sweep::refused(out, sweep).map_err(of_file)?;
    Ok(Sheet {
        name: sweep.name.clone(),
        doc: sweep.doc.clone(),
        axis: sweep.axis,
        metric: sweep.metric.text.clone(),
        metrics: sweep.metrics.iter().map(|metric| metric.text.clone()).collect(),
        refused: refused.into_iter().map(|refused| (refused.run, refused.reason)).collect(),
        claims: sweep.claims.iter().map(|(claim, _)| claim.clone()).collect(),
        papers: sweep.papers.clone(),
        curves: sweep.curves.clone(),
    })
}

/// Writes table and report beside the records; returns the report's path.
pub fn write_report(sweep: &Sweep, records: &[Record], out: &Path) -> Result<PathBuf, Fault> {
    write_text(&out.join("runs.csv"), &report::csv(records)).map_err(of_file)?;
    let page = report::html(&sheet(sweep, out)?, records, &|name| fs::read(out.join(name)).ok());
    let file = out.join("report.html");
    write_text(&file, &page).map_err(of_file)?;
    Ok(file)
}

pub fn of_sweep(error: SweepError) -> Fault {
    match error {
        SweepError::Documents(diagnostics) => Fault::Documents(diagnostics),
        other => Fault::Input(other.to_string()),
    }
}
