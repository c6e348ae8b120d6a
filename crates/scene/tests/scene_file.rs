//! Scene files: what they may say, and every fault with its place.

use glam::{Quat, Vec3};
use manylight_scene::{LightShape, Scene, files::Embedded, gpu_data::Falloff};

use crate::memory::{ROOM, TRIANGLE, assert_says, load, ron, summary};

const CAMERA: &str = "camera: (origin: (0.0, 0.0, 5.0), target: (0.0, 0.0, 0.0))";
const SPOT: &str = "position: (0.0, 1.0, 0.0), target: (0.0, 0.0, 0.0), intensity: 5.0, beam_deg: 10.0, cutoff_deg: 20.0";

#[test]
fn a_whole_scene() {
    let scene = ron("// comment
    Scene(
        meshes: [\"room.obj\", Mesh(file: \"tri.obj\", name: \"t\", transform: (translate: (1, 2, 3), rotate_deg: (axis: (0, 2, 0), angle: 90), scale: 2))],
        camera: (origin: (0.0, 0.0, 5.0), target: (0.0, 0.0, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 62.0),
        lights: [
            Spot(position: (0.0, 0.9, 0.0), target: (0.0, 0.0, 0.0), intensity: (1.0, 2.0, 3.0), beam_deg: 15.0, cutoff_deg: 20.0, falloff: smooth),
            Spot(position: (0.0, 0.9, 0.0), target: (0.0, 0.0, 1.0), intensity: 4.0, beam_deg: 0.0, cutoff_deg: 89.0),
            Point(position: (1.0, 2.0, 3.0), intensity: (4.0, 5.0, 6.0)),
            Directional(direction: (0, -2, 0), irradiance: 7),
        ],
        materials: {\"walls\": (diffuse: (0.1, 0.2, 0.3), specular: 0.4, shininess: 9)},
    )")
    .unwrap();
    assert_eq!(scene.name, "s");
    assert_eq!(scene.objects[1].name, "t");
    let pose = scene.objects[1].pose.at(0.0);
    assert_eq!((pose.translate, pose.scale), (Vec3::new(1.0, 2.0, 3.0), Vec3::splat(2.0)));
    assert!(pose.rotate.angle_between(Quat::from_rotation_y(90_f32.to_radians())) < 1e-3);
    assert_eq!(scene.camera.at(0.0).fov_x_deg, 62.0);
    let spot = |beam_deg, cutoff_deg, falloff| LightShape::Spot { beam_deg, cutoff_deg, falloff };
    let shapes: Vec<_> = scene.lights.iter().map(|light| light.shape).collect();
    let spots = [spot(15.0, 20.0, Falloff::Smooth), spot(0.0, 89.0, Falloff::Linear)];
    assert_eq!(shapes, [spots[0], spots[1], LightShape::Point, LightShape::Directional]);
    let pose = |index: usize| scene.lights[index].pose.at(0.0);
    assert_eq!(pose(1).strength, Vec3::splat(4.0));
    assert_eq!((pose(2).position, pose(2).strength), (Vec3::new(1.0, 2.0, 3.0), Vec3::new(4.0, 5.0, 6.0)));
    assert_eq!((pose(3).direction(), pose(3).strength), (Vec3::NEG_Y, Vec3::splat(7.0)));
    let walls = scene.materials.iter().find(|m| m.name == "walls").unwrap();
    assert_eq!((walls.diffuse, walls.specular, walls.shininess), (Vec3::new(0.1, 0.2, 0.3), Vec3::splat(0.4), 9.0));
    let features = scene.features();
    let on: Vec<_> = features.iter().filter(|(_, on)| **on).map(|(name, _)| name.as_str()).collect();
    assert_eq!(on, ["glossy", "several_lights"]);
    assert_eq!(features.len(), 8);
}

/// Each fault alone: the text, the place that is pointed at, and words of the message.
#[test]
fn every_fault_has_its_place() {
    let mesh = "meshes: [\"tri.obj\"]";
    let spot = |changed: &str, to: &str| format!("Scene({mesh}, lights: [Spot({})])", SPOT.replace(changed, to));
    let light = |light: &str| format!("Scene({mesh}, lights: [{light}])");
    let camera = |changed: &str, to: &str| format!("Scene({mesh}, {})", CAMERA.replace(changed, to));
    let object = |rest: &str| format!("Scene(meshes: [Mesh(file: \"tri.obj\", {rest})])");
    let cases: Vec<(String, &str, &[&str])> = vec![
        (format!("Scene({mesh}, ligths: [])"), "ligths", &["unknown field `ligths`", "lights"]),
        ("Scene(lights: [])".into(), "Scene", &["missing field `meshes`"]),
        ("Scene(meshes: [])".into(), "[]", &["needs a mesh"]),
        ("Scene(meshes: \"tri.obj\")".into(), "\"tri.obj\"", &["expected a list"]),
        ("Scene(meshes: [1])".into(), "1", &["expected `Mesh(…)`"]),
        ("Scene(meshes: [Mush(file: \"tri.obj\")])".into(), "Mush", &["Mesh"]),
        ("Scen(meshes: [])".into(), "Scen", &["expected `Scene(…)`"]),
        ("(meshes: [\"tri.obj\"])".into(), "", &["expected `Scene(…)`"]),
        ("// nothing".into(), "", &["empty", "the least scene is `Scene(meshes"]),
        ("".into(), "", &["empty", "the least scene is `Scene(meshes"]),
        ("Scene(meshes: [\"tri.obj\"".into(), "[", &["never closed"]),
        ("Scene(meshes: [\"gone.obj\"])".into(), "\"gone.obj\"", &["cannot read `gone.obj`: no such file"]),
        (spot("cutoff_deg: 20.0", "cutoff_deg: 10.0"), "10.0", &["not above the beam"]),
        (spot("20.0", "90.0"), "90.0", &["90 is out of range", "below 90"]),
        (spot("10.0", "-1.0"), "-1.0", &["-1 is out of range"]),
        (spot("intensity: 5.0", "intensity: (1.0, -2.0, 3.0)"), "-2.0", &["-2 is out of range", "not negative"]),
        (spot("intensity: 5.0", "intensity: (1.0, 3.0)"), "(1.0, 3.0)", &["expected three numbers, found 2"]),
        (spot("intensity: 5.0", "intensity: true"), "true", &["expected three numbers"]),
        (spot("intensity: 5.0", "intensity: NaN"), "NaN", &["NaN"]),
        (spot("intensity: 5.0", "intensity: inf"), "inf", &["inf"]),
        (spot("intensity: 5.0", "intensity: 1e30"), "1e30", &["too large"]),
        (spot("intensity: 5.0, ", ""), "Spot", &["missing field `intensity`"]),
        (spot("(0.0, 0.0, 0.0)", "(0.0, 1.0, 0.0)"), "Spot", &["the light is on its target"]),
        (spot("5.0", "5.0, falloff: linea"), "linea", &["unknown falloff `linea`", "linear"]),
        (spot("5.0", "5.0, falloff: 3"), "3", &["expected `linear`"]),
        (spot("5.0", "5.0, colour: 3"), "colour", &["unknown field `colour` in a spot light"]),
        (light(&format!("Sport({SPOT})")), "Sport", &["expected `Spot(…)` or `Point(…)` or `Directional(…)`", "did you mean `Spot`?"]),
        (light("Poimt(position: (0, 1, 0), intensity: 5)"), "Poimt", &["did you mean `Point`?"]),
        (light("Moon(direction: (0, -1, 0), irradiance: 5)"), "Moon", &["`Spot`, `Point`, `Directional`, `Sun`"]),
        (light("3"), "3", &["expected `Spot(…)`", "`Directional(direction: …, irradiance: …)`"]),
        (light("Point(position: (0, 1, 0))"), "Point", &["missing field `intensity`"]),
        (light("Point(position: (0, 1, 0), intensity: 5, target: (0, 0, 0))"), "target", &["unknown field `target` in a point light"]),
        (light("Point(position: (0, 1, 0), intensity: -5)"), "-5", &["-5 is out of range", "not negative"]),
        (
            light("Point(position: (0, 1, 0), intensity: 5, motion: [(time: 0, target: (0, 0, 0))])"),
            "target",
            &["unknown field `target` in a key frame of a point light"],
        ),
        (light("Directional(direction: (0, -1, 0))"), "Directional", &["missing field `irradiance`"]),
        (light("Directional(direction: (0, 0, 0), irradiance: 5)"), "(0, 0, 0)", &["the direction is zero"]),
        (light("Directional(direction: (0, -1, 0), irradiance: (1, 2))"), "(1, 2)", &["expected three numbers, found 2"]),
        (
            light("Directional(direction: (0, -1, 0), irradiance: 5, intensity: 5)"),
            "intensity",
            &["unknown field `intensity`", "irradiance"],
        ),
        (
            light("Directional(direction: (0, -1, 0), irradiance: 5, motion: [(time: 0, direction: (0, 0, 0))])"),
            "(0, 0, 0)",
            &["the direction is zero"],
        ),
        (camera("(0.0, 0.0, 5.0)", "(0.0, 0.0, 0.0)"), "(", &["the camera is on its target"]),
        (camera("target", "up: (0.0, 0.0, -2.0), target"), "(0.0, 0.0, -2.0)", &["the camera looks along `up`"]),
        (camera("target", "up: (0.0, 0.0, 0.0), target"), "(0.0, 0.0, 0.0)", &["the direction is zero"]),
        (camera("target", "fov_x_deg: 180.0, target"), "180.0", &["180 is out of range"]),
        (camera("target", "fov_x_deg: 0.0, target"), "0.0", &["0 is out of range"]),
        (camera("target", "tarqet"), "tarqet", &["unknown field `tarqet`", "target"]),
        (object("transform: (scale: 0.0)"), "(scale: 0.0)", &["the scale is zero"]),
        (object("transform: (rotate_deg: (axis: (0.0, 0.0, 0.0), angle: 3.0))"), "(0.0, 0.0, 0.0)", &["the direction is zero"]),
        (object("transform: (rotate_deg: (axis: (0.0, 0.0, 1.0)))"), "(", &["missing field `angle`"]),
        (object("transform: (rotate_deg: 3.0)"), "3.0", &["expected three numbers"]),
        (object("motion: []"), "[]", &["needs a key frame"]),
        (object("motion: [(time: 1.0), (time: 1.0)]"), "(", &["the time 1 does not come after 1"]),
        (object("motion: [(scale: 1.0)]"), "(", &["missing field `time`"]),
        (object("motion: [(time: NaN)]"), "NaN", &["NaN"]),
        (object("motion: [(time: 0.0)], repeat: lop"), "lop", &["unknown repetition `lop`", "loop"]),
        (format!("Scene({mesh}, materials: {{\"a\": (diffuse: 0.5)}})"), "\"a\"", &["no mesh has a material `a`"]),
        (
            "Scene(meshes: [\"room.obj\"], materials: {\"wals\": (diffuse: 0.5)})".into(),
            "\"wals\"",
            &["no mesh has a material `wals`", "walls"],
        ),
        ("Scene(meshes: [\"room.obj\"], materials: {\"walls\": (diffuse: 1.5)})".into(), "1.5", &["1.5 is out of range"]),
        ("Scene(meshes: [\"room.obj\"], materials: {\"walls\": (shininess: -1)})".into(), "-1", &["at least 0"]),
        ("Scene(meshes: [\"room.obj\"], materials: {\"walls\": (texture: \"no.png\")})".into(), "\"no.png\"", &["cannot read `no.png`"]),
        ("Scene(meshes: [\"room.obj\"], materials: {walls: (diffuse: 0.5)})".into(), "walls", &["\"walls\""]),
    ];
    for (text, place, words) in cases {
        let faults = match ron(&text) {
            Ok(scene) => panic!("{text} is accepted: {:?}", summary(&scene.warnings)),
            Err(faults) => faults,
        };
        assert!(faults.has_errors());
        assert_says(&faults, place, words);
        let errors = faults.0.iter().filter(|d| d.severity == manylight_graph::diagnostics::Severity::Error).count();
        assert_eq!(errors, 1, "{text}: {:?}", summary(&faults));
    }
}

#[test]
fn all_faults_are_told_at_once_and_in_order() {
    let faults = ron("Scene(
        meshes: [\"gone.obj\", \"tri.obj\"],
        camera: (origin: (0.0, 0.0, inf), target: (0.0, 0.0), fov_x_deg: 200.0),
        lights: [Spot(position: (0.0, 1.0, 0.0), target: (0.0, 0.0, 0.0), intensity: -1.0, beam_deg: 30.0, cutoff_deg: 20.0)],
        material: {},
    )")
    .unwrap_err();
    let places: Vec<_> = faults.0.iter().map(|d| d.labels[0].span.range.start).collect();
    assert_eq!(places.len(), 7, "{:?}", summary(&faults));
    assert!(places.is_sorted());
}

#[test]
fn warnings_that_do_not_stop() {
    let scene = ron("Scene(meshes: [Mesh(file: \"tri.obj\", repeat: loop)])").unwrap();
    assert_says(&scene.warnings, "loop", &["no effect without `motion`"]);
    let scene = ron("Scene(meshes: [Mesh(file: \"tri.obj\", motion: [
        (time: 0, rotate_deg: (axis: (0, 1, 0), angle: 0)), (time: 1, rotate_deg: (axis: (0, 1, 0), angle: 270))])])")
    .unwrap();
    assert_says(&scene.warnings, "(", &["the short way round", "180°"]);
    assert_says(&scene.warnings, "", &["the scene has no camera"]);
    assert_says(&scene.warnings, "", &["the scene has no light"]);
}

#[test]
fn a_sun_without_a_key_at_noon_is_warned_of() {
    let sun = |noon: &str| {
        let motion = format!("[(time: 0, direction: (3, 0, 0)), {noon} (time: 2, direction: (-1, 0, 0))]");
        let light = format!("Directional(direction: (0, -1, 0), irradiance: 5, motion: {motion})");
        ron(&format!("Scene(meshes: [\"tri.obj\"], {CAMERA}, lights: [{light}])")).unwrap()
    };
    assert_says(&sun("").warnings, "(", &["from [1, 0, 0] to [-1, 0, 0] is half a turn", "put a key frame between them"]);
    let scene = sun("(time: 1, irradiance: 9),");
    assert_eq!(scene.warnings.0.len(), 0);
    assert!(scene.features()["moving_lights"]);
    // Keys of different lengths are mixed alike: a quarter of the way is 45° down.
    let light = scene.sample(0.5).lights[0];
    assert!(light.direction.distance(Vec3::new(1.0, -1.0, 0.0).normalize()) < 1e-6, "{}", light.direction);
    assert_eq!(light.strength, Vec3::splat(7.0));
}

/// A warning took the camera or the light away, so that another one was fitted, or the picture black.
#[test]
fn a_warning_about_a_camera_or_a_light_does_not_drop_it() {
    let camera = CAMERA.replace("target", "repeat: loop, target");
    let scene = ron(&format!("Scene(meshes: [\"tri.obj\"], {camera}, lights: [Spot({SPOT}, repeat: loop)])")).unwrap();
    assert_eq!(scene.warnings.0.len(), 2, "{:?}", summary(&scene.warnings));
    assert_eq!((scene.camera.at(0.0).origin, scene.lights.len()), (Vec3::new(0.0, 0.0, 5.0), 1));
}

#[test]
fn a_key_takes_from_the_transform_what_it_leaves_out() {
    let scene = ron("Scene(meshes: [Mesh(file: \"tri.obj\", transform: (translate: (1, 0, 0), scale: 2), motion: [(time: 0), (time: 1, translate: (3, 0, 0))])])").unwrap();
    let pose = scene.objects[0].pose.at(0.5);
    assert_eq!((pose.translate, pose.scale), (Vec3::X * 2.0, Vec3::splat(2.0)));
}

#[test]
fn the_camera_moves() {
    let scene = ron(&format!(
        "Scene(meshes: [\"tri.obj\"], {})",
        CAMERA.replace("target", "motion: [(time: 0), (time: 2, origin: (2, 0, 5), fov_x_deg: 70)], target")
    ))
    .unwrap();
    assert!(scene.features()["moving_camera"]);
    let camera = scene.sample(1.0).camera;
    assert_eq!((camera.origin, camera.fov_x_deg), (Vec3::new(1.0, 0.0, 5.0), 60.0));
}

#[test]
fn one_mesh_twice_has_one_material_of_each_name() {
    let scene = ron("Scene(meshes: [\"room.obj\", \"./room.obj\"], materials: {\"floor\": (diffuse: 0.25)})").unwrap();
    assert_eq!((scene.meshes.len(), scene.objects.len(), scene.materials.len()), (1, 2, 3));
    assert_eq!(scene.materials[0].diffuse, Vec3::splat(0.25));
    let triangles = scene.gpu_triangles();
    assert_eq!(triangles.len(), 24);
    assert_eq!((triangles[0].a, triangles[0].object), (triangles[12].a, 0));
    assert_eq!(triangles[12].object, 1);
}

#[test]
fn two_meshes_have_vertices_of_their_own() {
    let scene = ron("Scene(meshes: [\"tri.obj\", \"room.obj\"])").unwrap();
    let (vertices, triangles) = (scene.gpu_vertices(), scene.gpu_triangles());
    assert_eq!(vertices[triangles[1].a as usize].position, Vec3::splat(-1.0));
    assert_eq!(triangles[1].material, 1, "the first mesh has the default material");
}

#[test]
fn files_are_relative_and_can_be_embedded() {
    let files = [
        ("dir/s.ron", "Scene(meshes: [\"../other/room.obj\", \"sub\\\\tri.obj\"])"),
        ("other/room.obj", ROOM),
        ("dir/sub/tri.obj", TRIANGLE),
    ];
    assert_eq!(load("./dir/s.ron", &files).unwrap().objects.len(), 2);
    let embedded = Embedded(files.iter().map(|(name, text)| ((*name).to_owned(), text.as_bytes())).collect());
    let scene = Scene::load_with("dir/s.ron", &embedded).unwrap();
    assert_eq!(scene.sources.len(), 3);
    assert!(Scene::load_with("dir/none.ron", &embedded).is_err());
}

#[test]
fn a_file_on_disk_wins_over_an_embedded_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    let embedded = Embedded(vec![(path.to_string_lossy().into_owned(), TRIANGLE.as_bytes())]);
    assert_eq!(Scene::load_with(&path, &embedded).unwrap().triangle_count(), 1);
    std::fs::write(&path, ROOM).unwrap();
    assert_eq!(Scene::load_with(&path, &embedded).unwrap().triangle_count(), 12);
    let fault = Scene::load(folder.path()).unwrap_err();
    assert_says(&fault, "", &["cannot read"]);
}

#[test]
fn bytes_that_are_no_text_are_an_error() {
    let fault = load("s.ron", &[("s.ron", &[0xff_u8, 0xfe, 0x00][..])]).unwrap_err();
    assert_says(&fault, "", &["not a text in UTF-8"]);
    assert_says(&load::<&str>("s.fbx", &[]).unwrap_err(), "", &["a scene is a `.ron`, `.obj`, `.gltf` or `.glb` file, not `.fbx`"]);
}

/// Every example of the guide's page is a scene, or a part of one.
#[test]
fn the_examples_of_the_guide_load() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/src/guide/scenes.md")).unwrap();
    let picture = std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/checker.png")).unwrap();
    let examples: Vec<&str> = page.split("```ron\n").skip(1).map(|rest| rest.split("```").next().unwrap()).collect();
    assert!(examples.len() >= 8, "{}", examples.len());
    for example in examples {
        let text = match example.split(['(', ':']).next().unwrap() {
            "Scene" => example.to_owned(),
            "Mesh" | "Metaballs" => format!("Scene(meshes: [{example}])"),
            "motion" => format!("Scene(meshes: [Mesh(file: \"room.obj\", {example})])"),
            "meshes" => format!("Scene({example})"),
            _ => format!("Scene(meshes: [\"room.obj\"], {example})"),
        };
        let reader = |path: &std::path::Path| match path.extension().and_then(|extension| extension.to_str()) {
            Some("ron") => Ok(text.clone().into_bytes()),
            Some("png") => Ok(picture.clone()),
            _ => Ok(ROOM.replace("usemtl walls", "usemtl white").into_bytes()),
        };
        let scene = Scene::load_with("s.ron", &reader).unwrap_or_else(|faults| panic!("{text}: {:?}", summary(&faults)));
        let known = |message: &str| message.starts_with("the scene has no") || message.contains("not in the material library");
        assert!(scene.warnings.0.iter().all(|warning| known(&warning.message)), "{:?}", summary(&scene.warnings));
    }
}
