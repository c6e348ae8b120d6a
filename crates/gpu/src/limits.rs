//! Sizes compared with what the device allows, before anything is allocated.

use manylight_graph::{
    plan::{Lifetime, Plan, PlanNode, PlanResource, PlanStep, Workgroups},
    value::ResourceDesc,
};

use crate::{
    device::Gpu,
    error::{Fault, LimitError, OUT_OF_MEMORY},
    format::{byte_size, describe, texture_format},
};

/// Compares a resource's size with the limits; `subject` opens the message (``resource `ism` ``).
pub fn check_resource(limits: &wgpu::Limits, subject: &str, desc: &ResourceDesc) -> Result<(), LimitError> {
    let fail = |needed: u64, allowed: u64, unit, limit| {
        if needed <= allowed {
            return Ok(());
        }
        let subject = format!("{subject} ({})", describe(desc));
        Err(LimitError { subject, needed, allowed, unit, limit, remedy: String::new() })
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

/// Compares the size of a plan's resource with the limits. The error names the parameters to lower.
pub(crate) fn check_planned(limits: &wgpu::Limits, plan: &Plan, resource: &PlanResource) -> Result<(), LimitError> {
    let checked = check_resource(limits, &format!("resource `{}`", resource.name), &resource.desc);
    checked.map_err(|error| LimitError { remedy: remedy(plan, [resource]), ..error })
}

/// The error of a resource that could not be made: when memory ran out, what to lower for those that take most.
pub(crate) fn out_of_memory(plan: &Plan, fault: Fault) -> Fault {
    let Fault::Resource { resource, message } = fault else { return fault };
    if message != OUT_OF_MEMORY {
        return Fault::Resource { resource, message };
    }
    let mut own: Vec<&PlanResource> = plan.resources.iter().filter(|r| r.lifetime != Lifetime::External).collect();
    own.sort_by_key(|r| std::cmp::Reverse(byte_size(&r.desc)));
    let all: u64 = own.iter().map(|r| byte_size(&r.desc)).fold(0, u64::saturating_add);
    own.truncate(LARGEST);
    let needed = format!("{} MiB", all.div_ceil(1 << 20));
    Fault::OutOfMemory { resource, needed, remedy: remedy(plan, own) }
}

/// So many resources are looked at for what to lower when memory ran out.
const LARGEST: usize = 3;

/// Names the parameters that decide the sizes of resources, with their values.
fn remedy<'a>(plan: &Plan, resources: impl IntoIterator<Item = &'a PlanResource>) -> String {
    let mut names: Vec<&str> = Vec::new();
    let mut has_fixed = false;
    for resource in resources {
        has_fixed |= resource.sized_by.is_empty();
        names.extend(resource.sized_by.iter().map(String::as_str));
    }
    names.sort_unstable();
    names.dedup();
    let value = |name: &str| plan.param(name).map(|value| format!(" (now {value})"));
    let mut shown: Vec<String> = names.into_iter().map(|name| format!("`{name}`{}", value(name).unwrap_or_default())).collect();
    if has_fixed {
        shown.push("the size of the picture".to_owned());
    }
    format!("lower {}", shown.join(" or "))
}

/// What to lower for a node: what decides the sizes of what it writes.
fn remedy_of_node(plan: &Plan, node: &PlanNode) -> String {
    remedy(plan, node.outputs().filter_map(|ix| plan.resources.get(ix)))
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
        Err(LimitError { subject, needed, allowed: allowed.into(), unit, limit, remedy: remedy_of_node(plan, node) })
    };
    match step {
        PlanStep::Compute { entry, groups, .. } => {
            let known = node.decl.shader.as_ref().and_then(|shader| shader.entries.iter().find(|e| e.name == *entry));
            let shared = known.map_or(0, |e| e.workgroup_bytes);
            let (allowed, limit) = (limits.max_compute_workgroup_storage_size, "max_compute_workgroup_storage_size");
            if shared > allowed.into() {
                let subject = format!("node `{}`, entry point `{entry}`", node.id);
                let remedy = "make its `var<workgroup>` smaller".to_owned();
                return Err(LimitError {
                    subject,
                    needed: shared,
                    allowed: allowed.into(),
                    unit: " bytes shared by a workgroup",
                    limit,
                    remedy,
                });
            }
            // What the GPU finds itself is bounded by wgpu: more than the limit runs nothing.
            let most = match groups {
                Workgroups::Fixed(groups) => u64::from(groups.iter().copied().max().unwrap_or(0)),
                Workgroups::Indirect(_) => 0,
            };
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
fn attachment_bytes(plan: &Plan, targets: &[Option<usize>]) -> u32 {
    let mut total: u32 = 0;
    for &target in targets.iter().flatten() {
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
    use manylight_graph::{
        plan::Usage,
        value::{Encoding, Format, Value},
    };

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
    fn a_lack_of_memory_names_what_takes_most() {
        let resource = |name: &str, count: u64, sized_by: &[&str]| PlanResource {
            name: name.to_owned(),
            desc: ResourceDesc::Buffer { element: "u32".into(), stride: 4, count },
            sized_by: sized_by.iter().map(|name| (*name).to_owned()).collect(),
            lifetime: Lifetime::Kept,
            usage: Usage::default(),
        };
        let resources = vec![
            resource("tiny", 1, &["samples"]),
            resource("points", 1 << 28, &["point_count"]),
            resource("atlas", 1 << 27, &["clusters", "ism_size"]),
            resource("splats", 1 << 26, &["clusters"]),
        ];
        let params = vec![("clusters".to_owned(), Value::Int(4096)), ("point_count".to_owned(), Value::Int(9))];
        let plan = Plan { nodes: Vec::new(), idle: Vec::new(), resources, presents: 0, radiance: None, params, slots: 0 };
        let fault = |message: &str| Fault::Resource { resource: "resource `atlas`".into(), message: message.into() };
        let text = out_of_memory(&plan, fault(OUT_OF_MEMORY)).to_string();
        for part in ["`atlas`", "1793 MiB", "`clusters` (now 4096)", "`ism_size`", "`point_count` (now 9)"] {
            assert!(text.contains(part), "{text}");
        }
        assert!(!text.contains("samples"), "{text}");
        assert_eq!(out_of_memory(&plan, fault("it is odd")).to_string(), fault("it is odd").to_string());
    }

    #[test]
    fn endless_buffers_are_refused_and_do_not_overflow() {
        let desc = ResourceDesc::Buffer { element: "u32".into(), stride: 4, count: u64::MAX };
        check_resource(&wgpu::Limits::default(), "resource `x`", &desc).expect_err("no GPU has that much");
    }
}
