//! A camera and a light for scenes that have none.

use glam::{DVec3, Vec3};

use crate::{
    bounds::Bounds,
    gpu_data::Falloff,
    motion::{CameraPose, LightPose, Track},
    scene::{Light, LightShape},
};

/// Horizontal field of view of a fitted camera in degrees.
const FOV_X_DEG: f64 = 50.0;
/// Width over height of the widest picture that still shows all of the scene.
const WIDEST: f64 = 16.0 / 9.0;
/// Room around the scene in a fitted picture.
const MARGIN: f64 = 1.05;

/// A camera outside of the bounds on their longest horizontal axis, that sees all of them. It looks towards −z or −x, as
/// models usually face +z.
pub(crate) fn camera(bounds: &Bounds) -> CameraPose {
    let size = bounds.size();
    let (axis, width, depth) = if size.x > size.z { (DVec3::X, size.z, size.x) } else { (DVec3::Z, size.x, size.z) };
    let half = 0.5 * width.max(WIDEST * size.y).max(1e-3 * bounds.diagonal());
    let distance = 0.5 * depth + MARGIN * half / (FOV_X_DEG / 2.0).to_radians().tan();
    let target = bounds.centre();
    CameraPose { origin: (target + axis * distance).as_vec3(), target: target.as_vec3(), up: Vec3::Y, fov_x_deg: FOV_X_DEG as f32 }
}

/// Where a fitted light stands: this share of the way from the centre to the greatest corner of the bounds.
const LIGHT_PLACE: DVec3 = DVec3::new(0.3, 0.9, 0.3);
/// Least height of a fitted light above the centre, over the diagonal: a flat scene is lit from above.
const LEAST_HEIGHT: f64 = 0.2;

/// A spot from above, aimed at the centre, so strong that its irradiance there is π W/m² (a white surface has radiance 1).
pub(crate) fn light(bounds: &Bounds) -> Light {
    let target = bounds.centre();
    let mut offset = 0.5 * bounds.size() * LIGHT_PLACE;
    offset.y = offset.y.max(LEAST_HEIGHT * bounds.diagonal());
    let intensity = std::f64::consts::PI * offset.length_squared();
    let pose = LightPose { position: (target + offset).as_vec3(), target: target.as_vec3(), strength: Vec3::splat(intensity as f32) };
    Light { pose: Track::fixed(pose), shape: LightShape::Spot { beam_deg: 35.0, cutoff_deg: 50.0, falloff: Falloff::Linear } }
}
