//! Nodes whose inputs are as they were are skipped, and the picture never tells.

use std::{fs, path::Path};

use manylight_gpu::FrameTimings;
use manylight_passes::{Renderer, Settings};

use crate::{
    matrix::documents_of_all_pipelines,
    renders::{Job, read},
    support::{Random, copy_of_library, root},
};

/// The scene, whose camera, light and block move or stand still in turn: each for two seconds of eight.
const SCENE: &str = r#"Scene(
    meshes: [
        "assets/cornell_empty.obj",
        Mesh(file: "assets/cube.obj", name: "block", transform: (translate: (1.9, 0.01, 3.4), scale: (1.4, 2.8, 1.4)), repeat: loop, motion: [
            (time: 0.0, rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 0.0)), (time: 2.0, rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 50.0)), (time: 8.0, rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 50.0))]),
    ],
    camera: (origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 39.3, repeat: loop, motion: [
        (time: 0.0), (time: 2.0), (time: 4.0, origin: (3.78, 2.73, -8.0)), (time: 8.0, origin: (3.78, 2.73, -8.0))]),
    lights: [Spot(position: (2.0, 3.9, 1.2), target: (5.4, 4.9, 5.3), intensity: (200.0, 200.0, 200.0), beam_deg: 15.0, cutoff_deg: 20.0, repeat: loop, motion: [
        (time: 0.0), (time: 4.0), (time: 6.0, target: (5.4, 3.0, 4.0)), (time: 8.0, target: (5.4, 3.0, 4.0))])],
)"#;

/// A change between two frames.
enum Change {
    Set(&'static str, &'static str),
    /// A comment at the end of a shader changes nothing; a factor in it does.
    Shader(&'static str, &'static str, &'static str),
    Size(u32, u32),
    Restart,
}

const CHANGES: &[Change] = &[
    Change::Set("clusters", "32"),
    Change::Set("clusters", "100"),
    Change::Set("visibility", "none"),
    Change::Set("visibility", "simple"),
    Change::Set("visibility", "pcss"),
    Change::Set("lights", "vpl"),
    Change::Set("lights", "val"),
    Change::Set("sampling", "samples"),
    Change::Set("sampling", "incremental"),
    Change::Set("sampling", "clusters"),
    Change::Set("indirect_shadows", "off"),
    Change::Set("indirect_shadows", "auto"),
    Change::Set("direct_shadows", "off"),
    Change::Set("direct_shadows", "auto"),
    Change::Set("specular", "on"),
    Change::Set("specular", "auto"),
    Change::Set("view_importance", "on"),
    Change::Set("view_importance", "auto"),
    Change::Set("second_bounce", "on"),
    Change::Set("second_bounce", "off"),
    Change::Set("adaptive", "auto"),
    Change::Set("adaptive", "off"),
    Change::Set("points", "dynamic"),
    Change::Set("points", "auto"),
    Change::Set("view", "clusters"),
    Change::Set("view", "final"),
    Change::Shader("shaders/lighting/compose.wgsl", "textureStore(composed", "textureStore( composed"),
    Change::Shader("shaders/rsm/flux.wgsl", "vec4f(0.0);", "vec4f( 0.0);"),
    Change::Size(40, 24),
    Change::Size(32, 32),
    Change::Restart,
];

fn renderer(root: &Path, scene: &Path, skip_unchanged: bool) -> Renderer {
    let job = Job { root: root.to_owned(), pipeline: "acrsm".to_owned(), size: (32, 32), skip_unchanged, ..Job::scene(scene) };
    // Clusters settle sooner than some of the pauses last, and later than others.
    job.set("rsm_size", 64).set("point_count", 2000).set("settle", 5).renderer()
}

fn bits(renderer: &Renderer) -> Vec<u32> {
    let plan = renderer.plan();
    let shown = |ix: usize| read(renderer, &plan.resources[ix].name).data.into_iter().map(f32::to_bits);
    plan.radiance.into_iter().chain([plan.presents]).flat_map(shown).collect()
}

fn apply(change: &Change, renderer: &mut Renderer) {
    match change {
        Change::Set(name, value) => drop(renderer.set_parameter(name, value).unwrap_or_else(|e| panic!("{}", e.render()))),
        Change::Size(width, height) => {
            let settings = Settings { size: (*width, *height), ..renderer.settings().clone() };
            renderer.set(settings).unwrap_or_else(|e| panic!("{}", e.render()));
        }
        // The file is changed for both renderers at once.
        Change::Shader(..) => drop(renderer.reload(&[]).unwrap_or_else(|e| panic!("{}", e.render()))),
        Change::Restart => renderer.restart(),
    }
}

/// 200 frames of camera, light and block that move and rest, with parameters, sizes and shaders changed at random in between.
#[test]
fn skipping_changes_no_bit() {
    const FRAMES: u32 = 200;
    let project = copy_of_library();
    let scene = project.path().join("scene.ron");
    fs::write(&scene, SCENE).expect("writable");
    let mut all = renderer(project.path(), &scene, false);
    let mut skipping = renderer(project.path(), &scene, true);
    let (mut chance, mut time, mut skipped, mut applied) = (Random(3), 0.0, 0, 0);
    for frame in 0..FRAMES {
        // Time stands still for a while now and then.
        if chance.below(3) > 0 {
            time += 0.1 * chance.below(4) as f64;
        }
        if chance.below(5) == 0 {
            let change = &CHANGES[chance.below(CHANGES.len())];
            if let Change::Shader(file, from, to) = change {
                let path = project.path().join(file);
                let text = fs::read_to_string(&path).expect("readable");
                let changed = if text.contains(from) { text.replacen(from, to, 1) } else { text.replacen(to, from, 1) };
                assert_ne!(text, changed, "{file} is not as this test knows it");
                fs::write(&path, changed).expect("writable");
            }
            apply(change, &mut all);
            apply(change, &mut skipping);
            applied += 1;
        }
        all.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
        skipping.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
        skipped += skipping.wait_timings().map_or(0, |t| t.nodes.iter().filter(|node| !node.ran).count());
        assert!(bits(&all) == bits(&skipping), "frame {frame} at {time} s differs");
    }
    println!("{skipped} nodes skipped in {FRAMES} frames with {applied} changes");
    assert!(skipped > 1000 && applied > 30);
}

/// Ids of the nodes that ran.
fn ran(timings: Option<&FrameTimings>) -> Vec<String> {
    timings.expect("CPU times are always there").nodes.iter().filter(|n| n.ran).map(|n| n.id.clone()).collect()
}

/// What a change costs: only nodes that depend on it.
#[test]
fn only_what_depends_on_a_change_runs() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let scene = folder.path().join("scene.ron");
    fs::write(&scene, SCENE.replace("assets/", &format!("{}/assets/", root().to_string_lossy().replace('\\', "/")))).expect("writable");
    let mut renderer = renderer(&root(), &scene, true);
    let mut at = |time: f64, frames: u32| {
        let mut last = Vec::new();
        for _ in 0..frames {
            renderer.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
            last = ran(renderer.wait_timings());
        }
        last
    };
    // Still: the clusters settle, then nothing runs.
    let first = at(2.0, 1);
    assert!(first.iter().any(|id| id == "gbuffer") && first.iter().any(|id| id == "evaluate"), "{first:?}");
    let settling = at(2.0, 3);
    assert!(!settling.iter().any(|id| id == "gbuffer" || id == "rsm") && settling.iter().any(|id| id == "evaluate"), "{settling:?}");
    assert_eq!(at(2.0, 20), Vec::<String>::new());
    // The camera moves: no reflective shadow map.
    let camera = at(3.0, 1);
    assert!(camera.iter().any(|id| id == "gbuffer") && !camera.iter().any(|id| id.starts_with("rsm")), "{camera:?}");
    assert_eq!(at(4.0, 20), Vec::<String>::new());
    // The light moves: no G-buffer.
    let light = at(5.0, 1);
    assert!(light.iter().any(|id| id == "rsm") && !light.iter().any(|id| id == "gbuffer"), "{light:?}");
}

/// Every pipeline comes to rest in a scene that stands still, but for one that goes on for ever by its nature.
#[test]
fn still_frames_cost_nothing() {
    for (pipeline, documents) in documents_of_all_pipelines() {
        if pipeline.ends_with("/precomputed.ron") {
            continue;
        }
        let pipeline_path = root().join(&pipeline).to_string_lossy().into_owned();
        let job = Job { pipeline: pipeline_path, size: (32, 32), skip_unchanged: true, ..Job::asset("cornell") };
        // Whether nodes rest does not depend on how much they do.
        let small = [("rsm_size", 64), ("point_count", 2000)];
        let small = small.into_iter().filter(|(name, _)| documents.pipeline().params.contains_key(*name));
        let mut renderer = small.fold(job, |job, (name, value)| job.set(name, value)).renderer();
        for _ in 0..40 {
            renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
        }
        let left = ran(renderer.wait_timings());
        let goes_on = renderer.plan().nodes.iter().any(|node| node.id == "accumulate");
        assert_eq!(left.is_empty(), !goes_on, "{pipeline}: {left:?}");
    }
}
