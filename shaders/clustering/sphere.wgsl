// Virtual lights from a Halton sequence on the unit sphere around each light. [SOI] 3.1, [HALTON].
// Points are uniform in solid angle: one of a light's n stands for Ω / n, and its flux is ρ I(θ) Ω / n (methods: radiometry), read as Φ_j / ω_j of its
// texel. A point light has the whole sphere; of a directional light points are uniform over the disk that its rays pass. Lights share N by their power.
// A workgroup a light tests the sequence, 256 points at a time, until n are inside of the cone: their order, and so which are first, needs no counting
// across workgroups. It stops at LAST_POINT (1024 rounds of some 25: below the 65,535 rounds that software adapters allow).
// Differs from the paper: a cone with fewer than n of these points gets all its directions by mapping the sequence into it, which is as uniform.

#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::scene::{Light, LIGHT_DIRECTIONAL}
#import common::rsm::{scene_light_views, view_count, view_towards, position_in_map, cell_of_view, cell_side, texel_ray, texel_area}
#import common::octahedral::unpack_unit
#import common::radiometry::{PI, max_component}
#import common::random::halton_23
#import common::tiles::light_of_point

struct Params {
    tiles: u32,
}

@group(0) @binding(0) var<storage, read> scene_lights: array<Light>;
@group(0) @binding(1) var rsm_flux: texture_2d<f32>;
@group(0) @binding(2) var rsm_normal: texture_2d<u32>;
@group(0) @binding(3) var rsm_distance: texture_2d<f32>;
@group(0) @binding(4) var<uniform> params: Params;
@group(0) @binding(5) var<storage, read_write> clusters: array<Cluster>;

override directions_is_sphere: bool;

const LANES: u32 = 256u;
const WORDS: u32 = 8u;
const LAST_POINT: u32 = 262144u;
// Share of the points up to the last that is taken to fall into a cone of that share of the sphere: the sequence is even to far less than the rest.
const CERTAIN: f32 = 0.9;

// Texels by which lights stay within their cell.
const RIM: f32 = 1e-3;

// A light, and the run of virtual lights that are its own.
struct Source {
    light: u32,
    first: u32,
    count: u32,
}

// Virtual lights of all lights before `light`.
fn lights_before(light: u32) -> u32 {
    let all = arrayLength(&clusters);
    var share = 0.0;
    for (var i = 0u; i < light; i++) {
        share += scene_lights[i].share;
    }
    return select(min(u32(round(share * f32(all))), all), all, light == arrayLength(&scene_lights));
}

fn source_of_light(light: u32) -> Source {
    let first = lights_before(light);
    return Source(light, first, lights_before(light + 1u) - first);
}

// Which light virtual light `c` is of.
fn source_of(c: u32) -> Source {
    for (var light = 0u; light < arrayLength(&scene_lights); light++) {
        let source = source_of_light(light);
        if c < source.first + source.count {
            return source;
        }
    }
    return Source();
}

// First of a light's views.
fn view_of_light(light: u32) -> u32 {
    var index = 0u;
    while index + 1u < view_count() && scene_light_views[index].light != light {
        index++;
    }
    return index;
}

// Where rays of a light may go: directions around an axis.
struct Cone {
    axis: vec3f,
    height: f32, // 1 − cosine of the half-angle: share of the sphere times 2
}

fn light_cone(light: Light) -> Cone {
    let s = sin(0.5 * light.cutoff_rad); // point lights: half of π
    return Cone(light.direction, 2.0 * s * s);
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

// Whether `count` directions are the first of the sphere's points, and enough of these are tested.
fn rejects(light: Light, count: u32) -> bool {
    return directions_is_sphere && light.kind != LIGHT_DIRECTIONAL
        && f32(count) <= 0.5 * light_cone(light).height * CERTAIN * f32(LAST_POINT);
}

var<workgroup> accepted: array<atomic<u32>, WORDS>; // a bit a lane
var<workgroup> found: u32;

@compute @workgroup_size(256)
fn choose(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let view = group.x;
    // A group a light: its first view's.
    if view >= view_count() || scene_light_views[view].face != 0u {
        return;
    }
    let source = source_of_light(scene_light_views[view].light);
    let light = scene_lights[source.light];
    if !rejects(light, source.count) {
        for (var i = lane; i < source.count; i += LANES) {
            clusters[source.first + light_of_point(i, source.count, params.tiles)].generation = i + 1u; // point 0 is a pole
        }
        return;
    }
    let cone = light_cone(light);
    for (var first = 1u; first < LAST_POINT; first += LANES) {
        let before = workgroupUniformLoad(&found);
        if before >= source.count {
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
        if is_inside && rank < source.count {
            clusters[source.first + light_of_point(rank, source.count, params.tiles)].generation = index;
        }
        if lane == 0u {
            found = before + total;
        }
    }
}

// What a light's points are spread over, and a place that the ray of one of them passes.
struct Ray {
    extent: f32, // solid angle, sr; of directional lights area, m²
    through: vec3f,
}

fn ray_of(light: Light, view: u32, index: u32, count: u32) -> Ray {
    let camera = scene_light_views[view].view;
    if light.kind == LIGHT_DIRECTIONAL {
        // The disk around the scene, within the square that the view sees.
        let point = halton_23(index);
        let radius = camera.tan_half_x * sqrt(point.y);
        let phi = 2.0 * PI * point.x;
        return Ray(PI * camera.tan_half_x * camera.tan_half_x, camera.origin + radius * (sin(phi) * camera.right + cos(phi) * camera.up));
    }
    let cone = light_cone(light);
    var direction: vec3f;
    if rejects(light, count) {
        direction = sphere_direction(index);
    } else {
        direction = cone_direction(cone, index);
    }
    return Ray(2.0 * PI * cone.height, camera.origin + direction);
}

@compute @workgroup_size(64)
fn place(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= arrayLength(&clusters) {
        return;
    }
    let source = source_of(c);
    let first_view = view_of_light(source.light);
    var light = Cluster();
    light.generation = clusters[c].generation;
    let ray = ray_of(scene_lights[source.light], first_view, light.generation, source.count);
    let size = textureDimensions(rsm_flux);
    let view = view_towards(first_view, ray.through);
    let side = cell_side(size);
    let cell = cell_of_view(view) * side;
    // At the rim of a cell the projection may round to the texel beyond.
    light.texel = clamp(position_in_map(view, ray.through, size).xy, vec2f(cell), vec2f(cell + side) - RIM);
    let texel = min(vec2u(light.texel), cell + side - 1u);
    let flux = textureLoad(rsm_flux, texel, 0);
    if max_component(flux.rgb) > 0.0 {
        let seen = texel_ray(texel, size);
        let d = textureLoad(rsm_distance, texel, 0).x;
        // How many texels the light stands for.
        let texels = ray.extent / f32(source.count) / flux.a;
        light.state = CLUSTER_ACTIVE;
        light.position = seen.origin + seen.direction * d;
        light.normal = unpack_unit(textureLoad(rsm_normal, texel, 0).x);
        light.importance = 1.0;
        light.flux = flux.rgb * texels;
        light.area = texel_area(texel, size, d, -dot(light.normal, seen.direction)) * texels;
        light.count = max(u32(round(texels)), 1u);
    }
    clusters[c] = light;
}
