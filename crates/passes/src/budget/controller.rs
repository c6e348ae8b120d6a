//! From frame times to rungs of a ladder: a pure machine, without a clock and without a GPU.
//!
//! Times come in blocks; of each the median counts. A block over the budget moves down the ladder, at once to where the time is expected to fit. A block
//! within the budget moves up if the better rung is expected to fit, by a margin if it was there before, and if enough blocks have passed since the last change.
//! What holds:
//!
//! - **Constant load**, be the time of each rung what it may: at most 2R changes for R rungs below the first, then none. The last rung is within the budget
//!   or the cheapest.
//! - **Noise** of medians up to ±[`Tuning::noise`] (8 %): at most R (R + 1) / 2 changes, then none: a rung that failed is not tried again before the load
//!   falls by [`Tuning::drop`], measured on one and the same rung.
//! - **Any times at all**: the waiting time doubles with each move down that follows a move up. After n blocks there were k ≤ log₂(n / [`Tuning::hold`] + 1) of
//!   these, and at most 2R (k + 1) changes. A load that comes and goes is followed ever more rarely.
//! - **A load that rises and stays**: a rung within the budget, or the cheapest, is reached after at most R + 2 blocks.
//! - **Spikes** in less than half of the frames of each block change nothing.
//! - **The same times give the same rungs**: bit for bit on every machine, since nothing but +, −, ×, ÷ and comparisons is used.
//!
//! Why: a move down from rung r forbids r and all better ones (`floor`) until the load has fallen. So each rung fails at most once in between: that bounds moves down,
//! and they bound moves up.

use serde::{Deserialize, Serialize};

/// How the controller decides.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tuning {
    /// Frames of a block.
    pub window: usize,
    /// By so much a better rung that was reached before must be expected to stay below the budget.
    pub margin: f64,
    /// By so much the time on one rung must fall, from the longest since it was reached, before rungs that failed are considered again.
    pub drop: f64,
    /// Blocks to wait after a change before a better rung is tried, at first.
    pub hold: u64,
    /// Expected time of a rung over that of the rung above, before anything better is known.
    pub step: f64,
}

impl Default for Tuning {
    fn default() -> Self {
        Self { window: 5, margin: 0.05, drop: 0.15, hold: 2, step: 0.85 }
    }
}

impl Tuning {
    /// Relative noise of medians under which no rung that failed is tried again while the load is the same.
    pub fn noise(&self) -> f64 {
        self.drop / (2.0 - self.drop)
    }
}

/// Why the rung changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Why {
    /// The median was over the budget.
    OverBudget,
    /// The better rung is expected to fit.
    Fits,
}

/// A change of rung.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// The rung before.
    pub from: usize,
    /// The rung from now on.
    pub to: usize,
    /// Median of the block that decided, in milliseconds.
    pub median_ms: f64,
    /// What is expected on the new rung, in milliseconds.
    pub expected_ms: f64,
    /// Why.
    pub why: Why,
}

/// Chooses rungs. Rung 0 is the best.
#[derive(Debug, Clone, PartialEq)]
pub struct Controller {
    budget_ms: f64,
    tuning: Tuning,
    rung: usize,
    /// Times of the block that is not full yet.
    block: Vec<f64>,
    median_ms: Option<f64>,
    /// Times of the rungs that were reached, in proportion to each other.
    cost: Vec<Option<f64>>,
    /// Rungs that cannot be had.
    closed: Vec<bool>,
    /// The best rung that has not failed.
    floor: usize,
    /// Longest median on this rung since it was reached, or since rungs were considered again.
    peak: f64,
    /// Where it came from, and the median there, until the first block on this rung is full.
    came: Option<(usize, f64)>,
    went_up: bool,
    hold: u64,
    /// Full blocks since the last change.
    waited: u64,
    settled: bool,
}

/// Rounding of a product of quotients.
const ROUNDING: f64 = 1.0 + 1e-9;

impl Controller {
    /// Starts on the best of `rungs`, of which there is at least one.
    pub fn new(budget_ms: f64, rungs: usize, tuning: Tuning) -> Self {
        let rungs = rungs.max(1);
        Self {
            budget_ms,
            rung: 0,
            block: Vec::with_capacity(tuning.window),
            median_ms: None,
            cost: vec![None; rungs],
            closed: vec![false; rungs],
            floor: 0,
            peak: 0.0,
            came: None,
            went_up: false,
            hold: tuning.hold,
            waited: 0,
            settled: false,
            tuning,
        }
    }

    /// The rung to be on.
    pub fn rung(&self) -> usize {
        self.rung
    }

    /// Median of the last full block, in milliseconds.
    pub fn median_ms(&self) -> Option<f64> {
        self.median_ms
    }

    /// Whether the last full block gave no reason to change, now or later: with the load as it is, this is the rung to stay on.
    pub fn is_settled(&self) -> bool {
        self.settled
    }

    /// Takes the time of a frame on the present rung, in milliseconds; what is no time above zero is passed over.
    pub fn observe(&mut self, ms: f64) -> Option<Step> {
        if !(ms.is_finite() && ms > 0.0) {
            return None;
        }
        self.block.push(ms);
        if self.block.len() < self.tuning.window.max(1) {
            return None;
        }
        let median = median(&mut self.block);
        self.block.clear();
        self.median_ms = Some(median);
        self.waited += 1;
        self.learn(median);
        if median > self.budget_ms { self.down(median) } else { self.up(median) }
    }

    /// Forgets the block that is not full: its frames and those to come do not belong together.
    pub fn interrupt(&mut self) {
        self.block.clear();
    }

    /// Another load, from the present rung on: what was learnt of times is forgotten, and all rungs are considered.
    pub fn restart(&mut self) {
        let closed = std::mem::take(&mut self.closed);
        *self = Self { rung: self.rung, closed, ..Self::new(self.budget_ms, self.cost.len(), self.tuning) };
    }

    /// The step that was just taken could not be made: goes back, and never tries that rung again.
    pub fn undo(&mut self, step: Step) {
        self.closed[step.to] = true;
        self.rung = step.from;
        // The block that decided was on this rung.
        self.came = None;
        self.waited = 0;
    }

    fn learn(&mut self, median: f64) {
        if let Some((from, before)) = self.came.take() {
            // The load is that of the block before: what differs is the rung.
            self.cost[self.rung] = self.cost[from].map(|cost| cost * median / before);
            self.peak = median;
        }
        if self.cost[self.rung].is_none() {
            (self.cost[self.rung], self.peak) = (Some(median), median);
        }
        self.peak = self.peak.max(median);
    }

    fn down(&mut self, median: f64) -> Option<Step> {
        let last = self.cost.len() - 1;
        self.floor = self.floor.max((self.rung + 1).min(last));
        let open: Vec<usize> = (self.rung + 1..=last).filter(|rung| !self.closed[*rung]).collect();
        let fits = open.iter().copied().find(|rung| self.expected(*rung, median) <= self.budget_ms * ROUNDING);
        let Some(to) = fits.or(open.last().copied()) else {
            self.settled = true;
            return None;
        };
        if self.went_up {
            self.hold = self.hold.saturating_mul(2);
        }
        Some(self.go(to, median, Why::OverBudget))
    }

    fn up(&mut self, median: f64) -> Option<Step> {
        if median < self.peak * (1.0 - self.tuning.drop) {
            (self.floor, self.peak) = (0, median);
        }
        let fits = |rung: &usize| !self.closed[*rung] && self.hoped(*rung, median) <= self.budget_ms;
        let to = (self.floor..self.rung).find(fits);
        self.settled = to.is_none();
        let to = to.filter(|_| self.waited >= self.hold)?;
        Some(self.go(to, median, Why::Fits))
    }

    fn go(&mut self, to: usize, median: f64, why: Why) -> Step {
        let step = Step { from: self.rung, to, median_ms: median, expected_ms: self.expected(to, median), why };
        (self.rung, self.came, self.went_up) = (to, Some((step.from, median)), why == Why::Fits);
        (self.waited, self.settled) = (0, false);
        step
    }

    /// Time of a better rung for the purpose of trying it. One that was never reached is tried once without a margin, and if it is the next one on the mere
    /// hope that it takes the usual step: what is learnt is worth it.
    fn hoped(&self, rung: usize, now: f64) -> f64 {
        let expected = self.expected(rung, now);
        match self.cost[rung] {
            Some(_) => expected * (1.0 + self.tuning.margin),
            None if rung + 1 == self.rung => expected.min(now / self.tuning.step),
            None => expected,
        }
    }

    /// Time expected on a rung while the present one takes `now`: as it was learnt; between two rungs that were reached, on the line between them; beyond
    /// them, by the usual step.
    fn expected(&self, rung: usize, now: f64) -> f64 {
        let Some(here) = self.cost[self.rung] else { return now };
        let above = (0..=rung).rev().find_map(|other| self.cost[other].map(|cost| (other, cost)));
        let below = (rung..self.cost.len()).find_map(|other| self.cost[other].map(|cost| (other, cost)));
        let steps = |count: usize| (0..count).fold(1.0, |product, _| product * self.tuning.step);
        let cost = match (above, below) {
            (Some((a, cost)), Some((b, _))) if a == b => cost,
            (Some((a, high)), Some((b, low))) => high + (low - high) * (rung - a) as f64 / (b - a) as f64,
            (Some((a, cost)), None) => cost * steps(rung - a),
            (None, Some((b, cost))) => cost / steps(b - rung),
            (None, None) => here,
        };
        now * cost / here
    }
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    let half = times.len() / 2;
    if times.len() % 2 == 1 { times[half] } else { (times[half - 1] + times[half]) / 2.0 }
}

#[cfg(test)]
mod tests;
