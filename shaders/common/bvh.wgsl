// Rays against the hierarchy that the host builds (crate manylight-scene, module `bvh`; layouts are compared when a shader loads).
// A node whose entry points reach `intersect` has the ports `bvh_nodes` and `bvh_triangles`. Cost: some tens of nodes a ray.

#import common::scene::SceneInfo

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

@group(1) @binding(auto) var<storage, read> bvh_nodes: array<BvhNode>;
@group(1) @binding(auto) var<storage, read> bvh_triangles: array<BvhTriangle>;

// Depth that a traversal's stack must hold; the host refuses deeper hierarchies.
const BVH_STACK: u32 = 48u;

// Rays start and end so far away from surfaces, in the scene's units: a share of its diagonal, which hides detail below that size from shadow rays;
// in a scene far from the origin eight units in the last place of its coordinates, which is what positions on surfaces are known to.
fn ray_offset(info: SceneInfo) -> f32 {
    let farthest = max(abs(info.bounds_min), abs(info.bounds_max));
    return max(2e-5 * info.diagonal, exp2(-20.0) * max(farthest.x, max(farthest.y, farthest.z)));
}

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

// Rounding may put a ray beside both triangles of an edge that they share: each is larger by this share of itself, so that no ray slips through.
const EDGE_SLACK: f32 = 1e-6;

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
    let inside = min(min(u, v), 1.0 - u - v) >= -EDGE_SLACK;
    let hit = determinant != 0.0 && inside && t > nearest && t < limit;
    return TriangleHit(select(MISSED, t, hit), u, v);
}

struct Hit {
    t: f32, // MISSED if nothing was hit
    triangle: u32, // in `bvh_triangles`
    u: f32,
    v: f32,
}

// Nearest hit before `limit`; with `any`, whichever comes first.
fn intersect(ray: Ray, limit: f32, any_hit: bool) -> Hit {
    var best = Hit(limit, 0u, 0.0, 0.0);
    var found = false;
    var stack: array<u32, BVH_STACK>;
    var height = 0u;
    var index = 0u;
    // A scene without triangles has an empty root, with no children.
    if bvh_nodes[0].count == 0u && bvh_nodes[0].first == 0u {
        return Hit(MISSED, 0u, 0.0, 0.0);
    }
    loop {
        let node = bvh_nodes[index];
        if node.count > 0u {
            for (var i = node.first; i < node.first + node.count; i++) {
                let hit = hit_triangle(ray, bvh_triangles[i], 0.0, best.t);
                if hit.t < MISSED {
                    best = Hit(hit.t, i, hit.u, hit.v);
                    found = true;
                    if any_hit {
                        return best;
                    }
                }
            }
        } else {
            let left = bvh_nodes[node.first];
            let right = bvh_nodes[node.first + 1u];
            let l = enter_box(ray, left.low, left.high, best.t);
            let r = enter_box(ray, right.low, right.high, best.t);
            if l < MISSED && r < MISSED {
                // The nearer child first; the other waits.
                stack[height] = select(node.first, node.first + 1u, l <= r);
                height += 1u;
                index = select(node.first + 1u, node.first, l <= r);
                continue;
            }
            if l < MISSED || r < MISSED {
                index = select(node.first + 1u, node.first, l < MISSED);
                continue;
            }
        }
        if height == 0u {
            break;
        }
        height -= 1u;
        index = stack[height];
    }
    best.t = select(MISSED, best.t, found);
    return best;
}

// Whether nothing lies between two points that are off their surfaces already.
fn visible(p: vec3f, q: vec3f) -> bool {
    return intersect(make_ray(p, q - p), 1.0, true).t >= MISSED;
}
