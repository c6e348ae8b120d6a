//! How long a user waits: from documents to a plan, for a frame, and from saving a shader to the new picture.
//!
//! `cargo bench -p manylight-passes --bench edit` in the repository. Prints median and 95th percentile in milliseconds; asserts nothing,
//! because times depend on the machine.

mod common;

use std::{
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use common::{Outcome, library_copy, report};
use manylight_gpu::{Gpu, GpuOptions, watch::Watcher};
use manylight_graph::{library::Library, pipeline::Pipeline, planner};
use manylight_passes::{Documents, Renderer, SceneSource, Settings, plan_input};

/// The edits that the 50th percentile is of.
const EDITS: usize = 20;
const FRAMES: usize = 40;
const PLANS: usize = 100;

fn main() -> Outcome<()> {
    let (root, copy) = library_copy()?;
    let library = || Library::new(Some(copy.path().to_owned()), Vec::new());
    let scene = SceneSource::file(root.join("assets/cornell.ron"));
    let gpu = Gpu::new(&GpuOptions::default())?;
    println!("{} ({})", gpu.adapter_info().name, gpu.kind());

    let settings =
        |size, rsm: u32| Settings { size: (size, size), set: vec![("rsm_size".to_owned(), rsm.to_string())], ..Settings::default() };
    let documents = Documents::load(library(), Path::new("acrsm"))?;
    let input = plan_input(documents.pipeline(), &settings(256, 256), &scene.load()?);
    let mut plans = Vec::new();
    for _ in 0..PLANS {
        let start = Instant::now();
        let pipeline = Pipeline::load(documents.library(), "pipelines/acrsm.ron")?;
        planner::plan(&pipeline, documents.registry(), &input)?;
        plans.push(start.elapsed());
    }
    report("parse to plan of acrsm.ron", &mut plans);

    let mut renderer = Renderer::new(&gpu, library(), "acrsm", scene.clone(), settings(256, 256))?;
    let mut frames = Vec::new();
    for _ in 0..FRAMES {
        let start = Instant::now();
        renderer.render_frame(0.0)?;
        gpu.wait();
        frames.push(start.elapsed());
    }
    report("frame at 256², RSM 256², 64 PCSS VALs, 64,000 points", &mut frames);

    let mut renderer = Renderer::new(&gpu, library(), "acrsm", scene, settings(128, 256))?;
    renderer.render_frame(0.0)?;
    let mut watcher = Watcher::new(renderer.watch_set())?;
    let shader = copy.path().join("shaders/lighting/compose.wgsl");
    let text = fs::read_to_string(&shader)?;
    let mut edits = Vec::new();
    for edit in 0..EDITS {
        let saved = Instant::now();
        fs::write(&shader, format!("{text}\nconst EDIT: u32 = {edit}u;\n"))?;
        let mut changed: Vec<PathBuf> = Vec::new();
        while changed.is_empty() && saved.elapsed() < Duration::from_secs(10) {
            changed = watcher.recv_timeout(Duration::from_secs(1));
        }
        renderer.reload(&changed)?;
        renderer.render_frame(0.0)?;
        renderer.read("presented")?;
        edits.push(saved.elapsed());
    }
    report("saved shader to new picture at 128²", &mut edits);
    Ok(())
}
