//! Principal components of key frames ([PCA] 3.2), by the eigenvectors of their Gram matrix: with n frames of m values that is an n×n problem instead
//! of an m×m one, and has the same components.

use nalgebra::{DMatrix, SymmetricEigen};

/// Eigenvalues below this share of the largest are rounding: their components would be noise.
const RANK_TOLERANCE: f64 = 1e-12;
/// Values of all frames that are taken together, which bounds memory.
const CHUNK: usize = 4096;

/// Frames as a mean and components: frame i is `mean + Σ_j weights[i][j] · components[j]`.
#[derive(Debug, Clone)]
pub struct Pca {
    /// Mean of the frames, or zero where it was not taken off.
    pub mean: Vec<f32>,
    /// Of unit length, orthogonal, the one with the largest variance first.
    pub components: Vec<Vec<f32>>,
    /// For each frame the weight of each component.
    pub weights: Vec<Vec<f64>>,
    /// Share of the variance that the first 1, 2, … components hold.
    pub kept: Vec<f64>,
}

impl Pca {
    /// Components of frames of equal length. All that are more than rounding are found; there are at most as many as frames. `subtract_mean` takes the mean
    /// of the frames off first. Of no frame there is nothing.
    pub fn of(frames: &[&[f32]], subtract_mean: bool) -> Self {
        let Some(first) = frames.first() else {
            return Self { mean: Vec::new(), components: Vec::new(), weights: Vec::new(), kept: Vec::new() };
        };
        let values = first.len();
        let mut mean = vec![0.0_f32; values];
        if subtract_mean {
            for (i, mean) in mean.iter_mut().enumerate() {
                *mean = (frames.iter().map(|frame| f64::from(frame[i])).sum::<f64>() / frames.len() as f64) as f32;
            }
        }
        let mut gram = DMatrix::<f64>::zeros(frames.len(), frames.len());
        for first in (0..values).step_by(CHUNK) {
            let part = centred(frames, &mean, first, CHUNK.min(values - first));
            gram += part.tr_mul(&part);
        }
        // The trace before the eigenvalues are found: their sum must be it.
        let total = gram.trace();
        let eigen = SymmetricEigen::new(gram);
        let mut order: Vec<usize> = (0..frames.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let largest = order.first().map_or(0.0, |i| eigen.eigenvalues[*i]);
        order.retain(|i| eigen.eigenvalues[*i] > RANK_TOLERANCE * largest && eigen.eigenvalues[*i] > 0.0);

        let sigma: Vec<f64> = order.iter().map(|i| eigen.eigenvalues[*i].sqrt()).collect();
        // Frames into components: columns of eigenvectors over the singular values.
        let project = DMatrix::from_fn(frames.len(), order.len(), |row, column| eigen.eigenvectors[(row, order[column])] / sigma[column]);
        let mut components = vec![Vec::with_capacity(values); order.len()];
        for first in (0..values).step_by(CHUNK) {
            let part = centred(frames, &mean, first, CHUNK.min(values - first)) * &project;
            for (component, column) in components.iter_mut().zip(part.column_iter()) {
                component.extend(column.iter().map(|v| *v as f32));
            }
        }
        let weights = (0..frames.len()).map(|i| (0..order.len()).map(|j| eigen.eigenvectors[(i, order[j])] * sigma[j]).collect()).collect();
        let mut sum = 0.0;
        let kept = sigma
            .iter()
            .map(|sigma| {
                sum += sigma * sigma;
                if total > 0.0 { (sum / total).min(1.0) } else { 1.0 }
            })
            .collect();
        Self { mean, components, weights, kept }
    }

    /// How many components hold a share of the variance; all of them if none do.
    pub fn components_for(&self, share: f64) -> usize {
        self.kept.iter().position(|kept| *kept >= share).map_or(self.kept.len(), |index| index + 1)
    }

    /// A frame from its first `components`.
    pub fn reconstruct(&self, frame: usize, components: usize) -> Vec<f32> {
        let mut out: Vec<f64> = self.mean.iter().map(|v| f64::from(*v)).collect();
        for (component, weight) in self.components.iter().zip(&self.weights[frame]).take(components) {
            out.iter_mut().zip(component).for_each(|(out, v)| *out += weight * f64::from(*v));
        }
        out.into_iter().map(|v| v as f32).collect()
    }
}

/// Some values of all frames without their mean: a row a value, a column a frame.
fn centred(frames: &[&[f32]], mean: &[f32], first: usize, rows: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, frames.len(), |row, column| f64::from(frames[column][first + row]) - f64::from(mean[first + row]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A light that moves: blobs at other places, plus a little that does not repeat.
    fn frames(count: usize, values: usize) -> Vec<Vec<f32>> {
        let value = |i: usize, p: usize| {
            let (place, at) = (p as f64 / values as f64, i as f64 / count as f64);
            (-(8.0 * (place - at)).powi(2)).exp() + 0.1 * place + 1e-3 * ((i * 7919 + p * 104_729) % 97) as f64 / 97.0
        };
        (0..count).map(|i| (0..values).map(|p| value(i, p) as f32).collect()).collect()
    }

    fn slices(frames: &[Vec<f32>]) -> Vec<&[f32]> {
        frames.iter().map(Vec::as_slice).collect()
    }

    /// Sum of squared differences of all frames from what `k` components give, in 64 bits.
    fn lost(pca: &Pca, frames: &[Vec<f32>], k: usize) -> f64 {
        let of = |i: usize| pca.reconstruct(i, k).iter().zip(&frames[i]).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
        (0..frames.len()).map(of).sum()
    }

    #[test]
    fn all_components_give_the_frames_back() {
        // More values than a chunk, so that chunks are joined.
        let frames = frames(12, 5000);
        for subtract_mean in [true, false] {
            let pca = Pca::of(&slices(&frames), subtract_mean);
            for (i, frame) in frames.iter().enumerate() {
                let back = pca.reconstruct(i, pca.components.len());
                let worst = back.iter().zip(frame).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                // Mean and components are rounded to 24 bits, and values are at most 1.1: each of at most 13 terms is off by less than 2⁻²⁴ of about 1.
                // Components left out for RANK_TOLERANCE hold 10⁻⁶ of the largest amplitude or less.
                assert!(worst < 5e-6, "{worst}");
            }
        }
    }

    #[test]
    fn kept_variance_is_what_reconstruction_keeps() {
        let frames = frames(16, 300);
        let pca = Pca::of(&slices(&frames), true);
        let total = lost(&pca, &frames, 0);
        for k in 1..=pca.components.len() {
            // The twin: 1 − lost / total, summed in 64 bits over the frames themselves. Rounding to 24 bits loses about 10⁻¹³ of the total.
            let expected = 1.0 - lost(&pca, &frames, k) / total;
            assert!((pca.kept[k - 1] - expected).abs() < 1e-9, "{k}: {} {expected}", pca.kept[k - 1]);
        }
        assert!(pca.kept.windows(2).all(|pair| pair[0] <= pair[1]));
        assert!((pca.kept[pca.kept.len() - 1] - 1.0).abs() < 1e-9);
    }

    #[test]
    fn components_are_orthonormal() {
        let frames = frames(9, 200);
        let pca = Pca::of(&slices(&frames), true);
        for (i, a) in pca.components.iter().enumerate() {
            for (j, b) in pca.components.iter().enumerate() {
                let dot: f64 = a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum();
                // Eigenvalues span up to 10⁴ to the smallest kept here: rounding of the Gram matrix is magnified as much.
                assert!((dot - f64::from(u8::from(i == j))).abs() < 1e-5, "{i} {j}: {dot}");
            }
        }
        assert!(pca.components.len() < frames.len(), "without the mean, n frames have at most n − 1 components");
    }

    #[test]
    fn the_number_of_components_follows_from_a_share() {
        let pca = Pca::of(&slices(&frames(16, 300)), true);
        let k = pca.components_for(0.95);
        assert!(pca.kept[k - 1] >= 0.95 && (k == 1 || pca.kept[k - 2] < 0.95));
        assert_eq!(pca.components_for(2.0), pca.kept.len());
    }

    /// Frames among which the components are none, fewer than frames, or rounding.
    #[test]
    fn frames_that_repeat_are_given_back_exactly() {
        let (a, b): (Vec<f32>, Vec<f32>) = ((0..50).map(|i| i as f32 * 0.25).collect(), (0..50).map(|i| 12.0 - i as f32 * 0.5).collect());
        let black = vec![0.0; 50];
        let cases: [(&str, Vec<&[f32]>); 7] = [
            ("one frame", vec![&a]),
            ("one black frame", vec![&black]),
            ("black frames", vec![&black, &black, &black]),
            ("equal frames", vec![&a, &a, &a]),
            ("two equal of three", vec![&a, &b, &a]),
            ("two pairs", vec![&a, &b, &a, &b]),
            ("no frame", vec![]),
        ];
        for (what, frames) in cases {
            for subtract_mean in [true, false] {
                let pca = Pca::of(&frames, subtract_mean);
                assert!(pca.components.len() <= 2 && pca.kept.len() == pca.components.len(), "{what}: {} components", pca.components.len());
                assert!(pca.components.iter().flatten().chain(&pca.mean).all(|v| v.is_finite()), "{what}");
                assert!(pca.weights.iter().flatten().chain(&pca.kept).all(|v| v.is_finite()), "{what}");
                for (i, frame) in frames.iter().enumerate() {
                    // More components than there are is all of them.
                    let back = pca.reconstruct(i, 100);
                    let worst = back.iter().zip(*frame).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                    // Values up to 12.5 and a component, each rounded to 24 bits.
                    assert!(worst < 1e-5, "{what}, frame {i}: {worst}");
                }
            }
        }
    }

    #[test]
    fn equal_frames_have_no_component() {
        let frames = vec![vec![0.5_f32; 10]; 4];
        let pca = Pca::of(&slices(&frames), true);
        assert!(pca.components.is_empty() && pca.kept.is_empty());
        assert_eq!(pca.reconstruct(2, 0), frames[2]);
    }
}
