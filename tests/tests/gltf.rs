//! glTF files on the command line.

use std::{fs, path::Path};

use crate::support::{manylight, manylight_in};

/// A floor and a wall, the same as OBJ with its materials and as glTF with its buffer.
fn write_both(folder: &Path) {
    let corners: [[f32; 3]; 6] =
        [[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0], [1.0, 2.0, -1.0], [-1.0, 2.0, -1.0]];
    let faces: [[u16; 3]; 4] = [[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]];
    let vertex = |[x, y, z]: &[f32; 3]| format!("v {x} {y} {z}\n");
    let face = |[a, b, c]: &[u16; 3]| format!("f {} {} {}\n", a + 1, b + 1, c + 1);
    let obj: String = corners.iter().map(vertex).chain(faces.iter().map(face)).collect();
    fs::write(folder.join("a.obj"), format!("mtllib a.mtl\nusemtl clay\n{obj}")).expect("written");
    // Roughness 0.5: α = 0.25, 2/0.0625 − 2.
    fs::write(folder.join("a.mtl"), "newmtl clay\nKd 0.5 0.25 0.75\nKs 0.04 0.04 0.04\nNs 30\n").expect("written");
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    bytes.extend(faces.iter().flatten().flat_map(|i| i.to_le_bytes()));
    fs::write(folder.join("a.bin"), bytes).expect("written");
    let json = r#"{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 96}],
        "bufferViews": [{"buffer": 0, "byteLength": 72}, {"buffer": 0, "byteOffset": 72, "byteLength": 24}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 6}, {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 12}],
        "materials": [{"name": "clay", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 0.75, 1], "metallicFactor": 0, "roughnessFactor": 0.5}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}], "nodes": [{"mesh": 0}]}"#;
    fs::write(folder.join("a.gltf"), json).expect("written");
}

#[test]
fn a_gltf_file_gives_the_picture_of_the_same_obj() {
    let folder = tempfile::tempdir().expect("a folder");
    write_both(folder.path());
    let pictures = ["obj", "gltf"].map(|kind| {
        let file = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
        let (scene, out) = (file(&format!("a.{kind}")), file(&format!("{kind}.png")));
        manylight(&["render", "acrsm", "--scene", &scene, "--size", "64x64", "--frames", "1", "--out", &out])
            .expect(0)
            .says(&["no camera"]);
        fs::read(out).expect("a picture")
    });
    assert!(pictures[0] == pictures[1], "the pictures differ");
}

#[test]
fn check_reads_gltf_files() {
    let folder = tempfile::tempdir().expect("a folder");
    write_both(folder.path());
    manylight_in(folder.path(), &["check", "a.gltf"]).expect(0).says(&["checked 1 scene"]);
    fs::remove_file(folder.path().join("a.bin")).expect("removed");
    manylight_in(folder.path(), &["check", "a.gltf"]).expect(1).says(&[
        "buffers[0]: cannot read",
        "a.bin",
        "keep the files of a `.gltf` together",
    ]);
}
