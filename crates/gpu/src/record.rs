//! The commands of a compute pass and of a draw. Nothing here allocates.

use crate::frame::{Dispatch, DispatchSize, Draw};

/// Colour targets that WebGPU allows at most.
pub(crate) const MOST_TARGETS: usize = 8;

/// Query set, and the queries to write at the begin and at the end of a pass.
pub(crate) type Stamps<'a> = Option<(&'a wgpu::QuerySet, Option<u32>, Option<u32>)>;

/// Records dispatches in one pass.
pub(crate) fn compute(encoder: &mut wgpu::CommandEncoder, label: &str, steps: &[Dispatch], parity: usize, stamps: Stamps<'_>) {
    let timestamp_writes = stamps.map(|(query_set, begin, end)| wgpu::ComputePassTimestampWrites {
        query_set,
        beginning_of_pass_write_index: begin,
        end_of_pass_write_index: end,
    });
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes });
    let mut before: Option<&Dispatch> = None;
    for step in steps {
        if before.is_none_or(|b| b.pipeline != step.pipeline) {
            pass.set_pipeline(&step.pipeline);
        }
        let groups = &step.bindings.groups[parity];
        // Steps that share a layout and are repeated share their bind groups.
        if before.is_none_or(|b| b.bindings.groups[parity] != *groups) {
            for (index, group) in groups {
                pass.set_bind_group(*index, group, &[]);
            }
        }
        match &step.groups {
            DispatchSize::Fixed([x, y, z]) => pass.dispatch_workgroups(*x, *y, *z),
            DispatchSize::Indirect(_, buffers) => pass.dispatch_workgroups_indirect(&buffers[parity], 0),
        }
        before = Some(step);
    }
}

/// Records a draw in a pass of its own.
pub(crate) fn draw(encoder: &mut wgpu::CommandEncoder, label: &str, step: &Draw, parity: usize, stamps: Stamps<'_>) {
    let mut colors = [const { None }; MOST_TARGETS];
    for (slot, target) in colors.iter_mut().zip(&step.targets) {
        let Some((views, clear)) = target else { continue };
        let load = if *clear { wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT) } else { wgpu::LoadOp::Load };
        *slot = Some(wgpu::RenderPassColorAttachment {
            view: &views[parity],
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load, store: wgpu::StoreOp::Store },
        });
    }
    let depth = step.depth.as_ref().map(|(views, clear)| {
        let load = if *clear { wgpu::LoadOp::Clear(0.0) } else { wgpu::LoadOp::Load };
        wgpu::RenderPassDepthStencilAttachment {
            view: &views[parity],
            depth_ops: Some(wgpu::Operations { load, store: wgpu::StoreOp::Store }),
            stencil_ops: None,
        }
    });
    let timestamp_writes = stamps.map(|(query_set, begin, end)| wgpu::RenderPassTimestampWrites {
        query_set,
        beginning_of_pass_write_index: begin,
        end_of_pass_write_index: end,
    });
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some(label),
        color_attachments: &colors[..step.targets.len()],
        depth_stencil_attachment: depth,
        timestamp_writes,
        ..Default::default()
    });
    pass.set_pipeline(&step.pipeline);
    for (index, group) in &step.bindings.groups[parity] {
        pass.set_bind_group(*index, group, &[]);
    }
    pass.draw(0..step.vertices, 0..step.instances);
}
