//! What ends a command early, and the exit code that goes with it.

use manylight_graph::diagnostics::{Diagnostic, Diagnostics};
use thiserror::Error;

/// Why a command did not do what it was asked to.
#[derive(Debug, Error)]
pub enum Fault {
    /// A document, shader, scene or file is at fault: exit code 1. The text is ready to be shown.
    #[error("{0}")]
    Input(String),
    /// Faults in documents and shaders, with their places: exit code 1.
    #[error("{0}")]
    Documents(Diagnostics),
    /// The command line itself is at fault: exit code 2.
    #[error("{0}")]
    Usage(String),
    /// No adapter can be used: exit code 3. The text says what to install.
    #[error("{0}")]
    NoGpu(String),
    /// The fault has been printed already: exit code 1.
    #[error("")]
    Reported,
}

impl Fault {
    /// The exit code of the process: 1 input, 2 usage, 3 no usable GPU.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) | Self::Documents(_) | Self::Reported => 1,
            Self::Usage(_) => 2,
            Self::NoGpu(_) => 3,
        }
    }

    /// The text for the terminal, in the same shape for every kind.
    pub fn render(&self) -> String {
        match self {
            Self::Documents(diagnostics) => diagnostics.render(),
            Self::Reported => String::new(),
            Self::Input(text) | Self::Usage(text) | Self::NoGpu(text) => {
                Diagnostics(vec![Diagnostic::error_nowhere(text.clone())]).render()
            }
        }
    }
}

impl From<Diagnostics> for Fault {
    fn from(diagnostics: Diagnostics) -> Self {
        Self::Documents(diagnostics)
    }
}
