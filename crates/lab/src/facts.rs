//! What a result depends on, as JSON for scripts.

use manylight_gpu::Gpu;
use manylight_graph::{plan::Plan, value::Value as Parameter};
use serde_json::{Value, json};

/// Name, kind, backend and driver of the adapter.
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

/// Every parameter of the pipeline with its value.
pub fn parameters(plan: &Plan) -> Value {
    let value = |value: &Parameter| match value {
        Parameter::Int(v) => json!(v),
        Parameter::Float(v) => json!(v),
        Parameter::Bool(v) => json!(v),
        Parameter::Choice(v) => json!(v),
    };
    Value::Object(plan.params.iter().map(|(name, v)| (name.clone(), value(v))).collect())
}
