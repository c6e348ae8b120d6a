//! Numbers of the difference between an image and a reference.

use indexmap::IndexMap;
use serde_json::{Value, json};

use super::{KNOWN, flip, nearest_rank, pair::Pair, ssim};

/// What is added to the square of the reference where an error is taken relative to it, as a share of its squared mean. It weighs errors
/// of pixels darker than a tenth of the mean as if they were that bright. The usual 0.01 for pictures whose mean is about 1 (the image
/// viewer tev has it, for example), made independent of the picture's scale.
const DARK: f64 = 0.01;

/// [`DARK`] times the squared mean of the reference; never 0, so that black over black is no error.
pub(super) fn dark(mean_reference: f64) -> f64 {
    (DARK * mean_reference * mean_reference).max(f64::MIN_POSITIVE)
}

/// Differences between an image and a reference, over all pixels that count and all channels but alpha.
///
/// A pixel with a value that is not finite, in either picture, is left out of every number and counted; so are pixels outside of a mask.
/// Definitions: [`KNOWN`].
#[derive(Debug, Clone, PartialEq)]
pub struct Metrics {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Names of the channels compared.
    pub channels: Vec<String>,
    /// Pixels left out because the image is not finite there.
    pub non_finite_image: usize,
    /// Pixels left out because the reference is not finite there (and the image is).
    pub non_finite_reference: usize,
    /// Pixels left out because they are outside of the mask; they are not among those that are not finite.
    pub masked: usize,
    /// Mean of the image.
    pub mean_image: f64,
    /// Mean of the reference.
    pub mean_reference: f64,
    /// Root of the mean squared difference.
    pub rmse: f64,
    /// Mean of (a − b)² / (b² + 0.01 m²), m being the mean of the reference; `None` when that is 0.
    pub relative_mse: Option<f64>,
    /// Mean absolute difference.
    pub mean_absolute_error: f64,
    /// Largest absolute difference.
    pub max: f64,
    /// The absolute difference that 99.9 % of the values do not exceed (nearest rank).
    pub percentile_999: f64,
    /// Mean FLIP at 67 pixels a degree, 0 to 1; `None` for what is no colour or grey level.
    pub flip: Option<f64>,
    /// Mean SSIM, −1 to 1; `None` for what is no colour or grey level, or narrower than its window of 11 pixels.
    pub ssim: Option<f64>,
}

impl Metrics {
    pub(super) fn of(pair: &Pair) -> Self {
        let mean_reference = pair.mean_reference();
        let dark = dark(mean_reference);
        let (mut sum_image, mut squares, mut relative) = (0.0, 0.0, 0.0);
        let mut differences: Vec<f64> = Vec::with_capacity(pair.image.data.len());
        for (_, a, b) in pair.pixels() {
            for (a, b) in a.iter().zip(b) {
                let (a, b) = (f64::from(*a), f64::from(*b));
                let square = (a - b) * (a - b);
                sum_image += a;
                squares += square;
                relative += square / (b * b + dark);
                differences.push((a - b).abs());
            }
        }
        let count = differences.len() as f64;
        let absolute: f64 = differences.iter().sum();
        let percentile_999 = nearest_rank(&mut differences, 0.999).unwrap_or(0.0);
        let (width, height) = (pair.image.width, pair.image.height);
        let shown = pair.display();
        Self {
            width,
            height,
            channels: pair.image.names.clone(),
            non_finite_image: pair.non_finite_image,
            non_finite_reference: pair.non_finite_reference,
            masked: pair.masked,
            mean_image: sum_image / count,
            mean_reference,
            rmse: (squares / count).sqrt(),
            relative_mse: (mean_reference != 0.0).then_some(relative / count),
            mean_absolute_error: absolute / count,
            max: differences.last().copied().unwrap_or(0.0),
            percentile_999,
            flip: shown.as_ref().and_then(|(image, reference)| flip::mean(image, reference, width, &pair.counts)),
            ssim: shown.as_ref().and_then(|(image, reference)| ssim::mean(image, reference, width, &pair.counts)),
        }
    }

    /// RMSE over the magnitude of the reference's mean; `None` when that is 0.
    pub fn relative_rmse(&self) -> Option<f64> {
        self.over_mean(self.rmse).map(f64::abs)
    }

    /// Mean absolute error over the magnitude of the reference's mean; `None` when that is 0.
    pub fn relative_mean_absolute_error(&self) -> Option<f64> {
        self.over_mean(self.mean_absolute_error).map(f64::abs)
    }

    /// The 99.9th percentile over the magnitude of the reference's mean; `None` when that is 0.
    pub fn relative_percentile_999(&self) -> Option<f64> {
        self.over_mean(self.percentile_999).map(f64::abs)
    }

    /// Mean of the image less that of the reference.
    pub fn bias(&self) -> f64 {
        self.mean_image - self.mean_reference
    }

    /// Bias over the magnitude of the reference's mean; `None` when that is 0.
    pub fn relative_bias(&self) -> Option<f64> {
        (self.mean_reference != 0.0).then(|| self.bias() / self.mean_reference.abs())
    }

    /// Mean of the image over that of the reference; `None` when the reference is black.
    pub fn energy_ratio(&self) -> Option<f64> {
        self.over_mean(self.mean_image)
    }

    /// Pixels that count.
    pub fn counted(&self) -> usize {
        self.width * self.height - self.masked - self.non_finite_image - self.non_finite_reference
    }

    fn over_mean(&self, value: f64) -> Option<f64> {
        (self.mean_reference != 0.0).then(|| value / self.mean_reference)
    }

    /// Every number that is defined, under its name and in the order of [`KNOWN`].
    pub fn named(&self) -> IndexMap<String, f64> {
        KNOWN.iter().filter_map(|known| Some((known.name.to_owned(), known.of(self)?))).collect()
    }

    /// As JSON, under the names that scripts use; what is not defined is `null`.
    pub fn to_json(&self) -> Value {
        let mut json = json!({
            "width": self.width,
            "height": self.height,
            "channels": self.channels,
            "pixels": self.width * self.height,
            "counted": self.counted(),
            "masked": self.masked,
            "non_finite_image": self.non_finite_image,
            "non_finite_reference": self.non_finite_reference,
            "mean_image": self.mean_image,
            "mean_reference": self.mean_reference,
        });
        for known in KNOWN.iter().filter(|known| known.of_two_pictures()) {
            json[known.name] = known.of(self).into();
        }
        json
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{files::Picture, metrics::compare};

    fn grey(values: &[f32]) -> Picture {
        Picture::linear(values.len(), 1, 1, values.to_vec())
    }

    #[test]
    fn numbers_agree_with_a_calculation_by_hand() {
        // Differences 1, 0, -1, 2: squares 1, 0, 1, 4.
        let metrics = compare(&grey(&[2.0, 2.0, 1.0, 6.0]), &grey(&[1.0, 2.0, 2.0, 4.0])).expect("comparable");
        assert_eq!(metrics.mean_image, 2.75);
        assert_eq!(metrics.mean_reference, 2.25);
        assert_eq!(metrics.rmse, 1.5_f64.sqrt());
        assert_eq!(metrics.relative_rmse(), Some(1.5_f64.sqrt() / 2.25));
        assert_eq!(metrics.mean_absolute_error, 1.0);
        assert_eq!(metrics.relative_mean_absolute_error(), Some(1.0 / 2.25));
        assert_eq!(metrics.bias(), 0.5);
        assert_eq!(metrics.relative_bias(), Some(0.5 / 2.25));
        assert_eq!(metrics.energy_ratio(), Some(2.75 / 2.25));
        assert_eq!((metrics.max, metrics.percentile_999), (2.0, 2.0));
        assert_eq!(metrics.relative_percentile_999(), Some(2.0 / 2.25));
        // 0.01 · 2.25² = 0.050625 under each square of the reference. 1e-12: rounding of a sum of four.
        let by_hand = (1.0 / 1.050625 + 0.0 + 1.0 / 4.050625 + 4.0 / 16.050625) / 4.0;
        assert!((metrics.relative_mse.expect("not black") - by_hand).abs() < 1e-12);
    }

    #[test]
    fn relative_numbers_do_not_depend_on_the_scale() {
        let (image, reference) = ([2.0, 2.0, 0.5, 6.0], [1.0, 2.0, 0.0, 4.0]);
        let scaled = |values: [f32; 4]| grey(&values.map(|v| v * 1024.0));
        let small = compare(&grey(&image), &grey(&reference)).expect("comparable");
        let large = compare(&scaled(image), &scaled(reference)).expect("comparable");
        assert_eq!(small.relative_mse, large.relative_mse);
        assert_eq!(small.relative_rmse(), large.relative_rmse());
        assert_eq!((small.flip, small.ssim), (large.flip, large.ssim));
        assert!(large.rmse > 1000.0 * small.rmse);
    }

    #[test]
    fn the_percentile_leaves_out_one_in_a_thousand() {
        let reference = vec![1.0; 2000];
        let mut image = reference.clone();
        image[7] = 101.0;
        image[8] = 51.0;
        image[9] = 3.0;
        let metrics = compare(&grey(&image), &grey(&reference)).expect("comparable");
        assert_eq!((metrics.max, metrics.percentile_999), (100.0, 2.0));
    }

    #[test]
    fn a_black_reference_has_no_ratios() {
        let metrics = compare(&grey(&[1.0]), &grey(&[0.0])).expect("comparable");
        assert_eq!((metrics.relative_rmse(), metrics.relative_mse, metrics.energy_ratio()), (None, None, None));
        assert!(metrics.to_json()["relative_rmse"].is_null());
        assert!(!metrics.named().contains_key("relative_rmse") && metrics.named()["rmse"] == 1.0);
    }

    #[test]
    fn equal_pictures_have_the_best_values() {
        let picture = Picture::linear(16, 16, 3, (0..768).map(|i| (i % 7) as f32).collect());
        let metrics = compare(&picture, &picture).expect("comparable");
        for known in KNOWN.iter().filter(|known| known.of_two_pictures()) {
            assert_eq!(metrics.named()[known.name], known.best.value(), "{}", known.name);
        }
    }
}
