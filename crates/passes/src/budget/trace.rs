//! What a budget saw and did, to be looked at and to be done again.

use serde::{Deserialize, Serialize};

use super::controller::{Controller, Step, Tuning};

/// Times and changes of a run, by frame since its start.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BudgetTrace {
    /// The time that was to be held, in milliseconds.
    pub budget_ms: f64,
    /// How was decided.
    pub tuning: Tuning,
    /// Rungs of the ladder.
    pub rungs: usize,
    /// Every time that counted.
    pub times: Vec<Sample>,
    /// Every change.
    pub changes: Vec<Change>,
}

/// A time that counted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Frames that had been rendered when it was known.
    pub frame: u64,
    /// Milliseconds; nothing where the plan was made anew for another reason, so that the block begins again.
    pub ms: Option<f64>,
}

/// A change of rung.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Change {
    /// Frames that had been rendered.
    pub frame: u64,
    /// From where to where, and why.
    #[serde(flatten)]
    pub step: Step,
    /// Whether it could not be made, and was taken back.
    pub undone: bool,
}

impl BudgetTrace {
    /// The changes that these times lead to: those that the trace has, unless it was edited.
    pub fn replay(&self) -> Vec<Change> {
        let mut controller = Controller::new(self.budget_ms, self.rungs, self.tuning);
        let mut changes: Vec<Change> = Vec::new();
        for sample in &self.times {
            let Some(ms) = sample.ms else {
                controller.interrupt();
                continue;
            };
            if let Some(step) = controller.observe(ms) {
                let undone = self.changes.get(changes.len()).is_some_and(|change| change.undone);
                if undone {
                    controller.undo(step);
                }
                changes.push(Change { frame: sample.frame, step, undone });
            }
        }
        changes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Recorded once; decisions must not change unnoticed, since recorded runs would no longer be repeated.
    const RECORDED: &str = r#"{
        "budget_ms": 16.0, "tuning": {"window": 5, "margin": 0.05, "drop": 0.15, "hold": 2, "step": 0.85}, "rungs": 6,
        "times": [
            {"frame": 2, "ms": 31.0}, {"frame": 3, "ms": 30.5}, {"frame": 4, "ms": 90.0}, {"frame": 5, "ms": null},
            {"frame": 7, "ms": 30.0}, {"frame": 8, "ms": 31.0}, {"frame": 9, "ms": 250.0}, {"frame": 10, "ms": 30.2}, {"frame": 11, "ms": 30.4},
            {"frame": 13, "ms": 9.0}, {"frame": 14, "ms": 9.1}, {"frame": 15, "ms": 9.0}, {"frame": 16, "ms": 9.2}, {"frame": 17, "ms": 9.0},
            {"frame": 18, "ms": 9.0}, {"frame": 19, "ms": 9.1}, {"frame": 20, "ms": 9.0}, {"frame": 21, "ms": 9.2}, {"frame": 22, "ms": 9.0}
        ],
        "changes": [
            {"frame": 11, "from": 0, "to": 4, "median_ms": 30.4, "expected_ms": 15.868989999999997, "why": "over_budget", "undone": false},
            {"frame": 22, "from": 4, "to": 3, "median_ms": 9.0, "expected_ms": 14.350000000000001, "why": "fits", "undone": false}
        ]
    }"#;

    #[test]
    fn recorded_times_give_the_recorded_changes() {
        let trace: BudgetTrace = serde_json::from_str(RECORDED).expect("a trace");
        assert_eq!(trace.replay(), trace.changes);
        let again: BudgetTrace = serde_json::from_str(&serde_json::to_string(&trace).expect("writable")).expect("readable");
        assert_eq!(again, trace);
    }

    #[test]
    fn a_change_that_was_taken_back_is_taken_back_again() {
        let mut trace: BudgetTrace = serde_json::from_str(RECORDED).expect("a trace");
        trace.changes[0].undone = true;
        let again = trace.replay();
        assert!(again[0].undone && again.iter().skip(1).all(|change| change.step.to != again[0].step.to), "{again:?}");
    }
}
