//! Why there is no frame.

use manylight_gpu::{BadNumbers, Fault, RunError};
use manylight_graph::diagnostics::{Diagnostic, Diagnostics};
use thiserror::Error;

/// Why there is no frame.
#[derive(Debug, Clone, Error)]
pub enum RenderError {
    /// Documents, shaders or parameters are at fault, or do not fit the device.
    #[error("{0}")]
    Documents(Diagnostics),
    /// The frame could not be run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// The frame is there and can be read, but numbers in it are bad (`Debug::watch_numbers`).
    #[error("{}", bad_numbers(*.frame, .found).render().trim_end())]
    Numbers {
        /// Which frame, counted from the first.
        frame: u32,
        /// What was found, in the order of execution: what comes first is likely the cause of the rest.
        found: Vec<BadNumbers>,
    },
}

impl RenderError {
    /// As diagnostics for people.
    pub fn diagnostics(self) -> Diagnostics {
        match self {
            Self::Documents(diagnostics) => diagnostics,
            Self::Run(error) => Diagnostics(vec![Diagnostic::error_nowhere(error.to_string())]),
            Self::Numbers { frame, found } => bad_numbers(frame, &found),
        }
    }
}

/// Findings that are told of a frame.
const MOST_TOLD: usize = 4;

fn bad_numbers(frame: u32, found: &[BadNumbers]) -> Diagnostics {
    let mut all: Vec<Diagnostic> =
        found.iter().take(MOST_TOLD).map(|bad| Diagnostic::error_nowhere(format!("frame {frame}: {bad}"))).collect();
    let more = match found.len().saturating_sub(MOST_TOLD) {
        0 => String::new(),
        more => format!("; so do {more} resources or levels after it"),
    };
    if let Some(last) = all.pop() {
        let help = format!("the first of these is likely the cause of the rest{more}; `--dump RESOURCE=FILE` writes a resource whole");
        all.push(last.help(help));
    }
    Diagnostics(all)
}

impl From<Diagnostics> for RenderError {
    fn from(diagnostics: Diagnostics) -> Self {
        Self::Documents(diagnostics)
    }
}

impl From<Fault> for RenderError {
    fn from(fault: Fault) -> Self {
        Self::Documents(Diagnostics(vec![Diagnostic::error_nowhere(fault.to_string())]))
    }
}
