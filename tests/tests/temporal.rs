//! Long sequences: light and objects move, the number of lights changes. Nothing drifts, nothing leaks, and nothing depends on chance.

use std::{
    collections::BTreeSet,
    hash::{DefaultHasher, Hash, Hasher},
};

use manylight_graph::plan::{Debug, Lifetime};
use manylight_passes::Renderer;

use crate::{
    matrix::documents_of_all_pipelines,
    records,
    renders::{Job, read, shows_baked_light},
    support::root,
};

/// Frames of the sequence, and after how many everything repeats: the loop of the scene, 10 s.
const FRAMES: usize = 300;
const PERIOD: usize = 60;
const FRAMES_A_SECOND: f64 = 6.0;
/// Numbers of lights, one after the other within a period.
const LIGHTS: [u32; 4] = [64, 512, 16, 100];

/// What became of the frames.
struct Played {
    /// Hash of the picture's bits, by frame.
    hashes: Vec<u64>,
    /// Mean radiance, by frame.
    means: Vec<f64>,
    /// Mean magnitude of the second difference of a pixel over three frames without a change of the number of lights, over the mean.
    flicker: f64,
    /// Bytes of memory at the end of each period.
    memory: Vec<u64>,
}

fn play(pipeline: &str, frames: usize) -> Played {
    let debug = Debug { watch_numbers: true, ..Debug::default() };
    let pipeline = root().join(pipeline).to_string_lossy().into_owned();
    let job = Job { pipeline, size: (32, 32), debug, ..Job::asset("moving") };
    let mut job = job;
    // Smaller where there are such parameters.
    let usual = job.renderer();
    let has = |name: &str| usual.plan().params.iter().any(|(known, _)| known == name);
    let steps = PERIOD / LIGHTS.len();
    for (name, value) in [("rsm_size", 64), ("point_count", 4000), ("ism_size", 32), ("atlas_width", 512)] {
        job = if has(name) { job.set(name, value) } else { job };
    }
    let varies = has("clusters");
    if usual.pipeline().resources.contains_key("imbalance") {
        job = job.keep(&["imbalance"]);
    }
    let mut renderer = job.renderer();
    let mut played = Played { hashes: Vec::new(), means: Vec::new(), flicker: 0.0, memory: Vec::new() };
    let (mut pictures, mut second, mut counted): (Vec<Vec<f32>>, f64, u32) = (Vec::new(), 0.0, 0);
    for frame in 0..frames {
        let in_period = frame % PERIOD;
        if varies && in_period.is_multiple_of(steps) {
            let lights = LIGHTS[in_period / steps];
            renderer.set_parameter("clusters", &lights.to_string()).unwrap_or_else(|e| panic!("{}", e.render()));
        }
        let time = in_period as f64 / FRAMES_A_SECOND;
        renderer.render_frame(time).unwrap_or_else(|e| panic!("{pipeline}, frame {frame}: {e}", pipeline = job.pipeline));
        let radiance = radiance(&renderer);
        played.hashes.push(hash(&radiance));
        played.means.push(radiance.iter().map(|v| f64::from(*v)).sum::<f64>() / radiance.len() as f64);
        if let [.., a, b] = pictures.as_slice()
            && in_period % steps >= 2
        {
            let sum: f64 = a.iter().zip(b).zip(&radiance).map(|((a, b), c)| f64::from((a - 2.0 * b + c).abs())).sum();
            second += sum / radiance.len() as f64;
            counted += 1;
        }
        pictures.push(radiance);
        if in_period == PERIOD - 1 {
            played.memory.push(renderer.memory_report().total());
        }
    }
    played.flicker = second / f64::from(counted.max(1)) / (played.means.iter().sum::<f64>() / played.means.len() as f64);
    played
}

fn radiance(renderer: &Renderer) -> Vec<f32> {
    let plan = renderer.plan();
    let name = &plan.resources[plan.radiance.expect("every pipeline names its radiance")].name;
    read(renderer, name).data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect()
}

fn hash(radiance: &[f32]) -> u64 {
    let mut hasher = DefaultHasher::new();
    radiance.iter().for_each(|v| v.to_bits().hash(&mut hasher));
    hasher.finish()
}

/// The whole sequence for each way of making lights that carries something from frame to frame; of the rest as much as shows that chance has no part.
#[test]
fn three_hundred_frames_neither_drift_nor_leak_and_play_alike_twice() {
    // Means of a period with the same movement and numbers of lights differ by where clusters lie.
    const DRIFT: f64 = 0.02;
    let (mut rows, mut seen) = (Vec::new(), BTreeSet::new());
    for (pipeline, documents) in documents_of_all_pipelines() {
        if shows_baked_light(&documents) {
            continue;
        }
        let renderer =
            Job { pipeline: root().join(&pipeline).to_string_lossy().into_owned(), size: (32, 32), ..Job::asset("moving") }.renderer();
        let plan = renderer.plan();
        let way = plan.params.iter().find(|(name, _)| name == "sampling").map(|(_, value)| value.to_string());
        let carries = plan.resources.iter().any(|r| r.lifetime == Lifetime::History) && way.is_some_and(|way| seen.insert(way));
        let first = play(&pipeline, if carries { FRAMES } else { PERIOD / 2 });
        let again = play(&pipeline, if carries { PERIOD } else { PERIOD / 2 });
        let differs = first.hashes.iter().zip(&again.hashes).position(|(a, b)| a != b);
        assert_eq!(differs, None, "{pipeline}: a frame is not as when it was played before");
        assert!(first.hashes.iter().collect::<BTreeSet<_>>().len() > first.hashes.len() / 4, "{pipeline}: nothing moves");
        let period = |i: usize| first.means[i * PERIOD..(i + 1) * PERIOD].iter().sum::<f64>() / PERIOD as f64;
        let mut drift: Option<f64> = None;
        if carries {
            let (second, last) = (period(1), period(FRAMES / PERIOD - 1));
            let change = last / second - 1.0;
            drift = Some(change);
            assert!(change.abs() < DRIFT, "{pipeline}: the mean goes from {second} to {last}");
            assert!(first.memory.iter().skip(1).all(|bytes| *bytes == first.memory[1]), "{pipeline}: {:?} bytes", first.memory);
        }
        println!(
            "{pipeline}: {} frames, drift {drift:.5?}, flicker {:.4}, {:?} bytes",
            first.hashes.len(),
            first.flicker,
            first.memory.last()
        );
        rows.push(serde_json::json!({ "pipeline": pipeline, "frames": first.hashes.len(), "drift": drift, "flicker": first.flicker }));
    }
    records::write("temporal", &rows);
}
