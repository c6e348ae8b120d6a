// Precomputed indirect light, pasted onto the picture. [PCA] 3.1: the first of the three ways of look-up.
// Differs from the paper: distances are baked as well. A pixel whose surface was not there (a dynamic object) gets no indirect light instead of that
// of what is behind it, and pictures of other sizes are interpolated between texels of their own surface only.
// What bounds it: a read a layer for each of four texels, at silhouettes of nine.

#import common::baked::{baked_light, seen_light}

struct Params {
    sky: u32,
    tolerance: f32,
}

@group(0) @binding(0) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var indirect: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn look_up(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(indirect);
    if any(id.xy >= size) {
        return;
    }
    let distance = textureLoad(gbuffer_distance, id.xy, 0).x;
    let place = (vec2f(id.xy) + 0.5) / vec2f(size) * vec2f(textureDimensions(baked_light)) - 0.5;
    textureStore(indirect, id.xy, seen_light(place, distance, params.tolerance, params.sky != 0u));
}
