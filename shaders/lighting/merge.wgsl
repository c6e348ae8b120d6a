// Merging of the split light. [ACRSM] 5.3.3.

#import common::tiles::split_of_pixel

struct Params {
    tiles: u32,
}

@group(0) @binding(0) var split_light: texture_2d<f32>;
@group(0) @binding(1) var indirect_merged: texture_storage_2d<rgba32float, write>;
@group(0) @binding(2) var<uniform> params: Params;

@compute @workgroup_size(8, 8)
fn merge(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(indirect_merged)) {
        return;
    }
    let split = split_of_pixel(id.xy, textureDimensions(split_light) / params.tiles, params.tiles);
    textureStore(indirect_merged, id.xy, textureLoad(split_light, split, 0));
}
