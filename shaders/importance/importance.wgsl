// Importance map. [ACRSM] 4.5 and 5.1.1.
// Differs from the paper: the light's colour and the exponent are divided by their largest values, so that the result stays in [0, 1];
// the sampled positions also cut off what lies behind the lit surface (it cannot receive its light).
// Several lights: each is compared with its own brightest colour, then all of it weighted by what a texel of the light's view can reflect.

#import common::scene::{Light, View, Seed}
#import common::rsm::{scene_light_views, view_of_texel, texel_ray}
#import common::view::pixel_direction
#import common::octahedral::unpack_unit
#import common::radiometry::{falloff, max_component}
#import common::random::{halton_23, hash}

struct Params {
    diffuse_weight: f32,
    view_weight: f32,
    view_samples: u32,
    shininess_scale: f32,
}

@group(0) @binding(0) var<storage, read> scene_lights: array<Light>;
@group(0) @binding(1) var<uniform> scene_camera: View;
@group(0) @binding(2) var<uniform> seed: Seed;
@group(0) @binding(3) var<uniform> params: Params;
@group(0) @binding(4) var<storage, read> lit_texels: array<u32>;
@group(0) @binding(5) var rsm_albedo: texture_2d<f32>;
@group(0) @binding(6) var rsm_specular: texture_2d<f32>;
@group(0) @binding(7) var rsm_normal: texture_2d<u32>;
@group(0) @binding(8) var rsm_distance: texture_2d<f32>;
@group(0) @binding(9) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(10) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(11) var importance_map: texture_storage_2d<r32float, write>;
@group(0) @binding(12) var<storage, read> lit_texel_groups: array<vec4u>;

override specular: bool;
override view_importance: bool;

const MAX_SAMPLES: u32 = 256u;
const LANES: u32 = 256u;

// The sampled positions of the picture, gathered once a group; normal zero where the sample met no surface.
var<workgroup> sample_position: array<vec3f, MAX_SAMPLES>;
var<workgroup> sample_normal: array<vec3f, MAX_SAMPLES>;

// The samples are the same for all texels and frames: a map that changes at random would make the clusters flicker.
fn gather_samples(lane: u32) {
    let size = textureDimensions(gbuffer_distance);
    for (var i = lane; i < params.view_samples; i += LANES) {
        let uv = halton_23(i + 1u + hash(seed.value) % 1024u);
        let pixel = min(vec2u(uv * vec2f(size)), size - 1u);
        let distance = textureLoad(gbuffer_distance, pixel, 0).x;
        sample_position[i] = scene_camera.origin + distance * pixel_direction(scene_camera, pixel, size);
        sample_normal[i] = unpack_unit(textureLoad(gbuffer_normal, pixel, 0).x);
    }
}

// Mean cosine at the sampled positions towards a lit point. [ACRSM] eq. 4.2
fn seen_importance(lit: vec3f, lit_normal: vec3f) -> f32 {
    var sum = 0.0;
    for (var i = 0u; i < params.view_samples; i++) {
        let to_lit = lit - sample_position[i];
        if dot(to_lit, lit_normal) < 0.0 {
            sum += max(dot(sample_normal[i], to_lit) * inverseSqrt(max(dot(to_lit, to_lit), 1e-30)), 0.0);
        }
    }
    return sum / f32(params.view_samples);
}

// The map may be padded to a power of two.
@compute @workgroup_size(8, 8)
fn clear(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(importance_map)) {
        textureStore(importance_map, id.xy, vec4f(0.0));
    }
}

@compute @workgroup_size(LANES)
fn estimate(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    var view_weight = 0.0;
    if view_importance {
        view_weight = params.view_weight;
    }
    if view_weight > 0.0 {
        gather_samples(lane);
    }
    workgroupBarrier();
    let place = LANES * (group.x + group.y * groups.x) + lane;
    if place >= lit_texel_groups[0].w {
        return;
    }
    let texel = vec2u(lit_texels[place] & 0xffffu, lit_texels[place] >> 16u);
    let rsm_size = textureDimensions(rsm_albedo);
    let view = scene_light_views[view_of_texel(texel, rsm_size)];
    let source = scene_lights[view.light];
    let ray = texel_ray(texel, rsm_size);
    let light = source.strength / max(max_component(source.strength), 1e-30) * saturate(falloff(source, ray.direction));
    var lobe = vec4f(0.0);
    if specular {
        lobe = textureLoad(rsm_specular, texel, 0);
    }
    let f_d = max_component(textureLoad(rsm_albedo, texel, 0).rgb * light); // [ACRSM] eq. 5.1
    let f_s = max_component(lobe.rgb * light) * saturate(lobe.a / params.shininess_scale); // [ACRSM] eq. 5.2
    let brdf = f_d * params.diffuse_weight + f_s * (1.0 - params.diffuse_weight); // [ACRSM] eq. 4.1
    var importance = (1.0 - view_weight) * brdf;
    if view_weight > 0.0 {
        let lit = ray.origin + ray.direction * textureLoad(rsm_distance, texel, 0).x;
        importance += view_weight * seen_importance(lit, unpack_unit(textureLoad(rsm_normal, texel, 0).x)); // [ACRSM] eq. 4.3
    }
    // Lights share the virtual lights by what their texels can reflect.
    importance *= view.weight;
    // A lit texel is never worth nothing: warping must be able to reach it.
    importance = max(importance, 1e-6);
    textureStore(importance_map, texel, vec4f(importance, 0.0, 0.0, 0.0));
}
