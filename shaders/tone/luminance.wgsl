// Log-luminance pyramid. [REINHARD] eq. 1, [ACRSM] 5.3.4.
// Differs from the paper: black pixels are left out (their logarithm would need an offset that sets the exposure of dark pictures);
// the base is padded to powers of two, so that every level halves exactly.

#import common::radiometry::luminance as luminance_of

@group(0) @binding(0) var composed: texture_2d<f32>;
@group(0) @binding(1) var luminance: texture_storage_2d<rg32float, write>;
@group(0) @binding(2) var luminance_finer: texture_2d<f32>;

// Darker than this is black: keeps the logarithm finite.
const BLACK: f32 = 1e-30;
// Brighter counts as this: keeps the sum finite.
const WHITE: f32 = 1e30;

@compute @workgroup_size(8, 8)
fn measure(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(luminance)) {
        return;
    }
    var sum = vec2f(0.0);
    if all(id.xy < textureDimensions(composed)) {
        let l = min(luminance_of(textureLoad(composed, id.xy, 0).rgb), WHITE);
        if l > BLACK {
            sum = vec2f(log(l), 1.0);
        }
    }
    textureStore(luminance, id.xy, vec4f(sum, 0.0, 0.0));
}

@compute @workgroup_size(8, 8)
fn reduce(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(luminance)) {
        return;
    }
    // A level is one texel wide or high from some level on.
    let finer = textureDimensions(luminance_finer);
    var sum = vec2f(0.0);
    for (var y = 0u; y < min(finer.y, 2u); y++) {
        for (var x = 0u; x < min(finer.x, 2u); x++) {
            sum += textureLoad(luminance_finer, 2u * id.xy + vec2u(x, y), 0).xy;
        }
    }
    textureStore(luminance, id.xy, vec4f(sum, 0.0, 0.0));
}
