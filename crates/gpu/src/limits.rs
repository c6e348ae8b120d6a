//! Sizes compared with what the device allows, before anything is allocated.

use manylight_graph::{
    plan::{Plan, PlanNode, PlanStep},
    value::ResourceDesc,
};

use crate::{
    device::Gpu,
    error::LimitError,
    format::{byte_size, describe, texture_format},
};

/// Compares a resource's size with the limits; `subject` opens the message (``resource `ism` ``).
pub fn check_resource(limits: &wgpu::Limits, subject: &str, desc: &ResourceDesc) -> Result<(), LimitError> {
    let fail = |needed: u64, allowed: u64, unit, limit| {
        if needed <= allowed {
            return Ok(());
        }
        let subject = format!("{subject} ({})", describe(desc));
        Err(LimitError { subject, needed, allowed, unit, limit })
    };
    let bytes = byte_size(desc);
    match *desc {
        ResourceDesc::Texture { width, height, layers, .. } => {
            let side = limits.max_texture_dimension_2d;
            fail(width.max(height).into(), side.into(), " texels a side", "max_texture_dimension_2d")?;
            fail(layers.into(), limits.max_texture_array_layers.into(), " layers", "max_texture_array_layers")
        }
        ResourceDesc::Buffer { .. } => {
            fail(bytes, limits.max_buffer_size, " bytes", "max_buffer_size")?;
            fail(bytes, limits.max_storage_buffer_binding_size, " bytes", "max_storage_buffer_binding_size")
        }
        ResourceDesc::Uniform { .. } => fail(bytes, limits.max_uniform_buffer_binding_size, " bytes", "max_uniform_buffer_binding_size"),
    }
}

/// Compares a node's dispatches and render targets with the limits.
pub(crate) fn check_node(gpu: &Gpu, plan: &Plan, node: &PlanNode) -> Result<(), LimitError> {
    node.steps.iter().try_for_each(|step| check_step(gpu.limits(), plan, node, step))
}

fn check_step(limits: &wgpu::Limits, plan: &Plan, node: &PlanNode, step: &PlanStep) -> Result<(), LimitError> {
    let fail = |entry: &str, needed: u64, allowed: u32, unit, limit| {
        if needed <= u64::from(allowed) {
            return Ok(());
        }
        let subject = format!("node `{}`, entry point `{entry}`", node.id);
        Err(LimitError { subject, needed, allowed: allowed.into(), unit, limit })
    };
    match step {
        PlanStep::Compute { entry, groups, .. } => {
            let most = u64::from(groups.iter().copied().max().unwrap_or(0));
            fail(
                entry,
                most,
                limits.max_compute_workgroups_per_dimension,
                " workgroups in a dimension",
                "max_compute_workgroups_per_dimension",
            )
        }
        PlanStep::Draw { fragment, targets, .. } => {
            fail(fragment, targets.len() as u64, limits.max_color_attachments, " colour targets", "max_color_attachments")?;
            let bytes = attachment_bytes(plan, targets);
            fail(
                fragment,
                bytes.into(),
                limits.max_color_attachment_bytes_per_sample,
                " bytes a pixel of colour targets",
                "max_color_attachment_bytes_per_sample",
            )
        }
    }
}

/// Bytes of a pixel over all colour targets, counted as WebGPU does.
fn attachment_bytes(plan: &Plan, targets: &[usize]) -> u32 {
    let mut total: u32 = 0;
    for &target in targets {
        if let Some(ResourceDesc::Texture { format, .. }) = plan.resources.get(target).map(|r| &r.desc) {
            let format = texture_format(*format);
            let align = format.target_component_alignment().unwrap_or(1);
            total = total.next_multiple_of(align) + format.target_pixel_byte_cost().unwrap_or(0);
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use manylight_graph::value::{Encoding, Format};

    use super::*;

    #[test]
    fn too_large_resources_name_need_and_limit() {
        let limits = wgpu::Limits { max_texture_dimension_2d: 1024, ..Default::default() };
        let desc = ResourceDesc::Texture {
            format: Format::R32Float,
            width: 4096,
            height: 1,
            layers: 1,
            array: false,
            mips: 1,
            encoding: Encoding::Plain,
        };
        let error = check_resource(&limits, "resource `ism`", &desc).expect_err("4096 is above 1024");
        let text = error.to_string();
        for part in ["`ism`", "4096", "1024", "max_texture_dimension_2d"] {
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn endless_buffers_are_refused_and_do_not_overflow() {
        let desc = ResourceDesc::Buffer { element: "u32".into(), stride: 4, count: u64::MAX };
        check_resource(&wgpu::Limits::default(), "resource `x`", &desc).expect_err("no GPU has that much");
    }
}
