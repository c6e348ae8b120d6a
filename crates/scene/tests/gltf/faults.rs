//! What a file cannot be.

use super::build::{ONE, glb, gltf, triangle};
use crate::memory::{assert_says, load};

#[track_caller]
fn refused(text: &str, words: &[&str]) {
    let fault = gltf(text).expect_err("it is refused");
    assert!(fault.0.iter().filter(|fault| fault.help.is_none() && fault.message.contains("a.gltf")).count() == 0, "no remedy: {fault}");
    assert_says(&fault, "", &[&["`a.gltf`"], words].concat());
}

#[test]
fn files_that_are_no_gltf_are_refused_with_a_remedy() {
    refused("", &["not a glTF file", "EOF"]);
    refused("{\"asset\": {\"version\": \"2.0\"},,}", &["not a glTF file", "key must be a string"]);
    assert_says(&gltf("{\n \"asset\": }").unwrap_err(), "}", &["expected value"]);
    refused("[]", &["no `asset.version`"]);
    refused("{\"asset\":{\"version\":\"1.0\"}}", &["it is glTF 1.0", "convert it"]);
    refused("{\"asset\":{\"version\":\"2.1\",\"minVersion\":\"2.1\"}}", &["it is glTF 2.1"]);
    refused("{\"asset\":{\"version\":\"2.0\"}}", &["holds no triangle", "a node with a mesh"]);
    refused("{\"asset\":{\"version\":\"2.0\"},\"nodes\":7}", &["invalid type: integer `7`"]);
    assert_says(&gltf("{\"asset\":{\"version\":\"2.0\"},\n\"nodes\":[{\"mesh\":\"a\"}]}").unwrap_err(), "\"", &["invalid type: string"]);
    assert_says(&load::<&str>("gone.glb", &[]).unwrap_err(), "", &["cannot read `gone.glb`: no such file"]);
}

#[test]
fn names_of_what_does_not_exist_are_refused_with_their_path() {
    let text = triangle().gltf(ONE);
    for (from, to, words) in [
        ("\"POSITION\":0", "\"POSITION\":9", "meshes[0].primitives[0].attributes: accessors[9] does not exist"),
        ("\"POSITION\":0", "\"NORMAL\":0", "meshes[0].primitives[0].attributes[\"POSITION\"] is missing"),
        ("\"mesh\":0", "\"mesh\":3", "nodes[0].mesh names something that does not exist"),
        ("\"material\":0", "\"material\":1", "meshes[0].primitives[0].material names something"),
        ("\"bufferView\":0", "\"bufferView\":1", "accessors[0].bufferView names something"),
        ("\"buffer\":0", "\"buffer\":1", "bufferViews[0].buffer names something"),
        ("5126", "77", "accessors[0].componentType has a value that glTF does not know"),
        ("VEC3", "VEC9", "accessors[0].type has a value"),
        ("VEC3", "VEC2", "accessors[0] has 2 numbers an element, not 3"),
        ("\"count\":3", "\"count\":4", "accessors[0] has 4 elements, which go beyond the end of its buffer view"),
        ("\"count\":3", "\"count\":18446744073709551615", "go beyond the end"),
        ("\"byteLength\":36}]", "\"byteLength\":37}]", "buffers[0] has 36 bytes of 37"),
        ("\"byteLength\":36}],\"accessors", "\"byteLength\":37}],\"accessors", "bufferViews[0] goes beyond the end of buffers[0]"),
        ("\"bufferView\":0", "\"byteOffset\":0", "accessors[0].bufferView is missing"),
        ("\"mesh\":0", "\"mesh\":0,\"translation\":[1e30,0,0]", "nodes[0] is too far away"),
        ("base64,", "base64,!", "buffers[0]: its base64 data is faulty"),
        ("data:application/octet-stream;base64,", "https://example.org/", "is not a file beside it"),
        ("data:application/octet-stream;base64,", "data:", "a data URI without data"),
        ("\"uri\"", "\"url\"", "buffers[0] has no data"),
        ("\"mode\":4", "\"mode\":4", ""),
    ] {
        if words.is_empty() {
            assert!(gltf(&text).is_ok());
            continue;
        }
        assert!(text.contains(from), "{from}");
        let last = text.rfind(from).unwrap();
        // The last one, as buffers stand first and views after them.
        let changed = if from.starts_with("\"byteLength\":36}]") {
            text.replacen(from, to, 1)
        } else {
            format!("{}{to}{}", &text[..last], &text[last + from.len()..])
        };
        refused(&changed, &[words]);
    }
    let beside = triangle().beside(ONE, "gone.bin");
    refused(&beside, &["buffers[0]: cannot read `gone.bin`: no such file", "keep the files of a `.gltf` together"]);
}

#[test]
fn extensions_that_a_file_needs_are_refused_with_what_to_do() {
    for (name, remedy) in [
        ("KHR_draco_mesh_compression", "without compression"),
        ("EXT_meshopt_compression", "without compression"),
        ("KHR_texture_basisu", "PNG or JPEG"),
        ("KHR_materials_pbrSpecularGlossiness", "metalrough"),
        ("EXT_mesh_gpu_instancing", "every instance as a node"),
        ("X_private", "without this extension"),
    ] {
        refused(&triangle().gltf(&format!("\"extensionsRequired\":[\"{name}\"],{ONE}")), &["cannot be read without", name, remedy]);
    }
    let scene = gltf(
        &triangle().gltf(&format!("\"extensionsRequired\":[\"KHR_materials_unlit\"],\"extensionsUsed\":[\"KHR_materials_unlit\"],{ONE}")),
    );
    assert_says(&scene.unwrap().warnings, "", &["`KHR_materials_unlit` is left out"]);
}

#[test]
fn nodes_form_a_tree() {
    let nodes = |nodes: &str| triangle().gltf(&ONE.replace("\"nodes\":[{\"mesh\":0}]", &format!("\"nodes\":[{nodes}]")));
    for ring in ["{\"mesh\":0,\"children\":[0]}", "{\"mesh\":0,\"children\":[1]},{\"children\":[0]}"] {
        refused(&nodes(ring), &["has several parents, or is below itself"]);
    }
    refused(&nodes("{\"mesh\":0},{\"children\":[0]},{\"children\":[0]}"), &["nodes[0] has several parents"]);
    // A long chain is walked without recursion.
    let chain: Vec<String> = (1..20_000).map(|i| format!("{{\"children\":[{i}]}}")).chain(["{\"mesh\":0}".to_owned()]).collect();
    assert_eq!(gltf(&nodes(&chain.join(","))).unwrap().triangle_count(), 1);
}

#[test]
fn what_is_left_out_of_a_mesh_is_told() {
    let with = |primitive: &str, node: &str| {
        let rest = format!(
            "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}},\"material\":0}},{{{primitive}}}]}}],\"materials\":[{{}}],\"nodes\":[{{\"mesh\":0{node}}}],\"skins\":[{{\"joints\":[0]}}]"
        );
        let mut doc = triangle();
        doc.floats(&[[0.0, 0.0, 2.0], [1.0, 0.0, 2.0], [0.0, 1.0, 2.0], [0.0, 3.0, 2.0]]);
        doc.indices(&[0, 1, 2, 0, 1, 9, 3]);
        doc.floats(&[[f32::NAN, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]);
        gltf(&doc.gltf(&rest)).unwrap_or_else(|faults| panic!("{faults}"))
    };
    let cases = [
        ("\"attributes\":{\"POSITION\":1},\"mode\":0", "", "meshes[0].primitives[1].mode: points and lines are left out"),
        ("\"attributes\":{\"POSITION\":1,\"COLOR_0\":1}", "", "meshes[0].primitives[1].attributes.COLOR_0: colours of vertices"),
        ("\"attributes\":{\"POSITION\":1,\"_MINE\":1}", "", "meshes[0].primitives[1].attributes: vertex attributes of names"),
        ("\"attributes\":{\"POSITION\":1},\"targets\":[{\"POSITION\":1}]", "", "meshes[0].primitives[1].targets: morph targets"),
        ("\"attributes\":{\"POSITION\":1},\"indices\":2", "", "meshes[0].primitives[1].indices: triangles of vertices that do not exist"),
        ("\"attributes\":{\"POSITION\":1},\"indices\":2", "", "meshes[0].primitives[1]: vertices that are over"),
        ("\"attributes\":{\"POSITION\":1,\"NORMAL\":3}", "", "normals that are not finite count as 0"),
        ("\"attributes\":{\"POSITION\":1}", ",\"skin\":0", "nodes[0].skin: skins are left out"),
        ("\"attributes\":{\"POSITION\":1}", ",\"rotation\":[0,0,0,0]", "nodes[0].rotation: rotations that are no unit quaternions"),
        ("\"attributes\":{\"POSITION\":1}", ",\"matrix\":[1,0,0,1,0,1,0,0,0,0,1,0,0,0,0,1]", "nodes[0].matrix: the last rows"),
    ];
    for (primitive, node, words) in cases {
        assert_says(&with(primitive, node).warnings, "", &["`a.gltf`: ", words]);
    }
    let broken = triangle().gltf(&ONE.replace("\"POSITION\":0", "\"POSITION\":0,\"NORMAL\":1"));
    let broken = broken.replace("],\"meshes\"", ",{\"componentType\":5126,\"type\":\"VEC3\",\"count\":2,\"bufferView\":0}],\"meshes\"");
    refused(&broken, &["meshes[0].primitives[0]: accessors[1] has 2 elements for 3 vertices"]);
}

#[test]
fn binary_files_cut_off_or_of_other_versions_are_refused() {
    let whole = triangle().glb(ONE);
    let refused =
        |bytes: &[u8], words: &[&str]| assert_says(&load("a.glb", &[("a.glb", bytes)]).unwrap_err(), "", &[&["`a.glb`"], words].concat());
    refused(&whole[..whole.len() - 8], &["shorter than it says", "cut off"]);
    refused(&whole[..10], &["shorter than it says"]);
    let mut lying = whole.clone();
    lying[8..12].copy_from_slice(&4_u32.to_le_bytes());
    refused(&lying, &["shorter than it says"]);
    let mut old = whole.clone();
    old[4] = 1;
    refused(&old, &["binary glTF of version 1"]);
    let mut odd = whole;
    odd[16] = b'X';
    refused(&odd, &["not a binary glTF file: unknown chunk type"]);
    refused(&glb(triangle().glb(ONE).as_slice(), None), &["not a glTF file"]);
}
