// All virtual lights in one buffer, and negative ones behind them: what virtual lights without shadows light through surfaces is taken away again. [SOI] 3.3.
// Points of a Halton sequence in the picture are surfaces p. What reaches p from behind, E = Σ Φ_c max(−n·t, 0) cosθ_c / (π d² + A_c), would have been
// stopped there, but lights what is in front of p. A light at p with flux −E A_p takes it away, A_p being the visible surface that p stands for: area
// of a pixel times pixels per sample. It shines along the mean way of that light, weighted by E.
// The paper leaves open how much a negative light takes away and whether its direction is towards or from the lights; this is what conserves energy.
// What bounds it: a negative light looks at all other lights (at most 8192 rounds), and has one invocation.

#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::dispatch::linear_index
#import common::octahedral::unpack_unit
#import common::radiometry::{disk_form_factor, luminance}
#import common::random::halton_23
#import common::rsm::MIN_COSINE
#import common::scene::{View, SceneInfo}
#import common::tiles::point_of_light
#import common::view::{pixel_direction, pixel_solid_angle}

struct Params {
    second_lights: u32,
    negative_strength: f32,
    vpl_clamp: f32,
    tiles: u32,
}

@group(0) @binding(0) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(1) var<uniform> scene_camera: View;
@group(0) @binding(2) var<uniform> scene_info: SceneInfo;
@group(0) @binding(3) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(4) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var<storage, read_write> virtual_lights: array<Cluster>;
@group(0) @binding(7) var<storage, read> second_bounce: array<Cluster>;

override lights_is_val: bool;

// Luminance, W/m², below which the direction of light is lost in rounding.
const LEAST_LIGHT: f32 = 1e-30;

fn positive_lights() -> u32 {
    return arrayLength(&clusters) + params.second_lights;
}

fn positive_light(i: u32) -> Cluster {
    let first = arrayLength(&clusters);
    if i < first {
        return clusters[i];
    }
    return second_bounce[i - first];
}

// Light that arrives at the back of a surface.
struct Behind {
    irradiance: vec3f, // W/m²
    way: vec3f, // sum of its directions, weighted by luminance
}

fn light_behind(position: vec3f, normal: vec3f) -> Behind {
    let least_distance = params.vpl_clamp * scene_info.diagonal;
    var sum = Behind(vec3f(0.0), vec3f(0.0));
    for (var c = 0u; c < positive_lights(); c++) {
        let cluster = positive_light(c);
        if cluster.state != CLUSTER_ACTIVE || cluster.count == 0u {
            continue;
        }
        let v = position - cluster.position;
        let d2 = dot(v, v);
        let direction = v * inverseSqrt(max(d2, 1e-30));
        let d2_kept = select(max(d2, least_distance * least_distance), d2, lights_is_val);
        let area = select(0.0, cluster.area, lights_is_val);
        let e = cluster.flux * disk_form_factor(dot(normal, direction), dot(cluster.normal, direction), d2_kept, area);
        sum.irradiance += e;
        sum.way += luminance(e) * direction;
    }
    return sum;
}

// Negative light `i` of `count`; idle where the picture shows nothing, or nothing is lit from behind.
fn negative_light(i: u32, count: u32) -> Cluster {
    var light = Cluster();
    let size = textureDimensions(gbuffer_distance);
    // Point 0 is the corner (0, 0): start at 1.
    let point = halton_23(1u + point_of_light(i, count, params.tiles));
    let pixel = min(vec2u(point * vec2f(size)), size - 1u);
    let distance = textureLoad(gbuffer_distance, pixel, 0).x;
    if distance <= 0.0 {
        return light;
    }
    let ray = pixel_direction(scene_camera, pixel, size);
    let position = scene_camera.origin + distance * ray;
    let normal = unpack_unit(textureLoad(gbuffer_normal, pixel, 0).x);
    let behind = light_behind(position, normal);
    let strength = luminance(behind.irradiance);
    if strength < LEAST_LIGHT {
        return light;
    }
    // What the pixels of a sample cover, across the ray and on the surface.
    let solid_angle = pixel_solid_angle(scene_camera, pixel, size) * f32(size.x * size.y) / f32(count);
    light.state = CLUSTER_ACTIVE;
    light.count = 1u;
    light.position = position;
    light.area = solid_angle * distance * distance / max(-dot(normal, ray), MIN_COSINE);
    light.normal = normalize(behind.way / strength); // no two ways are opposite: all come from behind
    light.flux = -params.negative_strength * light.area * behind.irradiance;
    return light;
}

@compute @workgroup_size(64)
fn append(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear_index(id, groups, 64u);
    let positive = positive_lights();
    let all = arrayLength(&virtual_lights);
    if i < positive {
        virtual_lights[i] = positive_light(i);
    } else if i < all {
        virtual_lights[i] = negative_light(i - positive, all - positive);
    }
}
