// Virtual lights as samples of the reflective shadow map: points of a Halton sequence, warped by importance. Φ = Φ_j / (N p_j), p_j being the
// probability of the texel (methods: radiometry). A sample that meets nothing lit is idle and counts in N. No lit texel is lost: none has an importance
// of zero, and where fewer levels are warped texels of a cell are equally likely. Each point is a light: the same texel may be drawn twice.
// Source: [ACRSM] 4.4, 4.5 for seeds and warping; [RSM] for texels as lights.

#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::scene::Frame
#import common::rsm::{texel_ray, texel_area}
#import common::octahedral::unpack_unit
#import common::radiometry::max_component
#import common::random::{halton_23, hash3, unit_float}
#import common::tiles::point_of_light
#import common::warp::warp_to_texel

struct Params {
    tiles: u32,
    warp_levels: u32,
    jitter: u32,
}

@group(0) @binding(0) var<uniform> turn: Frame;
@group(0) @binding(1) var importance: texture_2d<f32>;
@group(0) @binding(2) var rsm_flux: texture_2d<f32>;
@group(0) @binding(3) var rsm_normal: texture_2d<u32>;
@group(0) @binding(4) var rsm_distance: texture_2d<f32>;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var<storage, read_write> clusters: array<Cluster>;

// A point that is uniform over all frames, the same for all lights of one (Cranley and Patterson 1976).
fn rotation() -> vec2f {
    return vec2f(unit_float(hash3(turn.index, turn.seed, 1u)), unit_float(hash3(turn.index, turn.seed, 2u)));
}

@compute @workgroup_size(64)
fn sample(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    let count = arrayLength(&clusters);
    if c >= count {
        return;
    }
    // Point 0 is the corner (0, 0): start at 1.
    var point = halton_23(1u + point_of_light(c, count, params.tiles));
    if params.jitter != 0u {
        point = fract(point + rotation());
    }
    let warped = warp_to_texel(importance, point, params.warp_levels);
    let size = textureDimensions(rsm_flux);
    let texel = warped.texel;
    // The pyramid may be larger than the map: padded to a power of two.
    let flux = textureLoad(rsm_flux, min(texel, size - 1u), 0);
    var light = Cluster();
    if all(texel < size) && max_component(flux.rgb) > 0.0 {
        let ray = texel_ray(texel, size);
        let d = textureLoad(rsm_distance, texel, 0).x;
        // How many texels it stands for: 1 / (N p_j).
        let texels = 1.0 / (f32(count) * warped.probability);
        light.state = CLUSTER_ACTIVE;
        light.position = ray.origin + ray.direction * d;
        light.normal = unpack_unit(textureLoad(rsm_normal, texel, 0).x);
        light.texel = vec2f(texel) + 0.5;
        light.importance = textureLoad(importance, texel, 0).x;
        light.flux = flux.rgb * texels;
        light.area = texel_area(texel, size, d, -dot(light.normal, ray.direction)) * texels;
        light.count = max(u32(round(texels)), 1u);
    }
    clusters[c] = light;
}
