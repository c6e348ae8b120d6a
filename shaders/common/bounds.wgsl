// What a group of surface points can get from a light, from below and from above: their box, the cone of their normals, and how far their own planes
// lie from its middle. Nothing outside of these bounds is possible, whatever the rounding: they are widened by more than that.

#import common::radiometry::PI

// Points of surfaces that lie near each other.
struct SurfaceBounds {
    middle: vec3f, // of the box around the points, world space
    points: u32, // 0: there is no surface
    half_size: vec3f, // of the box
    spread: f32, // length of the largest difference between a normal and the axis
    axis: vec3f, // mean normal, unit
    first: u32, // texel of the group's corner: x + 65536 y
    low: f32, // least and greatest n · (p − middle)
    high: f32,
}

// Shares by which sums of a few products in 32 bits may be off, generously: of the lengths involved, and of the coordinates' size.
const SLACK: f32 = 1e-5;
const COORDINATE_SLACK: f32 = 1e-6;

// Cosine of an angle less (`nearer`) or more the half angle of a cone, at least 0 and at most π; the chord of the half angle is `spread`.
// The angle's sine is given as well: at small angles it does not follow from the cosine.
fn cosine_beside_cone(cosine: f32, sine: f32, spread: f32, nearer: bool) -> f32 {
    let cos_half = 1.0 - 0.5 * spread * spread;
    let sin_half = spread * sqrt(max(1.0 - 0.25 * spread * spread, 0.0));
    if nearer {
        return select(cosine * cos_half + sine * sin_half, 1.0, cosine >= cos_half);
    }
    return select(cosine * cos_half - sine * sin_half, -1.0, cosine <= -cos_half);
}

// Least and greatest `disk_form_factor` of a light towards any point of the group; distances² below `least_d2` count as this. 1/m²
fn form_factor_bounds(group: SurfaceBounds, position: vec3f, normal: vec3f, area: f32, least_d2: f32) -> vec2f {
    let to_light = position - group.middle;
    let d = length(to_light);
    let far = abs(position) + abs(group.middle);
    let slack = SLACK * (d + length(group.half_size)) + COORDINATE_SLACK * max(far.x, max(far.y, far.z));
    let beyond = max(abs(to_light) - group.half_size, vec3f(0.0));
    let across = abs(to_light) + group.half_size;
    let nearest = max(length(beyond) - slack, 0.0);
    let farthest = length(across) + slack;

    // Of the light above the points' planes, n · (light − p), and of the points above the light's.
    let cosine = dot(group.axis, to_light) / max(d, 1e-30);
    let sine = length(cross(group.axis, to_light)) / max(d, 1e-30);
    let over = d * cosine_beside_cone(cosine, sine, group.spread, true) - group.low + slack;
    let least_over = d * cosine_beside_cone(cosine, sine, group.spread, false) - group.high - slack;
    let front = -dot(normal, to_light);
    let reach = dot(abs(normal), group.half_size) + slack;

    var upper = 0.0;
    if over > 0.0 && front + reach > 0.0 {
        // Both cosines are at most 1.
        let cosines = min(over, nearest) * min(front + reach, nearest);
        let at_nearest = select(cosines / max(nearest * nearest, 1e-30), 1.0, nearest <= 0.0);
        upper = at_nearest / max(PI * max(nearest * nearest, least_d2) + area, 1e-30) * (1.0 + SLACK);
    }
    var lower = 0.0;
    if least_over > 0.0 && front - reach > 0.0 && farthest > 0.0 {
        let cosines = min(least_over, farthest) * min(front - reach, farthest) / (farthest * farthest);
        lower = cosines / max(PI * max(farthest * farthest, least_d2) + area, 1e-30) * (1.0 - SLACK);
    }
    return vec2f(lower, upper);
}
