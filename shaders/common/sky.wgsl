// Light of the sky. A node whose entry points reach `sky_radiance` has the port `scene_sky`.

#import common::scene::Sky

@group(1) @binding(auto) var<uniform> scene_sky: Sky;

// Radiance of the sky in a direction, W/(m² sr).
fn sky_radiance(direction: vec3f) -> vec3f {
    let height = normalize(direction).y;
    if scene_sky.is_lit == 0u {
        return vec3f(0.0);
    }
    let above = mix(scene_sky.horizon, scene_sky.zenith, pow(max(height, 0.0), scene_sky.exponent));
    return select(scene_sky.ground, above, height >= 0.0);
}
