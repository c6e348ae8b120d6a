//! Bytes of texels and elements as numbers.

use std::collections::BTreeMap;

use manylight_graph::{
    shader::{Layout, MemberKind, Scalar},
    value::{Encoding, Format},
};
use serde_json::{Map, Value};

/// Appends the numbers of one texel.
pub(crate) fn decode_texel(format: Format, encoding: Encoding, texel: &[u8], to: &mut Vec<f32>) {
    let words = || texel.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    let halves = || texel.chunks_exact(2).map(|b| half_to_f32(u16::from_le_bytes([b[0], b[1]])));
    match format {
        Format::R8Unorm | Format::Rgba8Unorm => {
            to.extend(texel.iter().map(|b| f32::from(*b) / 255.0));
        }
        Format::Rgba8UnormSrgb => {
            for (i, b) in texel.iter().enumerate() {
                let v = f32::from(*b) / 255.0;
                to.push(if i == 3 { v } else { srgb_to_linear(v) });
            }
        }
        Format::R16Float | Format::Rg16Float | Format::Rgba16Float => to.extend(halves()),
        Format::R32Float | Format::Rg32Float | Format::Rgba32Float | Format::Depth32Float => {
            to.extend(words().map(f32::from_bits));
        }
        Format::R32Uint if encoding == Encoding::Octahedral => {
            words().for_each(|w| to.extend(octahedral(w)));
        }
        Format::R32Uint | Format::Rg32Uint | Format::Rgba32Uint => {
            to.extend(words().map(|w| w as f32));
        }
    }
}

/// The unit vector of an octahedral code (x in the low half), or zero for the code 0, which stands for "none": the twin of
/// `shaders/common/octahedral.wgsl`, where the spare code −32768 of the first component stands in for 0 so that +z has a code.
pub fn octahedral(code: u32) -> [f32; 3] {
    match code {
        0 => return [0.0; 3],
        0x8000 => return [0.0, 0.0, 1.0],
        _ => {}
    }
    let snorm = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).max(-1.0);
    let (x, y) = (snorm(code & 0xffff), snorm(code >> 16));
    let z = 1.0 - x.abs() - y.abs();
    let (x, y) = if z < 0.0 { ((1.0 - y.abs()).copysign(x), (1.0 - x.abs()).copysign(y)) } else { (x, y) };
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

fn srgb_to_linear(v: f32) -> f32 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// IEEE 754 binary16 to binary32.
fn half_to_f32(bits: u16) -> f32 {
    let sign = if bits & 0x8000 == 0 { 1.0 } else { -1.0 };
    let exponent = i32::from(bits >> 10 & 0x1f);
    let mantissa = f32::from(bits & 0x3ff);
    sign * match exponent {
        0 => mantissa * 2f32.powi(-24),
        31 if mantissa == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        _ => (1.0 + mantissa / 1024.0) * 2f32.powi(exponent - 15),
    }
}

/// The elements of a buffer as JSON.
pub(crate) fn elements_to_json(bytes: &[u8], element: &str, stride: u32, layouts: &BTreeMap<String, Layout>) -> Vec<Value> {
    bytes.chunks_exact(stride.max(1) as usize).map(|bytes| structure(bytes, element, layouts)).collect()
}

fn structure(bytes: &[u8], name: &str, layouts: &BTreeMap<String, Layout>) -> Value {
    let Some(layout) = layouts.get(name) else {
        return Value::Null;
    };
    if let [only] = layout.members.as_slice()
        && only.name.is_empty()
    {
        return member(bytes, &only.kind, layouts);
    }
    let field = |m: &manylight_graph::shader::Member| {
        let rest = bytes.get(m.offset as usize..).unwrap_or_default();
        (m.name.clone(), member(rest, &m.kind, layouts))
    };
    Value::Object(layout.members.iter().map(field).collect::<Map<_, _>>())
}

fn member(bytes: &[u8], kind: &MemberKind, layouts: &BTreeMap<String, Layout>) -> Value {
    match kind {
        MemberKind::Struct(name) => structure(bytes, name, layouts),
        MemberKind::Array { of, count, stride } => {
            let at = |i| bytes.get((i * stride) as usize..).unwrap_or_default();
            (0..*count).map(|i| member(at(i), of, layouts)).collect()
        }
        MemberKind::Numeric { scalar, rows, columns, column_stride } => {
            let number = |at: u32| scalar_to_json(bytes, at as usize, *scalar);
            let column = |c: u32| (0..*rows).map(|r| number(c * column_stride + 4 * r)).collect::<Value>();
            match (rows, columns) {
                (1, 1) => number(0),
                (_, 1) => column(0),
                _ => (0..*columns).map(column).collect(),
            }
        }
    }
}

fn scalar_to_json(bytes: &[u8], at: usize, scalar: Scalar) -> Value {
    let Some(word) = bytes.get(at..at + 4).and_then(|b| b.try_into().ok()) else {
        return Value::Null;
    };
    match scalar {
        Scalar::U32 => u32::from_le_bytes(word).into(),
        Scalar::I32 => i32::from_le_bytes(word).into(),
        Scalar::Bool => (u32::from_le_bytes(word) != 0).into(),
        Scalar::F32 => {
            let v = f32::from_le_bytes(word);
            if v.is_finite() {
                // The shortest decimal of the 32-bit float, not of its 64-bit neighbour.
                let short: f64 = v.to_string().parse().unwrap_or_else(|_| f64::from(v));
                short.into()
            } else {
                v.to_string().into()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_exact() {
        let known = [(0x0000, 0.0), (0x3c00, 1.0), (0xc000, -2.0), (0x3555, 0.333_251_95), (0x0001, 5.960_464_5e-8), (0x7bff, 65504.0)];
        for (bits, value) in known {
            assert_eq!(half_to_f32(bits), value, "{bits:04x}");
        }
        assert_eq!(half_to_f32(0xfc00), f32::NEG_INFINITY);
        assert!(half_to_f32(0x7e00).is_nan());
    }

    #[test]
    fn octahedral_codes_are_unit_vectors_and_zero_is_none() {
        assert_eq!(octahedral(0), [0.0; 3]);
        assert_eq!(octahedral(0x0000_7fff), [1.0, 0.0, 0.0]);
        assert_eq!(octahedral(0x7fff_0000), [0.0, 1.0, 0.0]);
        assert_eq!(octahedral(0x0000_8000), [0.0, 0.0, 1.0]);
        // All of −z lies at the corners.
        let [x, y, z] = octahedral(0x7fff_7fff);
        assert!(x.abs() < 1e-4 && y.abs() < 1e-4 && (z + 1.0).abs() < 1e-6);
    }

    #[test]
    fn numbers_that_json_lacks_become_texts() {
        let word = |v: f32| scalar_to_json(&v.to_le_bytes(), 0, Scalar::F32);
        assert_eq!(word(f32::NAN), Value::from("NaN"));
        assert_eq!(word(f32::INFINITY), Value::from("inf"));
        assert_eq!(word(f32::NEG_INFINITY), Value::from("-inf"));
        assert_eq!(word(0.1).to_string(), "0.1");
    }
}
