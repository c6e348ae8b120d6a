//! The pipeline `reference` against another renderer's path-traced images, pixel by pixel with both standard errors.

use std::path::PathBuf;

use manylight::{
    files::Picture,
    metrics::{Estimate, ZTest, z_test},
};

use crate::{
    reference::exr,
    renders::{Job, read},
    support::{root, shared},
};

/// Paths a pixel and frame: so many are spread evenly over each pixel.
const PATHS: i64 = 8;

struct Case {
    scene: PathBuf,
    reference: PathBuf,
    /// Parameter `component`, and the stem of the reference's files.
    component: (&'static str, &'static str),
    frames: u32,
}

fn case(scene: PathBuf, reference: PathBuf, component: (&'static str, &'static str), frames: u32) -> Case {
    Case { scene, reference, component, frames }
}

const DIRECT: (&str, &str) = ("direct", "direct");
const ONE_BOUNCE: (&str, &str) = ("one_bounce", "onebounce");
const FULL: (&str, &str) = ("full", "full");

/// Batches that the references' standard errors are from.
fn batches(component: &str) -> u32 {
    if component == "full" { 10 } else { 12 }
}

/// The test of every pixel against the reference with both standard errors. `scale` multiplies the tracer's radiance: 1 but for the test of
/// the test.
fn test(case: &Case, scale: f32) -> ZTest {
    let job = Job { pipeline: root().join("pipelines/reference.ron").to_string_lossy().into_owned(), ..Job::scene(&case.scene) }
        .set("component", case.component.0)
        .set("paths", PATHS)
        .frames(case.frames)
        .keep(&["standard_error"]);
    let renderer = job.render();
    let scaled = |name: &str, scale: f32| {
        let image = read(&renderer, name);
        let data = image.data.iter().map(|v| v * scale).collect();
        Picture::linear(image.width as usize, image.height as usize, image.channels as usize, data).without_alpha()
    };
    let (image, error) = (scaled("composed", scale), scaled("standard_error", scale));
    let read = |end: &str| exr(&case.reference.join(format!("{}{end}.exr", case.component.1))).layer("").expect("plain channels");
    let (reference, reference_error) = (read(""), read("_stderr"));
    let ours = Estimate { picture: &image, standard_error: Some(&error), batches: Some(case.frames) };
    let theirs = Estimate { picture: &reference, standard_error: Some(&reference_error), batches: Some(batches(case.component.1)) };
    z_test(ours, theirs, None).expect("testable")
}

#[test]
fn the_path_tracer_agrees_with_another_renderer() {
    let data = root().join("tests/data/cornell_blocks");
    let cornell = root().join("assets/cornell.ron");
    let mut cases = vec![
        case(cornell.clone(), data.clone(), DIRECT, 8),
        case(cornell.clone(), data.clone(), ONE_BOUNCE, 8),
        case(cornell, data, FULL, 8),
    ];
    if let Some(shared) = shared() {
        let scene = |name: &str| (shared.join("scenes").join(name).join(format!("{name}.ron")), shared.join("reference").join(name));
        for (name, component, frames) in [("cornell_objects", ONE_BOUNCE, 8), ("sponza", DIRECT, 6), ("sponza", ONE_BOUNCE, 12)] {
            let (file, reference) = scene(name);
            cases.push(case(file, reference, component, frames));
        }
    } else {
        println!("cornell_objects and sponza were not run: ../shared is not there");
    }
    for case in cases {
        let result = test(&case, 1.0);
        let name = case.scene.file_stem().expect("a name").to_string_lossy();
        let ratio = result.ratio.expect("not black");
        println!(
            "{name}, {}: ratio of means {:.5} ± {:.5}, {:.3} % of pixels pass",
            case.component.0,
            ratio.value,
            ratio.standard_error,
            100.0 * result.passing
        );
        assert!((ratio.value - 1.0).abs() <= 0.005, "{name}, {}: {result:?}", case.component.0);
        assert!(result.fair && result.tested == 256 * 256, "{name}, {}: {result:?}", case.component.0);
    }
}

/// A test of the test: two per cent too much energy is found, by the pixels of direct light and by the ratio of the means of indirect light.
#[test]
fn two_per_cent_too_much_energy_is_found() {
    let of = |component| case(root().join("assets/cornell.ron"), root().join("tests/data/cornell_blocks"), component, 8);
    let direct = test(&of(DIRECT), 1.02);
    assert!(!direct.fair, "{direct:?}");
    let ratio = test(&of(ONE_BOUNCE), 1.02).ratio.expect("not black");
    assert!((ratio.value - 1.0).abs() > 0.005 && ratio.value - 1.0 > 5.0 * ratio.standard_error, "{ratio:?}");
}

/// Many paths in one frame are as many in several: some adapters end loops that run long, in silence, so no dispatch may do them all.
#[test]
fn all_paths_of_a_frame_are_traced() {
    let mean = |paths: u32, frames: u32| {
        let job = Job { pipeline: root().join("pipelines/reference.ron").to_string_lossy().into_owned(), ..Job::asset("glossy") };
        let job = Job { size: (16, 16), ..job }.set("component", "full").set("paths", paths).frames(frames);
        let image = read(&job.render(), "composed");
        let rgb = image.data.chunks_exact(4).flat_map(|pixel| &pixel[..3]);
        rgb.map(|v| f64::from(*v)).sum::<f64>() / f64::from(3 * 16 * 16)
    };
    let (one, several) = (mean(256, 1), mean(16, 16));
    println!("{one:.5} in one frame, {several:.5} in sixteen");
    assert!((one / several - 1.0).abs() < 0.03, "{one} in one frame, {several} in sixteen");
}
