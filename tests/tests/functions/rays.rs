//! Rays against boxes, triangles and the hierarchy of a real scene.

use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};
use manylight_scene::bvh::BvhNode;
use proptest::strategy::Strategy;

use super::{
    directions::v3,
    harness::{Case, EXACT, Resource, Want, absolute, check, relative, ulps, values},
    inputs::{Numbers, join, magnitude, one_of, real, unit_vector, vector},
    scene::{MISSED, ray_offset, world},
};

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [boxes(), hierarchy()].into_iter().flatten().collect()
}

fn boxes() -> Vec<Case> {
    vec![
        Case::new("bvh::make_ray", "origin: vec3f, direction: vec3f")
            .before("let ray = make_ray(origin, direction);")
            .also("vec3f", "ray.origin")
            .also("vec3f", "ray.direction")
            .also("vec3f", "ray.inverse")
            .edges([
                vec![0.0, 0.0, 0.0, 0.0, -0.0, 1e-20],
                vec![0.0, 0.0, 0.0, 1e-30, -1e-30, 1e20],
                vec![0.0, 0.0, 0.0, -1e-19, 1e-21, 0.0],
            ])
            .random(join([vector(1e-3, 1e4), vector(1e-6, 1e6)]))
            .twin(ulps(2.5, "a quotient, for which WGSL allows this"), |i| {
                let tiny = f64::from(1e-20_f32);
                let inverse = |d: f64| {
                    1.0 / if d.abs() >= tiny {
                        d
                    } else if d >= 0.0 {
                        tiny
                    } else {
                        -tiny
                    }
                };
                values([i[0], i[1], i[2], i[3], i[4], i[5], inverse(i[3]), inverse(i[4]), inverse(i[5])])
            }),
        Case::new("bvh::ray_offset", "low: vec3f, high: vec3f, diagonal: f32")
            .imports("scene::SceneInfo")
            .before("let info = SceneInfo(low, diagonal, high, 1.0, 1.0, 1.0, 1.0, 1.0, 0u, 0u, 0u, 0u);")
            .also("f32", "ray_offset(info)")
            .edges([vec![0.0; 7]])
            .random(join([vector(1e-3, 1e6), vector(1e-3, 1e6), magnitude(1e-3, 1e5)]))
            .twin(ulps(2.0, "a product"), |i| values([ray_offset(v3(i), v3(&i[3..]), i[6])])),
        Case::new("bvh::enter_box", "origin: vec3f, direction: vec3f, low: vec3f, extent: vec3f, limit: f32")
            .imports("bvh::make_ray")
            .also("f32", "enter_box(make_ray(origin, direction), low, low + extent, limit)")
            .edges([
                // Along a face, from inside, away from it, a flat box, a limit before it.
                vec![0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 2.0, 1.0, 3e38],
                vec![0.5, 0.5, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 3e38],
                vec![0.5, 2.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 3e38],
                vec![0.5, -1.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 3e38],
                vec![0.5, -1.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.5],
            ])
            .random(
                // At a point of the box or beside it.
                (
                    vector(0.1, 10.0),
                    vector(1e-2, 1e1),
                    [0.0..4.0_f64, 0.0..4.0, 0.0..4.0],
                    [-0.3..1.3_f64, -0.3..1.3, -0.3..1.3],
                    one_of(&[3e38, 1.0, 100.0, 0.0]),
                )
                    .prop_map(|(origin, low, extent, inside, limit)| {
                        let target = (0..3).map(|k| low[k] + inside[k] * extent[k] - origin[k]);
                        [origin.clone(), target.collect(), low.clone(), extent.to_vec(), limit].concat()
                    })
                    .boxed(),
            )
            .random(join([
                vector(0.1, 10.0),
                unit_vector(),
                vector(1e-2, 1e1),
                magnitude(0.1, 4.0),
                magnitude(0.1, 4.0),
                magnitude(0.1, 4.0),
                one_of(&[3e38]),
            ]))
            .twin(relative(1e-6, "a difference and a product, and the slack of a few roundings"), |i| {
                let (origin, direction, low) = (v3(i), v3(&i[3..]), v3(&i[6..]));
                let high = (low.as_vec3() + v3(&i[9..]).as_vec3()).as_dvec3();
                let [mut enter, mut leave] = [0.0_f64, i[12]];
                let mut largest = 0.0_f64;
                for k in 0..3 {
                    let tiny = f64::from(1e-20_f32);
                    let d =
                        if direction[k].abs() >= tiny { direction[k] } else { tiny.copysign(if direction[k] >= 0.0 { 1.0 } else { -1.0 }) };
                    let (a, b) = ((low[k] - origin[k]) / d, (high[k] - origin[k]) / d);
                    enter = enter.max(a.min(b));
                    leave = leave.min(a.max(b));
                    largest = largest.max(a.abs().min(b.abs()).min(1e15));
                }
                let margin = (leave - enter) / enter.abs().max(leave.abs()).max(1e-20);
                match () {
                    () if margin > 2e-6 => vec![Want::new(enter)],
                    () if margin < -2e-6 => vec![Want::new(MISSED)],
                    () => vec![Want::OneOf(vec![Want::new(enter), Want::new(MISSED)])],
                }
            }),
        Case::new("bvh::hit_triangle", "origin: vec3f, direction: vec3f, a: vec3f, ab: vec3f, ac: vec3f, nearest: f32, limit: f32")
            .imports("bvh::{make_ray, BvhTriangle, MISSED}")
            .before("let h = hit_triangle(make_ray(origin, direction), BvhTriangle(a, 0u, ab, 0u, ac, 0u), nearest, limit);")
            .also("f32", "h.t")
            .also("vec2f", "select(vec2f(0.0), vec2f(h.u, h.v), h.t < MISSED)")
            .edges([
                // A corner, an edge, edge-on, no area, behind.
                vec![0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
                vec![0.5, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
            ])
            .random(
                (
                    vector(0.1, 10.0),
                    vector(0.1, 10.0),
                    vector(0.1, 10.0),
                    vector(0.1, 10.0),
                    [-0.3..1.3_f64, -0.3..1.3],
                    one_of(&[3e38, 1.0, 0.5]),
                )
                    .prop_map(|(origin, a, ab, ac, at, limit)| {
                        let target = (0..3).map(|k| a[k] + at[0] * ab[k] + at[1] * ac[k] - origin[k]);
                        [origin.clone(), target.collect(), a.clone(), ab.clone(), ac.clone(), vec![0.0], limit].concat()
                    })
                    .boxed(),
            )
            .twin(relative(4e-6, "of what a determinant's rounding makes of distance and weights"), |i| {
                let (origin, direction, a, ab, ac) = (v3(i), v3(&i[3..]), v3(&i[6..]), v3(&i[9..]), v3(&i[12..]));
                let miss = || vec![Want::new(MISSED), Want::new(0.0), Want::new(0.0)];
                let hit = meet(origin, direction, a, ab, ac);
                if hit.condition > 3e4 {
                    // Edge-on: rounding decides everything.
                    return vec![Want::Between(i[15], MISSED), Want::Between(-1.0, 2.0), Want::Between(-1.0, 2.0)];
                }
                let slack = 1e-6 * (2.0 + hit.condition);
                let found = vec![
                    Want::of(hit.t, hit.condition * (1.0 + hit.t.abs())),
                    Want::of(hit.u, hit.condition),
                    Want::of(hit.v, hit.condition),
                ];
                let inside = hit.u.min(hit.v).min(1.0 - hit.u - hit.v);
                let ahead = (hit.t - i[15]).min(i[16] - hit.t);
                match () {
                    () if inside < -slack || ahead < -slack => miss(),
                    () if inside > slack && ahead > slack => found,
                    () => found.into_iter().zip(miss()).map(|(a, b)| Want::OneOf(vec![a, b])).collect(),
                }
            }),
    ]
}

/// Where a ray meets a triangle's plane.
struct Meeting {
    t: f64,
    u: f64,
    v: f64,
    /// How much larger the errors of these are than those of what they are computed from.
    condition: f64,
}

/// By solving o + t d = a + u ab + v ac.
fn meet(origin: DVec3, direction: DVec3, a: DVec3, ab: DVec3, ac: DVec3) -> Meeting {
    let matrix = DMat3::from_cols(-direction, ab, ac);
    let determinant = matrix.determinant();
    let extent = direction.length() * ab.length() * ac.length();
    if determinant.abs() <= 1e-300 {
        return Meeting { t: f64::NAN, u: f64::NAN, v: f64::NAN, condition: f64::INFINITY };
    }
    let found = matrix.inverse() * (origin - a);
    let reach = (origin - a).length() / ab.length().min(ac.length()).min(direction.length());
    Meeting { t: found.x, u: found.y, v: found.z, condition: extent / determinant.abs() * (1.0 + reach) }
}

/// Rays from inside the box: anywhere, and at the edges of its objects.
fn rays() -> Numbers {
    (real(0.1, 5.4), real(0.1, 5.4), real(0.1, 5.4), unit_vector(), magnitude(1e-2, 1e2))
        .prop_map(|(x, y, z, d, l)| vec![x[0], y[0], z[0], d[0] * l[0], d[1] * l[0], d[2] * l[0]])
        .boxed()
}

fn hierarchy() -> Vec<Case> {
    let world = world();
    let (scene, seeing) = (Arc::clone(&world), Arc::clone(&world));
    let empty = [
        Resource::buffer("bvh_nodes", "BvhNode", &[BvhNode { low: Vec3::ZERO, first: 0, high: Vec3::ZERO, count: 0 }]),
        world.hierarchy()[1].clone(),
    ];
    let flag = |v: bool| Want::new(f64::from(u8::from(v)));
    let intersect = || {
        Case::new("bvh::intersect", "origin: vec3f, direction: vec3f, limit: f32")
            .imports("bvh::{make_ray, bvh_triangles, MISSED}")
            .before("let ray = make_ray(origin, direction); let h = intersect(ray, limit, false); let t = bvh_triangles[h.triangle];")
            .also("f32", "h.t")
            .also("bool", "intersect(ray, limit, true).t < MISSED")
            // That the triangle and the weights are those of the place.
            .also("f32", "select(0.0, distance(t.a + h.u * t.ab + h.v * t.ac, origin + h.t * direction), h.t < MISSED)")
            .random(join([rays(), one_of(&[3e38, 1.0, 3.0])]))
    };
    vec![
        intersect().reads(&world.hierarchy()).count(2048).twin(
            absolute(4e-5, "in the box's units of 0.1 m: a ray's distance over a few of them"),
            move |i| {
                let (origin, direction) = (v3(i), v3(&i[3..]));
                match scene.nearest(origin, direction, i[6].min(MISSED)) {
                    Ok(Some((t, ..))) => vec![
                        Want::Between(
                            t - 1e-5 * (1.0 + t) / direction.length().min(1.0),
                            t + 1e-5 * (1.0 + t) / direction.length().min(1.0),
                        ),
                        flag(true),
                        Want::of(0.0, 1.0),
                    ],
                    Ok(None) => vec![Want::new(MISSED), flag(false), Want::new(0.0)],
                    Err(()) => vec![Want::Between(0.0, MISSED), Want::Between(0.0, 1.0), Want::finite()],
                }
            },
        ),
        intersect().reads(&empty).count(16).twin(EXACT, move |_| vec![Want::new(MISSED), flag(false), Want::new(0.0)]),
        Case::new("bvh::visible", "p: vec3f, q: vec3f")
            .gives("bool")
            .reads(&world.hierarchy())
            .edges([vec![1.0; 6]])
            .random(join((0..6).map(|_| real(0.05, 5.5))))
            .count(2048)
            .twin(EXACT, move |i| match seeing.visible(v3(i), v3(&i[3..])) {
                Ok(seen) => vec![flag(seen)],
                Err(()) => vec![Want::Between(0.0, 1.0)],
            }),
    ]
}

#[test]
fn rays_are_as_their_twins() {
    check(cases());
}
