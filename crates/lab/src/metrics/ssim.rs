//! SSIM: structural similarity.
//!
//! Wang, Bovik, Sheikh, Simoncelli: Image quality assessment: from error visibility to structural similarity (2004), by the crate
//! `blazediff-ssim`: luma (Rec. 601 weights) of 8-bit values, Gaussian window of 11 pixels with σ = 1.5, K₁ = 0.01, K₂ = 0.03, only where
//! the window lies inside, at full resolution.

use blazediff_ssim::{Plane, Rgba8, SsimOptions, ssim};

use super::mean_over;

/// Side of the window.
const WINDOW: usize = 11;
/// The crate halves pictures whose shorter side is 384 pixels or more, as the authors' script does; strips of fewer rows keep the resolution.
const STRIP: usize = 383;

/// SSIM of every pixel, `None` within half a window of the edge; three bytes a pixel. Nothing for pictures narrower than the window.
fn map(image: &[u8], reference: &[u8], width: usize) -> Option<Vec<Option<f32>>> {
    let height = image.len() / 3 / width.max(1);
    if width < WINDOW || height < WINDOW {
        return None;
    }
    let mut map = vec![None; width * height];
    for top in (0..=height - WINDOW).step_by(STRIP - WINDOW + 1) {
        let rows = STRIP.min(height - top);
        let part = 3 * width * top..3 * width * (top + rows);
        let (image, reference) = (luma(&image[part.clone()], width, rows)?, luma(&reference[part], width, rows)?);
        let strip = ssim(&image, &reference, &SsimOptions::default()).ok()?;
        for (row, values) in strip.map.chunks_exact(strip.map_width).enumerate() {
            let at = (top + row + WINDOW / 2) * width + WINDOW / 2;
            map[at..at + values.len()].iter_mut().zip(values).for_each(|(to, value)| *to = Some(*value));
        }
    }
    Some(map)
}

fn luma(rgb: &[u8], width: usize, height: usize) -> Option<Plane> {
    let rgba: Vec<u8> = rgb.chunks_exact(3).flat_map(|c| [c[0], c[1], c[2], 255]).collect();
    Plane::from_rgba8(Rgba8::new(&rgba, width, height)).ok()
}

/// Its mean over the pixels that count.
pub(super) fn mean(image: &[u8], reference: &[u8], width: usize, counts: &[bool]) -> Option<f64> {
    mean_over(counts, map(image, reference, width)?.into_iter())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize, value: impl Fn(usize, usize) -> u8) -> Vec<u8> {
        (0..width * height).flat_map(|i| [value(i % width, i / width); 3]).collect()
    }

    fn texture(x: usize, y: usize) -> u8 {
        (100.0 + 60.0 * (x as f64 * 0.9).sin() * (y as f64 * 0.7).cos()) as u8
    }

    /// The definition, with sums over the window in f64.
    fn by_definition(a: &[u8], b: &[u8], width: usize, x: usize, y: usize) -> f64 {
        let weight = |i: usize| (-(i as f64 - 5.0).powi(2) / 4.5).exp();
        let sum = |f: &dyn Fn(f64, f64) -> f64| {
            let (mut total, mut weights) = (0.0, 0.0);
            for j in 0..11 {
                for i in 0..11 {
                    let at = 3 * ((y + j - 5) * width + x + i - 5);
                    let w = weight(i) * weight(j);
                    total += w * f(f64::from(a[at]), f64::from(b[at]));
                    weights += w;
                }
            }
            total / weights
        };
        let (ma, mb) = (sum(&|a, _| a), sum(&|_, b| b));
        let (va, vb) = (sum(&|a, _| a * a) - ma * ma, sum(&|_, b| b * b) - mb * mb);
        let covariance = sum(&|a, b| a * b) - ma * mb;
        let (c1, c2) = (2.55_f64.powi(2), 7.65_f64.powi(2));
        (2.0 * ma * mb + c1) * (2.0 * covariance + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2))
    }

    #[test]
    fn values_are_those_of_the_definition_across_strips() {
        let (width, height) = (400, 420);
        let a = picture(width, height, texture);
        let b = picture(width, height, |x, y| texture(x + 1, y).saturating_add((x * y % 13) as u8));
        let map = map(&a, &b, width).expect("large enough");
        for (x, y) in [(5, 5), (200, 377), (200, 378), (394, 414), (17, 383)] {
            let (found, expected) = (f64::from(map[y * width + x].expect("inside")), by_definition(&a, &b, width, x, y));
            // f32 sums of squares up to 2¹⁶, and luma weights that sum to 1 to four digits.
            assert!((found - expected).abs() < 2e-3, "{x} {y}: {found} {expected}");
        }
        assert!(map[4 * width + 5].is_none() && map[415 * width + 5].is_none());
        assert_eq!(map.iter().flatten().count(), 390 * 410);
    }

    #[test]
    fn masks_choose_the_centres_of_windows() {
        let a = picture(32, 32, texture);
        let b = picture(32, 32, |x, y| if x < 12 { texture(x, y) } else { 255 - texture(x, y) });
        let left: Vec<bool> = (0..32 * 32).map(|i| i % 32 < 7).collect();
        assert!((mean(&a, &b, 32, &left).expect("pixels") - 1.0).abs() < 1e-6);
        assert!(mean(&a, &b, 32, &[true; 1024]).expect("pixels") < 0.5);
        assert_eq!(mean(&a[..300], &b[..300], 10, &[true; 100]), None);
    }
}
