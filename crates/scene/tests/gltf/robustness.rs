//! No bytes make reading panic.

use std::time::Duration;

use manylight_graph::diagnostics::Severity;

use super::build::{Doc, U8};
use crate::{memory::load, mutate::fuzz, robustness::check_scene, support::Random};

/// A file with something of everything.
fn everything() -> (Doc, String) {
    let mut doc = Doc::default();
    doc.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.5]]);
    doc.floats(&[[0.0, 0.0, 1.0]; 4]);
    doc.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]);
    doc.indices(&[0, 1, 2, 2, 1, 3]);
    doc.floats(&[[0.0_f32], [1.0]]);
    doc.floats(&[[0.0, 0.0, 0.0, 1.0], [0.0, 0.6, 0.0, 0.8]]);
    doc.floats(&[[0.0, 0.0, 0.0]; 6]);
    let places = doc.view(&[1, 2], "");
    let values = doc.view(&[0; 24], "");
    doc.raw(&format!(
        "\"componentType\":5126,\"type\":\"VEC3\",\"count\":3,\"bufferView\":0,\"sparse\":{{\"count\":2,\"indices\":{{\"bufferView\":{places},\"componentType\":{U8}}},\"values\":{{\"bufferView\":{values}}}}}"
    ));
    let rest = "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1,\"TEXCOORD_0\":2},\"indices\":3,\"material\":0},\
        {\"attributes\":{\"POSITION\":7},\"mode\":5}]}],\
        \"materials\":[{\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,0.5,0.2,1],\"metallicFactor\":0.3,\"baseColorTexture\":{\"index\":0,\"extensions\":{\"KHR_texture_transform\":{\"rotation\":1}}}}}],\
        \"textures\":[{\"source\":0}],\"images\":[{\"bufferView\":1,\"mimeType\":\"image/png\"}],\
        \"cameras\":[{\"type\":\"perspective\",\"perspective\":{\"yfov\":0.8,\"aspectRatio\":1.5,\"znear\":0.1}}],\
        \"extensions\":{\"KHR_lights_punctual\":{\"lights\":[{\"type\":\"spot\",\"intensity\":50,\"spot\":{\"innerConeAngle\":0.2,\"outerConeAngle\":0.6}},{\"type\":\"directional\"}]}},\
        \"extensionsUsed\":[\"KHR_lights_punctual\"],\
        \"nodes\":[{\"mesh\":0,\"children\":[1,2]},{\"camera\":0,\"translation\":[0,0,5]},{\"mesh\":0,\"scale\":[1,2,-1],\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}}},{\"rotation\":[0,0,0.6,0.8],\"extensions\":{\"KHR_lights_punctual\":{\"light\":1}}}],\
        \"animations\":[{\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"rotation\"}},{\"sampler\":1,\"target\":{\"node\":2,\"path\":\"translation\"}}],\
        \"samplers\":[{\"input\":4,\"output\":5,\"interpolation\":\"LINEAR\"},{\"input\":4,\"output\":6,\"interpolation\":\"CUBICSPLINE\"}]}],\
        \"scenes\":[{\"nodes\":[0,3]}],\"scene\":0";
    (doc, rest.to_owned())
}

/// What stands in place of a number.
const NUMBERS: &[&str] = &[
    "0",
    "1",
    "2",
    "3",
    "7",
    "-1",
    "255",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e38",
    "-1e30",
    "1e-30",
    "0.5",
    "3.2",
    "5121",
    "5123",
    "5126",
    "null",
    "\"x\"",
    "[]",
];

/// The text with numbers replaced, or bytes.
fn damaged(text: &str, random: &mut Random) -> Vec<u8> {
    let mut text = text.to_owned();
    for _ in 0..1 + random.below(3) {
        let bytes = text.as_bytes();
        let starts: Vec<usize> =
            (1..bytes.len()).filter(|i| bytes[*i].is_ascii_digit() && matches!(bytes[*i - 1], b':' | b',' | b'[')).collect();
        let start = *random.of(&starts);
        let length = bytes[start..].iter().take_while(|byte| byte.is_ascii_digit() || **byte == b'.').count();
        text.replace_range(start..start + length, random.of::<&str>(NUMBERS));
    }
    let mut bytes = text.into_bytes();
    if random.below(4) == 0 {
        let at = random.below(bytes.len());
        bytes[at] = random.below(256) as u8;
    }
    bytes
}

fn check(name: &str, bytes: &[u8]) -> bool {
    match load(name, &[(name, bytes)]) {
        Ok(scene) => {
            check_scene(&scene).unwrap_or_else(|fault| panic!("{fault}\n{}", String::from_utf8_lossy(bytes)));
            true
        }
        Err(faults) => {
            for fault in faults.0.iter().filter(|fault| fault.severity == Severity::Error) {
                assert!(fault.message.contains(name) && fault.help.is_some(), "{}", faults.render());
            }
            assert!(faults.has_errors());
            false
        }
    }
}

#[test]
fn files_with_other_numbers_are_used_or_refused_by_name() {
    let (doc, rest) = everything();
    let text = doc.gltf(&rest);
    assert!(check("a.gltf", text.as_bytes()), "it is good as it is");
    fuzz("gltf numbers", 1500, Duration::from_secs(20), move |random: &mut Random| {
        check("a.gltf", &damaged(&text, random));
    });
}

#[test]
fn binary_files_cut_off_or_with_other_bytes_are_used_or_refused_by_name() {
    let (doc, rest) = everything();
    let whole = doc.glb(&rest);
    assert!(check("a.glb", &whole));
    for length in 0..whole.len() {
        assert!(!check("a.glb", &whole[..length]), "{length} bytes");
    }
    let data = whole.len() - doc.bin.len();
    fuzz("glb bytes", 1000, Duration::from_secs(20), move |random: &mut Random| {
        let mut bytes = whole.clone();
        for _ in 0..1 + random.below(4) {
            // The data more often than the rest.
            let at = if random.below(3) == 0 { random.below(bytes.len()) } else { data + random.below(bytes.len() - data) };
            bytes[at] = random.below(256) as u8;
        }
        check("a.glb", &bytes);
    });
}
