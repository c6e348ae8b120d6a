// Tone mapping. [REINHARD], [ACRSM] 5.3.4.

#import common::radiometry::luminance as luminance_of
#import common::srgb::srgb_encode

struct Params {
    key: f32,
    white: f32,
}

@group(0) @binding(0) var composed: texture_2d<f32>;
@group(0) @binding(1) var luminance: texture_2d<f32>;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var tonemapped: texture_storage_2d<rgba8unorm, write>;

// Brighter counts as this: keeps squares and quotients finite.
const BRIGHTEST: f32 = 1e15;

@compute @workgroup_size(8, 8)
fn tonemap(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(tonemapped)) {
        return;
    }
    let top = textureLoad(luminance, vec2u(0u), textureNumLevels(luminance) - 1u).xy;
    // All black: any exposure will do.
    let log_mean = select(0.0, top.x / top.y, top.y > 0.0);
    let radiance = textureLoad(composed, id.xy, 0).rgb;
    let l = luminance_of(radiance);
    let scaled = min(exp(log(params.key) - log_mean + log(max(l, 1e-30))), BRIGHTEST); // [REINHARD] eq. 2
    let mapped = scaled * (1.0 + scaled / (params.white * params.white)) / (1.0 + scaled); // [REINHARD] eq. 4
    let colour = select(vec3f(0.0), radiance / l * mapped, l > 1e-30);
    textureStore(tonemapped, id.xy, vec4f(srgb_encode(colour), 1.0));
}
