//! `manylight sweep`: many runs, their records and their report.

use std::{fs, path::PathBuf};

use manylight::{
    fault::Fault,
    files::{FileError, write_text},
    graph::library::Library,
    lab::{
        record::Record,
        report,
        sweep::{Event, Outcome, SceneUse, Sweep, collect, refused, shard},
    },
    library,
};

use super::{lab, note, of_file};
use crate::cli::{Cli, SweepArgs};

/// Runs what has not been run, then reports.
pub fn run(cli: &Cli, args: &SweepArgs) -> Result<(), Fault> {
    let library = library::open(cli.root.as_deref())?;
    let sweep = read(&library, args)?;
    if args.report {
        return report_only(&library, &sweep, args);
    }
    let prepared = lab::load(sweep, &library)?;
    if args.list {
        let (part, parts) = args.shard.unwrap_or((1, 1));
        let runs = shard(prepared.runs, part, parts);
        let lines: String = runs.iter().map(|run| format!("{}\n", run.name)).collect();
        return super::print(&lines);
    }
    let Outcome { records, kept, failed, missing } = lab::run(&prepared, &args.out, args.shard, &args.lab)?;
    let report = write(&prepared.sweep, &records, args)?;
    let total = prepared.runs.len();
    super::print(&format!("{} of {total} runs have records ({kept} were there already): {}\n", records.len(), report.display()))?;
    match (failed, missing) {
        (0, 0) => Ok(()),
        (0, missing) => {
            note(&format!("{missing} runs are still to be done: run the other parts, then the same command without --shard"));
            Ok(())
        }
        (failed, _) => Err(Fault::Input(format!("{failed} runs failed; the others are kept"))),
    }
}

/// The sweep with what the command line changes of it.
fn read(library: &Library, args: &SweepArgs) -> Result<Sweep, Fault> {
    let mut sweep = lab::read(library, &args.sweep, &args.lab)?;
    if args.reference.is_some() && args.scene.len() != 1 {
        return Err(Fault::Usage("--reference is the reference of one scene: give --scene once".to_owned()));
    }
    let mut scenes = Vec::new();
    for scene in &args.scene {
        // Told here if it is not there: the sweep's document is not at fault.
        library::scene(library, scene)?;
        let path = |file: &PathBuf| lab::given(&sweep, &file.to_string_lossy());
        let (reference, standard_error) = (args.reference.as_ref().map(path), args.standard_error.as_ref().map(path));
        scenes.push(SceneUse { scene: lab::given(&sweep, scene), reference, standard_error });
    }
    if !scenes.is_empty() {
        sweep.scenes = scenes;
    }
    Ok(sweep)
}

/// Table and report of the records that are there.
fn report_only(library: &Library, sweep: &Sweep, args: &SweepArgs) -> Result<(), Fault> {
    let (registry, _) = manylight::load_registry(library);
    let faults = sweep.check(library, &registry, &lab::find_scene(library));
    if faults.has_errors() {
        return Err(faults.into());
    }
    let refused = refused(&args.out, sweep).map_err(of_file)?;
    let runs = sweep.runs().len() - refused.len();
    let records = collect(&args.out, sweep, &mut |event| {
        if let Event::Damaged(damage) = event {
            note(&damage.to_string());
        }
    })
    .map_err(of_file)?;
    let file = write(sweep, &records, args)?;
    super::print(&format!("{} of {runs} runs have records: {}\n", records.len(), file.display()))
}

/// Writes the report, and the page of a book where that is asked for.
fn write(sweep: &Sweep, records: &[Record], args: &SweepArgs) -> Result<PathBuf, Fault> {
    if let Some(folder) = &args.markdown {
        let page = report::markdown(&lab::sheet(sweep, &args.out)?, records);
        fs::create_dir_all(folder).map_err(|e| of_file(FileError::write(folder, &e)))?;
        let text = (format!("{}.md", sweep.name), page.text);
        for (name, text) in page.figures.iter().chain([&text]) {
            write_text(&folder.join(name), text).map_err(of_file)?;
        }
    }
    lab::write_report(sweep, records, &args.out)
}
