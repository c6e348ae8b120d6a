//! A step's pipeline, and the pass that runs it.

use manylight_graph::{
    plan::{Plan, PlanNode, PlanStep, ResourceIx, Target, Workgroups},
    shader::Shader,
    value::{Format, ResourceDesc},
};

use crate::{
    bind::{Finder, StepLayout, step_layout, view},
    device::Gpu,
    error::Fault,
    format::texture_format,
    frame::{Bindings, Dispatch, DispatchSize, Draw, Pass, entry_of},
    params,
    pipeline_cache::{ComputeKey, Constants, PipelineCache, Refused, RenderKey},
    pool::Memory,
    record::MOST_TARGETS,
};

/// A step's pipeline with its layout, before memory is known.
pub(crate) struct Prepared {
    pub(crate) layout: StepLayout,
    pub(crate) pipeline: Pipeline,
}

pub(crate) enum Pipeline {
    Compute(wgpu::ComputePipeline),
    Render(wgpu::RenderPipeline),
}

/// Makes the pipeline of a step, or finds it in the cache.
pub(crate) fn prepare(
    gpu: &Gpu,
    cache: &mut PipelineCache,
    plan: &Plan,
    node: &PlanNode,
    shader: &Shader,
    step: &PlanStep,
) -> Result<Prepared, Fault> {
    let entry = || entry_of(Some(step));
    let binding = |message| Fault::Binding { node: node.id.clone(), entry: entry(), message };
    let refused = |refused| match refused {
        Refused::Module(message) => Fault::Module { node: node.id.clone(), shader: shader.source.name.clone(), message },
        Refused::Pipeline(message) => {
            Fault::Pipeline { node: node.id.clone(), entry: entry(), shader: shader.source.name.clone(), message }
        }
    };
    let constants = Constants::new(&params::overrides(node, shader));
    match step {
        PlanStep::Compute { entry, .. } => {
            let layout = step_layout(gpu, cache, plan, node, shader, &[entry]).map_err(binding)?;
            let key = ComputeKey { shader: shader.hash, entry: entry.clone(), constants, layout: layout.key.clone() };
            let pipeline = cache.compute(gpu, shader, &layout.pipeline, key).map_err(refused)?;
            Ok(Prepared { layout, pipeline: Pipeline::Compute(pipeline) })
        }
        PlanStep::Draw { vertex, fragment, targets, depth, .. } => {
            let layout = step_layout(gpu, cache, plan, node, shader, &[vertex, fragment]).map_err(binding)?;
            let formats = color_formats(gpu, plan, targets).map_err(binding)?;
            let key = RenderKey {
                shader: shader.hash,
                vertex: vertex.clone(),
                fragment: fragment.clone(),
                constants,
                layout: layout.key.clone(),
                targets: formats,
                depth: depth.is_some(),
            };
            let pipeline = cache.render(gpu, shader, &layout.pipeline, key).map_err(refused)?;
            Ok(Prepared { layout, pipeline: Pipeline::Render(pipeline) })
        }
    }
}

fn color_formats(gpu: &Gpu, plan: &Plan, targets: &[Option<ResourceIx>]) -> Result<Vec<Option<wgpu::TextureFormat>>, String> {
    if targets.len() > MOST_TARGETS {
        return Err(format!("it has more than {MOST_TARGETS} colour targets"));
    }
    let format_of = |ix: ResourceIx| {
        let resource = &plan.resources[ix];
        let name = &resource.name;
        match resource.desc {
            ResourceDesc::Texture { format: Format::Depth32Float, .. } => Err(format!("`{name}` is a depth texture and no colour target")),
            ResourceDesc::Texture { format, .. } => {
                let format = texture_format(format);
                let usages = gpu.adapter().get_texture_format_features(format).allowed_usages;
                if usages.contains(wgpu::TextureUsages::RENDER_ATTACHMENT) {
                    Ok(format)
                } else {
                    Err(format!("this GPU cannot draw to the format {format:?} of `{name}`"))
                }
            }
            _ => Err(format!("`{name}` is a buffer and no colour target")),
        }
    };
    targets.iter().map(|ix| ix.map(format_of).transpose()).collect()
}

/// The number of workgroups that lies in a buffer.
pub(crate) fn dispatch_size(finder: Finder<'_>, target: Target) -> Result<DispatchSize, String> {
    let of = |parity| match finder.memory(target, parity)? {
        Memory::Buffer(buffer) if buffer.usage().contains(wgpu::BufferUsages::INDIRECT) => Ok(buffer.clone()),
        Memory::Buffer(_) => Err("the buffer that says how many workgroups run was made without the usage INDIRECT".to_owned()),
        Memory::Texture(_) => Err("a texture cannot say how many workgroups run".to_owned()),
    };
    Ok(DispatchSize::Indirect(target, [of(0)?, of(1)?]))
}

/// A pass of one step; `cleared` tells which targets an earlier draw of the node has already cleared.
pub(crate) fn pass(
    finder: Finder<'_>,
    step: &PlanStep,
    pipeline: Pipeline,
    bindings: Bindings,
    cleared: &mut Vec<ResourceIx>,
) -> Result<Pass, String> {
    match (step, pipeline) {
        (PlanStep::Compute { groups, .. }, Pipeline::Compute(pipeline)) => {
            let groups = match groups {
                Workgroups::Fixed(groups) => DispatchSize::Fixed(*groups),
                Workgroups::Indirect(target) => dispatch_size(finder, *target)?,
            };
            Ok(Pass::Compute(vec![Dispatch { pipeline, bindings, groups }]))
        }
        (PlanStep::Draw { vertices, instances, targets, depth, .. }, Pipeline::Render(pipeline)) => {
            let mut attach = |ix: ResourceIx| {
                let of = |parity| match finder.memory(Target::Resource(ix), parity)? {
                    Memory::Texture(texture) => Ok(view(texture, false, Some(0))),
                    Memory::Buffer(_) => Err("a buffer is no render target".to_owned()),
                };
                let clear = !cleared.contains(&ix);
                cleared.push(ix);
                Ok::<_, String>(([of(0)?, of(1)?], clear))
            };
            let targets = targets.iter().map(|ix| ix.map(&mut attach).transpose());
            let targets = targets.collect::<Result<_, _>>()?;
            let depth = depth.map(attach).transpose()?;
            Ok(Pass::Draw(Box::new(Draw { pipeline, bindings, vertices: *vertices, instances: *instances, targets, depth })))
        }
        _ => Err("the pipeline does not fit the step".to_owned()),
    }
}
