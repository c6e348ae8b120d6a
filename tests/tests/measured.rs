//! Measured features of scenes against what the pipelines render: the path tracer's components, and virtual lights with and without shadows.
//!
//! Both sides have standard errors; what is known to be approximate besides has a floor of its own, stated where it is used.

use std::{
    collections::BTreeMap,
    f64::consts::PI,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use glam::{DVec3, Vec3};
use manylight_gpu::Image;
use manylight_graph::{features::Measured, library::Library};
use manylight_passes::{Documents, Renderer, SceneSource, Settings};
use manylight_scene::{MeasureOptions, Scene, gpu_data::Light};

use crate::{
    reference::rgb,
    renders::{Job, gpu, read},
    support::{command, project_with, root, shared},
};

/// Width and height of pictures: with indirect light, of the G-buffer alone, and path-traced.
const SIDE: u32 = 64;
const GBUFFER_SIDE: u32 = 512;
const TRACED_SIDE: u32 = 32;
/// Batches of paths, whose spread gives the standard error, and paths a pixel of each.
const BATCHES: u32 = 6;
const PATHS: u32 = 16;

/// All scenes of the repository, and those beside it.
fn scenes() -> Vec<PathBuf> {
    let is_scene = |path: &PathBuf| path.extension().is_some_and(|end| end == "ron");
    let mut scenes: Vec<_> =
        fs::read_dir(root().join("assets")).expect("assets").map(|entry| entry.expect("an entry").path()).filter(is_scene).collect();
    scenes.sort();
    assert!(scenes.len() >= 8, "{scenes:?}");
    match shared() {
        Some(shared) => {
            let of = |name: &str| shared.join("scenes").join(name).join(name).with_extension("ron");
            scenes.extend(["cornell_blocks", "cornell_empty", "cornell_objects", "sponza"].map(of));
        }
        None => println!("cornell_blocks, cornell_empty, cornell_objects and sponza were not run: ../shared is not there"),
    }
    scenes
}

fn load(path: &Path) -> Scene {
    Scene::load(path).unwrap_or_else(|faults| panic!("{faults}"))
}

/// Without specular lobes.
fn matt(mut scene: Scene) -> Scene {
    scene.materials.iter_mut().for_each(|material| material.specular = Vec3::ZERO);
    scene
}

/// The scene as it was measured, at one time of those at which it was: on the way if it moves.
fn measured(scene: &Scene) -> (f64, BTreeMap<String, Measured>) {
    let mut times = scene.measure(&MeasureOptions::default()).at_times;
    let middle = times.len() * 5 / 8;
    times.swap_remove(middle)
}

/// A pipeline with a scene that need not be the file's.
fn renderer(pipeline: &str, path: &Path, scene: &Scene, side: u32, set: &[(&str, &str)], keep: &[&str]) -> Renderer {
    let documents = Documents::load(Library::new(Some(root()), Vec::new()), &root().join(format!("pipelines/{pipeline}.ron")));
    let settings = Settings {
        size: (side, side),
        set: set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect(),
        keep: keep.iter().map(|name| (*name).to_owned()).collect(),
        skip_unchanged: true,
        ..Settings::default()
    };
    let documents = documents.unwrap_or_else(|faults| panic!("{faults}"));
    Renderer::with(gpu(), documents, SceneSource::file(path), scene.clone(), settings).unwrap_or_else(|e| panic!("{e}"))
}

fn render(renderer: &mut Renderer, time: f64, frames: u32) {
    for _ in 0..frames {
        renderer.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// A sum with its standard error.
#[derive(Clone, Copy, Debug)]
struct Sum {
    value: f64,
    error: f64,
}

impl Sum {
    fn plus(self, other: Self) -> Self {
        Self { value: self.value + other.value, error: self.error.hypot(other.error) }
    }

    /// The share of it in a whole that is independent of it.
    fn of(self, whole: Self) -> Measured {
        let value = self.value / whole.value;
        Measured { value, standard_error: (self.error.powi(2) + (value * whole.error).powi(2)).sqrt() / whole.value }
    }
}

fn pixels(image: &Image) -> impl Iterator<Item = [f64; 3]> + '_ {
    (0..image.height).flat_map(move |y| (0..image.width).map(move |x| rgb(image, x, y)))
}

/// A component of the path tracer's light, all colours together, mean of all pixels.
fn traced(path: &Path, scene: &Scene, component: &str, time: f64) -> Sum {
    let set = [("component", component), ("paths", &PATHS.to_string())];
    let mut renderer = renderer("reference", path, scene, TRACED_SIDE, &set, &["standard_error"]);
    render(&mut renderer, time, BATCHES);
    let value: f64 = pixels(&read(&renderer, "composed")).map(|p| p.iter().sum::<f64>()).sum();
    // Colours of a pixel follow each other, pixels are independent.
    let error = pixels(&read(&renderer, "standard_error")).map(|p| p.iter().sum::<f64>().powi(2)).sum::<f64>().sqrt();
    let count = f64::from(TRACED_SIDE * TRACED_SIDE);
    Sum { value: value / count, error: error / count }
}

/// Fails unless two estimates are within four standard errors of each other, with a floor for what is known to be approximate.
#[track_caller]
fn agree(what: &str, measured: Measured, rendered: Measured, floor: f64) {
    let error = measured.standard_error.hypot(rendered.standard_error).hypot(floor / 4.0);
    let z = (measured.value - rendered.value) / error;
    println!(
        "{what}: measured {:.4} ± {:.4}, rendered {:.4} ± {:.4}, z {z:.2}",
        measured.value, measured.standard_error, rendered.value, rendered.standard_error
    );
    assert!(z.abs() <= 4.0, "{what}: measured {measured:?}, rendered {rendered:?}, z {z}");
}

/// Sixteen bits of textures' filtering, and ends of paths at 32 bounces.
const SAME_METHOD: f64 = 0.002;

/// Light of two and more bounces, and light by way of lobes: what the same scene loses without them.
#[test]
fn estimates_agree_with_the_components_of_the_path_tracer() {
    for path in scenes() {
        let scene = load(&path);
        let (time, features) = measured(&scene);
        let name = format!("{} at {time} s", scene.name);
        let component = |scene: &Scene, component: &str| traced(&path, scene, component, time);
        let (direct, one_bounce, indirect) = (component(&scene, "direct"), component(&scene, "one_bounce"), component(&scene, "indirect"));
        let later = indirect.plus(Sum { value: -one_bounce.value, ..one_bounce });
        agree(&format!("{name}: second_bounce"), features["second_bounce"], later.of(direct.plus(indirect)), SAME_METHOD);
        let without = matt(scene.clone());
        if scene.materials == without.materials {
            assert_eq!(features["specular_energy"], Measured { value: 0.0, standard_error: 0.0 }, "{name}");
        } else {
            let rest = component(&without, "direct").plus(component(&without, "indirect")).of(direct.plus(indirect));
            let share = Measured { value: 1.0 - rest.value, ..rest };
            agree(&format!("{name}: specular_energy"), features["specular_energy"], share, SAME_METHOD);
        }
    }
}

/// Pixels and texels are seen through their middles, and where light grazes what few pixels show, each of them counts.
const RASTERIZED: f64 = 0.01;

/// What a light sends to a place: direction to it and irradiance, in 64 bits.
fn arriving(light: &Light, position: DVec3) -> (DVec3, DVec3) {
    let direction = light.direction.as_dvec3();
    if light.kind == 2 {
        return (-direction, light.strength.as_dvec3());
    }
    let offset = light.position.as_dvec3() - position;
    let angle = (-offset).angle_between(direction);
    let (beam, cutoff) = (f64::from(light.beam_rad), f64::from(light.cutoff_rad));
    let t = if light.kind == 1 { 1.0 } else { ((cutoff - angle) / (cutoff - beam)).clamp(0.0, 1.0) };
    let falloff = if light.falloff == 2 { t * t * (3.0 - 2.0 * t) } else { t };
    (offset.normalize(), light.strength.as_dvec3() * (falloff / offset.length_squared()))
}

/// Blocked direct light, matt: the path tracer's against the same without shadows, from the G-buffer. And what the G-buffer says of distances.
#[test]
fn what_is_seen_agrees_with_the_g_buffer() {
    for path in scenes() {
        let scene = matt(load(&path));
        let (time, features) = measured(&scene);
        let state = scene.sample(time);
        let name = format!("{} at {time} s", scene.name);
        let names = ["gbuffer_albedo", "gbuffer_normal", "gbuffer_depth", "rsm_flux"];
        let mut renderer = renderer("rsm_gather", &path, &scene, GBUFFER_SIDE, &[("rsm_size", "256"), ("samples", "1")], &names);
        render(&mut renderer, time, 1);
        let [albedo, normal, depth, flux] = names.map(|name| read(&renderer, name));
        let view = state.camera_view(1.0);
        let mut unshadowed = 0.0;
        let mut logs = Vec::new();
        for (x, y) in (0..GBUFFER_SIDE).flat_map(|y| (0..GBUFFER_SIDE).map(move |x| (x, y))) {
            let distance = f64::from(depth.pixel(x, y)[0]);
            if distance <= 0.0 {
                continue;
            }
            logs.push(distance.ln());
            let ndc = |i: u32| 2.0 * (f64::from(i) + 0.5) / f64::from(GBUFFER_SIDE) - 1.0;
            let [origin, forward, right, up] = [view.origin, view.forward, view.right, view.up].map(|v| v.as_dvec3());
            let across = right * (ndc(x) * f64::from(view.tan_half_x)) - up * (ndc(y) * f64::from(view.tan_half_y));
            let direction = (forward + across).normalize();
            let position = origin + distance * direction;
            let n = DVec3::from(rgb(&normal, x, y)).normalize();
            for light in &state.lights {
                let (to_light, irradiance) = arriving(light, position);
                unshadowed += (DVec3::from(rgb(&albedo, x, y)) / PI * irradiance).element_sum() * n.dot(to_light).max(0.0);
            }
        }
        let reaching =
            traced(&path, &scene, "direct", time).of(Sum { value: unshadowed / f64::from(GBUFFER_SIDE * GBUFFER_SIDE), error: 0.0 });
        let blocked = Measured { value: 1.0 - reaching.value, ..reaching };
        agree(&format!("{name}: direct_occlusion"), features["direct_occlusion"], blocked, RASTERIZED);

        let exact = |value| Measured { value, standard_error: 0.0 };
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        let spread = (logs.iter().map(|l| (l - mean).powi(2)).sum::<f64>() / logs.len() as f64).sqrt();
        agree(&format!("{name}: depth_spread"), features["depth_spread"], exact(spread), RASTERIZED);

        let side = flux.height / scene.light_view_count().div_ceil(6) as u32;
        let mut lit = 0;
        for index in 0..scene.light_view_count() as u32 {
            let texels = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
            let at = |(x, y)| rgb(&flux, index % 6 * side + x, index / 6 * side + y);
            lit += texels.map(at).filter(|rgb| rgb.iter().any(|v| *v > 0.0)).count();
        }
        let lit = lit as f64 / (f64::from(side * side) * scene.light_view_count() as f64);
        agree(&format!("{name}: lit_share"), features["lit_share"], exact(lit), RASTERIZED);
    }
}

/// Sets of virtual point lights, and lights in each.
const SETS: u32 = 8;
const LIGHTS: u32 = 256;
/// A receiver is the middle of its pixel, an emitter the middle of its texel; smooth normals count at both ends.
const VIRTUAL_LIGHTS: f64 = 0.015;

/// Virtual point lights without a clamp, with and without exact shadows: the same lights in both, other ones in each frame.
#[test]
fn blocked_indirect_light_agrees_with_virtual_lights() {
    for path in scenes() {
        // The pipelines' indirect light is matt.
        let scene = matt(load(&path));
        let (time, features) = measured(&scene);
        let lights = |visibility: &str| -> Vec<f64> {
            let count = LIGHTS.to_string();
            let set = [
                ("sampling", "samples"),
                ("jitter", "true"),
                ("lights", "vpl"),
                ("indirect.vpl_clamp", "0.0"),
                ("clusters", &count),
                ("tiles", "1"),
                ("rsm_size", "256"),
                ("visibility", visibility),
            ];
            let mut renderer = renderer("acrsm", &path, &scene, SIDE, &set, &["indirect"]);
            let mut frame = || {
                render(&mut renderer, time, 1);
                pixels(&read(&renderer, "indirect")).map(|p| p.iter().sum::<f64>()).sum()
            };
            (0..SETS).map(|_| frame()).collect()
        };
        let (sent, reaching) = (lights("none"), lights("exact"));
        let whole: f64 = sent.iter().sum();
        let share = reaching.iter().sum::<f64>() / whole;
        let residuals: f64 = sent.iter().zip(&reaching).map(|(s, r)| (r - share * s).powi(2)).sum();
        let count = f64::from(SETS);
        let standard_error = (residuals * count / (count - 1.0)).sqrt() / whole;
        let blocked = Measured { value: 1.0 - share, standard_error };
        agree(&format!("{} at {time} s: indirect_occlusion", scene.name), features["indirect_occlusion"], blocked, VIRTUAL_LIGHTS);
    }
}

/// Exact shadows of indirect light where some of it is blocked.
const ASKS: &str = "Pipeline(
    doc: \"Exact shadows of indirect light where they matter.\",
    extends: \"acrsm.ron\",
    set: {\"visibility\": \"none\"},
    nodes: [
        (id: \"bvh\", node: \"scene/bvh\", when: Above(\"indirect_occlusion\", 0.02)),
        (
            id: \"indirect\", node: \"lighting/indirect\", in: {\"clusters\": \"virtual_lights\"},
            params: {\"visibility\": If(Above(\"indirect_occlusion\", 0.02), \"exact\", \"none\")},
        ),
    ],
)";

#[test]
fn the_command_line_measures_scenes_and_keeps_what_it_measured() {
    let project = project_with(&[("pipelines/asks.ron", ASKS)]);
    let cache = project.path().join("cache");
    let explain = |pipeline: &str, scene: &str| {
        let output = command(&["explain", pipeline, "--scene", scene]).current_dir(&project).env("XDG_CACHE_HOME", &cache).output();
        let output = output.expect("the program starts");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        text.lines().find(|line| line.starts_with("bvh ")).map(str::to_owned).unwrap_or_default()
    };
    let kept = || fs::read_dir(cache.join("manylight/measures")).map_or(0, Iterator::count);
    explain("reference", "cornell");
    assert_eq!(kept(), 0, "that pipeline asks for nothing that is measured");
    let (open, empty) = (explain("asks", "cornell"), explain("asks", "cornell_empty"));
    println!("{open}\n{empty}");
    assert!(open.starts_with("bvh") && open.contains(" runs "), "{open}");
    assert!(empty.contains(" off ") && empty.contains("`indirect_occlusion` is 0.00"), "{empty}");
    assert_eq!(kept(), 2);
    assert_eq!((explain("asks", "cornell"), explain("asks", "cornell_empty")), (open, empty), "from the cache");
}

#[test]
fn a_renderer_measures_a_scene_that_changed_and_no_other() {
    let project = project_with(&[("pipelines/asks.ron", ASKS)]);
    let scene = project.path().join("assets/cornell_empty.ron");
    let job = Job { root: project.path().to_owned(), pipeline: "asks".to_owned(), ..Job::scene(&scene) };
    let mut renderer = Job { size: (32, 32), ..job }.set("rsm_size", 64).renderer();
    let has_bvh = |renderer: &Renderer| renderer.plan().nodes.iter().any(|node| node.id == "bvh");
    assert!(!has_bvh(&renderer), "nothing blocks light there");
    let known = renderer.scene().measured(1.0);
    render(&mut renderer, 0.0, 2);
    renderer.set_parameter("clusters", "32").unwrap_or_else(|faults| panic!("{faults}"));
    assert!(Arc::ptr_eq(&known, &renderer.scene().measured(1.0)));
    let text = fs::read_to_string(&scene).expect("readable");
    fs::write(&scene, text.replace("cornell_empty.obj", "cornell.obj")).expect("writable");
    renderer.reload(&[]).unwrap_or_else(|faults| panic!("{faults}"));
    assert!(has_bvh(&renderer), "the blocks do");
    render(&mut renderer, 0.0, 1);
}
