//! Which pixels count.

use crate::files::Picture;

/// What the value of a pixel must be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Condition {
    /// Above a threshold.
    Above(f32),
    /// Below a threshold.
    Below(f32),
}

/// The pixels over which metrics are taken.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mask {
    pub(super) width: usize,
    pub(super) height: usize,
    holds: Vec<bool>,
}

impl Mask {
    /// The pixels of a picture where a condition holds for its channel; where there are several, for the mean of all but alpha.
    /// It holds for no value that is not a number.
    pub fn new(picture: &Picture, condition: Condition) -> Self {
        let plain = picture.without_alpha();
        let channels = plain.channels().max(1);
        let holds = |pixel: &[f32]| {
            let value = pixel.iter().sum::<f32>() / channels as f32;
            match condition {
                Condition::Above(threshold) => value > threshold,
                Condition::Below(threshold) => value < threshold,
            }
        };
        Self { width: plain.width, height: plain.height, holds: plain.data.chunks_exact(channels).map(holds).collect() }
    }

    /// Number of pixels inside.
    pub fn count(&self) -> usize {
        self.holds.iter().filter(|holds| **holds).count()
    }

    /// Whether a pixel is inside, by its index.
    pub(super) fn holds(&self, pixel: usize) -> bool {
        self.holds[pixel]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conditions_are_of_the_mean_without_alpha() {
        let picture = Picture::linear(3, 1, 4, vec![0.0, 0.0, 3.0, 9.0, 0.0, 0.0, 0.9, 9.0, f32::NAN, 9.0, 9.0, 9.0]);
        let above = Mask::new(&picture, Condition::Above(0.5));
        assert_eq!((above.count(), above.holds(0), above.holds(2)), (1, true, false));
        let below = Mask::new(&picture, Condition::Below(0.5));
        assert_eq!((below.count(), below.holds(1)), (1, true));
        assert_eq!(Mask::new(&Picture::linear(1, 1, 1, vec![0.5]), Condition::Above(0.5)).count(), 0);
    }
}
