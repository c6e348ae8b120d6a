//! Lights at one time, as shaders read them.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};

use crate::{
    bounds::Bounds,
    gpu_data::{self, Falloff, LightKind, LightView, View},
    motion::LightPose,
    scene::{Light, LightShape},
};

/// Cone of the light of a scene without spot lights.
const DARK_BEAM_RAD: f32 = 0.5;
const DARK_CUTOFF_RAD: f32 = 0.6;

/// Radius of a directional light's disk over that of the sphere around the scene's bounds: room for rounding in 32 bits, which would
/// leave the rim of the scene without rays. It adds as much to the variance of a path tracer, and nothing to its mean.
const DISK_MARGIN: f64 = 1.001;

/// Distance of the near plane over the diagonal of the scene. With reverse z in 32-bit floats a near plane this close costs no precision.
pub(crate) const NEAR: f64 = 1e-3;

/// Half width of the view of a directional light is never less, so that a scene of one point still has a view.
const LEAST_HALF_WIDTH: f64 = 1e-12;

/// Half-angle of the view of a spot light is never less: narrower cones are a part of it.
const LEAST_HALF_ANGLE_RAD: f32 = 1e-6;

/// Views of a point light: the faces of a cube, in the order of [`LightView::face`].
const FACES: [DVec3; 6] = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];

/// How many views a light has.
pub(crate) fn view_count(shape: &LightShape) -> usize {
    if *shape == LightShape::Point { FACES.len() } else { 1 }
}

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

/// What the lights see. Without lights: what a dark one sees.
pub(crate) fn views(lights: &[gpu_data::Light], poses: &[LightPose], bounds: &Bounds) -> Vec<LightView> {
    if lights.is_empty() {
        return vec![LightView {
            view: spot_view(&dark(bounds), None, bounds),
            light: 0,
            kind: LightKind::Spot as u32,
            face: 0,
            weight: 1.0,
        }];
    }
    let mut out = Vec::new();
    // What a texel of each view can reflect, W, up to the number of texels.
    let mut powers = Vec::new();
    for (index, (light, pose)) in lights.iter().zip(poses).enumerate() {
        let strength = f64::from(light.strength.max_element());
        let mut add = |view, face, extent: f64| {
            out.push(LightView { view, light: index as u32, kind: light.kind, face, weight: 1.0 });
            powers.push(strength * extent);
        };
        if light.kind == LightKind::Directional as u32 {
            let half_width = f64::from(light.radius).max(LEAST_HALF_WIDTH);
            let view = View::parallel(light.position, light.direction.as_dvec3(), half_width, 2.0 * half_width);
            add(view, 0, 4.0 * half_width * half_width);
        } else if light.kind == LightKind::Point as u32 {
            let (near, far) = depths(light.position, bounds);
            for (face, forward) in (0..).zip(FACES) {
                add(View::along(light.position, forward, Vec3::Y, [1.0; 2], near, far), face, 4.0 * PI / 6.0);
            }
        } else {
            let view = spot_view(light, Some(pose.target), bounds);
            let tan2 = f64::from(view.tan_half_x).powi(2);
            add(view, 0, 4.0 * (tan2 / (1.0 + 2.0 * tan2).sqrt()).atan());
        }
    }
    let most = powers.iter().copied().fold(0.0, f64::max);
    if most > 0.0 && most.is_finite() {
        for (view, power) in out.iter_mut().zip(powers) {
            view.weight = (power / most) as f32;
        }
    }
    out
}

/// The cone of a spot light as a square camera: its full field of view is twice the cut-off.
fn spot_view(light: &gpu_data::Light, target: Option<Vec3>, bounds: &Bounds) -> View {
    let origin = light.position;
    let target = target.filter(|target| *target != origin).unwrap_or(origin + light.direction * bounds.diagonal() as f32);
    let (near, far) = depths(origin, bounds);
    View::perspective(origin, target, Vec3::Y, 2.0 * light.cutoff_rad.max(LEAST_HALF_ANGLE_RAD), 1.0, near, far)
}

/// Near plane of a light, and a distance beyond everything.
fn depths(origin: Vec3, bounds: &Bounds) -> (f32, f32) {
    ((NEAR * bounds.diagonal()) as f32, bounds.beyond(origin.as_dvec3()) as f32)
}

/// A spot light without light.
fn dark(bounds: &Bounds) -> gpu_data::Light {
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
