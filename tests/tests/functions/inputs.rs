//! What functions are called with: proptest strategies that favour the edges, drawn with a seed that is always the same.

use std::f64::consts::PI;

use glam::DVec3;
use proptest::{
    prelude::{BoxedStrategy, Just, Strategy, prop_oneof},
    sample::select,
    strategy::ValueTree,
    test_runner::TestRunner,
};

/// Arguments of a call, or a part of them, one number after another.
pub type Numbers = BoxedStrategy<Vec<f64>>;

/// The largest number below 1 that a shader can hold.
pub const ALMOST_ONE: f64 = 0.999_999_940_395_355_2;
/// The largest number that a shader can hold.
pub const LARGEST: f64 = f32::MAX as f64;

/// Draws from a strategy; always the same.
pub fn draw(strategy: &Numbers, count: usize) -> Vec<Vec<f64>> {
    let mut runner = TestRunner::deterministic();
    (0..count).map(|_| strategy.new_tree(&mut runner).expect("strategies here refuse nothing").current()).collect()
}

/// One part after another.
pub fn join(parts: impl IntoIterator<Item = Numbers>) -> Numbers {
    parts.into_iter().collect::<Vec<_>>().prop_map(|parts| parts.concat()).boxed()
}

/// One of these numbers.
pub fn one_of(values: &[f64]) -> Numbers {
    select(values.to_vec()).prop_map(|v| vec![v]).boxed()
}

/// A number of an interval; its ends, zero (if it is inside) and what is next to them are likelier than their neighbours.
pub fn real(low: f64, high: f64) -> Numbers {
    let width = high - low;
    let edges = [low, high, low + 1e-6 * width, high - 1e-6 * width, 0.5 * (low + high), 0.0, -0.0, 1.0, -1.0, 1e-7, -1e-7];
    let edges: Vec<f64> = edges.into_iter().filter(|v| (low..=high).contains(v)).collect();
    prop_oneof![1 => select(edges), 4 => low..=high].prop_map(|v| vec![v]).boxed()
}

/// A positive number whose logarithm is uniform.
pub fn magnitude(low: f64, high: f64) -> Numbers {
    prop_oneof![1 => select(vec![low, high]), 6 => (low.ln()..=high.ln()).prop_map(f64::exp)]
        .prop_map(move |v| vec![v.clamp(low, high)])
        .boxed()
}

/// The same, zero, or the smallest numbers there are.
pub fn magnitude_or_zero(low: f64, high: f64) -> Numbers {
    prop_oneof![1 => one_of(&[0.0, 1e-45, 1.2e-38]), 9 => magnitude(low, high)].boxed()
}

/// A number of [0, 1).
pub fn unit_interval() -> Numbers {
    prop_oneof![1 => one_of(&[0.0, ALMOST_ONE, 0.5, 0.25, 1.0 / 3.0, 1e-8, 1.0 - 1e-6, 1e-30]), 6 => (0.0..ALMOST_ONE).prop_map(|v| vec![v])].boxed()
}

/// Any 32 bits as a number; small ones, powers of two and all bits set are likelier.
pub fn word() -> Numbers {
    let any = proptest::num::u32::ANY;
    prop_oneof![
        1 => select(vec![0, 1, 2, 3, u32::MAX, u32::MAX - 1, 1 << 31, (1 << 31) - 1]),
        2 => (0_u32..32).prop_map(|k| 1 << k),
        3 => 0_u32..4096,
        6 => any,
    ]
    .prop_map(|v| vec![f64::from(v)])
    .boxed()
}

/// A whole number below `end`.
pub fn index(end: u32) -> Numbers {
    prop_oneof![1 => select(vec![0, end - 1]), 6 => 0..end].prop_map(|v| vec![f64::from(v)]).boxed()
}

/// 0 or 1.
pub fn switch() -> Numbers {
    one_of(&[0.0, 1.0])
}

/// A vector of unit length: the axes, close to them, where components change their sign, diagonals, and uniform over the sphere.
pub fn unit_vector() -> Numbers {
    prop_oneof![2 => select(special_directions()), 6 => direction()].prop_map(|v| v.to_array().to_vec()).boxed()
}

/// Uniform over the sphere.
pub fn direction() -> impl Strategy<Value = DVec3> {
    (-1.0..=1.0_f64, -PI..PI).prop_map(|(z, angle)| {
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * angle.cos(), r * angle.sin(), z)
    })
}

fn special_directions() -> Vec<DVec3> {
    let mut all = Vec::new();
    let steps = [-1.0, -1e-3, -1e-7, -0.0, 0.0, 1e-20, 1e-7, 1e-3, 1.0];
    for x in steps {
        for y in steps {
            for z in steps {
                let v = DVec3::new(x, y, z);
                if v.abs().max_element() > 0.5 {
                    all.push(v.normalize());
                }
            }
        }
    }
    all
}

/// A vector of any length between two.
pub fn vector(shortest: f64, longest: f64) -> Numbers {
    (unit_vector(), magnitude(shortest, longest)).prop_map(|(d, l)| d.iter().map(|v| v * l[0]).collect()).boxed()
}

/// A colour: black, white, one channel, or anything up to `brightest`.
pub fn colour(brightest: f64) -> Numbers {
    let channel = move || prop_oneof![1 => Just(0.0), 1 => Just(brightest), 4 => 0.0..=brightest];
    (channel(), channel(), channel()).prop_map(|(r, g, b)| vec![r, g, b]).boxed()
}

/// An orthonormal basis, right, up and forward: right × up = −forward.
pub fn frame() -> Numbers {
    unit_vector()
        .prop_map(|f| {
            let forward = DVec3::from_slice(&f).normalize();
            let (right, up) = (-forward).any_orthonormal_pair();
            [right, up, forward].iter().flat_map(|v| v.to_array()).collect()
        })
        .boxed()
}
