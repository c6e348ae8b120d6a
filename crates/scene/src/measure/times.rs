//! The times at which a scene is measured.

use crate::{motion::Track, scene::Scene, sky::DAY_S};

/// As many times as `count`, evenly over the scene's motion, and time 0; the one time 0 of a scene that stands still.
pub(super) fn of(scene: &Scene, count: u32) -> Vec<f64> {
    let objects = scene.objects.iter().filter_map(|object| object.pose.span());
    let lights = scene.lights.iter().filter_map(|light| light.pose.span());
    let shapes = scene.meshes.iter().filter_map(|mesh| mesh.deformation.as_ref()).flat_map(|deformation| deformation.spans());
    let sun = scene.sun.map(|_| (0.0, DAY_S, true));
    let spans: Vec<_> = objects.chain(lights).chain(shapes).chain(Track::span(&scene.camera)).chain(sun).collect();
    let start = spans.iter().map(|span| span.0).fold(f64::INFINITY, f64::min);
    let end = spans.iter().map(|span| span.1).fold(f64::NEG_INFINITY, f64::max);
    if start >= end || count < 2 {
        return vec![0.0];
    }
    // Where everything starts again, the end is the start.
    let steps = if spans.iter().all(|span| span.2) { count } else { count - 1 };
    let mut times: Vec<f64> = (0..count).map(|i| start + (end - start) * f64::from(i) / f64::from(steps)).collect();
    // The time that is shown if nobody asks for another.
    if !times.contains(&0.0) && start < 0.0 {
        times.push(0.0);
        times.sort_by(f64::total_cmp);
    }
    times
}
