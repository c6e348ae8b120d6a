//! Counts the faults of a text file kind by kind, and makes one warning of each kind.

use std::{borrow::Cow, ops::Range, path::Path, sync::Arc};

use manylight_graph::diagnostics::{Diagnostic, Diagnostics, Severity, Source, Span};

/// A warning without a place.
pub(crate) fn nowhere(message: impl Into<String>) -> Diagnostic {
    Diagnostic { severity: Severity::Warning, ..Diagnostic::error_nowhere(message) }
}

/// A warning at a place if there is one.
fn warning(message: impl Into<String>, span: Option<Span>) -> Diagnostic {
    match span {
        Some(span) => Diagnostic::warning(message, span),
        None => nowhere(message),
    }
}

/// Texts up to this many bytes are kept for showing the line at fault; of longer ones only the line's number is told.
const LONGEST_TEXT_KEPT: usize = 4 << 20;

/// One kind of fault.
struct Fault {
    /// What is wrong with `count` things; `{}` stands for the count.
    message: Cow<'static, str>,
    help: &'static str,
    count: usize,
    first: Range<usize>,
}

/// The faults of one file.
#[derive(Default)]
pub(crate) struct Faults(Vec<Fault>);

impl Faults {
    /// Counts a fault; `message` has `{}` where the count goes and tells the kinds apart.
    pub(crate) fn add(&mut self, message: impl Into<Cow<'static, str>>, help: &'static str, place: Range<usize>) {
        let message = message.into();
        match self.0.iter_mut().find(|fault| fault.message == message) {
            Some(fault) => fault.count += 1,
            None => self.0.push(Fault { message, help, count: 1, first: place }),
        }
    }

    /// A warning for each kind that occurred.
    pub(crate) fn report(self, path: &Path, text: &str, warnings: &mut Diagnostics) {
        let kept = text.len() <= LONGEST_TEXT_KEPT && !self.0.is_empty();
        let source = kept.then(|| Arc::new(Source { name: path.display().to_string(), path: Some(path.to_owned()), text: text.into() }));
        for fault in self.0 {
            let said = fault.message.replace("{}", &fault.count.to_string());
            let line = 1 + text.as_bytes()[..fault.first.start].iter().filter(|byte| **byte == b'\n').count();
            let message = format!("`{}`, line {line}: {said}", path.display());
            let span = source.clone().map(|source| Span { source, range: fault.first });
            let label = if fault.count > 1 { "the first is here" } else { "" };
            warnings.0.push(warning(message, span).at(label).help(fault.help));
        }
    }
}
