//! The sun of a place on a day, and the light of the sky.

use glam::{DQuat, DVec3, Vec3};

use crate::{gpu_data, motion::LightPose};

/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;

/// A directional light that goes its way over the sky. Scene time is solar time in seconds since midnight: the sun is in the south (or north)
/// at 43 200 s. Every day is the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sun {
    /// Of the place, north positive.
    pub latitude_deg: f64,
    /// Angle of the sun above the plane of the equator: ±23.44° at the solstices, 0° at the equinoxes.
    pub declination_deg: f64,
    /// Turns the compass about +y: at 0° north is −z and east +x.
    pub north_deg: f64,
    /// Irradiance of a surface that faces the sun when it is high, W/m².
    pub irradiance: Vec3,
    /// Elevation from which on it has all of its strength; below it fades smoothly to nothing at the horizon.
    pub fade_deg: f64,
    /// How far below the horizon it still lights the sky.
    pub twilight_deg: f64,
}

/// Where the sun of a scene is among its lights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SunLight {
    /// Index of the directional light.
    pub light: usize,
    /// Its way.
    pub sun: Sun,
}

impl Sun {
    /// Declination on a day of the year (1 is the first of January), to half a degree: Cooper's formula with a circular orbit.
    pub fn declination_of_day_deg(day: f64) -> f64 {
        -23.44 * (std::f64::consts::TAU * (day + 10.0) / 365.0).cos()
    }

    /// Unit vector towards the sun at a time in seconds.
    pub fn to_sun(&self, time: f64) -> DVec3 {
        let time = if time.is_finite() { time } else { 0.0 };
        let hour_angle = std::f64::consts::TAU * ((time / DAY_S).rem_euclid(1.0) - 0.5);
        let (sin_latitude, cos_latitude) = self.latitude_deg.to_radians().sin_cos();
        let (sin_declination, cos_declination) = self.declination_deg.to_radians().sin_cos();
        let east = -cos_declination * hour_angle.sin();
        let north = cos_latitude * sin_declination - sin_latitude * cos_declination * hour_angle.cos();
        let up = sin_latitude * sin_declination + cos_latitude * cos_declination * hour_angle.cos();
        (DQuat::from_rotation_y(self.north_deg.to_radians()) * DVec3::new(east, up, -north)).normalize()
    }

    /// Elevation above the horizon in degrees.
    pub fn elevation_deg(&self, time: f64) -> f64 {
        self.to_sun(time).y.clamp(-1.0, 1.0).asin().to_degrees()
    }

    /// Direction and strength of its light.
    pub fn pose(&self, time: f64) -> LightPose {
        let strength = smooth(self.elevation_deg(time) / self.fade_deg);
        LightPose { position: Vec3::ZERO, target: (-self.to_sun(time)).as_vec3(), strength: self.irradiance * strength as f32 }
    }

    /// Share of its light that the sky has: 1 by day, 0 by night.
    pub fn daylight(&self, time: f64) -> f64 {
        smooth((self.elevation_deg(time) + self.twilight_deg) / (self.fade_deg + self.twilight_deg))
    }
}

/// The smooth step from 0 to 1.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Radiance of the sky in W/(m² sr): what a ray meets that leaves the scene. From the horizon (where directions have no upward part) to the zenith it is
/// mixed by the sine of the elevation to the power of `exponent`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sky {
    /// Straight above.
    pub zenith: Vec3,
    /// At the horizon.
    pub horizon: Vec3,
    /// In all directions below the horizon.
    pub ground: Vec3,
    /// Below 1 the horizon is a narrow band.
    pub exponent: f32,
}

impl Sky {
    /// No light at all.
    pub const BLACK: Self = Self::uniform(Vec3::ZERO);

    /// The same in all directions.
    pub const fn uniform(radiance: Vec3) -> Self {
        Self { zenith: radiance, horizon: radiance, ground: radiance, exponent: 1.0 }
    }

    /// Whether there is no light.
    pub fn is_black(&self) -> bool {
        [self.zenith, self.horizon, self.ground].iter().all(|radiance| *radiance == Vec3::ZERO)
    }

    /// As shaders read it, with a share of its light.
    pub(crate) fn on_gpu(&self, daylight: f64) -> gpu_data::Sky {
        let scale = daylight as f32;
        gpu_data::Sky {
            zenith: self.zenith * scale,
            daylight: scale,
            horizon: self.horizon * scale,
            exponent: self.exponent,
            ground: self.ground * scale,
            is_lit: u32::from(!self.is_black() && scale > 0.0),
        }
    }
}
