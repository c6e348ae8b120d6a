//! Vectors, colours and angles of scene files.

use glam::{EulerRot, Quat, Vec3};
use manylight_graph::ron::{Kind, Reader, Shape, Tree};

/// Numbers beyond this are refused: their squares leave the range of 32-bit floats.
pub(super) const LARGEST: f64 = 1e15;

/// A finite number of usable size that `fault` has nothing to say about.
pub(super) fn checked(reader: &mut Reader, tree: &Tree, fault: impl Fn(f32) -> Option<&'static str>) -> Option<f32> {
    let value = reader.float(tree, "a number")?;
    if value.abs() > LARGEST {
        reader.error(&tree.range, format!("the number {value:e} is too large"), format!("at most {LARGEST:e}"));
        return None;
    }
    let value = value as f32;
    if let Some(help) = fault(value) {
        reader.error(&tree.range, format!("{value} is out of range"), help);
        return None;
    }
    Some(value)
}

/// Three numbers.
fn three(reader: &mut Reader, tree: &Tree, fault: impl Fn(f32) -> Option<&'static str>) -> Option<Vec3> {
    match &tree.kind {
        Kind::Tuple(None, items) if items.len() == 3 => {
            // All three are looked at, so that all faults are told.
            let numbers: Vec<_> = items.iter().map(|item| checked(reader, item, &fault)).collect();
            Some(Vec3::new(numbers[0]?, numbers[1]?, numbers[2]?))
        }
        Kind::Tuple(None, items) => {
            reader.error(&tree.range, format!("expected three numbers, found {}", items.len()), "write `(x, y, z)`");
            None
        }
        _ => {
            reader.expected(tree, "three numbers `(x, y, z)`", "");
            None
        }
    }
}

/// One number for all three, or three.
fn one_or_three(reader: &mut Reader, tree: &Tree, fault: impl Fn(f32) -> Option<&'static str>) -> Option<Vec3> {
    match &tree.kind {
        Kind::Number { .. } => checked(reader, tree, fault).map(Vec3::splat),
        _ => three(reader, tree, fault),
    }
}

/// A point or displacement.
pub(super) fn point(reader: &mut Reader, tree: &Tree) -> Option<Vec3> {
    three(reader, tree, |_| None)
}

/// A direction of any length but 0.
pub(super) fn vector(reader: &mut Reader, tree: &Tree) -> Option<Vec3> {
    let vector = point(reader, tree)?;
    if vector == Vec3::ZERO {
        reader.error(&tree.range, "the direction is zero", "it may have any length but 0");
        return None;
    }
    Some(vector)
}

/// A factor or three.
pub(super) fn scale(reader: &mut Reader, tree: &Tree) -> Option<Vec3> {
    one_or_three(reader, tree, |_| None)
}

/// Intensity or irradiance: grey or RGB.
pub(super) fn strength(reader: &mut Reader, tree: &Tree) -> Option<Vec3> {
    one_or_three(reader, tree, |value| (value < 0.0).then_some("light is not negative"))
}

/// A share of light: grey or RGB.
pub(super) fn albedo(reader: &mut Reader, tree: &Tree) -> Option<Vec3> {
    let help = "a surface reflects between 0 and 1 of the light";
    one_or_three(reader, tree, |value| (!(0.0..=1.0).contains(&value)).then_some(help))
}

/// Half-angle of a cone in degrees.
pub(super) fn angle(reader: &mut Reader, tree: &Tree) -> Option<f32> {
    let help = "a half-angle of a spot light is at least 0 and below 90 degrees";
    checked(reader, tree, |value| (!(0.0..90.0).contains(&value)).then_some(help))
}

const AXIS_ANGLE: Shape = Shape { what: "a rotation", required: &["axis", "angle"], optional: &[] };

/// `(axis: (x, y, z), angle: degrees)`, or degrees about x, then y, then z (axes of the world). The second value is axis and angle if
/// written so.
pub(super) fn rotation(reader: &mut Reader, tree: &Tree) -> Option<(Quat, Option<(Vec3, f32)>)> {
    if let Kind::Record(..) = tree.kind {
        let fields = reader.record(tree, &AXIS_ANGLE)?;
        let axis = fields.get("axis").and_then(|tree| vector(reader, tree));
        let angle = fields.get("angle").and_then(|tree| checked(reader, tree, |_| None));
        let (axis, angle) = (axis?.as_dvec3().normalize().as_vec3(), angle?);
        return Some((Quat::from_axis_angle(axis, angle.to_radians()), Some((axis, angle))));
    }
    let angles = three(reader, tree, |_| None)?;
    let [x, y, z] = angles.to_array().map(f32::to_radians);
    Some((Quat::from_euler(EulerRot::ZYX, z, y, x), None))
}
