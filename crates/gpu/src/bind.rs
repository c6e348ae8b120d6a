//! Bind groups by name: which resource each global of a step's shader stands for, and the layouts and groups that follow.

use std::collections::BTreeMap;

use manylight_graph::{
    plan::{Plan, PlanNode, Target},
    shader::{Access, Global, GlobalKind, SampleKind, Shader, Stage},
    value::{Format, ResourceDesc},
};

use crate::{
    device::Gpu,
    externals::Externals,
    format::texture_format,
    params::PARAMS,
    pipeline_cache::{LayoutKey, PipelineCache},
    pool::{Memory, Resource, placeholder_buffer, placeholder_texture},
};

/// Layouts of a step.
#[derive(Debug, Clone)]
pub(crate) struct StepLayout {
    pub(crate) key: LayoutKey,
    pub(crate) pipeline: wgpu::PipelineLayout,
    groups: Vec<GroupLayout>,
}

#[derive(Debug, Clone)]
struct GroupLayout {
    index: u32,
    layout: wgpu::BindGroupLayout,
    /// Indices into [`Shader::globals`].
    globals: Vec<usize>,
}

/// Bind groups of a step with their group numbers.
pub(crate) type Groups = Vec<(u32, wgpu::BindGroup)>;

/// What a node binds besides resources.
#[derive(Debug, Default, Clone)]
pub(crate) struct Own {
    /// The uniform `params`.
    pub(crate) params: Option<wgpu::Buffer>,
    /// Stand-ins for absent ports, by index into [`Shader::globals`].
    pub(crate) absent: BTreeMap<usize, Memory>,
}

/// Which mip level of a port a global is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    /// The step's own level if the step runs over the mips of this port; otherwise all (read) or 0 (written).
    Own,
    Finer,
    Coarser,
}

/// What a global stands for.
enum Source<'a> {
    Params,
    Sampler(&'a wgpu::Sampler),
    Port { port: &'a str, target: Target, level: Level },
}

fn source<'a>(gpu: &'a Gpu, node: &'a PlanNode, global: &'a Global) -> Result<Source<'a>, String> {
    let port = |name: &str| node.bindings.iter().find(|(port, _)| port == name).map(|(port, target)| (port.as_str(), *target));
    let name = global.name.as_str();
    if let Some((port, target)) = port(name) {
        return Ok(Source::Port { port, target, level: Level::Own });
    }
    for (suffix, level) in [("_finer", Level::Finer), ("_coarser", Level::Coarser)] {
        if let Some((port, target)) = name.strip_suffix(suffix).and_then(port) {
            return Ok(Source::Port { port, target, level });
        }
    }
    match &global.kind {
        GlobalKind::Uniform { .. } if name == PARAMS => Ok(Source::Params),
        GlobalKind::Sampler => {
            let known = gpu.sampler(name).ok_or_else(|| {
                format!("there is no sampler `{name}`; there are linear_sampler, linear_repeat_sampler and nearest_sampler")
            })?;
            Ok(Source::Sampler(known))
        }
        _ => Err(format!("the global `{name}` is no port of `{}`", node.decl.name)),
    }
}

/// Indices of the globals that the named entry points use, with the stages that see them.
fn used(shader: &Shader, entries: &[&str]) -> BTreeMap<usize, wgpu::ShaderStages> {
    let mut all: BTreeMap<usize, wgpu::ShaderStages> = BTreeMap::new();
    for entry in shader.entries.iter().filter(|e| entries.contains(&e.name.as_str())) {
        let stage = match entry.stage {
            Stage::Compute => wgpu::ShaderStages::COMPUTE,
            Stage::Vertex => wgpu::ShaderStages::VERTEX,
            Stage::Fragment => wgpu::ShaderStages::FRAGMENT,
        };
        for (global, _) in &entry.uses {
            *all.entry(*global).or_insert(wgpu::ShaderStages::NONE) |= stage;
        }
    }
    all
}

/// Layouts for a step that runs the named entry points.
pub(crate) fn step_layout(
    gpu: &Gpu,
    cache: &mut PipelineCache,
    plan: &Plan,
    node: &PlanNode,
    shader: &Shader,
    entries: &[&str],
) -> Result<StepLayout, String> {
    let mut by_group: BTreeMap<u32, Vec<(usize, wgpu::BindGroupLayoutEntry)>> = BTreeMap::new();
    for (ix, visibility) in used(shader, entries) {
        let Some(global) = shader.globals.get(ix) else {
            continue;
        };
        let entry =
            wgpu::BindGroupLayoutEntry { binding: global.binding, visibility, ty: binding_type(gpu, plan, node, global)?, count: None };
        by_group.entry(global.group).or_default().push((ix, entry));
    }
    let mut ids = Vec::new();
    let mut groups = Vec::new();
    for (index, mut entries) in by_group {
        if index >= gpu.limits().max_bind_groups {
            return Err(format!("@group({index}) is beyond the {} bind groups of this GPU", gpu.limits().max_bind_groups));
        }
        entries.sort_by_key(|(_, e)| e.binding);
        let (globals, entries) = entries.into_iter().unzip();
        let (id, layout) = cache.group_layout(gpu, entries)?;
        ids.resize(index as usize, None);
        ids.push(Some(id));
        groups.push(GroupLayout { index, layout, globals });
    }
    let mut layouts = vec![None; ids.len()];
    for group in &groups {
        layouts[group.index as usize] = Some(&group.layout);
    }
    let key = LayoutKey(ids);
    let pipeline = cache.pipeline_layout(gpu, &key, &layouts)?;
    Ok(StepLayout { key, pipeline, groups })
}

fn binding_type(gpu: &Gpu, plan: &Plan, node: &PlanNode, global: &Global) -> Result<wgpu::BindingType, String> {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    Ok(match &global.kind {
        GlobalKind::Uniform { .. } => buffer(wgpu::BufferBindingType::Uniform),
        GlobalKind::Storage { access, .. } => buffer(wgpu::BufferBindingType::Storage { read_only: !access.write }),
        GlobalKind::Sampler => {
            let nearest = global.name.starts_with("nearest");
            wgpu::BindingType::Sampler(if nearest { wgpu::SamplerBindingType::NonFiltering } else { wgpu::SamplerBindingType::Filtering })
        }
        GlobalKind::StorageTexture { format, array, access } => wgpu::BindingType::StorageTexture {
            access: storage_access(*access),
            format: texture_format(*format),
            view_dimension: dimension(*array),
        },
        GlobalKind::Texture { sample, array, filtered } => {
            let bound = match source(gpu, node, global)? {
                Source::Port { target: Target::Resource(ix) | Target::Previous(ix), .. } => format_of(plan, ix),
                _ => None,
            };
            // A format that this device cannot filter may still be sampled with `nearest_sampler`.
            let filterable = *filtered && bound.is_none_or(|f| is_filterable(gpu, f));
            let sample_type = match sample {
                SampleKind::Float => wgpu::TextureSampleType::Float { filterable },
                SampleKind::Uint => wgpu::TextureSampleType::Uint,
                SampleKind::Sint => wgpu::TextureSampleType::Sint,
                SampleKind::Depth => wgpu::TextureSampleType::Depth,
            };
            wgpu::BindingType::Texture { sample_type, view_dimension: dimension(*array), multisampled: false }
        }
    })
}

fn storage_access(access: Access) -> wgpu::StorageTextureAccess {
    match access {
        Access { read: true, write: true } => wgpu::StorageTextureAccess::ReadWrite,
        Access { read: true, .. } => wgpu::StorageTextureAccess::ReadOnly,
        _ => wgpu::StorageTextureAccess::WriteOnly,
    }
}

fn dimension(array: bool) -> wgpu::TextureViewDimension {
    if array { wgpu::TextureViewDimension::D2Array } else { wgpu::TextureViewDimension::D2 }
}

fn format_of(plan: &Plan, ix: usize) -> Option<Format> {
    match plan.resources.get(ix)?.desc {
        ResourceDesc::Texture { format, .. } => Some(format),
        _ => None,
    }
}

fn is_filterable(gpu: &Gpu, format: Format) -> bool {
    let kind = texture_format(format).sample_type(None, Some(gpu.features()));
    kind == Some(wgpu::TextureSampleType::Float { filterable: true })
}

/// Stand-ins for the ports of `node` that are connected to nothing.
pub(crate) fn placeholders(gpu: &Gpu, node: &PlanNode, shader: &Shader) -> Result<BTreeMap<usize, Memory>, String> {
    let is_absent = |global: &Global| matches!(source(gpu, node, global), Ok(Source::Port { target: Target::Absent, .. }));
    let make = |global: &Global| match &global.kind {
        GlobalKind::Texture { sample, .. } => {
            let format = match sample {
                SampleKind::Float => wgpu::TextureFormat::Rgba8Unorm,
                SampleKind::Uint => wgpu::TextureFormat::R32Uint,
                SampleKind::Sint => wgpu::TextureFormat::R32Sint,
                SampleKind::Depth => wgpu::TextureFormat::Depth32Float,
            };
            Memory::Texture(placeholder_texture(gpu, format, false))
        }
        GlobalKind::StorageTexture { format, .. } => Memory::Texture(placeholder_texture(gpu, texture_format(*format), true)),
        GlobalKind::Storage { stride, .. } => Memory::Buffer(placeholder_buffer(gpu, *stride, false)),
        GlobalKind::Uniform { size, .. } => Memory::Buffer(placeholder_buffer(gpu, *size, true)),
        GlobalKind::Sampler => Memory::Buffer(placeholder_buffer(gpu, 4, true)),
    };
    let absent = shader.globals.iter().enumerate().filter(|(_, g)| is_absent(g));
    gpu.scoped(|| absent.map(|(ix, g)| (ix, make(g))).collect())
}

/// Where bind groups find memory.
#[derive(Clone, Copy)]
pub(crate) struct Finder<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) resources: &'a [Resource],
    pub(crate) externals: &'a Externals,
}

enum Bound<'a> {
    Sampler(&'a wgpu::Sampler),
    Buffer(&'a wgpu::Buffer),
    View(wgpu::TextureView),
}

impl<'a> Finder<'a> {
    /// Memory behind a target in a frame of this parity.
    pub(crate) fn memory(&self, target: Target, parity: usize) -> Result<&'a Memory, String> {
        let (ix, parity) = match target {
            Target::Resource(ix) => (ix, parity),
            Target::Previous(ix) => (ix, parity ^ 1),
            Target::Absent => return Err("it is connected to nothing".to_owned()),
        };
        let resource = self.resources.get(ix).ok_or("the plan names a resource that is not there")?;
        resource
            .memory(parity)
            .or_else(|| self.externals.memory(&resource.name))
            .ok_or_else(|| format!("nobody set the external `{}`", resource.name))
    }

    /// The bind groups of a step of `node` for frames of this parity.
    pub(crate) fn groups(
        &self,
        node: &PlanNode,
        shader: &Shader,
        own: &Own,
        layout: &StepLayout,
        mip: Option<(&str, u32)>,
        parity: usize,
    ) -> Result<Groups, String> {
        let mut groups = Vec::with_capacity(layout.groups.len());
        for group in &layout.groups {
            let mut bound = Vec::with_capacity(group.globals.len());
            for &ix in &group.globals {
                let global = &shader.globals[ix];
                let resource = self.bound(node, own, ix, global, mip, parity).map_err(|e| format!("`{}`: {e}", global.name))?;
                bound.push((global.binding, resource));
            }
            let entries: Vec<_> = bound
                .iter()
                .map(|(binding, bound)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: match bound {
                        Bound::Sampler(sampler) => wgpu::BindingResource::Sampler(sampler),
                        Bound::Buffer(buffer) => buffer.as_entire_binding(),
                        Bound::View(view) => wgpu::BindingResource::TextureView(view),
                    },
                })
                .collect();
            let descriptor = wgpu::BindGroupDescriptor { label: Some(&node.id), layout: &group.layout, entries: &entries };
            let made = self.gpu.scoped(|| self.gpu.device().create_bind_group(&descriptor))?;
            groups.push((group.index, made));
        }
        Ok(groups)
    }

    fn bound<'b>(
        &self,
        node: &'b PlanNode,
        own: &'b Own,
        ix: usize,
        global: &'b Global,
        mip: Option<(&str, u32)>,
        parity: usize,
    ) -> Result<Bound<'b>, String>
    where
        'a: 'b,
    {
        let (port, target, level) = match source(self.gpu, node, global)? {
            Source::Params => {
                return own.params.as_ref().map(Bound::Buffer).ok_or("it has no layout".to_owned());
            }
            Source::Sampler(sampler) => return Ok(Bound::Sampler(sampler)),
            Source::Port { port, target, level } => (port, target, level),
        };
        let memory = match own.absent.get(&ix) {
            Some(stand_in) => stand_in,
            None => self.memory(target, parity)?,
        };
        let texture = match memory {
            Memory::Buffer(buffer) => return Ok(Bound::Buffer(buffer)),
            Memory::Texture(texture) => texture,
        };
        let (array, written) = match &global.kind {
            GlobalKind::Texture { array, .. } => (*array, false),
            GlobalKind::StorageTexture { array, .. } => (*array, true),
            _ => return Err("a texture is connected to a buffer port".to_owned()),
        };
        let own_level = mip.filter(|(of, _)| *of == port).map(|(_, level)| level);
        let only = match (level, own_level) {
            (Level::Own, Some(level)) => Some(level),
            (Level::Finer, Some(level)) => Some(level.checked_sub(1).ok_or("level 0 has no finer one")?),
            (Level::Coarser, Some(level)) => Some(level + 1),
            (Level::Own, None) => written.then_some(0),
            (Level::Finer | Level::Coarser, None) => {
                return Err("only steps repeated over the mips of the port have it".to_owned());
            }
        };
        let only = if own.absent.contains_key(&ix) { Some(0) } else { only };
        Ok(Bound::View(view(texture, array, only)))
    }
}

/// A view of one mip level or of all.
pub(crate) fn view(texture: &wgpu::Texture, array: bool, mip: Option<u32>) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(dimension(array)),
        base_mip_level: mip.unwrap_or(0),
        mip_level_count: mip.map(|_| 1),
        array_layer_count: (!array).then_some(1),
        ..Default::default()
    })
}
