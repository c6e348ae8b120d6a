//! Rays against the hierarchy find what rays against each triangle find.

use std::{cell::Cell, path::Path};

use glam::{DVec3, Vec3};
use manylight_scene::{
    Scene,
    bvh::{Bvh, BvhTriangle, Hit, MISSED, Ray},
};
use proptest::prelude::*;

/// Distance at which a ray meets a triangle, in 64 bits: by the plane, then by the areas of the triangles that the point makes with the edges.
fn meets(origin: DVec3, direction: DVec3, t: &BvhTriangle) -> Option<f64> {
    let [a, ab, ac] = [t.a, t.ab, t.ac].map(|v| v.as_dvec3());
    let normal = ab.cross(ac);
    let distance = (a - origin).dot(normal) / direction.dot(normal);
    let p = origin + distance * direction;
    let inside = [(a, a + ab), (a + ab, a + ac), (a + ac, a)].iter().all(|(p0, p1)| (*p1 - *p0).cross(p - *p0).dot(normal) >= 0.0);
    (distance.is_finite() && distance > 0.0 && inside).then_some(distance)
}

/// How far a hit is from the edges of its triangle, as a share of it.
fn margin(hit: &Hit) -> f32 {
    hit.u.min(hit.v).min(1.0 - hit.u - hit.v)
}

fn asset(name: &str) -> Bvh {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets")).join(name);
    let scene = Scene::load(&path).unwrap_or_else(|e| panic!("{e}"));
    Bvh::build(&scene, &scene.sample(0.0))
}

#[test]
fn they_find_what_each_triangle_finds() {
    for name in ["cornell.ron", "glossy.ron", "floating.ron"] {
        let bvh = asset(name);
        let met = Cell::new(0);
        proptest!(ProptestConfig { cases: 600, failure_persistence: None, ..Default::default() }, |(from in prop::array::uniform3(-1.0_f32..7.0), to in prop::array::uniform3(-1.0_f32..7.0), limit in 0.3_f32..1.5)| {
            let (origin, to) = (Vec3::from(from), Vec3::from(to));
            prop_assume!(origin.distance(to) > 1e-2);
            let ray = Ray::between(origin, to);
            let mut hits = Vec::new();
            bvh.all_hits(&ray, limit, &mut hits);
            let direction = ray.direction.as_dvec3();
            let all: Vec<_> = bvh.triangles.iter().map(|t| meets(origin.as_dvec3(), direction, t).filter(|d| *d < limit.into())).collect();
            // At edges, at the limit and at the origin rounding decides; elsewhere nothing does.
            let is_certain = |hit: &Hit| margin(hit) > 1e-4 && (hit.t - limit).abs() > 1e-4 && hit.t > 1e-4;
            for hit in hits.iter().filter(|hit| is_certain(hit)) {
                met.set(met.get() + 1);
                let distance = all[hit.triangle as usize].expect("the ray does not meet this triangle");
                prop_assert!((distance - f64::from(hit.t)).abs() < 1e-4, "{} instead of {}", hit.t, distance);
            }
            let margins = |d: f64| d > 1e-3 && d < f64::from(limit) - 1e-3;
            for (index, _) in all.iter().enumerate().filter(|(_, d)| d.is_some_and(margins)) {
                prop_assert!(hits.iter().any(|hit| hit.triangle == index as u32), "triangle {index} was not met");
            }
            let nearest = bvh.nearest(&ray, limit);
            let least = hits.iter().map(|hit| hit.t).fold(MISSED, f32::min);
            prop_assert_eq!(nearest.map_or(MISSED, |hit| hit.t), least);
            prop_assert_eq!(bvh.is_blocked(&ray, limit), nearest.is_some());
        });
        println!("{name}: {} hits compared", met.get());
        assert!(met.get() > 300, "{name}: only {} hits compared", met.get());
    }
}

#[test]
fn no_ray_slips_through_the_edges_of_a_closed_box() {
    let bvh = asset("cornell_empty.ron");
    let middle = Vec3::new(2.78, 2.73, 2.8);
    // Towards points on the diagonals and edges of the walls, all of which but the front are there.
    for i in 0..=1000 {
        let s = 5.4 * i as f32 / 1000.0 + 0.05;
        for target in [Vec3::new(s, s, 5.592), Vec3::new(s, 0.0, s), Vec3::new(0.0, s, s), Vec3::new(s, 0.0, 5.592)] {
            let ray = Ray::new(middle, target - middle);
            assert!(bvh.nearest(&ray, MISSED).is_some(), "towards {target}");
        }
    }
}

#[test]
fn nothing_is_met_where_there_is_nothing() {
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    assert_eq!(Bvh::default().nearest(&ray, MISSED), None);
    assert!(Bvh::default().sees(Vec3::ZERO, Vec3::ONE));
}
