//! Scenes at a time.

use glam::Vec3;
use manylight_scene::gpu_data::{Falloff, LightKind};

use crate::memory::{obj, ron};

#[test]
fn objects_move_and_carry_their_area() {
    let scene = ron("Scene(meshes: [
        Mesh(file: \"tri.obj\", motion: [(time: 0.0), (time: 2.0, translate: (10.0, 0.0, 0.0), scale: 3.0)]),
        Mesh(file: \"tri.obj\", name: \"still\", transform: (translate: (0.0, 5.0, 0.0), rotate_deg: (0.0, 0.0, 90.0), scale: (2.0, 1.0, 1.0))),
    ])")
    .unwrap();
    assert_eq!(scene.meshes.len(), 1, "one file is one mesh");
    assert_eq!((scene.objects[0].name.as_str(), scene.objects[1].name.as_str()), ("tri", "still"));
    let start = scene.sample(0.0);
    assert!((start.info.total_area - 1.5).abs() < 1e-6);
    let end = scene.sample(2.0);
    assert!((end.info.total_area - (4.5 + 1.0)).abs() < 1e-5);
    let world = end.objects[0].world_from_object.transform_point3(Vec3::X);
    assert!(world.distance(Vec3::new(13.0, 0.0, 0.0)) < 1e-5);
    assert_eq!(end.info.bounds_max.x, 13.0);
    assert_eq!(end.info.bounds_min.x, -1.0, "the turned triangle reaches to −1");
    // Scaled by 2 along its x, then turned by 90° about z: x goes to y.
    let turned = end.objects[1].world_from_object.transform_point3(Vec3::X);
    assert!(turned.distance(Vec3::new(0.0, 7.0, 0.0)) < 1e-5, "{turned}");
}

#[test]
fn normals_stay_normal_under_uneven_and_mirrored_scales() {
    let scene =
        ron("Scene(meshes: [Mesh(file: \"tri.obj\", transform: (rotate_deg: (30.0, 40.0, 50.0), scale: (2.0, -0.5, 3.0)))])").unwrap();
    let object = scene.sample(0.0).objects[0];
    // A plane with normal n and tangents t, u.
    let (n, t, u) = (Vec3::new(1.0, 2.0, 2.0) / 3.0, Vec3::new(2.0, -2.0, 1.0), Vec3::new(2.0, 1.0, -2.0));
    let moved = object.normal_from_object.transform_vector3(n);
    for tangent in [t, u] {
        assert!(moved.dot(object.world_from_object.transform_vector3(tangent)).abs() < 1e-5);
    }
    // The side is kept: a point on the normal's side stays there.
    assert!(moved.dot(object.world_from_object.transform_vector3(n)) > 0.0);
}

#[test]
fn an_object_scaled_to_nothing_has_finite_normals() {
    let scene = ron("Scene(meshes: [\"room.obj\", Mesh(file: \"tri.obj\", motion: [(time: 0.0), (time: 1.0, scale: 0.0), (time: 2.0, scale: (1.0, 0.0, 1.0))])])").unwrap();
    for time in [0.0, 0.5, 1.0, 1.5, 2.0] {
        let state = scene.sample(time);
        let matrix = state.objects[1].normal_from_object;
        assert!(matrix.is_finite());
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            assert!(matrix.transform_vector3(axis).length() > 1e-9, "time {time}");
        }
        assert!(state.info.total_area.is_finite() && state.info.diagonal.is_finite());
    }
}

#[test]
fn the_light_moves_and_its_view_is_its_cone() {
    let scene = ron("Scene(meshes: [\"room.obj\"], lights: [Spot(position: (0.0, 0.0, 0.0), target: (0.0, 0.0, 1.0), intensity: 2.0,
        beam_deg: 10.0, cutoff_deg: 30.0, falloff: cosine,
        motion: [(time: 0.0), (time: 1.0, position: (1.0, 0.0, 0.0), target: (1.0, -1.0, 0.0), intensity: (4.0, 6.0, 8.0))])])")
    .unwrap();
    let state = scene.sample(0.5);
    let light = state.lights[0];
    assert_eq!(light.position, Vec3::new(0.5, 0.0, 0.0));
    assert_eq!(light.strength, Vec3::new(3.0, 4.0, 5.0));
    assert_eq!(light.falloff, Falloff::Cosine as u32);
    assert!(light.direction.distance(Vec3::new(0.0, -0.5, 0.5).normalize()) < 1e-6);
    let view = state.light_views[0].view;
    assert_eq!(view.forward, light.direction);
    assert!((view.tan_half_x - 30_f32.to_radians().tan()).abs() < 1e-6 && view.tan_half_x == view.tan_half_y);
    assert!((light.cutoff_rad - 30_f32.to_radians()).abs() < 1e-6);
    assert!(scene.features()["moving_lights"] && !scene.features()["several_lights"]);
}

#[test]
fn lights_share_their_power() {
    let spot = "Spot(position: (0, 0, 0), target: (0, 0, 1), intensity: (1, 2, 3), beam_deg: 10, cutoff_deg: 60)";
    let scene = ron(&format!(
        "Scene(meshes: [\"room.obj\"], lights: [Directional(direction: (0, 0, 2), irradiance: 2), Point(position: (0, 0, 0), intensity: 0),
        {spot}, Point(position: (0, 0.5, 0), intensity: (3, 0, 0), motion: [(time: 0), (time: 1, position: (1, 0.5, 0), intensity: 2)])])"
    ))
    .unwrap();
    let state = scene.sample(1.0);
    let [sun, dark, spot, point] = state.lights[..] else { panic!("four lights") };
    let kinds = [LightKind::Directional, LightKind::Point, LightKind::Spot, LightKind::Point];
    assert_eq!(state.lights.iter().map(|light| light.kind).collect::<Vec<_>>(), kinds.map(|kind| kind as u32));
    assert_eq!((point.position, point.strength), (Vec3::new(1.0, 0.5, 0.0), Vec3::splat(2.0)));
    // W, summed over the colours: E·π·r² over the room's sphere, with room for rounding; I·Ω with Ω = π sr for the cone.
    let radius = 3_f32.sqrt();
    assert!(sun.radius > radius && sun.radius < 1.01 * radius);
    assert!((sun.position + radius * sun.direction).length() < 0.01 * radius && sun.direction == Vec3::Z);
    let pi = std::f32::consts::PI;
    let powers = [6.0 * pi * sun.radius.powi(2), 0.0, 6.0 * pi, 6.0 * 4.0 * pi];
    let total: f32 = powers.iter().sum();
    for (light, power) in [sun, dark, spot, point].iter().zip(powers) {
        assert!((light.share - power / total).abs() < 1e-6, "{light:?}");
        assert!((light.ray_density - light.strength.element_sum() / total).abs() < 1e-6, "{light:?}");
    }
}

#[test]
fn dark_and_extreme_lights_have_finite_shares() {
    for lights in [
        "Point(position: (0, 0, 0), intensity: 0), Directional(direction: (0, 1, 0), irradiance: 0)",
        "Spot(position: (0, 0, 0), target: (0, 0, 1), intensity: 1, beam_deg: 0, cutoff_deg: 1e-40)",
        "Directional(direction: (0, 1, 0), irradiance: 1e15), Point(position: (1e15, 0, 0), intensity: 1e-30)",
    ] {
        for mesh in ["\"room.obj\"", "Mesh(file: \"room.obj\", motion: [(time: 0, scale: 0)])"] {
            let state = ron(&format!("Scene(meshes: [{mesh}], lights: [{lights}])")).unwrap().sample(0.0);
            assert!(state.lights.iter().all(|light| light.share.is_finite() && light.ray_density.is_finite()), "{:?}", state.lights);
            let views = &state.light_views;
            assert_eq!(views.len(), scene_views(lights));
            assert!(views.iter().all(|view| view.view.clip_from_world.is_finite() && (0.0..=1.0).contains(&view.weight)), "{views:?}");
        }
    }
}

/// Views of lights as a scene file lists them.
fn scene_views(lights: &str) -> usize {
    lights.matches("Spot").count() + lights.matches("Directional").count() + 6 * lights.matches("Point").count()
}

/// A corner of the scene is in one view of each light that reaches everywhere, and each view knows its light.
#[test]
fn views_of_lights_cover_the_scene() {
    let lights = "Directional(direction: (1, -2, 0.5), irradiance: 2), Point(position: (0.1, 0.2, -0.3), intensity: 3),
        Spot(position: (0, 0, 0), target: (0, 0, 1), intensity: 5, beam_deg: 10, cutoff_deg: 45), Point(position: (0, 0, 9), intensity: 1)";
    let scene = ron(&format!("Scene(meshes: [\"room.obj\"], lights: [{lights}])")).unwrap();
    let state = scene.sample(0.0);
    assert_eq!(state.light_views.len(), scene.light_view_count());
    assert_eq!(scene.light_view_count(), scene_views(lights));
    let of_light: Vec<_> = state.light_views.iter().map(|view| view.light).collect();
    assert_eq!(of_light, [0, 1, 1, 1, 1, 1, 1, 2, 3, 3, 3, 3, 3, 3]);
    assert!(state.light_views.iter().all(|view| view.kind == state.lights[view.light as usize].kind));
    for corner in state.bounds.corners() {
        let seen = |light: u32| {
            let clips =
                state.light_views.iter().filter(|v| v.light == light).map(|v| v.view.clip_from_world * corner.as_vec3().extend(1.0));
            clips.filter(|c| c.x.abs() < c.w && c.y.abs() < c.w && c.z > 0.0 && c.z <= c.w).count()
        };
        assert_eq!((seen(0), seen(1), seen(3)), (1, 1, 1), "{corner}");
    }
    // E·A of the square around the scene, I·4π/6 of a face, and of a spot light whose square has the same solid angle.
    let half = f64::from(state.lights[0].radius);
    let face = 4.0 * std::f64::consts::PI / 6.0;
    let powers = [(0, 2.0 * 4.0 * half * half), (1, 3.0 * face), (7, 5.0 * face), (8, face)];
    for (index, power) in powers {
        let weight = f64::from(state.light_views[index].weight);
        assert!((weight - power / powers[0].1).abs() < 1e-5, "view {index}: {weight}");
    }
}

#[test]
fn near_and_far_hold_the_scene() {
    for scale in [1e-3_f32, 1.0, 1e4] {
        let scene = ron(&format!("Scene(meshes: [Mesh(file: \"room.obj\", transform: (scale: {scale:?}))])")).unwrap();
        let state = scene.sample(0.0);
        let view = state.camera_view(1.0);
        let diagonal = state.info.diagonal;
        assert!((diagonal / (scale * 12_f32.sqrt()) - 1.0).abs() < 1e-5);
        assert!(view.near > 0.0 && view.near <= 1e-3 * diagonal * 1.001);
        for corner in state.bounds.corners() {
            assert!(view.far > (corner.as_vec3() - view.origin).length());
        }
        assert!(state.light_views[0].view.near < 2e-3 * diagonal);
    }
}

#[test]
fn fitted_camera_and_light_see_and_light_the_scene() {
    let scene = obj(crate::memory::ROOM).unwrap();
    assert_eq!(scene.warnings.0.len(), 3, "{:?}", crate::memory::summary(&scene.warnings));
    let state = scene.sample(0.0);
    for aspect in [0.5, 1.0, 16.0 / 9.0] {
        let view = state.camera_view(aspect);
        for corner in state.bounds.corners() {
            let clip = view.clip_from_world * corner.as_vec3().extend(1.0);
            assert!(clip.x.abs() <= clip.w && clip.y.abs() <= clip.w && clip.w > view.near, "{aspect}: {clip}");
        }
    }
    let light = state.lights[0];
    let distance = light.position.distance(state.bounds.centre().as_vec3());
    assert!((light.strength.x / distance.powi(2) - std::f32::consts::PI).abs() < 1e-4);
    assert!(state.bounds.distance(light.position.as_dvec3()) == 0.0 && light.position.y > 0.5);
    assert!(light.direction.dot(-light.position.normalize()) > 0.999);
}

#[test]
fn a_flat_scene_is_lit_from_above() {
    let scene = obj("v 0 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\n").unwrap();
    let state = scene.sample(0.0);
    assert!(state.lights[0].position.y > 0.1);
    assert!(state.camera_view(1.0).clip_from_world.is_finite());
}

#[test]
fn no_lights_is_dark() {
    let scene = ron("Scene(meshes: [\"tri.obj\"], lights: [])").unwrap();
    crate::memory::assert_says(&scene.warnings, "", &["black"]);
    let state = scene.sample(0.0);
    assert!(state.lights.is_empty());
    assert!(state.light_views[0].view.clip_from_world.is_finite());
    assert_eq!(state.info.light_count, 0);
}
