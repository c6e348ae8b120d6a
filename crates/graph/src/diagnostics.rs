//! The one type for every fault and warning a user can cause, and its rendering with file, line, column and caret.

use std::{fmt, ops::Range, path::PathBuf, sync::Arc};

/// A text that diagnostics can point into.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// The name shown to the user: a path as they would type it.
    pub name: String,
    /// Where the text lies on disk; `None` when it is the copy embedded in the program.
    pub path: Option<PathBuf>,
    /// The whole text.
    pub text: Arc<str>,
}

/// A byte range of one source.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Span {
    /// The text pointed into.
    pub source: Arc<Source>,
    /// Bytes `start..end` of [`Source::text`].
    pub range: Range<usize>,
}

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The input can be used, but probably not as meant.
    Warning,
    /// The input cannot be used.
    Error,
}

/// A place and what is to be said about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    /// The place.
    pub span: Span,
    /// What to say at the caret; may be empty.
    pub message: String,
}

/// One fault or warning: what is wrong, where, and what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// Error or warning.
    pub severity: Severity,
    /// One sentence without a final stop.
    pub message: String,
    /// Places, the primary one first; empty when there is no text to point into.
    pub labels: Vec<Label>,
    /// The remedy, when there is one to name.
    pub help: Option<String>,
}

/// Faults and warnings of one operation, in the order of their places.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Diagnostics(pub Vec<Diagnostic>);

impl Diagnostic {
    /// An error at a place.
    pub fn error(message: impl Into<String>, span: Span) -> Self {
        Self { severity: Severity::Error, message: message.into(), labels: vec![Label { span, message: String::new() }], help: None }
    }

    /// An error that has no place in a text (a missing file, a command-line value).
    pub fn error_nowhere(message: impl Into<String>) -> Self {
        Self { severity: Severity::Error, message: message.into(), labels: Vec::new(), help: None }
    }

    /// A warning at a place.
    pub fn warning(message: impl Into<String>, span: Span) -> Self {
        Self { severity: Severity::Warning, ..Self::error(message, span) }
    }

    /// Says something at the primary place.
    #[must_use]
    pub fn at(mut self, message: impl Into<String>) -> Self {
        if let Some(first) = self.labels.first_mut() {
            first.message = message.into();
        }
        self
    }

    /// Adds a second place.
    #[must_use]
    pub fn and(mut self, span: Span, message: impl Into<String>) -> Self {
        self.labels.push(Label { span, message: message.into() });
        self
    }

    /// Adds the remedy.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl Diagnostics {
    /// Whether any of them is an error.
    pub fn has_errors(&self) -> bool {
        self.0.iter().any(|d| d.severity == Severity::Error)
    }
}

impl fmt::Display for Diagnostics {
    /// All of them as text for a terminal without colour.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.render())
    }
}

impl std::error::Error for Diagnostics {}
