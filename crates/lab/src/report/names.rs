//! What metrics are called in words, and which value of each is best.

use crate::metrics::Known;

/// A metric as a report shows it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Metric<'a> {
    /// In words.
    pub title: &'a str,
    /// With the unit, where it has one.
    pub axis: String,
    /// What it is, in a sentence, where that is known.
    pub doc: Option<&'a str>,
    /// Where there is no difference.
    pub best: f64,
}

/// Looks up a metric; one that is not known is called by its name, has no unit and is best at 0.
pub(super) fn metric(name: &str) -> Metric<'_> {
    let Some(known) = Known::find(name) else {
        return Metric { title: name, axis: name.to_owned(), doc: None, best: 0.0 };
    };
    let axis = if known.unit == "1" { known.title.to_owned() } else { format!("{} (unit {})", known.title, known.unit) };
    Metric { title: known.title, axis, doc: Some(known.doc), best: known.best.value() }
}
