//! The display mapping: one exposure from the reference, then the sRGB curve, 8 bits.

use super::nearest_rank;
use crate::{
    files::{Picture, Tone},
    tone::{Meaning, to_bytes},
};

/// The share of pixels that is darker than what comes out at [`BRIGHT`]: a lamp or a few glints do not set the exposure.
const DARKER: f64 = 0.99;
/// The linear value on the display of that luminance. Below 1, so that an image that is too bright there is seen to be.
const BRIGHT: f64 = 0.8;

/// The factor by which a linear reference and all its images are multiplied before they are shown: it brings the 99th percentile of the
/// reference's luminance (Rec. 709; of finite pixels) to 0.8. Where that is not above 0, the largest luminance takes its place; 1 for a
/// black reference, and for one that is made for the display already.
pub fn exposure_of(reference: &Picture) -> f32 {
    if reference.tone == Tone::Display {
        return 1.0;
    }
    let colours = colours(reference);
    let pixels = colours.data.chunks_exact(colours.channels().max(1));
    let mut luminances: Vec<f64> = pixels.map(luminance).filter(|l| l.is_finite()).collect();
    let bright = nearest_rank(&mut luminances, DARKER).filter(|l| *l > 0.0).or(luminances.last().copied());
    bright.filter(|l| *l > 0.0).map_or(1.0, |l| ((BRIGHT / l) as f32).min(f32::MAX))
}

/// A picture as it is shown: times the exposure, clamped to 0…1, by the sRGB curve to 8 bits; three bytes (RGB) a pixel, rows from the
/// top. One channel is grey, alpha is left out, NaN is black. Of a picture made for the display, its own values, whatever the exposure.
pub fn display(picture: &Picture, exposure: f32) -> Vec<u8> {
    let mut colours = colours(picture);
    let meaning = match colours.tone {
        Tone::Display => Meaning::Display,
        Tone::Linear => {
            colours.data.iter_mut().for_each(|v| *v *= exposure);
            Meaning::Light
        }
    };
    match to_bytes(&colours.data, colours.channels(), meaning) {
        (1, grey) => grey.iter().flat_map(|v| [*v; 3]).collect(),
        (_, rgb) => rgb,
    }
}

/// The plain channels in the order R, G, B, without alpha; all channels where there are only layers.
fn colours(picture: &Picture) -> Picture {
    picture.layer("").as_ref().unwrap_or(picture).without_alpha()
}

/// Rec. 709 (IEC 61966-2-1) of three channels, else their mean.
fn luminance(pixel: &[f32]) -> f64 {
    match pixel {
        [r, g, b] => 0.2126 * f64::from(*r) + 0.7152 * f64::from(*g) + 0.0722 * f64::from(*b),
        _ => pixel.iter().map(|v| f64::from(*v)).sum::<f64>() / pixel.len() as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lamp_does_not_set_the_exposure() {
        let mut data = vec![0.02; 1000];
        data[3] = 500.0;
        assert!((exposure_of(&Picture::linear(1000, 1, 1, data)) - 40.0).abs() < 1e-4);
    }

    #[test]
    fn luminance_is_that_of_the_named_channels() {
        let blue_first = ["B", "G", "R"].map(str::to_owned).to_vec();
        let picture = Picture { names: blue_first, ..Picture::linear(1, 1, 3, vec![0.0, 0.0, 4.0]) };
        assert!((exposure_of(&picture) - 0.8 / (0.2126 * 4.0)).abs() < 1e-6);
        assert_eq!(display(&picture, 1.0), [255, 0, 0]);
    }

    #[test]
    fn dark_and_broken_references_have_an_exposure() {
        assert_eq!(exposure_of(&Picture::linear(2, 1, 1, vec![0.0, f32::NAN])), 1.0);
        let mut data = vec![0.0; 200];
        data[0] = 0.1;
        assert!((exposure_of(&Picture::linear(200, 1, 1, data)) - 8.0).abs() < 1e-5);
        assert!(exposure_of(&Picture::linear(1, 1, 1, vec![1e-45])).is_finite());
    }

    #[test]
    fn half_of_the_light_is_188() {
        assert_eq!(display(&Picture::linear(3, 1, 1, vec![0.25, 9.0, f32::NAN]), 2.0), [188, 188, 188, 255, 255, 255, 0, 0, 0]);
        let shown = Picture { tone: Tone::Display, ..Picture::linear(1, 1, 3, vec![0.0, 0.2, 1.0]) };
        assert_eq!((display(&shown, 7.0), exposure_of(&shown)), (vec![0, 51, 255], 1.0));
    }
}
