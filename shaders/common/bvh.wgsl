// Rays against the hierarchy that the host builds (crate manylight-scene, module `bvh`; layouts are compared when a shader loads).
// The buffers belong to a node, so the loop over them does, too: these are its parts.

struct BvhNode {
    low: vec3f,
    first: u32, // triangle, or the first of two children
    high: vec3f,
    count: u32, // triangles; 0: two children
}

struct BvhTriangle {
    a: vec3f,
    index: u32, // in `scene_triangles`
    ab: vec3f,
    material: u32,
    ac: vec3f,
    object: u32,
}

// Depth that a traversal's stack must hold; the host refuses deeper hierarchies.
const BVH_STACK: u32 = 48u;

struct Ray {
    origin: vec3f,
    direction: vec3f, // need not have unit length: distances are in its lengths
    inverse: vec3f, // one over the direction; large instead of infinite
}

fn make_ray(origin: vec3f, direction: vec3f) -> Ray {
    let tiny = vec3f(1e-20);
    let safe = select(direction, select(-tiny, tiny, direction >= vec3f(0.0)), abs(direction) < tiny);
    return Ray(origin, direction, 1.0 / safe);
}

const MISSED: f32 = 3.0e38;

// Distance at which the ray enters the box, or MISSED if that is not before `limit`.
fn enter_box(ray: Ray, low: vec3f, high: vec3f, limit: f32) -> f32 {
    let a = (low - ray.origin) * ray.inverse;
    let b = (high - ray.origin) * ray.inverse;
    let near = min(a, b);
    let far = max(a, b);
    let enter = max(max(near.x, near.y), max(near.z, 0.0));
    let leave = min(min(far.x, far.y), min(far.z, limit));
    // A few rounding errors of slack, so that no ray slips through between two boxes.
    return select(MISSED, enter, enter <= leave * 1.0000004);
}

struct TriangleHit {
    t: f32, // MISSED if it does not hit
    u: f32, // barycentric weights of the second and third corner
    v: f32,
}

// Möller and Trumbore 1997, both sides.
fn hit_triangle(ray: Ray, triangle: BvhTriangle, nearest: f32, limit: f32) -> TriangleHit {
    let p = cross(ray.direction, triangle.ac);
    let determinant = dot(triangle.ab, p);
    let inverse = 1.0 / determinant;
    let s = ray.origin - triangle.a;
    let u = dot(s, p) * inverse;
    let q = cross(s, triangle.ab);
    let v = dot(ray.direction, q) * inverse;
    let t = dot(triangle.ac, q) * inverse;
    let hit = determinant != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > nearest && t < limit;
    return TriangleHit(select(MISSED, t, hit), u, v);
}
