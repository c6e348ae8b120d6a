// Imperfect shadow maps: every point goes into s_f of the k maps. [ACRSM] 5.3.2, [VAL] 5, [ISM].
// The depth test is an atomic minimum on the bits of positive floats: the same for any order of the points.
// Differs from the papers: surfels. A square at the point's own distance lies in front of the surface around the point and shadows it; a disk in the
// point's tangent plane does not. Splats have the size that their point's area asks for (area of a point × maps over splat factor).
// What bounds it: texels covered, about 20 per point at the defaults, half of the points being behind the light's plane.

#import common::points::{ScenePoint, WORLD_SPACE}
#import common::scene::{Object, SceneInfo, Seed}
#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::paraboloid::{basis, paraboloid_project, paraboloid_unproject, paraboloid_scale, atlas_origin}
#import common::dispatch::linear_index
#import common::radiometry::PI
#import common::random::{hash3, unit_float}

struct Params {
    ism_size: u32,
    atlas_width: u32,
    splat_factor: f32,
    splat_scale: f32,
    splat_limit: u32,
}

@group(0) @binding(0) var<storage, read> points: array<ScenePoint>;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<storage, read> scene_objects: array<Object>;
@group(0) @binding(3) var<uniform> scene_info: SceneInfo;
@group(0) @binding(4) var<uniform> seed: Seed;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var<storage, read_write> ism_splats: array<atomic<u32>>;

override splat_is_surfel: bool;
override scatter_is_hash: bool;

// Bits of 1.0, the far distance.
const NOTHING: u32 = 0x3f800000u;
// A ray that meets the tangent plane at a smaller cosine than this misses the disk: it would only graze it.
const MIN_COSINE: f32 = 1e-3;

@compute @workgroup_size(256)
fn clear(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear_index(id, groups, 256u);
    if i < arrayLength(&ism_splats) {
        atomicStore(&ism_splats[i], NOTHING);
    }
}

fn store(origin: vec2u, texel: vec2i, depth: f32) {
    let size = i32(params.ism_size);
    if depth > 0.0 && depth < 1.0 && all(texel >= vec2i(0)) && all(texel < vec2i(size)) {
        let p = origin + vec2u(texel);
        atomicMin(&ism_splats[p.y * params.atlas_width + p.x], bitcast<u32>(depth));
    }
}

fn splat(map: u32, position: vec3f, normal: vec3f, radius: f32) {
    let light = clusters[map];
    if light.state != CLUSTER_ACTIVE || light.count == 0u {
        return;
    }
    let v = position - light.position;
    let d = length(v);
    // The light lies within the point's own disk, or the disk wholly behind the light's plane.
    if d <= radius || dot(v, light.normal) <= -radius {
        return;
    }
    let frame_of_light = basis(light.normal);
    let local = v * frame_of_light / d; // transpose × vector: into the light's frame
    if local.z < -0.7 {
        return;
    }
    let disk = paraboloid_project(local);
    let size = f32(params.ism_size);
    let centre = (0.5 + 0.5 * disk) * size;
    let far = scene_info.diagonal;
    let origin = atlas_origin(map, params.ism_size, params.atlas_width / params.ism_size);
    // Half a map is the unit disk.
    let reach = min(paraboloid_scale(disk) * (radius / d) * 0.5 * size, f32(params.splat_limit));
    let middle = vec2i(floor(centre));
    if !splat_is_surfel {
        // [ACRSM] 5.3.2: a square at the point's distance, smaller when farther.
        let half = max(reach, 0.5);
        let low = vec2i(floor(centre - half + 0.5));
        let high = vec2i(floor(centre + half - 0.5));
        for (var y = low.y; y <= max(high.y, low.y); y++) {
            for (var x = low.x; x <= max(high.x, low.x); x++) {
                store(origin, vec2i(x, y), d / far);
            }
        }
        return;
    }
    let local_normal = normal * frame_of_light;
    let plane = dot(local_normal, local) * d; // distance of the tangent plane, signed
    // The disk may be thinner than a texel: the texel of its centre always counts, if the light sees it at all.
    if local.z > 0.0 {
        store(origin, middle, d / far);
    }
    let low = max(vec2i(floor(centre - reach)), vec2i(0));
    let high = min(vec2i(floor(centre + reach)), vec2i(i32(params.ism_size) - 1));
    for (var y = low.y; y <= high.y; y++) {
        for (var x = low.x; x <= high.x; x++) {
            let ray = paraboloid_unproject((vec2f(vec2i(x, y)) + 0.5) * (2.0 / size) - 1.0);
            let cosine = dot(local_normal, ray);
            if abs(cosine) < MIN_COSINE {
                continue;
            }
            let t = plane / cosine;
            let offset = ray * t - local * d;
            if t > 0.0 && dot(offset, offset) <= radius * radius {
                store(origin, vec2i(x, y), t / far);
            }
        }
    }
}

@compute @workgroup_size(64)
fn splat_points(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear_index(id, groups, 64u);
    if i >= arrayLength(&points) {
        return;
    }
    let point = points[i];
    if point.area <= 0.0 || params.splat_factor <= 0.0 {
        return;
    }
    var position = point.position;
    var normal = point.normal;
    if point.object != WORLD_SPACE {
        let object = scene_objects[point.object];
        position = (object.world_from_object * vec4f(position, 1.0)).xyz;
        normal = (object.normal_from_object * vec4f(normal, 0.0)).xyz;
    }
    normal *= inverseSqrt(max(dot(normal, normal), 1e-37));

    // A map gets splat_factor / k of all points: each of them stands for so much more area.
    let maps = arrayLength(&clusters);
    let share = min(params.splat_factor / f32(maps), 1.0);
    let radius = params.splat_scale * sqrt(point.area / (share * PI));
    var first = i % maps;
    if scatter_is_hash {
        // [ACRSM] 5.3.2, for generated points: primes mix a point's coordinates.
        let unit = fract(abs(position) / max(scene_info.diagonal, 1e-30) * 97.0);
        first = (i + u32(unit.x * 7.0 * 64.0) + u32(unit.y * 89.0 * 64.0) + u32(unit.z * 991.0 * 64.0)) % maps;
    }
    var copies = u32(params.splat_factor);
    if unit_float(hash3(i, seed.value, 77u)) < fract(params.splat_factor) {
        copies += 1u;
    }
    copies = min(copies, maps);
    for (var s = 0u; s < copies; s++) {
        splat((first + s) % maps, position, normal, radius);
    }
}
