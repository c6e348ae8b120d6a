//! Materials from MTL files.

use std::{collections::HashMap, fmt::Write, ops::Range};

use glam::Vec3;

use super::{DEFAULT_SHININESS, faults::Faults};

/// A material as the file has it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct MtlMaterial {
    pub(super) diffuse: Option<Vec3>,
    pub(super) specular: Vec3,
    pub(super) shininess: f32,
    /// As written after `map_Kd`, without its options.
    pub(super) texture: Option<String>,
    /// Where `map_Kd` (or else the material) stands.
    pub(super) place: Range<usize>,
}

/// Materials by name.
pub(super) type MtlMaterials = HashMap<String, MtlMaterial>;

/// Reads a text.
pub(super) fn read(text: &str, faults: &mut Faults) -> MtlMaterials {
    let (clean, places) = clean(text, faults);
    // What is left is well formed; a parser that still refuses it gives no materials, which is reported where they are used.
    let Ok((materials, _)) = tobj::load_mtl_buf(&mut clean.as_bytes()) else {
        return MtlMaterials::new();
    };
    let convert = |material: tobj::Material| {
        let place = material.name.parse::<usize>().ok().and_then(|index| places.get(index)).cloned();
        let (name, place) = place.unwrap_or_default();
        let matt = material.illumination_model.is_some_and(|model| model < 2);
        let specular = material.specular.filter(|_| !matt).map_or(Vec3::ZERO, Vec3::from_array);
        let shininess = material.shininess.unwrap_or(DEFAULT_SHININESS);
        let diffuse = material.diffuse.map(Vec3::from_array);
        (name, MtlMaterial { diffuse, specular, shininess, texture: material.diffuse_texture, place })
    };
    materials.into_iter().map(convert).collect()
}

/// The lines that the parser needs and takes, with materials numbered; and their names and places.
fn clean(text: &str, faults: &mut Faults) -> (String, Vec<(String, Range<usize>)>) {
    let mut clean = String::with_capacity(text.len());
    let mut materials: Vec<(String, Range<usize>)> = Vec::new();
    let mut offset = 0;
    for whole in text.split_inclusive('\n') {
        let start = offset + (whole.len() - whole.trim_start().len());
        offset += whole.len();
        let line = whole.trim();
        let place = start.min(offset)..(start + line.len()).min(offset);
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if keyword == "newmtl" {
            let _ = writeln!(clean, "newmtl {}", materials.len());
            materials.push((rest.to_owned(), place));
            continue;
        }
        let Some(material) = materials.last_mut() else {
            if matches!(keyword, "Kd" | "Ks" | "Ns" | "map_Kd") {
                faults.add("{} lines stand before the first `newmtl` and are left out", "every property belongs to a material", place);
            }
            continue;
        };
        // Writing to a string cannot fail.
        let _ = match keyword.to_ascii_lowercase().as_str() {
            "kd" | "ks" => match colour(rest, faults, &place) {
                Some([r, g, b]) => writeln!(clean, "{} {r} {g} {b}", if keyword.ends_with(['d', 'D']) { "Kd" } else { "Ks" }),
                None => Ok(()),
            },
            "ns" => match rest.parse::<f32>() {
                Ok(ns) if ns.is_finite() && ns >= 0.0 => writeln!(clean, "Ns {ns}"),
                _ => {
                    faults.add("{} exponents `Ns` are not numbers of at least 0", "the default is used instead", place);
                    Ok(())
                }
            },
            "illum" => match rest.parse::<u8>() {
                Ok(model) => writeln!(clean, "illum {model}"),
                Err(_) => Ok(()),
            },
            "map_kd" => {
                let file = without_options(rest);
                if file.is_empty() {
                    faults.add("{} textures `map_Kd` have no file name", "the material has no texture", place);
                    Ok(())
                } else {
                    material.1 = place;
                    writeln!(clean, "map_Kd {file}")
                }
            }
            "map_ks" | "map_ns" | "map_bump" | "bump" | "map_d" | "map_ke" | "norm" => {
                faults.add("{} textures other than `map_Kd` are left out", "only diffuse textures are supported", place);
                Ok(())
            }
            "ke" if colour(rest, &mut Faults::default(), &place).is_some_and(|ke| ke != [0.0; 3]) => {
                faults.add("{} materials emit light, which is left out", "lights are spots named in the scene file", place);
                Ok(())
            }
            _ => Ok(()),
        };
    }
    (clean, materials)
}

/// One or three numbers in 0…1; others are clamped, or left out if they are no numbers.
fn colour(text: &str, faults: &mut Faults, place: &Range<usize>) -> Option<[f32; 3]> {
    let numbers: Result<Vec<f32>, _> = text.split_whitespace().take(3).map(str::parse).collect();
    let rgb = match numbers.as_deref() {
        Ok([grey]) => [*grey; 3],
        Ok([r, g, b]) => [*r, *g, *b],
        _ => [f32::NAN; 3],
    };
    if rgb.iter().any(|c| c.is_nan()) {
        faults.add("{} colours are not three numbers and are left out", "RGB colours only: no spectra, no CIE XYZ", place.clone());
        return None;
    }
    if rgb.iter().any(|c| !(0.0..=1.0).contains(c)) {
        faults.add("{} colours are outside of 0…1 and are clamped", "a surface cannot reflect more light than it gets", place.clone());
    }
    Some(rgb.map(|c| c.clamp(0.0, 1.0)))
}

/// The file name after options such as `-s 1 1 1` or `-clamp on`.
fn without_options(text: &str) -> &str {
    let mut rest = text;
    while rest.starts_with('-') {
        let next = |text: &mut &str| {
            let (_, tail) = text.split_once(char::is_whitespace).unwrap_or(("", ""));
            *text = tail.trim_start();
        };
        let numbers = rest.starts_with("-s ") || rest.starts_with("-o ") || rest.starts_with("-t ") || rest.starts_with("-mm ");
        next(&mut rest);
        if numbers {
            while rest.split_whitespace().next().is_some_and(|word| word.parse::<f32>().is_ok()) && rest.contains(char::is_whitespace) {
                next(&mut rest);
            }
        } else {
            next(&mut rest);
        }
    }
    rest
}
