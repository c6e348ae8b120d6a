//! Meshes that change their shape: key frames and metaballs.

use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};
use manylight_scene::{
    Deformation, Mesh, Metaballs, Scene, SceneState,
    bvh::Bvh,
    deform::Ball,
    motion::{Repeat, Track},
    points::{PointMethod, PointOptions, generate},
};
use proptest::prelude::*;

use crate::memory::{assert_says, load, ron, summary};

/// Two triangles in the plane z = 0, with normals; the second key frame is moved and turned upside down.
const SHEET: &str = "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 2 2 0\nvt 0 0\nvt 1 0\nvn 0 0 1\nf 1/1/1 2/2/1 3/1/1\nf 2/2/1 4/2/1 3/1/1\n";
const RAISED: &str = "v 0 0 1\nv 2 0 1\nv 0 4 1\nv 2 4 3\nvt 0.5 0\nvt 1 1\nvn 1 0 0\nf 1/1/1 2/2/1 3/1/1\nf 2/2/1 4/2/1 3/1/1\n";

fn sheet(motion: &str) -> Result<Scene, manylight_graph::diagnostics::Diagnostics> {
    let text = format!("Scene(meshes: [Mesh(file: \"sheet.obj\", motion: [{motion}], repeat: loop)])");
    let turned = SHEET.replace("f 2/2/1 4/2/1 3/1/1", "f 4/2/1 2/2/1 3/1/1");
    let larger = format!("{SHEET}v 5 5 5\nv 5 6 5\nf 1/1/1 2/2/1 5/1/1\n");
    let flat = SHEET.replace("v 2 2 0", "v 1 1 0");
    load(
        "s.ron",
        &[
            ("s.ron", text.as_str()),
            ("sheet.obj", SHEET),
            ("raised.obj", RAISED),
            ("turned.obj", &turned),
            ("larger.obj", &larger),
            ("flat.obj", &flat),
        ],
    )
}

#[test]
fn key_frames_are_exact_at_keys_and_mixed_between() {
    let scene = sheet("(time: 1), (time: 3, file: \"raised.obj\"), (time: 4)").unwrap();
    assert!(scene.deforms() && scene.features()["deforming_objects"]);
    assert!(!scene.features()["moving_objects"], "its keys are all at one place");
    let shape = |time: f64| scene.sample(time).deformed[0].shape.clone();
    let positions = |mesh: &Mesh| mesh.vertices.iter().map(|v| v.position).collect::<Vec<_>>();
    let (low, high) = (shape(1.0), shape(3.0));
    assert_eq!(positions(&low), [Vec3::ZERO, Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::new(2.0, 2.0, 0.0)]);
    let raised = [Vec3::Z, Vec3::new(2.0, 0.0, 1.0), Vec3::new(0.0, 4.0, 1.0), Vec3::new(2.0, 4.0, 3.0)];
    assert_eq!(positions(&high), raised);
    let middle = shape(2.0);
    for ((a, b), c) in low.vertices.iter().zip(&high.vertices).zip(&middle.vertices) {
        assert!(c.position.distance(0.5 * (a.position + b.position)) < 1e-6);
        assert!(c.normal.distance(Vec3::new(1.0, 0.0, 1.0).normalize()) < 1e-6, "{}", c.normal);
        assert_eq!((c.u, c.v), (a.u, a.v), "texture coordinates stay");
    }
    // The whole track starts again; what `state` says follows.
    assert_eq!(positions(&shape(6.0)), raised);
    let info = |time: f64| scene.sample(time).info;
    assert_eq!((info(3.0).bounds_max, info(3.0).bounds_min), (Vec3::new(2.0, 4.0, 3.0), Vec3::Z));
    assert_eq!((info(1.0).total_area, info(1.0).area_max, info(1.0).edge_min, info(1.0).triangle_count), (4.0, 2.0, 2.0, 2));
    assert!(info(3.0).total_area > 7.9 && info(3.0).edge_max > 4.0);
    assert_eq!(scene.room, scene_room(&scene, 2.0));
}

fn scene_room(scene: &Scene, time: f64) -> manylight_scene::deform::Room {
    let state = scene.sample(time);
    manylight_scene::deform::Room { vertices: scene.gpu_vertices_at(&state).len(), triangles: scene.gpu_triangles_at(&state).len() }
}

#[test]
fn one_file_in_all_keys_is_a_rigid_mesh() {
    let scene = sheet("(time: 1), (time: 3, file: \"sheet.obj\", translate: (1, 0, 0))").unwrap();
    assert!(!scene.deforms() && scene.features()["moving_objects"]);
    assert!(scene.sample(2.0).deformed.is_empty());
}

#[test]
fn key_frames_of_other_triangles_are_refused() {
    let fault = |file: &str| sheet(&format!("(time: 0), (time: 1, file: \"{file}\")")).unwrap_err();
    for (file, words) in [
        ("larger.obj", ["`larger.obj` cannot be a key frame of `sheet.obj`", "5 vertices, not 4", "export them from one mesh"]),
        ("flat.obj", ["`flat.obj` cannot be a key frame of `sheet.obj`", "1 triangles, not 2", "each face an area"]),
        ("turned.obj", ["`turned.obj` cannot be a key frame of `sheet.obj`", "triangle 2 of it joins other vertices", "same order"]),
        ("gone.obj", ["cannot read `gone.obj`", "no such file", ""]),
    ] {
        assert_says(&fault(file), &format!("\"{file}\""), &words);
    }
    assert_says(&ron("Scene(meshes: [Mesh(motion: [(time: 0, file: \"tri.obj\")])])").unwrap_err(), "Mesh", &["missing field `file`"]);
}

/// Two balls that part: the scene of most tests.
const PARTING: &str = "balls: [(position: (0, 0, 0), radius: 1.0),
    (position: (0.5, 0, 0), radius: 0.9, motion: [(time: 0), (time: 1, position: (2.5, 0.2, 0.1))])]";

fn metaballs(fields: &str) -> Scene {
    ron(&format!("Scene(meshes: [Metaballs({fields})])")).unwrap_or_else(|faults| panic!("{:?}", summary(&faults)))
}

fn surface(state: &SceneState) -> &Mesh {
    &state.deformed[0].shape
}

/// Asserts that every edge is that of two triangles that go along it in opposite ways, and returns V − E + F: twice the number of pieces
/// less twice the number of handles.
#[track_caller]
fn euler_characteristic(mesh: &Mesh) -> i64 {
    let mut edges: HashMap<(u32, u32), u32> = HashMap::new();
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.vertices;
        for edge in [(a, b), (b, c), (c, a)] {
            *edges.entry(edge).or_default() += 1;
        }
    }
    for (&(a, b), &count) in &edges {
        assert_eq!((count, edges.get(&(b, a))), (1, Some(&1)), "the edge from {a} to {b}");
    }
    let used: HashSet<u32> = mesh.triangles.iter().flat_map(|triangle| triangle.vertices).collect();
    assert_eq!(used.len(), mesh.vertices.len(), "a vertex without a triangle");
    used.len() as i64 - edges.len() as i64 / 2 + mesh.triangles.len() as i64
}

fn volume(mesh: &Mesh) -> f64 {
    mesh.triangles.iter().map(|triangle| mesh.corners(triangle)).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

#[test]
fn the_topology_changes_and_the_surface_stays_closed() {
    let scene = metaballs(PARTING);
    let characteristics: Vec<i64> = [0.0, 0.2, 0.8, 1.0].map(|time| euler_characteristic(surface(&scene.sample(time)))).into();
    assert_eq!(characteristics, [2, 2, 4, 4], "one piece, then two");
    let ring: String = (0..10)
        .map(|i| {
            let angle = f64::from(i) * 0.628;
            format!("(position: ({:.4}, {:.4}, 0), radius: 0.6, motion: [(time: 0), (time: 1, radius: 0)]),", angle.cos(), angle.sin())
        })
        .collect();
    let ring = metaballs(&format!("balls: [{ring}], cells: 40"));
    assert_eq!(euler_characteristic(surface(&ring.sample(0.0))), 0, "a ring has a handle");
    assert_eq!(surface(&ring.sample(1.0)).triangles.len(), 0);
    let counts: HashSet<usize> = (0..10).map(|i| surface(&scene.sample(f64::from(i) * 0.1)).triangles.len()).collect();
    assert!(counts.len() > 5, "the number of triangles changes: {counts:?}");
}

/// Cells, and the share of a cell by which vertices may be off the surface: measured 8e-3, 8e-7 and 1.5e-6, rounding of 32-bit coordinates.
const OFF_SURFACE: [(u32, f64); 3] = [(8, 0.05), (32, 1e-4), (64, 1e-4)];

#[test]
fn vertices_lie_on_the_surface_with_its_normals() {
    for (cells, most) in OFF_SURFACE {
        let scene = metaballs(&format!("{PARTING}, cells: {cells}"));
        let Some(Deformation::Metaballs(field)) = &scene.meshes[0].deformation else { panic!("no metaballs") };
        let (mut farthest, mut least_cosine) = (0.0_f64, 1.0_f64);
        for time in [0.0, 0.3, 0.9] {
            let state = scene.sample(time);
            let balls = field.balls(time);
            for vertex in &surface(&state).vertices {
                let (value, gradient) = Metaballs::field(&balls, vertex.position.as_dvec3());
                // To first order, in cells.
                farthest = farthest.max((value - 0.25).abs() / gradient.length() / field.cell());
                assert!(vertex.normal.is_normalized() && vertex.normal.as_dvec3().dot(gradient.normalize()) < -0.9999);
            }
            for triangle in &surface(&state).triangles {
                let [a, b, c] = surface(&state).corners(triangle);
                let Some(flat) = (b - a).cross(c - a).try_normalize() else { continue };
                let mean: DVec3 = triangle.vertices.iter().map(|i| surface(&state).vertices[*i as usize].normal.as_dvec3()).sum();
                least_cosine = least_cosine.min(flat.dot(mean.normalize()));
            }
            assert!(volume(surface(&state)) > 0.0, "counter-clockwise seen from outside");
        }
        println!("{cells} cells: {farthest:.2e} of a cell off, least cosine between flat and smooth normals {least_cosine:.3}");
        assert!(farthest <= most, "{cells} cells: {farthest} of a cell off the surface");
        assert!(least_cosine > if cells < 32 { 0.5 } else { 0.9 }, "{cells} cells: cosine {least_cosine}");
    }
}

#[test]
fn a_lone_ball_is_a_sphere_of_the_stated_radius() {
    let scene = metaballs("balls: [(position: (1, 2, 3), radius: 2.0)], cells: 48, material: \"clay\", transform: (scale: 2)");
    assert!(!scene.deforms(), "what stands still is a rigid mesh");
    assert_eq!((scene.objects[0].name.as_str(), scene.materials[0].name.as_str()), ("metaballs", "clay"));
    let radius = 2.0 * (1.0 - 0.25_f64.cbrt()).sqrt();
    let mesh = &scene.meshes[0];
    for vertex in &mesh.vertices {
        let distance = vertex.position.as_dvec3().distance(DVec3::new(1.0, 2.0, 3.0));
        assert!((distance / radius - 1.0).abs() < 1e-4, "{distance} is not {radius}");
    }
    let (pi, info) = (std::f64::consts::PI, scene.sample(0.0).info);
    assert!((volume(mesh) / (4.0 / 3.0 * pi * radius.powi(3)) - 1.0).abs() < 0.01);
    assert!((f64::from(info.total_area) / (4.0 * 4.0 * pi * radius.powi(2)) - 1.0).abs() < 0.01);
}

#[test]
fn materials_of_meshes_can_be_shared_and_changed() {
    let text =
        format!("Scene(meshes: [Metaballs({PARTING}, material: \"walls\"), \"room.obj\"], materials: {{\"walls\": (diffuse: 0.25)}})");
    let scene = ron(&text).unwrap();
    assert_eq!(scene.objects.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["metaballs", "room"]);
    assert_eq!(scene.materials.iter().filter(|m| m.name == "walls").count(), 1);
    let material = scene.gpu_triangles()[0].material as usize;
    assert_eq!((scene.materials[material].name.as_str(), scene.materials[material].diffuse), ("walls", Vec3::splat(0.25)));
}

/// The same time gives the same bits, also from a scene that is loaded again.
#[test]
fn the_same_time_is_the_same_geometry() {
    let (scene, again) = (metaballs(PARTING), metaballs(PARTING));
    assert!(scene == again);
    for time in [0.0, 0.37, 1.0, 0.37] {
        let state = scene.sample(time);
        assert_eq!(state, again.sample(time));
        assert_eq!(scene.gpu_vertices_at(&state), again.gpu_vertices_at(&again.sample(time)));
    }
}

#[test]
fn triangles_beyond_those_there_are_have_no_area() {
    let scene =
        ron(&format!("Scene(meshes: [Metaballs({PARTING}, name: \"blobs\", transform: (translate: (5, 0, 0))), \"room.obj\"])")).unwrap();
    for time in [0.0, 0.5, 1.0] {
        let state = scene.sample(time);
        let (vertices, triangles) = (scene.gpu_vertices_at(&state), scene.gpu_triangles_at(&state));
        assert!(scene.has_room(&state));
        assert_eq!((vertices.len(), triangles.len()), (scene.room.vertices, scene.room.triangles), "sizes never change");
        let used = state.info.triangle_count as usize;
        assert!(used < triangles.len() && used == surface(&state).triangles.len() + 12);
        for (index, triangle) in triangles.iter().enumerate() {
            let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(|i| vertices[i as usize].position);
            assert_eq!((b - a).cross(c - a).length() > 0.0, index < used, "triangle {index} of {used}");
        }
        let bvh = Bvh::build(&scene, &state);
        assert_eq!(bvh.triangles.len(), used);
        // Bounds are tight: a vertex touches each side, in world space.
        let world: Vec<Vec3> = (0..used)
            .flat_map(|t| [triangles[t].a, triangles[t].b, triangles[t].c].map(|i| (triangles[t].object, vertices[i as usize].position)))
            .map(|(object, p)| state.objects[object as usize].world_from_object.transform_point3(p))
            .collect();
        let (low, high) = world.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
        assert!(low.distance(state.info.bounds_min) < 1e-5 && high.distance(state.info.bounds_max) < 1e-5);
        let area: f32 = bvh.triangles.iter().map(|t| 0.5 * t.ab.cross(t.ac).length()).sum();
        assert!((area / state.info.total_area - 1.0).abs() < 1e-4);
    }
}

/// A ball that swells for a moment shorter than the times that are looked at: room grows and is kept.
#[test]
fn room_grows_where_it_was_not_foreseen() {
    let mut scene = metaballs(PARTING);
    let state = scene.sample(0.6);
    let foreseen = scene.room;
    assert!(!scene.make_room(&state), "there is room");
    scene.room.triangles = surface(&state).triangles.len() / 2;
    scene.room.vertices = 10;
    assert!(scene.make_room(&state), "too little");
    assert!(scene.has_room(&state) && !scene.make_room(&state));
    assert!(scene.room.triangles > surface(&state).triangles.len() && scene.room.vertices >= surface(&state).vertices.len());
    assert!(scene.room.triangles < 2 * foreseen.triangles);
}

#[test]
fn static_points_follow_a_deformed_shape() {
    let scene = metaballs(PARTING);
    for time in [0.0, 0.9] {
        let state = scene.sample(time);
        let options = PointOptions { method: PointMethod::Area { count: 2000 }, seed: 1 };
        let points = generate(&scene, &state.deformed, &options).unwrap();
        let area: f64 = points.iter().map(|point| f64::from(point.area)).sum();
        assert!((area / f64::from(state.info.total_area) - 1.0).abs() < 1e-4);
        let field = |p: Vec3| {
            let Some(Deformation::Metaballs(field)) = &scene.meshes[0].deformation else { panic!("no metaballs") };
            Metaballs::field(&field.balls(time), p.as_dvec3()).0
        };
        assert!(points.iter().all(|point| (field(point.position) - 0.25).abs() < 0.03), "time {time}");
    }
}

#[test]
fn faults_of_metaballs_have_their_places() {
    let with = |fields: &str| format!("balls: [(position: (0, 0, 0), radius: 1)], {fields}");
    let ball = |fields: &str| format!("balls: [({fields})]");
    let cases: Vec<(String, &str, &[&str])> = vec![
        ("level: 1".into(), "Metaballs", &["missing field `balls`"]),
        ("balls: []".into(), "[]", &["metaballs need a ball", "write `balls:"]),
        (with("level: 0"), "0", &["0 is out of range", "above 0"]),
        (with("level: -1"), "-1", &["-1 is out of range"]),
        (with("level: NaN"), "NaN", &["NaN"]),
        (with("cells: 0"), "0", &["0 cells are out of range", "1 to 256"]),
        (with("cells: 257"), "257", &["257 cells are out of range"]),
        (with("cells: 1.5"), "1.5", &["expected a number of cells", "without fraction"]),
        (with("cels: 2"), "cels", &["unknown field `cels`", "cells"]),
        (with("material: 3"), "3", &["expected a material"]),
        (with("level: 2"), "[(position: (0, 0, 0), radius: 1)]", &["no surface", "lower `level`"]),
        (ball("position: (0, 0, 0)"), "(", &["missing field `radius`"]),
        (ball("radius: 1"), "(", &["missing field `position`"]),
        (ball("position: (0, 0, 0), radius: -1"), "-1", &["-1 is out of range", "not negative"]),
        (ball("position: (0, 0, 0), radius: NaN"), "NaN", &["NaN"]),
        (ball("position: (0, inf, 0), radius: 1"), "inf", &["inf"]),
        (ball("position: (0, 0, 0), radius: 1, strength: 1e30"), "1e30", &["too large"]),
        (ball("position: (0, 0, 0), radius: 1, motion: [(time: 0, centre: 1)]"), "centre", &["unknown field `centre`", "position"]),
        (ball("position: (0, 0, 0), radius: 0"), "[(position: (0, 0, 0), radius: 0)]", &["no surface"]),
    ];
    for (fields, place, words) in cases {
        let faults = match ron(&format!("Scene(meshes: [Metaballs({fields})])")) {
            Ok(scene) => panic!("{fields} is accepted: {:?}", summary(&scene.warnings)),
            Err(faults) => faults,
        };
        assert_says(&faults, place, words);
        assert_eq!(faults.0.len(), 1, "{fields}: {:?}", summary(&faults));
    }
}

#[test]
fn metaballs_without_a_surface_are_warned_of_and_harmless() {
    let moving = "balls: [(position: (1, 2, 3), radius: 2, motion: [(time: 0), (time: 1, position: (2, 2, 3))])], level: 1.5";
    let scene = metaballs(moving);
    assert_says(&scene.warnings, "", &["no surface at any of the times"]);
    let state = scene.sample(0.5);
    assert_eq!((state.info.triangle_count, state.info.total_area, state.info.area_min, state.info.edge_max), (0, 0.0, 0.0, 0.0));
    assert!(state.bounds.diagonal() > 1.0 && state.camera_view(1.0).clip_from_world.is_finite());
    assert!(Bvh::build(&scene, &state).nodes.is_empty());
    let options = PointOptions { method: PointMethod::Area { count: 100 }, seed: 1 };
    assert!(generate(&scene, &state.deformed, &options).unwrap().is_empty());
}

/// A track of a ball from numbers that need not make sense.
fn track() -> impl Strategy<Value = Track<Ball>> {
    let number = prop_oneof![Just(0.0_f32), Just(1e15), Just(-1e15), Just(1e-40), -3.0_f32..3.0];
    let radius = prop_oneof![Just(0.0_f32), Just(1e-40), Just(1e15), 0.0_f32..2.0];
    let ball = (prop::array::uniform3(number.clone()), radius, number).prop_map(|(position, radius, strength)| Ball {
        position: position.into(),
        radius,
        strength,
    });
    prop::collection::vec(ball, 1..4)
        .prop_map(|balls| Track::keyed(balls.into_iter().enumerate().map(|(i, ball)| (i as f64, ball)).collect(), Repeat::Loop).unwrap())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    /// Whatever the balls are, the surface is closed, finite and the same each time.
    #[test]
    fn odd_metaballs(
        balls in prop::collection::vec(track(), 1..5),
        level in prop_oneof![Just(1e-40_f32), Just(1e15), 0.05_f32..1.5],
        cells in prop_oneof![Just(1_u32), Just(2), 3_u32..14],
        time in prop_oneof![Just(f64::NAN), Just(1e300), -2.0..4.0],
    ) {
        let metaballs = Metaballs::new(balls, level, cells, 7);
        let (vertices, triangles) = metaballs.surface(time);
        prop_assert_eq!((&vertices, &triangles), (&metaballs.surface(time).0, &metaballs.surface(time).1));
        prop_assert!(vertices.iter().all(|v| v.position.is_finite() && (v.normal == Vec3::ZERO || v.normal.is_normalized())));
        // Where sheets touch in one cell, four triangles may meet at an edge: as many go along it each way.
        let mut edges: HashMap<(u32, u32), i32> = HashMap::new();
        for triangle in &triangles {
            prop_assert!(triangle.material == 7 && triangle.vertices.iter().all(|i| (*i as usize) < vertices.len()));
            let [a, b, c] = triangle.vertices;
            for (a, b) in [(a, b), (b, c), (c, a)] {
                *edges.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        prop_assert!(edges.values().all(|balance| *balance == 0));
    }
}
