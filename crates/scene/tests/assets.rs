//! The scenes of this repository, and larger ones if they lie beside it.

use std::{path::Path, time::Instant};

use glam::Vec3;
use manylight_scene::Scene;

use crate::memory::summary;

const ASSETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets");

fn asset(name: &str) -> Scene {
    let scene = Scene::load(format!("{ASSETS}/{name}")).unwrap_or_else(|faults| panic!("{faults:?}"));
    assert!(scene.warnings.0.is_empty(), "{name}: {:?}", summary(&scene.warnings));
    scene
}

#[test]
fn every_scene_says_what_it_is_and_its_licence() {
    let mut count = 0;
    for entry in std::fs::read_dir(ASSETS).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "ron") {
            let text = std::fs::read_to_string(&path).unwrap();
            let comment: String = text.lines().take_while(|line| line.starts_with("//")).collect();
            assert!(comment.contains("CC0") && comment.len() > 40, "{}", path.display());
            let _ = asset(&path.file_name().unwrap().to_string_lossy());
            count += 1;
        }
    }
    assert!(count >= 4);
}

#[test]
fn the_cornell_box_is_the_published_one() {
    let scene = asset("cornell.ron");
    assert_eq!(scene.triangle_count(), 30);
    assert_eq!(asset("cornell_empty.ron").triangle_count(), 10);
    let red = scene.materials.iter().find(|material| material.name == "red").unwrap();
    assert_eq!(red.diffuse, Vec3::new(0.63, 0.065, 0.05));
    let info = scene.sample(0.0).info;
    assert_eq!((info.bounds_min, info.bounds_max), (Vec3::ZERO, Vec3::new(5.56, 5.488, 5.592)));
}

#[test]
fn the_glossy_box_has_all_kinds_of_surfaces() {
    let scene = asset("glossy.ron");
    let features = scene.features();
    assert!(features["glossy"] && features["textures"] && features["normals"]);
    assert!(!features["moving_objects"]);
    assert_eq!(scene.textures.count, 1);
}

#[test]
fn the_moving_box_sweeps_over_its_edge() {
    let scene = asset("moving.ron");
    let features = scene.features();
    assert!(features["moving_objects"] && features["moving_lights"] && !features["moving_camera"]);
    assert_eq!(scene.camera.keys().len(), 1);
    // Over the whole motion everything stays in the box, and the axis hits both walls.
    let (mut back, mut side) = (0, 0);
    for i in 0..100 {
        let state = scene.sample(f64::from(i) * 0.1);
        assert!(state.bounds.min.min_element() > -1e-3 && state.bounds.max.max_element() < 5.6, "{:?}", state.bounds);
        let light = state.lights[0];
        let to_back = (5.59 - light.position.z) / light.direction.z;
        let at = light.position + light.direction * to_back;
        if light.direction.z > 0.0 && at.x > 0.05 {
            back += 1;
        } else {
            side += 1;
        }
    }
    assert!(back > 30 && side > 30, "{back} {side}");
    assert_eq!(scene.sample(0.0).lights, scene.sample(10.0).lights);
}

/// The scenes of the reference images: `MANYLIGHT_SHARED`, or `shared` beside the repository.
#[test]
fn the_reference_scenes_load() {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("MANYLIGHT_SHARED").map_or(beside, Into::into);
    let scenes = [("cornell_blocks", 30), ("cornell_empty", 10), ("cornell_objects", 75_781), ("sponza", 66_453)];
    if !shared.join("scenes").is_dir() {
        println!("not run: no reference scenes in {}", shared.display());
        return;
    }
    for (name, triangles) in scenes {
        let start = Instant::now();
        let scene = Scene::load(shared.join(format!("scenes/{name}/{name}.ron"))).unwrap_or_else(|faults| panic!("{faults:?}"));
        println!("{name}: {:.3} s, {:?}", start.elapsed().as_secs_f64(), summary(&scene.warnings));
        // Up to a few that repeat others.
        let found = scene.triangle_count();
        assert!(found <= triangles && found * 1000 >= triangles * 998, "{name}: {found} of {triangles}");
        let state = scene.sample(0.0);
        assert!(state.info.diagonal > 1.0 && state.info.total_area.is_finite());
    }
}
