//! The reflective shadow map: views of lights of all kinds, side by side.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, Vec3};
use manylight_scene::gpu_data::{self, LightView};
use proptest::strategy::Strategy;

use super::{
    directions::{View, v3},
    harness::{Bound, Case, EXACT, Resource, Want, check, ulps, values, values_of},
    inputs::{Numbers, index, join, magnitude, real, vector},
    light::{LIGHT, Light, MAKE_LIGHT, light},
};

/// Views in a row.
const COLUMNS: u32 = 6;
/// Texels a side of a view's cell, and of the whole map.
const SIDE: u32 = 16;
const MAP: [u32; 2] = [COLUMNS * SIDE, 2 * SIDE];
const SIZE: &str = "vec2u(96u, 32u)";

const SPOT: u32 = 0;
const POINT: u32 = 1;
const DIRECTIONAL: u32 = 2;

/// Views of a spot light, a point light, a directional light, and a spot light of nearly 170°.
fn views() -> Vec<LightView> {
    let wrap = |view, kind, face, light| LightView { view, light, kind, face, weight: 1.0 };
    let spot = |from: Vec3, to: Vec3, fov_deg: f32| gpu_data::View::perspective(from, to, Vec3::Y, fov_deg.to_radians(), 1.0, 0.01, 100.0);
    let mut all = vec![wrap(spot(Vec3::new(1.0, 2.0, 3.0), Vec3::new(-1.0, 0.5, 2.0), 40.0), SPOT, 0, 0)];
    for (face, axis) in (0..).zip([Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]) {
        let eye = Vec3::new(-2.0, 0.5, 0.25);
        all.push(wrap(spot(eye, eye + axis, 90.0), POINT, face, 1));
    }
    let sun = gpu_data::View { tan_half_x: 7.5, tan_half_y: 7.5, near: 0.0, ..spot(Vec3::new(10.0, 20.0, 5.0), Vec3::ZERO, 90.0) };
    all.push(wrap(sun, DIRECTIONAL, 0, 2));
    all.push(wrap(spot(Vec3::new(0.0, 5.0, 0.0), Vec3::new(0.5, 0.0, 0.0), 169.9), SPOT, 0, 3));
    all
}

/// The view of an index, in 64 bits, and its kind.
fn view(index: f64) -> (View, u32) {
    let LightView { view: v, kind, .. } = views()[index as usize];
    let [origin, right, up, forward] = [v.origin, v.right, v.up, v.forward].map(Vec3::as_dvec3);
    (View { origin, right, up, forward, tan_x: v.tan_half_x.into(), tan_y: v.tan_half_y.into() }, kind)
}

/// Of a texel: the view, and where its centre is in the view's picture, −1 to 1, upwards.
fn of_texel(x: f64, y: f64) -> (f64, DVec2) {
    let side = f64::from(SIDE);
    let cell = DVec2::new(x, y) / side;
    let at = (cell.fract() + 0.5 / side) * 2.0 - 1.0;
    (cell.y.floor() * f64::from(COLUMNS) + cell.x.floor(), DVec2::new(at.x, -at.y))
}

fn ray(index: f64, at: DVec2) -> (DVec3, DVec3) {
    let (view, kind) = view(index);
    if kind == DIRECTIONAL {
        return (view.origin + at.x * view.tan_x * view.right + at.y * view.tan_y * view.up, view.forward);
    }
    (view.origin, (view.forward + at.x * view.tan_x * view.right + at.y * view.tan_y * view.up).normalize())
}

/// sr, or m² across parallel rays.
fn extent(index: f64, at: DVec2) -> f64 {
    let (view, kind) = view(index);
    let area = (2.0 * view.tan_x / f64::from(SIDE)).powi(2);
    if kind == DIRECTIONAL { area } else { area * (1.0 + (at.x * view.tan_x).powi(2) + (at.y * view.tan_y).powi(2)).powf(-1.5) }
}

fn surface_area(x: f64, y: f64, distance: f64, cosine: f64) -> f64 {
    let (index, at) = of_texel(x, y);
    let spread = if view(index).1 == DIRECTIONAL { 1.0 } else { distance * distance };
    extent(index, at) * spread / cosine.max(f64::from(0.02_f32))
}

fn seen(index: f64, position: DVec3) -> Vec<Want> {
    let (view, kind) = view(index);
    if kind != DIRECTIONAL {
        return view.uv(position);
    }
    let v = position - view.origin;
    let part = |axis: DVec3, half: f64, sign: f64| Want::of(0.5 + sign * 0.5 * v.dot(axis) / half, v.length() / half);
    vec![part(view.right, view.tan_x, 1.0), part(view.up, view.tan_y, -1.0), Want::of(v.dot(view.forward), v.length())]
}

/// A texel of a cell that is a view's.
fn texel() -> Numbers {
    (index(9), index(SIDE), index(SIDE))
        .prop_map(|(v, x, y)| {
            let (column, row) = (v[0] % f64::from(COLUMNS), (v[0] / f64::from(COLUMNS)).floor());
            vec![column * f64::from(SIDE) + x[0], row * f64::from(SIDE) + y[0]]
        })
        .boxed()
}

/// A view and a position: anywhere, at the view's origin, or in front of it.
fn view_and_position() -> Numbers {
    let anywhere = join([index(9), vector(1e-3, 1e4)]);
    let ahead = (index(9), real(-1.2, 1.2), real(-1.2, 1.2), magnitude(1e-3, 1e3), 0..8_u32)
        .prop_map(|(v, x, y, z, choice)| {
            let view = view(v[0]).0;
            let offset = z[0] * (view.forward + x[0] * view.tan_x * view.right + y[0] * view.tan_y * view.up);
            let offset = if choice == 0 { DVec3::ZERO } else { offset };
            [v, (view.origin + offset).to_array().to_vec()].concat()
        })
        .boxed();
    proptest::prop_oneof![anywhere, ahead].boxed()
}

const PLACE: &str = "let place = place_of_texel(texel, vec2u(96u, 32u));";

fn case(function: &'static str, takes: &'static str) -> Case {
    Case::new(function, takes).reads(&[Resource::buffer("scene_light_views", "LightView", &views())])
}

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [counts(), rays(), positions()].into_iter().flatten().collect()
}

fn counts() -> Vec<Case> {
    let none = || [vec![0.0]];
    let few: Vec<LightView> = views()[..3].to_vec();
    let of_few =
        |function: &'static str, takes| Case::new(function, takes).reads(&[Resource::buffer("scene_light_views", "LightView", &few)]);
    let cell = |x: f64| (x / f64::from(SIDE)).floor();
    vec![
        case("rsm::view_count", "unused: u32").also("u32", "view_count()").edges(none()).twin(EXACT, |_| values([9.0])),
        case("rsm::columns", "unused: u32").also("u32", "columns()").edges(none()).twin(EXACT, |_| values([6.0])),
        of_few("rsm::columns", "unused: u32").also("u32", "columns()").edges(none()).twin(EXACT, |_| values([3.0])),
        case("rsm::rows", "unused: u32").also("u32", "rows()").edges(none()).twin(EXACT, |_| values([2.0])),
        of_few("rsm::rows", "unused: u32").also("u32", "rows()").edges(none()).twin(EXACT, |_| values([1.0])),
        case("rsm::cell_side", "size: vec2u")
            .gives("u32")
            .random(join([index(16_384), index(16_384)]))
            .twin(EXACT, |i| values([(i[0] / 6.0).floor()])),
        Case::new("rsm::cell_of_view", "index: u32")
            .gives("vec2u")
            .edges((0..100).map(|i| vec![f64::from(i)]))
            .twin(EXACT, |i| values([i[0] % 6.0, (i[0] / 6.0).floor()])),
        case("rsm::view_of_texel", "texel: vec2u")
            .also("u32", format!("view_of_texel(texel, {SIZE})"))
            .random(join([index(MAP[0]), index(MAP[1])]))
            .twin(EXACT, move |i| values([cell(i[1]) * 6.0 + cell(i[0])])),
        case("rsm::cell_of_texel", "texel: vec2u")
            .before("let cell = cell_of_texel(texel, vec2u(96u, 32u));")
            .also("vec2f", "cell.low")
            .also("vec2f", "cell.high")
            .random(join([index(MAP[0]), index(MAP[1])]))
            .twin(EXACT, move |i| {
                let low = DVec2::new(cell(i[0]), cell(i[1])) * f64::from(SIDE);
                values([low.x, low.y, low.x + f64::from(SIDE), low.y + f64::from(SIDE)])
            }),
        Case::new("rsm::in_cell", "low: vec2f, high: vec2f, place: vec2f")
            .imports("rsm::Cell")
            .also("bool", "in_cell(Cell(low, high), place)")
            .edges(
                [[16.0, 16.0], [32.0, 16.0], [16.0, 32.0], [31.999_998, 31.0], [15.999_999, 20.0]]
                    .map(|p| vec![16.0, 16.0, 32.0, 32.0, p[0], p[1]]),
            )
            .random(join([real(0.0, 2.0), real(0.0, 2.0), real(1.0, 3.0), real(1.0, 3.0), real(0.0, 3.0), real(0.0, 3.0)]))
            .twin(EXACT, |i| {
                let inside = [0, 1].iter().all(|axis| i[*axis] <= i[4 + axis] && i[4 + axis] < i[2 + axis]);
                values([f64::from(u8::from(inside))])
            }),
        case("rsm::is_parallel", "index: u32")
            .gives("bool")
            .edges((0..9).map(|i| vec![f64::from(i)]))
            .twin(EXACT, |i| values([f64::from(u8::from(i[0] == 7.0))])),
        case("rsm::place_of_texel", "texel: vec2u")
            .before(PLACE)
            .also("u32", "place.view")
            .also("u32", "place.side")
            .also("vec2u", "place.pixel")
            .random(join([index(MAP[0]), index(MAP[1])]))
            .twin(EXACT, move |i| {
                let side = f64::from(SIDE);
                values([cell(i[1]) * 6.0 + cell(i[0]), side, i[0] % side, i[1] % side])
            }),
        case("rsm::views_of_light", "index: u32")
            .gives("u32")
            .edges((0..9).map(|i| vec![f64::from(i)]))
            .twin(EXACT, |i| values([if (1.0..7.0).contains(&i[0]) { 6.0 } else { 1.0 }])),
    ]
}

const RAY: Bound = ulps(8.0, "a unit vector from three; a point of the square where parallel rays start");

fn rays() -> Vec<Case> {
    let wanted = |i: &[f64]| {
        let (index, at) = of_texel(i[0], i[1]);
        let (origin, direction) = ray(index, at);
        let scale = if view(index).1 == DIRECTIONAL { 40.0 } else { origin.length() };
        [values_of(origin.to_array(), scale), values_of(direction.to_array(), 1.0)].concat()
    };
    let area = ulps(60.0, "the cube of a cosine down to 0.06 at the corners of a field of 170°");
    vec![
        case("rsm::ray_at", "texel: vec2u")
            .imports("rsm::place_of_texel")
            .before("let ray = ray_at(place_of_texel(texel, vec2u(96u, 32u)));")
            .also("vec3f", "ray.origin")
            .also("vec3f", "ray.direction")
            .random(texel())
            .twin(RAY, wanted),
        case("rsm::texel_ray", "texel: vec2u")
            .before("let ray = texel_ray(texel, vec2u(96u, 32u));")
            .also("vec3f", "ray.origin")
            .also("vec3f", "ray.direction")
            .random(texel())
            .twin(RAY, wanted),
        case("rsm::texel_position", "texel: vec2u, distance: f32")
            .also("vec3f", format!("texel_position(texel, {SIZE}, distance)"))
            .random(join([texel(), magnitude(1e-3, 1e4)]))
            .twin(ulps(8.0, "of the distance and the light's place, whichever is larger"), |i| {
                let (index, at) = of_texel(i[0], i[1]);
                let (origin, direction) = ray(index, at);
                values_of((origin + direction * i[2]).to_array(), i[2].max(40.0))
            }),
        case("rsm::extent_at", "texel: vec2u")
            .imports("rsm::place_of_texel")
            .before(PLACE)
            .also("f32", "extent_at(place)")
            .random(texel())
            .twin(area, |i| {
                let (index, at) = of_texel(i[0], i[1]);
                values([extent(index, at)])
            }),
        case("rsm::power_of_unit_strength_at", String::leak(format!("texel: vec2u, {LIGHT}")))
            .imports("rsm::place_of_texel")
            .imports("scene::Light")
            .before(String::leak(format!("{PLACE} {MAKE_LIGHT}")))
            .also("f32", "power_of_unit_strength_at(light, place)")
            .random(join([texel(), light()]))
            .twin(area, |i| {
                let (index, at) = of_texel(i[0], i[1]);
                let extent = extent(index, at);
                let options =
                    Light::of(&i[2..]).falloff(ray(index, at).1).into_iter().map(|(share, error)| Want::of(share * extent, error * extent));
                vec![Want::OneOf(options.collect())]
            }),
        case("rsm::area_at", "texel: vec2u, distance: f32, cosine: f32")
            .imports("rsm::place_of_texel")
            .before(PLACE)
            .also("f32", "area_at(place, distance, cosine)")
            .random(join([texel(), magnitude(1e-3, 1e4), real(-1.0, 1.0)]))
            .twin(area, |i| values([surface_area(i[0], i[1], i[2], i[3])])),
        case("rsm::texel_area", "texel: vec2u, distance: f32, cosine: f32")
            .also("f32", format!("texel_area(texel, {SIZE}, distance, cosine)"))
            .random(join([texel(), magnitude(1e-3, 1e4), real(-1.0, 1.0)]))
            .twin(area, |i| values([surface_area(i[0], i[1], i[2], i[3])])),
    ]
}

fn positions() -> Vec<Case> {
    let place =
        ulps(8.0, "of what the offset from the light makes in its picture: far from the axis and near the light's plane it is stretched");
    vec![
        case("rsm::position_in_cell", "index: u32, position: vec3f")
            .gives("vec3f")
            .random(view_and_position())
            .twin(place, |i| seen(i[0], v3(&i[1..]))),
        case("rsm::position_in_map", "index: u32, position: vec3f")
            .also("vec3f", format!("position_in_map(index, position, {SIZE})"))
            .random(view_and_position())
            .twin(place, |i| {
                let side = f64::from(SIDE);
                let origin = [(i[0] % 6.0) * side, (i[0] / 6.0).floor() * side, 0.0];
                let scaled = |(axis, want): (usize, Want)| match want {
                    Want::Value { value, scale } if axis < 2 => Want::of(value * side + origin[axis], scale * side + origin[axis]),
                    other => other,
                };
                seen(i[0], v3(&i[1..])).into_iter().enumerate().map(scaled).collect()
            }),
        case("rsm::place_towards", "index: u32, position: vec3f").gives("vec2f").random(view_and_position()).twin(place, |i| {
            let (view, kind) = view(i[0]);
            let v = v3(&i[1..]) - view.origin;
            let z = v.dot(view.forward);
            let nearest = || {
                seen(i[0], v3(&i[1..]))[..2]
                    .iter()
                    .map(|want| match want {
                        // Beyond the border it is the border.
                        Want::Value { value, scale } => {
                            Want::of(value.clamp(0.0, 1.0), if (-0.5..=1.5).contains(value) { *scale } else { 1.0 })
                        }
                        other => other.clone(),
                    })
                    .collect::<Vec<_>>()
            };
            // Behind: beyond the border on its side, a thousandth of the distance from the light's plane.
            let beyond = || {
                let least = (1e-3 * v.length()).max(1e-30);
                let side = |side: f64, tan: f64| {
                    let value = 0.5 + 0.5 * side / (least * tan);
                    Want::of(value.clamp(0.0, 1.0), v.length() / (least * tan))
                };
                vec![side(v.dot(view.right), view.tan_x), side(-v.dot(view.up), view.tan_y)]
            };
            if v.length() == 0.0 {
                return vec![Want::Between(0.0, 1.0); 2];
            }
            let border = 1e-3 * v.length();
            match () {
                () if kind == DIRECTIONAL || z > border * 1.001 => nearest(),
                () if z < border * 0.999 => beyond(),
                () => nearest().into_iter().zip(beyond()).map(|(a, b)| Want::OneOf(vec![a, b])).collect(),
            }
        }),
        case("rsm::distance_in_view", "index: u32, position: vec3f").gives("f32").random(view_and_position()).twin(
            ulps(4.0, "a vector's length, or its part along an axis"),
            |i| {
                let (view, kind) = view(i[0]);
                let v = v3(&i[1..]) - view.origin;
                vec![Want::of(if kind == DIRECTIONAL { v.dot(view.forward) } else { v.length() }, v.length())]
            },
        ),
        case("rsm::view_towards", "index: u32, position: vec3f")
            .gives("u32")
            .edges(
                [[0.0; 3], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [0.0, 1.0, -1.0], [0.0, 0.0, -1.0]]
                    .map(|d| vec![3.0, d[0] - 2.0, d[1] + 0.5, d[2] + 0.25]),
            )
            .random(view_and_position())
            .twin(EXACT, |i| {
                let (view, kind) = view(i[0]);
                if kind != POINT {
                    return values([i[0]]);
                }
                // Any face whose direction is no farther from that of the position than the others'.
                let v = v3(&i[1..]) - view.origin;
                let along: Vec<f64> = (1..7).map(|face| v.dot(self::view(f64::from(face)).0.forward)).collect();
                let most = along.iter().copied().fold(f64::MIN, f64::max);
                let fitting = (1..7).filter(|face| along[*face - 1] >= most - 1e-6 * v.length()).map(|face| Want::new(face as f64));
                vec![Want::OneOf(fitting.collect())]
            }),
    ]
}

/// Six faces of a point light together see all of the sphere, and a directional light's square has its area.
#[test]
fn extents_add_up() {
    let texels = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y)));
    let sum: f64 = texels.clone().map(|(x, y)| extent(1.0, of_texel(f64::from(SIDE + x), y.into()).1)).sum();
    assert!((6.0 * sum / (4.0 * PI) - 1.0).abs() < 0.01, "{sum}");
    let sum: f64 = texels.map(|_| extent(7.0, DVec2::ZERO)).sum();
    assert!((sum / 225.0 - 1.0).abs() < 1e-9, "{sum}");
}

#[test]
fn maps_of_lights_are_as_their_twins() {
    check(cases());
}
