//! From the numbers of a texture to the bytes of a picture to look at.

/// What the numbers of a texture mean, as far as showing them goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Meaning {
    /// Made for the display: shown as they are.
    Display,
    /// Linear light or albedo: clamped to 0…1 and sRGB-encoded.
    Light,
    /// Distances, indices, counts: stretched from their smallest to their largest finite value.
    Quantity,
    /// Unit vectors: −1…1 becomes 0…1.
    Direction,
}

/// The sRGB curve: a linear value of 0…1 to a display value of 0…1.
pub fn srgb_from_linear(value: f32) -> f32 {
    if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

/// Bytes of grey (one channel) or RGB (more; alpha is left out, a missing third channel is 0), and the number of channels.
/// What is not a number is shown black, infinity as the largest value.
pub fn to_bytes(data: &[f32], channels: usize, meaning: Meaning) -> (usize, Vec<u8>) {
    let channels = channels.max(1);
    let (low, high) = if meaning == Meaning::Quantity { range(data) } else { (0.0, 1.0) };
    let show = |value: f32| {
        let shown = match meaning {
            Meaning::Display => value,
            Meaning::Light => srgb_from_linear(value.clamp(0.0, 1.0)),
            Meaning::Quantity => (value - low) / (high - low),
            Meaning::Direction => 0.5 + 0.5 * value,
        };
        (shown.clamp(0.0, 1.0) * 255.0).round() as u8
    };
    if channels == 1 {
        return (1, data.iter().map(|v| show(*v)).collect());
    }
    let pixels = data.chunks_exact(channels);
    (3, pixels.flat_map(|pixel| [0, 1, 2].map(|c| pixel.get(c).map_or(0, |v| show(*v)))).collect())
}

/// Smallest and largest finite value; a range of 1 where all are equal.
fn range(data: &[f32]) -> (f32, f32) {
    let finite = || data.iter().copied().filter(|v| v.is_finite());
    let low = finite().fold(f32::INFINITY, f32::min);
    let high = finite().fold(f32::NEG_INFINITY, f32::max);
    if low < high { (low, high) } else { (low.min(f32::MAX), low.min(f32::MAX) + 1.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn display_values_are_not_touched() {
        let data: Vec<f32> = (0..=255).map(|v| v as f32 / 255.0).collect();
        let (channels, bytes) = to_bytes(&data, 1, Meaning::Display);
        assert_eq!((channels, bytes), (1, (0..=255).collect()));
    }

    #[test]
    fn light_follows_the_srgb_curve() {
        // IEC 61966-2-1: half of the light is 188 of 255.
        assert_eq!(to_bytes(&[0.0, 0.5, 1.0, 1.0, 7.0, -1.0, f32::NAN, 0.0], 4, Meaning::Light), (3, vec![0, 188, 255, 255, 0, 0]));
    }

    #[test]
    fn quantities_are_stretched_to_their_finite_range() {
        assert_eq!(to_bytes(&[2.0, 4.0, 3.0, f32::INFINITY], 1, Meaning::Quantity).1, [0, 255, 128, 255]);
        assert_eq!(to_bytes(&[5.0, 5.0], 1, Meaning::Quantity).1, [0, 0]);
        assert_eq!(to_bytes(&[f32::NAN], 1, Meaning::Quantity).1, [0]);
    }

    #[test]
    fn directions_are_centred() {
        assert_eq!(to_bytes(&[-1.0, 0.0, 1.0], 3, Meaning::Direction).1, [0, 128, 255]);
    }
}
