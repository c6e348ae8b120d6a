//! Runs that their pipelines refuse: left out, and kept on the disk with their reasons, so that a report can say so.

use std::{fs, io::ErrorKind, path::Path};

use manylight_graph::diagnostics::Diagnostics;
use serde::{Deserialize, Serialize};

use super::document::Sweep;
use crate::files::{FileError, write_text};

/// File of refused runs, beside the records: one JSON object a line.
const REFUSED: &str = "refused.jsonl";

/// A run that its pipeline refuses.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Refused {
    /// The sweep's name.
    pub sweep: String,
    /// Name of the run.
    pub run: String,
    /// Why, with the values that led to it.
    pub reason: String,
}

impl Refused {
    pub(super) fn new(sweep: &Sweep, run: &str, refusals: &Diagnostics) -> Self {
        let reason = |fault: &manylight_graph::diagnostics::Diagnostic| {
            let values = fault.labels.first().map(|label| format!(" ({})", label.message)).unwrap_or_default();
            format!("{}{values}", fault.message)
        };
        let reasons: Vec<String> = refusals.0.iter().map(reason).collect();
        Self { sweep: sweep.name.clone(), run: run.to_owned(), reason: reasons.join("; ") }
    }
}

/// The refused runs of a sweep in a folder of records.
///
/// # Errors
/// The file is there, but cannot be read.
pub fn refused(folder: &Path, sweep: &Sweep) -> Result<Vec<Refused>, FileError> {
    Ok(read(folder)?.into_iter().filter(|refused| refused.sweep == sweep.name).collect())
}

/// Puts a sweep's refused runs in the place of those that it had.
pub(super) fn keep(folder: &Path, sweep: &Sweep, refused: &[Refused]) -> Result<(), FileError> {
    let known = read(folder)?;
    let others = known.iter().filter(|known| known.sweep != sweep.name);
    let all: Vec<&Refused> = others.chain(refused).collect();
    if all.iter().copied().eq(&known) {
        return Ok(());
    }
    let file = folder.join(REFUSED);
    let line = |refused: &Refused| serde_json::to_string(refused).map(|line| line + "\n");
    let text = all.into_iter().map(line).collect::<Result<String, _>>().map_err(|e| FileError::read(&file, e))?;
    write_text(&file, &text)
}

/// All lines that can be read: the others are made again.
fn read(folder: &Path) -> Result<Vec<Refused>, FileError> {
    let file = folder.join(REFUSED);
    match fs::read_to_string(&file) {
        Ok(text) => Ok(text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect()),
        Err(e) if e.kind() == ErrorKind::NotFound => Ok(Vec::new()),
        Err(e) => Err(FileError::read(&file, e)),
    }
}
