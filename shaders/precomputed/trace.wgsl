// Light of the texels of an atlas, for a camera that moves freely. [PCA] 3.1: the third of the three ways of look-up.
// Differs from the paper: what is traced is what a white matt surface reflects, so that albedo textures keep their own sharpness; and each side of a
// surface has texels of its own.
// What bounds it: as in reference/trace.

#import common::scene::Frame
#import common::random::hash3
#import common::path::{PATHS_AT_ONCE, Gathered, Surface, light_of, path_index, start_paths}
#import common::texels::{NO_TRIANGLE, SurfaceTexel}

struct Params {
    paths: u32,
    max_bounces: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read> baked_texels: array<SurfaceTexel>;
@group(0) @binding(3) var traced: texture_storage_2d<r32float, read_write>;

override component_is_direct: bool;
override component_is_one_bounce: bool;
override component_is_two_bounces: bool;
override component_is_indirect: bool;
override component_is_sky: bool;
override component_is_full: bool;

// A white matt surface: it reflects irradiance / π whoever looks at it.
fn white(texel: SurfaceTexel) -> Surface {
    return Surface(texel.position, texel.normal, texel.geometric, texel.geometric, vec3f(1.0), vec3f(0.0), 1.0);
}

@compute @workgroup_size(8, 8)
fn clear(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(traced)) {
        textureStore(traced, id.xy, vec4f(0.0));
    }
}

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(traced) / vec2u(4u, 1u);
    if any(id.xy >= size) {
        return;
    }
    let index = id.x + id.y * size.x;
    let texel = baked_texels[index];
    if texel.triangle == NO_TRIANGLE {
        return;
    }
    let bounces = select(select(params.max_bounces, 2u, component_is_two_bounces), 1u, component_is_one_bounce);
    let lights = component_is_one_bounce || component_is_two_bounces || component_is_indirect || component_is_full;
    let what = Gathered(lights, component_is_sky || component_is_full, bounces);
    var sum: vec4f;
    for (var i = 0u; i < 4u; i++) {
        sum[i] = textureLoad(traced, vec2u(4u * id.x + i, id.y)).x;
    }
    let first = u32(sum.a);
    start_paths(hash3(index, frame.index, frame.seed), first);
    for (path_index = first; path_index < min(first + PATHS_AT_ONCE, params.paths); path_index++) {
        sum += vec4f(light_of(white(texel), component_is_direct || component_is_full, what), 1.0);
    }
    for (var i = 0u; i < 4u; i++) {
        textureStore(traced, vec2u(4u * id.x + i, id.y), vec4f(sum[i]));
    }
}
