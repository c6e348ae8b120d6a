//! What a result depends on, as JSON for scripts.

use manylight_gpu::{Gpu, GpuKind};
use manylight_graph::{plan::Plan, value::Value as Parameter};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

/// Name, kind, backend and driver of the adapter; of a software adapter also the threads that the machine has.
pub fn adapter(gpu: &Gpu) -> Value {
    let info = gpu.adapter_info();
    // What a software adapter runs on decides its times.
    let threads = if gpu.kind() == GpuKind::Software { std::thread::available_parallelism().ok().map(|n| n.get()) } else { None };
    json!({
        "threads": threads,
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

/// Everything that decides what a plan's GPU work computes: nodes with their shaders, parameters, connections and sizes.
pub fn fingerprint(plan: &Plan) -> String {
    let shaders: Vec<String> =
        plan.nodes.iter().map(|n| n.decl.shader.as_ref().map_or(String::new(), |s| format!("{:016x}", s.hash))).collect();
    hash(&[&plan.to_json().to_string(), &shaders.join(" ")])
}

/// Hash of several parts, hexadecimal: the first half of SHA-256, which is enough to tell any two apart.
pub fn hash(parts: &[&(impl AsRef<[u8]> + ?Sized)]) -> String {
    let mut digest = Sha256::new();
    for part in parts {
        // The lengths keep ("ab", "c") and ("a", "bc") apart.
        digest.update((part.as_ref().len() as u64).to_le_bytes());
        digest.update(part.as_ref());
    }
    digest.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect()
}
