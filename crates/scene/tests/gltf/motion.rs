//! Animations against an evaluation in 64 bits.

use glam::{DMat4, DQuat, DVec3, Vec3};
use manylight_scene::Scene;

use super::build::{Doc, corners, gltf, triangle};
use crate::memory::{assert_says, load, summary};

/// A file of a triangle in node 0 with these nodes and animations.
fn rest(nodes: &str, animations: &str) -> String {
    format!(
        "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}},\"material\":0}}]}}],\"materials\":[{{}}],\"nodes\":[{nodes}],\"animations\":[{animations}]"
    )
}

/// An animation of one node's property by accessors.
fn animation(node: usize, path: &str, input: usize, output: usize, interpolation: &str) -> String {
    format!(
        "{{\"channels\":[{{\"sampler\":0,\"target\":{{\"node\":{node},\"path\":\"{path}\"}}}}],\
         \"samplers\":[{{\"input\":{input},\"output\":{output},\"interpolation\":\"{interpolation}\"}}]}}"
    )
}

fn scene(doc: &Doc, nodes: &str, animations: &[String]) -> Scene {
    let scene = gltf(&doc.gltf(&rest(nodes, &animations.join(",")))).unwrap_or_else(|faults| panic!("{faults}"));
    assert!(scene.warnings.0.len() <= 2, "{:?}", summary(&scene.warnings));
    scene
}

/// The largest distance of a corner from where it should be.
fn farthest(scene: &Scene, exact: impl Fn(f64) -> DMat4, end: f64) -> f64 {
    let mut farthest = 0.0_f64;
    for i in 0..1000 {
        let time = end * (f64::from(i) + 0.37) / 1000.0;
        let matrix = exact(time);
        for (found, corner) in corners(scene, time)[0].into_iter().zip([DVec3::ZERO, DVec3::X, DVec3::Y]) {
            farthest = farthest.max(found.distance(matrix.transform_point3(corner)));
        }
    }
    farthest
}

fn around_y(angle: f64) -> [f32; 4] {
    DQuat::from_rotation_y(angle).as_quat().to_array()
}

#[test]
fn straight_motion_and_turns_have_the_keys_of_the_file() {
    let mut doc = triangle();
    let times = doc.floats(&[[0.0_f32], [1.0], [3.0]]);
    let places = doc.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 4.0, 0.0]]);
    let turns = doc.floats(&[around_y(0.0), around_y(1.5), around_y(-0.5)]);
    let animations = [animation(0, "translation", times, places, "LINEAR"), animation(0, "rotation", times, turns, "LINEAR")];
    let scene = scene(&doc, "{\"mesh\":0,\"scale\":[2,2,2]}", &animations);
    assert_eq!(scene.objects[0].pose.keys().len(), 3);
    let exact = |time: f64| {
        let (a, b) = (time.min(1.0), (0.5 * (time - 1.0)).max(0.0));
        let turn = DQuat::from_rotation_y(1.5 * a - 2.0 * b);
        DMat4::from_scale_rotation_translation(DVec3::splat(2.0), turn, DVec3::new(a, 4.0 * b, 0.0))
    };
    assert!(farthest(&scene, exact, 3.0) < 1e-5);
    // Then it starts again.
    assert!(corners(&scene, 3.5)[0][0].distance(corners(&scene, 0.5)[0][0]) < 1e-6);
    assert!(scene.features()["moving_objects"]);
}

#[test]
fn a_turning_arm_carries_what_is_below_it() {
    let mut doc = triangle();
    let times = doc.floats(&[[0.0_f32], [1.0], [2.0]]);
    let turns = doc.floats(&[around_y(0.0), around_y(2.0), around_y(4.0)]);
    let sizes = doc.floats(&[[1.0, 1.0, 1.0], [3.0, 3.0, 3.0], [1.0, 1.0, 1.0]]);
    let animations = [animation(1, "rotation", times, turns, "LINEAR"), animation(0, "scale", times, sizes, "LINEAR")];
    let nodes = "{\"mesh\":0,\"translation\":[10,0,0]},{\"children\":[0],\"translation\":[0,1,0]}";
    let scene = scene(&doc, nodes, &animations);
    let exact = |time: f64| {
        let arm = DMat4::from_rotation_translation(DQuat::from_rotation_y(2.0 * time), DVec3::Y);
        arm * DMat4::from_scale_rotation_translation(DVec3::splat(1.0 + 2.0 * (1.0 - (time - 1.0).abs())), DQuat::IDENTITY, 10.0 * DVec3::X)
    };
    let found = farthest(&scene, exact, 2.0);
    // A thousandth of its largest size, 3 √2, and a little for what lies between the times looked at.
    assert!(found < 1.2e-3 * 3.0 * 2.0_f64.sqrt(), "{found}");
    assert!((20..600).contains(&scene.objects[0].pose.keys().len()), "{}", scene.objects[0].pose.keys().len());
}

#[test]
fn steps_jump_and_splines_bend() {
    let mut doc = triangle();
    let times = doc.floats(&[[0.5_f32], [1.0], [2.0]]);
    let places = doc.floats(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [5.0, 4.0, 0.0]]);
    let stepping = scene(&doc, "{\"mesh\":0}", &[animation(0, "translation", times, places, "STEP")]);
    for (time, x) in [(0.0, 0.0), (0.7, 0.0), (1.0 - 1e-5, 0.0), (1.0, 1.0), (1.7, 1.0), (1.999, 1.0)] {
        assert_eq!(corners(&stepping, time)[0][0].x, x, "{time}");
    }
    // Slope in, value, slope out.
    let keys: [[f32; 3]; 9] = [
        [0.0; 3],
        [0.0; 3],
        [4.0, 0.0, -2.0],
        [1.0, 3.0, 0.0],
        [1.0, 0.0, 0.0],
        [-5.0, 1.0, 0.0],
        [0.0, 2.0, 0.0],
        [5.0, 4.0, 0.0],
        [9.0; 3],
    ];
    let spline = doc.floats(&keys);
    let bending = scene(&doc, "{\"mesh\":0}", &[animation(0, "translation", times, spline, "CUBICSPLINE")]);
    let key = |i: usize| DVec3::from_array(keys[i].map(f64::from));
    let hermite = |time: f64| {
        let Some((k, start, length)) = [(0, 0.5, 0.5), (1, 1.0, 1.0)].into_iter().rfind(|(_, start, _)| *start <= time) else {
            return key(1);
        };
        let t = (time - start) / length;
        let (t2, t3) = (t * t, t * t * t);
        key(3 * k + 1) * (2.0 * t3 - 3.0 * t2 + 1.0)
            + key(3 * k + 2) * length * (t3 - 2.0 * t2 + t)
            + key(3 * k + 4) * (3.0 * t2 - 2.0 * t3)
            + key(3 * k + 3) * length * (t3 - t2)
    };
    let found = farthest(&bending, |time| DMat4::from_translation(hermite(time)), 2.0);
    assert!(found < 1.2e-3 * 2.0_f64.sqrt(), "{found}");
}

#[test]
fn cameras_and_lights_ride_on_nodes() {
    let mut doc = triangle();
    let times = doc.floats(&[[0.0_f32], [2.0]]);
    let turns = doc.floats(&[around_y(0.0), around_y(3.0)]);
    let light = "\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}}";
    let nodes =
        format!("{{\"mesh\":0}},{{\"children\":[2,3]}},{{\"camera\":0,\"translation\":[0,0,8]}},{{{light},\"translation\":[0,3,0]}}");
    let more = ",\"cameras\":[{\"type\":\"perspective\",\"perspective\":{\"yfov\":0.8,\"aspectRatio\":1,\"znear\":0.1}}],\
        \"extensions\":{\"KHR_lights_punctual\":{\"lights\":[{\"type\":\"spot\",\"intensity\":683,\"spot\":{}}]}}";
    let text = doc.gltf(&(rest(&nodes, &animation(1, "rotation", times, turns, "LINEAR")) + more));
    let scene = gltf(&text).unwrap();
    assert!(scene.warnings.0.is_empty(), "{:?}", summary(&scene.warnings));
    assert!(!scene.features()["moving_objects"] && scene.features()["moving_camera"] && scene.features()["moving_lights"]);
    for i in 0..200 {
        let time = f64::from(i) * 0.01;
        let turn = DQuat::from_rotation_y(1.5 * time);
        let camera = scene.camera.at(time);
        assert!(camera.origin.as_dvec3().distance(turn * (8.0 * DVec3::Z)) < 3e-4, "{time}");
        let way = (camera.target - camera.origin).as_dvec3().normalize();
        assert!(way.distance(turn * DVec3::NEG_Z) < 2e-4 && camera.up.abs_diff_eq(Vec3::Y, 1e-5), "{time}");
        assert!(scene.lights[0].pose.at(time).direction().as_dvec3().distance(turn * DVec3::NEG_Z) < 2e-4, "{time}");
    }
    // In a scene file it is a mesh.
    let scene = load("s.ron", &[("s.ron", "Scene(meshes: [\"a.gltf\"])"), ("a.gltf", &text)]).unwrap();
    for what in
        ["animations are left out of a mesh", "cameras are left out of a mesh", "lights are left out of a mesh", "no camera", "no light"]
    {
        assert_says(&scene.warnings, "", &[what]);
    }
    assert!(!scene.features()["moving_objects"]);
}

#[test]
fn odd_animations_leave_their_node_at_rest_and_say_why() {
    let mut doc = triangle();
    let times = doc.floats(&[[0.0_f32], [1.0]]);
    let backwards = doc.floats(&[[1.0_f32], [0.0]]);
    let places = doc.floats(&[[0.0, 0.0, 5.0], [1.0, 0.0, 5.0]]);
    let three = doc.floats(&[[0.0, 0.0, 5.0]; 3]);
    let endless = doc.floats(&[[0.0, 0.0, f32::NAN]; 2]);
    let no_turn = doc.floats(&[[0.0; 4]; 2]);
    let none = doc.raw("\"componentType\":5126,\"type\":\"SCALAR\",\"count\":0,\"bufferView\":0");
    let cases = [
        (animation(0, "translation", backwards, places, "LINEAR"), "the times of key frames do not increase from 0"),
        (animation(0, "translation", times, three, "LINEAR"), "3 values for 2 key frames"),
        (animation(0, "translation", times, places, "CUBICSPLINE"), "2 values for 2 key frames"),
        (animation(0, "translation", times, endless, "LINEAR"), "not finite"),
        (animation(0, "rotation", times, no_turn, "LINEAR"), "no unit quaternion"),
        (animation(0, "rotation", times, places, "LINEAR"), "3 numbers an element, not 4"),
        (animation(0, "translation", none, places, "LINEAR"), "no key frame"),
        (animation(0, "weights", times, times, "LINEAR"), "morph targets"),
        (animation(0, "pointer", times, times, "LINEAR"), "anything but nodes"),
        (animation(0, "translation", times, places, "LINEAR").replace("\"node\":0,", ""), "anything but nodes"),
    ];
    for (animation, words) in cases {
        let scene = gltf(&doc.gltf(&rest("{\"mesh\":0}", &animation))).unwrap_or_else(|faults| panic!("{words}: {faults}"));
        assert_says(&scene.warnings, "", &["`a.gltf`: animations[0].channels[0]", words]);
        assert!(!scene.objects[0].pose.moves(), "{words}");
        assert_eq!(corners(&scene, 0.5)[0][0], DVec3::ZERO);
    }
    let twice = [animation(0, "translation", times, places, "LINEAR"), animation(0, "translation", times, places, "STEP")].join(",");
    let scene = gltf(&doc.gltf(&rest("{\"mesh\":0}", &twice))).unwrap();
    assert_says(&scene.warnings, "", &["animations[1].channels[0]", "the first is shown"]);
    assert_eq!(corners(&scene, 0.5)[0][0], DVec3::new(0.5, 0.0, 5.0));
    // A key frame that is everywhere the same is no motion.
    let still = doc.floats(&[[0.0, 0.0, 5.0]; 2]);
    let scene = gltf(&doc.gltf(&rest("{\"mesh\":0}", &animation(0, "translation", times, still, "LINEAR")))).unwrap();
    assert_eq!((scene.features()["moving_objects"], corners(&scene, 0.0)[0][0].z), (false, 5.0));
}

#[test]
fn what_shears_while_it_moves_is_told() {
    let mut doc = triangle();
    let times = doc.floats(&[[0.0_f32], [1.0]]);
    let turns = doc.floats(&[around_y(0.0), around_y(1.0)]);
    let nodes = "{\"mesh\":0},{\"children\":[0],\"scale\":[1,1,3]}";
    let scene = gltf(&doc.gltf(&rest(nodes, &animation(0, "rotation", times, turns, "LINEAR")))).unwrap();
    assert_says(&scene.warnings, "", &["nodes[0]", "shown without shear"]);
    assert!(scene.features()["moving_objects"]);
}
