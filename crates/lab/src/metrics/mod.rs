//! How far a picture is from a reference: one pass over two pictures of equal size.

use serde_json::{Value, json};
use thiserror::Error;

use crate::files::{Picture, Tone};

/// Why two pictures cannot be compared.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum CompareError {
    /// They differ in size.
    #[error(
        "the image is {image_width}×{image_height}, the reference {reference_width}×{reference_height}: only pictures of equal size can be compared"
    )]
    #[allow(missing_docs)]
    Size { image_width: usize, image_height: usize, reference_width: usize, reference_height: usize },
    /// They differ in their channels.
    #[error("the image has the channels {image}, the reference {reference}: pictures with the same channels can be compared")]
    #[allow(missing_docs)]
    Channels { image: String, reference: String },
    /// One is linear, the other for the display.
    #[error("the {linear} holds linear values, the {display} values for the display: compare EXR with EXR or PNG with PNG")]
    #[allow(missing_docs)]
    Tone { linear: &'static str, display: &'static str },
}

/// Differences between an image and a reference, over all finite pixels and all channels but alpha.
///
/// A pixel with a value that is not finite, in either picture, is left out of every number and counted.
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
    /// Mean of the image.
    pub mean_image: f64,
    /// Mean of the reference.
    pub mean_reference: f64,
    /// Root of the mean squared difference.
    pub rmse: f64,
    /// Mean absolute difference.
    pub mean_absolute_error: f64,
    /// Largest absolute difference.
    pub max: f64,
    /// The absolute difference that 99.9 % of the values do not exceed (nearest rank).
    pub percentile_999: f64,
}

impl Metrics {
    /// RMSE over the magnitude of the reference's mean; `None` when that is 0.
    pub fn relative_rmse(&self) -> Option<f64> {
        self.over_mean(self.rmse).map(f64::abs)
    }

    /// Mean absolute error over the magnitude of the reference's mean; `None` when that is 0.
    pub fn relative_mean_absolute_error(&self) -> Option<f64> {
        self.over_mean(self.mean_absolute_error).map(f64::abs)
    }

    /// Mean of the image less that of the reference.
    pub fn bias(&self) -> f64 {
        self.mean_image - self.mean_reference
    }

    /// Mean of the image over that of the reference; `None` when the reference is black.
    pub fn energy_ratio(&self) -> Option<f64> {
        self.over_mean(self.mean_image)
    }

    /// Pixels that count.
    pub fn finite(&self) -> usize {
        self.width * self.height - self.non_finite_image - self.non_finite_reference
    }

    fn over_mean(&self, value: f64) -> Option<f64> {
        (self.mean_reference != 0.0).then(|| value / self.mean_reference)
    }

    /// As JSON, under the names that scripts use; ratios to a black reference are `null`.
    pub fn to_json(&self) -> Value {
        json!({
            "width": self.width,
            "height": self.height,
            "channels": self.channels,
            "pixels": self.width * self.height,
            "non_finite_image": self.non_finite_image,
            "non_finite_reference": self.non_finite_reference,
            "mean_image": self.mean_image,
            "mean_reference": self.mean_reference,
            "rmse": self.rmse,
            "relative_rmse": self.relative_rmse(),
            "mean_absolute_error": self.mean_absolute_error,
            "relative_mean_absolute_error": self.relative_mean_absolute_error(),
            "bias": self.bias(),
            "energy_ratio": self.energy_ratio(),
            "max": self.max,
            "percentile_99_9": self.percentile_999,
        })
    }
}

/// Compares two pictures; alpha is left out.
pub fn compare(image: &Picture, reference: &Picture) -> Result<Metrics, CompareError> {
    let (image, reference) = (image.without_alpha(), reference.without_alpha());
    if (image.width, image.height) != (reference.width, reference.height) {
        return Err(CompareError::Size {
            image_width: image.width,
            image_height: image.height,
            reference_width: reference.width,
            reference_height: reference.height,
        });
    }
    match (image.tone, reference.tone) {
        (Tone::Linear, Tone::Display) => return Err(CompareError::Tone { linear: "image", display: "reference" }),
        (Tone::Display, Tone::Linear) => return Err(CompareError::Tone { linear: "reference", display: "image" }),
        _ => {}
    }
    // R, G, B and X, Y, Z are the same three numbers: normals are dumped as the former, references store the latter.
    if image.names != reference.names && !(is_triple(&image.names) && is_triple(&reference.names)) {
        return Err(CompareError::Channels { image: image.names.join(", "), reference: reference.names.join(", ") });
    }
    Ok(measure(&image, &reference))
}

fn is_triple(names: &[String]) -> bool {
    names == ["R", "G", "B"] || names == ["X", "Y", "Z"]
}

fn measure(image: &Picture, reference: &Picture) -> Metrics {
    let channels = image.channels().max(1);
    let (mut non_finite_image, mut non_finite_reference) = (0, 0);
    let (mut sum_image, mut sum_reference, mut squares) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut differences: Vec<f64> = Vec::with_capacity(image.data.len());
    for (a, b) in image.data.chunks_exact(channels).zip(reference.data.chunks_exact(channels)) {
        if !a.iter().all(|v| v.is_finite()) {
            non_finite_image += 1;
        } else if !b.iter().all(|v| v.is_finite()) {
            non_finite_reference += 1;
        } else {
            for (a, b) in a.iter().zip(b) {
                let (a, b) = (f64::from(*a), f64::from(*b));
                sum_image += a;
                sum_reference += b;
                squares += (a - b) * (a - b);
                differences.push((a - b).abs());
            }
        }
    }
    let count = differences.len().max(1) as f64;
    let absolute: f64 = differences.iter().sum();
    differences.sort_by(f64::total_cmp);
    let rank = ((differences.len() as f64 * 0.999).ceil() as usize).max(1) - 1;
    Metrics {
        width: image.width,
        height: image.height,
        channels: image.names.clone(),
        non_finite_image,
        non_finite_reference,
        mean_image: sum_image / count,
        mean_reference: sum_reference / count,
        rmse: (squares / count).sqrt(),
        mean_absolute_error: absolute / count,
        max: differences.last().copied().unwrap_or(0.0),
        percentile_999: differences.get(rank).copied().unwrap_or(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(metrics.energy_ratio(), Some(2.75 / 2.25));
        assert_eq!((metrics.max, metrics.percentile_999), (2.0, 2.0));
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
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let image = Picture::linear(3, 1, 3, vec![1.0, 1.0, f32::NAN, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0]);
        let reference = Picture::linear(3, 1, 3, vec![9.0, 9.0, 9.0, 2.0, 2.0, 2.0, 1.0, f32::INFINITY, 1.0]);
        let metrics = compare(&image, &reference).expect("comparable");
        assert_eq!((metrics.non_finite_image, metrics.non_finite_reference, metrics.finite()), (1, 1, 1));
        assert_eq!((metrics.rmse, metrics.mean_reference), (0.0, 2.0));
    }

    #[test]
    fn a_black_reference_has_no_ratios() {
        let metrics = compare(&grey(&[1.0]), &grey(&[0.0])).expect("comparable");
        assert_eq!((metrics.relative_rmse(), metrics.energy_ratio()), (None, None));
        assert!(metrics.to_json()["relative_rmse"].is_null());
    }

    #[test]
    fn unlike_pictures_are_refused() {
        assert!(matches!(compare(&grey(&[1.0]), &grey(&[1.0, 2.0])), Err(CompareError::Size { .. })));
        let colour = Picture::linear(1, 1, 3, vec![0.0; 3]);
        assert!(matches!(compare(&grey(&[1.0]), &colour), Err(CompareError::Channels { .. })));
        let display = Picture { tone: Tone::Display, ..colour.clone() };
        assert!(matches!(compare(&colour, &display), Err(CompareError::Tone { linear: "image", display: "reference" })));
    }
}
