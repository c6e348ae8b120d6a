//! Where the difference is: maps as numbers and as colours.

use super::{CompareError, Mask, difference::dark, flip, pair::Pair};
use crate::files::Picture;

/// What an error map shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorMapKind {
    /// a − b.
    Difference,
    /// |a − b|.
    Absolute,
    /// |a − b| / √(b² + 0.01 m²), m being the mean of the reference.
    Relative,
    /// FLIP of the displayed pictures.
    Flip,
}

/// A map of the error.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorMap {
    /// What it shows.
    pub kind: ErrorMapKind,
    /// The values, in the channels of the pictures (`Y` for FLIP); NaN where a pixel does not count.
    pub picture: Picture,
    /// Three bytes (RGB) a pixel, rows from the top: the mean over the channels in colours. Pixels outside of the mask are [`OUTSIDE`],
    /// those that are not finite [`NOT_FINITE`].
    pub rgb: Vec<u8>,
    /// The value at the bright end of the colours; of differences, its negative is at the other end.
    pub range: f32,
}

/// The colour of pixels outside of the mask.
pub const OUTSIDE: [u8; 3] = [96, 96, 96];
/// The colour of pixels that are not finite in the image or the reference.
pub const NOT_FINITE: [u8; 3] = [0, 255, 0];
/// The ends and the middle of the colours of differences.
const DARKER: [f32; 3] = [24.0, 78.0, 168.0];
const EQUAL: [f32; 3] = [246.0, 246.0, 246.0];
const BRIGHTER: [f32; 3] = [186.0, 24.0, 40.0];

impl ErrorMap {
    /// What the colours mean, for a caption.
    pub fn legend(&self) -> String {
        let range = self.range;
        let scale = match self.kind {
            ErrorMapKind::Difference => {
                return format!("image − reference: blue {:.4} or less (darker), white 0, red {range:.4} or more (brighter)", -range);
            }
            ErrorMapKind::Absolute => "|image − reference|",
            ErrorMapKind::Relative => "|image − reference| / √(reference² + 0.01 mean²)",
            ErrorMapKind::Flip => "FLIP",
        };
        format!("{scale}: black 0, pale yellow {range:.4} or more")
    }
}

/// A map of the error, over the pixels of a mask if there is one. `range` is the value at the end of the colours; without it half of the
/// reference's mean for differences and absolute errors, 0.5 for relative ones and 1 for FLIP: it depends on the reference only, so that
/// maps of several images can be set side by side.
///
/// # Errors
/// The pictures cannot be compared; for FLIP also: they hold no colours.
pub fn error_map(
    kind: ErrorMapKind,
    image: &Picture,
    reference: &Picture,
    mask: Option<&Mask>,
    range: Option<f32>,
) -> Result<ErrorMap, CompareError> {
    let pair = Pair::new(image, reference, mask)?;
    let mean = pair.mean_reference();
    let picture = match kind {
        ErrorMapKind::Flip => {
            let channels = || CompareError::NoColour { channels: pair.image.names.join(", ") };
            let (image, reference) = pair.display().ok_or_else(channels)?;
            let mut map = flip::map(&image, &reference, pair.image.width);
            map.iter_mut().zip(&pair.counts).filter(|(_, counts)| !**counts).for_each(|(v, _)| *v = f32::NAN);
            Picture::linear(pair.image.width, pair.image.height, 1, map)
        }
        _ => {
            let dark = dark(mean);
            let error = |a: f32, b: f32| {
                let (a, b) = (f64::from(a), f64::from(b));
                let error = match kind {
                    ErrorMapKind::Relative => (a - b).abs() / (b * b + dark).sqrt(),
                    ErrorMapKind::Absolute => (a - b).abs(),
                    _ => a - b,
                };
                error as f32
            };
            let channels = pair.image.channels();
            let mut data = vec![f32::NAN; pair.image.data.len()];
            for (i, a, b) in pair.pixels() {
                let values = a.iter().zip(b).map(|(a, b)| error(*a, *b));
                data[i * channels..(i + 1) * channels].iter_mut().zip(values).for_each(|(to, value)| *to = value);
            }
            Picture { data, ..pair.image.clone() }
        }
    };
    let range = range.unwrap_or(match kind {
        // A black reference has no mean to go by.
        ErrorMapKind::Difference | ErrorMapKind::Absolute if mean == 0.0 => 1.0,
        ErrorMapKind::Difference | ErrorMapKind::Absolute => (0.5 * mean.abs()) as f32,
        ErrorMapKind::Relative => 0.5,
        ErrorMapKind::Flip => 1.0,
    });
    let magma = flip::magma();
    let colour = |(i, pixel): (usize, &[f32])| {
        if mask.is_some_and(|m| !m.holds(i)) {
            return OUTSIDE;
        }
        if !pair.counts[i] {
            return NOT_FINITE;
        }
        let value = pixel.iter().sum::<f32>() / pixel.len() as f32 / range;
        if kind == ErrorMapKind::Difference { diverging(value) } else { magma[(value.clamp(0.0, 1.0) * 255.0).round() as usize] }
    };
    let rgb = picture.data.chunks_exact(picture.channels()).enumerate().flat_map(colour).collect();
    Ok(ErrorMap { kind, picture, rgb, range })
}

/// Blue at −1, near white at 0, red at 1.
fn diverging(value: f32) -> [u8; 3] {
    let end = if value < 0.0 { DARKER } else { BRIGHTER };
    let share = value.abs().min(1.0);
    [0, 1, 2].map(|c| (EQUAL[c] + share * (end[c] - EQUAL[c])).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Condition, compare_over};

    fn grey(values: &[f32]) -> Picture {
        Picture::linear(values.len(), 1, 1, values.to_vec())
    }

    #[test]
    fn differences_are_blue_and_red_around_white() {
        let map = error_map(ErrorMapKind::Difference, &grey(&[0.0, 2.0, 9.0, f32::NAN]), &grey(&[2.0; 4]), None, None).expect("comparable");
        assert_eq!((map.range, &map.picture.data[..3]), (1.0, &[-2.0, 0.0, 7.0][..]));
        assert!(map.picture.data[3].is_nan());
        assert_eq!(map.rgb, [[24, 78, 168], [246; 3], [186, 24, 40], NOT_FINITE].concat());
        assert_eq!(map.legend(), "image − reference: blue -1.0000 or less (darker), white 0, red 1.0000 or more (brighter)");
    }

    #[test]
    fn errors_go_from_black_to_pale_yellow() {
        let mask = Mask::new(&grey(&[1.0, 1.0, 0.0]), Condition::Above(0.5));
        let map = error_map(ErrorMapKind::Absolute, &grey(&[2.0, 6.0, 0.0]), &grey(&[2.0; 3]), Some(&mask), Some(4.0)).expect("comparable");
        let magma = flip::magma();
        assert_eq!(map.rgb, [magma[0], magma[255], OUTSIDE].concat());
        assert_eq!(map.picture.data[..2], [0.0, 4.0]);
        // By hand: mean 2, so 1 / √(4 + 0.04).
        let relative = error_map(ErrorMapKind::Relative, &grey(&[3.0]), &grey(&[2.0]), None, None).expect("comparable");
        assert!((relative.picture.data[0] - 0.497_518_6).abs() < 1e-6 && relative.range == 0.5);
    }

    #[test]
    fn the_map_of_flip_has_the_mean_of_the_metric() {
        let reference = Picture::linear(20, 20, 3, (0..1200).map(|i| (i % 11) as f32).collect());
        let image = Picture { data: reference.data.iter().map(|v| v * 1.2).collect(), ..reference.clone() };
        let mask = Mask::new(&reference, Condition::Above(4.0));
        let map = error_map(ErrorMapKind::Flip, &image, &reference, Some(&mask), None).expect("comparable");
        let inside: Vec<f64> = map.picture.data.iter().filter(|v| !v.is_nan()).map(|v| f64::from(*v)).collect();
        let mean = inside.iter().sum::<f64>() / inside.len() as f64;
        assert_eq!(inside.len(), mask.count());
        assert_eq!(compare_over(&image, &reference, &mask).expect("comparable").flip, Some(mean));
    }

    #[test]
    fn flip_needs_colours() {
        let vectors = Picture::linear(1, 1, 2, vec![0.0; 2]);
        let error = error_map(ErrorMapKind::Flip, &vectors, &vectors, None, None).expect_err("no colours");
        assert_eq!(error, CompareError::NoColour { channels: "R, G".to_owned() });
    }
}
