//! Change from frame to frame that is no motion.

use super::{
    CompareError, Mask,
    pair::{Pair, alike},
};
use crate::files::Picture;

/// How much a sequence flickers: the mean of |f(t−1) − 2 f(t) + f(t+1)| over the mean of f(t), over all pixels, channels and frames that
/// have a neighbour on both sides. A steady picture and one that brightens evenly have 0, one that alternates between 0 and 2 has 4.
///
/// Only two frames are kept. A pixel that is not finite in one of three frames is left out of those three. `None` for fewer than three
/// frames and for black ones.
///
/// # Errors
/// Frames, or a frame and the mask, differ in size; frames differ in channels or tone.
pub fn flicker(frames: impl IntoIterator<Item = Picture>, mask: Option<&Mask>) -> Result<Option<f64>, CompareError> {
    let (mut change, mut light) = (0.0, 0.0);
    let mut last: [Option<Picture>; 2] = [None, None];
    for frame in frames {
        let frame = frame.without_alpha();
        let [before, middle] = last;
        if let Some(middle) = &middle {
            alike(&frame, middle)?;
        }
        if let (Some(before), Some(middle)) = (&before, &middle) {
            let pair = match Pair::new(&frame, before, mask) {
                // Nothing of these three frames is left.
                Err(CompareError::NoPixels { .. }) => None,
                pair => Some(pair?),
            };
            let channels = middle.channels();
            for (i, after, before) in pair.iter().flat_map(Pair::pixels) {
                let now = &middle.data[i * channels..(i + 1) * channels];
                if now.iter().all(|v| v.is_finite()) {
                    for ((before, now), after) in before.iter().zip(now).zip(after) {
                        let (before, now, after) = (f64::from(*before), f64::from(*now), f64::from(*after));
                        change += (before - 2.0 * now + after).abs();
                        light += now;
                    }
                }
            }
        }
        last = [middle, Some(frame)];
    }
    Ok((light > 0.0).then(|| change / light))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Condition;

    fn frames(values: &[[f32; 2]]) -> Vec<Picture> {
        values.iter().map(|v| Picture::linear(2, 1, 1, v.to_vec())).collect()
    }

    #[test]
    fn steady_and_even_change_do_not_flicker() {
        assert_eq!(flicker(frames(&[[1.0, 2.0]; 4]), None), Ok(Some(0.0)));
        assert_eq!(flicker(frames(&[[1.0, 8.0], [2.0, 6.0], [3.0, 4.0]]), None), Ok(Some(0.0)));
    }

    #[test]
    fn alternation_is_four_times_its_mean() {
        let alternating = [[0.0, 2.0], [2.0, 0.0], [0.0, 2.0], [2.0, 0.0]];
        assert_eq!(flicker(frames(&alternating), None), Ok(Some(4.0)));
        // By hand: |1 − 2·2 + 4| = 1 over 2.
        assert_eq!(flicker(frames(&[[1.0, 0.0], [2.0, 0.0], [4.0, 0.0]]), None), Ok(Some(0.5)));
    }

    #[test]
    fn what_is_not_finite_or_masked_is_left_out() {
        let broken = frames(&[[1.0, f32::NAN], [2.0, 0.0], [4.0, 0.0]]);
        assert_eq!(flicker(broken, None), Ok(Some(0.5)));
        let first = Mask::new(&Picture::linear(2, 1, 1, vec![1.0, 0.0]), Condition::Above(0.5));
        assert_eq!(flicker(frames(&[[1.0, 9.0], [2.0, 0.0], [4.0, 9.0]]), Some(&first)), Ok(Some(0.5)));
        assert_eq!(flicker(frames(&[[f32::NAN; 2]; 3]), None), Ok(None));
        assert_eq!(flicker(frames(&[[1.0; 2]; 2]), None), Ok(None));
    }

    #[test]
    fn frames_of_unlike_size_are_refused() {
        for at in 0..3 {
            let mut unlike = frames(&[[1.0; 2]; 2]);
            unlike.insert(at, Picture::linear(1, 1, 1, vec![1.0]));
            assert!(matches!(flicker(unlike, None), Err(CompareError::Size { .. })), "{at}");
        }
    }
}
