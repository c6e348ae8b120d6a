//! Values that change over time: key frames, interpolated linearly (rotations on the shortest arc).

use glam::{DMat4, DQuat, DVec3, Quat, Vec3};

/// What happens before the first and after the last key frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Repeat {
    /// The first or the last value stays.
    #[default]
    Clamp,
    /// The whole track starts again: time is taken modulo the distance from the first to the last key.
    Loop,
}

/// A value that can be mixed with another.
pub trait Interpolate: Clone + PartialEq {
    /// The value at `fraction` of the way from `self` (0) to `other` (1).
    #[must_use]
    fn interpolate(&self, other: &Self, fraction: f32) -> Self;
}

/// A value over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Track<T> {
    /// Times in seconds, strictly increasing, and values; never empty.
    keys: Vec<(f64, T)>,
    /// Outside of the keys.
    repeat: Repeat,
}

impl<T> Track<T> {
    /// A value that never changes.
    pub fn fixed(value: T) -> Self {
        Self { keys: vec![(0.0, value)], repeat: Repeat::Clamp }
    }

    /// Key frames; `None` if there are none or their times are not finite and strictly increasing.
    pub fn keyed(keys: Vec<(f64, T)>, repeat: Repeat) -> Option<Self> {
        let ordered = keys.windows(2).all(|pair| pair[0].0 < pair[1].0) && keys.iter().all(|key| key.0.is_finite());
        (ordered && !keys.is_empty()).then_some(Self { keys, repeat })
    }

    /// The same times with other values.
    #[must_use]
    pub fn map<U>(self, convert: impl Fn(T) -> U) -> Track<U> {
        Track { keys: self.keys.into_iter().map(|(time, value)| (time, convert(value))).collect(), repeat: self.repeat }
    }

    /// Times and values.
    pub fn keys(&self) -> &[(f64, T)] {
        &self.keys
    }

    /// Whether there is more than one key.
    pub fn moves(&self) -> bool {
        self.keys.len() > 1
    }

    /// The first and the last time where the value changes between them, and whether the track starts again after that.
    pub(crate) fn span(&self) -> Option<(f64, f64, bool)>
    where
        T: PartialEq,
    {
        let changes = self.keys.windows(2).any(|pair| pair[0].1 != pair[1].1);
        changes.then(|| (self.keys[0].0, self.keys[self.keys.len() - 1].0, self.repeat == Repeat::Loop))
    }

    /// The values before and after a time in seconds, and which share of the way between them it is (0…1, without 1). Where the track stands
    /// still, and on a key, both are the same. A time that is not finite counts as 0.
    pub fn around(&self, time: f64) -> (&T, &T, f32) {
        let (first, last) = (&self.keys[0], &self.keys[self.keys.len() - 1]);
        let mut time = if time.is_finite() { time } else { 0.0 };
        if self.repeat == Repeat::Loop && self.moves() {
            time = first.0 + (time - first.0).rem_euclid(last.0 - first.0);
        }
        let next = self.keys.partition_point(|key| key.0 <= time);
        match (next.checked_sub(1).map(|i| &self.keys[i]), self.keys.get(next)) {
            (Some(a), Some(b)) if a.0 < time => (&a.1, &b.1, ((time - a.0) / (b.0 - a.0)) as f32),
            (Some(a), _) => (&a.1, &a.1, 0.0),
            (None, _) => (&first.1, &first.1, 0.0),
        }
    }
}

impl<T: Interpolate> Track<T> {
    /// The value at a time in seconds. A time that is not finite counts as 0.
    pub fn at(&self, time: f64) -> T {
        match self.around(time) {
            (before, _, 0.0) => before.clone(),
            // What rests between two keys must not move by rounding: who looks at it would see a change.
            (before, after, _) if before == after => before.clone(),
            (before, after, fraction) => before.interpolate(after, fraction),
        }
    }
}

/// Where an object is: scaled, then turned, then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// World units.
    pub translate: Vec3,
    /// Unit quaternion.
    pub rotate: Quat,
    /// Factor along each axis of the object.
    pub scale: Vec3,
}

impl Default for Pose {
    fn default() -> Self {
        Self { translate: Vec3::ZERO, rotate: Quat::IDENTITY, scale: Vec3::ONE }
    }
}

impl Pose {
    /// The affine matrix.
    pub fn world_from_object(&self) -> DMat4 {
        let rotate = DQuat::from_xyzw(self.rotate.x.into(), self.rotate.y.into(), self.rotate.z.into(), self.rotate.w.into());
        DMat4::from_scale_rotation_translation(self.scale.as_dvec3(), rotate.normalize(), self.translate.as_dvec3())
    }
}

impl Interpolate for Pose {
    fn interpolate(&self, other: &Self, fraction: f32) -> Self {
        Self {
            translate: self.translate.lerp(other.translate, fraction),
            rotate: self.rotate.slerp(other.rotate, fraction),
            scale: self.scale.lerp(other.scale, fraction),
        }
    }
}

/// What of a light can move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LightPose {
    /// World space. A directional light has none: zero, so that its target is its direction.
    pub position: Vec3,
    /// A point on the axis, world space; without meaning for a point light.
    pub target: Vec3,
    /// Intensity along the axis in W/sr; of a directional light the irradiance of a surface that faces it, in W/m².
    pub strength: Vec3,
}

impl LightPose {
    /// Unit vector along the axis; downwards if the light is on its target.
    pub fn direction(&self) -> Vec3 {
        (self.target.as_dvec3() - self.position.as_dvec3()).try_normalize().unwrap_or(DVec3::NEG_Y).as_vec3()
    }
}

impl Interpolate for LightPose {
    fn interpolate(&self, other: &Self, fraction: f32) -> Self {
        Self {
            position: self.position.lerp(other.position, fraction),
            target: self.target.lerp(other.target, fraction),
            strength: self.strength.lerp(other.strength, fraction),
        }
    }
}

/// A pinhole camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraPose {
    /// The eye, world space.
    pub origin: Vec3,
    /// What is in the middle of the picture, world space.
    pub target: Vec3,
    /// Towards the top of the picture; any length.
    pub up: Vec3,
    /// Full horizontal field of view in degrees.
    pub fov_x_deg: f32,
}

impl Interpolate for CameraPose {
    fn interpolate(&self, other: &Self, fraction: f32) -> Self {
        Self {
            origin: self.origin.lerp(other.origin, fraction),
            target: self.target.lerp(other.target, fraction),
            up: self.up.lerp(other.up, fraction),
            fov_x_deg: self.fov_x_deg + (other.fov_x_deg - self.fov_x_deg) * fraction,
        }
    }
}
