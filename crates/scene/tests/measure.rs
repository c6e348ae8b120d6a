//! Measured features: values known by thought, honest errors, the same bits whatever the threads, no scene that they fail on.

use std::{collections::HashMap, fs, io, path::Path, sync::Arc};

use glam::DVec3;
use manylight_graph::features::Measured;
use manylight_scene::{MeasureOptions, Measures, Scene, bvh::Bvh, gpu_data::View};

fn asset(name: &str) -> Scene {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets")).join(name);
    Scene::load(&path).unwrap_or_else(|e| panic!("{e}"))
}

/// A scene of files in memory; `assets/` has the others.
fn made(text: &str, files: &[(&str, &str)]) -> Scene {
    let files: HashMap<&str, &str> = files.iter().copied().chain([("scene.ron", text)]).collect();
    let reader = |path: &Path| -> io::Result<Vec<u8>> {
        let name = path.to_str().unwrap_or_default();
        let in_assets = || fs::read(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets")).join(path));
        files.get(name).map_or_else(in_assets, |text| Ok(text.as_bytes().to_vec()))
    };
    Scene::load_with("scene.ron", &reader).unwrap_or_else(|e| panic!("{e}"))
}

fn quick() -> MeasureOptions {
    MeasureOptions { samples: 4096, ..Default::default() }
}

/// Fails unless the estimate is within four standard errors and `known`, the share of itself that the expected value is known to.
#[track_caller]
fn agrees(measured: Measured, expected: f64, known: f64) {
    let allowed = 4.0 * measured.standard_error + known * expected;
    assert!((measured.value - expected).abs() <= allowed, "{measured:?} instead of {expected} ± {allowed}");
}

const ALBEDO: f32 = 0.5;

/// A hollow sphere around a light and the camera.
fn sphere(kd: f32) -> Scene {
    let mesh = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/sphere.obj")).unwrap();
    let scene = "Scene(
        meshes: [\"wall.obj\"],
        camera: (origin: (0.0, 0.0, 0.0), target: (-2.0, 0.0, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 90.0),
        lights: [Point(position: (0.0, 0.0, 0.0), intensity: 3.0)],
    )";
    let wall = format!("newmtl ball\nKd {kd} {kd} {kd}\n");
    made(scene, &[("wall.obj", &mesh.replace("objects.mtl", "wall.mtl")), ("wall.mtl", &wall)])
}

/// All of the wall gets the same light, and what it reflects reaches all of the wall alike: with albedo a, light of n bounces is in proportion to aⁿ.
#[test]
fn a_hollow_sphere_is_known_by_thought() {
    let measures = sphere(ALBEDO).measure(&quick());
    println!("{:?}", measures.features);
    // The sphere is 1280 triangles inside of it: near their edges a smooth normal and the triangle do not see the same.
    agrees(measures["second_bounce"], f64::from(ALBEDO).powi(2), 0.02);
    agrees(measures["unseen_light"], 5.0 / 6.0, 0.01);
    agrees(measures["lit_share"], 1.0, 0.0);
    assert_eq!(measures["direct_occlusion"].value, 0.0);
    assert_eq!(measures["specular_energy"], Measured { value: 0.0, standard_error: 0.0 });
    assert!(measures["indirect_occlusion"].value < 0.01, "{:?}", measures["indirect_occlusion"]);
    // The middle of a triangle is nearer than its corners, by less than 1.5 %.
    assert!(measures["depth_spread"].value < 0.01, "{:?}", measures["depth_spread"]);
}

/// A wall that the light meets, one that the camera sees, facing it, and a larger one between them or not.
fn walls(middle: bool) -> Scene {
    let between = if middle { "v 0 -3 -3\nv 0 3 -3\nv 0 3 3\nv 0 -3 3\nf 9 10 11 12\n" } else { "" };
    let mesh =
        format!("v -2 -1 -1\nv -2 1 -1\nv -2 1 1\nv -2 -1 1\nf 1 2 3 4\nv 2 -1 -1\nv 2 1 -1\nv 2 1 1\nv 2 -1 1\nf 5 6 7 8\n{between}");
    let scene = "Scene(
        meshes: [\"walls.obj\"],
        camera: (origin: (0.5, 0.0, 0.0), target: (2.0, 0.0, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 40.0),
        lights: [Spot(position: (-1.0, 0.0, 0.0), target: (-2.0, 0.0, 0.0), intensity: 10.0, beam_deg: 15.0, cutoff_deg: 20.0)],
    )";
    made(scene, &[("walls.obj", &mesh)])
}

#[test]
fn a_wall_between_blocks_all_of_one_bounce() {
    let measures = walls(true).measure(&quick());
    agrees(measures["indirect_occlusion"], 1.0, 0.0);
    assert!(measures["indirect_occlusion"].standard_error < 0.02, "{:?}", measures["indirect_occlusion"]);
    assert_eq!(measures["unseen_light"].value, 1.0);
    let measures = walls(false).measure(&quick());
    assert_eq!(measures["indirect_occlusion"].value, 0.0);
    // A circle in a square that is as wide.
    agrees(measures["lit_share"], std::f64::consts::FRAC_PI_4, 0.0);
}

/// A floor seen from above in parallel light, and a plate above the camera whose shadow ends in the middle of the picture.
#[test]
fn half_of_a_floor_is_in_shadow() {
    half_a_floor(1);
}

/// Of many lights, some are looked at from each point.
#[test]
fn half_of_a_floor_is_in_the_shadow_of_many_lights() {
    half_a_floor(21);
}

fn half_a_floor(lights: usize) {
    let mesh = "v -9 0 -9\nv -9 0 9\nv 9 0 9\nv 9 0 -9\nf 1 2 3 4\nv -30 10 -20\nv -30 10 20\nv -10 10 20\nv -10 10 -20\nf 5 6 7 8\n";
    let lights = "Directional(direction: (1.0, -1.0, 0.0), irradiance: 3.0),".repeat(lights);
    let scene = format!(
        "Scene(
        meshes: [\"floor.obj\"],
        camera: (origin: (0.0, 2.0, 0.0), target: (0.0, 0.0, 0.0), up: (1.0, 0.0, 0.0), fov_x_deg: 60.0),
        lights: [{lights}],
    )"
    );
    let measures = made(&scene, &[("floor.obj", mesh)]).measure(&quick());
    agrees(measures["direct_occlusion"], 0.5, 0.0);
    assert!(measures["direct_occlusion"].standard_error < 0.01);
}

/// Standard errors say how far estimates with other seeds are from each other.
#[test]
fn standard_errors_are_honest() {
    const SEEDS: u32 = 40;
    let scene = asset("glossy.ron");
    let runs: Vec<Measures> = (0..SEEDS).map(|seed| scene.measure(&MeasureOptions { seed, samples: 1024, ..Default::default() })).collect();
    for name in runs[0].features.keys() {
        let values: Vec<Measured> = runs.iter().map(|run| run[name]).collect();
        let mean = values.iter().map(|m| m.value).sum::<f64>() / f64::from(SEEDS);
        let spread = (values.iter().map(|m| (m.value - mean).powi(2)).sum::<f64>() / f64::from(SEEDS - 1)).sqrt();
        let stated = (values.iter().map(|m| m.standard_error.powi(2)).sum::<f64>() / f64::from(SEEDS)).sqrt();
        println!("{name}: {mean:.4}, spread {spread:.5}, stated {stated:.5}");
        // 40 values give their own spread to 11 %; an error that is stated too large hides nothing.
        assert!(spread <= 1.4 * stated, "{name}: spread {spread}, stated {stated}");
        assert!(stated <= 2.0 * spread + 2e-3, "{name}: spread {spread}, stated {stated}");
    }
}

#[test]
fn threads_change_no_bit_and_the_seed_does() {
    let scene = asset("moving.ron");
    let with =
        |threads, seed| scene.measure(&MeasureOptions { threads: Some(threads), seed, samples: 1024, times: 2, ..Default::default() });
    let one = with(1, 0);
    for threads in [2, 5, 64] {
        assert_eq!(with(threads, 0), one, "{threads} threads");
    }
    assert_ne!(with(1, 1), one);
}

const NOTHING: Measured = Measured { value: 0.0, standard_error: 0.0 };

#[test]
fn scenes_without_light_or_surface_have_features_all_the_same() {
    let square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";
    let with = |lights: &str, camera: &str, kd: f32| {
        let text = format!(
            "Scene(meshes: [\"square.obj\"], camera: (origin: (0.0, 0.0, 3.0), target: {camera}), lights: [{lights}], materials: {{}})"
        );
        let wall = format!("newmtl wall\nKd {kd} {kd} {kd}\n");
        made(&text, &[("square.obj", &format!("mtllib wall.mtl\nusemtl wall\n{square}")), ("wall.mtl", &wall)])
    };
    let spot = |strength: &str| {
        format!("Spot(position: (0.0, 0.0, 2.0), target: (0.0, 0.0, 0.0), intensity: {strength}, beam_deg: 10.0, cutoff_deg: 20.0)")
    };
    let (here, away) = ("(0.0, 0.0, 0.0)", "(0.0, 0.0, 9.0)");
    let cases = [
        ("no light", with("", here, 0.5)),
        ("a dark light", with(&spot("0.0"), here, 0.5)),
        ("a black wall", with(&spot("1.0"), here, 0.0)),
        ("a camera that sees nothing", with(&spot("1.0"), away, 0.5)),
        ("a very strong light", with(&spot("1.0e15"), here, 0.5)),
        ("a very weak light", with(&spot("1.0e-30"), here, 0.5)),
    ];
    for (name, scene) in cases {
        let measures = scene.measure(&MeasureOptions { samples: 256, ..Default::default() });
        for (feature, m) in &measures.features {
            assert!(m.value.is_finite() && m.standard_error.is_finite(), "{name}: {feature} is {m:?}");
            assert!(m.value >= 0.0 && m.standard_error >= 0.0, "{name}: {feature} is {m:?}");
        }
        for feature in ["indirect_occlusion", "direct_occlusion", "second_bounce", "specular_energy"] {
            if !name.starts_with("a very") {
                assert_eq!(measures[feature], NOTHING, "{name}: {feature}");
            }
        }
        if name.starts_with("a very") {
            agrees(measures["lit_share"], std::f64::consts::FRAC_PI_4, 0.0);
        }
    }
}

#[test]
fn a_scene_that_moves_counts_where_a_feature_is_most() {
    let scene = asset("day.ron");
    let measures = scene.measure(&MeasureOptions { samples: 1024, ..Default::default() });
    assert_eq!(measures.at_times.len(), 8);
    let (midnight, noon) = (&measures.at_times[0], &measures.at_times[4]);
    assert_eq!((midnight.0, noon.0), (0.0, 43_200.0));
    assert_eq!(midnight.1["second_bounce"], NOTHING, "there is no sun at night");
    assert!(noon.1["second_bounce"].value > 0.1, "{:?}", noon.1);
    for (name, measured) in &measures.features {
        let most = measures.at_times.iter().map(|(_, features)| features[name].at_most()).fold(0.0, f64::max);
        assert_eq!(measured.at_most(), most, "{name}");
    }
    let still = asset("cornell.ron").measure(&MeasureOptions { samples: 256, ..Default::default() });
    assert_eq!(still.at_times.len(), 1);
}

#[test]
fn measures_are_kept_and_a_bad_cache_does_no_harm() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().join("not/yet/there");
    let scene = asset("cornell_empty.ron");
    let options = MeasureOptions { samples: 256, cache: Some(cache.clone()), ..Default::default() };
    let fresh = scene.measure(&options);
    let file = fs::read_dir(&cache).unwrap().next().unwrap().unwrap().path();
    let text = fs::read_to_string(&file).unwrap();
    // What is taken from the cache is what the file says: here, another value.
    assert_eq!(scene.measure(&options), fresh);
    // Another picture, other samples: another file.
    let wide = scene.measure(&MeasureOptions { aspect: 2.0, ..options.clone() });
    assert_ne!(wide, fresh);
    assert_eq!(fs::read_dir(&cache).unwrap().count(), 2);
    for damaged in ["", "manylight", &text[..text.len() / 2], &text.replace("time 0.0", "time 1.0")] {
        fs::write(&file, damaged).unwrap();
        assert_eq!(scene.measure(&options), fresh);
        assert_eq!(fs::read_to_string(&file).unwrap(), text, "it is measured and written again");
    }
    // A folder that cannot be made, and a file where the folder should be.
    let blocked = MeasureOptions { cache: Some(file.join("folder")), ..options.clone() };
    assert_eq!(scene.measure(&blocked), fresh);
    fs::remove_file(&file).unwrap();
    fs::create_dir(&file).unwrap();
    assert_eq!(scene.measure(&options), fresh);
}

/// The share of one bounce that is blocked, by another way: all pairs of a point that the camera sees and a point that a light's ray meets, each against
/// all triangles, in 64 bits. Pairs nearer than a twentieth of the box are kept from standing for all: their light is bounded, blocked or not, which
/// moves the share by less than the spread that is allowed.
#[test]
fn all_pairs_of_points_say_the_same() {
    const SIDE: usize = 24;
    let scene = asset("cornell.ron");
    let state = scene.sample(0.0);
    let bvh = Bvh::build(&scene, &state);
    let triangles: Vec<[DVec3; 3]> = bvh.triangles.iter().map(|t| [t.a, t.ab, t.ac].map(|v| v.as_dvec3())).collect();
    let meets = |origin: DVec3, direction: DVec3, [a, ab, ac]: &[DVec3; 3]| -> Option<f64> {
        let normal = ab.cross(*ac);
        let t = (*a - origin).dot(normal) / direction.dot(normal);
        let p = origin + t * direction - *a;
        let (v, w) = (normal.dot(ab.cross(p)), normal.dot(p.cross(*ac)));
        (t > 1e-9 && v >= 0.0 && w >= 0.0 && v + w <= normal.length_squared()).then_some(t)
    };
    // Position, normal towards the ray's origin, albedo.
    let nearest = |origin: DVec3, direction: DVec3| {
        let hits = triangles.iter().enumerate().filter_map(|(i, t)| Some((meets(origin, direction, t)?, i)));
        hits.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(t, i)| {
            let normal = triangles[i][1].cross(triangles[i][2]).normalize();
            let albedo = scene.materials[bvh.triangles[i].material as usize].diffuse.as_dvec3();
            (origin + t * direction, if normal.dot(direction) > 0.0 { -normal } else { normal }, albedo)
        })
    };
    let through = |view: &View| {
        let at = |i: usize| 2.0 * (i as f64 + 0.5) / SIDE as f64 - 1.0;
        let [origin, forward, right, up] = [view.origin, view.forward, view.right, view.up].map(|v| v.as_dvec3());
        let (tan_x, tan_y) = (f64::from(view.tan_half_x), f64::from(view.tan_half_y));
        let direction = move |x: usize, y: usize| forward + right * (at(x) * tan_x) + up * (at(y) * tan_y);
        (0..SIDE * SIDE).map(move |i| (origin, direction(i % SIDE, i / SIDE))).collect::<Vec<_>>()
    };
    let seen: Vec<_> = through(&state.camera_view(1.0)).into_iter().filter_map(|(origin, direction)| nearest(origin, direction)).collect();
    let (light, axis) = (&state.lights[0], state.lights[0].direction.as_dvec3());
    let lit: Vec<_> = through(&state.light_views[0].view)
        .into_iter()
        .filter_map(|(origin, direction)| {
            let (beam, cutoff) = (f64::from(light.beam_rad), f64::from(light.cutoff_rad));
            let angle = direction.angle_between(axis);
            let falloff = ((cutoff - angle) / (cutoff - beam)).clamp(0.0, 1.0);
            // A place of the square is seen under an angle that goes with the cube of the cosine.
            let (position, normal, albedo) = nearest(origin, direction).filter(|_| falloff > 0.0)?;
            Some((position, normal, albedo * (falloff * angle.cos().powi(3))))
        })
        .collect();
    let (mut sent, mut reaching) = (0.0, 0.0);
    for (x, x_normal, x_albedo) in &seen {
        for (y, y_normal, flux) in &lit {
            let offset = *y - *x;
            let (cos_x, cos_y) = (offset.dot(*x_normal).max(0.0), (-offset).dot(*y_normal).max(0.0));
            if cos_x * cos_y > 0.0 {
                let d2 = offset.length_squared();
                let radiance = (*x_albedo * *flux).element_sum() * cos_x * cos_y / d2 / d2.max(0.25_f64.powi(2));
                sent += radiance;
                let between = |t: &[DVec3; 3]| meets(*x, offset, t).is_some_and(|t| t > 1e-6 && t < 1.0 - 1e-6);
                reaching += if triangles.iter().any(between) { 0.0 } else { radiance };
            }
        }
    }
    let brute = 1.0 - reaching / sent;
    let measured = scene.measure(&MeasureOptions::default())["indirect_occlusion"];
    println!("all pairs {brute:.4}, measured {measured:?}, {} × {} points", seen.len(), lit.len());
    agrees(measured, brute, 0.05);
    assert!(brute > 0.05, "much is blocked there: {brute}");
}

#[test]
fn a_scene_is_measured_once_and_a_changed_one_anew() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = asset("cornell_empty.ron");
    scene.keep_measures_in(folder.path().to_owned());
    let first = scene.measured(1.0);
    let again = scene.clone().measured(1.005);
    assert!(Arc::ptr_eq(&first, &again), "a clone knows, and so nearly square a picture is square");
    assert_ne!(*scene.measured(1.5), *first);
    let mut white = scene.clone();
    white.materials.iter_mut().for_each(|material| material.diffuse = glam::Vec3::splat(0.9));
    let bright = white.measured(1.0);
    assert!(bright["second_bounce"].value > first["second_bounce"].value + 0.1, "{:?}", bright.features);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    let mut later = asset("cornell_empty.ron");
    later.keep_measures_in(folder.path().to_owned());
    assert_eq!(later.measured(1.0).features, first.features);
    // No picture has such proportions.
    for aspect in [0.0, f32::NAN, f32::INFINITY, -1.0] {
        assert_eq!(later.measured(aspect).features, first.features);
    }
}
