// Direct light. [ACRSM] 5.3.4; BRDF: Lambert + normalised Blinn.

#import common::scene::{View, Light}
#import common::view::{pixel_direction, view_uv}
#import common::octahedral::unpack_unit
#import common::radiometry::{spot_falloff, max_component, lambert_blinn}
#import common::shadow::plane_reciprocal

struct Params {
    pcf: u32,
    direct_bias: f32,
}

@group(0) @binding(0) var<uniform> scene_camera: View;
@group(0) @binding(1) var<uniform> scene_light: Light;
@group(0) @binding(2) var<uniform> scene_light_view: View;
@group(0) @binding(3) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(4) var gbuffer_specular: texture_2d<f32>;
@group(0) @binding(5) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(6) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(7) var rsm_distance: texture_2d<f32>;
@group(0) @binding(8) var<uniform> params: Params;
@group(0) @binding(9) var direct: texture_storage_2d<rgba32float, write>;

// Share of pcf × pcf texels around the receiver that see it. Texels outside the cone are unlit anyway and count as visible.
fn shadow(position: vec3f, normal: vec3f) -> f32 {
    let size = textureDimensions(rsm_distance);
    let seen = view_uv(scene_light_view, position);
    if seen.z <= 0.0 {
        return 0.0;
    }
    let own = max(distance(position, scene_light_view.origin), 1e-30);
    let height = dot(normal, position - scene_light_view.origin);
    let middle = vec2i(floor(seen.xy * vec2f(size)));
    let low = -i32(params.pcf - 1u) / 2;
    var lit = 0.0;
    for (var y = 0u; y < params.pcf; y++) {
        for (var x = 0u; x < params.pcf; x++) {
            let texel = middle + vec2i(low) + vec2i(i32(x), i32(y));
            if any(texel < vec2i(0)) || any(texel >= vec2i(size)) {
                lit += 1.0;
                continue;
            }
            let stored = textureLoad(rsm_distance, texel, 0).x;
            let cosine = dot(normal, pixel_direction(scene_light_view, vec2u(texel), size));
            lit += select(0.0, 1.0, stored <= 0.0 || stored * plane_reciprocal(cosine, height, own) >= 1.0 - params.direct_bias);
        }
    }
    return lit / f32(params.pcf * params.pcf);
}

@compute @workgroup_size(8, 8)
fn light(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(direct);
    if any(id.xy >= size) {
        return;
    }
    let distance = textureLoad(gbuffer_distance, id.xy, 0).x;
    var radiance = vec3f(0.0);
    var visible = 0.0;
    if distance > 0.0 {
        let direction = pixel_direction(scene_camera, id.xy, size);
        let position = scene_camera.origin + distance * direction;
        let normal = unpack_unit(textureLoad(gbuffer_normal, id.xy, 0).x);
        let to_light = scene_light.position - position;
        let d2 = max(dot(to_light, to_light), 1e-30);
        let l = to_light * inverseSqrt(d2);
        let cosine = dot(normal, l);
        let intensity = scene_light.strength * spot_falloff(scene_light, -l);
        if cosine > 0.0 && max_component(intensity) > 0.0 {
            visible = shadow(position, normal);
            let specular = textureLoad(gbuffer_specular, id.xy, 0);
            let albedo = textureLoad(gbuffer_albedo, id.xy, 0).rgb;
            let brdf = lambert_blinn(albedo, specular.rgb, specular.a, normal, l, -direction);
            radiance = brdf * intensity * (cosine / d2 * visible); // methods: radiometry
        }
    }
    textureStore(direct, id.xy, vec4f(radiance, visible));
}
