//! Whether noise explains the difference between two estimates of one image.
//!
//! A test for each pixel and channel, as the renderer Mitsuba tests its own images (`test_renders.py`): the difference over its standard
//! error, a two-sided p-value, Šidák's correction for the number of tests. Unlike there both pictures may be noisy, and few batches are
//! accounted for: with standard errors s from n batches the statistic follows Student's t with the degrees of freedom of Welch and
//! Satterthwaite (Jung, Hanika, Dachsbacher: Detecting bias in Monte Carlo renderers using Welch's t-test, 2020).

use serde_json::{Value, json};
use statrs::function::{beta::beta_reg, erf::erfc};

use super::{
    CompareError, Mask,
    pair::{Pair, is_triple, same_size},
};
use crate::files::{Picture, Tone};

/// The probability that a test of an image rejects any pixel of a fair one.
const SIGNIFICANCE: f64 = 0.01;
/// The share of pixels of a fair image that pass. Mitsuba's: room for a few pixels whose noise has been underestimated.
const PASSING: f64 = 0.9975;
/// Share of the reference's mean that is added in quadrature to every standard error: rounding of f32 sums, and of standard errors that
/// are stored as half floats or came out as 0 where no path has met light. Differences below it are never found.
const FLOOR: f64 = 1e-4;
/// From here on Student's t and the normal distribution give the same p-values to three digits, even far out.
const MANY: f64 = 1e6;

/// A picture with what is known about its noise.
#[derive(Debug, Clone, Copy)]
pub struct Estimate<'a> {
    /// Linear values: means of independent batches, or the truth.
    pub picture: &'a Picture,
    /// The standard error of every value, in the same unit and with the same channels; `None`: the picture has no noise. An alpha channel
    /// is the number of batches that it was estimated from, as in `standard_error` of the pipeline `reference`.
    pub standard_error: Option<&'a Picture>,
    /// The number of batches for all pixels, before the alpha channel. Where neither is known the standard errors count as exact.
    pub batches: Option<u32>,
}

/// Mean of the image over that of the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ratio {
    /// The ratio; 1 is best.
    pub value: f64,
    /// Its standard error, if the noise of pixels is independent.
    pub standard_error: f64,
}

/// What the tests of all pixels found.
#[derive(Debug, Clone, PartialEq)]
pub struct ZTest {
    /// Pixels tested.
    pub tested: usize,
    /// Pixels left out because the image, the reference or a standard error is not finite (or is negative).
    pub non_finite: usize,
    /// Pixels outside of the mask.
    pub masked: usize,
    /// Share of the tested pixels of which every channel passes.
    pub passing: f64,
    /// Whether at least 99.75 % pass.
    pub fair: bool,
    /// What a p-value must exceed to pass: 1 − (1 − 0.01)^(1/n) for n tests, one for each channel of each tested pixel.
    pub significance: f64,
    /// The smallest p-value.
    pub smallest_p: f64,
    /// Mean of the image over that of the reference, over the tested pixels; `None` for a black reference. It finds an error of the
    /// image's energy that no single pixel shows.
    pub ratio: Option<Ratio>,
}

impl ZTest {
    /// As JSON.
    pub fn to_json(&self) -> Value {
        json!({
            "tested": self.tested,
            "non_finite": self.non_finite,
            "masked": self.masked,
            "passing": self.passing,
            "fair": self.fair,
            "significance": self.significance,
            "smallest_p": self.smallest_p,
            "energy_ratio": self.ratio.map(|r| r.value),
            "energy_ratio_standard_error": self.ratio.map(|r| r.standard_error),
        })
    }
}

/// Tests each pixel (inside of a mask) for whether noise explains its difference. It assumes that the means of batches are nearly normal,
/// which fails where a few rare paths carry the light, and for the ratio that the noise of pixels is independent.
///
/// # Errors
/// The pictures cannot be compared, are not linear or have no standard error; one is of another size, has other channels, or is of fewer
/// than 2 batches; no pixel is left.
pub fn z_test(image: Estimate<'_>, reference: Estimate<'_>, mask: Option<&Mask>) -> Result<ZTest, CompareError> {
    let pair = Pair::new(image.picture, reference.picture, mask)?;
    if pair.image.tone != Tone::Linear {
        return Err(CompareError::NotLinear);
    }
    if image.standard_error.is_none() && reference.standard_error.is_none() {
        return Err(CompareError::NoStandardError);
    }
    let of_image = Noise::of(image, &pair.image, "standard error of the image")?;
    let of_reference = Noise::of(reference, &pair.reference, "standard error of the reference")?;

    let floor = (FLOOR * pair.mean_reference()).powi(2);
    let channels = pair.image.channels();
    let mut smallest: Vec<f64> = Vec::with_capacity(pair.counts.len());
    let mut sums = Sums::default();
    let mut without_noise = 0;
    for (pixel, a, b) in pair.pixels() {
        let noise = |c: usize| Some((of_image.at(pixel, c)?, of_reference.at(pixel, c)?));
        let Some(noise) = (0..channels).map(noise).collect::<Option<Vec<_>>>() else {
            without_noise += 1;
            continue;
        };
        let mut p = 1.0_f64;
        for ((a, b), noise) in a.iter().zip(b).zip(noise) {
            let (a, b) = (f64::from(*a), f64::from(*b));
            sums.add(a, b, noise);
            p = p.min(p_value(a - b, noise, floor));
        }
        smallest.push(p);
    }

    let tested = smallest.len();
    let non_finite = pair.non_finite_image + pair.non_finite_reference + without_noise;
    if tested == 0 {
        return Err(CompareError::NoPixels {
            non_finite_image: pair.non_finite_image + without_noise,
            non_finite_reference: pair.non_finite_reference,
            masked: pair.masked,
        });
    }
    // 1 − (1 − α)^(1/n) without cancellation.
    let significance = -((-SIGNIFICANCE).ln_1p() / (tested * channels) as f64).exp_m1();
    let passing = smallest.iter().filter(|p| **p > significance).count() as f64 / tested as f64;
    Ok(ZTest {
        tested,
        non_finite,
        masked: pair.masked,
        passing,
        fair: passing >= PASSING,
        significance,
        smallest_p: smallest.iter().copied().fold(1.0, f64::min),
        ratio: sums.ratio(),
    })
}

/// Variance of a mean, and its degrees of freedom.
type Spread = (f64, f64);

/// The standard errors of a picture, pixel by pixel.
struct Noise {
    errors: Option<Picture>,
    /// Number of batches of each pixel; empty where it is not known.
    batches: Vec<f32>,
    all: Option<u32>,
}

impl Noise {
    fn of(estimate: Estimate<'_>, picture: &Picture, what: &'static str) -> Result<Self, CompareError> {
        let all = estimate.batches;
        let Some(errors) = estimate.standard_error else { return Ok(Self { errors: None, batches: Vec::new(), all }) };
        same_size(what, errors.width, errors.height, picture)?;
        let plain = errors.without_alpha();
        if plain.names != picture.names && !(is_triple(&plain.names) && is_triple(&picture.names)) {
            return Err(CompareError::BesideChannels { what, channels: plain.names.join(", "), expected: picture.names.join(", ") });
        }
        let alpha = errors.names.iter().position(|n| n == "A").filter(|_| all.is_none());
        let batches: Vec<f32> = alpha.map_or_else(Vec::new, |a| errors.data.iter().skip(a).step_by(errors.channels()).copied().collect());
        if all.is_some_and(|n| n < 2) || batches.iter().any(|n| *n < 2.0) {
            return Err(CompareError::Batches { what });
        }
        Ok(Self { errors: Some(plain), batches, all })
    }

    /// `None` where it is no number that a standard error can be.
    fn at(&self, pixel: usize, channel: usize) -> Option<Spread> {
        let Some(errors) = &self.errors else { return Some((0.0, f64::INFINITY)) };
        let error = f64::from(errors.data[pixel * errors.channels() + channel]);
        let batches = self.all.map(f64::from).or(self.batches.get(pixel).map(|n| f64::from(*n))).unwrap_or(f64::INFINITY);
        (error.is_finite() && error >= 0.0 && !batches.is_nan()).then_some((error * error, batches - 1.0))
    }
}

/// Probability of a difference at least as large by noise alone; `floor` is a variance that is known exactly.
fn p_value(difference: f64, ((va, na), (vb, nb)): (Spread, Spread), floor: f64) -> f64 {
    let variance = va + vb + floor;
    if variance == 0.0 {
        return if difference == 0.0 { 1.0 } else { 0.0 };
    }
    let square = difference * difference / variance;
    // Welch and Satterthwaite; infinite where no uncertain variance is part of it.
    let freedom = variance * variance / (va * va / na + vb * vb / nb);
    if freedom < MANY { beta_reg(freedom / 2.0, 0.5, freedom / (freedom + square)) } else { erfc((square / 2.0).sqrt()) }
}

/// Sums over the values tested, for the ratio of means.
#[derive(Default)]
struct Sums {
    image: f64,
    reference: f64,
    variance_image: f64,
    variance_reference: f64,
}

impl Sums {
    fn add(&mut self, image: f64, reference: f64, noise: (Spread, Spread)) {
        self.image += image;
        self.reference += reference;
        self.variance_image += noise.0.0;
        self.variance_reference += noise.1.0;
    }

    /// The error of a quotient to first order.
    fn ratio(&self) -> Option<Ratio> {
        let value = self.image / self.reference;
        let standard_error = (self.variance_image + value * value * self.variance_reference).sqrt() / self.reference.abs();
        (self.reference != 0.0).then_some(Ratio { value, standard_error })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Condition;

    const SIDE: usize = 128;

    /// Normal numbers: splitmix64 and the transform of Box and Muller.
    struct Normal(u64);

    impl Normal {
        fn uniform(&mut self) -> f64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = self.0;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
        }

        fn next(&mut self) -> f64 {
            let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
            radius * (std::f64::consts::TAU * self.uniform()).cos()
        }
    }

    /// The truth: brightness from 0.1 to 1.9, mean 1.
    fn truth(i: usize) -> f64 {
        0.1 + 1.8 * (i % 101) as f64 / 100.0
    }

    fn picture(values: impl FnMut(usize) -> f32) -> Picture {
        Picture::linear(SIDE, SIDE, 3, (0..3 * SIDE * SIDE).map(values).collect())
    }

    /// `energy` times the truth with noise of a known standard error, `noise` times the truth; and that error.
    fn noisy(seed: u64, energy: f64, noise: f64) -> (Picture, Picture) {
        let mut normal = Normal(seed);
        (picture(|i| (energy * truth(i) * (1.0 + noise * normal.next())) as f32), picture(|i| (noise * truth(i)) as f32))
    }

    /// The mean of so many batches and the standard error from their spread.
    fn batched(seed: u64, batches: u32) -> (Picture, Picture) {
        let mut normal = Normal(seed);
        let n = f64::from(batches);
        let mut errors = Vec::new();
        let mean = picture(|i| {
            let values: Vec<f64> = (0..batches).map(|_| truth(i) * (1.0 + 0.1 * normal.next())).collect();
            let mean = values.iter().sum::<f64>() / n;
            errors.push((values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt() as f32);
            mean as f32
        });
        (mean, Picture::linear(SIDE, SIDE, 3, errors))
    }

    fn exact(picture: &Picture) -> Estimate<'_> {
        Estimate { picture, standard_error: None, batches: None }
    }

    fn with<'a>((picture, error): &'a (Picture, Picture), batches: Option<u32>) -> Estimate<'a> {
        Estimate { picture, standard_error: Some(error), batches }
    }

    #[test]
    fn p_values_are_those_of_tables() {
        let known = (0.0, f64::INFINITY);
        // Normal: two-sided 5 % at 1.959964, 5.733031e-7 at 5. Student, 10 degrees: 5 % at 2.228139, 0.1 % at 4.586894.
        for (t, freedom, expected) in
            [(1.959_964, f64::INFINITY, 0.05), (5.0, f64::INFINITY, 5.733_031e-7), (2.228_139, 10.0, 0.05), (4.586_894, 10.0, 0.001)]
        {
            let p = p_value(2.0 * t, ((4.0, freedom), known), 0.0);
            assert!((p / expected - 1.0).abs() < 1e-6, "{t}: {p}");
        }
        // Equal variances and sizes: the degrees of freedom add up (5 + 5).
        let p = p_value(2.228_139, ((0.5, 5.0), (0.5, 5.0)), 0.0);
        assert!((p - 0.05).abs() < 1e-7, "{p}");
        // On both sides of MANY.
        let near = |freedom| p_value(5.0, ((1.0, freedom), known), 0.0);
        assert!((near(0.99 * MANY) / near(1.01 * MANY) - 1.0).abs() < 1e-3);
        assert_eq!((p_value(0.0, (known, known), 0.0), p_value(1e-9, (known, known), 0.0)), (1.0, 0.0));
    }

    /// Over 20 pairs, the test of a whole image at 1 % should find no more than a few pixels in all.
    #[test]
    fn images_with_known_noise_are_fair() {
        let truth = picture(|i| truth(i) as f32);
        let mut alarms = 0;
        for seed in 0..10 {
            let (a, b) = (noisy(seed, 1.0, 0.3), noisy(seed + 100, 1.0, 0.1));
            for test in [z_test(with(&a, None), with(&b, None), None), z_test(with(&a, None), exact(&truth), None)] {
                let test = test.expect("testable");
                assert!(test.fair && test.tested == SIDE * SIDE, "{test:?}");
                alarms += usize::from(test.smallest_p <= test.significance);
                let ratio = test.ratio.expect("a ratio");
                assert!((ratio.value - 1.0).abs() < 4.0 * ratio.standard_error, "{ratio:?}");
            }
        }
        // 1 % of 20 tests are expected to find a pixel: three or more would be one case in 900.
        assert!(alarms <= 2, "{alarms} of 20 tests found a pixel");
    }

    /// Single pixels show 2 % up to about 1 % of noise (at 0.4 %, where it is 5 standard errors, four of five do);
    /// the ratio of means shows it far above that.
    #[test]
    fn two_per_cent_too_much_energy_is_rejected() {
        let truth = picture(|i| truth(i) as f32);
        for noise in [0.002, 0.004, 0.006, 0.02, 0.3] {
            let test = z_test(with(&noisy(1, 1.02, noise), None), exact(&truth), None).expect("testable");
            let ratio = test.ratio.expect("a ratio");
            let off = (ratio.value - 1.0) / ratio.standard_error;
            println!("noise {noise}: {:.3} % pass, ratio {:.5}, {off:.1} standard errors off", 100.0 * test.passing, ratio.value);
            assert_eq!(test.fair, noise > 0.006, "noise {noise}: {test:?}");
            assert!(off > 5.0, "noise {noise}: {ratio:?}");
        }
    }

    /// Standard errors from few batches are too small by chance for some pixels; only Student's t knows.
    #[test]
    fn few_batches_are_fair_with_their_number_only() {
        let truth = picture(|i| truth(i) as f32);
        for batches in [3, 8, 12] {
            let image = batched(u64::from(batches), batches);
            let known = z_test(with(&image, Some(batches)), exact(&truth), None).expect("testable");
            let unknown = z_test(with(&image, None), exact(&truth), None).expect("testable");
            println!("{batches} batches: {:.3} % pass, as exact {:.3} %", 100.0 * known.passing, 100.0 * unknown.passing);
            assert!(known.passing >= 1.0 - 3.0 / (SIDE * SIDE) as f64, "{batches}: {known:?}");
            assert!(unknown.passing < known.passing && (batches > 8 || !unknown.fair), "{batches}: {unknown:?}");
        }
    }

    #[test]
    fn the_alpha_channel_is_the_number_of_batches() {
        let (mean, error) = batched(5, 8);
        let alpha = |n: f32| {
            let data = error.data.chunks_exact(3).flat_map(|e| [e[0], e[1], e[2], n]).collect();
            (mean.clone(), Picture::linear(SIDE, SIDE, 4, data))
        };
        let truth = picture(|i| truth(i) as f32);
        let test = |pair: &(Picture, Picture), batches| z_test(with(pair, batches), exact(&truth), None);
        assert_eq!(test(&alpha(8.0), None), test(&(mean.clone(), error.clone()), Some(8)));
        assert_eq!(test(&alpha(8.0), Some(3)), test(&(mean.clone(), error.clone()), Some(3)));
        assert!(matches!(test(&alpha(1.0), None), Err(CompareError::Batches { .. })));
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let mut image = noisy(2, 1.0, 0.1);
        let mut reference = noisy(3, 1.0, 0.1);
        image.0.data[0] = f32::NAN;
        image.1.data[5] = f32::INFINITY;
        reference.0.data[9] = f32::NAN;
        reference.1.data[13] = -1.0;
        let mask = Mask::new(&picture(|i| if i / 3 < 1000 { 1.0 } else { 0.0 }), Condition::Above(0.5));
        let test = z_test(with(&image, None), with(&reference, None), Some(&mask)).expect("testable");
        assert_eq!((test.tested, test.non_finite, test.masked), (996, 4, SIDE * SIDE - 1000));
        assert!(test.fair && test.ratio.is_some_and(|r| r.value.is_finite()));
    }

    /// Where no path has met light the error is 0: a difference within rounding passes, one beyond does not.
    #[test]
    fn zero_errors_have_a_floor() {
        let zero = picture(|_| 0.0);
        let reference = picture(|_| 1.0);
        for (difference, fair) in [(1e-4_f32, true), (1e-3, false)] {
            let image = picture(|_| 1.0 + difference);
            let estimate = Estimate { picture: &image, standard_error: Some(&zero), batches: Some(4) };
            assert_eq!(z_test(estimate, exact(&reference), None).expect("testable").fair, fair, "{difference}");
        }
    }

    #[test]
    fn what_cannot_be_tested_is_refused() {
        let image = noisy(1, 1.0, 0.1);
        let small = Picture::linear(1, 1, 3, vec![0.0; 3]);
        let grey = Picture::linear(SIDE, SIDE, 1, vec![0.0; SIDE * SIDE]);
        let test = |error: &Picture| z_test(Estimate { standard_error: Some(error), ..exact(&image.0) }, exact(&image.0), None);
        assert_eq!(z_test(exact(&image.0), exact(&image.0), None), Err(CompareError::NoStandardError));
        assert!(matches!(test(&small), Err(CompareError::Beside { width: 1, .. })));
        assert!(matches!(test(&grey), Err(CompareError::BesideChannels { .. })));
        assert!(matches!(test(&picture(|_| f32::NAN)), Err(CompareError::NoPixels { .. })));
        let shown = Picture { tone: Tone::Display, ..image.0.clone() };
        assert_eq!(z_test(with(&(shown.clone(), image.1.clone()), None), exact(&shown), None), Err(CompareError::NotLinear));
    }
}
