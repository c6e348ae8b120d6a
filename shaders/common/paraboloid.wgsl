// The hemisphere around a normal as the unit disk ([VAL] 5, [ACRSM] 5.3.2; paraboloid mapping), and imperfect shadow maps in an atlas.

// Two unit vectors that complete `normal` to a right-handed basis (Duff et al. 2017); columns: tangent, bitangent, normal.
fn basis(normal: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (s + normal.z);
    let b = normal.x * normal.y * a;
    return mat3x3f(
        vec3f(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x),
        vec3f(b, s + normal.y * normal.y * a, -normal.y),
        normal,
    );
}

// Unit direction in the basis' space to the disk; |result| ≤ 1 for z ≥ 0. The antipode (z = -1) has no image: bounded instead.
fn paraboloid_project(local: vec3f) -> vec2f {
    return local.xy / max(1.0 + local.z, 1e-6);
}

// Disk to unit direction.
fn paraboloid_unproject(p: vec2f) -> vec3f {
    let r2 = dot(p, p);
    return vec3f(2.0 * p, 1.0 - r2) / (1.0 + r2);
}

// Distance on the disk per angle (rad) at `p`: the map is conformal with this scale.
fn paraboloid_scale(p: vec2f) -> f32 {
    return 0.5 * (1.0 + dot(p, p));
}

// Top left texel of a map in the atlas: maps fill rows of `maps_per_row`.
fn atlas_origin(map: u32, map_size: u32, maps_per_row: u32) -> vec2u {
    return vec2u(map % maps_per_row, map / maps_per_row) * map_size;
}

struct Rectangle {
    low: vec2f,
    high: vec2f, // below `low` when empty
}

fn include(r: Rectangle, p: vec2f) -> Rectangle {
    return Rectangle(min(r.low, p), max(r.high, p));
}

// A point of the circle that continues an edge, if it lies on the edge itself; `across` is normal to the edge's plane through the eye.
fn include_if_between(r: Rectangle, p: vec2f, a: vec3f, b: vec3f, across: vec3f) -> Rectangle {
    let s = paraboloid_unproject(p);
    let between = dot(cross(a, s), across) >= 0.0 && dot(cross(s, b), across) >= 0.0;
    let grown = include(r, p);
    return Rectangle(select(r.low, grown.low, between), select(r.high, grown.high, between));
}

// Rectangle around the image of the straight edge between two points at or above the horizon. The map is a stereographic projection: planes through the eye
// become circles around n.xy / n.z, whose leftmost, rightmost, lowest and highest points count where they are on the edge.
fn include_edge(r: Rectangle, a: vec3f, b: vec3f) -> Rectangle {
    let start = a * inverseSqrt(max(dot(a, a), 1e-30));
    let end = b * inverseSqrt(max(dot(b, b), 1e-30));
    var out = include(include(r, paraboloid_project(start)), paraboloid_project(end));
    let across = cross(start, end);
    // Nearly straight within the unit disk: off by less than one part in 2000, which the caller's margin covers.
    if abs(across.z) > 1e-3 * length(across) {
        let centre = across.xy / across.z;
        let radius = sqrt(1.0 + dot(centre, centre));
        out = include_if_between(out, centre + vec2f(radius, 0.0), start, end, across);
        out = include_if_between(out, centre - vec2f(radius, 0.0), start, end, across);
        out = include_if_between(out, centre + vec2f(0.0, radius), start, end, across);
        out = include_if_between(out, centre - vec2f(0.0, radius), start, end, across);
    }
    return out;
}

// Rectangle around the image of the part of a triangle above the horizon (z > 0 in the map's frame): its edges above, and the piece of the horizon
// between the two points where its other edges come down to it.
fn above_horizon(a: vec3f, b: vec3f, c: vec3f) -> Rectangle {
    var r = Rectangle(vec2f(1.0), vec2f(-1.0));
    if max(a.z, max(b.z, c.z)) <= 0.0 {
        return r;
    }
    var landing = vec3f(0.0);
    var p = c;
    var q = a;
    for (var edge = 0u; edge < 3u; edge++) {
        if edge > 0u {
            p = q;
            q = select(c, b, edge == 1u);
        }
        // A corner on the horizon counts as above: an edge along the horizon is an arc of the circle, which goes beyond its ends.
        if max(p.z, q.z) < 0.0 {
            continue;
        }
        if min(p.z, q.z) >= 0.0 {
            r = include_edge(r, p, q);
            continue;
        }
        let meet = vec3f(mix(p.xy, q.xy, p.z / (p.z - q.z)), 0.0);
        r = include_edge(r, select(p, meet, p.z < 0.0), select(q, meet, q.z < 0.0));
        if any(landing != vec3f(0.0)) {
            // Nearly half of the horizon lies in no certain plane: the whole circle.
            if dot(landing, meet) < -0.99 * length(landing) * length(meet) {
                return Rectangle(vec2f(-1.0), vec2f(1.0));
            }
            r = include_edge(r, landing, meet);
        }
        landing = meet;
    }
    return r;
}
