//! FLIP: how visible a difference is when one flips between two pictures.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: FLIP, a difference evaluator for alternating images (2020), by the
//! authors' C++ through the crate `nv-flip`. It is LDR-FLIP: of pictures on the display, 8 bits.

use nv_flip::{FlipImageRgb8, flip, magma_lut};

use super::mean_over;

/// The authors' default: a display 0.7 m wide with 3840 pixels, seen from 0.7 m.
const DISTANCE_M: f32 = 0.7;
const WIDTH_M: f32 = 0.7;
const WIDTH_PIXELS: f32 = 3840.0;

/// FLIP of every pixel, 0 to 1; three bytes a pixel.
pub(super) fn map(image: &[u8], reference: &[u8], width: usize) -> Vec<f32> {
    let height = image.len() / 3 / width.max(1);
    let of = |bytes: &[u8]| FlipImageRgb8::with_data(width as u32, height as u32, bytes);
    flip(of(reference), of(image), nv_flip::pixels_per_degree(DISTANCE_M, WIDTH_PIXELS, WIDTH_M)).to_vec()
}

/// Its mean over the pixels that count.
pub(super) fn mean(image: &[u8], reference: &[u8], width: usize, counts: &[bool]) -> Option<f64> {
    mean_over(counts, map(image, reference, width).into_iter().map(Some))
}

/// The colours of error maps from dark (no error) to bright, the table `magma` of the authors.
pub(super) fn magma() -> Vec<[u8; 3]> {
    magma_lut().to_vec().chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_against_white_is_nearly_one_and_equal_is_zero() {
        let (black, white) = (vec![0; 3 * 64], vec![255; 3 * 64]);
        assert!(map(&black, &black, 8).iter().all(|v| *v == 0.0));
        // Black and white are the farthest colours but for a saturated pair: above 0.9 by the definition of the colour term.
        let far = map(&white, &black, 8);
        assert!(far.iter().all(|v| (0.9..=1.0).contains(v)), "{far:?}");
    }

    #[test]
    fn a_difference_of_one_step_is_hardly_visible() {
        let mean = mean(&[128; 3 * 64], &[129; 3 * 64], 8, &[true; 64]).expect("pixels");
        assert!(mean > 0.0 && mean < 0.05, "{mean}");
    }

    #[test]
    fn narrow_pictures_work() {
        for (width, height) in [(1, 1), (1, 9), (37, 2)] {
            assert_eq!(map(&vec![9; 3 * width * height], &vec![200; 3 * width * height], width).len(), width * height);
        }
    }

    #[test]
    fn magma_goes_from_black_to_pale_yellow() {
        let colours = magma();
        assert_eq!(colours.len(), 256);
        assert!(colours[0].iter().all(|v| *v < 8) && colours[255][0] > 240 && colours[255][2] < colours[255][0]);
    }
}
