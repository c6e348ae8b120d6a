//! Two pictures that can be compared, and which of their pixels count.

use thiserror::Error;

use super::{
    Mask,
    display::{display, exposure_of},
};
use crate::files::{Picture, Tone};

/// Why two pictures cannot be compared.
#[derive(Debug, Error, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum CompareError {
    /// They differ in size.
    #[error(
        "the image is {image_width}×{image_height}, the reference {reference_width}×{reference_height}: only pictures of equal size can be compared"
    )]
    Size { image_width: usize, image_height: usize, reference_width: usize, reference_height: usize },
    /// They differ in their channels.
    #[error("the image has the channels {image}, the reference {reference}: pictures with the same channels can be compared")]
    Channels { image: String, reference: String },
    /// One is linear, the other for the display.
    #[error("the {linear} holds linear values, the {display} values for the display: compare EXR with EXR or PNG with PNG")]
    Tone { linear: &'static str, display: &'static str },
    /// A picture that goes with the image or the reference is of another size than they are.
    #[error("the {what} is {width}×{height}, the image {image_width}×{image_height}: both must be of equal size")]
    Beside { what: &'static str, width: usize, height: usize, image_width: usize, image_height: usize },
    /// A standard error has other channels than its picture.
    #[error("the {what} has the channels {channels}, its picture {expected}: it must have the same, and may have alpha beside them")]
    BesideChannels { what: &'static str, channels: String, expected: String },
    /// No pixel is left to compare.
    #[error(
        "no pixel can be compared: {non_finite_image} are not finite in the image, {non_finite_reference} in the reference, {masked} are outside of the mask"
    )]
    NoPixels { non_finite_image: usize, non_finite_reference: usize, masked: usize },
    /// FLIP is of colours or grey levels.
    #[error("FLIP is of colours (R, G, B) or grey levels (Y), these pictures have the channels {channels}")]
    NoColour { channels: String },
    /// A test against noise without any noise known.
    #[error("the z-test needs the standard error of the image, of the reference, or of both")]
    NoStandardError,
    /// A test against noise of 8-bit values.
    #[error("the z-test is of linear values, these pictures hold values for the display: compare EXR files")]
    NotLinear,
    /// A spread needs two measurements.
    #[error("the {what} is of fewer than 2 batches, which have no spread: render at least 2 frames")]
    Batches { what: &'static str },
}

/// An image and a reference of equal size, channels (without alpha) and tone.
pub(super) struct Pair {
    pub image: Picture,
    pub reference: Picture,
    /// For each pixel whether it counts: inside of the mask and finite in both.
    pub counts: Vec<bool>,
    /// Pixels inside of the mask that do not count because of the image.
    pub non_finite_image: usize,
    /// Those that do not count because of the reference only.
    pub non_finite_reference: usize,
    /// Pixels outside of the mask.
    pub masked: usize,
}

impl Pair {
    pub fn new(image: &Picture, reference: &Picture, mask: Option<&Mask>) -> Result<Self, CompareError> {
        let (image, reference) = (image.without_alpha(), reference.without_alpha());
        alike(&image, &reference)?;
        if let Some(mask) = mask {
            same_size("mask", mask.width, mask.height, &image)?;
        }
        Self::counted(image, reference, mask)
    }

    fn counted(image: Picture, reference: Picture, mask: Option<&Mask>) -> Result<Self, CompareError> {
        let (mut non_finite_image, mut non_finite_reference, mut masked) = (0, 0, 0);
        let finite = |pixel: &[f32]| pixel.iter().all(|v| v.is_finite());
        let counts: Vec<bool> = (0..image.width * image.height)
            .map(|i| {
                let channels = i * image.channels()..(i + 1) * image.channels();
                if mask.is_some_and(|m| !m.holds(i)) {
                    masked += 1;
                } else if !finite(&image.data[channels.clone()]) {
                    non_finite_image += 1;
                } else if !finite(&reference.data[channels]) {
                    non_finite_reference += 1;
                } else {
                    return true;
                }
                false
            })
            .collect();
        if counts.contains(&true) {
            Ok(Self { image, reference, counts, non_finite_image, non_finite_reference, masked })
        } else {
            Err(CompareError::NoPixels { non_finite_image, non_finite_reference, masked })
        }
    }

    /// Index and channels of image and reference of every pixel that counts.
    pub fn pixels(&self) -> impl Iterator<Item = (usize, &[f32], &[f32])> {
        let channels = self.image.channels();
        let both = self.image.data.chunks_exact(channels).zip(self.reference.data.chunks_exact(channels));
        both.enumerate().filter(|(i, _)| self.counts[*i]).map(|(i, (a, b))| (i, a, b))
    }

    /// Mean of the reference over pixels that count and channels.
    pub fn mean_reference(&self) -> f64 {
        let (sum, number) = self
            .pixels()
            .fold((0.0, 0_usize), |(sum, number), (_, _, b)| (sum + b.iter().map(|v| f64::from(*v)).sum::<f64>(), number + b.len()));
        sum / number as f64
    }

    /// Image and reference as shown by the exposure of the reference, three bytes a pixel; `None` for what is no colour or grey level.
    /// A pixel that is not finite in one of them is black in both, so that FLIP and SSIM see no edge around it.
    pub fn display(&self) -> Option<(Vec<u8>, Vec<u8>)> {
        let colours = [&["R", "G", "B"][..], &["Y"]];
        if !colours.iter().any(|names| self.image.names == *names && self.reference.names == *names) {
            return None;
        }
        let exposure = exposure_of(&self.reference);
        let (mut image, mut reference) = (display(&self.image, exposure), display(&self.reference, exposure));
        let channels = self.image.channels();
        let pixels = self.image.data.chunks_exact(channels).zip(self.reference.data.chunks_exact(channels));
        for (i, (a, b)) in pixels.enumerate() {
            if !a.iter().chain(b).all(|v| v.is_finite()) {
                image[3 * i..3 * i + 3].fill(0);
                reference[3 * i..3 * i + 3].fill(0);
            }
        }
        Some((image, reference))
    }
}

/// Fails unless two pictures without alpha agree in size, tone and channels.
pub(super) fn alike(image: &Picture, reference: &Picture) -> Result<(), CompareError> {
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
    Ok(())
}

/// Fails unless what goes with the image is of its size.
pub(super) fn same_size(what: &'static str, width: usize, height: usize, image: &Picture) -> Result<(), CompareError> {
    if (width, height) == (image.width, image.height) {
        return Ok(());
    }
    Err(CompareError::Beside { what, width, height, image_width: image.width, image_height: image.height })
}

/// Whether three channels are colours or coordinates.
pub(super) fn is_triple(names: &[String]) -> bool {
    names == ["R", "G", "B"] || names == ["X", "Y", "Z"]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::{Condition, compare, compare_over};

    fn grey(values: &[f32]) -> Picture {
        Picture::linear(values.len(), 1, 1, values.to_vec())
    }

    #[test]
    fn pixels_that_are_not_finite_are_counted_and_left_out() {
        let image = Picture::linear(3, 1, 3, vec![1.0, 1.0, f32::NAN, 2.0, 2.0, 2.0, 1.0, 1.0, 1.0]);
        let reference = Picture::linear(3, 1, 3, vec![9.0, 9.0, 9.0, 2.0, 2.0, 2.0, 1.0, f32::INFINITY, 1.0]);
        let metrics = compare(&image, &reference).expect("comparable");
        assert_eq!((metrics.non_finite_image, metrics.non_finite_reference, metrics.counted()), (1, 1, 1));
        assert_eq!((metrics.rmse, metrics.mean_reference), (0.0, 2.0));
        assert_eq!(metrics.flip, Some(0.0));
    }

    #[test]
    fn without_a_finite_pixel_there_is_no_result() {
        let error = compare(&grey(&[f32::NAN, 1.0]), &grey(&[1.0, f32::NAN])).expect_err("nothing to compare");
        assert_eq!(error, CompareError::NoPixels { non_finite_image: 1, non_finite_reference: 1, masked: 0 });
    }

    #[test]
    fn only_pixels_of_the_mask_count() {
        let (image, reference) = (grey(&[1.0, 5.0, f32::NAN, f32::NAN]), grey(&[1.0, 1.0, 1.0, 1.0]));
        let mask = Mask::new(&grey(&[1.0, 0.0, 0.0, 1.0]), Condition::Above(0.5));
        let metrics = compare_over(&image, &reference, &mask).expect("comparable");
        assert_eq!((metrics.counted(), metrics.masked, metrics.non_finite_image), (1, 2, 1));
        assert_eq!(metrics.rmse, 0.0);
        let none = Mask::new(&grey(&[0.0; 4]), Condition::Above(0.5));
        assert!(matches!(compare_over(&image, &reference, &none), Err(CompareError::NoPixels { masked: 4, .. })));
        let narrow = Mask::new(&grey(&[1.0]), Condition::Above(0.5));
        assert!(matches!(compare_over(&image, &reference, &narrow), Err(CompareError::Beside { what: "mask", width: 1, .. })));
    }

    #[test]
    fn unlike_pictures_are_refused() {
        assert!(matches!(compare(&grey(&[1.0]), &grey(&[1.0, 2.0])), Err(CompareError::Size { .. })));
        let colour = Picture::linear(1, 1, 3, vec![0.0; 3]);
        assert!(matches!(compare(&grey(&[1.0]), &colour), Err(CompareError::Channels { .. })));
        let display = Picture { tone: Tone::Display, ..colour.clone() };
        assert_eq!(compare(&display, &colour), Err(CompareError::Tone { linear: "reference", display: "image" }));
    }

    #[test]
    fn coordinates_compare_with_colours_but_have_no_looks() {
        let colour = Picture::linear(1, 1, 3, vec![0.0, 0.6, 0.8]);
        let normal = Picture { names: ["X", "Y", "Z"].map(str::to_owned).to_vec(), ..colour.clone() };
        let metrics = compare(&colour, &normal).expect("comparable");
        assert_eq!((metrics.rmse, metrics.flip, metrics.ssim), (0.0, None, None));
    }
}
