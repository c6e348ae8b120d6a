//! No input makes loading panic.

use proptest::prelude::*;

use crate::memory::load;

const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0 1\nv 0 1 0 1 0 0\nv 0 0 1\nvt 0 0\nvt 1\nvn 0 0 1\nusemtl a\nf 1/1/1 2/2/1 3/1/1\ng x\nusemtl b c\nf 1//1 2//1 4//1\nf -1 -2 -3 -4\nl 1 2\np 1\n";
const MTL: &str = "newmtl a\nKd 0.5 0.5 0.5\nKs 0.1 0.1 0.1\nNs 10\nillum 2\nmap_Kd -s 1 1 1 t.png\nnewmtl b c\nKd 1 0 0\nKe 0 0 0\n";
const RON: &str = "Scene(meshes: [\"a.obj\", Mesh(file: \"a.obj\", transform: (translate: (1, 2, 3), rotate_deg: (axis: (0, 1, 0), angle: 30)), motion: [(time: 0.0), (time: 1.5, scale: 2.0, file: \"b.obj\")], repeat: loop), Metaballs(balls: [(position: (0, 1, 0), radius: 1, motion: [(time: 0), (time: 1, radius: 0.5)])], level: 0.3, cells: 6, material: \"a\")], camera: (origin: (0, 0, 9), target: (0, 0, 0), fov_x_deg: 40.0), lights: [Spot(position: (0, 1, 0), target: (0, 0, 0), intensity: (1, 2, 3), beam_deg: 10, cutoff_deg: 20, falloff: smooth), Point(position: (0, 1, 0), intensity: 2), Directional(direction: (0, -1, 0), irradiance: 3, motion: [(time: 0), (time: 1, direction: (0, 1, 0))])], materials: {\"a\": (diffuse: 0.5)})";

/// A text with some bytes replaced, put in, or taken out.
fn mutated(text: &'static str) -> impl Strategy<Value = Vec<u8>> {
    let token = prop_oneof![
        any::<u8>().prop_map(|byte| vec![byte]),
        prop::sample::select(vec![
            "nan",
            "inf",
            "-1e999",
            "1e38",
            "-9223372036854775808",
            "9223372036854775807",
            "4294967296",
            "0",
            "/",
            "//",
            "\\\n",
            "\n",
            " f ",
            "v ",
            "usemtl ",
            "newmtl ",
            "Kd 1",
            "\u{feff}",
            "#",
            "(",
            ")",
            "]",
            "\"",
            ",",
            "-0.0",
            "1e-40",
            "loop",
            "/*",
        ])
        .prop_map(|token| token.as_bytes().to_vec()),
    ];
    prop::collection::vec((0..text.len(), 0_usize..12, token), 1..12).prop_map(move |edits| {
        let mut bytes = text.as_bytes().to_vec();
        for (at, remove, token) in edits {
            let at = at.min(bytes.len());
            let end = (at + remove).min(bytes.len());
            bytes.splice(at..end, token);
        }
        bytes
    })
}

/// Whatever loads can be sampled, and gives finite numbers and indices in range.
fn check(path: &str, obj: &[u8], mtl: &[u8], ron: &[u8]) -> Result<(), TestCaseError> {
    let Ok(scene) = load(path, &[("a.obj", obj), ("b.obj", obj), ("m.mtl", mtl), ("s.ron", ron), ("t.png", b"no picture")]) else {
        return Ok(());
    };
    for time in [0.0, 0.7, 1e9] {
        let state = scene.sample(time);
        let vertices = scene.gpu_vertices_at(&state);
        for triangle in scene.gpu_triangles_at(&state) {
            for index in [triangle.a, triangle.b, triangle.c] {
                let vertex = vertices[index as usize];
                prop_assert!(vertex.position.is_finite() && vertex.normal.is_finite() && vertex.u.is_finite() && vertex.v.is_finite());
            }
            prop_assert!((triangle.material as usize) < scene.materials.len() && (triangle.object as usize) < scene.objects.len());
        }
        prop_assert!(state.info.diagonal.is_finite() && state.info.diagonal > 0.0 || state.bounds.diagonal() > 1e30);
        prop_assert!(state.camera_view(1.5).forward.is_finite());
        prop_assert_eq!(state.light_views.len(), scene.light_view_count());
        prop_assert!(state.light_views.iter().all(|view| view.view.forward.is_finite() && view.weight.is_finite()));
        prop_assert!(
            state.lights.iter().all(|light| light.direction.is_finite() && light.share.is_finite() && light.ray_density.is_finite())
        );
        prop_assert!(state.objects.iter().all(|object| object.normal_from_object.is_finite()));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn damaged_meshes(obj in mutated(OBJ), mtl in mutated(MTL)) {
        check("a.obj", &obj, &mtl, b"")?;
    }

    #[test]
    fn damaged_scenes(ron in mutated(RON)) {
        check("s.ron", OBJ.as_bytes(), MTL.as_bytes(), &ron)?;
    }

    #[test]
    fn noise(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
        check("a.obj", &bytes, &bytes, b"")?;
        check("s.ron", OBJ.as_bytes(), MTL.as_bytes(), &bytes)?;
    }
}
