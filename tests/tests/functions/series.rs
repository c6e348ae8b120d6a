//! Convolution soft shadow maps, and importance warping: what reads textures with levels.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};
use half::f16;
use manylight_graph::value::Format;
use manylight_scene::gpu_data::SceneInfo;
use proptest::strategy::Strategy;

use super::{
    directions::v3,
    harness::{Case, EXACT, Resource, Want, absolute, check, ulps, values, values_of},
    inputs::{ALMOST_ONE, Numbers, index, join, magnitude, magnitude_or_zero, one_of, real, unit_interval, vector},
    random::hash,
};

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [depths(), regions(), warping()].into_iter().flatten().collect()
}

/// Frequency of a term, k from 1.
fn c(k: u32) -> f64 {
    f64::from(2 * k - 1) * PI
}

fn depths() -> Vec<Case> {
    let info = SceneInfo { bounds_min: Vec3::new(-1.0, -2.0, -3.0), bounds_max: Vec3::new(4.0, 5.0, 6.0), ..SceneInfo::default() };
    let point = SceneInfo::default();
    let range = |info: SceneInfo| {
        Case::new("cssm::depth_range", "eye: vec3f")
            .before("let range = depth_range(eye, scene_info);")
            .also("f32", "range")
            .reads(&[Resource::uniform("scene_info", "SceneInfo", &info).declared("var<uniform> scene_info: SceneInfo")])
            .imports("scene::SceneInfo")
            .edges([vec![0.0; 3]])
            .random(vector(1e-6, 1e4))
            .twin(ulps(4.0, "a vector's length"), move |i| {
                let corners = (0..8).map(|corner| {
                    let pick = |bit: u32, low: f32, high: f32| f64::from(if corner >> bit & 1 == 1 { high } else { low });
                    let (low, high) = (info.bounds_min, info.bounds_max);
                    DVec3::new(pick(0, low.x, high.x), pick(1, low.y, high.y), pick(2, low.z, high.z)).distance(v3(i))
                });
                vec![Want::new(corners.fold(1e-30, f64::max))]
            })
    };
    vec![
        range(info),
        range(point),
        Case::new("cssm::slabs_of", "terms: u32")
            .gives("u32")
            .edges((0..=16).map(|m| vec![f64::from(m)]))
            .twin(EXACT, |i| values([(i[0] / 2.0).ceil()])),
        Case::new("cssm::turn", "a: vec2f, b: vec2f").gives("vec2f").random(join((0..4).map(|_| real(-1.0, 1.0)))).twin(
            ulps(2.0, "two products and their sum"),
            |i| {
                let (a, b) = (DVec2::new(i[0], i[1]), DVec2::new(i[2], i[3]));
                values_of(a.rotate(b).to_array(), a.length() * b.length())
            },
        ),
        Case::new("cssm::series_value", "margin: f32, terms: u32")
            .gives("f32")
            // No margin: half. Equality of depths is this.
            .edges((0..=16).flat_map(|m| [0.0, 1.0, -1.0, 0.5, 1e-7, 1e-30].map(|margin| vec![margin, f64::from(m)])))
            .random(join([real(-1.0, 1.0), index(17)]))
            .twin(ulps(24.0, "of 1: the wave is turned from term to term, up to 16 times, and a term's error has the weight 2 / c"), |i| {
                let sum: f64 = (1..=i[1] as u32).map(|k| 2.0 / c(k) * (c(k) * i[0]).sin()).sum();
                vec![Want::of(0.5 + sum, 1.0)]
            }),
        series(),
        fetch(),
    ]
}

/// Texels a side of the atlas that `series` and `fetch` read, and slabs below each other.
const ATLAS: u32 = 32;
const SLABS: u32 = 4;

/// Depths of the texels: ends of the range and others.
fn depth(texel: u32) -> f64 {
    match texel {
        0 => 0.0,
        1 => 1.0,
        2 => 0.5,
        3 => 1e-3,
        4 => 0.999,
        _ => f64::from(hash(texel) >> 8) / f64::from(1 << 24),
    }
}

/// One texel of one slab, as half floats hold it: sine and cosine of two terms.
fn basis_texel(slab: u32, texel: u32) -> [f16; 4] {
    let z = depth(texel);
    let [first, second] = [c(2 * slab + 1), c(2 * slab + 2)];
    [(first * z).sin(), (first * z).cos(), (second * z).sin(), (second * z).cos()].map(f16::from_f64)
}

fn levels() -> Vec<Vec<f16>> {
    let mut levels: Vec<Vec<f16>> =
        vec![(0..SLABS).flat_map(|slab| (0..ATLAS * ATLAS).flat_map(move |texel| basis_texel(slab, texel))).collect()];
    let mut width = ATLAS;
    while width > 2 {
        let finer = levels.last().expect("one at least");
        let (w, h) = (width / 2, width * SLABS / 2);
        let mean = |x: u32, y: u32, channel: u32| {
            let at = |dx: u32, dy: u32| finer[(4 * ((2 * y + dy) * width + 2 * x + dx) + channel) as usize].to_f64();
            f16::from_f64((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) / 4.0)
        };
        let level =
            (0..h).flat_map(|y| (0..w).flat_map(move |x| (0..4).map(move |channel| (x, y, channel)))).map(|(x, y, c)| mean(x, y, c));
        let level = level.collect();
        levels.push(level);
        width = w;
    }
    levels
}

fn atlas() -> [Resource; 2] {
    let texture = Resource::texture("cssm_atlas", Format::Rgba16Float, (ATLAS, ATLAS * SLABS), &levels());
    [texture, Resource::sampler("linear_sampler")]
}

fn series() -> Case {
    Case::new("cssm::series", "x: u32, y: u32, first: u32, terms: u32, d: f32")
        .imports("cssm::Region")
        .before("let r = Region(vec2f(f32(x) + 0.5, f32(y) + 0.5), 0.0);")
        .also("f32", format!("series(cssm_atlas, linear_sampler, r, first, {ATLAS}u, terms, d)"))
        .reads(&atlas())
        // The ends of the range, equality with the stored depth, and next to it.
        .edges((0..8_u32).flat_map(|x| {
            let z = depth(x);
            [0.0, 1.0, z, z - 1e-6, z + 1e-6, z - 0.125, 0.5]
                .into_iter()
                .flat_map(move |d| [1.0, 3.0, 4.0].map(|m| vec![f64::from(x), 0.0, 0.0, m, d]))
        }))
        .random(
            (index(ATLAS), index(ATLAS), one_of(&[0.0, 1.0, 2.0]), 1_u32..=4, real(0.0, 1.0))
                .prop_map(|(x, y, first, terms, d)| vec![x[0], y[0], first[0], f64::from(terms), d[0]])
                .boxed(),
        )
        .twin(ulps(16.0, "of 1: as the series' value; texels are read at their centres, and the twin has them as half floats"), |i| {
            let (texel, first, slabs) = (i[0] as u32 + ATLAS * i[1] as u32, i[2] as u32, (i[3] as u32).div_ceil(2));
            if first + slabs > SLABS {
                return vec![Want::finite()];
            }
            // [CSM] eq. 6 without its constant term.
            let sum: f64 = (1..=2 * slabs)
                .map(|k| {
                    let stored = basis_texel(first + (k - 1) / 2, texel).map(f16::to_f64);
                    let [sin, cos] = [stored[2 * ((k as usize - 1) % 2)], stored[2 * ((k as usize - 1) % 2) + 1]];
                    2.0 / c(k) * ((c(k) * i[4]).cos() * sin - (c(k) * i[4]).sin() * cos)
                })
                .sum();
            vec![Want::of(sum, 1.0)]
        })
}

fn fetch() -> Case {
    let levels = levels();
    Case::new("cssm::fetch", "texel: vec2f, level: f32, slab: u32")
        .imports("cssm::Region")
        .also("vec4f", format!("fetch(cssm_atlas, linear_sampler, Region(texel, level), slab, {ATLAS}u)"))
        .reads(&atlas())
        .random(join([real(8.0, 24.0), real(8.0, 24.0), real(0.0, 3.0), index(SLABS)]))
        .twin(
            absolute(0.03, "devices interpolate between texels and levels in steps of 1/256 of values that differ by up to 2"),
            move |i| {
                let sample = |level: usize, channel: usize| {
                    let (w, h) = (ATLAS as usize >> level, (ATLAS * SLABS) as usize >> level);
                    let scale = f64::from(1 << level);
                    let p = DVec2::new(i[0], i[1] + i[3] * f64::from(ATLAS)) / scale - 0.5;
                    let (low, share) = (p.floor(), p - p.floor());
                    let at = |dx: usize, dy: usize| {
                        let (x, y) = ((low.x as usize + dx).min(w - 1), (low.y as usize + dy).min(h - 1));
                        levels[level][4 * (y * w + x) + channel].to_f64()
                    };
                    let row = |dy: usize| at(0, dy) * (1.0 - share.x) + at(1, dy) * share.x;
                    row(0) * (1.0 - share.y) + row(1) * share.y
                };
                let (level, share) = (i[2].floor() as usize, i[2].fract());
                let mix = |channel: usize| {
                    if share > 0.0 {
                        sample(level, channel) * (1.0 - share) + sample(level + 1, channel) * share
                    } else {
                        sample(level, channel)
                    }
                };
                values([mix(0), mix(1), mix(2), mix(3)])
            },
        )
}

fn regions() -> Vec<Case> {
    vec![
        Case::new("cssm::region", "map: u32, texel: vec2f, width: f32, map_size: u32, maps_per_row: u32")
            .before("let r = region(map, texel, width, map_size, maps_per_row);")
            .also("vec2f", "r.texel")
            .also("f32", "r.level")
            .edges([0.0, -1.0, 1.0, 2.0, 8.0, 128.0, 1e30, 1e-30].map(|w| vec![5.0, 3.0, 127.5, w, 128.0, 4.0]))
            .random(join([
                index(64),
                real(-2.0, 514.0),
                real(-2.0, 514.0),
                magnitude(0.1, 2e3),
                one_of(&[16.0, 64.0, 128.0, 512.0]),
                one_of(&[1.0, 8.0]),
            ]))
            .twin(ulps(8.0, "a logarithm of up to 9; places are exact where no level begins"), |i| {
                let (size, last) = (i[4], i[4].log2());
                let level = i[3].max(1.0).log2().min(last);
                let origin = DVec2::new(i[0] % i[5], (i[0] / i[5]).floor()) * size;
                // Where a level begins, rounding decides which.
                let margins: Vec<f64> = [level - 1e-5, level + 1e-5].into_iter().map(|l| 0.5 * l.clamp(0.0, last).ceil().exp2()).collect();
                let place = |axis: usize| {
                    let kept = margins.iter().map(|m| Want::of(origin[axis] + i[1 + axis].clamp(*m, size - m), 1e-3));
                    Want::OneOf(kept.collect())
                };
                vec![place(0), place(1), Want::of(level, 1.0)]
            }),
    ]
}

fn warping() -> Vec<Case> {
    let mut all = vec![
        Case::new("warp::warp_quad", "p: vec2f, weights: vec4f")
            .before("let w = warp_quad(p, weights); let own = weights[2u * w.quadrant.y + w.quadrant.x];")
            .also("vec2u", "w.quadrant")
            .also("vec2f", "w.position")
            .also("f32", "w.share")
            // Never to a place without weight, unless there is none at all; and always inside.
            .also("bool", "own > 0.0 || all(weights == vec4f(0.0))")
            .also("bool", "all(w.position >= vec2f(0.0)) && all(w.position < vec2f(1.0))")
            .edges(quads())
            .random(join([unit_interval(), unit_interval(), weight(), weight(), weight(), weight()]))
            .twin(ulps(8.0, "of the share that a place is stretched by"), warp_quad),
    ];
    for image in &images() {
        all.extend(of_pyramid(image));
    }
    all
}

fn weight() -> Numbers {
    (0..3_u32, magnitude_or_zero(1e-6, 1.0), unit_interval())
        .prop_map(|(choice, m, u)| {
            vec![match choice {
                0 => 0.0,
                1 if m[0] > 1e-30 => m[0],
                _ => {
                    if u[0] > 1e-30 {
                        u[0]
                    } else {
                        1.0
                    }
                }
            }]
        })
        .boxed()
}

/// Uniform, all zero, one texel, one row, one column, huge, tiny.
fn quads() -> impl Iterator<Item = Vec<f64>> {
    let weights = [
        [1.0, 1.0, 1.0, 1.0],
        [0.0, 0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [1.0, 1.0, 0.0, 0.0],
        [0.0, 0.0, 1.0, 1.0],
        [1.0, 0.0, 1.0, 0.0],
        [0.0, 1.0, 0.0, 1.0],
        [1e30, 1e30, 1e30, 1e30],
        [1e-30, 1e-30, 0.0, 1e-30],
        [1.0, 1e-8, 1e-8, 0.0],
        [1e-8, 1.0, 0.0, 1e-8],
    ];
    let places = [0.0, 0.25, 0.5, 0.999, ALMOST_ONE];
    weights.into_iter().flat_map(move |w| places.into_iter().flat_map(move |x| places.map(|y| [vec![x, y], w.to_vec()].concat())))
}

/// One coordinate: which half, where in it, the probability of the half; and the magnitude of the place's error. `None` if rounding decides.
fn split(p: f64, first: f64, second: f64, error: f64) -> Option<(bool, f64, f64, f64)> {
    let share = if first + second > 0.0 { first / (first + second) } else { 0.5 };
    let is_second = p >= share;
    if (p - share).abs() < error && share > 0.0 && share < 1.0 {
        return None;
    }
    let own = if is_second { 1.0 - share } else { share };
    let place = if is_second { (p - share) / own } else { p / own };
    Some((is_second, place.min(ALMOST_ONE), own, error / own))
}

fn warp_quad(i: &[f64]) -> Vec<Want> {
    let w = &i[2..6];
    let decided = split(i[1], w[0] + w[1], w[2] + w[3], 2.4e-7).and_then(|y| {
        let row = if y.0 { &w[2..4] } else { &w[..2] };
        split(i[0], row[0], row[1], 2.4e-7).map(|x| (x, y))
    });
    let Some((x, y)) = decided else {
        let place = Want::Between(0.0, ALMOST_ONE);
        return vec![
            Want::Between(0.0, 1.0),
            Want::Between(0.0, 1.0),
            place.clone(),
            place,
            Want::Between(0.0, 1.0),
            Want::new(1.0),
            Want::new(1.0),
        ];
    };
    let quadrant = [x, y].map(|half| Want::new(f64::from(u8::from(half.0))));
    let places = [x, y].map(|half| Want::of(half.1, 1.0 / half.2));
    [quadrant.to_vec(), places.to_vec(), vec![Want::of(x.2 * y.2, 1.0), Want::new(1.0), Want::new(1.0)]].concat()
}

/// A map of importance and its means.
#[derive(Clone)]
struct Pyramid {
    levels: Vec<(u32, u32, Vec<f32>)>,
}

impl Pyramid {
    fn new(width: u32, height: u32, texel: impl Fn(u32, u32) -> f64) -> Self {
        let first: Vec<f32> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y) as f32).collect();
        let mut levels: Vec<(u32, u32, Vec<f32>)> = vec![(width, height, first)];
        while let Some((w, h, finer)) = levels.last().filter(|(w, h, _)| w.max(h) > &1) {
            let (next_w, next_h) = ((w / 2).max(1), (h / 2).max(1));
            let mean = |x: u32, y: u32| {
                let inside: Vec<f32> = [(0, 0), (1, 0), (0, 1), (1, 1)]
                    .into_iter()
                    .map(|(dx, dy)| (2 * x + dx, 2 * y + dy))
                    .filter(|(x, y)| x < w && y < h)
                    .map(|(x, y)| finer[(y * w + x) as usize])
                    .collect();
                inside.iter().sum::<f32>() / inside.len() as f32
            };
            let level = (0..next_h).flat_map(|y| (0..next_w).map(move |x| (x, y))).map(|(x, y)| mean(x, y)).collect();
            levels.push((next_w, next_h, level));
        }
        Self { levels }
    }

    fn at(&self, level: usize, x: u32, y: u32) -> f64 {
        let (w, h, texels) = &self.levels[level];
        if x < *w && y < *h { f64::from(texels[(y * w + x) as usize]) } else { 0.0 }
    }

    fn quad(&self, level: usize, x: u32, y: u32) -> [f64; 4] {
        [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(dx, dy)| self.at(level, 2 * x + dx, 2 * y + dy))
    }
}

/// Random, wider than high, higher than wide, black, one texel, one row, constant.
fn images() -> Vec<Pyramid> {
    let noise = |x: u32, y: u32| f64::from(hash(x + 64 * y) % 5) * 0.25;
    vec![
        Pyramid::new(16, 16, noise),
        Pyramid::new(16, 4, noise),
        Pyramid::new(2, 16, noise),
        Pyramid::new(1, 1, |_, _| 1.0),
        Pyramid::new(16, 16, |_, _| 0.0),
        Pyramid::new(16, 16, |x, y| f64::from(u8::from((x, y) == (5, 11)))),
        Pyramid::new(16, 16, |_, y| f64::from(u8::from(y == 7)) * 1e-3),
        Pyramid::new(16, 16, |_, _| 0.3),
    ]
}

fn of_pyramid(image: &Pyramid) -> Vec<Case> {
    let (width, height, _) = image.levels[0].clone();
    let levels: Vec<Vec<f32>> = image.levels.iter().map(|(_, _, texels)| texels.clone()).collect();
    let texture = Resource::texture("importance", Format::R32Float, (width, height), &levels);
    // All invocations ask for one level, as in every node: Mesa's software rasterizer takes the size of a level from the first of those that run together.
    let mut all = Vec::new();
    for levels in [0_u32, 1, 2, 31, u32::MAX] {
        let warped = image.clone();
        // A place in the map and in its texel; where there is light and all levels are gone down, on light.
        let inside =
            "all(w.texel < textureDimensions(importance)) && all(w.position >= vec2f(w.texel)) && all(w.position <= vec2f(w.texel) + 1.0)";
        let top = "textureLoad(importance, vec2u(0u), textureNumLevels(importance) - 1u).x";
        all.push(
            Case::new("warp::warp_to_texel", "seed: vec2f")
                .before(String::leak(format!("let w = warp_to_texel(importance, seed, {levels}u);")))
                .also("vec2f", "w.position")
                .also("vec2u", "w.texel")
                .also("f32", "w.probability")
                .also("bool", inside)
                .also("bool", format!("{levels}u < 31u || textureLoad(importance, w.texel, 0).x > 0.0 || {top} == 0.0"))
                .reads(std::slice::from_ref(&texture))
                .random(join([unit_interval(), unit_interval()]))
                .twin(ulps(8.0, "of the stretching of all levels together, in texels"), move |i| warp_to_texel(&warped, i, levels)),
        );
    }
    for level in 0..levels.len() - 1 {
        let quads = image.clone();
        all.push(
            Case::new("warp::quad_weights", "above: vec2u")
                .also("vec4f", format!("quad_weights(importance, above, {level}u)"))
                .reads(std::slice::from_ref(&texture))
                .random(join([index(16), index(16)]))
                .twin(EXACT, move |i| values(quads.quad(level, i[0] as u32, i[1] as u32))),
        );
    }
    all
}

fn warp_to_texel(image: &Pyramid, i: &[f64], levels: u32) -> Vec<Want> {
    let last = image.levels.len() - 1;
    let stop = last - last.min(levels as usize);
    let (mut x, mut y) = (0, 0);
    let mut place = DVec2::new(i[0], i[1]);
    let mut error = DVec2::splat(1e-7);
    let mut probability = 1.0;
    let anywhere =
        || vec![Want::finite(), Want::finite(), Want::finite(), Want::finite(), Want::Between(0.0, 1.0), Want::new(1.0), Want::new(1.0)];
    for level in (stop..last).rev() {
        let w = image.quad(level, x, y);
        let Some(vertical) = split(place.y, w[0] + w[1], w[2] + w[3], 4.0 * error.y) else { return anywhere() };
        let row = if vertical.0 { [w[2], w[3]] } else { [w[0], w[1]] };
        let Some(horizontal) = split(place.x, row[0], row[1], 4.0 * error.x) else { return anywhere() };
        x = 2 * x + u32::from(horizontal.0);
        y = 2 * y + u32::from(vertical.0);
        place = DVec2::new(horizontal.1, vertical.1);
        error = DVec2::new(horizontal.3 / 4.0 + 1e-7, vertical.3 / 4.0 + 1e-7);
        probability *= horizontal.2 * vertical.2;
    }
    let (width, height, _) = image.levels[0];
    let cell = [(1 << stop).min(width), (1 << stop).min(height)];
    let side = DVec2::new(cell[0].into(), cell[1].into());
    let in_cell = place * side;
    let texel = [0, 1].map(|axis| {
        let first = f64::from([x, y][axis] * cell[axis]);
        // Between two texels of a cell rounding decides.
        let near = |offset: f64| (in_cell[axis] + offset * (4.0 * error[axis] * side[axis])).floor().clamp(0.0, side[axis] - 1.0);
        Want::Between(first + near(-1.0), first + near(1.0))
    });
    let position = [0, 1].map(|axis| {
        let first = f64::from([x, y][axis] * cell[axis]);
        Want::of(first + in_cell[axis], error[axis] / 1e-7 * side[axis] + first)
    });
    [position.to_vec(), texel.to_vec(), vec![Want::of(probability / (side.x * side.y), 1.0), Want::new(1.0), Want::new(1.0)]].concat()
}

#[test]
fn series_and_warping_are_as_their_twins() {
    check(cases());
}
