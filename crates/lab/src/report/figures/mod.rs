//! The plots of a report, with what is said beneath them.

mod knobs;
mod scatter;
mod sequence;
mod stages;

pub(super) use knobs::knobs;
pub(super) use scatter::scatter;
pub(super) use sequence::sequence;
pub(super) use stages::stages;

use super::study::Study;

/// A plot and what is said beneath it.
pub(super) struct Figure {
    /// What it shows, in a word or two: a part of its file's name.
    pub name: String,
    /// The same in a sentence.
    pub caption: String,
    /// The drawing; `None` if there is nothing to draw.
    pub svg: Option<String>,
    /// What is left out, and numbers that belong to it.
    pub notes: Vec<String>,
}

impl Figure {
    fn new(name: impl Into<String>, caption: impl Into<String>, drawn: Option<Result<String, String>>, mut notes: Vec<String>) -> Self {
        let svg = match drawn {
            Some(Ok(svg)) => Some(svg),
            Some(Err(reason)) => {
                notes.push(format!("The plot could not be drawn: {reason}."));
                None
            }
            None => {
                notes.push("There is nothing to draw.".into());
                None
            }
        };
        Self { name: name.into(), caption: caption.into(), svg, notes }
    }
}

/// Runs of a variant that a knob joins: indices with their values in rising order, or in that of the sweep where values are no numbers.
fn along(study: &Study<'_>, knob: &str, mut runs: Vec<usize>) -> Vec<usize> {
    let value = |run: usize| study.records[run].set.get(knob).and_then(|v| number_of(v));
    if runs.iter().all(|&run| value(run).is_some()) {
        runs.sort_by(|&a, &b| value(a).unwrap_or(0.0).total_cmp(&value(b).unwrap_or(0.0)));
    }
    runs
}

/// The number that a setting is.
fn number_of(value: &str) -> Option<f64> {
    value.parse().ok().filter(|v: &f64| v.is_finite())
}
