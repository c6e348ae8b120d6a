// Reflected flux of an RSM texel, in watts. [RSM], [ACRSM] 5.1.1.
// The paper's Φ = k cosθ/cosω is this up to a constant; the physical one makes ΣΦ the power that the scene reflects once.

#import common::scene::Light
#import common::rsm::{scene_light_views, view_count, view_of_texel, texel_extent, texel_power_of_unit_strength}

@group(0) @binding(0) var<storage, read> scene_lights: array<Light>;
@group(0) @binding(1) var rsm_albedo: texture_2d<f32>;
@group(0) @binding(2) var rsm_flux: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn reflect_flux(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(rsm_flux);
    if any(id.xy >= size) {
        return;
    }
    let index = view_of_texel(id.xy, size);
    var flux = vec4f(0.0);
    if index < view_count() {
        let light = scene_lights[scene_light_views[index].light];
        let rgb = textureLoad(rsm_albedo, id.xy, 0).rgb * light.strength * texel_power_of_unit_strength(light, id.xy, size);
        flux = vec4f(rgb, texel_extent(id.xy, size));
    }
    textureStore(rsm_flux, id.xy, flux);
}
