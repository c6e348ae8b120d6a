//! The pipeline `reference` against another renderer's path-traced images, pixel by pixel with both standard errors.

use std::path::PathBuf;

use crate::{
    reference::{exr, reference_rgb, rgb},
    renders::{Job, read},
    support::{root, shared},
};

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

/// Blocks of this many pixels a side are compared: the mean over a block is near to normally distributed also where single paths are
/// rarely bright, which a z-test needs.
const BLOCK: u32 = 8;

/// Mean and standard error.
pub type Block = ([f64; 3], [f64; 3]);

/// Means and standard errors of blocks; pixels are independent.
pub fn blocks(size: u32, value: impl Fn(u32, u32) -> [f64; 3], error: impl Fn(u32, u32) -> [f64; 3]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for by in 0..size / BLOCK {
        for bx in 0..size / BLOCK {
            let (mut sum, mut variance) = ([0.0; 3], [0.0; 3]);
            for y in by * BLOCK..(by + 1) * BLOCK {
                for x in bx * BLOCK..(bx + 1) * BLOCK {
                    let (v, e) = (value(x, y), error(x, y));
                    for i in 0..3 {
                        sum[i] += v[i];
                        variance[i] += e[i] * e[i];
                    }
                }
            }
            let n = f64::from(BLOCK * BLOCK);
            blocks.push((sum.map(|s| s / n), variance.map(|v| v.sqrt() / n)));
        }
    }
    blocks
}

/// Share of blocks and channels whose difference is beyond four standard errors (normal: 6 in 100,000), and the ratio of the means.
pub fn compare(mine: &[Block], theirs: &[Block]) -> (f64, f64) {
    let total = |blocks: &[Block]| blocks.iter().flat_map(|(mean, _)| *mean).sum::<f64>();
    let ratio = total(mine) / total(theirs);
    // Rounding of f32 sums and of the references' half-float errors.
    let floor = 1e-4 * total(theirs) / (3 * theirs.len()) as f64;
    let mut beyond = 0;
    for (a, b) in mine.iter().zip(theirs) {
        for i in 0..3 {
            let deviation = (a.1[i].powi(2) + b.1[i].powi(2) + floor * floor).sqrt();
            beyond += usize::from((a.0[i] - b.0[i]).abs() > 4.0 * deviation);
        }
    }
    (beyond as f64 / (3 * mine.len()) as f64, ratio)
}

/// What [`compare`] says of the tracer and a reference. `scale` multiplies the tracer's radiance: 1 but for the test of the test.
fn disagreement(case: &Case, scale: f64) -> (f64, f64) {
    let job = Job { pipeline: root().join("pipelines/reference.ron").to_string_lossy().into_owned(), ..Job::scene(&case.scene) }
        .set("component", case.component.0)
        .set("paths", 1)
        .frames(case.frames)
        .keep(&["standard_error"]);
    let renderer = job.render();
    let (mean, error) = (read(&renderer, "composed"), read(&renderer, "standard_error"));
    let reference = exr(&case.reference.join(format!("{}.exr", case.component.1)));
    let reference_error = exr(&case.reference.join(format!("{}_stderr.exr", case.component.1)));
    let mine = blocks(mean.width, |x, y| rgb(&mean, x, y).map(|v| scale * v), |x, y| rgb(&error, x, y));
    let theirs = blocks(mean.width, |x, y| reference_rgb(&reference, x, y), |x, y| reference_rgb(&reference_error, x, y));
    compare(&mine, &theirs)
}

#[test]
fn the_path_tracer_agrees_with_another_renderer() {
    let data = root().join("tests/data/cornell_blocks");
    let cornell = root().join("assets/cornell.ron");
    let mut cases = vec![
        case(cornell.clone(), data.clone(), DIRECT, 48),
        case(cornell.clone(), data.clone(), ONE_BOUNCE, 64),
        case(cornell, data, FULL, 64),
    ];
    if let Some(shared) = shared() {
        let scene = |name: &str| (shared.join("scenes").join(name).join(format!("{name}.ron")), shared.join("reference").join(name));
        for (name, component, frames) in [("cornell_objects", ONE_BOUNCE, 32), ("sponza", DIRECT, 32), ("sponza", ONE_BOUNCE, 32)] {
            let (file, reference) = scene(name);
            cases.push(case(file, reference, component, frames));
        }
    } else {
        println!("cornell_objects and sponza were not run: ../shared is not there");
    }
    for case in cases {
        let (beyond, ratio) = disagreement(&case, 1.0);
        let name = case.scene.file_stem().expect("a name").to_string_lossy();
        println!("{name}, {}: ratio of means {ratio:.4}, {:.3} % of blocks beyond four standard errors", case.component.0, 100.0 * beyond);
        assert!((ratio - 1.0).abs() <= 0.005, "{name}, {}: ratio of means {ratio}", case.component.0);
        assert!(beyond <= 0.0025, "{name}, {}: {:.2} % of blocks differ", case.component.0, 100.0 * beyond);
    }
}

/// A test of the test: two per cent too much energy is found.
#[test]
fn two_per_cent_too_much_energy_is_found() {
    let case = case(root().join("assets/cornell.ron"), root().join("tests/data/cornell_blocks"), ONE_BOUNCE, 48);
    let (_, ratio) = disagreement(&case, 1.02);
    assert!((ratio - 1.0).abs() > 0.005, "ratio of means {ratio}");
}
