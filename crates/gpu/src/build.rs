//! From a plan to a frame: pipelines, memory and bind groups, all under error scopes, beside the frame that runs.

use std::{collections::BTreeMap, str::FromStr, sync::Arc};

use manylight_graph::{
    diagnostics::Span,
    plan::{Lifetime, Plan, PlanNode, PlanStep, ResourceIx, Target, Usage},
    registry::Direction,
    shader::{GlobalKind, Shader},
    value::{Format, ResourceDesc},
};

use crate::{
    bind::{Finder, Groups, Own, StepLayout, placeholders, step_layout, view},
    device::Gpu,
    error::{BuildError, Fault},
    externals::Externals,
    format::{byte_size, texture_format},
    frame::{Bindings, Dispatch, Draw, Frame, Host, MOST_TARGETS, Node, Pass, UsedExternal, check_external, entry_of},
    host::{HostBytes, HostNodes},
    limits::check_node,
    params,
    pipeline_cache::{ComputeKey, Constants, PipelineCache, Refused, RenderKey},
    poison::{Poison, fills},
    pool::{self, Memory},
    timing::Timer,
};

/// Switches of a build.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildOptions {
    /// Fill transient and kept resources with NaN before their first use (`Debug::poison`).
    pub poison: bool,
    /// Measure GPU times where the device can.
    pub timestamps: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { poison: false, timestamps: true }
    }
}

/// What a build did.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BuildReport {
    /// Nodes whose pipelines were all there already, by id.
    pub kept: Vec<String>,
    /// Nodes for which a pipeline was compiled, or that are new, by id.
    pub rebuilt: Vec<String>,
    /// Histories that start from zero.
    pub reset: Vec<String>,
    /// Histories taken over from the frame before.
    pub history_kept: Vec<String>,
    /// Pipelines compiled.
    pub compiled: usize,
    /// Pipelines found in the cache.
    pub reused: usize,
}

struct Builder<'a> {
    gpu: &'a Gpu,
    plan: &'a Plan,
    faults: Vec<(Fault, Option<Span>)>,
}

impl Builder<'_> {
    fn fault(&mut self, node: Option<&PlanNode>, fault: Fault) {
        self.faults.push((fault, node.map(|n| n.decl.span.clone())));
    }

    fn done<T>(&mut self, value: T) -> Result<T, BuildError> {
        if self.faults.is_empty() { Ok(value) } else { Err(BuildError { faults: std::mem::take(&mut self.faults) }) }
    }
}

/// A step's pipeline with its layout, before memory is known.
struct Prepared {
    layout: StepLayout,
    pipeline: Pipeline,
}

enum Pipeline {
    Compute(wgpu::ComputePipeline),
    Render(wgpu::RenderPipeline),
}

impl Frame {
    /// Binds a plan to the device. What the previous frame has and this one needs as well is taken over: pipelines, memory of
    /// equal shape, histories of equal name and description, and the state of host nodes. The previous frame is not touched:
    /// when the build fails it goes on as before; when it succeeds, drop it.
    pub fn build(
        gpu: &Gpu,
        plan: &Plan,
        externals: &Externals,
        hosts: &HostNodes,
        previous: Option<&Frame>,
        options: BuildOptions,
    ) -> Result<(Frame, BuildReport), BuildError> {
        let mut b = Builder { gpu, plan, faults: Vec::new() };
        let mut report = BuildReport::default();
        b.check(externals, hosts);
        b.done(())?;
        let prepared = b.pipelines(previous, &mut report);
        let prepared = b.done(prepared)?;
        let host_outputs = host_outputs(plan);
        let usage = usages(plan);
        let old = previous.map(|f| f.resources.as_slice());
        let allocated = pool::allocate(gpu, plan, &usage, &host_outputs, old)
            .map_err(|faults| BuildError { faults: faults.into_iter().map(|f| (f, None)).collect() })?;
        (report.history_kept, report.reset) = (allocated.history_kept, allocated.history_reset);
        let mut frame = Frame {
            plan: plan.clone(),
            resources: allocated.resources,
            nodes: Vec::new(),
            externals: used_externals(plan, externals),
            host_bytes: host_bytes(plan, &host_outputs),
            poison: None,
            timer: Timer::new(gpu, std::iter::empty(), false),
            index: previous.map_or(0, |f| f.index),
        };
        for (node, prepared) in plan.nodes.iter().zip(prepared) {
            match b.node(&frame, externals, hosts, previous, node, prepared) {
                Ok(built) => frame.nodes.push(built),
                Err(fault) => b.fault(Some(node), fault),
            }
        }
        b.done(())?;
        if options.poison {
            frame.add_poison(gpu)?;
        }
        frame.rehearse(gpu)?;
        let names = plan.nodes.iter().zip(&frame.nodes);
        let names = names.map(|(p, n)| (p.id.clone(), p.stage.clone(), !n.passes.is_empty()));
        frame.timer = gpu.scoped(|| Timer::new(gpu, names, options.timestamps)).map_err(|message| Fault::Recording { message })?;
        Ok((frame, report))
    }

    fn add_poison(&mut self, gpu: &Gpu) -> Result<(), Fault> {
        let poison = Poison::new(gpu, &self.resources);
        self.poison = poison.map_err(|message| Fault::Resource { resource: "poison".to_owned(), message })?;
        let mut seen = vec![false; self.resources.len()];
        for (node, planned) in self.nodes.iter_mut().zip(&self.plan.nodes) {
            for (_, target) in &planned.bindings {
                if let Target::Resource(ix) = *target
                    && !std::mem::replace(&mut seen[ix], true)
                    && self.resources[ix].can_be_poisoned()
                {
                    node.poisons.extend(fills(&self.resources[ix]));
                }
            }
        }
        Ok(())
    }

    /// Records both parities without submitting, so that what wgpu finds only then is found now.
    fn rehearse(&mut self, gpu: &Gpu) -> Result<(), Fault> {
        for parity in [0, 1] {
            let recorded = gpu.scoped(|| {
                let mut encoder = gpu.device().create_command_encoder(&Default::default());
                self.encode(&mut encoder, parity);
                drop(encoder.finish());
            });
            recorded.map_err(|message| Fault::Recording { message })?;
        }
        Ok(())
    }
}

impl Builder<'_> {
    /// Everything that can be known before anything is made.
    fn check(&mut self, externals: &Externals, hosts: &HostNodes) {
        for r in &self.plan.resources {
            if r.lifetime == Lifetime::External
                && let Err(fault) = check_external(externals, &r.name, &r.desc)
            {
                self.faults.push((fault, None));
            }
        }
        for node in &self.plan.nodes {
            for feature in &node.decl.requires {
                if let Some(fault) = missing(self.gpu, node, feature) {
                    self.fault(Some(node), fault);
                }
            }
            if let Err(fault) = check_node(self.gpu, self.plan, node) {
                self.fault(Some(node), Fault::Limit(fault));
            }
            if node.decl.shader.is_none() {
                self.check_host(hosts, node);
            }
        }
    }

    fn check_host(&mut self, hosts: &HostNodes, node: &PlanNode) {
        let kind = node.decl.name.clone();
        if hosts.find(&kind).is_none() {
            let id = node.id.clone();
            self.fault(Some(node), Fault::UnknownHost { node: id, kind });
        }
        let made_by_hosts = host_outputs(self.plan);
        for (port, target) in &node.bindings {
            let (Target::Resource(ix) | Target::Previous(ix)) = *target else {
                continue;
            };
            let r = &self.plan.resources[ix];
            let is_output = is_output(node, port);
            let message = if is_output && !matches!(r.desc, ResourceDesc::Buffer { .. }) {
                "a node written in Rust can only write buffers"
            } else if !is_output && r.lifetime != Lifetime::External && !made_by_hosts[ix] {
                "a node written in Rust can only read externals and what other such nodes write: the rest is on the GPU"
            } else {
                continue;
            };
            let fault = Fault::HostPort { node: node.id.clone(), port: port.clone(), message: message.to_owned() };
            self.fault(Some(node), fault);
        }
    }

    fn pipelines(&mut self, previous: Option<&Frame>, report: &mut BuildReport) -> Vec<Vec<Prepared>> {
        let gpu = self.gpu;
        let mut cache = gpu.cache();
        cache.begin();
        let mut all = Vec::new();
        for node in &self.plan.nodes {
            let before = cache.compiled();
            let mut prepared = Vec::new();
            for step in &node.steps {
                let Some(shader) = &node.decl.shader else {
                    break;
                };
                match prepare(gpu, &mut cache, self.plan, node, shader, step) {
                    Ok(step) => prepared.push(step),
                    Err(fault) => {
                        self.fault(Some(node), fault);
                        break;
                    }
                }
            }
            all.push(prepared);
            let was_there = previous.is_none_or(|f| f.plan.nodes.iter().any(|n| n.id == node.id));
            let list = if cache.compiled() == before && was_there { &mut report.kept } else { &mut report.rebuilt };
            list.push(node.id.clone());
        }
        (report.compiled, report.reused) = cache.finish();
        all
    }

    fn node(
        &self,
        frame: &Frame,
        externals: &Externals,
        hosts: &HostNodes,
        previous: Option<&Frame>,
        node: &PlanNode,
        prepared: Vec<Prepared>,
    ) -> Result<Node, Fault> {
        let mut built = Node { own: Own::default(), passes: Vec::new(), host: None, poisons: Vec::new() };
        let Some(shader) = &node.decl.shader else {
            built.host = host(self.plan, hosts, previous, node);
            return Ok(built);
        };
        let binding = |entry: String, message: String| Fault::Binding { node: node.id.clone(), entry, message };
        let own = self.gpu.scoped(|| params::uniform_bytes(node, shader).map(|bytes| params::uniform_buffer(self.gpu, &node.id, &bytes)));
        built.own.params = own.map_err(|e| binding("params".to_owned(), e))?;
        built.own.absent = placeholders(self.gpu, node, shader).map_err(|e| binding("placeholder".to_owned(), e))?;
        let finder = Finder { gpu: self.gpu, resources: &frame.resources, externals };
        let mut cleared = Vec::new();
        let mut made: Vec<(Bound, [Groups; 2])> = Vec::new();
        for (step, Prepared { layout, pipeline }) in node.steps.iter().zip(prepared) {
            let entry = || entry_of(Some(step));
            let mip = match step {
                PlanStep::Compute { mip, .. } => mip.clone(),
                PlanStep::Draw { .. } => None,
            };
            let key = (layout.key.clone(), entry(), mip.clone());
            let groups = match made.iter().find(|(known, _)| *known == key) {
                Some((_, groups)) => groups.clone(),
                None => {
                    let at = mip.as_ref().map(|(port, level)| (port.as_str(), *level));
                    let groups = |parity| finder.groups(node, shader, &built.own, &layout, at, parity);
                    let both = groups(0).and_then(|even| Ok([even, groups(1)?]));
                    let both = both.map_err(|e| binding(entry(), e))?;
                    made.push((key, both.clone()));
                    both
                }
            };
            let bindings = Bindings { layout, mip, groups };
            let pass = pass(finder, step, pipeline, bindings, &mut cleared).map_err(|e| binding(entry(), e))?;
            match (built.passes.last_mut(), pass) {
                (Some(Pass::Compute(steps)), Pass::Compute(more)) => steps.extend(more),
                (_, pass) => built.passes.push(pass),
            }
        }
        Ok(built)
    }
}

/// Steps with the same layout, entry points and mip level bind the same groups.
type Bound = (crate::pipeline_cache::LayoutKey, String, Option<(String, u32)>);

fn missing(gpu: &Gpu, node: &PlanNode, feature: &str) -> Option<Fault> {
    let known = wgpu::Features::from_name(feature).or_else(|| wgpu::Features::from_str(feature).ok());
    match known {
        None => Some(Fault::UnknownFeature { node: node.id.clone(), feature: feature.to_owned() }),
        Some(known) if !gpu.features().contains(known) => {
            Some(Fault::MissingFeature { node: node.id.clone(), feature: feature.to_owned(), adapter: gpu.adapter_info().name.clone() })
        }
        Some(_) => None,
    }
}

fn prepare(
    gpu: &Gpu,
    cache: &mut PipelineCache,
    plan: &Plan,
    node: &PlanNode,
    shader: &Arc<Shader>,
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

fn color_formats(gpu: &Gpu, plan: &Plan, targets: &[ResourceIx]) -> Result<Vec<wgpu::TextureFormat>, String> {
    if targets.len() > MOST_TARGETS {
        return Err(format!("it has more than {MOST_TARGETS} colour targets"));
    }
    let format_of = |ix: &ResourceIx| {
        let resource = &plan.resources[*ix];
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
    targets.iter().map(format_of).collect()
}

/// A pass of one step; `cleared` tells which targets an earlier draw of the node has already cleared.
fn pass(
    finder: Finder<'_>,
    step: &PlanStep,
    pipeline: Pipeline,
    bindings: Bindings,
    cleared: &mut Vec<ResourceIx>,
) -> Result<Pass, String> {
    match (step, pipeline) {
        (PlanStep::Compute { groups, .. }, Pipeline::Compute(pipeline)) => {
            Ok(Pass::Compute(vec![Dispatch { pipeline, bindings, groups: *groups }]))
        }
        (PlanStep::Draw { vertices, targets, depth, .. }, Pipeline::Render(pipeline)) => {
            let mut attach = |ix: ResourceIx| {
                let of = |parity| match finder.memory(Target::Resource(ix), parity)? {
                    Memory::Texture(texture) => Ok(view(texture, false, Some(0))),
                    Memory::Buffer(_) => Err("a buffer is no render target".to_owned()),
                };
                let clear = !cleared.contains(&ix);
                cleared.push(ix);
                Ok::<_, String>(([of(0)?, of(1)?], clear))
            };
            let targets = targets.iter().map(|ix| attach(*ix));
            let targets = targets.collect::<Result<_, _>>()?;
            let depth = depth.map(attach).transpose()?;
            Ok(Pass::Draw(Draw { pipeline, bindings, vertices: *vertices, targets, depth }))
        }
        _ => Err("the pipeline does not fit the step".to_owned()),
    }
}

fn is_output(node: &PlanNode, port: &str) -> bool {
    node.decl.ports.get(port).is_some_and(|p| p.direction == Direction::Output)
}

/// Which resources a host node writes.
fn host_outputs(plan: &Plan) -> Vec<bool> {
    let mut all = vec![false; plan.resources.len()];
    for node in plan.nodes.iter().filter(|n| n.decl.shader.is_none()) {
        for (port, target) in &node.bindings {
            if let Target::Resource(ix) = *target
                && is_output(node, port)
            {
                all[ix] = true;
            }
        }
    }
    all
}

fn host_bytes(plan: &Plan, host_outputs: &[bool]) -> BTreeMap<ResourceIx, HostBytes> {
    let mut all = BTreeMap::new();
    for (ix, r) in plan.resources.iter().enumerate() {
        if let ResourceDesc::Buffer { stride, count, .. } = r.desc
            && host_outputs[ix]
        {
            let bytes = (u64::from(stride) * count).min(byte_size(&r.desc)) as usize;
            all.insert(ix, HostBytes { bytes: vec![0; bytes], stride, stamp: 0 });
        }
    }
    all
}

fn host(plan: &Plan, hosts: &HostNodes, previous: Option<&Frame>, node: &PlanNode) -> Option<Host> {
    let kept = previous.and_then(|f| {
        let at = f.plan.nodes.iter().position(|n| n.id == node.id && n.decl.name == node.decl.name)?;
        Some(f.nodes[at].host.as_ref()?.node.clone())
    });
    let make = || {
        let kind = hosts.find(&node.decl.name)?;
        Some(Arc::new(std::sync::Mutex::new((kind.make)())))
    };
    let mut host = Host { node: kept.or_else(make)?, outputs: Vec::new(), externals: Vec::new(), inputs: Vec::new(), ran_with: None };
    for (port, target) in &node.bindings {
        match *target {
            Target::Resource(ix) if is_output(node, port) => host.outputs.push(ix),
            Target::Resource(ix) | Target::Previous(ix) => {
                let r = &plan.resources[ix];
                if r.lifetime == Lifetime::External {
                    host.externals.push(r.name.clone());
                } else {
                    host.inputs.push(ix);
                }
            }
            Target::Absent => {}
        }
    }
    Some(host)
}

fn used_externals(plan: &Plan, externals: &Externals) -> Vec<UsedExternal> {
    let of = |(resource, r): (usize, &manylight_graph::plan::PlanResource)| {
        let bound = externals.memory(&r.name)?.clone();
        (r.lifetime == Lifetime::External).then_some(UsedExternal { resource, bound })
    };
    plan.resources.iter().enumerate().filter_map(of).collect()
}

/// Usages over all nodes: what the plan says, and what the shaders declare.
fn usages(plan: &Plan) -> Vec<Usage> {
    let mut all: Vec<Usage> = plan.resources.iter().map(|r| r.usage).collect();
    for node in &plan.nodes {
        for step in &node.steps {
            if let PlanStep::Draw { targets, depth, .. } = step {
                for &ix in targets.iter().chain(depth) {
                    all[ix].target = true;
                }
            }
        }
        let Some(shader) = &node.decl.shader else {
            continue;
        };
        for global in &shader.globals {
            let port = node.bindings.iter().find(|(port, _)| *port == global.name);
            if let Some((_, Target::Resource(ix) | Target::Previous(ix))) = port
                && matches!(global.kind, GlobalKind::StorageTexture { .. })
            {
                all[*ix].storage = true;
            }
        }
    }
    all
}
