// Direct light with exact shadows. BRDF: Lambert + normalised Blinn (methods: radiometry).
// What bounds it: a ray to each light.

#import common::scene::{View, Light, SceneInfo, LIGHT_DIRECTIONAL}
#import common::bvh::{MISSED, RAY_OFFSET, make_ray, intersect, visible}
#import common::view::pixel_direction
#import common::octahedral::unpack_unit
#import common::radiometry::{light_at, max_component, lambert_blinn}

@group(0) @binding(0) var<uniform> scene_camera: View;
@group(0) @binding(1) var<storage, read> scene_lights: array<Light>;
@group(0) @binding(2) var<uniform> scene_info: SceneInfo;
@group(0) @binding(3) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(4) var gbuffer_specular: texture_2d<f32>;
@group(0) @binding(5) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(6) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(7) var direct: texture_storage_2d<rgba32float, write>;

// The pixel's position comes from a distance in 32 bits: rays start this many ray offsets nearer to the camera, so that it is before its own surface.
const OFFSETS: f32 = 10.0;

fn sees_light(point: vec3f, light: Light) -> bool {
    if light.kind == LIGHT_DIRECTIONAL {
        return intersect(make_ray(point, -light.direction), MISSED, true).t >= MISSED;
    }
    return visible(point, light.position);
}

@compute @workgroup_size(8, 8)
fn light(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(direct);
    if any(id.xy >= size) {
        return;
    }
    let distance = textureLoad(gbuffer_distance, id.xy, 0).x;
    var radiance = vec3f(0.0);
    if distance > 0.0 {
        let direction = pixel_direction(scene_camera, id.xy, size);
        let position = scene_camera.origin + distance * direction;
        let normal = unpack_unit(textureLoad(gbuffer_normal, id.xy, 0).x);
        let specular = textureLoad(gbuffer_specular, id.xy, 0);
        let albedo = textureLoad(gbuffer_albedo, id.xy, 0).rgb;
        let start = position + (normal - direction) * (OFFSETS * RAY_OFFSET * scene_info.diagonal);
        for (var i = 0u; i < scene_info.light_count; i++) {
            let arrival = light_at(scene_lights[i], position);
            let cosine = dot(normal, arrival.to_light);
            if cosine > 0.0 && max_component(arrival.irradiance) > 0.0 && sees_light(start, scene_lights[i]) {
                let brdf = lambert_blinn(albedo, specular.rgb, specular.a, normal, arrival.to_light, -direction);
                radiance += brdf * arrival.irradiance * cosine;
            }
        }
    }
    textureStore(direct, id.xy, vec4f(radiance, select(0.0, 1.0, max_component(radiance) > 0.0)));
}
