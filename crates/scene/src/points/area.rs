//! A given number of points, in proportion to area.

use super::{MAX_POINTS, PointError, Shapes};
use crate::{
    gpu_data::ScenePoint,
    random::{hash2, unit},
};

/// Systematic sampling of the cumulative area: point i lies at a random place of the i-th of `count` equal pieces.
pub(super) fn generate(shapes: &Shapes<'_>, count: u32, seed: u32) -> Result<Vec<ScenePoint>, PointError> {
    if u64::from(count) > MAX_POINTS {
        return Err(PointError::TooMany { wanted: count.into(), lower: "the number of points" });
    }
    let mut total = 0.0;
    shapes.for_each_surface(|_, _, area| total += area);
    if count == 0 || total <= 0.0 {
        return Ok(Vec::new());
    }
    let share = total / f64::from(count);
    let place = |i: u32| (f64::from(i) + unit(hash2(seed, i))) * share;
    let mut points = Vec::with_capacity(count as usize);
    let mut before = 0.0;
    let mut next = 0;
    let mut last = None;
    shapes.for_each_surface(|_, surface, area| {
        let after = before + area;
        while next < count && place(next) < after && area > 0.0 {
            points.push(surface.point((place(next) - before) / area, share));
            next += 1;
        }
        if area > 0.0 {
            last = Some(surface.point(1.0, share));
        }
        before = after;
    });
    // Rounding of the sums may leave the last place beyond the last triangle.
    points.extend(last.into_iter().cycle().take((count - next) as usize));
    Ok(points)
}
