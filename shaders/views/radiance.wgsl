// Debug view: one kind of light alone.

#import common::srgb::srgb_encode

struct Params {
    exposure: f32,
}

@group(0) @binding(0) var radiance: texture_2d<f32>;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var view: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8)
fn show(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(view)) {
        textureStore(view, id.xy, vec4f(srgb_encode(textureLoad(radiance, id.xy, 0).rgb * params.exposure), 1.0));
    }
}
