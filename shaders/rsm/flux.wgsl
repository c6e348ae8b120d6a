// Reflected flux of an RSM texel, in watts. [RSM], [ACRSM] 5.1.1.
// The paper's Φ = k cosθ/cosω is this up to a constant; the physical one makes ΣΦ the power that the scene reflects once.

#import common::scene::Light
#import common::rsm::{scene_light_views, view_count, place_of_texel, extent_at, power_of_unit_strength_at}

@group(0) @binding(0) var<storage, read> scene_lights: array<Light>;
@group(0) @binding(1) var rsm_albedo: texture_2d<f32>;
@group(0) @binding(2) var rsm_flux: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn reflect_flux(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(rsm_flux);
    if any(id.xy >= size) {
        return;
    }
    let place = place_of_texel(id.xy, size);
    var flux = vec4f(0.0);
    if place.view < view_count() {
        let light = scene_lights[scene_light_views[place.view].light];
        let rgb = textureLoad(rsm_albedo, id.xy, 0).rgb * light.strength * power_of_unit_strength_at(light, place);
        flux = vec4f(rgb, extent_at(place));
    }
    textureStore(rsm_flux, id.xy, flux);
}
