// Virtual lights from a Halton sequence on the unit sphere around the light. [SOI] 3.1, [HALTON].
// Points are uniform in solid angle: a light stands for Ω / N, and its flux is ρ I(θ) Ω / N (methods: radiometry), read as Φ_j / ω_j of its texel.
// One workgroup tests the sequence, 256 points at a time, until N are inside of the cone: their order, and so which are first, needs no counting
// across workgroups. It stops at LAST_POINT (1024 rounds of some 25: below the 65,535 rounds that software adapters allow).
// Differs from the paper: a cone with fewer than N of these points gets all its directions by mapping the sequence into it, which is as uniform.

#import common::cluster::{Cluster, CLUSTER_ACTIVE, texel_area}
#import common::scene::{Light, View}
#import common::view::{pixel_direction, view_uv}
#import common::octahedral::unpack_unit
#import common::radiometry::{PI, max_component}
#import common::random::halton_23
#import common::tiles::light_of_point

struct Params {
    tiles: u32,
}

@group(0) @binding(0) var<uniform> scene_light: Light;
@group(0) @binding(1) var<uniform> scene_light_view: View;
@group(0) @binding(2) var rsm_flux: texture_2d<f32>;
@group(0) @binding(3) var rsm_normal: texture_2d<u32>;
@group(0) @binding(4) var rsm_distance: texture_2d<f32>;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var<storage, read_write> clusters: array<Cluster>;

override directions_is_sphere: bool;

const LANES: u32 = 256u;
const WORDS: u32 = 8u;
const LAST_POINT: u32 = 262144u;
// Share of the points up to the last that is taken to fall into a cone of that share of the sphere: the sequence is even to far less than the rest.
const CERTAIN: f32 = 0.9;

// Where the lights may be: directions around an axis.
struct Cone {
    axis: vec3f,
    height: f32, // 1 − cosine of the half-angle: share of the sphere times 2
}

fn light_cone() -> Cone {
    let s = sin(0.5 * scene_light.cutoff_rad);
    return Cone(scene_light.direction, 2.0 * s * s);
}

// Point of the cylinder around the sphere, of equal area: height in [−1, 1] and angle in [0, 1).
fn on_sphere(height: f32, angle: f32) -> vec3f {
    let radius = sqrt(max(1.0 - height * height, 0.0));
    let phi = 2.0 * PI * angle;
    return vec3f(sin(phi) * radius, cos(phi) * radius, height);
}

// [SOI] 3.1: φ = 2π Φ₂(i), sin δ = 2 Φ₃(i) − 1.
fn sphere_direction(index: u32) -> vec3f {
    let point = halton_23(index);
    return on_sphere(2.0 * point.y - 1.0, point.x);
}

fn cone_direction(cone: Cone, index: u32) -> vec3f {
    let point = halton_23(index);
    let local = on_sphere(1.0 - point.y * cone.height, point.x);
    let other = select(vec3f(1.0, 0.0, 0.0), vec3f(0.0, 1.0, 0.0), abs(cone.axis.x) > 0.5);
    let x = normalize(cross(other, cone.axis));
    return x * local.x + cross(cone.axis, x) * local.y + cone.axis * local.z;
}

fn inside(cone: Cone, direction: vec3f) -> bool {
    // |d − a|² / 2 = 1 − cos: keeps its precision at small angles.
    let offset = direction - cone.axis;
    return 0.5 * dot(offset, offset) <= cone.height;
}

// Whether the sphere's points are enough for `count` lights.
fn rejects(cone: Cone, count: u32) -> bool {
    return directions_is_sphere && f32(count) <= 0.5 * cone.height * CERTAIN * f32(LAST_POINT);
}

var<workgroup> accepted: array<atomic<u32>, WORDS>; // a bit a lane
var<workgroup> found: u32;

@compute @workgroup_size(256)
fn choose(@builtin(local_invocation_index) lane: u32) {
    let count = arrayLength(&clusters);
    let cone = light_cone();
    if !rejects(cone, count) {
        for (var i = lane; i < count; i += LANES) {
            clusters[light_of_point(i, count, params.tiles)].generation = i + 1u; // point 0 is a pole
        }
        return;
    }
    for (var first = 1u; first < LAST_POINT; first += LANES) {
        let before = workgroupUniformLoad(&found);
        if before >= count {
            break;
        }
        if lane < WORDS {
            atomicStore(&accepted[lane], 0u);
        }
        workgroupBarrier();
        let index = first + lane;
        let is_inside = inside(cone, sphere_direction(index));
        if is_inside {
            atomicOr(&accepted[lane / 32u], 1u << (lane % 32u));
        }
        workgroupBarrier();
        var total = 0u;
        var rank = before;
        for (var word = 0u; word < WORDS; word++) {
            let bits = atomicLoad(&accepted[word]);
            total += countOneBits(bits);
            // Words below the lane's own count whole, its own below its bit.
            let lower = select(0u, bits, word < lane / 32u) | select(0u, bits & ((1u << (lane % 32u)) - 1u), word == lane / 32u);
            rank += countOneBits(lower);
        }
        if is_inside && rank < count {
            clusters[light_of_point(rank, count, params.tiles)].generation = index;
        }
        if lane == 0u {
            found = before + total;
        }
    }
}

@compute @workgroup_size(64)
fn place(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    let count = arrayLength(&clusters);
    if c >= count {
        return;
    }
    let cone = light_cone();
    var light = Cluster();
    light.generation = clusters[c].generation;
    var direction: vec3f;
    if rejects(cone, count) {
        direction = sphere_direction(light.generation);
    } else {
        direction = cone_direction(cone, light.generation);
    }
    let size = textureDimensions(rsm_flux);
    let at = view_uv(scene_light_view, scene_light_view.origin + direction).xy * vec2f(size);
    // At the rim of the cone the projection may round to the texel beyond the map.
    let texel = min(vec2u(max(at, vec2f(0.0))), size - 1u);
    light.texel = at;
    let flux = textureLoad(rsm_flux, texel, 0);
    if max_component(flux.rgb) > 0.0 {
        let ray = pixel_direction(scene_light_view, texel, size);
        let d = textureLoad(rsm_distance, texel, 0).x;
        // Solid angle that the light stands for, and how many texels that are.
        let solid_angle = 2.0 * PI * cone.height / f32(count);
        let texels = solid_angle / flux.a;
        light.state = CLUSTER_ACTIVE;
        light.position = scene_light_view.origin + ray * d;
        light.normal = unpack_unit(textureLoad(rsm_normal, texel, 0).x);
        light.importance = 1.0;
        light.flux = flux.rgb * texels;
        light.area = texel_area(solid_angle, d, -dot(light.normal, ray));
        light.count = max(u32(round(texels)), 1u);
    }
    clusters[c] = light;
}
