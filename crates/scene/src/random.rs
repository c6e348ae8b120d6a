//! Small deterministic random numbers: the same on every machine, for ever.

/// A 32-bit hash of good quality (PCG's output function over a linear step, after Jarzynski and Olano 2020).
pub(crate) fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A hash of two numbers.
pub(crate) fn hash2(a: u32, b: u32) -> u32 {
    hash(a ^ hash(b.wrapping_add(0x9e37_79b9)))
}

/// A number in 0…1, without 1.
pub(crate) fn unit(hash: u32) -> f64 {
    f64::from(hash) / 4_294_967_296.0
}

/// Shuffles a slice (Fisher–Yates).
pub(crate) fn shuffle<T>(items: &mut [T], seed: u32) {
    for i in (1..items.len()).rev() {
        let random = unit(hash2(seed, i as u32));
        items.swap(i, (random * (i + 1) as f64) as usize);
    }
}
