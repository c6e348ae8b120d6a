//! As many points on each triangle as a tessellation would have vertices.

use std::collections::HashMap;

use super::{MAX_POINTS, PointError, Shapes};
use crate::{
    gpu_data::ScenePoint,
    import::edges,
    random::{hash2, unit},
};

/// Order of the polynomial that blends between the factors of the smallest and of the largest triangle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Smoothness {
    /// 3x² − 2x³.
    #[default]
    Third,
    /// 6x⁵ − 15x⁴ + 10x³.
    Fifth,
}

impl Smoothness {
    /// The polynomial of x = (value − lower) / (upper − lower), clamped to 0…1; 1 where the limits are equal, so that a scene of equal
    /// triangles gets the greatest factor.
    pub fn step(self, lower: f64, upper: f64, value: f64) -> f64 {
        let x = if upper > lower { ((value - lower) / (upper - lower)).clamp(0.0, 1.0) } else { 1.0 };
        match self {
            Self::Third => x * x * (3.0 - 2.0 * x),
            Self::Fifth => x * x * x * (10.0 + x * (6.0 * x - 15.0)),
        }
    }
}

/// Points with factors from `min` to `max`.
pub(super) fn generate(shapes: &Shapes<'_>, min: u32, max: u32, smoothness: Smoothness, seed: u32) -> Result<Vec<ScenePoint>, PointError> {
    if min == 0 || min > max {
        return Err(PointError::Factors { min, max });
    }
    let statistics = || shapes.objects().map(|(_, mesh)| &mesh.statistics);
    let area_min = statistics().map(|s| s.area_min).fold(f64::INFINITY, f64::min);
    let area_max = statistics().map(|s| s.area_max).fold(0.0, f64::max);
    let edge_min = statistics().map(|s| s.edge_min).fold(f64::INFINITY, f64::min);
    let edge_max = statistics().map(|s| s.edge_max).fold(0.0, f64::max);
    let factor = |lower, upper, value| ((smoothness.step(lower, upper, value) * f64::from(max)).ceil() as u32).max(min);

    let mut known = HashMap::new();
    let mut counts = Vec::new();
    let mut wanted = 0;
    for (_, mesh) in shapes.objects() {
        for triangle in &mesh.triangles {
            let corners = mesh.corners(triangle);
            let inner = factor(area_min, area_max, crate::import::area(&corners)); // [ACRSM] eq. 5.3
            let divisions = edges(&corners).map(|edge| inner.saturating_add(factor(edge_min, edge_max, edge))); // [ACRSM] eq. 5.4
            let limit = MAX_POINTS - wanted;
            let count = *known.entry(divisions).or_insert_with(|| walk_length(divisions, limit));
            wanted += count;
            if wanted > MAX_POINTS {
                return Err(PointError::TooMany { wanted, lower: "the tessellation factors" });
            }
            counts.push(count as u32);
        }
    }

    let mut points = Vec::with_capacity(wanted as usize);
    shapes.for_each_surface(|index, surface, area| {
        let count = counts[index as usize];
        let share = area / f64::from(count);
        points.extend((0..count).map(|i| {
            let random = unit(hash2(hash2(seed, index), i));
            surface.point((f64::from(i) + random) / f64::from(count), share)
        }));
    });
    Ok(points)
}

/// Number of points that algorithm 5.2 makes of a triangle whose edges have these numbers of divisions (1/s_a, 1/s_b, 1/s_c); stops beyond
/// `limit`. At least 1.
fn walk_length(divisions: [u32; 3], limit: u64) -> u64 {
    let [step_a, step_b, step_c] = divisions.map(|n| 1.0 / f64::from(n));
    let mut count = 0;
    for i in 0..divisions[2] {
        let gamma = f64::from(i) * step_c;
        let mut alpha = 1.0 - gamma;
        while alpha > 0.0 && count <= limit {
            count += 1;
            let beta = 1.0 - alpha - gamma;
            alpha -= (1.0 - alpha) * step_a + (1.0 - beta) * step_b + (1.0 - gamma) * step_c;
        }
        if count > limit {
            break;
        }
    }
    count.max(1)
}
