//! Documents, shaders and files that were good, made wrong at random: nothing panics or hangs, every fault has a place, and what is accepted can be used.

mod baked;
mod documents;
mod mutate;
mod pictures;
mod shaders;

use manylight::graph::diagnostics::{Diagnostics, Severity};

/// Every fault can be printed and says something; of a document that is there, every error has a place in it.
#[track_caller]
fn check_faults(faults: &Diagnostics) {
    let text = faults.render();
    assert!(faults.0.is_empty() || !text.trim().is_empty());
    for fault in &faults.0 {
        assert!(!fault.message.trim().is_empty(), "a fault without a sentence:\n{text}");
        assert!(fault.severity == Severity::Warning || !fault.labels.is_empty(), "an error without a place:\n{text}");
        for label in &fault.labels {
            let all = &label.span.source.text;
            assert!(all.get(label.span.range.clone()).is_some(), "a place outside of {}:\n{text}", label.span.source.name);
        }
    }
}
