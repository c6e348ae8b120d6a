//! A Chrome trace of what a command does: CPU spans through `tracing`, GPU intervals added from timestamps.

use std::{
    io::{self, Write},
    path::Path,
    sync::{Arc, Mutex, PoisonError},
    time::Instant,
};

use manylight::{
    fault::Fault,
    files::{FileError, write_text},
    gpu::FrameTimings,
    graph::plan::Plan,
};
use serde_json::{Value, json};
use tracing_chrome::{ChromeLayerBuilder, FlushGuard};
use tracing_subscriber::layer::SubscriberExt;

use crate::commands::states::{self, State};

/// Track of the GPU in the trace; the CPU's threads count from 0.
const GPU_TRACK: u32 = 1000;

/// Records from its creation on.
pub struct Trace {
    buffer: Shared,
    guard: FlushGuard,
    start: Instant,
    gpu: Vec<Value>,
    /// End of the last GPU interval in microseconds: intervals of one queue do not overlap.
    gpu_end: f64,
    /// Why each node of the plan runs, and why it is skipped: unchanged, or settled.
    reasons: Vec<[String; 3]>,
}

#[derive(Clone, Default)]
struct Shared(Arc<Mutex<Vec<u8>>>);

impl Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Trace {
    /// Starts to record all spans of this process.
    pub fn start() -> Result<Self, Fault> {
        let buffer = Shared::default();
        let start = Instant::now();
        let (layer, guard) = ChromeLayerBuilder::new().writer(buffer.clone()).include_args(true).include_locations(false).build();
        tracing::subscriber::set_global_default(tracing_subscriber::registry().with(layer))
            .map_err(|e| Fault::Input(format!("cannot record a trace: {e}")))?;
        Ok(Self { buffer, guard, start, gpu: Vec::new(), gpu_end: 0.0, reasons: Vec::new() })
    }

    /// Microseconds since the start.
    pub fn now_us(&self) -> f64 {
        self.start.elapsed().as_secs_f64() * 1e6
    }

    /// Takes over what is known of a plan that is run from now on, and marks the nodes of it that do not run.
    pub fn plan(&mut self, plan: &Plan) {
        let states = states::of_plan(plan);
        let running = states.iter().zip(&plan.nodes);
        let skipped = |node, settled| states::skipped_reason(plan, node, settled);
        self.reasons = running.map(|(state, node)| [state.reason.clone(), skipped(node, false), skipped(node, true)]).collect();
        let at = self.now_us();
        for node in states.iter().filter(|node| node.state != State::Runs) {
            self.mark(&node.id, &node.stage, at, json!({"state": node.state.to_string(), "reason": node.reason}));
        }
    }

    /// A point in time on the track of the GPU.
    fn mark(&mut self, id: &str, stage: &str, at: f64, args: Value) {
        self.gpu.push(json!({"name": id, "cat": stage, "ph": "i", "s": "t", "pid": 1, "tid": GPU_TRACK, "ts": at, "args": args}));
    }

    /// Adds the GPU intervals of a frame that was recorded from `from_us` on. Timestamps tell how long each node took, not
    /// when the queue began: nodes are laid end to end, in order, from the time of recording or the end of the frame before. Nodes that were skipped are points in time.
    pub fn gpu_frame(&mut self, timings: &FrameTimings, from_us: f64) {
        let mut at = from_us.max(self.gpu_end);
        for (ix, node) in timings.nodes.iter().enumerate() {
            let reason = |kind: usize| self.reasons.get(ix).map(|reasons| reasons[kind].clone());
            if !node.ran {
                let reason = reason(if node.settled { 2 } else { 1 });
                self.mark(&node.id, &node.stage, at, json!({"frame": timings.frame, "state": "skipped", "reason": reason}));
                continue;
            }
            let Some(ns) = node.gpu_ns else { continue };
            let duration = ns as f64 / 1e3;
            self.gpu.push(json!({
                "name": node.id, "cat": node.stage, "ph": "X", "pid": 1, "tid": GPU_TRACK, "ts": at, "dur": duration,
                "args": {"frame": timings.frame, "state": "runs", "reason": reason(0)},
            }));
            at += duration;
        }
        self.gpu_end = at;
    }

    /// Writes everything as one file.
    pub fn write(self, path: &Path) -> Result<(), Fault> {
        let Self { buffer, guard, gpu, .. } = self;
        drop(guard); // the writer's thread ends and the text is complete
        let bytes = buffer.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut events: Vec<Value> = serde_json::from_slice(&bytes)
            .map_err(|e| Fault::Input(FileError::write(path, &io::Error::other(e.to_string())).to_string()))?;
        events.iter_mut().for_each(name_after_node);
        if !gpu.is_empty() {
            events.push(json!({"name": "thread_name", "ph": "M", "pid": 1, "tid": GPU_TRACK, "args": {"name": "GPU"}}));
        }
        events.extend(gpu);
        let text = serde_json::to_string(&events).unwrap_or_default();
        write_text(path, &text).map_err(|e| Fault::Input(e.to_string()))
    }
}

/// Spans of nodes are all called `node`; in the trace they bear the node's id and their stage as category. Texts among the arguments come
/// with quotation marks, which go.
fn name_after_node(event: &mut Value) {
    if let Some(args) = event.get_mut("args").and_then(Value::as_object_mut) {
        for value in args.values_mut() {
            if let Some(text) = value.as_str() {
                *value = text.trim_matches('"').into();
            }
        }
    }
    if event["name"] == "node" && event["args"]["node"].is_string() {
        event["name"] = event["args"]["node"].clone();
        event["cat"] = event["args"]["stage"].clone();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_bear_the_names_of_nodes() {
        let mut event = json!({"name": "node", "cat": "manylight_gpu::frame", "args": {"node": "\"pull_push\"", "stage": "\"ism\""}});
        name_after_node(&mut event);
        assert_eq!((&event["name"], &event["cat"]), (&json!("pull_push"), &json!("ism")));
        let mut other = json!({"name": "frame"});
        name_after_node(&mut other);
        assert_eq!(other, json!({"name": "frame"}));
    }
}
