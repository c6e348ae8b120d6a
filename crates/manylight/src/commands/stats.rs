//! What is known of a rendered frame, as JSON for scripts.

use std::time::Instant;

use manylight::{
    fault::Fault,
    gpu::{FrameTimings, Gpu, GpuKind, Image, memory::Holding},
    graph::{
        plan::Plan,
        value::{ResourceDesc, Value as Parameter},
    },
    renderer::Renderer,
};
use serde_json::{Map, Value, json};

use super::session::of_render;
use crate::samples::Samples;

/// Renders a frame and waits for it: its times, if there is a sample, and the milliseconds until it was done.
pub fn timed_frame(renderer: &mut Renderer, time: f64) -> Result<(Option<&FrameTimings>, f64), Fault> {
    let start = Instant::now();
    renderer.render_frame(time).map_err(of_render)?;
    let recorded = renderer.frame().index().wrapping_sub(1);
    // Times of an older frame are no sample of this one.
    let timings = renderer.wait_timings().filter(|t| t.frame == recorded);
    Ok((timings, start.elapsed().as_secs_f64() * 1e3))
}

/// Times of one node over several frames, in milliseconds.
#[derive(Debug, Default, Clone)]
pub struct NodeSamples {
    pub id: String,
    pub stage: String,
    /// Whether it runs on the CPU only.
    pub host: bool,
    pub cpu: Samples,
    pub gpu: Samples,
}

/// Times of several frames, in milliseconds.
#[derive(Debug, Default, Clone)]
pub struct FrameSamples {
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
        }
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

pub fn adapter(gpu: &Gpu) -> Value {
    let info = gpu.adapter_info();
    json!({
        "name": info.name,
        "kind": gpu.kind().name(),
        "backend": format!("{:?}", info.backend),
        "driver": format!("{} {}", info.driver, info.driver_info).trim(),
        "timestamps": gpu.has_timestamps(),
    })
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
        .map(|n| json!({"id": n.id, "stage": n.stage, "host": n.host, "cpu_ms": summary(&n.cpu), "gpu_ms": summary(&n.gpu)}))
        .collect();
    json!({
        "method": if serial { "serial" } else { "timestamps" },
        "frame": {"wall_ms": summary(&samples.wall), "cpu_ms": summary(&samples.cpu), "gpu_ms": summary(&samples.gpu)},
        "nodes": nodes,
    })
}

/// How a resource holds its memory, in a word.
pub fn holding(holding: Holding) -> String {
    match holding {
        Holding::External => "external".to_owned(),
        Holding::Pool { slot } => format!("pool slot {slot}"),
        Holding::Kept => "kept".to_owned(),
        Holding::Host => "host".to_owned(),
        Holding::History => "history".to_owned(),
    }
}

pub fn memory(renderer: &Renderer) -> Value {
    let report = renderer.memory_report();
    let resources: Vec<Value> =
        report.resources.iter().map(|r| json!({"name": r.name, "bytes": r.bytes, "holding": holding(r.holding)})).collect();
    json!({
        "total": report.total(),
        "pool": report.pool,
        "pool_unshared": report.pool_unshared,
        "history": report.history,
        "kept": report.kept,
        "host": report.host,
        "external": report.external,
        "resources": resources,
    })
}

pub fn parameters(plan: &Plan) -> Value {
    let value = |value: &Parameter| match value {
        Parameter::Int(v) => json!(v),
        Parameter::Float(v) => json!(v),
        Parameter::Bool(v) => json!(v),
        Parameter::Choice(v) => json!(v),
    };
    Value::Object(plan.params.iter().map(|(name, v)| (name.clone(), value(v))).collect())
}

/// Sums of every named resource: of textures by channel, of buffers by field.
pub fn sums(renderer: &Renderer, names: &[String]) -> Result<Value, Fault> {
    let mut all = Map::new();
    for name in names {
        let plan = renderer.plan();
        let Some(index) = plan.resource(name) else { continue };
        let value = if matches!(plan.resources[index].desc, ResourceDesc::Texture { .. }) {
            sums_of_image(&super::outputs::read(renderer, name)?)
        } else {
            sums_of_elements(&renderer.read_json(name).map_err(|e| Fault::Input(e.to_string()))?)
        };
        all.insert(name.clone(), value);
    }
    Ok(Value::Object(all))
}

fn sums_of_image(image: &Image) -> Value {
    let channels = image.channels.max(1) as usize;
    let of_channel = |channel: usize| {
        let values = || image.data.iter().skip(channel).step_by(channels).map(|v| f64::from(*v));
        let finite = || values().filter(|v| v.is_finite());
        let (count, sum) = (finite().count(), finite().sum::<f64>());
        json!({
            "sum": sum,
            "mean": (count > 0).then(|| sum / count as f64),
            "min": finite().reduce(f64::min),
            "max": finite().reduce(f64::max),
            "non_finite": values().count() - count,
        })
    };
    json!({"width": image.width, "height": image.height, "channels": (0..channels).map(of_channel).collect::<Vec<_>>()})
}

/// The element-wise sum of all elements; arrays and objects are summed member by member.
fn sums_of_elements(elements: &Value) -> Value {
    let Value::Array(elements) = elements else { return elements.clone() };
    let sum = elements.iter().fold(Value::Null, add);
    json!({"elements": elements.len(), "sum": sum})
}

fn add(sum: Value, element: &Value) -> Value {
    match (sum, element) {
        (Value::Null, Value::Object(_)) => add(Value::Object(Map::new()), element),
        (Value::Null, Value::Array(_)) => add(Value::Array(Vec::new()), element),
        (Value::Object(mut sums), Value::Object(members)) => {
            for (name, member) in members {
                let before = sums.remove(name).unwrap_or_default();
                sums.insert(name.clone(), add(before, member));
            }
            Value::Object(sums)
        }
        (Value::Array(mut sums), Value::Array(members)) => {
            sums.resize(sums.len().max(members.len()), Value::Null);
            Value::Array(sums.into_iter().zip(members).map(|(before, member)| add(before, member)).collect())
        }
        (before, member) => {
            let number = |v: &Value| v.as_f64().or_else(|| v.as_bool().map(|b| f64::from(u8::from(b)))).unwrap_or(0.0);
            json!(number(&before) + number(member))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_are_summed_field_by_field() {
        let elements = json!([{"flux": [1.0, 2.0, 3.0], "n": 4}, {"flux": [0.5, 0.0, "NaN"], "n": 1}]);
        assert_eq!(sums_of_elements(&elements), json!({"elements": 2, "sum": {"flux": [1.5, 2.0, 3.0], "n": 5.0}}));
        assert_eq!(sums_of_elements(&json!([1, 2])), json!({"elements": 2, "sum": 3.0}));
    }

    #[test]
    fn images_are_summed_channel_by_channel() {
        let image = Image { width: 2, height: 1, channels: 2, data: vec![1.0, 5.0, 3.0, f32::NAN] };
        let sums = sums_of_image(&image);
        assert_eq!(sums["channels"][0], json!({"sum": 4.0, "mean": 2.0, "min": 1.0, "max": 3.0, "non_finite": 0}));
        assert_eq!(sums["channels"][1]["non_finite"], 1);
    }
}
