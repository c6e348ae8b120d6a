// Split G-buffer for interleaved shading. [ACRSM] 5.1.4 and 5.3.3, [VAL] 6.

#import common::scene::View
#import common::view::pixel_direction
#import common::tiles::pixel_of_split

struct Params {
    tiles: u32,
}

@group(0) @binding(0) var<uniform> scene_camera: View;
@group(0) @binding(1) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(2) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(3) var<uniform> params: Params;
@group(0) @binding(4) var split_position: texture_storage_2d<rgba32float, write>;
@group(0) @binding(5) var split_normal: texture_storage_2d<r32uint, write>;

@compute @workgroup_size(8, 8)
fn split(@builtin(global_invocation_id) id: vec3u) {
    let split_size = textureDimensions(split_position);
    if any(id.xy >= split_size) {
        return;
    }
    let size = textureDimensions(gbuffer_distance);
    let pixel = pixel_of_split(id.xy, split_size / params.tiles, params.tiles);
    var position = vec4f(0.0);
    var normal = 0u;
    if all(pixel < size) {
        let distance = textureLoad(gbuffer_distance, pixel, 0).x;
        if distance > 0.0 {
            position = vec4f(scene_camera.origin + distance * pixel_direction(scene_camera, pixel, size), 1.0);
            normal = textureLoad(gbuffer_normal, pixel, 0).x;
        }
    }
    textureStore(split_position, id.xy, position);
    textureStore(split_normal, id.xy, vec4u(normal));
}
