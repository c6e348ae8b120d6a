//! Cameras and lights.

use glam::Vec3;
use manylight_scene::{Light, LightShape, Scene};

use super::build::{gltf, triangle};
use crate::memory::assert_says;

fn with(nodes: &str, more: &str) -> Scene {
    let rest = format!(
        "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0}},\"material\":0}}]}}],\"materials\":[{{}}],\"nodes\":[{{\"mesh\":0}},{nodes}],{more}"
    );
    gltf(&triangle().gltf(&rest)).unwrap_or_else(|faults| panic!("{faults}"))
}

#[test]
fn the_first_perspective_camera_sees_as_wide_as_it_says() {
    let cameras = "\"cameras\":[{\"type\":\"orthographic\",\"orthographic\":{\"xmag\":1,\"ymag\":1,\"znear\":0.1,\"zfar\":9}},\
        {\"type\":\"perspective\",\"perspective\":{\"yfov\":0.8,\"aspectRatio\":1.5,\"znear\":0.1}},\
        {\"type\":\"perspective\",\"perspective\":{\"yfov\":0.3,\"znear\":0.1}}]";
    // Turned by a quarter to the left: from −z to −x.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let second = format!("{{\"camera\":1,\"translation\":[1,2,3],\"rotation\":[0,{half},0,{half}]}}");
    let scene = with(&format!("{{\"camera\":0}},{second},{{\"camera\":2}}"), cameras);
    let camera = scene.camera.at(0.0);
    assert_eq!(camera.origin, Vec3::new(1.0, 2.0, 3.0));
    assert!((camera.fov_x_deg - 2.0 * (0.4_f32.tan() * 1.5).atan().to_degrees()).abs() < 1e-4);
    let view = scene.sample(0.0).camera_view(1.5);
    assert!(view.forward.abs_diff_eq(Vec3::NEG_X, 1e-6), "{}", view.forward);
    assert!(camera.up.abs_diff_eq(Vec3::Y, 1e-6));
    assert_says(&scene.warnings, "", &["cameras[0]", "without perspective"]);
    assert_says(&scene.warnings, "", &["cameras[2]", "other than the first"]);

    let scene = with("{\"camera\":2}", cameras);
    assert!((scene.camera.at(0.0).fov_x_deg - 2.0 * (0.15_f32.tan() * 16.0 / 9.0).atan().to_degrees()).abs() < 1e-4);
    assert_says(&scene.warnings, "", &["cameras[2].perspective.aspectRatio", "16:9"]);
    let odd = "\"cameras\":[{\"type\":\"perspective\",\"perspective\":{\"yfov\":0,\"znear\":0.1}}]";
    assert_says(&with("{\"camera\":0}", odd).warnings, "", &["cameras[0].perspective.yfov", "0 or 180"]);
    assert_says(&with("{\"camera\":0}", odd).warnings, "", &["the scene has no camera"]);
}

/// Nodes 1 and following with these lights.
fn lights(lights: &[&str], node: &str) -> Scene {
    let nodes: Vec<_> =
        (0..lights.len()).map(|i| format!("{{{node}\"extensions\":{{\"KHR_lights_punctual\":{{\"light\":{i}}}}}}}")).collect();
    let list = lights.iter().map(|light| format!("{{{light}}}")).collect::<Vec<_>>().join(",");
    let more = format!("\"extensionsUsed\":[\"KHR_lights_punctual\"],\"extensions\":{{\"KHR_lights_punctual\":{{\"lights\":[{list}]}}}}");
    with(&nodes.join(","), &more)
}

#[test]
fn lights_have_watts_of_their_candela_and_lux() {
    let written = [
        "\"type\":\"spot\",\"intensity\":683,\"color\":[1,0.5,0],\"spot\":{\"innerConeAngle\":0.2,\"outerConeAngle\":0.5}",
        "\"type\":\"point\",\"intensity\":1366",
        "\"type\":\"directional\",\"intensity\":341.5",
        "\"type\":\"spot\",\"spot\":{}",
    ];
    // Turned so that −z becomes −y.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let scene = lights(&written, &format!("\"translation\":[1,2,3],\"rotation\":[-{half},0,0,{half}],\"scale\":[3,3,3],"));
    let pose = |light: &Light| light.pose.at(0.0);
    let [spot, point, directional, default] = scene.lights.as_slice() else { panic!("{:?}", scene.lights) };
    assert!(pose(spot).strength.abs_diff_eq(Vec3::new(1.0, 0.5, 0.0), 1e-6));
    assert_eq!(pose(spot).position, Vec3::new(1.0, 2.0, 3.0));
    assert!(pose(spot).direction().abs_diff_eq(Vec3::NEG_Y, 1e-6));
    let LightShape::Spot { beam_deg, cutoff_deg, .. } = spot.shape else { panic!("{:?}", spot.shape) };
    assert!((beam_deg.to_radians() - 0.2).abs() < 1e-6 && (cutoff_deg.to_radians() - 0.5).abs() < 1e-6);
    assert_eq!((point.shape, pose(point).strength), (LightShape::Point, Vec3::splat(2.0)));
    assert_eq!((directional.shape, pose(directional).strength), (LightShape::Directional, Vec3::splat(0.5)));
    assert!(pose(directional).direction().abs_diff_eq(Vec3::NEG_Y, 1e-6));
    let LightShape::Spot { beam_deg, cutoff_deg, .. } = default.shape else { panic!("{:?}", default.shape) };
    assert!(beam_deg == 0.0 && (cutoff_deg - 45.0).abs() < 1e-4);
    assert!(scene.warnings.0.len() == 1, "only the camera is missing: {}", scene.warnings);
}

/// The fall-off that the extension recommends is the square of a share that is linear in the cosine.
#[test]
fn a_spot_falls_off_nearly_as_recommended() {
    let (beam, cutoff) = (0.0_f64, std::f64::consts::FRAC_PI_4);
    let worst = (0..=100)
        .map(|i| {
            let angle = cutoff * f64::from(i) / 100.0;
            let recommended = ((angle.cos() - cutoff.cos()) / (beam.cos() - cutoff.cos())).powi(2);
            let t = (cutoff - angle) / (cutoff - beam);
            (recommended - t * t * (3.0 - 2.0 * t)).abs()
        })
        .fold(0.0, f64::max);
    assert!(worst < 0.05, "the guide says 0.05: {worst}");
}

#[test]
fn odd_lights_are_mended_or_left_out() {
    let cases = [
        ("\"type\":\"point\",\"range\":5", "range", "for ever", 1),
        ("\"type\":\"spot\",\"spot\":{\"outerConeAngle\":1.5707964}", "outerConeAngle", "89 degrees", 1),
        ("\"type\":\"spot\",\"spot\":{\"outerConeAngle\":0}", "spot", "no angle", 1),
        ("\"type\":\"point\",\"intensity\":-1", "lights[0]", "negative or not finite", 1),
        ("\"type\":\"point\",\"extensions\":{\"X_glow\":{}}", "lights[0].extensions", "`X_glow`", 1),
    ];
    for (light, place, message, count) in cases {
        let scene = lights(&[light], "");
        assert_says(&scene.warnings, "", &["extensions.KHR_lights_punctual.lights[0]", place, message]);
        assert_eq!(scene.lights.len(), count);
    }
    // Inner and outer cone alike.
    let scene = lights(&["\"type\":\"spot\",\"spot\":{\"innerConeAngle\":0.5,\"outerConeAngle\":0.5}"], "");
    let LightShape::Spot { beam_deg, cutoff_deg, .. } = scene.lights[0].shape else { panic!("{:?}", scene.lights) };
    assert!(beam_deg < cutoff_deg && beam_deg > 0.99 * cutoff_deg);
}
