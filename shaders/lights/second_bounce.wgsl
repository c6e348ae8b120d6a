// Virtual lights of the second bounce, as in instant radiosity [IR]: a light at the end of a path from a light over one surface to another.
// The first surface is a texel j of the map, drawn with probability p_j as in `clustering/sample`; the way from there is cosine-distributed, which is how
// a diffuse surface reflects. So a light has the flux ρ Φ_j / (N p_j), ρ being the albedo where the ray ends, and the sum of the lights is an unbiased
// estimate of what the scene reflects twice. What leaves the scene is lost, as it must be.
// Paths start at texels, not at the lights of the first bounce: these are few, and each is one point for all of the surface that it stands for.
// Area: N lights lie as dense as light arrives, so that one stands for what arrives by it over the irradiance of all, Φ / E; E is that of the first
// lights without shadows, and where it is too little to be true the area is bounded.
// What bounds it: a ray, and a round over the first lights; one invocation a light.

#import common::bvh::{MISSED, intersect, make_ray, ray_offset}
#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::dispatch::linear_index
#import common::octahedral::unpack_unit
#import common::path::{cosine_direction, surface_at}
#import common::radiometry::{disk_form_factor, luminance, max_component}
#import common::random::{halton_23, hash3, r2_point, unit_float}
#import common::rsm::texel_position
#import common::scene::{SceneInfo, Seed}
#import common::tiles::point_of_light
#import common::warp::warp_to_texel

struct Params {
    tiles: u32,
    warp_levels: u32,
}

@group(0) @binding(0) var<uniform> seed: Seed;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var importance: texture_2d<f32>;
@group(0) @binding(3) var rsm_flux: texture_2d<f32>;
@group(0) @binding(4) var rsm_normal: texture_2d<u32>;
@group(0) @binding(5) var rsm_distance: texture_2d<f32>;
@group(0) @binding(6) var<uniform> scene_info: SceneInfo;
@group(0) @binding(7) var<uniform> params: Params;
@group(0) @binding(8) var<storage, read_write> second_bounce: array<Cluster>;

// A light stands for no more than this many of equal parts of the scene's surface, one a light. Where less light arrives than that asks for, its disk is too
// small: nearer to a point, which is noise and no loss.
const MOST_PARTS: f32 = 4.0;

// Luminance of what arrives at a surface from all lights of the first bounce, W/m², without shadows.
fn irradiance_by_first(position: vec3f, normal: vec3f) -> f32 {
    var sum = 0.0;
    for (var c = 0u; c < arrayLength(&clusters); c++) {
        let cluster = clusters[c];
        if cluster.state != CLUSTER_ACTIVE || cluster.count == 0u {
            continue;
        }
        let v = position - cluster.position;
        let d2 = dot(v, v);
        let direction = v * inverseSqrt(max(d2, 1e-30));
        sum += luminance(cluster.flux) * disk_form_factor(-dot(normal, direction), dot(cluster.normal, direction), d2, cluster.area);
    }
    return sum;
}

// Light `i` of `count`.
fn second_light(i: u32, count: u32) -> Cluster {
    var light = Cluster();
    // Point 0 is the corner (0, 0): start at 1.
    let point = 1u + point_of_light(i, count, params.tiles);
    let warped = warp_to_texel(importance, halton_23(point), params.warp_levels);
    let size = textureDimensions(rsm_flux);
    // The pyramid may be larger than the map: padded to a power of two.
    let texel = min(warped.texel, size - 1u);
    let reflected = textureLoad(rsm_flux, texel, 0).rgb;
    if any(warped.texel >= size) || max_component(reflected) <= 0.0 {
        return light;
    }
    let carried = reflected / (f32(count) * warped.probability);
    let normal = unpack_unit(textureLoad(rsm_normal, texel, 0).x);
    let start = texel_position(texel, size, textureLoad(rsm_distance, texel, 0).x) + normal * ray_offset(scene_info);
    // A sequence of its own, which no texel is tied to.
    let turn = vec2f(unit_float(hash3(seed.value, 1u, 0u)), unit_float(hash3(seed.value, 2u, 0u)));
    let ray = make_ray(start, cosine_direction(normal, fract(r2_point(point) + turn)));
    let hit = intersect(ray, MISSED, false);
    if hit.t >= MISSED {
        return light;
    }
    let surface = surface_at(ray, hit);
    let flux = surface.albedo * carried;
    if max_component(flux) <= 0.0 {
        return light;
    }
    let largest = MOST_PARTS * scene_info.total_area / f32(count);
    light.state = CLUSTER_ACTIVE;
    light.count = 1u;
    light.position = surface.position;
    light.normal = surface.normal;
    light.flux = flux;
    light.area = min(luminance(carried) / max(irradiance_by_first(surface.position, surface.normal), 1e-30), largest);
    light.texel = vec2f(texel) + 0.5;
    light.importance = textureLoad(importance, texel, 0).x;
    return light;
}

@compute @workgroup_size(64)
fn place(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear_index(id, groups, 64u);
    let count = arrayLength(&second_bounce);
    if i < count {
        second_bounce[i] = second_light(i, count);
    }
}
