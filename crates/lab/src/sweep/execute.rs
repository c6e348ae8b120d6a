//! All runs of a sweep: what is done is kept, the rest is done and added.

use std::{
    collections::HashMap,
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use manylight_gpu::Gpu;

use super::{
    SweepError,
    plan::{Run, shard},
    prepare::Prepared,
    run::Bench,
};
use crate::{
    files::FileError,
    record::{self, Damage, Record},
};

/// File of the records of a whole sweep; those of parts lie beside it.
pub const RECORDS: &str = "records.jsonl";

/// Where things lie and what is to be done.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// Folder of records, pictures and report; it is made if it is not there.
    pub out: &'a Path,
    /// Folder of path-traced references.
    pub cache: &'a Path,
    /// Part (from 1) and number of parts.
    pub shard: Option<(usize, usize)>,
}

impl Options<'_> {
    fn file(&self) -> PathBuf {
        self.out.join(self.shard.map_or_else(|| RECORDS.to_owned(), |(part, parts)| format!("records-{part}-of-{parts}.jsonl")))
    }
}

/// What happens while a sweep is done.
#[derive(Debug)]
#[allow(missing_docs)]
pub enum Event<'a> {
    /// A line is no record: its run is done again.
    Damaged(&'a Damage),
    /// A run begins, from 0; `left`: the time that the rest will take if it goes on so.
    Start { run: &'a Run, index: usize, of: usize, kept: usize, left: Option<Duration> },
    /// A reference is being rendered.
    Reference { run: &'a Run, done: u32, of: u32 },
    /// A run is done and its record on the disk.
    Done { record: &'a Record, index: usize, of: usize },
    /// A run could not be done; the others go on.
    Failed { run: &'a Run, reason: &'a str },
}

/// What a sweep came to.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// Records of the sweep in its order, this time's and earlier ones'.
    pub records: Vec<Record>,
    /// Runs that had a record already.
    pub kept: usize,
    /// Runs that failed.
    pub failed: usize,
    /// Runs of the whole sweep without a record.
    pub missing: usize,
}

/// Does every run that has no record of the same inputs yet.
///
/// # Errors
/// A file cannot be read or written (a full disk); what was done until then is kept. A run that fails is told and left out.
pub fn execute(gpu: &Gpu, prepared: &Prepared, options: Options<'_>, on: &mut dyn FnMut(Event<'_>)) -> Result<Outcome, SweepError> {
    fs::create_dir_all(options.out).map_err(|e| FileError::write(options.out, &e))?;
    let file = options.file();
    let mut known = read_folder(options.out, on)?;
    // Without damaged lines, so that the next record starts a line of its own.
    rewrite(&file, prepared)?;
    let mut bench = Bench { gpu, prepared, out: options.out, cache: options.cache, references: HashMap::new() };
    let (part, parts) = options.shard.unwrap_or((1, 1));
    let own = shard(prepared.runs.clone(), part, parts);
    let mut todo = Vec::new();
    for run in &own {
        let inputs = bench.inputs(run)?;
        if !known.iter().any(|r| r.run == run.name && r.inputs == inputs) {
            todo.push((run, inputs));
        }
    }
    let mut outcome = Outcome { kept: own.len() - todo.len(), ..Outcome::default() };
    let (of, start) = (todo.len(), Instant::now());
    for (index, (run, inputs)) in todo.into_iter().enumerate() {
        let left = (index > 0).then(|| start.elapsed().mul_f64((of - index) as f64 / index as f64));
        on(Event::Start { run, index, of, kept: outcome.kept, left });
        match bench.run(run, inputs, &mut |done, of| on(Event::Reference { run, done, of })) {
            Ok(record) => {
                record::append(&file, &record)?;
                on(Event::Done { record: &record, index, of });
                known.retain(|old| old.run != record.run);
                known.push(record);
            }
            Err(SweepError::File(fault)) => return Err(fault.into()),
            Err(fault) => {
                outcome.failed += 1;
                on(Event::Failed { run, reason: &fault.to_string() });
            }
        }
    }
    rewrite(&file, prepared)?;
    outcome.records = in_order(known, &prepared.runs);
    outcome.missing = prepared.runs.len() - outcome.records.len();
    Ok(outcome)
}

/// The records of a sweep's runs in a folder, whatever they were made with; the newest of each run.
///
/// # Errors
/// A file cannot be read.
pub fn collect(folder: &Path, runs: &[Run], on: &mut dyn FnMut(Event<'_>)) -> Result<Vec<Record>, FileError> {
    Ok(in_order(read_folder(folder, on)?, runs))
}

/// All records of all files of a folder, oldest file first by name.
fn read_folder(folder: &Path, on: &mut dyn FnMut(Event<'_>)) -> Result<Vec<Record>, FileError> {
    let entries = fs::read_dir(folder).map_err(|e| FileError::read(folder, e))?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "jsonl"));
    files.sort();
    let mut all = Vec::new();
    for file in files {
        let (records, damaged) = record::read(&file)?;
        all.extend(records);
        damaged.iter().for_each(|damage| on(Event::Damaged(damage)));
    }
    Ok(all)
}

/// One record a run, in the order of the sweep; the newest by date.
fn in_order(records: Vec<Record>, runs: &[Run]) -> Vec<Record> {
    let mut newest: HashMap<String, Record> = HashMap::new();
    for record in records {
        match newest.get(&record.run) {
            Some(other) if other.date > record.date => {}
            _ => {
                newest.insert(record.run.clone(), record);
            }
        }
    }
    runs.iter().filter_map(|run| newest.remove(&run.name)).collect()
}

/// Brings a file of records into the order of the sweep: damaged lines and records that a newer one of the same run replaced go, those of
/// other sweeps stay, at the end.
fn rewrite(file: &Path, prepared: &Prepared) -> Result<(), FileError> {
    let (records, damaged) = record::read(file)?;
    let others: Vec<Record> = records.iter().filter(|r| !prepared.runs.iter().any(|run| run.name == r.run)).cloned().collect();
    let mut sorted = in_order(records.clone(), &prepared.runs);
    sorted.extend(others);
    if sorted == records && damaged.is_empty() {
        return Ok(());
    }
    record::write(file, &sorted)
}
