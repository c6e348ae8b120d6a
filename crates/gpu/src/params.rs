//! Parameters of a node as its shader takes them: fields of the uniform `params`, and pipeline-overridable constants.

use manylight_graph::{
    plan::PlanNode,
    registry::NodeDecl,
    shader::{GlobalKind, Layout, MemberKind, Scalar, Shader},
    value::{ParamKind, Value},
};

use crate::device::Gpu;

/// Name of the uniform whose fields are parameters.
pub(crate) const PARAMS: &str = "params";

/// The value of a parameter as a number: a choice is the index of its option, a switch is 0 or 1.
fn number(decl: &NodeDecl, name: &str, value: &Value) -> f64 {
    match value {
        Value::Int(v) => *v as f64,
        Value::Float(v) => *v,
        Value::Bool(v) => f64::from(u8::from(*v)),
        Value::Choice(option) => option_index(decl, name, option) as f64,
    }
}

fn options<'a>(decl: &'a NodeDecl, name: &str) -> &'a [String] {
    match decl.params.get(name).map(|p| &p.kind) {
        Some(ParamKind::Choice { options, .. }) => options,
        _ => &[],
    }
}

fn option_index(decl: &NodeDecl, name: &str, option: &str) -> usize {
    options(decl, name).iter().position(|o| o == option).unwrap_or(0)
}

/// Values of the overridable constants that the node's parameters set, in the order of the shader.
pub(crate) fn overrides(node: &PlanNode, shader: &Shader) -> Vec<(String, f64)> {
    let value = |constant: &str| {
        if let Some((name, value)) = node.params.iter().find(|(name, _)| name == constant) {
            return Some(number(&node.decl, name, value));
        }
        node.params.iter().find_map(|(name, value)| {
            let option = constant.strip_prefix(name.as_str())?.strip_prefix("_is_")?;
            let Value::Choice(chosen) = value else {
                return None;
            };
            let declared = options(&node.decl, name).iter().any(|o| o == option);
            declared.then(|| f64::from(u8::from(chosen == option)))
        })
    };
    shader.overrides.iter().filter_map(|(name, _)| Some((name.clone(), value(name)?))).collect()
}

/// Contents of the uniform `params`, when the shader has it.
pub(crate) fn uniform_bytes(node: &PlanNode, shader: &Shader) -> Option<Vec<u8>> {
    if node.decl.ports.contains_key(PARAMS) {
        return None;
    }
    let global = shader.globals.iter().find(|g| g.name == PARAMS)?;
    let GlobalKind::Uniform { element, size } = &global.kind else {
        return None;
    };
    let mut bytes = vec![0; (*size as usize).next_multiple_of(16)];
    if let Some(layout) = shader.layouts.get(element) {
        fill(node, layout, &mut bytes);
    }
    Some(bytes)
}

fn fill(node: &PlanNode, layout: &Layout, bytes: &mut [u8]) {
    for member in &layout.members {
        let MemberKind::Numeric { scalar, .. } = &member.kind else {
            continue;
        };
        let Some((name, value)) = node.params.iter().find(|(name, _)| *name == member.name) else {
            continue;
        };
        let number = number(&node.decl, name, value);
        let word = match scalar {
            Scalar::F32 => (number as f32).to_le_bytes(),
            Scalar::I32 => (number as i32).to_le_bytes(),
            Scalar::U32 => (number as u32).to_le_bytes(),
            Scalar::Bool => u32::from(number != 0.0).to_le_bytes(),
        };
        let at = member.offset as usize;
        if let Some(field) = bytes.get_mut(at..at + 4) {
            field.copy_from_slice(&word);
        }
    }
}

/// A uniform buffer with these contents.
pub(crate) fn uniform_buffer(gpu: &Gpu, label: &str, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = gpu.device().create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.len() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    gpu.queue().write_buffer(&buffer, 0, bytes);
    buffer
}
