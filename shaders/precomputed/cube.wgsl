// Precomputed indirect light, looked up in the direction of each pixel. [PCA] 3.1: the second of the three ways of look-up.
// Differs from the paper: as precomputed/image; and each face reaches a little beyond a right angle instead of being filtered across its edges.
// What bounds it: as in precomputed/image.

#import common::baked::{baked_light, seen_light}
#import common::scene::View
#import common::view::pixel_direction

struct Params {
    sky: u32,
    tolerance: f32,
}

@group(0) @binding(0) var<uniform> scene_camera: View;
@group(0) @binding(1) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var indirect: texture_storage_2d<rgba32float, write>;

// Texels on each side of a face that lie beyond a right angle: look-ups and their neighbours stay on it. The same as in the crate manylight-lab.
const BORDER: f32 = 1.5;

// Where a direction meets the cube, in texels from the middle of the first. Faces +x, −x, +y in the first row, −y, +z, −z in the second; up is y, on
// ±y it is z.
fn place_of(direction: vec3f) -> vec2f {
    let extent = abs(direction);
    let axis = select(select(2u, 1u, extent.y >= extent.z), 0u, extent.x >= extent.y && extent.x >= extent.z);
    let is_negative = direction[axis] < 0.0;
    var forward = vec3f(0.0);
    forward[axis] = select(1.0, -1.0, is_negative);
    let up = select(vec3f(0.0, 1.0, 0.0), vec3f(0.0, 0.0, 1.0), axis == 1u);
    let side = 0.5 * f32(textureDimensions(baked_light).y);
    let on_face = vec2f(dot(direction, cross(forward, up)), -dot(direction, up)) / extent[axis];
    let face = 2u * axis + select(0u, 1u, is_negative);
    return vec2f(f32(face % 3u), f32(face / 3u)) * side + 0.5 * side + on_face * (0.5 * side - BORDER) - 0.5;
}

@compute @workgroup_size(8, 8)
fn look_up(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(indirect);
    if any(id.xy >= size) {
        return;
    }
    let distance = textureLoad(gbuffer_distance, id.xy, 0).x;
    let place = place_of(pixel_direction(scene_camera, id.xy, size));
    textureStore(indirect, id.xy, seen_light(place, distance, params.tolerance, params.sky != 0u));
}
