//! Lights and reflection: the twin of `shaders/common/radiometry.wgsl` and of what `path.wgsl` does with lights.

use std::{
    f32::consts::PI,
    ops::{Add, AddAssign, Mul},
};

use glam::{Mat3, Vec3};

use crate::{
    bvh::Ray,
    gpu_data::{Falloff, Light, LightKind},
};

/// Square of the distance to a light below which its irradiance grows no further.
const LEAST_DISTANCE2: f32 = 1e-20;
/// What lengths squared are divided by at least.
const TINY: f32 = 1e-30;

/// Light by way of all lobes, and of it what met matt reflection alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Both {
    pub(super) all: Vec3,
    pub(super) matt: Vec3,
}

impl Both {
    pub(super) const ZERO: Self = Self { all: Vec3::ZERO, matt: Vec3::ZERO };

    /// No light at all, as with a lobe there is no less than without.
    pub(super) fn is_dark(&self) -> bool {
        self.all.max_element() <= 0.0
    }
}

impl Add for Both {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self { all: self.all + other.all, matt: self.matt + other.matt }
    }
}

impl AddAssign for Both {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Mul for Both {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self { all: self.all * other.all, matt: self.matt * other.matt }
    }
}

impl Mul<f32> for Both {
    type Output = Self;

    fn mul(self, factor: f32) -> Self {
        Self { all: self.all * factor, matt: self.matt * factor }
    }
}

impl Mul<Vec3> for Both {
    type Output = Self;

    fn mul(self, factor: Vec3) -> Self {
        Self { all: self.all * factor, matt: self.matt * factor }
    }
}

/// A point of a surface as a ray meets it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    pub(super) position: Vec3,
    /// Towards the ray's origin.
    pub(super) normal: Vec3,
    /// The triangle's own, towards the ray's origin.
    pub(super) geometric: Vec3,
    /// Unit.
    pub(super) to_viewer: Vec3,
    pub(super) albedo: Vec3,
    pub(super) specular: Vec3,
    pub(super) shininess: f32,
}

impl Surface {
    /// Lambert and normalised Blinn, 1/sr.
    pub(super) fn brdf(&self, towards: Vec3) -> Both {
        let matt = self.albedo / PI;
        if self.specular.max_element() <= 0.0 {
            return Both { all: matt, matt };
        }
        // Opposite directions have no half vector: no lobe.
        let half = unit(towards + self.to_viewer);
        let lobe = (self.shininess + 8.0) / (8.0 * PI) * self.normal.dot(half).max(0.0).powf(self.shininess.max(1.0));
        Both { all: matt + self.specular * lobe, matt }
    }

    /// Radiance that it sends to its viewer of what arrives from a light, shadows aside.
    pub(super) fn reflected(&self, arrival: &Arrival) -> Both {
        let cosine = self.normal.dot(arrival.to_light).max(0.0);
        if cosine <= 0.0 || arrival.irradiance.max_element() <= 0.0 {
            return Both::ZERO;
        }
        self.brdf(arrival.to_light) * (arrival.irradiance * cosine)
    }

    /// Density per area here of points that rays from a light meet, with the cosine of the triangle itself.
    pub(super) fn pdf_light(&self, arrival: &Arrival) -> f32 {
        arrival.ray_density * self.geometric.dot(arrival.to_light).max(0.0)
    }

    /// Cosines at both ends over distance²: the projected solid angle that the surface at `other` has from here, over its area. 1/m²
    pub(super) fn coupling(&self, other: &Self) -> f32 {
        let to_here = self.position - other.position;
        let direction = unit(to_here);
        (-self.normal.dot(direction)).max(0.0) * other.geometric.dot(direction).max(0.0) / to_here.length_squared().max(TINY)
    }

    /// A cosine-distributed direction around the shading normal.
    pub(super) fn cosine_direction(&self, u: [f32; 2]) -> Vec3 {
        cosine_direction(self.normal, u)
    }
}

/// The light that arrives at a point if nothing is between.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arrival {
    /// Unit.
    pub(super) to_light: Vec3,
    /// Of a surface that faces the light.
    pub(super) irradiance: Vec3,
    /// That rays from this light have across them, 1/m².
    ray_density: f32,
}

/// What arrives at `position` from a light of any kind.
pub(super) fn arrival(light: &Light, position: Vec3) -> Arrival {
    if light.kind == LightKind::Directional as u32 {
        return Arrival { to_light: -light.direction, irradiance: light.strength, ray_density: light.ray_density };
    }
    let offset = light.position - position;
    let to_light = unit(offset);
    let spread = 1.0 / offset.length_squared().max(LEAST_DISTANCE2);
    let irradiance = light.strength * (falloff(light, -to_light) * spread);
    Arrival { to_light, irradiance, ray_density: light.ray_density * spread }
}

/// Share of the strength that a light of any kind sends along a unit direction.
pub(super) fn falloff(light: &Light, direction: Vec3) -> f32 {
    if light.kind != LightKind::Spot as u32 {
        return 1.0;
    }
    let cosine = light.direction.dot(direction);
    let angle = light.direction.cross(direction).length().atan2(cosine);
    if angle >= light.cutoff_rad {
        return 0.0;
    }
    if light.falloff == Falloff::Cosine as u32 {
        return cosine / light.cutoff_rad.cos();
    }
    let t = ((light.cutoff_rad - angle) / (light.cutoff_rad - light.beam_rad).max(1e-6)).clamp(0.0, 1.0);
    if light.falloff == Falloff::Smooth as u32 { t * t * (3.0 - 2.0 * t) } else { t }
}

/// A ray from a light: in its cone or sphere, or from its disk. Of unit length.
pub(super) fn light_ray(light: &Light, u: [f32; 2]) -> Ray {
    let angle = 2.0 * PI * u[0];
    let around = Vec3::new(angle.cos(), angle.sin(), 0.0);
    let axes = basis(light.direction);
    if light.kind == LightKind::Directional as u32 {
        return Ray::new(light.position + axes * (light.radius * u[1].sqrt() * around), light.direction);
    }
    let one_minus_cos = u[1] * 2.0 * (0.5 * light.cutoff_rad).sin().powi(2);
    let r = (one_minus_cos * (2.0 - one_minus_cos)).max(0.0).sqrt();
    Ray::new(light.position, axes * (r * around + Vec3::Z * (1.0 - one_minus_cos)))
}

/// Flux that a light's ray along a unit direction stands for, where rays of all lights are as many as one.
pub(super) fn flux_of_ray(light: &Light, direction: Vec3) -> Vec3 {
    light.strength * (falloff(light, direction) / light.ray_density)
}

/// A cosine-distributed direction around a normal.
pub(super) fn cosine_direction(normal: Vec3, u: [f32; 2]) -> Vec3 {
    let angle = 2.0 * PI * u[0];
    let r = u[1].sqrt();
    basis(normal) * Vec3::new(r * angle.cos(), r * angle.sin(), (1.0 - u[1]).max(0.0).sqrt())
}

/// A vector of unit length; zero stays zero.
pub(super) fn unit(v: Vec3) -> Vec3 {
    v / v.length_squared().max(TINY).sqrt()
}

/// Two unit vectors that complete `normal` to a right-handed basis (Duff et al. 2017).
fn basis(normal: Vec3) -> Mat3 {
    let s = if normal.z >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + normal.z);
    let b = normal.x * normal.y * a;
    Mat3::from_cols(
        Vec3::new(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x),
        Vec3::new(b, s + normal.y * normal.y * a, -normal.y),
        normal,
    )
}
