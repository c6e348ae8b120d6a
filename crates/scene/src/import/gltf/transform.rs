//! Transforms of nodes in 64-bit floats: translation, rotation and scale as long as they are enough, else matrices.

use glam::{DMat3, DMat4, DQuat, DVec3};

use crate::motion::Pose;

/// Cosine between axes up to which they count as perpendicular: 32-bit matrices are no better.
const PERPENDICULAR: f64 = 1e-5;
/// Relative difference of scales that count as equal.
const EQUAL: f64 = 1e-6;

/// Scaled, then turned, then moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trs {
    pub(super) translate: DVec3,
    pub(super) rotate: DQuat,
    pub(super) scale: DVec3,
}

/// A transform, which may shear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Transform {
    Trs(Trs),
    Matrix(DMat4),
}

impl Trs {
    pub(super) const IDENTITY: Self = Self { translate: DVec3::ZERO, rotate: DQuat::IDENTITY, scale: DVec3::ONE };

    fn matrix(&self) -> DMat4 {
        DMat4::from_scale_rotation_translation(self.scale, self.rotate, self.translate)
    }

    /// First `inner`, then this; `None` if that shears.
    fn after(&self, inner: &Self) -> Option<Self> {
        let largest = self.scale.abs().max_element();
        let uniform = (self.scale - DVec3::splat(self.scale.x)).abs().max_element() <= EQUAL * largest;
        let unturned = inner.rotate.xyz().length() <= 1e-9;
        (uniform || unturned).then(|| Self {
            translate: self.translate + self.rotate * (self.scale * inner.translate),
            rotate: (self.rotate * inner.rotate).normalize(),
            scale: self.scale * inner.scale,
        })
    }

    pub(super) fn pose(&self) -> Pose {
        Pose { translate: self.translate.as_vec3(), rotate: self.rotate.as_quat().normalize(), scale: self.scale.as_vec3() }
    }
}

impl Transform {
    pub(super) fn matrix(&self) -> DMat4 {
        match self {
            Self::Trs(trs) => trs.matrix(),
            Self::Matrix(matrix) => *matrix,
        }
    }

    /// First `inner`, then this.
    pub(super) fn after(&self, inner: &Self) -> Self {
        if let (Self::Trs(outer), Self::Trs(inner)) = (self, inner)
            && let Some(trs) = outer.after(inner)
        {
            return Self::Trs(trs);
        }
        Self::from_matrix(self.matrix() * inner.matrix())
    }

    /// A matrix, taken apart if its axes are perpendicular.
    pub(super) fn from_matrix(matrix: DMat4) -> Self {
        let (trs, sheared) = nearest(&matrix);
        if sheared { Self::Matrix(matrix) } else { Self::Trs(trs) }
    }

    /// The transform without its shear, and whether it has one.
    pub(super) fn without_shear(&self) -> (Trs, bool) {
        match self {
            Self::Trs(trs) => (*trs, false),
            Self::Matrix(matrix) => (nearest(matrix).0, true),
        }
    }
}

/// A transform with axes of the same lengths, the first of which has the same direction; and whether there is none that is equal. Of a mirror
/// image the first scale is negative.
fn nearest(matrix: &DMat4) -> (Trs, bool) {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|axis| axis.truncate());
    let mut scale = DVec3::new(x.length(), y.length(), z.length());
    let [ux, uy, uz] = [x, y, z].map(DVec3::normalize_or_zero);
    let sheared = [ux.dot(uy), uy.dot(uz), uz.dot(ux)].iter().any(|cosine| cosine.abs() > PERPENDICULAR);
    if ux.dot(uy.cross(uz)) < 0.0 {
        scale.x = -scale.x;
    }
    // Axes of length 0 have no direction: the others say where they are.
    let ux = ux * scale.x.signum();
    let known = |axis: DVec3, other: DVec3| if axis == DVec3::ZERO { other } else { axis };
    let first = known(ux, known(uy.cross(uz), known(uy, uz).any_orthonormal_vector_or_x()));
    let second =
        known((uy - first * uy.dot(first)).normalize_or_zero(), known(uz.cross(first).normalize_or_zero(), first.any_orthonormal_vector()));
    let axes = DMat3::from_cols(first, second, first.cross(second));
    (Trs { translate: matrix.w_axis.truncate(), rotate: DQuat::from_mat3(&axes).normalize(), scale }, sheared)
}

trait OrX {
    fn any_orthonormal_vector_or_x(self) -> DVec3;
}

impl OrX for DVec3 {
    /// A unit vector perpendicular to a unit vector; of no vector, the x axis.
    fn any_orthonormal_vector_or_x(self) -> DVec3 {
        if self == Self::ZERO { Self::X } else { self.any_orthonormal_vector() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trs(scale: [f64; 3], angle: f64) -> Trs {
        let rotate = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), angle);
        Trs { translate: DVec3::new(1.0, -2.0, 3.0), rotate, scale: scale.into() }
    }

    #[test]
    fn matrices_are_taken_apart_also_mirrored_and_flat_ones() {
        for scale in [[1.0, 2.0, 3.0], [-1.0, 2.0, 3.0], [1.0, -2.0, 3.0], [-1.0, -1.0, -1.0], [0.0, 1.0, 2.0], [1.0, 0.0, 0.0], [0.0; 3]] {
            let matrix = trs(scale, 2.0).matrix();
            let Transform::Trs(found) = Transform::from_matrix(matrix) else { panic!("{scale:?} shears") };
            assert!(found.matrix().abs_diff_eq(matrix, 1e-12), "{scale:?}: {found:?}");
        }
    }

    #[test]
    fn products_are_exact_and_shear_is_noticed() {
        let cases = [([2.0; 3], [1.0, 2.0, 3.0], false), ([-2.0; 3], [1.0, 2.0, 3.0], false), ([1.0, 2.0, 3.0], [1.0; 3], true)];
        for (outer, inner, shears) in cases {
            let (outer, inner) = (Transform::Trs(trs(outer, 0.5)), Transform::Trs(trs(inner, -1.0)));
            let product = outer.after(&inner);
            assert_eq!(matches!(product, Transform::Matrix(_)), shears);
            assert!(product.matrix().abs_diff_eq(outer.matrix() * inner.matrix(), 1e-12));
            assert_eq!(product.without_shear().1, shears);
        }
    }
}
