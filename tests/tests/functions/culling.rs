//! Blocks of a split picture, bounds of what they can get from a light, and the lights that they meet.

use glam::DVec3;
use proptest::strategy::Strategy;

use super::{
    directions::v3,
    harness::{Case, EXACT, Want, absolute, check, values},
    inputs::{Numbers, index, join, magnitude, magnitude_or_zero, real, switch, unit_vector, vector},
};

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [bounds(), blocks(), lights()].into_iter().flatten().collect()
}

/// What the shader widens bounds by.
const SLACK: f64 = 1e-5;
const COORDINATE_SLACK: f64 = 1e-6;
/// Points of a group that the twin looks at.
const POINTS: usize = 3;

fn form_factor(point: DVec3, normal: DVec3, light: DVec3, light_normal: DVec3, area: f64, least_d2: f64) -> f64 {
    let v = point - light;
    let d2 = v.length_squared();
    let direction = v / d2.sqrt().max(1e-15);
    let cosines = (-normal.dot(direction)).max(0.0) * light_normal.dot(direction).max(0.0);
    cosines / (std::f64::consts::PI * d2.max(least_d2) + area).max(1e-30)
}

/// A group of points as its bounds are handed over: box, cone and planes; then a light, then the points.
fn group_and_light() -> Numbers {
    let point = join([real(-1.0, 1.0), real(-1.0, 1.0), real(-1.0, 1.0), unit_vector()]);
    let points = join([point.clone(), point.clone(), point]);
    let light = join([unit_vector(), magnitude(1e-2, 1e2), unit_vector(), magnitude_or_zero(1e-4, 1e2), magnitude_or_zero(1e-4, 1.0)]);
    let shape = join([vector(1e-3, 1e2), magnitude_or_zero(1e-3, 10.0), real(0.0, 1.0), real(0.0, 1.0), switch()]);
    (points, light, shape).prop_map(|(points, light, shape)| group(&points, &light, &shape)).boxed()
}

fn group(points: &[f64], light: &[f64], shape: &[f64]) -> Vec<f64> {
    let (centre, size, bend, flatness) = (v3(shape), shape[3], shape[4], shape[5]);
    let first_normal = v3(&points[3..]);
    let placed: Vec<(DVec3, DVec3)> = (0..POINTS)
        .map(|k| {
            let at = &points[6 * k..];
            // From a plane, where all normals are one, to points all over with normals anywhere.
            let normal = first_normal.lerp(v3(&at[3..]), if shape[6] > 0.5 { 0.0 } else { bend }).normalize_or(first_normal);
            let offset = v3(at) * size;
            let flat = offset - first_normal * offset.dot(first_normal) * if shape[6] > 0.5 { 1.0 } else { flatness };
            // As the shader has them.
            ((centre + flat).as_vec3().as_dvec3(), normal.as_vec3().as_dvec3())
        })
        .collect();
    let low = placed.iter().fold(DVec3::INFINITY, |low, (p, _)| low.min(*p));
    let high = placed.iter().fold(DVec3::NEG_INFINITY, |high, (p, _)| high.max(*p));
    let middle = (0.5 * (low + high)).as_vec3().as_dvec3();
    let half = (high - middle).max(middle - low);
    let sum: DVec3 = placed.iter().map(|(_, n)| *n).sum();
    let axis = sum.normalize_or(DVec3::Z).as_vec3().as_dvec3();
    let spread = placed.iter().map(|(_, n)| n.distance(axis)).fold(0.0, f64::max);
    let heights: Vec<f64> = placed.iter().map(|(p, n)| n.dot(*p - middle)).collect();
    let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let light_position = centre + v3(light) * light[3] * size.max(0.1);
    let mut all: Vec<f64> = [middle, half, axis].iter().flat_map(|v| v.to_array()).collect();
    all.extend([spread, lowest, highest]);
    all.extend(light_position.to_array());
    all.extend(&light[4..9]);
    placed.iter().for_each(|(p, n)| all.extend([*p, *n].iter().flat_map(|v| v.to_array())));
    all
}

/// Bounds, widened by a multiple of what the shader widens them by.
fn form_factor_bounds(i: &[f64], widened: f64) -> (f64, f64) {
    let (middle, half, axis) = (v3(i), v3(&i[3..]), v3(&i[6..]));
    let (spread, low, high) = (i[9], i[10], i[11]);
    let (light, normal, area, least_d2) = (v3(&i[12..]), v3(&i[15..]), i[18], i[19]);
    let to_light = light - middle;
    let d = to_light.length();
    let slack = widened * (SLACK * (d + half.length()) + COORDINATE_SLACK * (light.abs() + middle.abs()).max_element());
    let nearest = ((to_light.abs() - half).max(DVec3::ZERO).length() - slack).max(0.0);
    let farthest = (to_light.abs() + half).length() + slack;
    let angle = axis.cross(to_light).length().atan2(axis.dot(to_light));
    let half_angle = 2.0 * (0.5 * spread).min(1.0).asin();
    let over = d * (angle - half_angle).max(0.0).cos() - low + slack;
    let least_over = d * (angle + half_angle).min(std::f64::consts::PI).cos() - high - slack;
    let front = -normal.dot(to_light);
    let reach = normal.abs().dot(half) + slack;
    let share = |d2: f64| 1.0 / (std::f64::consts::PI * d2.max(least_d2) + area).max(1e-30);
    let cosine = |height: f64, distance: f64| if distance > 0.0 { (height / distance).min(1.0) } else { 1.0 };
    let upper = if over > 0.0 && front + reach > 0.0 {
        cosine(over, nearest) * cosine(front + reach, nearest) * share(nearest * nearest)
    } else {
        0.0
    };
    let lower = if least_over > 0.0 && front - reach > 0.0 {
        cosine(least_over, farthest) * cosine(front - reach, farthest) * share(farthest * farthest)
    } else {
        0.0
    };
    (lower, upper)
}

fn bounds() -> Vec<Case> {
    vec![
        Case::new("bounds::cosine_beside_cone", "angle_cosine: f32, angle_sine: f32, spread: f32, nearer: bool")
            .also("f32", "cosine_beside_cone(angle_cosine, angle_sine, spread, nearer)")
            .edges([vec![1.0, 0.0, 0.0, 1.0], vec![1.0, 0.0, 2.0, 0.0], vec![-1.0, 0.0, 0.0, 0.0], vec![0.0, 1.0, 2.0, 1.0]])
            .random(
                (real(0.0, std::f64::consts::PI), real(0.0, 2.0), switch())
                    .prop_map(|(angle, spread, nearer)| vec![angle[0].cos(), angle[0].sin(), spread[0], nearer[0]])
                    .boxed(),
            )
            .twin(absolute(2e-6, "a sum of two products of numbers up to 1; half a turn has a sine that rounds by as much"), |i| {
                let angle = i[1].atan2(i[0]);
                let half = 2.0 * (0.5 * i[2]).asin();
                let beside = if i[3] != 0.0 { (angle - half).max(0.0) } else { (angle + half).min(std::f64::consts::PI) };
                values([beside.cos()])
            }),
        Case::new(
            "bounds::form_factor_bounds",
            "middle: vec3f, half_size: vec3f, axis: vec3f, spread: f32, low: f32, high: f32, position: vec3f, normal: vec3f, area: f32, \
             least_d2: f32, p0: vec3f, n0: vec3f, p1: vec3f, n1: vec3f, p2: vec3f, n2: vec3f",
        )
        .imports("bounds::SurfaceBounds")
        .before("let group = SurfaceBounds(middle, 1u, half_size, spread, axis, 0u, low, high);")
        .also("vec2f", "form_factor_bounds(group, position, normal, area, least_d2)")
        .random(group_and_light())
        .twin(EXACT, |i| {
            let (light, normal, area, least_d2) = (v3(&i[12..]), v3(&i[15..]), i[18], i[19]);
            let points = i[20..].chunks_exact(6).map(|p| form_factor(v3(p), v3(&p[3..]), light, normal, area, least_d2));
            let points: Vec<f64> = points.collect();
            let least = points.iter().copied().fold(f64::INFINITY, f64::min);
            let most = points.iter().copied().fold(0.0, f64::max);
            // No point is beyond them, and they are no wider than their own rounding asks for.
            let (tight, wide) = (form_factor_bounds(i, 0.5), form_factor_bounds(i, 2.0));
            vec![
                Want::Between((wide.0 * 0.999 - 1e-30).max(0.0), least.min(tight.0 * 1.000_001)),
                Want::Between(most.max(tight.1 * 0.999_999), wide.1 * 1.001 + 1e-30),
            ]
        }),
    ]
}

/// A tile's size, n, and the index of a block or a place in the picture.
fn tiles() -> Numbers {
    (1..70_u32, 1..50_u32, 1..9_u32, 0..u32::MAX, 0..u32::MAX)
        .prop_map(|(width, height, n, a, b)| [width, height, n, a % (n * width), b % (n * height)].map(f64::from).to_vec())
        .boxed()
}

fn block_count(i: &[f64]) -> [f64; 2] {
    [(i[0] / 8.0).ceil(), (i[1] / 8.0).ceil()]
}

fn block_index(i: &[f64]) -> f64 {
    let [across, down] = block_count(i);
    let (tile, within) = ([(i[3] / i[0]).floor(), (i[4] / i[1]).floor()], [i[3] % i[0], i[4] % i[1]]);
    (tile[1] * i[2] + tile[0]) * across * down + (within[1] / 8.0).floor() * across + (within[0] / 8.0).floor()
}

const TILES: &str = "width: u32, height: u32, n: u32, x: u32, y: u32";

fn blocks() -> Vec<Case> {
    let case = |function| Case::new(function, TILES).random(tiles());
    vec![
        case("lit_tiles::blocks_of_tile").also("vec2u", "blocks_of_tile(vec2u(width, height))").twin(EXACT, |i| values(block_count(i))),
        case("lit_tiles::corner_of_tile")
            .also("vec2u", "corner_of_tile(n - 1u, vec2u(width, height), n)")
            .twin(EXACT, |i| values([(i[2] - 1.0) * i[0], 0.0])),
        Case::new("lit_tiles::place_of_block", "index: u32, width: u32, height: u32")
            .before("let place = place_of_block(index, vec2u(width, height));")
            .also("u32", "place.tile")
            .also("vec2u", "place.within")
            .random(tiles().prop_map(|i| vec![block_index(&i), i[0], i[1]]).boxed())
            .twin(EXACT, |i| {
                let [across, down] = block_count(&i[1..]);
                let rest = i[0] % (across * down);
                values([(i[0] / (across * down)).floor(), 8.0 * (rest % across), 8.0 * (rest / across).floor()])
            }),
    ]
}

fn lights() -> Vec<Case> {
    let dealt =
        || (1..9_u32, 1..9000_u32, 0..64_u32).prop_map(|(n, count, tile)| [tile % (n * n), count, n * n].map(f64::from).to_vec()).boxed();
    vec![
        Case::new("culling::lights_of_tile", "tile: u32, count: u32, period: u32").gives("u32").random(dealt()).twin(EXACT, |i| {
            let own = (0..i[1] as u32).filter(|c| c % i[2] as u32 == i[0] as u32).count();
            values([own as f64])
        }),
        Case::new("culling::words_of_tile", "tile: u32, count: u32, period: u32")
            .also("u32", "words_of_tile(count, period)")
            .random(dealt())
            .twin(EXACT, |i| values([((i[1] / i[2]).ceil() / 32.0).ceil()])),
        Case::new("culling::full_word", "word: u32, lights: u32")
            .gives("u32")
            .edges([vec![0.0, 0.0], vec![0.0, 31.0], vec![0.0, 32.0], vec![1.0, 32.0], vec![1.0, 33.0], vec![5.0, 1.0]])
            .random(join([index(128), index(4097)]))
            .twin(EXACT, |i| {
                let bits = (0..32).filter(|bit| 32 * i[0] as u64 + bit < i[1] as u64).map(|bit| 1_u64 << bit).sum::<u64>();
                values([bits as f64])
            }),
    ]
}

#[test]
fn culling_is_as_its_twins() {
    check(cases());
}
