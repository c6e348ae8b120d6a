//! What must come out of a call, how far it may be off, and what came of it.

use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};

use crate::records;

/// What a result must be.
#[derive(Debug, Clone)]
pub enum Want {
    /// This value; the error counts in the unit of the case at the magnitude `scale`.
    Value { value: f64, scale: f64 },
    /// Any number from the first to the second: all that a function promises where it has no value, or where rounding decides between two.
    Between(f64, f64),
    /// One of several values, as [`Want::Value`]: rounding decides which.
    OneOf(Vec<Want>),
}

impl Want {
    /// A value; units are those of its own magnitude.
    pub fn new(value: f64) -> Self {
        Self::Value { value, scale: value.abs() }
    }

    /// A value that is the sum of terms of the magnitude `scale`, or follows from such: their rounding counts, however small it is itself.
    pub fn of(value: f64, scale: f64) -> Self {
        Self::Value { value, scale: scale.abs().max(value.abs()) }
    }

    /// Any finite number.
    pub fn finite() -> Self {
        Self::Between(f64::MIN, f64::MAX)
    }
}

/// Values with units of their own magnitude.
pub fn values(all: impl IntoIterator<Item = f64>) -> Vec<Want> {
    all.into_iter().map(Want::new).collect()
}

/// Values with units of a common magnitude.
pub fn values_of(all: impl IntoIterator<Item = f64>, scale: f64) -> Vec<Want> {
    all.into_iter().map(|value| Want::of(value, scale)).collect()
}

/// What errors are counted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Units in the last place of 32-bit floats.
    Ulps,
    /// As it is.
    Absolute,
    /// Shares of the value.
    Relative,
}

impl Unit {
    /// One of them at a magnitude.
    pub fn size(self, scale: f64) -> f64 {
        match self {
            // Numbers below the smallest normal one have its unit.
            Self::Ulps => (scale.max(f64::from(f32::MIN_POSITIVE)).log2().floor() - 23.0).exp2(),
            Self::Absolute => 1.0,
            Self::Relative => scale.max(f64::from(f32::MIN_POSITIVE)),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Ulps => "ulp",
            Self::Absolute => "absolute",
            Self::Relative => "relative",
        }
    }
}

/// How far results may be off.
#[derive(Debug, Clone, Copy)]
pub struct Bound {
    pub limit: f64,
    pub unit: Unit,
    pub reason: &'static str,
}

/// Whole numbers, switches, and values that are rounded nowhere.
pub const EXACT: Bound = Bound { limit: 0.0, unit: Unit::Ulps, reason: "nothing is rounded" };

/// A bound in units in the last place.
pub const fn ulps(limit: f64, reason: &'static str) -> Bound {
    Bound { limit, unit: Unit::Ulps, reason }
}

/// A bound on the difference itself.
pub const fn absolute(limit: f64, reason: &'static str) -> Bound {
    Bound { limit, unit: Unit::Absolute, reason }
}

/// A bound on the difference over the value.
pub const fn relative(limit: f64, reason: &'static str) -> Bound {
    Bound { limit, unit: Unit::Relative, reason }
}

/// What came of the comparison of one function.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub function: &'static str,
    pub inputs: usize,
    pub worst: f64,
    pub bound: Bound,
    /// The call with the worst error.
    pub worst_call: String,
}

impl Outcome {
    /// Nothing compared yet.
    pub fn new(function: &'static str, bound: Bound) -> Self {
        Self { function, inputs: 0, worst: 0.0, bound, worst_call: String::new() }
    }

    /// Compares the results of one more call.
    pub fn add(&mut self, want: &[Want], got: &[f64], input: impl Fn() -> String) {
        assert_eq!(want.len(), got.len(), "{}: the twin gives {} numbers for {} results", self.function, want.len(), got.len());
        self.inputs += 1;
        for (place, (want, got)) in want.iter().zip(got).enumerate() {
            let error = error(want, *got, self.bound.unit);
            if error > self.worst || error.is_nan() {
                self.worst = if error.is_nan() { f64::INFINITY } else { error };
                self.worst_call = format!("input {}: {}; result {place}: {got:e} instead of {want:?}", self.inputs - 1, input());
            }
        }
    }

    /// Takes over another comparison of the same function.
    pub fn join(&mut self, other: Self) {
        self.inputs += other.inputs;
        if other.worst > self.worst {
            (self.worst, self.worst_call) = (other.worst, other.worst_call);
        }
    }

    /// Whether the worst error is within the bound.
    pub fn is_good(&self) -> bool {
        self.inputs > 0 && self.worst <= self.bound.limit
    }
}

fn error(want: &Want, got: f64, unit: Unit) -> f64 {
    match want {
        Want::Value { value, scale } => {
            let difference = (got - value).abs();
            // A device may take numbers below the smallest normal one for zero.
            if difference < f64::from(f32::MIN_POSITIVE) { 0.0 } else { difference / unit.size(*scale) }
        }
        Want::Between(low, high) => {
            if got.is_finite() && (*low..=*high).contains(&got) {
                0.0
            } else {
                f64::INFINITY
            }
        }
        Want::OneOf(all) => all.iter().map(|want| error(want, got, unit)).fold(f64::INFINITY, f64::min),
    }
}

/// Records outcomes, and fails with everything that is beyond its bound.
pub fn judge(outcomes: Vec<Outcome>) {
    record(&outcomes);
    let bad: Vec<String> = outcomes
        .iter()
        .filter(|outcome| !outcome.is_good())
        .map(|o| {
            format!("{}: worst error {:.3e}, bound {:.3e} ({}), {}", o.function, o.worst, o.bound.limit, o.bound.unit.name(), o.worst_call)
        })
        .collect();
    assert!(bad.is_empty(), "{} of {} functions are not as their twins:\n{}", bad.len(), outcomes.len(), bad.join("\n"));
}

/// Adds outcomes to the record, by the names of the functions.
fn record(outcomes: &[Outcome]) {
    static ALL: Mutex<BTreeMap<&str, Outcome>> = Mutex::new(BTreeMap::new());
    let mut all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
    all.extend(outcomes.iter().map(|o| (o.function, o.clone())));
    let row = |o: &Outcome| {
        let Bound { limit, unit, reason } = o.bound;
        // A number that JSON lacks is a failure of the test, which says more.
        serde_json::json!({
            "function": o.function, "inputs": o.inputs, "worst": o.worst, "unit": unit.name(), "bound": limit, "reason": reason,
        })
    };
    records::write("functions", &all.values().map(row).collect::<Vec<_>>());
}
