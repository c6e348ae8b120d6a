//! Lights at one time, as shaders read them.

use std::f64::consts::PI;

use glam::Vec3;

use crate::{
    bounds::Bounds,
    gpu_data::{self, Falloff, LightKind},
    motion::LightPose,
    scene::{Light, LightShape},
};

/// Cone of the light of a scene without spot lights.
const DARK_BEAM_RAD: f32 = 0.5;
const DARK_CUTOFF_RAD: f32 = 0.6;

/// Radius of a directional light's disk over that of the sphere around the scene's bounds: room for rounding in 32 bits, which would
/// leave the rim of the scene without rays. It adds as much to the variance of a path tracer, and nothing to its mean.
const DISK_MARGIN: f64 = 1.001;

/// All lights, with their shares of the power.
pub(crate) fn on_gpu(lights: &[Light], poses: &[LightPose], bounds: &Bounds) -> Vec<gpu_data::Light> {
    let mut out: Vec<_> = lights.iter().zip(poses).map(|(light, pose)| of_shape(light.shape, pose, bounds)).collect();
    let total: f64 = out.iter().map(power_w).sum();
    for light in &mut out {
        let share = power_w(light) / total;
        let ray_density = (share / extent(light)) as f32;
        // Not so where all lights are dark, and for extents and sums beyond 32 bits: such a light is met by random directions only.
        if ray_density.is_finite() {
            (light.share, light.ray_density) = (share as f32, ray_density);
        }
    }
    out
}

/// A spot light without light.
pub(crate) fn dark(bounds: &Bounds) -> gpu_data::Light {
    gpu_data::Light {
        beam_rad: DARK_BEAM_RAD,
        cutoff_rad: DARK_CUTOFF_RAD,
        ..of_kind(LightKind::Spot, bounds.centre().as_vec3(), Vec3::NEG_Y, Vec3::ZERO)
    }
}

fn of_shape(shape: LightShape, pose: &LightPose, bounds: &Bounds) -> gpu_data::Light {
    let direction = pose.direction();
    match shape {
        LightShape::Spot { beam_deg, cutoff_deg, falloff } => gpu_data::Light {
            falloff: falloff as u32,
            beam_rad: beam_deg.to_radians(),
            cutoff_rad: cutoff_deg.to_radians(),
            ..of_kind(LightKind::Spot, pose.position, direction, pose.strength)
        },
        LightShape::Point => gpu_data::Light {
            beam_rad: PI as f32,
            cutoff_rad: PI as f32,
            ..of_kind(LightKind::Point, pose.position, Vec3::NEG_Y, pose.strength)
        },
        LightShape::Directional => {
            let radius = DISK_MARGIN * 0.5 * bounds.diagonal();
            let position = bounds.centre() - radius * direction.as_dvec3();
            gpu_data::Light { radius: radius as f32, ..of_kind(LightKind::Directional, position.as_vec3(), direction, pose.strength) }
        }
    }
}

fn of_kind(kind: LightKind, position: Vec3, direction: Vec3, strength: Vec3) -> gpu_data::Light {
    gpu_data::Light {
        position,
        kind: kind as u32,
        direction,
        falloff: Falloff::default() as u32,
        strength,
        beam_rad: 0.0,
        cutoff_rad: 0.0,
        radius: 0.0,
        share: 0.0,
        ray_density: 0.0,
    }
}

/// What a light's rays are spread over: solid angle in sr, or the area of the disk in m².
fn extent(light: &gpu_data::Light) -> f64 {
    if light.kind == LightKind::Directional as u32 {
        PI * f64::from(light.radius).powi(2)
    } else {
        4.0 * PI * (0.5 * f64::from(light.cutoff_rad)).sin().powi(2)
    }
}

/// Flux of a light whose fall-off is 1, summed over the colours: near enough to compare lights.
fn power_w(light: &gpu_data::Light) -> f64 {
    extent(light) * light.strength.as_dvec3().element_sum()
}
