//! Axis-aligned boxes.

use glam::{DMat4, DVec3};

/// An axis-aligned box; empty where `min` exceeds `max`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: DVec3,
    /// Greatest corner.
    pub max: DVec3,
}

impl Bounds {
    /// Around nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// Grows to hold a point.
    pub fn add(&mut self, point: DVec3) {
        self.min = self.min.min(point);
        self.max = self.max.max(point);
    }

    /// The box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Whether there is nothing inside.
    pub fn is_empty(&self) -> bool {
        self.min.cmpgt(self.max).any()
    }

    /// The middle.
    pub fn centre(&self) -> DVec3 {
        0.5 * (self.min + self.max)
    }

    /// Lengths of the edges.
    pub fn size(&self) -> DVec3 {
        (self.max - self.min).max(DVec3::ZERO)
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f64 {
        self.size().length()
    }

    /// Distance from a point; 0 inside.
    pub fn distance(&self, point: DVec3) -> f64 {
        (self.min - point).max(point - self.max).max(DVec3::ZERO).length()
    }

    /// A distance from a point beyond everything inside: twice the diagonal and the distance to the box.
    pub fn beyond(&self, point: DVec3) -> f64 {
        2.0 * (self.diagonal() + self.distance(point))
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), self.max, self.min))
    }

    /// A box around this one after an affine transform.
    #[must_use]
    pub fn transformed(&self, matrix: &DMat4) -> Self {
        let mut out = Self::EMPTY;
        if !self.is_empty() {
            self.corners().into_iter().for_each(|corner| out.add(matrix.transform_point3(corner)));
        }
        out
    }
}
