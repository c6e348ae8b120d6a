//! Diagnostics as text (through codespan-reporting) and as JSON; sorting; nearest names.

use std::{collections::HashMap, fmt::Write as _, ops::Range, sync::Arc};

use codespan_reporting::{
    diagnostic as codespan,
    files::SimpleFiles,
    term::{self, Chars, Config},
};
use serde_json::{Value as Json, json};

use crate::diagnostics::{Diagnostic, Diagnostics, Severity, Source, Span};

/// A line longer than this is named but not printed.
const LONGEST_SHOWN_LINE: usize = 400;
/// More faults than this are counted but not printed.
const MOST_SHOWN: usize = 200;

impl Source {
    /// Line and column (both from 1, columns in characters) of a byte offset.
    pub fn place(&self, offset: usize) -> (usize, usize) {
        let offset = floor_boundary(&self.text, offset);
        let before = &self.text[..offset];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

impl Span {
    /// A span of a source.
    pub fn new(source: &Arc<Source>, range: Range<usize>) -> Self {
        Self { source: Arc::clone(source), range }
    }

    /// The text it covers.
    pub fn text(&self) -> &str {
        let range = clamp(&self.source.text, &self.range);
        &self.source.text[range]
    }
}

impl Diagnostics {
    /// Whether there is nothing to say.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Adds one.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        self.0.push(diagnostic);
    }

    /// Adds all of another operation.
    pub fn extend(&mut self, other: Diagnostics) {
        self.0.extend(other.0);
    }

    /// Sorts by file, place and severity, and leaves out repetitions.
    #[must_use]
    pub fn sorted(mut self) -> Self {
        let key = |d: &Diagnostic| match d.labels.first() {
            Some(label) => (1, label.span.source.name.clone(), label.span.range.start),
            None => (0, String::new(), 0),
        };
        self.0.sort_by_cached_key(|d| (key(d), std::cmp::Reverse(d.severity)));
        self.0.dedup();
        self
    }

    /// All of them as text without colour: `error: …`, `--> file:line:column`, the line with a caret, `= help: …`.
    pub fn render(&self) -> String {
        let mut files = SimpleFiles::new();
        let mut ids: HashMap<*const Source, usize> = HashMap::new();
        let config = Config { chars: Chars::ascii(), ..Config::default() };
        let mut text = String::new();
        for diagnostic in self.0.iter().take(MOST_SHOWN) {
            if diagnostic.labels.iter().any(|label| longest_line(&label.span) > LONGEST_SHOWN_LINE) {
                render_without_snippet(&mut text, diagnostic);
                continue;
            }
            let mut shown = match diagnostic.severity {
                Severity::Error => codespan::Diagnostic::error(),
                Severity::Warning => codespan::Diagnostic::warning(),
            };
            shown.message.clone_from(&diagnostic.message);
            for (index, label) in diagnostic.labels.iter().enumerate() {
                let source = &label.span.source;
                let id = *ids.entry(Arc::as_ptr(source)).or_insert_with(|| files.add(source.name.clone(), Arc::clone(&source.text)));
                let range = clamp(&source.text, &label.span.range);
                let style = if index == 0 { codespan::LabelStyle::Primary } else { codespan::LabelStyle::Secondary };
                shown.labels.push(codespan::Label::new(style, id, range).with_message(&label.message));
            }
            if let Some(help) = &diagnostic.help {
                shown.notes.push(format!("help: {help}"));
            }
            match term::emit_into_string(&config, &files, &shown) {
                Ok(block) => text.push_str(&block),
                Err(_) => render_without_snippet(&mut text, diagnostic),
            }
            if !text.ends_with("\n\n") {
                text.push('\n');
            }
        }
        if let Some(more) = self.0.len().checked_sub(MOST_SHOWN).filter(|more| *more > 0) {
            let _ = writeln!(text, "and {more} more, which are not shown");
        }
        while text.ends_with("\n\n") {
            text.pop();
        }
        text
    }

    /// An array of objects: `severity`, `message`, `help`, and `labels` with `file`, `line`, `column`, `end_line`, `end_column`, `start`, `end`, `message`.
    pub fn to_json(&self) -> Json {
        let label = |label: &crate::diagnostics::Label| {
            let range = clamp(&label.span.source.text, &label.span.range);
            let (line, column) = label.span.source.place(range.start);
            let (end_line, end_column) = label.span.source.place(range.end);
            json!({
                "file": label.span.source.name, "line": line, "column": column, "end_line": end_line, "end_column": end_column,
                "start": range.start, "end": range.end, "message": label.message,
            })
        };
        let one = |d: &Diagnostic| {
            json!({
                "severity": match d.severity { Severity::Error => "error", Severity::Warning => "warning" },
                "message": d.message,
                "labels": d.labels.iter().map(label).collect::<Vec<_>>(),
                "help": d.help,
            })
        };
        Json::Array(self.0.iter().map(one).collect())
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(one: Diagnostic) -> Self {
        Self(vec![one])
    }
}

fn render_without_snippet(text: &mut String, diagnostic: &Diagnostic) {
    let severity = match diagnostic.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{severity}: {}", diagnostic.message);
    for label in &diagnostic.labels {
        let (line, column) = label.span.source.place(label.span.range.start);
        let _ = writeln!(text, "  --> {}:{line}:{column} {}", label.span.source.name, label.message);
    }
    if let Some(help) = &diagnostic.help {
        let _ = writeln!(text, "  = help: {help}");
    }
    text.push('\n');
}

/// Bytes of the longest line that a span touches at its ends.
fn longest_line(span: &Span) -> usize {
    let text = &span.source.text;
    let range = clamp(text, &span.range);
    let line = |at: usize| {
        let start = text[..at].rfind('\n').map_or(0, |n| n + 1);
        let end = text[at..].find('\n').map_or(text.len(), |n| at + n);
        end - start
    };
    line(range.start).max(line(range.end))
}

fn floor_boundary(text: &str, offset: usize) -> usize {
    let mut offset = offset.min(text.len());
    while !text.is_char_boundary(offset) {
        offset -= 1;
    }
    offset
}

fn clamp(text: &str, range: &Range<usize>) -> Range<usize> {
    let start = floor_boundary(text, range.start);
    start..floor_boundary(text, range.end).max(start)
}

/// The name most like `name`, if one is like enough to have been meant.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let wanted = name.to_lowercase();
    let mut best: Option<(f64, &str)> = None;
    for candidate in known {
        let other = candidate.to_lowercase();
        let mut score = strsim::normalized_damerau_levenshtein(&wanted, &other);
        if wanted.len() >= 3 && other.len() >= 3 && (other.contains(&wanted) || wanted.contains(&other)) {
            score = score.max(0.6 + 0.1 * score);
        }
        if score > best.map_or(0.0, |b| b.0) {
            best = Some((score, candidate));
        }
    }
    best.filter(|(score, _)| *score >= 0.5).map(|(_, candidate)| candidate)
}

/// The help for an unknown name: the nearest one, or what there is.
pub fn suggest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    const MOST_LISTED: usize = 16;
    let known: Vec<&str> = known.into_iter().collect();
    if let Some(near) = nearest(name, known.iter().copied()) {
        return format!("did you mean `{near}`?");
    }
    if known.is_empty() {
        return "there are none here".to_owned();
    }
    let mut list = known.iter().take(MOST_LISTED).map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", ");
    if known.len() > MOST_LISTED {
        let _ = write!(list, ", and {} more", known.len() - MOST_LISTED);
    }
    format!("there is {list}")
}

/// A help and another sentence.
pub(crate) fn and_also(help: String, more: &str) -> String {
    let stop = if help.ends_with('?') { "" } else { "." };
    format!("{help}{stop} {more}")
}
