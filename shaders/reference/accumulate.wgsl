// Progressive mean and standard error from independent batches: every frame is one. Welford's update keeps small variances of large means.

#import common::scene::{Frame, View, SceneInfo, Light, Sky}
#import common::random::hash

struct Params {
    component: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> scene_camera: View;
@group(0) @binding(2) var<uniform> scene_info: SceneInfo;
@group(0) @binding(3) var<storage, read> scene_lights: array<Light>;
@group(0) @binding(4) var<uniform> scene_sky: Sky;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var traced: texture_2d<f32>;
@group(0) @binding(7) var sum_previous: texture_2d<f32>;
@group(0) @binding(8) var squares_previous: texture_2d<f32>;
@group(0) @binding(9) var<storage, read> key_previous: array<u32>;
@group(0) @binding(10) var sum: texture_storage_2d<rgba32float, write>;
@group(0) @binding(11) var squares: texture_storage_2d<rgba32float, write>;
@group(0) @binding(12) var<storage, read_write> key: array<u32>;
@group(0) @binding(13) var composed: texture_storage_2d<rgba32float, write>;
@group(0) @binding(14) var standard_error: texture_storage_2d<rgba32float, write>;

fn mix(seed: u32, v: vec4f) -> u32 {
    let b = bitcast<vec4u>(v);
    return hash(b.x ^ hash(b.y ^ hash(b.z ^ hash(b.w ^ seed))));
}

// What a mean must not be taken over.
fn current_key() -> u32 {
    var h = hash(params.component ^ hash(scene_info.light_count ^ bitcast<u32>(frame.time)));
    for (var i = 0u; i < 4u; i++) {
        h = mix(h, scene_camera.clip_from_world[i]);
    }
    h = mix(h, vec4f(scene_camera.origin, 0.0));
    for (var i = 0u; i < scene_info.light_count; i++) {
        let light = scene_lights[i];
        h = hash(h ^ light.kind ^ (light.falloff << 8u));
        h = mix(h, vec4f(light.position, light.beam_rad));
        h = mix(h, vec4f(light.direction, light.cutoff_rad));
        h = mix(h, vec4f(light.strength, 0.0));
    }
    h = mix(h, vec4f(scene_sky.zenith, scene_sky.exponent));
    return mix(mix(h, vec4f(scene_sky.horizon, 0.0)), vec4f(scene_sky.ground, 0.0));
}

@compute @workgroup_size(1)
fn remember() {
    key[0] = current_key();
}

@compute @workgroup_size(8, 8)
fn accumulate(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(sum)) {
        return;
    }
    var paths: vec4f;
    for (var i = 0u; i < 4u; i++) {
        paths[i] = textureLoad(traced, vec2u(4u * id.x + i, id.y), 0).x;
    }
    let value = paths.rgb / max(paths.a, 1.0);
    var total = vec4f(value, 1.0);
    var spread = vec3f(0.0);
    if frame.index > 0u && key_previous[0] == key[0] {
        let before = textureLoad(sum_previous, id.xy, 0);
        total = before + vec4f(value, 1.0);
        let old_mean = before.rgb / before.a;
        spread = textureLoad(squares_previous, id.xy, 0).rgb + (value - old_mean) * (value - total.rgb / total.a);
    }
    textureStore(sum, id.xy, total);
    textureStore(squares, id.xy, vec4f(spread, 0.0));
    textureStore(composed, id.xy, vec4f(total.rgb / total.a, 1.0));
    let n = total.a;
    let error = select(vec3f(0.0), sqrt(max(spread, vec3f(0.0)) / (n * max(n - 1.0, 1.0))), n > 1.0);
    textureStore(standard_error, id.xy, vec4f(error, n));
}
