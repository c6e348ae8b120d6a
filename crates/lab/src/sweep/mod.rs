//! Sweeps: one document, many runs, a record each.
//!
//! `document` reads the RON, `check` compares it with pipelines and scenes, `plan` lists the runs, `refused` keeps those that make no sense, `reference` makes or finds what they are
//! compared with, `run` does one run, [`execute`] all of them and keeps what is done.

mod check;
mod document;
mod execute;
mod extras;
mod plan;
mod prepare;
mod reference;
mod refused;
mod run;

use thiserror::Error;

use manylight_graph::diagnostics::Diagnostics;
use manylight_passes::RenderError;

pub use check::SceneFinder;
pub use document::{Knob, MaskUse, PathTraced, SceneUse, Sequence, Sweep, Variant, Zip};
pub use execute::{Event, Options, Outcome, RECORDS, collect, execute};
pub use plan::{Run, shard};
pub use prepare::{Prepared, prepare};
pub use refused::{Refused, refused};

use crate::{files::FileError, metrics::CompareError};

/// Why a sweep, or a run of it, could not be done.
#[derive(Debug, Error)]
pub enum SweepError {
    /// Documents, shaders, scenes or parameters are at fault.
    #[error("{0}")]
    Documents(Diagnostics),
    /// A frame could not be run.
    #[error("{0}")]
    Render(String),
    /// A file could not be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Image and reference do not fit.
    #[error(transparent)]
    Compare(#[from] CompareError),
}

impl From<Diagnostics> for SweepError {
    fn from(diagnostics: Diagnostics) -> Self {
        Self::Documents(diagnostics)
    }
}

impl From<RenderError> for SweepError {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Documents(diagnostics) => Self::Documents(diagnostics),
            error => Self::Render(error.to_string()),
        }
    }
}
