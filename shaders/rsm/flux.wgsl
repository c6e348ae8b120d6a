// Reflected flux of an RSM texel, in watts. [RSM], [ACRSM] 5.1.1.
// The paper's Φ = k cosθ/cosω is this up to a constant; the physical one makes ΣΦ the power that the scene reflects once.

#import common::scene::{Light, View}
#import common::view::{pixel_direction, pixel_solid_angle}
#import common::radiometry::spot_falloff

@group(0) @binding(0) var<uniform> scene_light: Light;
@group(0) @binding(1) var<uniform> scene_light_view: View;
@group(0) @binding(2) var rsm_albedo: texture_2d<f32>;
@group(0) @binding(3) var rsm_flux: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn reflect_flux(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(rsm_flux);
    if any(id.xy >= size) {
        return;
    }
    let solid_angle = pixel_solid_angle(scene_light_view, id.xy, size);
    let falloff = spot_falloff(scene_light, pixel_direction(scene_light_view, id.xy, size));
    let flux = textureLoad(rsm_albedo, id.xy, 0).rgb * scene_light.strength * (falloff * solid_angle);
    textureStore(rsm_flux, id.xy, vec4f(flux, solid_angle));
}
