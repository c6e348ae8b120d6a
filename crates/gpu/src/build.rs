//! From a plan to a frame: pipelines, memory and bind groups, all under error scopes, beside the frame that runs.

use std::str::FromStr;

use manylight_graph::{
    diagnostics::Span,
    plan::{Lifetime, Plan, PlanNode, PlanStep, Target},
    value::ResourceDesc,
};

use crate::{
    bind::{Finder, Own, placeholders},
    device::Gpu,
    error::{BuildError, Fault},
    externals::Externals,
    frame::{Bindings, Frame, Node, Pass, check_external, entry_of},
    host::HostNodes,
    limits::check_node,
    numbers::Numbers,
    params,
    pipeline_cache::LayoutKey,
    poison::{Poison, fills},
    pool,
    skip::Skipper,
    steps::{Prepared, pass, prepare},
    timing::Timer,
    uses::{host, host_bytes, host_outputs, is_output, usages, used_externals},
};

/// Switches of a build.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BuildOptions {
    /// Fill transient and kept resources with NaN before their first use (`Debug::poison`).
    pub poison: bool,
    /// Look at every number that a node writes, right after it (`Debug::watch_numbers`).
    pub watch_numbers: bool,
    /// Skip nodes whose inputs are as they were when they ran last. For plans made with `PlanInput::keep_unchanged`; else it does nothing.
    pub skip_unchanged: bool,
    /// Measure GPU times where the device can.
    pub timestamps: bool,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self { poison: false, watch_numbers: false, skip_unchanged: false, timestamps: true }
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

impl Frame {
    /// Binds a plan to the device. What the previous frame has and this one needs as well is taken over: pipelines, memory of
    /// equal shape, histories of equal name and description (of a buffer with another count, what
    /// has room), and the state of host nodes. The previous frame is not touched:
    /// when the build fails it goes on as before; when it succeeds, drop it.
    pub fn build(
        gpu: &Gpu,
        plan: &Plan,
        externals: &Externals,
        hosts: &HostNodes,
        previous: Option<&Frame>,
        options: BuildOptions,
    ) -> Result<(Frame, BuildReport), BuildError> {
        if let Some(reason) = gpu.lost() {
            return Err(Fault::Lost { reason }.into());
        }
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
            numbers: None,
            skipper: Skipper::new(plan, options.skip_unchanged),
            timer: Timer::new(gpu, std::iter::empty(), false),
            serial: previous.is_some_and(|f| f.serial),
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
        if options.watch_numbers {
            frame.numbers = Some(Numbers::new(gpu, plan, &frame.resources)?);
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
        let mut made: Vec<(Bound, [crate::bind::Groups; 2])> = Vec::new();
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
type Bound = (LayoutKey, String, Option<(String, u32)>);

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
