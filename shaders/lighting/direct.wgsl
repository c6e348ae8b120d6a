// Direct light of all lights. [ACRSM] 5.3.4; BRDF: Lambert + normalised Blinn.
// Differs from the paper: a tap beyond the border of a light's view reads the border, as views lie beside each other in the map.
// What bounds it: pcf² reads of the map per pixel and light that is not behind the surface.

#import common::scene::{View, Light}
#import common::view::pixel_direction
#import common::rsm::{
    Place, scene_light_views, view_count, views_of_light, view_towards, position_in_map, distance_in_view, ray_at, cell_side, cell_of_view,
}
#import common::octahedral::unpack_unit
#import common::radiometry::{light_at, luminance, max_component, lambert_blinn}
#import common::shadow::plane_reciprocal

struct Params {
    pcf: u32,
    direct_bias: f32,
}

@group(0) @binding(0) var<uniform> scene_camera: View;
@group(0) @binding(1) var<storage, read> scene_lights: array<Light>;
@group(0) @binding(2) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(3) var gbuffer_specular: texture_2d<f32>;
@group(0) @binding(4) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(5) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(6) var rsm_distance: texture_2d<f32>;
@group(0) @binding(7) var<uniform> params: Params;
@group(0) @binding(8) var direct: texture_storage_2d<rgba32float, write>;

override specular: bool;
override direct_shadows: bool;

// Share of pcf × pcf texels around the receiver, in its cell, that see it.
fn shadow(index: u32, position: vec3f, normal: vec3f) -> f32 {
    let size = textureDimensions(rsm_distance);
    let seen = position_in_map(index, position, size);
    if seen.z <= 0.0 {
        return 0.0;
    }
    let own = max(distance_in_view(index, position), 1e-30);
    let side = cell_side(size);
    let first = cell_of_view(index) * side;
    let middle = vec2i(floor(seen.xy)) - vec2i(first);
    let low = -i32(params.pcf - 1u) / 2;
    var lit = 0.0;
    for (var y = 0u; y < params.pcf; y++) {
        for (var x = 0u; x < params.pcf; x++) {
            let pixel = vec2u(clamp(middle + vec2i(low) + vec2i(i32(x), i32(y)), vec2i(0), vec2i(i32(side) - 1)));
            let stored = textureLoad(rsm_distance, first + pixel, 0).x;
            let ray = ray_at(Place(index, side, pixel));
            let reciprocal = plane_reciprocal(dot(normal, ray.direction), dot(normal, position - ray.origin), own);
            lit += select(0.0, 1.0, stored <= 0.0 || stored * reciprocal >= 1.0 - params.direct_bias);
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
    var arriving = 0.0;
    var unshadowed = 0.0;
    if distance > 0.0 {
        let direction = pixel_direction(scene_camera, id.xy, size);
        let position = scene_camera.origin + distance * direction;
        let normal = unpack_unit(textureLoad(gbuffer_normal, id.xy, 0).x);
        var lobe = vec4f(0.0);
        if specular {
            lobe = textureLoad(gbuffer_specular, id.xy, 0);
        }
        let albedo = textureLoad(gbuffer_albedo, id.xy, 0).rgb;
        for (var index = 0u; index < view_count(); index += views_of_light(index)) {
            let arrival = light_at(scene_lights[scene_light_views[index].light], position);
            let cosine = dot(normal, arrival.to_light);
            if cosine <= 0.0 || max_component(arrival.irradiance) <= 0.0 {
                continue;
            }
            var visible = 1.0;
            if direct_shadows {
                visible = shadow(view_towards(index, position), position, normal);
            }
            let brdf = lambert_blinn(albedo, lobe.rgb, lobe.a, normal, arrival.to_light, -direction);
            radiance += brdf * arrival.irradiance * (cosine * visible); // methods: radiometry
            let irradiance = luminance(arrival.irradiance) * cosine;
            arriving += irradiance * visible;
            unshadowed += irradiance;
        }
    }
    let visible = select(0.0, arriving / unshadowed, unshadowed > 0.0);
    textureStore(direct, id.xy, vec4f(radiance, visible));
}
