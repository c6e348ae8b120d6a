//! Times of frames and of their nodes, over several frames.

use std::time::Instant;

use manylight_gpu::{FrameTimings, Gpu, GpuKind};
use manylight_graph::plan::Plan;
use manylight_passes::{RenderError, Renderer};
use serde_json::{Value, json};

pub use crate::samples::Samples;

/// Renders a frame and waits for it: its times, if there is a sample, and the milliseconds until it was done.
pub fn timed_frame(renderer: &mut Renderer, time: f64) -> Result<(Option<&FrameTimings>, f64), RenderError> {
    let start = Instant::now();
    renderer.render_frame(time)?;
    let recorded = renderer.frame().index().wrapping_sub(1);
    // Times of an older frame are no sample of this one.
    let timings = renderer.wait_timings().filter(|t| t.frame == recorded);
    Ok((timings, start.elapsed().as_secs_f64() * 1e3))
}

/// Times of one node over several frames, in milliseconds.
#[derive(Debug, Default, Clone)]
pub struct NodeSamples {
    /// The node's id in the pipeline.
    pub id: String,
    /// The stage that it belongs to.
    pub stage: String,
    /// Whether it runs on the CPU only.
    pub host: bool,
    /// To record it, or to do its work if it runs on the host.
    pub cpu: Samples,
    /// Its work on the GPU.
    pub gpu: Samples,
    /// Its work, on the processor that does it, in the frames in which it was not skipped.
    pub running: Samples,
    /// Frames in which it was skipped: nothing of what it depends on had changed.
    pub skipped: usize,
    /// How many of these for having settled.
    pub settled: usize,
}

/// Times of several frames, in milliseconds.
#[derive(Debug, Default, Clone)]
pub struct FrameSamples {
    /// In the order of the plan.
    pub nodes: Vec<NodeSamples>,
    /// To record and submit a frame.
    pub cpu: Samples,
    /// From the first pass to the last.
    pub gpu: Samples,
    /// From the start of recording until the GPU is done.
    pub wall: Samples,
}

impl FrameSamples {
    /// For the nodes of a plan.
    pub fn new(plan: &Plan) -> Self {
        let nodes = plan.nodes.iter().map(|n| NodeSamples {
            id: n.id.clone(),
            stage: n.stage.clone(),
            host: n.decl.shader.is_none(),
            ..NodeSamples::default()
        });
        Self { nodes: nodes.collect(), ..Self::default() }
    }

    /// Adds the times of a frame as a whole; `wall_ms` from the start of recording until the GPU was done.
    pub fn push_frame(&mut self, timings: Option<&FrameTimings>, wall_ms: f64) {
        self.wall.push(Some(wall_ms));
        let Some(timings) = timings else { return };
        self.cpu.push(Some(milliseconds(timings.cpu_ns)));
        self.gpu.push(timings.gpu_ns.map(milliseconds));
    }

    /// Adds the times of the nodes of a frame.
    pub fn push_nodes(&mut self, timings: Option<&FrameTimings>) {
        let Some(timings) = timings else { return };
        for (samples, timing) in self.nodes.iter_mut().zip(&timings.nodes) {
            samples.cpu.push(Some(milliseconds(timing.cpu_ns)));
            samples.gpu.push(timing.gpu_ns.map(milliseconds));
            samples.skipped += usize::from(!timing.ran);
            samples.settled += usize::from(timing.settled);
            let work = if samples.host { Some(timing.cpu_ns) } else { timing.gpu_ns };
            samples.running.push(work.filter(|_| timing.ran).map(milliseconds));
        }
    }

    /// Nodes of one stage together, stages in the order of their first nodes. Medians and percentiles of a stage are sums over its
    /// nodes, which is exact for medians only if the nodes vary alike.
    pub fn by_stage(&self) -> Vec<(String, Vec<&NodeSamples>)> {
        let mut stages: Vec<(String, Vec<&NodeSamples>)> = Vec::new();
        for node in &self.nodes {
            match stages.iter_mut().find(|(stage, _)| *stage == node.stage) {
                Some((_, nodes)) => nodes.push(node),
                None => stages.push((node.stage.clone(), vec![node])),
            }
        }
        stages
    }
}

fn milliseconds(ns: u64) -> f64 {
    ns as f64 / 1e6
}

/// Median, 95th percentile and number; `null` without a sample.
pub fn summary(samples: &Samples) -> Value {
    match (samples.median(), samples.percentile(95.0)) {
        (Some(median), Some(p95)) => json!({"median": median, "p95": p95, "samples": samples.len()}),
        _ => Value::Null,
    }
}

/// Whether nodes are best timed by submitting one after the other: timestamps of a software adapter are not tied to the work around them.
pub fn serial_by_default(gpu: &Gpu) -> bool {
    gpu.kind() == GpuKind::Software
}

/// All times; `serial`: nodes were submitted one after the other.
pub fn timings(samples: &FrameSamples, serial: bool) -> Value {
    let nodes: Vec<Value> = samples
        .nodes
        .iter()
        .map(|n| json!({"id": n.id, "stage": n.stage, "host": n.host, "cpu_ms": summary(&n.cpu), "gpu_ms": summary(&n.gpu), "skipped": n.skipped}))
        .collect();
    json!({
        "method": if serial { "serial" } else { "timestamps" },
        "frame": {"wall_ms": summary(&samples.wall), "cpu_ms": summary(&samples.cpu), "gpu_ms": summary(&samples.gpu)},
        "nodes": nodes,
    })
}
