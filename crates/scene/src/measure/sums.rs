//! What samples add up to, and the features with their standard errors.

use std::collections::BTreeMap;

use manylight_graph::features::Measured;

use super::FEATURES;

/// What is summed over the samples of a batch. Light is the sum of its colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// Light of the lights that what the camera sees would reflect to it without shadows, and does reflect.
    DirectSent,
    DirectReaching,
    /// Light of one bounce that what the camera sees would reflect to it if nothing blocked its way from the lit surface, and does reflect.
    BounceSent,
    BounceReaching,
    /// Light of two and more bounces.
    Later,
    /// All light, and of it what met matt reflection alone.
    All,
    Matt,
    /// Flux that lit surfaces reflect, and of it what reaches something that the camera sees.
    Flux,
    FluxSeen,
    /// Texels of the reflective shadow map, and of them those that reflect light.
    Texels,
    TexelsLit,
    /// Points that the camera sees, and the logarithm of their distance and its square.
    Seen,
    LogDistance,
    LogDistanceSquared,
}

const COUNT: usize = Quantity::LogDistanceSquared as usize + 1;

/// The sums of a batch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sums {
    sums: [f64; COUNT],
    /// Of the squares of what each sample gave.
    squares: [f64; COUNT],
}

impl Sums {
    pub(super) const ZERO: Self = Self { sums: [0.0; COUNT], squares: [0.0; COUNT] };

    /// Adds what one sample gives. What is no number (of scenes at the limits of 32 bits) is not counted.
    pub(super) fn add(&mut self, of: Quantity, value: f64) {
        if value.is_finite() {
            self.sums[of as usize] += value;
            self.squares[of as usize] += value * value;
        }
    }

    fn get(&self, of: Quantity) -> f64 {
        self.sums[of as usize]
    }

    fn plus(mut self, other: &Self) -> Self {
        for i in 0..COUNT {
            self.sums[i] += other.sums[i];
            self.squares[i] += other.squares[i];
        }
        self
    }

    fn minus(mut self, other: &Self) -> Self {
        (0..COUNT).for_each(|i| self.sums[i] -= other.sums[i]);
        self
    }
}

/// How a feature follows from the sums.
#[derive(Debug, Clone, Copy)]
pub(super) enum Formula {
    /// The share of the first quantity in the second.
    Share(Quantity, Quantity),
    /// What the first leaves of the second, as a share of it.
    Rest(Quantity, Quantity),
    /// The standard deviation of the logarithm of the distance.
    Spread,
}

impl Formula {
    /// The value; 0 where there is nothing that it could be a share of.
    fn value(self, sums: &Sums) -> f64 {
        let share = |part: Quantity, whole: Quantity| {
            let whole = sums.get(whole);
            (whole > 0.0).then(|| sums.get(part) / whole)
        };
        match self {
            Self::Share(part, whole) => share(part, whole).unwrap_or(0.0).clamp(0.0, 1.0),
            Self::Rest(part, whole) => share(part, whole).map_or(0.0, |share| 1.0 - share).clamp(0.0, 1.0),
            Self::Spread => {
                let mean = |of| share(of, Quantity::Seen).unwrap_or(0.0);
                (mean(Quantity::LogDistanceSquared) - mean(Quantity::LogDistance).powi(2)).max(0.0).sqrt()
            }
        }
    }

    /// What so many samples cannot tell from nothing: of what `n` equal ones did not meet, there is in 95 of 100 cases a share of less than 3 / n, which is
    /// twice this. Unequal samples count as (Σ w)² / Σ w² equal ones (Kish 1965).
    fn resolution(self, sums: &Sums) -> f64 {
        match self {
            Self::Share(_, whole) | Self::Rest(_, whole) if sums.get(whole) > 0.0 => {
                (1.5 * sums.squares[whole as usize] / sums.get(whole).powi(2)).min(1.0)
            }
            _ => 0.0,
        }
    }

    /// The value from all batches, and its standard error from what it is without each of them (the jackknife: Efron 1982).
    fn estimate(self, batches: &[Sums]) -> Measured {
        let all = batches.iter().fold(Sums::ZERO, |all, batch| all.plus(batch));
        let value = self.value(&all);
        let without: Vec<f64> = batches.iter().map(|batch| self.value(&all.minus(batch))).collect();
        let count = without.len().max(1) as f64;
        let mean = without.iter().sum::<f64>() / count;
        let variance = (count - 1.0) / count * without.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        Measured { value, standard_error: variance.sqrt().max(self.resolution(&all)) }
    }
}

/// All features from the sums of independent batches.
pub(super) fn estimate(batches: &[Sums], is_glossy: bool) -> BTreeMap<String, Measured> {
    let estimate = |feature: &super::Feature| {
        // Without a lobe there is nothing to estimate.
        let known = feature.name == "specular_energy" && !is_glossy;
        let measured = if known { Measured { value: 0.0, standard_error: 0.0 } } else { feature.formula.estimate(batches) };
        (feature.name.to_owned(), measured)
    };
    FEATURES.iter().map(estimate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn batch(part: f64, whole: f64) -> Sums {
        let mut sums = Sums::ZERO;
        sums.add(Quantity::Later, part);
        sums.add(Quantity::All, whole);
        sums
    }

    #[test]
    fn the_error_of_a_ratio_is_that_of_the_textbook() {
        let values = [(0.9, 2.0), (1.2, 2.2), (0.7, 1.7), (1.1, 2.4), (1.0, 1.9)];
        let batches: Vec<Sums> = values.iter().map(|&(part, whole)| batch(part, whole)).collect();
        let estimate = Formula::Share(Quantity::Later, Quantity::All).estimate(&batches);
        let (part, whole) = values.iter().fold((0.0, 0.0), |sum, v| (sum.0 + v.0, sum.1 + v.1));
        let ratio = part / whole;
        // Cochran 1977, eq. 2.46: the variance of the residuals over the squared mean of the whole.
        let residuals: f64 = values.iter().map(|(p, w)| (p - ratio * w).powi(2)).sum();
        let textbook = (residuals * 5.0 / 4.0).sqrt() / whole;
        assert!((estimate.value - ratio).abs() < 1e-12);
        let squares: f64 = values.iter().map(|(_, w)| w * w).sum();
        assert_eq!(estimate.standard_error, 1.5 * squares / (whole * whole), "so few samples resolve no less");
        let plain = Formula::Share(Quantity::Later, Quantity::All);
        let without: Vec<f64> = batches.iter().map(|b| plain.value(&batches.iter().fold(Sums::ZERO, |a, b| a.plus(b)).minus(b))).collect();
        let mean = without.iter().sum::<f64>() / 5.0;
        let jackknife = (0.8 * without.iter().map(|v| (v - mean).powi(2)).sum::<f64>()).sqrt();
        assert!((jackknife / textbook - 1.0).abs() < 0.1, "{jackknife} against {textbook}");
    }

    #[test]
    fn what_conditions_can_test_is_measured() {
        let known: Vec<_> = manylight_graph::features::measured().collect();
        assert_eq!(FEATURES.iter().map(|feature| feature.name).collect::<Vec<_>>(), known);
    }

    #[test]
    fn shares_of_nothing_are_nothing() {
        let batches = [Sums::ZERO; 4];
        for feature in FEATURES {
            assert_eq!(feature.formula.estimate(&batches), Measured { value: 0.0, standard_error: 0.0 }, "{}", feature.name);
        }
    }

    #[test]
    fn what_is_no_number_is_not_counted() {
        let mut sums = batch(0.25, 1.0);
        sums.add(Quantity::All, f64::NAN);
        sums.add(Quantity::Later, f64::INFINITY);
        let estimate = Formula::Share(Quantity::Later, Quantity::All).estimate(&[sums, batch(0.25, 1.0)]);
        assert_eq!(estimate.value, 0.25);
    }
}
