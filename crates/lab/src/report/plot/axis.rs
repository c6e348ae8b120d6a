//! Axes: linear, logarithmic or of names, with few round ticks.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use crate::report::text::{shorten, tick};

/// Ratio of the largest to the smallest value from which an axis of measurements is logarithmic.
const DECADE: f64 = 10.0;
/// The same for a knob, which sweeps double: three doublings.
const DOUBLINGS: f64 = 8.0;
/// Free space at both ends, as a part of the axis.
const MARGIN: f64 = 0.05;
/// Ticks nearer to each other than this part of the axis would write over each other.
const NEAREST: f64 = 0.07;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Scale {
    Linear,
    Log,
}

/// One axis of a plot.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::report) struct Axis {
    /// What it shows, with the unit.
    pub title: String,
    scale: Scale,
    low: f64,
    high: f64,
    ticks: Vec<(f64, String)>,
}

impl Axis {
    /// Of measurements: logarithmic where they are positive and span a decade. `values` that are not finite do not count.
    pub fn of(title: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        Self::spanning(title.into(), values, DECADE)
    }

    /// Of positive measurements, logarithmic whatever they span.
    pub fn log(title: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        Self::spanning(title.into(), values, 1.0)
    }

    /// Of moments, always linear.
    pub fn of_time(title: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        Self::spanning(title.into(), values, f64::INFINITY)
    }

    /// Of a parameter: logarithmic where it is positive and doubles three times, with ticks at its values if these are few.
    pub fn of_knob(title: impl Into<String>, values: &[f64]) -> Self {
        let mut axis = Self::spanning(title.into(), values.iter().copied(), DOUBLINGS);
        let mut distinct: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        distinct.sort_by(f64::total_cmp);
        distinct.dedup();
        if distinct.windows(2).all(|pair| axis.part(pair[1]) - axis.part(pair[0]) >= NEAREST) {
            axis.ticks = distinct.into_iter().map(|v| (v, tick(v))).collect();
        }
        axis
    }

    /// From 0 to a little above the largest of the values.
    pub fn from_zero(title: impl Into<String>, values: impl IntoIterator<Item = f64>) -> Self {
        let high = values.into_iter().filter(|v| v.is_finite()).fold(0.0, f64::max);
        let high = if high > 0.0 { high * (1.0 + MARGIN) } else { 1.0 };
        Self { title: title.into(), scale: Scale::Linear, low: 0.0, high, ticks: linear_ticks(0.0, high) }
    }

    /// Of names, at 0, 1, 2, …
    pub fn of_names(title: impl Into<String>, names: &[&str]) -> Self {
        let ticks = names.iter().enumerate().map(|(i, name)| (i as f64, shorten(name, 80 / names.len().max(1)))).collect();
        Self { title: title.into(), scale: Scale::Linear, low: -0.5, high: names.len().max(1) as f64 - 0.5, ticks }
    }

    fn spanning(title: String, values: impl IntoIterator<Item = f64>, log_from: f64) -> Self {
        let finite = values.into_iter().filter(|v| v.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        if low > 0.0 && high / low >= log_from {
            let pad = ((high.ln() - low.ln()) * MARGIN).max(0.02).exp();
            let (low, high) = ((low / pad).max(f64::MIN_POSITIVE), (high * pad).min(f64::MAX));
            let mut ticks = log_ticks(low, high);
            if ticks.len() < 3 {
                ticks = linear_ticks(low, high);
            }
            return Self { title, scale: Scale::Log, low, high, ticks };
        }
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        // A single value, or as good as one, needs room around it too.
        let room = if high > low + 1e-9 * low.abs() { high - low } else { high.abs() };
        let room = if room > 0.0 { room } else { 1.0 };
        let (low, high) = (low - room * MARGIN, high + room * MARGIN);
        Self { title, scale: Scale::Linear, low, high, ticks: linear_ticks(low, high) }
    }

    /// Whether it is logarithmic.
    pub fn is_log(&self) -> bool {
        self.scale == Scale::Log
    }

    /// Characters of its longest tick.
    pub fn widest_label(&self) -> usize {
        self.ticks.iter().map(|t| t.1.chars().count()).max().unwrap_or(0)
    }

    /// Where a value lies, 0 at the low end and 1 at the high one.
    fn part(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log => (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln()),
        }
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        from + (self.part(*value) * f64::from(to - from)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _hint: Hint) -> Vec<f64> {
        self.ticks.iter().map(|t| t.0).collect()
    }

    fn range(&self) -> Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        self.ticks.iter().find(|t| t.0 == *value).map_or_else(String::new, |t| t.1.clone())
    }
}

/// Multiples of 1, 2 or 5 times a power of ten, eight at most.
fn linear_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let least = (high - low) / 7.0;
    let power = 10f64.powf(least.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= least).unwrap_or(least);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    // A range too narrow for its magnitude has steps that double precision cannot add.
    (first..=last.min(first.saturating_add(7))).map(|i| i as f64 * step).map(|v| (v, tick(v))).collect()
}

/// 1, 2 and 5 times powers of ten, powers of ten alone over more than three decades, fewer over more than ten.
fn log_ticks(low: f64, high: f64) -> Vec<(f64, String)> {
    let decades = high.log10() - low.log10();
    let multiples: &[f64] = if decades <= 3.0 { &[1.0, 2.0, 5.0] } else { &[1.0] };
    let every = (decades / 10.0).ceil().max(1.0) as usize;
    let powers = (low.log10().floor() as i32..=high.log10().ceil() as i32).step_by(every);
    let values = powers.flat_map(|p| multiples.iter().map(move |m| m * 10f64.powi(p)));
    values.filter(|v| (low..=high).contains(v)).map(|v| (v, tick(v))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axis_is_logarithmic_from_a_decade() {
        assert!(Axis::of("", [1.0, 10.0, f64::NAN]).is_log());
        assert!(!Axis::of("", [1.0, 9.0]).is_log());
        assert!(!Axis::of("", [0.0, 90.0]).is_log(), "0 has no logarithm");
        assert!(Axis::of_knob("", &[32.0, 256.0]).is_log());
    }

    #[test]
    fn no_values_and_single_values_have_an_axis_too() {
        for values in [vec![], vec![f64::NAN], vec![0.0], vec![5.0], vec![-3.0, -3.0], vec![1e300, 1.0], vec![1.0, 1.0 + 1e-15]] {
            let axis = Axis::of("", values.iter().copied());
            assert!(axis.range().start < axis.range().end, "{values:?}");
            assert!(axis.ticks.len() <= 12, "{values:?}: {:?}", axis.ticks);
            for value in values.into_iter().filter(|v| v.is_finite()) {
                assert!(axis.range().contains(&value));
                assert!((0..=100).contains(&axis.map(&value, (0, 100))));
            }
        }
    }

    #[test]
    fn ticks_are_round() {
        let labels = |axis: Axis| axis.ticks.into_iter().map(|t| t.1).collect::<Vec<_>>();
        assert_eq!(labels(Axis::from_zero("", [26.0])), ["0", "5", "10", "15", "20", "25"]);
        assert_eq!(labels(Axis::of("", [0.9, 31.0])), ["1", "2", "5", "10", "20"]);
        assert_eq!(labels(Axis::of_knob("", &[64.0, 16.0, 256.0, 16.0])), ["16", "64", "256"]);
    }
}
