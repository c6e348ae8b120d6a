// Precomputed light: mean, components and sky, one a layer, each with its weight at this time ([PCA] 3.2, eq. 2).
// A node whose entry points reach these functions has the ports `baked_light` and `baked_weights`. Cost: one texture read a layer, at most 256.

@group(1) @binding(auto) var baked_light: texture_2d_array<f32>;
@group(1) @binding(auto) var<storage, read> baked_weights: array<f32>;
@group(1) @binding(auto) var linear_sampler: sampler;

// Layers that count: with that of the sky, which is the last one, or without it.
fn baked_layers(with_sky: bool) -> u32 {
    return arrayLength(&baked_weights) - select(1u, 0u, with_sky);
}

// Light of a texel. Components may be negative: what they leave of a dark place below zero is their error.
fn baked_texel(texel: vec2u, with_sky: bool) -> vec3f {
    var light = vec3f(0.0);
    for (var layer = 0u; layer < baked_layers(with_sky); layer++) {
        light += baked_weights[layer] * textureLoad(baked_light, texel, layer, 0).rgb;
    }
    return max(light, vec3f(0.0));
}

// Light at a place in texels, mixed from the four texels around it.
fn baked_light_at(place: vec2f, with_sky: bool) -> vec3f {
    let uv = place / vec2f(textureDimensions(baked_light));
    var light = vec3f(0.0);
    for (var layer = 0u; layer < baked_layers(with_sky); layer++) {
        light += baked_weights[layer] * textureSampleLevel(baked_light, linear_sampler, uv, layer, 0.0).rgb;
    }
    return max(light, vec3f(0.0));
}

// What stands for the logarithm of a distance where there was no surface.
const NOWHERE: f32 = 65504.0;
// Texels of less weight are not read: where picture and key frames have one size, a texel is one pixel but for rounding.
const LEAST_WEIGHT: f32 = 1e-4;

// Whether the surface at a distance is the one whose light a texel holds.
fn is_baked(distance: f32, texel: vec2i, tolerance: f32) -> bool {
    let baked = textureLoad(baked_light, clamp(texel, vec2i(0), vec2i(textureDimensions(baked_light)) - 1), 0, 0).a;
    if distance <= 0.0 || baked >= NOWHERE {
        return (distance <= 0.0) == (baked >= NOWHERE);
    }
    return abs(log2(distance) - baked) <= log2(1.0 + tolerance);
}

// Whether the four texels from `first` on, mixed, have a distance. On a plane its inverse is nearly linear from texel to texel, however steeply the plane is
// seen; and it is zero where there was no surface.
fn is_between(distance: f32, first: vec2i, part: vec2f, tolerance: f32) -> bool {
    let last = vec2i(textureDimensions(baked_light)) - 1;
    var inverse = 0.0;
    for (var i = 0; i < 4; i++) {
        let step = vec2i(i & 1, i >> 1u);
        let weights = select(1.0 - part, part, step == vec2i(1));
        inverse += weights.x * weights.y * exp2(-textureLoad(baked_light, clamp(first + step, vec2i(0), last), 0, 0).a);
    }
    return distance > 0.0 && inverse > 0.0 && abs(log2(distance * inverse)) <= log2(1.0 + tolerance);
}

// Light of a texel times its weight, and the weight; zero beside the picture.
fn tap(texel: vec2i, weight: f32, with_sky: bool) -> vec4f {
    let outside = any(texel < vec2i(0)) || any(texel >= vec2i(textureDimensions(baked_light)));
    if outside || weight < LEAST_WEIGHT {
        return vec4f(0.0);
    }
    return vec4f(baked_texel(vec2u(texel), with_sky), 1.0) * weight;
}

// Light of what was seen at a place, in texels from the middle of the first, where it is at the distance of the baked surface but for a share; alpha is 1
// there, and 0 where another surface is.
fn seen_light(place: vec2f, distance: f32, tolerance: f32, with_sky: bool) -> vec4f {
    let first = vec2i(floor(place));
    let part = place - floor(place);
    let is_whole = is_between(distance, first, part, tolerance);
    var sum = vec4f(0.0);
    for (var i = 0; i < 4; i++) {
        let step = vec2i(i & 1, i >> 1u);
        let weights = select(1.0 - part, part, step == vec2i(1));
        if is_whole || is_baked(distance, first + step, tolerance) {
            sum += tap(first + step, weights.x * weights.y, with_sky);
        }
    }
    if sum.a == 0.0 {
        // A silhouette lies between the four: their neighbours may be of this surface.
        let middle = vec2i(floor(place + 0.5));
        for (var i = 0; i < 9; i++) {
            let texel = middle + vec2i(i % 3 - 1, i / 3 - 1);
            if is_baked(distance, texel, tolerance) {
                sum += tap(texel, 1.0, with_sky);
            }
        }
    }
    return vec4f(sum.rgb / max(sum.a, LEAST_WEIGHT), select(0.0, 1.0, sum.a > 0.0));
}
