//! Precomputed light: at which time it is which, and which texels have that of a surface.

use std::sync::Arc;

use glam::DVec3;
use half::f16;
use manylight_graph::value::Format;
use manylight_passes::baked::{Baked, Header, Lookup, NOWHERE};
use proptest::strategy::Strategy;

use super::{
    harness::{Case, EXACT, Resource, Want, absolute, check, values},
    inputs::{Numbers, index, join, magnitude, one_of, real, switch},
};

/// Texels along a side.
const SIDE: i64 = 16;
/// Mean, two components, sky.
const LAYERS: i64 = 4;
const MIDNIGHT: f64 = 86_400.0;
/// Arguments that place a texel, up to three texels beside the picture, and the statement that does.
const TEXEL: &str = "x: u32, y: u32";
const MAKE_TEXEL: &str = "let texel = vec2i(i32(x), i32(y)) - 3;";

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    let layers = Arc::new(Layers::new());
    let now = layers.baked().weights_at(50_000.0, 1.0);
    [midnight(&layers), sums(&layers, &now), finds(&layers, &now)].into_iter().flatten().collect()
}

/// Texels of all layers.
struct Layers(Vec<Vec<f16>>);

impl Layers {
    /// Light of chance; distances of a plane that is seen steeply, of chance, and of a wall with holes.
    fn new() -> Self {
        let random = |seed: i64| f64::from(super::random::hash(seed as u32) % 1000) / 500.0 - 0.5;
        let number = |layer: i64, y: i64, x: i64, channel: i64| match (layer, channel, x) {
            (0, 3, ..8) => -(0.05 + 0.04 * x as f64 + 0.01 * y as f64).log2(),
            (0, 3, 8..12) => 2.0 * random(SIDE * y + x),
            (0, 3, _) if (x + y) % 3 == 0 => NOWHERE.into(),
            (0, 3, _) => 2.0,
            _ => random(((layer * SIDE + y) * SIDE + x) * 4 + channel),
        };
        let texel = |layer, y, x| (0..4).map(move |channel| f16::from_f64(number(layer, y, x, channel)));
        let row = |layer, y| (0..SIDE).flat_map(move |x| texel(layer, y, x));
        Self((0..LAYERS).map(|layer| (0..SIDE).flat_map(move |y| row(layer, y)).collect()).collect())
    }

    /// A day of three key frames.
    fn baked(&self) -> Baked {
        let header = Header {
            scene: "day".into(),
            scene_hash: String::new(),
            lookup: Lookup::Image,
            width: SIDE as usize,
            height: SIDE as usize,
            triangles: 0,
            components: 2,
            keys: vec![7200.0, 36_000.0, 79_200.0],
            period_s: MIDNIGHT,
            kept_variance: vec![0.9, 0.99],
            mean_subtracted: true,
            dark_keys: 0,
            sky_scale: 2.5,
            paths: 16,
            manylight: String::new(),
        };
        Baked { header, weights: vec![1.0, 0.5, -0.25, 1.0, 2.0, 0.125, 1.0, -1.0, 1.0], texels: self.0.concat(), corners: Vec::new() }
    }

    fn reads(&self, weights: &[f32]) -> [Resource; 2] {
        let size = (SIDE as u32, SIDE as u32);
        [Resource::buffer("baked_weights", "f32", weights), Resource::texture_array("baked_light", Format::Rgba16Float, size, &self.0)]
    }

    /// A number of the nearest texel that there is.
    fn number(&self, layer: usize, [x, y]: [i64; 2], channel: usize) -> f64 {
        let [x, y] = [x, y].map(|v| v.clamp(0, SIDE - 1));
        self.0[layer][4 * (SIDE * y + x) as usize + channel].to_f64()
    }

    fn colour(&self, layer: usize, texel: [i64; 2]) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|channel| self.number(layer, texel, channel)))
    }

    /// Logarithm to base 2.
    fn distance(&self, texel: [i64; 2]) -> f64 {
        self.number(0, texel, 3)
    }

    fn light(&self, now: &[f32], texel: [i64; 2], with_sky: bool) -> DVec3 {
        let sum: DVec3 = (0..3 + usize::from(with_sky)).map(|layer| f64::from(now[layer]) * self.colour(layer, texel)).sum();
        sum.max(DVec3::ZERO)
    }
}

/// At times around midnight: the last key frame of a day, half way to the first of the next, and others.
fn midnight(layers: &Arc<Layers>) -> Vec<Case> {
    let nights = [
        (79_200.0, 2, 0, 0.0),
        (MIDNIGHT, 2, 0, 0.5),
        (0.0, 2, 0, 0.5),
        (MIDNIGHT - 1e-3, 2, 0, 0.5 - 1e-3 / 14_400.0),
        (7199.0, 2, 0, 1.0 - 1.0 / 14_400.0),
        (7200.0, 0, 1, 0.0),
    ];
    let of_night = |(time, before, after, alpha): (f64, usize, usize, f64)| {
        let daylight = 0.25;
        let (baked, layers) = (layers.baked(), Arc::clone(layers));
        let row = |key: usize| [0, 1, 2].map(|column| f64::from(baked.weights[3 * key + column]));
        // [PCA] eq. 2, of the light of both key frames.
        let [from, to] = [row(before), row(after)];
        Case::new("baked::baked_texel", "texel: vec2u, with_sky: bool")
            .gives("vec3f")
            .reads(&layers.reads(&baked.weights_at(time, daylight)))
            .random(join([index(SIDE as u32), index(SIDE as u32), switch()]))
            .twin(absolute(2e-6, "weights are rounded once; a sum of four terms up to 4"), move |i| {
                let texel = [i[0] as i64, i[1] as i64];
                let of_key = |weights: [f64; 3]| (0..3).map(|layer| weights[layer] * layers.colour(layer, texel)).sum::<DVec3>();
                let sky = i[2] * 2.5 * daylight * layers.colour(3, texel);
                values(((1.0 - alpha) * of_key(from) + alpha * of_key(to) + sky).max(DVec3::ZERO).to_array())
            })
    };
    nights.map(of_night).into()
}

/// Layers that count, and sums of them.
fn sums(layers: &Arc<Layers>, now: &[f32]) -> Vec<Case> {
    let reads = layers.reads(now);
    let (between, at, weights) = (Arc::clone(layers), Arc::clone(layers), now.to_vec());
    let of_tap = weights.clone();
    vec![
        Case::new("baked::baked_layers", "with_sky: bool")
            .gives("u32")
            .reads(&reads[..1])
            .edges([vec![0.0], vec![1.0]])
            .twin(EXACT, |i| values([3.0 + i[0]])),
        Case::new("baked::baked_light_at", "place: vec2f, with_sky: bool")
            .gives("vec3f")
            .reads(&reads)
            .edges([[0.0, 0.0], [16.0, 16.0], [0.5, 15.5], [8.5, 3.5], [8.0, 3.0]].map(|p| vec![p[0], p[1], 1.0]))
            .random(join([real(0.0, SIDE as f64), real(0.0, SIDE as f64), switch()]))
            .twin(
                absolute(0.06, "devices interpolate between texels in steps of 1/256 of values that differ by up to 2, in four layers"),
                move |i| {
                    let (x, y) = (i[0] - 0.5, i[1] - 0.5);
                    let texel = |layer: usize, x: f64, y: f64| between.colour(layer, [x as i64, y as i64]);
                    let row = |layer: usize, y: f64| texel(layer, x.floor(), y).lerp(texel(layer, x.floor() + 1.0, y), x - x.floor());
                    let light = |layer: usize| row(layer, y.floor()).lerp(row(layer, y.floor() + 1.0), y - y.floor());
                    let sum: DVec3 = (0..3 + i[2] as usize).map(|layer| f64::from(weights[layer]) * light(layer)).sum();
                    values(sum.max(DVec3::ZERO).to_array())
                },
            ),
        Case::new("baked::tap", String::leak(format!("{TEXEL}, weight: f32, with_sky: bool")))
            .before(MAKE_TEXEL)
            .also("vec4f", "tap(texel, weight, with_sky)")
            .reads(&reads)
            .edges([1e-4, 0.99e-4, 0.0].map(|weight| vec![8.0, 8.0, weight, 1.0]))
            .random(join([index(SIDE as u32 + 6), index(SIDE as u32 + 6), real(0.0, 1.0), switch()]))
            .twin(absolute(2e-6, "a sum of four terms up to 4"), move |i| values(at.tap(&of_tap, texel_of(i), i[2], i[3] == 1.0))),
    ]
}

fn texel_of(i: &[f64]) -> [i64; 2] {
    [i[0] as i64 - 3, i[1] as i64 - 3]
}

/// Logarithms of distances nearer than this to what is allowed may count or not: rounding decides.
const UNSURE: f64 = 1e-5;

/// The twins; `lean` is added to how far logarithms of distances may be apart.
impl Layers {
    fn tap(&self, now: &[f32], texel: [i64; 2], weight: f64, with_sky: bool) -> [f64; 4] {
        if weight < f64::from(1e-4_f32) || texel.iter().any(|v| !(0..SIDE).contains(v)) {
            return [0.0; 4];
        }
        let light = weight * self.light(now, texel, with_sky);
        [light.x, light.y, light.z, weight]
    }

    fn is_baked(&self, distance: f64, texel: [i64; 2], tolerance: f64, lean: f64) -> bool {
        let baked = self.distance(texel);
        match (distance > 0.0, baked < NOWHERE.into()) {
            (true, true) => (distance.log2() - baked).abs() <= (1.0 + tolerance).log2() + lean,
            (something, was_something) => something == was_something,
        }
    }

    fn is_between(&self, distance: f64, [x, y]: [i64; 2], part: [f64; 2], tolerance: f64, lean: f64) -> bool {
        let inverse: f64 = corners(part).map(|(dx, dy, weight)| weight * (-self.distance([x + dx, y + dy])).exp2()).iter().sum();
        distance > 0.0 && inverse > 0.0 && (distance * inverse).log2().abs() <= (1.0 + tolerance).log2() + lean
    }

    /// Arguments: place, distance, tolerance, whether with the light of the sky.
    fn seen_light(&self, now: &[f32], i: &[f64], lean: f64) -> [f64; 4] {
        let [x, y] = [i[0].floor(), i[1].floor()];
        let (first, part, with_sky) = ([x as i64, y as i64], [i[0] - x, i[1] - y], i[4] == 1.0);
        let is_baked = |texel: [i64; 2]| self.is_baked(i[2], texel, i[3], lean);
        let is_whole = self.is_between(i[2], first, part, i[3], lean);
        let mut taps: Vec<[f64; 4]> = corners(part)
            .into_iter()
            .map(|(dx, dy, weight)| ([first[0] + dx, first[1] + dy], weight))
            .filter(|(texel, _)| is_whole || is_baked(*texel))
            .map(|(texel, weight)| self.tap(now, texel, weight, with_sky))
            .collect();
        if taps.iter().all(|tap| tap[3] == 0.0) {
            let middle = [(i[0] + 0.5).floor() as i64, (i[1] + 0.5).floor() as i64];
            let neighbours = (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| [middle[0] + dx, middle[1] + dy]));
            taps = neighbours.filter(|texel| is_baked(*texel)).map(|texel| self.tap(now, texel, 1.0, with_sky)).collect();
        }
        let sum = |channel: usize| taps.iter().map(|tap| tap[channel]).sum::<f64>();
        if sum(3) == 0.0 { [0.0; 4] } else { [sum(0) / sum(3), sum(1) / sum(3), sum(2) / sum(3), 1.0] }
    }
}

/// The four texels around a place, from the first of them on, and how much of each is there.
fn corners([x, y]: [f64; 2]) -> [(i64, i64, f64); 4] {
    [(0, 0, (1.0 - x) * (1.0 - y)), (1, 0, x * (1.0 - y)), (0, 1, (1.0 - x) * y), (1, 1, x * y)]
}

/// What a twin gives for both ways of rounding.
fn either<const N: usize>(of: impl Fn(f64) -> [f64; N]) -> Vec<Want> {
    let (less, more) = (of(-UNSURE), of(UNSURE));
    (0..N)
        .map(|n| if less[n] == more[n] { Want::new(less[n]) } else { Want::OneOf(vec![Want::new(less[n]), Want::new(more[n])]) })
        .collect()
}

/// A place in 256ths of a texel, up to three texels beside the picture; a distance of the surface of a texel near it, within the tolerance, beside it or at
/// its very end, of another surface, or of none; and the tolerance.
fn sights(layers: &Arc<Layers>) -> Numbers {
    let layers = Arc::clone(layers);
    let cell = || (index(SIDE as u32 + 6), index(256)).prop_map(|(texel, part)| texel[0] - 3.0 + part[0] / 256.0);
    let aside = || one_of(&[-1.0, 0.0, 0.0, 0.0, 1.0]);
    (cell(), cell(), (aside(), aside()), real(0.0, 1.0), real(-2.0, 2.0), magnitude(1e-3, 1e4), 0..8_u32)
        .prop_map(move |(x, y, aside, tolerance, off, other, choice)| {
            let of_texel = layers.distance([(x + 0.5 + aside.0[0]).floor() as i64, (y + 0.5 + aside.1[0]).floor() as i64]);
            let distance = match choice {
                0 => 0.0,
                1 => other[0],
                _ if of_texel >= NOWHERE.into() => 0.0,
                _ => (of_texel + off[0] * (1.0 + tolerance[0]).log2()).exp2(),
            };
            vec![x, y, distance, tolerance[0]]
        })
        .boxed()
}

/// Whose light texels have.
fn finds(layers: &Arc<Layers>, now: &[f32]) -> Vec<Case> {
    let reads = layers.reads(now);
    let [alone, four, all] = [0; 3].map(|_| Arc::clone(layers));
    let weights = now.to_vec();
    let whole = |i: Vec<f64>| vec![i[0].floor() + 3.0, i[1].floor() + 3.0, i[2], i[3]];
    let parts = |i: Vec<f64>| vec![i[0].floor() + 3.0, i[1].floor() + 3.0, i[2], i[0] - i[0].floor(), i[1] - i[1].floor(), i[3]];
    vec![
        Case::new("baked::is_baked", String::leak(format!("{TEXEL}, distance: f32, tolerance: f32")))
            .before(MAKE_TEXEL)
            .also("bool", "is_baked(distance, texel, tolerance)")
            .reads(&reads[1..])
            .random(sights(layers).prop_map(whole).boxed())
            .twin(EXACT, move |i| either(|lean| [f64::from(alone.is_baked(i[2], texel_of(i), i[3], lean))])),
        Case::new("baked::is_between", String::leak(format!("{TEXEL}, distance: f32, part: vec2f, tolerance: f32")))
            .before(MAKE_TEXEL)
            .also("bool", "is_between(distance, texel, part, tolerance)")
            .reads(&reads[1..])
            .random(sights(layers).prop_map(parts).boxed())
            .twin(EXACT, move |i| either(|lean| [f64::from(four.is_between(i[2], texel_of(i), [i[3], i[4]], i[5], lean))])),
        Case::new("baked::seen_light", "place: vec2f, distance: f32, tolerance: f32, with_sky: bool")
            .gives("vec4f")
            .reads(&reads)
            .random(join([sights(layers), switch()]))
            .twin(absolute(4e-6, "the mean of up to nine sums of four terms up to 4"), move |i| {
                either(|lean| all.seen_light(&weights, i, lean))
            }),
    ]
}

#[test]
fn precomputed_light_is_as_its_twins() {
    check(cases());
}
