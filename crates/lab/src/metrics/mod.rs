//! How far a picture is from a reference.
//!
//! [`compare`] gives every number of [`KNOWN`] that two pictures alone define, [`compare_over`] the same over the pixels of a [`Mask`].
//! [`z_test`] asks whether noise explains the difference, where the noise is known. [`flicker`] is of a sequence. [`error_map`] shows
//! where the difference is; [`exposure_of`] and [`display`] are the one way in which linear pictures become pictures to look at.

mod difference;
mod display;
mod error_map;
mod flicker;
mod flip;
mod known;
mod mask;
mod pair;
mod ssim;
mod z_test;

pub use difference::Metrics;
pub use display::{display, exposure_of};
pub use error_map::{ErrorMap, ErrorMapKind, NOT_FINITE, OUTSIDE, error_map};
pub use flicker::flicker;
pub use known::{Best, KNOWN, Known};
pub use mask::{Condition, Mask};
pub use pair::CompareError;
pub use z_test::{Estimate, Ratio, ZTest, z_test};

use crate::files::Picture;
use pair::Pair;

/// Compares two pictures of equal size, channels and tone; alpha is left out.
///
/// # Errors
/// They are unlike in one of these, or no pixel is finite in both.
pub fn compare(image: &Picture, reference: &Picture) -> Result<Metrics, CompareError> {
    Ok(Metrics::of(&Pair::new(image, reference, None)?))
}

/// The same over the pixels of a mask.
///
/// # Errors
/// As [`compare`]; the mask is of another size or leaves no pixel.
pub fn compare_over(image: &Picture, reference: &Picture, mask: &Mask) -> Result<Metrics, CompareError> {
    Ok(Metrics::of(&Pair::new(image, reference, Some(mask))?))
}

/// Mean over the pixels that count of a map with a value for each pixel; `None` where it has none, as at the edges of SSIM.
fn mean_over(counts: &[bool], map: impl Iterator<Item = Option<f32>>) -> Option<f64> {
    let (mut sum, mut number) = (0.0, 0_usize);
    for value in counts.iter().zip(map).filter_map(|(counts, value)| value.filter(|_| *counts)) {
        sum += f64::from(value);
        number += 1;
    }
    (number > 0).then(|| sum / number as f64)
}

/// The smallest value that a share of the values does not exceed (nearest rank). Sorts them.
fn nearest_rank(values: &mut [f64], share: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let rank = ((values.len() as f64 * share).ceil() as usize).max(1) - 1;
    values.get(rank).copied()
}
