//! No input makes loading panic.

use std::{fs, path::Path, time::Duration};

use manylight_scene::{
    Scene,
    bvh::Bvh,
    points::{PointMethod, PointOptions, generate},
};
use proptest::prelude::*;

use crate::{
    memory::{load, obj},
    mutate::{fuzz, ron, times},
    support::Random,
};

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
    match load(path, &[("a.obj", obj), ("b.obj", obj), ("m.mtl", mtl), ("s.ron", ron), ("t.png", b"no picture")]) {
        Ok(scene) => check_scene(&scene),
        Err(faults) => {
            prop_assert!(faults.has_errors() && faults.render().contains("error"));
            Ok(())
        }
    }
}

/// It can be sampled, has points and a hierarchy, and gives finite numbers and indices in range.
pub fn check_scene(scene: &Scene) -> Result<(), TestCaseError> {
    prop_assert!(!scene.warnings.has_errors());
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
        let options = PointOptions { method: PointMethod::Area { count: 64 }, seed: 1 };
        for point in generate(scene, &state.deformed, &options).unwrap_or_default() {
            prop_assert!(
                point.position.is_finite() && point.normal.is_finite() && point.area.is_finite() && point.area >= 0.0,
                "{point:?}"
            );
        }
        let bvh = Bvh::build(scene, &state);
        prop_assert!(bvh.triangles.len() <= scene.gpu_triangles_at(&state).len() && bvh.nodes.len() < 2 * bvh.triangles.len().max(1));
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400 * times() as u32))]

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

/// Scenes of the repository with entries left out, doubled, exchanged, of other types and with numbers at the ends of their ranges.
#[test]
fn scenes_changed_by_their_structure_are_used_or_refused_with_a_place() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets"));
    let mut files: Vec<(String, Vec<u8>)> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| (path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap()))
        .collect();
    files.sort();
    let scenes: Vec<String> =
        files.iter().filter(|(name, _)| name.ends_with(".ron")).map(|(_, bytes)| String::from_utf8(bytes.clone()).unwrap()).collect();
    fuzz("scenes", 1000, Duration::from_secs(20), move |random: &mut Random| {
        let text = ron(random.of(&scenes).as_str(), random.of(&scenes).as_str(), random);
        let mut all: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
        all.push(("s.ron", text.as_bytes()));
        match load("s.ron", &all) {
            Ok(scene) => check_scene(&scene).unwrap_or_else(|fault| panic!("{fault}\n{text}")),
            Err(faults) => {
                for fault in faults.0.iter().filter(|fault| fault.severity == manylight_graph::diagnostics::Severity::Error) {
                    // A file that a scene names and that is none has no text to point into; its name is told.
                    assert!(!fault.message.is_empty() && (!fault.labels.is_empty() || fault.message.contains('`')), "{}", faults.render());
                }
            }
        }
    });
}

/// Triangles that numbers break on, beside a good one.
#[test]
fn needles_slivers_and_coplanar_triangles_are_used() {
    let good = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    let cases = [
        ("needle", "v 0 0 5\nv 1e6 0 5\nv 1e6 1e-6 5\nf 4 5 6\n"),
        ("sliver of the smallest area", "v 0 0 5\nv 1e-19 0 5\nv 0 1e-19 5\nf 4 5 6\n"),
        ("larger than a square of it is", "v 1e20 0 5\nv 0 1e20 5\nv 0 0 1e20\nf 4 5 6\n"),
        ("coplanar, crossing", "v 0.2 0.2 0\nv 2 0 0\nv 0 2 0\nf 4 5 6\nf 6 5 4\nf 1 5 6\n"),
        ("the same from behind", "f 1 3 2\n"),
        ("far away", "v 1e7 1e7 1e7\nv 1.000001e7 1e7 1e7\nv 1e7 1.000001e7 1e7\nf 4 5 6\n"),
        ("denormal", "v 1e-42 0 0\nv 0 1e-42 0\nv 0 0 1e-42\nf 4 5 6\n"),
    ];
    for (what, faces) in cases {
        let scene = obj(&format!("{good}{faces}")).unwrap_or_else(|faults| panic!("{what}: {faults}"));
        check_scene(&scene).unwrap_or_else(|fault| panic!("{what}: {fault}"));
    }
    // Thousands in one place: the hierarchy cannot tell them apart, and ends.
    let many = format!("{good}{}", "v 0 0 0\nv 1 0 0\nv 0 1 0\n".repeat(3000));
    let faces: String = (0..3000).map(|i| format!("f {} {} {}\n", 3 * i + 4, 3 * i + 5, 3 * i + 6)).collect();
    check_scene(&obj(&(many + &faces)).unwrap()).unwrap();
}

/// A grid of `side`² quadrilaterals, two lines each.
fn grid(side: usize) -> String {
    let vertices = (0..=side).flat_map(|y| (0..=side).map(move |x| format!("v {x} {y} {}\n", (x * y) % 7)));
    let face = move |x: usize, y: usize| {
        let at = y * (side + 1) + x + 1;
        format!("f {at} {} {} {}\n", at + 1, at + side + 2, at + side + 1)
    };
    vertices.chain((0..side).flat_map(|y| (0..side).map(move |x| face(x, y)))).collect()
}

/// Ten times the lines take about ten times as long.
#[test]
fn long_meshes_are_read_in_proportion_to_their_length() {
    let time = |side: usize| {
        let text = grid(side);
        let start = std::time::Instant::now();
        let scene = obj(&text).unwrap();
        assert_eq!(scene.triangle_count(), 2 * side * side);
        start.elapsed()
    };
    // The best of some tries: other work on the machine only makes them longer.
    let best = |side: usize| (0..5).map(|_| time(side)).min().expect("tries");
    let (short, long) = (best(70).max(Duration::from_millis(2)), best(220));
    assert!(long < 60 * short, "10⁴ lines take {short:?}, 10⁵ lines {long:?}");
}
