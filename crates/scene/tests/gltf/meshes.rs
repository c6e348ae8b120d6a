//! Meshes, buffers and transforms.

use glam::{DMat4, DQuat, DVec3, Vec3};
use manylight_scene::Scene;

use super::build::{Doc, ONE, U8, U16, U32, corners, glb, gltf, triangle};
use crate::memory::{assert_says, load, summary};

/// Positions and texture coordinates of all corners.
fn seen(scene: &Scene) -> Vec<[(Vec3, f32, f32); 3]> {
    let mesh = &scene.meshes[0];
    let corner = |i: u32| {
        let vertex = mesh.vertices[i as usize];
        (vertex.position, vertex.u, vertex.v)
    };
    mesh.triangles.iter().map(|triangle| triangle.vertices.map(corner)).collect()
}

const CUBE: &str = "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"indices\":2,\"material\":0}]}],\
    \"materials\":[{\"name\":\"block\"}],\"nodes\":[{\"mesh\":0,\"name\":\"cube\"}],\"scenes\":[{\"nodes\":[0]}],\"scene\":0";

#[test]
fn a_cube_is_the_one_of_the_assets_however_its_data_is_kept() {
    let obj = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/cube.obj")).unwrap();
    let mesh = &obj.meshes[0];
    let mut doc = Doc::default();
    doc.floats(&mesh.vertices.iter().map(|vertex| vertex.position.to_array()).collect::<Vec<_>>());
    doc.floats(&mesh.vertices.iter().map(|vertex| [vertex.u, vertex.v]).collect::<Vec<_>>());
    doc.indices(&mesh.triangles.iter().flat_map(|triangle| triangle.vertices.map(|i| i as u16)).collect::<Vec<_>>());
    let scenes = [
        gltf(&doc.gltf(CUBE)).unwrap(),
        load("d/a.glb", &[("d/a.glb", doc.glb(CUBE))]).unwrap(),
        load("d/a.GLTF", &[("d/a.GLTF", doc.beside(CUBE, "my%20data.bin").into_bytes()), ("d/my data.bin", doc.bin.clone())]).unwrap(),
        load("s.ron", &[("s.ron", b"Scene(meshes: [Mesh(file: \"a.glb\", name: \"cube\")])".to_vec()), ("a.glb", doc.glb(CUBE))]).unwrap(),
    ];
    for scene in &scenes {
        assert_eq!(scene.triangle_count(), 12);
        assert_eq!(seen(scene), seen(&obj));
        assert_eq!((scene.objects[0].name.as_str(), scene.materials[0].name.as_str()), ("cube", "block"));
        assert!(scene.meshes[0].vertices.iter().all(|vertex| vertex.normal == Vec3::ZERO), "faceted");
        // A camera and a light are fitted, and nothing is lost.
        assert_eq!(scene.warnings.0.len(), 2, "{:?}", summary(&scene.warnings));
    }
    let sources: Vec<_> = scenes[2].sources.iter().map(|path| path.to_string_lossy()).collect();
    assert_eq!(sources, ["d/a.GLTF", "d/my data.bin"]);
    let mut other = doc.bin.clone();
    other[0] ^= 1;
    let changed = load("d/a.GLTF", &[("d/a.GLTF", doc.beside(CUBE, "my%20data.bin").into_bytes()), ("d/my data.bin", other)]).unwrap();
    assert_ne!(changed.hash, scenes[2].hash);
}

/// A mesh of one primitive of four points in a square.
fn square(mode: u32, indices: &str, doc: &mut Doc) -> Scene {
    let rest = format!(
        "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}},\"mode\":{mode}{indices},\"material\":0}}]}}],\"materials\":[{{}}],\"nodes\":[{{\"mesh\":0}}]"
    );
    gltf(&doc.gltf(&rest)).unwrap_or_else(|faults| panic!("{faults}"))
}

#[test]
fn triangles_strips_and_fans_go_round_the_same_way() {
    let square_of = || {
        let mut doc = Doc::default();
        doc.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]);
        doc
    };
    let fan: Vec<u8> = vec![0, 1, 3, 2];
    let long: Vec<u8> = [0_u32, 1, 2, 2, 1, 3].iter().flat_map(|i| i.to_le_bytes()).collect();
    let mut cases = Vec::new();
    cases.push(square(5, "", &mut square_of()));
    let mut doc = square_of();
    let index = doc.accessor(&fan, U8, "SCALAR", 4, "");
    cases.push(square(6, &format!(",\"indices\":{index}"), &mut doc));
    let mut doc = square_of();
    let index = doc.accessor(&long, U32, "SCALAR", 6, "");
    cases.push(square(4, &format!(",\"indices\":{index}"), &mut doc));
    for scene in cases {
        assert_eq!(scene.triangle_count(), 2);
        for [a, b, c] in corners(&scene, 0.0) {
            assert_eq!((b - a).cross(c - a), DVec3::Z);
        }
    }
}

#[test]
fn numbers_may_be_short_apart_or_sparse() {
    // Quantized positions, 8 bytes apart; their node scales them.
    let mut doc = Doc::default();
    let shorts: Vec<u8> = [[0_i16, 0, 0, 9], [32767, 0, 0, 9], [0, 32767, 0, 9]].iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let view = doc.view(&shorts, ",\"byteStride\":8");
    doc.raw(&format!("\"bufferView\":{view},\"componentType\":5122,\"normalized\":true,\"type\":\"VEC3\",\"count\":3"));
    let bytes: Vec<u8> = [[0_i8, 0, 127, 1], [0, 0, 127, 1], [0, -128, 0, 1]].iter().flatten().map(|x| *x as u8).collect();
    let view = doc.view(&bytes, ",\"byteStride\":4");
    doc.raw(&format!("\"bufferView\":{view},\"componentType\":5120,\"normalized\":true,\"type\":\"VEC3\",\"count\":3"));
    let words: Vec<u8> = [[0_u16, 65535], [32768, 0], [1, 2]].iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    doc.accessor(&words, U16, "VEC2", 3, ",\"normalized\":true");
    let rest = "\"extensionsUsed\":[\"KHR_mesh_quantization\"],\"extensionsRequired\":[\"KHR_mesh_quantization\"],\
        \"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"NORMAL\":1,\"TEXCOORD_0\":2},\"material\":0}]}],\"materials\":[{}],\
        \"nodes\":[{\"mesh\":0,\"scale\":[2,2,2]}]";
    let scene = gltf(&doc.gltf(rest)).unwrap();
    assert_eq!(corners(&scene, 0.0), [[DVec3::ZERO, 2.0 * DVec3::X, 2.0 * DVec3::Y]]);
    let vertices = &scene.meshes[0].vertices;
    assert_eq!((vertices[0].normal, vertices[2].normal), (Vec3::Z, Vec3::NEG_Y));
    assert_eq!((vertices[1].u, vertices[0].v, vertices[2].u), (32768.0 / 65535.0, 1.0, 1.0 / 65535.0));

    // All zeros but for two vertices.
    let mut doc = Doc::default();
    let places = doc.view(&[1, 2], "");
    let values: Vec<u8> = [[3.0_f32, 0.0, 0.0], [0.0, 4.0, 0.0]].iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    let values = doc.view(&values, "");
    doc.raw(&format!(
        "\"componentType\":5126,\"type\":\"VEC3\",\"count\":3,\"sparse\":{{\"count\":2,\"indices\":{{\"bufferView\":{places},\"componentType\":5121}},\"values\":{{\"bufferView\":{values}}}}}"
    ));
    assert_eq!(corners(&gltf(&doc.gltf(ONE)).unwrap(), 0.0), [[DVec3::ZERO, 3.0 * DVec3::X, 4.0 * DVec3::Y]]);
}

/// A triangle under nodes.
fn placed(nodes: &str) -> Scene {
    let rest = format!(
        "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0,\"NORMAL\":1}},\"material\":0}}]}}],\"materials\":[{{}}],\"nodes\":[{nodes}]"
    );
    let mut doc = triangle();
    doc.floats(&[[0.0, 0.0, 1.0]; 3]);
    gltf(&doc.gltf(&rest)).unwrap_or_else(|faults| panic!("{faults}"))
}

fn assert_placed(scene: &Scene, world: DMat4) {
    let expected = [DVec3::ZERO, DVec3::X, DVec3::Y].map(|corner| world.transform_point3(corner));
    let mut found = corners(scene, 0.0)[0];
    let normal_from_object = scene.sample(0.0).objects[0].normal_from_object;
    let normal = normal_from_object.transform_vector3(scene.meshes[0].vertices[0].normal).as_dvec3().normalize();
    let expected_normal = (world.inverse().transpose() * DVec3::Z.extend(0.0)).truncate().normalize();
    assert!(normal.distance(expected_normal) < 1e-5, "{normal} {expected_normal}");
    // The vertices of a sheared mirror image are baked, the other way round so that its front stays in front.
    if found[1].distance(expected[1]) > 1e-5 {
        found.swap(1, 2);
        assert!((found[1] - found[0]).cross(found[2] - found[0]).dot(expected_normal) < 0.0);
    }
    for (found, expected) in found.into_iter().zip(expected) {
        assert!(found.distance(expected) < 1e-5, "{found} {expected}");
    }
}

#[test]
fn nodes_are_where_all_above_them_put_them() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let turn = DQuat::from_xyzw(0.0, half, 0.0, half);
    let outer = DMat4::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::new(1.0, 2.0, 3.0));
    let inner = DMat4::from_scale_rotation_translation(DVec3::new(1.0, 3.0, -2.0), turn, DVec3::X);
    let trs =
        |children: &str, scale: &str| format!("{{\"translation\":[1,2,3],\"rotation\":[0,{half},0,{half}],\"scale\":{scale},{children}}}");
    let child = format!("{{\"mesh\":0,\"translation\":[1,0,0],\"rotation\":[0,{half},0,{half}],\"scale\":[1,3,-2]}}");
    assert_placed(&placed(&format!("{},{child}", trs("\"children\":[1]", "[2,2,2]"))), outer * inner);
    // The same by a matrix, a mirrored node, and one that shears.
    let columns = outer.to_cols_array().map(|x| x.to_string()).join(",");
    assert_placed(&placed(&format!("{{\"matrix\":[{columns}],\"children\":[1]}},{child}")), outer * inner);
    assert_placed(&placed("{\"mesh\":0,\"scale\":[-1,1,1]}"), DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)));
    for x in [1.0, -1.0] {
        let outer = DMat4::from_scale_rotation_translation(DVec3::new(x, 4.0, 1.0), turn, DVec3::new(1.0, 2.0, 3.0));
        let leaning = DQuat::from_xyzw(0.0, 0.0, 0.6, 0.8);
        let inner = DMat4::from_rotation_translation(leaning, DVec3::X);
        let child = "{\"mesh\":0,\"translation\":[1,0,0],\"rotation\":[0,0,0.6,0.8]}";
        let scene = placed(&format!("{},{child}", trs("\"children\":[1]", &format!("[{x},4,1]"))));
        assert_eq!(scene.meshes[0].name, "a.gltf#nodes[1]");
        assert_placed(&scene, outer * inner);
    }
}

#[test]
fn nodes_share_a_mesh_and_a_scene_file_gets_them_as_one() {
    let nodes = "{\"mesh\":0},{\"mesh\":0,\"translation\":[0,0,5],\"name\":\"second\"},{\"mesh\":0,\"scale\":[0,1,1]}";
    let rest = format!("\"meshes\":[{{\"name\":\"tri\",\"primitives\":[{{\"attributes\":{{\"POSITION\":0}}}}]}}],\"nodes\":[{nodes}]");
    let text = triangle().gltf(&rest);
    let scene = gltf(&text).unwrap();
    assert_eq!((scene.meshes.len(), scene.objects.len()), (1, 2));
    assert_eq!((scene.objects[0].name.as_str(), scene.objects[1].name.as_str()), ("tri", "second"));
    assert_says(&scene.warnings, "", &["`a.gltf`: nodes[2]", "scale is 0"]);
    assert_says(&scene.warnings, "", &["meshes[0].primitives[0]", "without a material are grey"]);
    let ron = "Scene(meshes: [Mesh(file: \"a.gltf\", transform: (translate: (0, 0, 1)))], materials: {\"default\": (diffuse: 0.25)})";
    let scene = load("s.ron", &[("s.ron", ron), ("a.gltf", &text)]).unwrap();
    assert_eq!((scene.objects.len(), scene.triangle_count()), (1, 2));
    assert_eq!(corners(&scene, 0.0)[1][0], 6.0 * DVec3::Z);
    assert_eq!(scene.materials[0].diffuse, Vec3::splat(0.25));
}

#[test]
fn only_the_default_scene_is_shown() {
    let rest = "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":0}]}],\"materials\":[{}],\
        \"nodes\":[{\"mesh\":0},{\"mesh\":0,\"name\":\"shown\"}],\"scenes\":[{\"nodes\":[0]},{\"nodes\":[1]}],\"scene\":1";
    let scene = gltf(&triangle().gltf(rest)).unwrap();
    assert_eq!((scene.objects.len(), scene.objects[0].name.as_str()), (1, "shown"));
    assert_says(&scene.warnings, "", &["scenes other than the default one"]);
    // A binary file may do without data.
    let text = triangle().gltf(rest);
    assert_eq!(load("a.glb", &[("a.glb", glb(text.as_bytes(), None))]).unwrap().triangle_count(), 1);
}
