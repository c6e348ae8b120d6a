//! A frame time that is held by giving up quality, and regained where there is time: a [`Budget`] beside a [`Renderer`].
//!
//! ```no_run
//! # use manylight_passes::{Budget, Renderer};
//! # fn run(mut renderer: Renderer) -> Result<(), Box<dyn std::error::Error>> {
//! let mut budget = Budget::new(16.0, &renderer)?;
//! loop {
//!     renderer.render_frame(0.0)?;
//!     // Looks at the newest times that have arrived; never waits.
//!     if let Some(change) = budget.follow(&mut renderer, None)? {
//!         println!("{}", budget.describe(&change));
//!     }
//! }
//! # }
//! ```
//!
//! What can be given up, and in which order, is the pipeline's `quality` ([`manylight_graph::quality`]). [`controller`] says how it is decided and what is
//! guaranteed.

pub mod controller;
mod ladder;
mod trace;

use std::collections::VecDeque;

use manylight_gpu::FrameTimings;
use manylight_graph::diagnostics::{Diagnostic, Diagnostics};

use self::controller::{Controller, Step, Tuning, Why};
pub use self::{
    ladder::Ladder,
    trace::{BudgetTrace, Change, Sample},
};
use crate::renderer::{Renderer, Settings};

/// Holds the frame time of a renderer.
///
/// The time of a frame is that of the GPU from the first pass to the last, or that of the CPU to record and submit, whichever is longer: in a program that does not wait
/// they overlap. Frames in which no node ran have no time, nor has the first frame of a plan, in which everything runs.
#[derive(Debug, Clone)]
pub struct Budget {
    controller: Controller,
    ladder: Ladder,
    /// Settings of the first rung.
    base: Vec<(String, String)>,
    trace: BudgetTrace,
    /// Times to take instead of measured ones.
    replayed: Option<VecDeque<Sample>>,
    /// Index of the frame whose time was seen last.
    seen: Option<u64>,
    /// Index of the first frame of the plan.
    built_at: u64,
    /// Frames of the renderer before the first that counts here.
    start: u64,
    /// The first median: of the first rung.
    before_ms: Option<f64>,
}

/// Milliseconds of a frame for a budget; nothing if nothing ran or the GPU has no sample.
pub fn frame_ms(timings: &FrameTimings) -> Option<f64> {
    let ran = timings.nodes.iter().any(|node| node.ran);
    timings.gpu_ns.filter(|_| ran).map(|gpu_ns| gpu_ns.max(timings.cpu_ns) as f64 / 1e6)
}

impl Budget {
    /// Holds `budget_ms` milliseconds, starting from the settings that the renderer has: they are the first rung.
    ///
    /// # Errors
    /// The pipeline has nothing to give up, or not with what is set; the time is none.
    pub fn new(budget_ms: f64, renderer: &Renderer) -> Result<Self, Diagnostics> {
        if !(budget_ms.is_finite() && budget_ms > 0.0) {
            return Err(Diagnostic::error_nowhere(format!("a frame cannot be held to {budget_ms} ms")).help("give a time above 0").into());
        }
        let ladder = Ladder::new(renderer, renderer.settings())?;
        let tuning = Tuning::default();
        Ok(Self {
            controller: Controller::new(budget_ms, ladder.len(), tuning),
            trace: BudgetTrace { budget_ms, tuning, rungs: ladder.len(), times: Vec::new(), changes: Vec::new() },
            ladder,
            base: renderer.settings().set.clone(),
            replayed: None,
            seen: None,
            built_at: renderer.built_at(),
            start: renderer.frame().index(),
            before_ms: None,
        })
    }

    /// Does what a trace says, by its times instead of measured ones: the same changes before the same frames, hence the same pictures.
    ///
    /// # Errors
    /// As [`Budget::new`]; the trace is of another ladder.
    pub fn replay(trace: &BudgetTrace, renderer: &Renderer) -> Result<Self, Diagnostics> {
        let mut budget = Self::new(trace.budget_ms, renderer)?;
        let rungs = budget.ladder.len();
        if trace.rungs != rungs {
            let message = format!("the times are of a ladder of {} rungs, and this one has {rungs}", trace.rungs);
            return Err(Diagnostic::error_nowhere(message).help("replay with the pipeline, scene and parameters of the recording").into());
        }
        budget.controller = Controller::new(trace.budget_ms, rungs, trace.tuning);
        budget.trace.tuning = trace.tuning;
        budget.replayed = Some(trace.times.iter().copied().collect());
        Ok(budget)
    }

    /// To be called after each frame: takes the newest time that has arrived, and changes the renderer's parameters if it must. `wall_ms`, where the caller knows
    /// how long the frame took, stands in on adapters without timestamps.
    ///
    /// # Errors
    /// The device cannot have the rung: everything stays as it was, and that rung is not tried again.
    pub fn follow(&mut self, renderer: &mut Renderer, wall_ms: Option<f64>) -> Result<Option<Change>, Diagnostics> {
        let now = renderer.frame().index().saturating_sub(self.start);
        let mut samples = self.samples(renderer, now, wall_ms);
        let step = samples.find_map(|sample| self.observe(Sample { frame: now, ..sample }));
        let Some(step) = step else { return Ok(None) };
        let set = self.put(renderer, step.to);
        let change = Change { frame: now, step, undone: set.is_err() };
        self.trace.changes.push(change);
        if change.undone {
            self.controller.undo(step);
        }
        self.built_at = renderer.built_at();
        set.map(|_| Some(change))
    }

    /// The times that have come to be known.
    fn samples(&mut self, renderer: &Renderer, now: u64, wall_ms: Option<f64>) -> std::vec::IntoIter<Sample> {
        let mut found = Vec::new();
        if let Some(replayed) = &mut self.replayed {
            // After a change comes another frame, as in the recording.
            while replayed.front().is_some_and(|sample| sample.frame <= now) {
                found.extend(replayed.pop_front());
            }
            return found.into_iter();
        }
        if self.built_at != renderer.built_at() {
            self.built_at = renderer.built_at();
            found.push(Sample { frame: now, ms: None });
        }
        if let Some(timings) = renderer.timings().filter(|t| t.frame > self.built_at && self.seen != Some(t.frame)) {
            self.seen = Some(timings.frame);
            let ran = timings.nodes.iter().any(|node| node.ran);
            let ms = frame_ms(timings).or(wall_ms.filter(|_| ran && timings.gpu_ns.is_none()));
            found.extend(ms.map(|ms| Sample { frame: now, ms: Some(ms) }));
        }
        found.into_iter()
    }

    fn observe(&mut self, sample: Sample) -> Option<Step> {
        self.trace.times.push(sample);
        let Some(ms) = sample.ms else {
            self.controller.interrupt();
            return None;
        };
        let step = self.controller.observe(ms);
        self.before_ms = self.before_ms.or(self.controller.median_ms());
        step
    }

    /// Documents, scene or size changed: what was learnt of times no longer holds. The rung stays if the ladder is the same; else the renderer
    /// goes back to the first.
    ///
    /// # Errors
    /// There is nothing left to give up; the renderer is on the first rung then. Or the renderer cannot go back to it.
    pub fn reconsider(&mut self, renderer: &mut Renderer) -> Result<(), Diagnostics> {
        let base = Settings { set: self.base.clone(), ..renderer.settings().clone() };
        match Ladder::new(renderer, &base) {
            Ok(ladder) if ladder == self.ladder => {
                self.controller.restart();
                self.this_rung(renderer)?;
                (self.start, self.built_at, self.seen) = (renderer.frame().index(), renderer.built_at(), None);
            }
            ladder => {
                self.first_rung(renderer)?;
                ladder?;
                *self = Self::new(self.trace.budget_ms, renderer)?;
            }
        }
        Ok(())
    }

    /// Sets the renderer to the first rung, as for a pipeline that no longer has what a rung sets. To be followed by [`Budget::reconsider`].
    ///
    /// # Errors
    /// The settings do not fit the pipeline.
    pub fn first_rung(&self, renderer: &mut Renderer) -> Result<(), Diagnostics> {
        self.put(renderer, 0)
    }

    /// Sets the renderer to the rung that it should be on.
    ///
    /// # Errors
    /// The settings do not fit the pipeline.
    pub fn this_rung(&self, renderer: &mut Renderer) -> Result<(), Diagnostics> {
        self.put(renderer, self.rung())
    }

    fn put(&self, renderer: &mut Renderer, rung: usize) -> Result<(), Diagnostics> {
        let base = Settings { set: self.base.clone(), ..renderer.settings().clone() };
        let settings = self.ladder.settings(&base, rung);
        if settings.set == renderer.settings().set { Ok(()) } else { renderer.set(settings).map(|_| ()) }
    }

    /// The rung now; 0 is the first and best.
    pub fn rung(&self) -> usize {
        self.controller.rung()
    }

    /// The rungs.
    pub fn ladder(&self) -> &Ladder {
        &self.ladder
    }

    /// Median of the first block of frames, in milliseconds: on the first rung.
    pub fn before_ms(&self) -> Option<f64> {
        self.before_ms
    }

    /// Median of the newest block of frames, in milliseconds. Right after a change it is that of the rung before.
    pub fn median_ms(&self) -> Option<f64> {
        self.controller.median_ms()
    }

    /// Whether this is the rung to stay on as long as the load is the same.
    pub fn is_settled(&self) -> bool {
        self.controller.is_settled()
    }

    /// All times and changes so far.
    pub fn trace(&self) -> &BudgetTrace {
        &self.trace
    }

    /// A change in words.
    pub fn describe(&self, change: &Change) -> String {
        let Step { from, to, median_ms, expected_ms, why } = change.step;
        let why = match why {
            Why::OverBudget => format!("{median_ms:.2} ms is over the budget of {} ms", self.trace.budget_ms),
            Why::Fits => format!("{median_ms:.2} ms leaves room for about {expected_ms:.2} ms"),
        };
        let moved: Vec<String> =
            self.ladder.moved(from, to).iter().map(|(name, before, after)| format!("{name} {before} → {after}")).collect();
        let last = self.ladder.len() - 1;
        let undone = if change.undone { "; not possible on this device" } else { "" };
        format!("frame {}: {why}: rung {from} → {to} of {last}: {}{undone}", change.frame, moved.join(", "))
    }
}
