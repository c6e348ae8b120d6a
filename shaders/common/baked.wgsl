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
