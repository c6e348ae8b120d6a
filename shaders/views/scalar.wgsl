// Debug view: one channel as grey.

struct Params {
    low: f32,
    high: f32,
}

@group(0) @binding(0) var scalar: texture_2d<f32>;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var view: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8)
fn show(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(view);
    if any(id.xy >= size) {
        return;
    }
    let texel = id.xy * textureDimensions(scalar) / size;
    let range = params.high - params.low;
    let grey = (textureLoad(scalar, texel, 0).x - params.low) / select(1.0, range, range != 0.0);
    textureStore(view, id.xy, vec4f(vec3f(saturate(grey)), 1.0));
}
