//! Shader modules, layouts and pipelines, kept across builds: what did not change is not compiled again.

use std::{collections::HashMap, hash::Hash};

use manylight_graph::shader::Shader;

use crate::device::Gpu;

/// Builds after which an unused pipeline is forgotten.
const KEEP_BUILDS: u64 = 24;

/// Number of a bind-group layout in the cache.
pub(crate) type LayoutId = usize;

/// A step's layout: bind-group layouts by group number.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct LayoutKey(pub(crate) Vec<Option<LayoutId>>);

/// Values of overridable constants, comparable.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct Constants(Vec<(String, u64)>);

impl Constants {
    pub(crate) fn new(values: &[(String, f64)]) -> Self {
        Self(values.iter().map(|(name, v)| (name.clone(), v.to_bits())).collect())
    }

    fn slice(&self) -> Vec<(&str, f64)> {
        self.0.iter().map(|(name, bits)| (name.as_str(), f64::from_bits(*bits))).collect()
    }
}

/// What makes a compute pipeline.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct ComputeKey {
    pub(crate) shader: u64,
    pub(crate) entry: String,
    pub(crate) constants: Constants,
    pub(crate) layout: LayoutKey,
}

/// What makes a render pipeline.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(crate) struct RenderKey {
    pub(crate) shader: u64,
    pub(crate) vertex: String,
    pub(crate) fragment: String,
    pub(crate) constants: Constants,
    pub(crate) layout: LayoutKey,
    pub(crate) targets: Vec<Option<wgpu::TextureFormat>>,
    pub(crate) depth: bool,
}

/// Why a pipeline could not be made.
pub(crate) enum Refused {
    Module(String),
    Pipeline(String),
}

struct Used<T> {
    value: T,
    build: u64,
}

/// The cache of one device.
#[derive(Default)]
pub(crate) struct PipelineCache {
    build: u64,
    compiled: usize,
    reused: usize,
    modules: HashMap<u64, Used<wgpu::ShaderModule>>,
    group_layouts: HashMap<Vec<wgpu::BindGroupLayoutEntry>, (LayoutId, wgpu::BindGroupLayout)>,
    layouts: HashMap<LayoutKey, wgpu::PipelineLayout>,
    compute: HashMap<ComputeKey, Used<wgpu::ComputePipeline>>,
    render: HashMap<RenderKey, Used<wgpu::RenderPipeline>>,
}

impl PipelineCache {
    /// Starts a build.
    pub(crate) fn begin(&mut self) {
        self.build += 1;
        (self.compiled, self.reused) = (0, 0);
    }

    /// Ends a build: pipelines compiled and taken from the cache. Forgets what no recent build used.
    pub(crate) fn finish(&mut self) -> (usize, usize) {
        let oldest = self.build.saturating_sub(KEEP_BUILDS);
        fn keep<K: Hash + Eq, T>(map: &mut HashMap<K, Used<T>>, oldest: u64) {
            map.retain(|_, used| used.build >= oldest);
        }
        keep(&mut self.modules, oldest);
        keep(&mut self.compute, oldest);
        keep(&mut self.render, oldest);
        (self.compiled, self.reused)
    }

    /// Pipelines compiled since the build began.
    pub(crate) fn compiled(&self) -> usize {
        self.compiled
    }

    pub(crate) fn group_layout(
        &mut self,
        gpu: &Gpu,
        entries: Vec<wgpu::BindGroupLayoutEntry>,
    ) -> Result<(LayoutId, wgpu::BindGroupLayout), String> {
        if let Some(known) = self.group_layouts.get(&entries) {
            return Ok(known.clone());
        }
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries };
        let layout = gpu.scoped(|| gpu.device().create_bind_group_layout(&descriptor))?;
        let made = (self.group_layouts.len(), layout);
        self.group_layouts.insert(entries, made.clone());
        Ok(made)
    }

    pub(crate) fn pipeline_layout(
        &mut self,
        gpu: &Gpu,
        key: &LayoutKey,
        groups: &[Option<&wgpu::BindGroupLayout>],
    ) -> Result<wgpu::PipelineLayout, String> {
        if let Some(known) = self.layouts.get(key) {
            return Ok(known.clone());
        }
        let descriptor = wgpu::PipelineLayoutDescriptor { label: None, bind_group_layouts: groups, immediate_size: 0 };
        let layout = gpu.scoped(|| gpu.device().create_pipeline_layout(&descriptor))?;
        self.layouts.insert(key.clone(), layout.clone());
        Ok(layout)
    }

    fn module(&mut self, gpu: &Gpu, shader: &Shader) -> Result<wgpu::ShaderModule, Refused> {
        if let Some(known) = self.modules.get_mut(&shader.hash) {
            known.build = self.build;
            return Ok(known.value.clone());
        }
        validate(gpu, &shader.module).map_err(Refused::Module)?;
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(&shader.source.name),
            source: wgpu::ShaderSource::Naga(std::borrow::Cow::Owned(shader.module.clone())),
        };
        let made = gpu.scoped(|| gpu.device().create_shader_module(descriptor));
        let module = made.map_err(Refused::Module)?;
        let used = Used { value: module.clone(), build: self.build };
        self.modules.insert(shader.hash, used);
        Ok(module)
    }

    pub(crate) fn compute(
        &mut self,
        gpu: &Gpu,
        shader: &Shader,
        layout: &wgpu::PipelineLayout,
        key: ComputeKey,
    ) -> Result<wgpu::ComputePipeline, Refused> {
        if let Some(known) = self.compute.get_mut(&key) {
            known.build = self.build;
            self.reused += 1;
            return Ok(known.value.clone());
        }
        let module = self.module(gpu, shader)?;
        let constants = key.constants.slice();
        let descriptor = wgpu::ComputePipelineDescriptor {
            label: Some(&key.entry),
            layout: Some(layout),
            module: &module,
            entry_point: Some(&key.entry),
            compilation_options: options(&constants),
            cache: None,
        };
        let made = gpu.scoped(|| gpu.device().create_compute_pipeline(&descriptor));
        let value = made.map_err(Refused::Pipeline)?;
        self.compiled += 1;
        let used = Used { value: value.clone(), build: self.build };
        self.compute.insert(key, used);
        Ok(value)
    }

    pub(crate) fn render(
        &mut self,
        gpu: &Gpu,
        shader: &Shader,
        layout: &wgpu::PipelineLayout,
        key: RenderKey,
    ) -> Result<wgpu::RenderPipeline, Refused> {
        if let Some(known) = self.render.get_mut(&key) {
            known.build = self.build;
            self.reused += 1;
            return Ok(known.value.clone());
        }
        let module = self.module(gpu, shader)?;
        let constants = key.constants.slice();
        let targets: Vec<_> = key.targets.iter().map(|&format| format.map(wgpu::ColorTargetState::from)).collect();
        let descriptor = wgpu::RenderPipelineDescriptor {
            label: Some(&key.fragment),
            layout: Some(layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(&key.vertex),
                compilation_options: options(&constants),
                buffers: &[],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: key.depth.then(reverse_z),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(&key.fragment),
                compilation_options: options(&constants),
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        };
        let made = gpu.scoped(|| gpu.device().create_render_pipeline(&descriptor));
        let value = made.map_err(Refused::Pipeline)?;
        self.compiled += 1;
        let used = Used { value: value.clone(), build: self.build };
        self.render.insert(key, used);
        Ok(value)
    }
}

fn options<'a>(constants: &'a [(&'a str, f64)]) -> wgpu::PipelineCompilationOptions<'a> {
    wgpu::PipelineCompilationOptions { constants, ..Default::default() }
}

/// Nearer is greater; the attachment is cleared to 0.
fn reverse_z() -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format: wgpu::TextureFormat::Depth32Float,
        depth_write_enabled: Some(true),
        depth_compare: Some(wgpu::CompareFunction::Greater),
        stencil: wgpu::StencilState::default(),
        bias: wgpu::DepthBiasState::default(),
    }
}

/// Validates a composed module with the device's abilities. wgpu would do it as well, but its message wants the source
/// text, which a composed module has not.
fn validate(gpu: &Gpu, module: &naga::Module) -> Result<(), String> {
    let flags = gpu.adapter().get_downlevel_capabilities().flags;
    let able = wgpu_naga_bridge::features_to_naga_capabilities(gpu.features(), flags);
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), able);
    validator.subgroup_stages(naga::valid::ShaderStages::all()).subgroup_operations(naga::valid::SubgroupOperationSet::all());
    match validator.validate(module) {
        Ok(_) => Ok(()),
        Err(error) => {
            let mut text = error.as_inner().to_string();
            let mut cause = std::error::Error::source(error.as_inner());
            while let Some(deeper) = cause {
                text += &format!(": {deeper}");
                cause = deeper.source();
            }
            Err(text)
        }
    }
}
