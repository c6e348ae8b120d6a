// Precomputed indirect light, looked up where the camera sees a surface. [PCA] 3.1: the third of the three ways of look-up.
// Differs from the paper: texels hold what a white matt surface would reflect, and the albedo comes from the picture. Glossy reflection of indirect
// light depends on where the camera is, and is left out.
// What bounds it: a filtered read a layer.

#import common::scene::View
#import common::view::pixel_direction
#import common::sky::sky_radiance
#import common::baked::baked_light_at

struct Params {
    sky: u32,
}

@group(0) @binding(0) var<uniform> scene_camera: View;
@group(0) @binding(1) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(2) var coordinates: texture_2d<f32>;
@group(0) @binding(3) var<uniform> params: Params;
@group(0) @binding(4) var indirect: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn look_up(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(indirect);
    if any(id.xy >= size) {
        return;
    }
    let with_sky = params.sky != 0u;
    let albedo = textureLoad(gbuffer_albedo, id.xy, 0);
    let place = textureLoad(coordinates, id.xy, 0).xy;
    var light = vec4f(0.0);
    if albedo.a == 0.0 {
        light = vec4f(select(vec3f(0.0), sky_radiance(pixel_direction(scene_camera, id.xy, size)), with_sky), 1.0);
    } else if all(place > vec2f(0.0)) {
        light = vec4f(albedo.rgb * baked_light_at(place, with_sky), 1.0);
    }
    textureStore(indirect, id.xy, light);
}
