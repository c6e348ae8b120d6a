//! All runs of a sweep: what is done is kept, the rest is done and added.

use std::{
    collections::{BTreeMap, HashMap},
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use manylight_gpu::Gpu;

use super::{
    SweepError,
    document::Sweep,
    plan::{Run, shard},
    prepare::Prepared,
    refused,
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

/// Does every run that has no record of the same inputs yet and is not refused. Without a part given, all records come to lie in [`RECORDS`], those of parts
/// as well.
///
/// # Errors
/// A file cannot be read or written (a full disk), or another process writes it; what was done until then is kept. A run that fails is
/// told and left out.
pub fn execute(gpu: &Gpu, prepared: &Prepared, options: Options<'_>, on: &mut dyn FnMut(Event<'_>)) -> Result<Outcome, SweepError> {
    fs::create_dir_all(options.out).map_err(|e| FileError::write(options.out, &e))?;
    let file = options.file();
    let _lock = lock(&file)?;
    refused::keep(options.out, &prepared.sweep, &prepared.refused)?;
    let mut bench = Bench { gpu, prepared, out: options.out, cache: options.cache, references: HashMap::new() };
    let mut inputs = HashMap::new();
    for run in &prepared.runs {
        inputs.insert(run.name.as_str(), bench.inputs(run)?);
    }
    let is_current = |record: &Record| record.sweep == prepared.sweep.name && inputs.get(record.run.as_str()) == Some(&record.inputs);
    let mut known = newest(read_folder(options.out, on)?.into_iter().filter(is_current));
    // Without damaged lines and with an end after the last, so that the next record starts a line of its own.
    tidy(&file, prepared, &[])?;
    let (part, parts) = options.shard.unwrap_or((1, 1));
    let own = shard(prepared.runs.clone(), part, parts);
    let todo: Vec<&Run> = own.iter().filter(|run| !known.contains_key(&run.name)).collect();
    let mut outcome = Outcome { kept: own.len() - todo.len(), ..Outcome::default() };
    let (of, start) = (todo.len(), Instant::now());
    for (index, run) in todo.into_iter().enumerate() {
        let left = (index > 0).then(|| start.elapsed().mul_f64((of - index) as f64 / index as f64));
        on(Event::Start { run, index, of, kept: outcome.kept, left });
        match bench.run(run, inputs[run.name.as_str()].clone(), &mut |done, of| on(Event::Reference { run, done, of })) {
            Ok(record) => {
                record::append(&file, &record)?;
                on(Event::Done { record: &record, index, of });
                known.insert(record.run.clone(), record);
            }
            Err(SweepError::File(fault)) => return Err(fault.into()),
            Err(fault) if gpu.lost().is_some() => {
                // The other runs would fail as well.
                return Err(SweepError::Render(format!("{fault}; the runs that are done are kept, and the same command does the others")));
            }
            Err(fault) => {
                outcome.failed += 1;
                on(Event::Failed { run, reason: &fault.to_string() });
            }
        }
    }
    outcome.records = prepared.runs.iter().filter_map(|run| known.remove(&run.name)).collect();
    outcome.missing = prepared.runs.len() - outcome.records.len();
    tidy(&file, prepared, if options.shard.is_none() { &outcome.records } else { &[] })?;
    Ok(outcome)
}

/// The records of a sweep's runs in a folder, whatever they were made with; the newest of each run.
///
/// # Errors
/// A file cannot be read.
pub fn collect(folder: &Path, sweep: &Sweep, on: &mut dyn FnMut(Event<'_>)) -> Result<Vec<Record>, FileError> {
    let mut known = newest(read_folder(folder, on)?.into_iter().filter(|record| record.sweep == sweep.name));
    Ok(sweep.runs().iter().filter_map(|run| known.remove(&run.name)).collect())
}

/// Keeps other processes from writing the same file; freed when it is dropped, also when the process is killed.
fn lock(file: &Path) -> Result<fs::File, SweepError> {
    let path = file.with_extension("lock");
    let lock = fs::File::create(&path).map_err(|e| FileError::write(&path, &e))?;
    match lock.try_lock() {
        Err(fs::TryLockError::WouldBlock) => {
            let text = format!("another process does a sweep in `{}`: wait for it, or do another part with --shard", file.display());
            Err(SweepError::Render(text))
        }
        // A file system that knows no locks has to do without.
        _ => Ok(lock),
    }
}

/// All records of all files of a folder.
fn read_folder(folder: &Path, on: &mut dyn FnMut(Event<'_>)) -> Result<Vec<Record>, FileError> {
    let entries = fs::read_dir(folder).map_err(|e| FileError::read(folder, e))?;
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    let holds_records = |file: &PathBuf| {
        file.file_name().is_some_and(|n| n.to_string_lossy().starts_with("records")) && file.extension().is_some_and(|e| e == "jsonl")
    };
    files.retain(holds_records);
    files.sort();
    let mut all = Vec::new();
    for file in files {
        let lines = record::read(&file)?;
        all.extend(lines.records);
        lines.damaged.iter().for_each(|damage| on(Event::Damaged(damage)));
    }
    Ok(all)
}

/// One record a run, by its name: the newest; of equally old ones, and where a clock was set back within a file, the later line.
fn newest(records: impl Iterator<Item = Record>) -> HashMap<String, Record> {
    let mut newest: HashMap<String, Record> = HashMap::new();
    for record in records {
        if newest.get(&record.run).is_none_or(|other| other.date <= record.date) {
            newest.insert(record.run.clone(), record);
        }
    }
    newest
}

/// Brings a file of records into the order of the sweep, with `more` added: damaged lines and records that a later line of the same run
/// replaced go, records of other sweeps and lines of other formats stay.
fn tidy(file: &Path, prepared: &Prepared, more: &[Record]) -> Result<(), FileError> {
    let lines = record::read(file)?;
    let place: HashMap<&str, usize> = prepared.runs.iter().enumerate().map(|(place, run)| (run.name.as_str(), place)).collect();
    let place = |record: &Record| (record.sweep == prepared.sweep.name).then(|| place.get(record.run.as_str()).copied()).flatten();
    let mut own: BTreeMap<usize, Record> = BTreeMap::new();
    let mut others = Vec::new();
    for record in lines.records.iter().chain(more).cloned() {
        match place(&record) {
            Some(place) => drop(own.insert(place, record)),
            None => others.push(record),
        }
    }
    let sorted: Vec<Record> = own.into_values().chain(others).collect();
    if sorted == lines.records && lines.damaged.is_empty() && lines.complete {
        return Ok(());
    }
    record::write(file, &sorted, &lines.foreign)
}
