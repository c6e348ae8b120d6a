//! OBJ and MTL: what is read, and what is mended.

use glam::Vec3;
use manylight_scene::{DEFAULT_SHININESS, Scene};

use crate::memory::{assert_says, load, obj, summary};

/// Everything but the fitted camera and light is as it should be.
#[track_caller]
fn assert_only_fitted(scene: &Scene) {
    let others: Vec<_> = scene.warnings.0.iter().filter(|d| !d.message.contains("the scene has no")).collect();
    assert!(others.is_empty(), "{:?}", summary(&scene.warnings));
}

#[test]
fn polygons_negative_indices_comments_and_line_ends() {
    let text = "\u{feff}# a comment\r\no thing # 2\r\nv 0 0 0\r\nv 1 0 0 # here\r\nv 1 1 0\r\nv 0 1 0\r\nv 0.5 1.5 0 1.0\r\ng g\r\ns off\r\nf -5 \\\r\n -4 -3 -1 -2\r\n";
    let scene = obj(text).unwrap();
    assert_only_fitted(&scene);
    assert_eq!(scene.triangle_count(), 3);
    let mesh = &scene.meshes[0];
    assert_eq!(mesh.vertices.len(), 5);
    assert!((mesh.statistics.area - 1.25).abs() < 1e-12);
    assert_eq!(scene.materials[0].name, "default");
    assert_eq!(scene.materials[0].diffuse, Vec3::splat(0.5));
}

#[test]
fn faces_may_stand_before_their_vertices() {
    let scene = obj("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").unwrap();
    assert_only_fitted(&scene);
    assert_eq!(scene.triangle_count(), 1);
}

#[test]
fn vertices_are_shared_by_equal_indices_only() {
    let text =
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nvn 0 0 2\nvn 0 0 -1\nf 1/1/1 2/1/1 3/2/1\nf 1/1/1 3/2/1 4/2/2\nf 1//1 2 4\n";
    let scene = obj(text).unwrap();
    assert_only_fitted(&scene);
    let vertices = &scene.meshes[0].vertices;
    assert_eq!(vertices.len(), 4 + 3);
    assert_eq!(vertices[0].normal, Vec3::Z, "normals have unit length");
    assert_eq!((vertices[2].u, vertices[2].v), (1.0, 0.0), "v counts downwards");
    assert_eq!(vertices[3].normal, Vec3::NEG_Z);
    let bare = vertices.iter().filter(|v| v.normal == Vec3::ZERO).count();
    assert_eq!(bare, 2, "corners without a normal are flat");
    assert!(scene.features()["normals"]);
}

#[test]
fn materials_are_those_of_the_library() {
    let mtl = "newmtl matt\r\nKd 0.1 0.2 0.3\r\nnewmtl two words\nKd 0.5\nKs 0.4 0.4 0.4\nNs 30\nillum 2\nnewmtl off\nKs 1 1 1\nillum 1\nnewmtl shiny\nKs 0.1 0.1 0.1\n";
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nmtllib sub/m.mtl\nusemtl matt\nf 1 2 3\nusemtl two words\nf 1 2 4\nusemtl off\nf 1 3 4\nusemtl shiny\nf 2 3 4\n";
    let scene = load("dir/a.obj", &[("dir/a.obj", text), ("dir/sub/m.mtl", mtl)]).unwrap();
    assert_only_fitted(&scene);
    let materials = &scene.materials;
    assert_eq!(materials.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["matt", "two words", "off", "shiny"]);
    assert_eq!(materials[0].diffuse, Vec3::new(0.1, 0.2, 0.3));
    assert_eq!((materials[1].diffuse, materials[1].specular, materials[1].shininess), (Vec3::splat(0.5), Vec3::splat(0.4), 30.0));
    assert_eq!(materials[2].specular, Vec3::ZERO, "illum 1 has no highlights");
    assert_eq!(materials[3].shininess, DEFAULT_SHININESS);
    assert_eq!(scene.gpu_triangles().iter().map(|t| t.material).collect::<Vec<_>>(), [0, 1, 2, 3]);
    assert!(scene.features()["glossy"]);
    assert_eq!(scene.sources.iter().map(|p| p.to_string_lossy().into_owned()).collect::<Vec<_>>(), ["dir/a.obj", "dir/sub/m.mtl"]);
}

#[test]
fn faults_of_an_obj_are_counted_and_placed() {
    let cases: [(&str, &[&str]); 14] = [
        ("v nan 0 0\nf 1 2 4", &["1 vertices are not three finite numbers", "line 4"]),
        ("v 1e39 0 0\nv 1 inf 2\nv 1 2\nv a b c\nf 4 1 2", &["4 vertices are not"]),
        ("v nan 0 0\nf 1 2 4", &["1 triangles have vertices that are not finite"]),
        ("f 1 2 9", &["1 faces name vertices that do not exist", "line 4"]),
        ("f 0 1 2\nf -9 1 2\nf 1 2 99999999999999999999", &["1 faces are malformed"]),
        ("f 0 1 2\nf -9 1 2", &["2 faces name vertices that do not exist"]),
        ("f 1 2 x", &["1 faces are malformed"]),
        ("f 1/7 2 3//9", &["2 corners name a texture coordinate or normal"]),
        ("f 1 2\nf 3\nf", &["3 faces have fewer than three corners"]),
        ("l 1 2\np 1\np 2", &["3 points and lines are left out"]),
        ("vn nan 0 0\nvt inf 0", &["1 normals are not finite"]),
        ("vt inf 0", &["1 texture coordinates are not finite"]),
        ("f 1 1 2\nv 2 0 0\nf 1 2 4", &["2 triangles have no area"]),
        ("v 0 0 0\nf 2 3 1\nf 3 2 4", &["2 triangles repeat another one"]),
    ];
    for (fault, words) in cases {
        // The good face is written last, so that an index of the fault cannot hit later vertices by chance.
        let text = format!("v 0 0 0\nv 1 0 0\nv 0 1 0\n{fault}\nf 1 2 3\n");
        let scene = obj(&text).unwrap_or_else(|e| panic!("{fault}: {e:?}"));
        assert_says(&scene.warnings, "", &[&["a.obj"], words].concat());
        assert!(scene.triangle_count() >= 1);
        assert!(scene.sample(0.0).bounds.max.is_finite());
    }
}

#[test]
fn a_warning_points_at_the_line() {
    let scene = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\n  f 1 2 9 # bad\nf 1 2 8\nf 1 2 3\n").unwrap();
    assert_says(&scene.warnings, "  f 1 2 9 # bad", &["2 faces name vertices", "line 4", "the first is here"]);
}

#[test]
fn files_without_a_triangle_are_errors_that_name_them() {
    let junk: Vec<u8> = (0..4096_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for bytes in [&b""[..], b"# nothing\n", b"v 0 0 0\n", b"v 0 0 0\nv 1 0 0\nl 1 2\n", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", &junk] {
        let fault = load("bad.obj", &[("bad.obj", bytes)]).unwrap_err();
        assert_says(&fault, "", &["`bad.obj` holds no triangle"]);
    }
    let fault = load("bad.obj", &[("bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n")]).unwrap_err();
    assert_says(&fault, "", &["`bad.obj` holds no triangle"]);
    assert_says(&fault, "f 1 2 9", &["1 faces name vertices that do not exist"]);
    assert_says(&load::<&str>("gone.obj", &[]).unwrap_err(), "", &["cannot read `gone.obj`: no such file"]);
}

#[test]
fn a_missing_library_is_a_warning() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib gone.mtl\nusemtl wood\nf 1 2 3\n";
    let scene = obj(text).unwrap();
    assert_says(&scene.warnings, "mtllib gone.mtl", &["1 material libraries cannot be read"]);
    assert_eq!(scene.warnings.0.len(), 3, "only that, and the fitted camera and light: {:?}", summary(&scene.warnings));
    assert_eq!((scene.materials[0].name.as_str(), scene.materials[0].diffuse), ("wood", Vec3::splat(0.5)));
    assert_eq!(scene.sources.len(), 2, "the missing file is watched, too");
}

#[test]
fn faults_of_a_library_are_counted_and_placed() {
    let cases: [(&str, &[&str]); 8] = [
        ("Kd 0.5 0.5", &["1 colours are not three numbers"]),
        ("Kd spectral file.rfl", &["1 colours are not three numbers"]),
        ("Kd 2 0 0\nKs -1 0 0", &["2 colours are outside of 0…1"]),
        ("Ns much\nNs -4", &["2 exponents `Ns`"]),
        ("map_Kd", &["1 textures `map_Kd` have no file name"]),
        ("map_Kd -s 2 2 2 gone.png", &["cannot read `gone.png`: no such file"]),
        ("map_Bump a.png\nmap_Ks b.png", &["2 textures other than `map_Kd`"]),
        ("Ke 1 1 1", &["1 materials emit light"]),
    ];
    for (fault, words) in cases {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\nusemtl a\nf 1 2 3\n";
        let mtl = format!("Kd 1 1 1\nnewmtl a\n{fault}\n");
        let scene = load("a.obj", &[("a.obj", text), ("m.mtl", &mtl)]).unwrap();
        assert_says(&scene.warnings, fault.lines().next().unwrap(), &[&["m.mtl", "line 3"], words].concat());
        assert_says(&scene.warnings, "Kd 1 1 1", &["1 lines stand before the first `newmtl`"]);
        let diffuse = scene.materials[0].diffuse;
        assert!(diffuse.is_finite() && diffuse.max_element() <= 1.0 && diffuse.min_element() >= 0.0);
    }
}

#[test]
fn a_material_that_the_library_lacks_is_grey() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nmtllib m.mtl\nusemtl b\nf 1 2 3\n";
    let scene = load("a.obj", &[("a.obj", text), ("m.mtl", "newmtl a\nKd 1 0 0\n")]).unwrap();
    assert_says(&scene.warnings, "usemtl b", &["1 materials are not in the material library"]);
    assert_eq!(scene.materials[0].diffuse, Vec3::splat(0.5));
}

#[test]
fn the_hash_is_that_of_the_contents() {
    let hash = |text: &str| obj(text).unwrap().hash;
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(hash(text), hash(text));
    assert_ne!(hash(text), hash(&text.replace("v 1 0 0", "v 2 0 0")));
}

#[test]
fn large_meshes_load_fast() {
    // 80,000 triangles: a grid of 200 × 200 cells.
    let mut text = String::new();
    for y in 0..=200 {
        for x in 0..=200 {
            text.push_str(&format!("v {} {} {}\n", f64::from(x) * 0.01, (f64::from(x * y) * 0.37).sin(), f64::from(y) * 0.01));
        }
    }
    for y in 0..200 {
        for x in 0..200 {
            let i = y * 201 + x + 1;
            text.push_str(&format!("f {} {} {}\nf {} {} {}\n", i, i + 1, i + 201, i + 1, i + 202, i + 201));
        }
    }
    let start = std::time::Instant::now();
    let scene = obj(&text).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    assert_eq!(scene.triangle_count(), 80_000);
    println!("80,000 triangles in {seconds:.3} s");
    // Ten times what a release build takes on a slow machine: only a quadratic loop fails.
    assert!(seconds < 5.0, "{seconds} s");
}
