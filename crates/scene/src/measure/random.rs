//! Numbers of one batch of samples: the twin of what `shaders/common/random.wgsl` does for the paths of a pixel.

use crate::random::{hash, hash2};

/// What the samples of a batch spread evenly over it, each independently of the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Purpose {
    /// The point of the picture.
    Pixel = 0x1000,
    /// The ray from a light.
    FromLight = 0x2000,
    /// The direction from what the camera sees.
    Next = 0x3000,
    /// The direction from what a ray from a light met.
    Onward = 0x4000,
    /// The place in a reflective shadow map.
    Texel = 0x5000,
}

/// Numbers of the samples of one batch.
#[derive(Debug, Clone)]
pub(super) struct Random {
    seed: u32,
    /// Samples of the batch, a power of two, less one.
    mask: u32,
    index: u32,
    state: u32,
}

impl Random {
    /// For a batch of `count` samples, a power of two. Batches of different seeds are independent.
    pub(super) fn new(seed: u32, count: u32) -> Self {
        Self { seed, mask: count - 1, index: 0, state: 0 }
    }

    /// Goes on to a sample.
    pub(super) fn start(&mut self, index: u32) {
        self.index = index;
        self.state = hash2(self.seed, index);
    }

    /// Two numbers in 0…1, without 1, that the samples of the batch spread evenly.
    pub(super) fn even(&self, purpose: Purpose) -> [f32; 2] {
        scrambled_sobol(self.index, hash(self.seed ^ purpose as u32), self.mask)
    }

    /// A number in 0…1, without 1, independent of all others.
    pub(super) fn one(&mut self) -> f32 {
        self.state = hash(self.state);
        unit_float(self.state)
    }

    /// Two of them.
    pub(super) fn pair(&mut self) -> [f32; 2] {
        [self.one(), self.one()]
    }
}

/// 24 bits, so that it is below 1 in an `f32`.
fn unit_float(bits: u32) -> f32 {
    (bits >> 8) as f32 / 16_777_216.0
}

/// Owen's scrambling in a hash: each bit is flipped or not, depending on the bits above it (Burley 2020, after Laine and Karras).
fn owen_scramble(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

/// A point of the first two dimensions of Sobol's sequence, shuffled among the `mask` + 1 first ones and scrambled (Burley 2020).
fn scrambled_sobol(index: u32, seed: u32, mask: u32) -> [f32; 2] {
    let mut i = owen_scramble(index, seed) & mask;
    let x = i.reverse_bits();
    let mut y = 0;
    let mut column = 0x8000_0000_u32;
    while i != 0 {
        if i & 1 != 0 {
            y ^= column;
        }
        i >>= 1;
        column ^= column >> 1;
    }
    [owen_scramble(x, hash(seed ^ 1)), owen_scramble(y, hash(seed ^ 2))].map(unit_float)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One point in each of as many equal boxes, of every shape, whatever the seed.
    #[test]
    fn samples_of_a_batch_are_spread_evenly() {
        const COUNT: u32 = 64;
        for seed in [0, 1, 77] {
            let mut random = Random::new(seed, COUNT);
            for columns in [1_u32, 2, 8, 32, 64] {
                let rows = COUNT / columns;
                let mut taken = vec![false; COUNT as usize];
                for index in 0..COUNT {
                    random.start(index);
                    let [x, y] = random.even(Purpose::Next);
                    let cell = (x * columns as f32) as u32 * rows + (y * rows as f32) as u32;
                    assert!(
                        !std::mem::replace(&mut taken[cell as usize], true),
                        "seed {seed}: two samples in one of {columns}×{rows} boxes"
                    );
                }
            }
        }
    }
}
