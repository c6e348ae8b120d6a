//! Numbers that look random, low-discrepancy sequences, and whole-number arithmetic of indices.

use super::{
    harness::{Bound, Case, EXACT, Want, check, relative, ulps, values},
    inputs::{index, join, word},
};

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    vec![
        Case::new("random::hash", "value: u32").gives("u32").random(word()).twin(EXACT, |i| values([hash(i[0] as u32).into()])),
        Case::new("random::hash3", "a: u32, b: u32, c: u32")
            .gives("u32")
            .random(join([word(), word(), word()]))
            .twin(EXACT, |i| values([hash(i[0] as u32 ^ hash(i[1] as u32 ^ hash(i[2] as u32))).into()])),
        Case::new("random::unit_float", "bits: u32").gives("f32").random(word()).twin(EXACT, |i| values([unit(i[0] as u32)])),
        Case::new("random::radical_inverse_2", "index: u32")
            .gives("f32")
            .edges(sequence())
            .random(word())
            // Bits beyond the 24th of the exact number are cut off.
            .twin(EXACT, |i| values([(radical_inverse(2, i[0] as u64) * f64::from(1 << 24)).floor() / f64::from(1 << 24)])),
        Case::new("random::radical_inverse_3", "index: u32")
            .gives("f32")
            .edges(sequence())
            .random(word())
            .twin(BASE_3, |i| vec![base_3(i[0])]),
        Case::new("random::halton_23", "index: u32").gives("vec2f").edges(sequence()).random(word()).twin(BASE_3, |i| {
            let base_2 = (radical_inverse(2, i[0] as u64) * f64::from(1 << 24)).floor() / f64::from(1 << 24);
            vec![Want::new(base_2), base_3(i[0])]
        }),
        Case::new("random::r2_point", "index: u32").gives("vec2f").edges(sequence()).random(word()).twin(
            relative(0.0, "multiples are exact modulo 2³², and bits beyond the 24th are cut off"),
            |i| {
                // The plastic number: x³ = x + 1. Fixed point with 32 bits after the point, as the sequence is defined there.
                let plastic = 1.324_717_957_244_746_f64;
                let multiple = |share: f64| unit((i[0] as u32).wrapping_mul((share * 2_f64.powi(32)).round() as u32));
                values([multiple(1.0 / plastic), multiple(1.0 / (plastic * plastic))])
            },
        ),
        Case::new("random::owen_scramble", "bits: u32, seed: u32")
            .gives("u32")
            .random(join([word(), word()]))
            .twin(EXACT, |i| values([scramble(i[0] as u32, i[1] as u32).into()])),
        Case::new("random::scrambled_sobol", "index: u32, seed: u32").gives("vec2f").random(join([index(256), word()])).twin(EXACT, |i| {
            let seed = i[1] as u32;
            let index = scramble(i[0] as u32, seed) & 255;
            let [x, y] = sobol(index);
            values([unit(scramble(x, hash(seed ^ 1))), unit(scramble(y, hash(seed ^ 2)))])
        }),
        Case::new("dispatch::linear_index", "id: vec3u, groups: vec3u, workgroup_width: u32")
            .gives("u32")
            .random(join([index(64 * 65_535), index(1024), index(2), index(65_536), index(1025), index(2), index(257)]))
            .twin(EXACT, |i| {
                let row = i[3] as u64 * i[6] as u64;
                values([f64::from((i[0] as u64 + i[1] as u64 * row) as u32)])
            }),
        Case::new("tiles::pixel_of_split", "split: vec2u, tile: vec2u, n: u32")
            .gives("vec2u")
            .random(tiles())
            .twin(EXACT, |i| values([0, 1].map(|axis| (i[axis] % i[2 + axis]) * i[4] + (i[axis] / i[2 + axis]).floor()))),
        Case::new("tiles::split_of_pixel", "pixel: vec2u, tile: vec2u, n: u32")
            .gives("vec2u")
            .random(tiles())
            .twin(EXACT, |i| values([0, 1].map(|axis| (i[axis] % i[4]) * i[2 + axis] + (i[axis] / i[4]).floor()))),
        // There and back: the light of a point's light is the point, whatever the numbers.
        Case::new("tiles::point_of_light", "c: u32, count: u32, n: u32").gives("u32").random(lights()).twin(EXACT, |i| {
            let (light, count, period) = (i[0] as u32, i[1] as u32, (i[2] * i[2]) as u32);
            // Lights of the tiles before, and of this one before.
            let before =
                (0..count).filter(|c| c % period < light % period).count() + (0..light).filter(|c| c % period == light % period).count();
            values([before as f64])
        }),
        Case::new("tiles::light_of_point", "point: u32, count: u32, n: u32").gives("u32").random(lights()).twin(EXACT, |i| {
            let (count, period) = (i[1] as u32, (i[2] * i[2]) as u32);
            let mut lights: Vec<u32> = (0..count).collect();
            lights.sort_by_key(|c| (c % period, *c));
            values([f64::from(lights[i[0] as usize])])
        }),
    ]
}

const BASE_3: Bound = ulps(
    2.5,
    "digits are whole numbers up to 3¹⁵: both are rounded when they become floats at most once, and WGSL allows a quotient 2.5 ulp",
);

/// Indices of which the values are compared with exact rationals, one by one.
fn sequence() -> impl Iterator<Item = Vec<f64>> {
    (0..100_000).map(|i| vec![f64::from(i)])
}

/// The radical inverse by its definition, as the quotient of two whole numbers.
fn radical_inverse(base: u64, index: u64) -> f64 {
    let (mut digits, mut scale, mut rest) = (0, 1, index);
    while rest > 0 {
        digits = digits * base + rest % base;
        scale *= base;
        rest /= base;
    }
    digits as f64 / scale as f64
}

/// In base 3, of the first fifteen digits, and below 1.
fn base_3(index: f64) -> Want {
    Want::new(radical_inverse(3, index as u64 % 3_u64.pow(15)))
}

pub fn unit(bits: u32) -> f64 {
    f64::from(bits >> 8) / f64::from(1 << 24)
}

/// PCG's output function RXS-M-XS for a state that is advanced once (O'Neill 2014, 6.3.4).
pub fn hash(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let shift = (state >> 28) + 4;
    let word = (state ^ (state >> shift)).wrapping_mul(277_803_737);
    word ^ (word >> 22)
}

/// [BURLEY], listing 3, between two reversals: Laine and Karras' permutation with better constants.
pub fn scramble(bits: u32, seed: u32) -> u32 {
    let mut x = bits.reverse_bits().wrapping_add(seed);
    for multiplier in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6_u32] {
        x ^= x.wrapping_mul(multiplier);
    }
    x.reverse_bits()
}

/// The first two dimensions of Sobol's sequence: the radical inverse, and the product with Pascal's triangle modulo 2 (its direction numbers).
pub fn sobol(index: u32) -> [u32; 2] {
    let mut y = 0;
    for column in 0..32 {
        if index >> column & 1 == 1 {
            // Bit `row` from the top of a column is the binomial coefficient C(column, row) modulo 2: odd if row is a subset of column (Lucas).
            y ^= (0..=column).filter(|row| row & column == *row).fold(0, |sum, row| sum | 1 << (31 - row));
        }
    }
    [index.reverse_bits(), y]
}

fn tiles() -> super::inputs::Numbers {
    use proptest::strategy::Strategy;
    (1_u32..=8, 1_u32..=512, 1_u32..=512)
        .prop_flat_map(|(n, w, h)| (0..w * n, 0..h * n).prop_map(move |(x, y)| [x, y, w, h, n].map(f64::from).to_vec()))
        .boxed()
}

fn lights() -> super::inputs::Numbers {
    use proptest::strategy::Strategy;
    (1_u32..=8, 1_u32..=600).prop_flat_map(|(n, count)| (0..count).prop_map(move |c| [c, count, n].map(f64::from).to_vec())).boxed()
}

#[test]
fn random_numbers_and_indices_are_as_their_twins() {
    check(cases());
}
