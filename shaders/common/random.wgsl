// Seeded pseudo-random and low-discrepancy numbers.

// PCG hash (O'Neill; as a hash: Jarzynski and Olano 2020).
fn hash(value: u32) -> u32 {
    let state = value * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

fn hash3(a: u32, b: u32, c: u32) -> u32 {
    return hash(a ^ hash(b ^ hash(c)));
}

// [0, 1), 24 bits.
fn unit_float(bits: u32) -> f32 {
    return f32(bits >> 8u) * 0x1p-24;
}

// Radical inverse in base 2, exact to 24 bits. [HALTON]
fn radical_inverse_2(index: u32) -> f32 {
    return f32(reverseBits(index) >> 8u) * 0x1p-24;
}

// Radical inverse in base 3: digits are gathered as a whole number, so the only rounding is the last division. [HALTON]
fn radical_inverse_3(index: u32) -> f32 {
    var n = index;
    var digits = 0u;
    var scale = 1u;
    // 3^15 is the largest power of three that an f32 quotient still resolves.
    for (var i = 0u; i < 15u && n > 0u; i++) {
        digits = digits * 3u + n % 3u;
        scale *= 3u;
        n /= 3u;
    }
    return min(f32(digits) / f32(scale), 0x1.fffffep-1);
}

// Point `index` of the Halton sequence in bases 2 and 3, in [0, 1)².
fn halton_23(index: u32) -> vec2f {
    return vec2f(radical_inverse_2(index), radical_inverse_3(index));
}

// Point `index` of the sequence R2 (Roberts 2018), in [0, 1)²: multiples of one over the plastic number and of its square, exact to 24 bits. No loop.
fn r2_point(index: u32) -> vec2f {
    return vec2f(unit_float(index * 3242174889u), unit_float(index * 2447445414u));
}

// Owen's scrambling in a hash: each bit is flipped or not, depending on the bits above it. [BURLEY], after Laine and Karras.
fn owen_scramble(bits: u32, seed: u32) -> u32 {
    var x = reverseBits(bits) + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return reverseBits(x);
}

// Point `index` (below 256) of the first two dimensions of Sobol's sequence, shuffled and scrambled by a seed: any aligned 2^k of the points lie one in
// each of 2^k equal boxes, in [0, 1)². Points of different seeds are independent. [BURLEY]
fn scrambled_sobol(index: u32, seed: u32) -> vec2f {
    var i = owen_scramble(index, seed) & 255u;
    let x = reverseBits(i);
    var y = 0u;
    for (var column = 0x80000000u; i != 0u; column ^= column >> 1u) {
        y ^= select(0u, column, (i & 1u) != 0u);
        i >>= 1u;
    }
    return vec2f(unit_float(owen_scramble(x, hash(seed ^ 1u))), unit_float(owen_scramble(y, hash(seed ^ 2u))));
}
