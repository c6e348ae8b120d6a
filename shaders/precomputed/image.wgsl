// Precomputed indirect light, pasted onto the picture. [PCA] 3.1: the first of the three ways of look-up.
// Differs from the paper: distances are baked as well. A pixel whose surface was not there (a dynamic object) gets no indirect light instead of that
// of what is behind it, and pictures of other sizes are interpolated between texels of their own surface only.
// What bounds it: a read a layer for each of four texels, at silhouettes of nine.

#import common::baked::{baked_light, baked_texel}

struct Params {
    sky: u32,
    tolerance: f32,
}

@group(0) @binding(0) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var indirect: texture_storage_2d<rgba32float, write>;

// What stands for the logarithm of a distance where there was no surface.
const NOWHERE: f32 = 65504.0;
// Texels of less weight are not read: where picture and key frames have one size, a texel is one pixel but for rounding.
const LEAST_WEIGHT: f32 = 1e-4;

// Whether the surface at a distance is the one whose light was baked.
fn is_baked(distance: f32, texel: vec2u) -> bool {
    let baked = textureLoad(baked_light, texel, 0u, 0).a;
    if distance <= 0.0 || baked >= NOWHERE {
        return (distance <= 0.0) == (baked >= NOWHERE);
    }
    return abs(log2(distance) - baked) <= log2(1.0 + params.tolerance);
}

// Light of a texel times its weight, and the weight; zero where it is another surface or beside the picture.
fn tap(distance: f32, texel: vec2i, weight: f32) -> vec4f {
    let outside = any(texel < vec2i(0)) || any(texel >= vec2i(textureDimensions(baked_light)));
    if outside || weight < LEAST_WEIGHT || !is_baked(distance, vec2u(max(texel, vec2i(0)))) {
        return vec4f(0.0);
    }
    return vec4f(baked_texel(vec2u(texel), params.sky != 0u), 1.0) * weight;
}

@compute @workgroup_size(8, 8)
fn look_up(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(indirect);
    if any(id.xy >= size) {
        return;
    }
    let distance = textureLoad(gbuffer_distance, id.xy, 0).x;
    let place = (vec2f(id.xy) + 0.5) / vec2f(size) * vec2f(textureDimensions(baked_light)) - 0.5;
    let first = vec2i(floor(place));
    let part = place - floor(place);
    var sum = vec4f(0.0);
    for (var i = 0; i < 4; i++) {
        let step = vec2i(i & 1, i >> 1u);
        let weights = select(1.0 - part, part, step == vec2i(1));
        sum += tap(distance, first + step, weights.x * weights.y);
    }
    if sum.a == 0.0 {
        // A silhouette lies between the four: their neighbours may be of this surface.
        let middle = vec2i(floor(place + 0.5));
        for (var i = 0; i < 9; i++) {
            sum += tap(distance, middle + vec2i(i % 3 - 1, i / 3 - 1), 1.0);
        }
    }
    let light = sum.rgb / max(sum.a, LEAST_WEIGHT);
    textureStore(indirect, id.xy, vec4f(light, select(0.0, 1.0, sum.a > 0.0)));
}
