//! A plan bound to a device. Running it records and submits one command buffer; it knows no pass by name.

use std::{collections::BTreeMap, time::Instant};

use manylight_graph::{
    plan::{Plan, PlanNode, PlanStep, ResourceIx, Target},
    shader::Shader,
    value::ResourceDesc,
};

use crate::{
    bind::{Finder, Groups, Own, StepLayout},
    device::Gpu,
    error::{Fault, ReadError, RunError},
    externals::{Externals, write_padded},
    format::describe,
    host::{HostBytes, HostContext, HostData, SharedHost},
    numbers::{BadNumbers, Numbers},
    poison::{Fill, Poison},
    pool::{Memory, Place, Resource, copy},
    record::{compute, draw},
    skip::{Decision, Skipper},
    steps::dispatch_size,
    timing::{FrameTimings, Timer},
};

const FRAME_ENCODER: wgpu::CommandEncoderDescriptor<'static> = wgpu::CommandEncoderDescriptor { label: Some("frame") };

/// A plan bound to a device: pipelines, bind groups, memory and timers.
pub struct Frame {
    pub(crate) plan: Plan,
    pub(crate) resources: Vec<Resource>,
    pub(crate) nodes: Vec<Node>,
    pub(crate) externals: Vec<UsedExternal>,
    pub(crate) host_bytes: BTreeMap<ResourceIx, HostBytes>,
    pub(crate) poison: Option<Poison>,
    pub(crate) numbers: Option<Numbers>,
    pub(crate) skipper: Skipper,
    pub(crate) timer: Timer,
    /// Submit and wait node by node.
    pub(crate) serial: bool,
    /// Frames run so far; its lowest bit chooses the copy of each history.
    pub(crate) index: u64,
}

/// What a node of the plan became.
pub(crate) struct Node {
    pub(crate) own: Own,
    pub(crate) passes: Vec<Pass>,
    pub(crate) host: Option<Host>,
    /// Resources that this node is the first to touch.
    pub(crate) poisons: Vec<Fill>,
}

pub(crate) enum Pass {
    Compute(Vec<Dispatch>),
    Draw(Box<Draw>),
}

/// Bind groups of a step for frames of even and odd index.
pub(crate) struct Bindings {
    pub(crate) layout: StepLayout,
    pub(crate) mip: Option<(String, u32)>,
    pub(crate) groups: [Groups; 2],
}

pub(crate) struct Dispatch {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) bindings: Bindings,
    pub(crate) groups: DispatchSize,
}

/// How many workgroups a dispatch has.
pub(crate) enum DispatchSize {
    Fixed([u32; 3]),
    /// What lies at the start of a buffer, of frames of even and odd index.
    Indirect(Target, [wgpu::Buffer; 2]),
}

pub(crate) struct Draw {
    pub(crate) pipeline: wgpu::RenderPipeline,
    pub(crate) bindings: Bindings,
    pub(crate) vertices: u32,
    pub(crate) instances: u32,
    /// Views for frames of even and odd index, and whether the target is cleared; none where nothing is drawn to.
    pub(crate) targets: Vec<Option<([wgpu::TextureView; 2], bool)>>,
    pub(crate) depth: Option<([wgpu::TextureView; 2], bool)>,
}

pub(crate) struct Host {
    pub(crate) node: SharedHost,
    pub(crate) outputs: Vec<ResourceIx>,
    /// Names of externals it reads.
    pub(crate) externals: Vec<String>,
    /// Outputs of other host nodes it reads.
    pub(crate) inputs: Vec<ResourceIx>,
    /// What it depended on when it last ran.
    pub(crate) ran_with: Option<u64>,
}

/// An external as the bind groups know it.
pub(crate) struct UsedExternal {
    pub(crate) resource: ResourceIx,
    pub(crate) bound: Memory,
}

impl std::fmt::Debug for Frame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Frame").field("nodes", &self.nodes.len()).field("index", &self.index).finish_non_exhaustive()
    }
}

impl Frame {
    /// The plan it was built from.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// Frames run so far, counted from the first that was built with this history.
    pub fn index(&self) -> u64 {
        self.index
    }

    /// Memory of a resource of the plan, as the latest frame left it. `None` for externals and for names that the plan does
    /// not use. A transient's memory may hold another resource by then: name it in `PlanInput::keep` to read it.
    pub fn memory(&self, name: &str) -> Option<&Memory> {
        let ix = self.plan.resource(name)?;
        self.resources[ix].memory(self.latest_parity())
    }

    /// The picture to show (display-referred).
    pub fn presented(&self) -> Option<&wgpu::Texture> {
        self.resources.get(self.plan.presents)?.memory(self.latest_parity())?.texture()
    }

    /// Linear radiance before tone mapping, when the pipeline names it.
    pub fn radiance(&self) -> Option<&wgpu::Texture> {
        self.resources.get(self.plan.radiance?)?.memory(self.latest_parity())?.texture()
    }

    /// Times of the newest frame whose timestamps have arrived; `None` until there is one. Never waits.
    pub fn timings(&self) -> Option<&FrameTimings> {
        self.timer.latest()
    }

    /// Waits for the frames under way and returns the times of the newest.
    pub fn wait_timings(&mut self, gpu: &Gpu) -> Option<&FrameTimings> {
        gpu.wait();
        self.timer.collect();
        self.timer.latest()
    }

    /// What became of a node of the plan in the latest frame.
    pub fn decision(&self, node: usize) -> Decision {
        self.skipper.decision(node)
    }

    /// What a node of the plan reads that had changed in the latest frame since the node ran before. Of nodes on the host, none is known.
    pub fn changed_inputs(&self, node: usize) -> impl Iterator<Item = Target> + '_ {
        self.skipper.changed(node)
    }

    /// Numbers of the latest frame that are NaN, infinite or beyond what a port promises, in the order of execution. None where
    /// [`BuildOptions::watch_numbers`](crate::BuildOptions::watch_numbers) is off. Waits for the GPU.
    ///
    /// # Errors
    /// The device is lost.
    pub fn bad_numbers(&self, gpu: &Gpu) -> Result<Vec<BadNumbers>, ReadError> {
        self.numbers.as_ref().map_or(Ok(Vec::new()), |numbers| numbers.found(gpu, &self.plan))
    }

    /// Runs the host nodes whose inputs changed, records the frame and submits it. Never waits for the GPU.
    pub fn record_and_submit(&mut self, gpu: &Gpu, externals: &Externals, data: HostData<'_>) -> Result<(), RunError> {
        if let Some(reason) = gpu.lost() {
            return Err(RunError::Lost(reason));
        }
        let _span = tracing::info_span!("frame", index = self.index).entered();
        let errors_before = gpu.error_count();
        let start = Instant::now();
        self.follow_externals(gpu, externals)?;
        self.run_hosts(gpu, externals, data)?;
        self.skip_unchanged(externals);
        if self.serial {
            self.submit_serially(gpu);
        } else {
            self.timer.begin();
            let mut encoder = gpu.device().create_command_encoder(&FRAME_ENCODER);
            self.encode(&mut encoder, self.parity());
            self.timer.resolve(&mut encoder);
            gpu.queue().submit([encoder.finish()]);
            self.timer.submitted(self.index, nanoseconds(start));
        }
        self.index += 1;
        if gpu.error_count() != errors_before {
            return Err(RunError::Gpu(gpu.take_errors().join("; ")));
        }
        Ok(())
    }

    /// Decides which nodes run in this frame.
    fn skip_unchanged(&mut self, externals: &Externals) {
        let parity = self.parity();
        let host_bytes = &self.host_bytes;
        let stamp_of_host = |ix| host_bytes.get(&ix).map_or(0, |bytes| bytes.stamp);
        self.skipper.decide(parity, |name| externals.stamp(name), stamp_of_host);
        for ix in 0..self.nodes.len() {
            self.timer.decided(ix, self.skipper.decision(ix));
        }
    }

    /// Whether each node is submitted on its own and waited for, so that its GPU time is the wall-clock time of that.
    ///
    /// For measuring on adapters whose timestamps are not tied to the work around them: software Vulkan rasterizes
    /// and answers timestamps in threads of its own, so that the time of a node shows up at another. Slower than a
    /// usual frame by a submission and a wait a node; the picture is the same.
    pub fn measure_serially(&mut self, on: bool) {
        self.serial = on;
    }

    fn submit_serially(&mut self, gpu: &Gpu) {
        let parity = self.parity();
        let (mut cpu_ns, mut gpu_ns) = (0, 0);
        gpu.wait();
        if let Some(numbers) = &self.numbers {
            let mut encoder = gpu.device().create_command_encoder(&FRAME_ENCODER);
            numbers.begin(&mut encoder);
            gpu.queue().submit([encoder.finish()]);
        }
        for ix in 0..self.nodes.len() {
            let runs = self.skipper.runs(ix);
            if !runs && !self.nodes[ix].passes.is_empty() {
                self.timer.set_serial(ix, 0);
            }
            if !self.has_gpu_work(ix) {
                continue;
            }
            let start = Instant::now();
            let mut encoder = gpu.device().create_command_encoder(&FRAME_ENCODER);
            self.encode_node(&mut encoder, ix, parity);
            let commands = encoder.finish();
            cpu_ns += nanoseconds(start);
            let start = Instant::now();
            gpu.queue().submit([commands]);
            gpu.wait();
            let took = nanoseconds(start);
            gpu_ns += took;
            if runs {
                self.timer.set_serial(ix, took);
            }
        }
        self.timer.ran_serially(self.index, cpu_ns, gpu_ns);
    }

    pub(crate) fn parity(&self) -> usize {
        (self.index & 1) as usize
    }

    fn latest_parity(&self) -> usize {
        (self.index.wrapping_sub(1) & 1) as usize
    }

    /// Lets every node run in the next frame, as in the first.
    pub fn forget(&mut self) {
        self.skipper.forget();
    }

    /// Whether a node has passes to run in this frame, wrote on the host what is looked at on the GPU, or left a history to be copied.
    fn has_gpu_work(&self, ix: usize) -> bool {
        let is_looked_at = || self.numbers.as_ref().is_some_and(|numbers| numbers.looks_at(ix));
        let works = !self.nodes[ix].passes.is_empty() || is_looked_at();
        (self.skipper.runs(ix) && works) || !self.skipper.copies(ix).is_empty()
    }

    /// Records all nodes.
    pub(crate) fn encode(&mut self, encoder: &mut wgpu::CommandEncoder, parity: usize) {
        if let Some(numbers) = &self.numbers {
            numbers.begin(encoder);
        }
        for ix in 0..self.nodes.len() {
            self.encode_node(encoder, ix, parity);
        }
    }

    fn encode_node(&mut self, encoder: &mut wgpu::CommandEncoder, ix: usize, parity: usize) {
        let Self { plan, nodes, timer, poison, numbers, skipper, resources, .. } = self;
        let (node, planned) = (&nodes[ix], &plan.nodes[ix]);
        for &history in skipper.copies(ix) {
            if let (Some(from), Some(to)) = (resources[history].memory(1 - parity), resources[history].memory(parity)) {
                copy(encoder, from, to);
            }
        }
        if !skipper.runs(ix) {
            return;
        }
        if !node.passes.is_empty() {
            let start = Instant::now();
            encode_passes(encoder, node, planned, poison.as_ref(), timer.span(ix), parity);
            timer.set_cpu(ix, nanoseconds(start));
        }
        if let Some(numbers) = numbers
            && numbers.looks_at(ix)
        {
            numbers.scan(encoder, ix, parity);
        }
    }

    /// Binds externals whose memory was replaced since the bind groups were made.
    fn follow_externals(&mut self, gpu: &Gpu, externals: &Externals) -> Result<(), Fault> {
        let mut moved = Vec::new();
        for used in &self.externals {
            let planned = &self.plan.resources[used.resource];
            let Some(memory) = externals.memory(&planned.name) else {
                return Err(Fault::MissingExternal { name: planned.name.clone() });
            };
            if *memory != used.bound {
                check_external(externals, &planned.name, &planned.desc)?;
                moved.push(used.resource);
            }
        }
        if moved.is_empty() {
            return Ok(());
        }
        let finder = Finder { gpu, resources: &self.resources, externals };
        for (node, planned) in self.nodes.iter_mut().zip(&self.plan.nodes) {
            let reads = |target: &Target| matches!(target, Target::Resource(ix) if moved.contains(ix));
            if let Some(shader) = &planned.decl.shader
                && planned.bindings.iter().any(|(_, target)| reads(target))
            {
                rebind(node, planned, shader, finder).map_err(|(entry, message)| Fault::Binding {
                    node: planned.id.clone(),
                    entry,
                    message,
                })?;
            }
        }
        for used in &mut self.externals {
            if let Some(memory) = externals.memory(&self.plan.resources[used.resource].name) {
                used.bound = memory.clone();
            }
        }
        Ok(())
    }

    fn run_hosts(&mut self, gpu: &Gpu, externals: &Externals, data: HostData<'_>) -> Result<(), RunError> {
        let parity = self.parity();
        let Self { plan, nodes, timer, host_bytes, resources, index, .. } = self;
        for (ix, (node, planned)) in nodes.iter_mut().zip(&plan.nodes).enumerate() {
            let Some(host) = &mut node.host else { continue };
            let start = Instant::now();
            let _span = tracing::info_span!("node", node = planned.id.as_str(), stage = planned.stage.as_str()).entered();
            let mut running = host.node.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let stamp = dependencies(host, externals, host_bytes, data);
            let due = host.ran_with != Some(stamp) || running.every_frame();
            if due {
                let mut ctx = HostContext { node: planned, data, frame: *index, stamp, buffers: host_bytes };
                host.ran_with = None;
                running.run(&mut ctx).map_err(|source| RunError::Host { node: planned.id.clone(), source })?;
                host.ran_with = Some(stamp);
            }
            for output in &host.outputs {
                let Some(bytes) = host_bytes.get_mut(output) else {
                    continue;
                };
                bytes.stamp += u64::from(due);
                // The copies of a history must both follow.
                let swaps = matches!(resources[*output].place, Place::History(_));
                if let Some(Memory::Buffer(buffer)) = resources[*output].memory(parity)
                    && (due || swaps)
                {
                    write_padded(gpu, buffer, &bytes.bytes);
                }
            }
            timer.set_cpu(ix, nanoseconds(start));
        }
        Ok(())
    }
}

/// Records the passes of a node, timed by two queries where there are any.
fn encode_passes(
    encoder: &mut wgpu::CommandEncoder,
    node: &Node,
    planned: &PlanNode,
    poison: Option<&Poison>,
    span: Option<(&wgpu::QuerySet, u32, u32)>,
    parity: usize,
) {
    let id = planned.id.as_str();
    let _span = tracing::info_span!("node", node = id, stage = planned.stage.as_str()).entered();
    if let Some(poison) = poison {
        for fill in &node.poisons {
            poison.fill(encoder, fill);
        }
    }
    let last = node.passes.len() - 1;
    for (i, pass) in node.passes.iter().enumerate() {
        let stamps = span.filter(|_| i == 0 || i == last);
        let stamps = stamps.map(|(set, begin, end)| (set, (i == 0).then_some(begin), (i == last).then_some(end)));
        match pass {
            Pass::Compute(steps) => compute(encoder, id, steps, parity, stamps),
            Pass::Draw(step) => draw(encoder, id, step, parity, stamps),
        }
    }
}

/// Whether an external still is what the plan was made for; only the number of elements of a buffer may differ.
pub(crate) fn check_external(externals: &Externals, name: &str, planned: &ResourceDesc) -> Result<(), Fault> {
    let Some(now) = externals.desc(name) else {
        return Err(Fault::MissingExternal { name: name.to_owned() });
    };
    let same = match (now, planned) {
        (ResourceDesc::Buffer { element: a, stride: x, .. }, ResourceDesc::Buffer { element: b, stride: y, .. }) => a == b && x == y,
        (ResourceDesc::Texture { format: f, array: a, .. }, ResourceDesc::Texture { format: g, array: b, .. }) => f == g && a == b,
        (a, b) => a == b,
    };
    if same {
        return Ok(());
    }
    Err(Fault::WrongExternal { name: name.to_owned(), expected: describe(planned), actual: describe(now) })
}

/// Makes the bind groups of a node anew. An error names the entry point.
fn rebind(node: &mut Node, planned: &PlanNode, shader: &Shader, finder: Finder<'_>) -> Result<(), (String, String)> {
    let mut steps = planned.steps.iter();
    let Node { own, passes, .. } = node;
    let all = passes.iter_mut().flat_map(|pass| -> Vec<(&mut Bindings, Option<&mut DispatchSize>)> {
        match pass {
            Pass::Compute(steps) => steps.iter_mut().map(|s| (&mut s.bindings, Some(&mut s.groups))).collect(),
            Pass::Draw(step) => vec![(&mut step.bindings, None)],
        }
    });
    for (bindings, size) in all {
        let mip = bindings.mip.as_ref().map(|(port, level)| (port.as_str(), *level));
        let entry = entry_of(steps.next());
        let groups = |parity| finder.groups(planned, shader, own, &bindings.layout, mip, parity);
        let made = groups(0).and_then(|even| Ok([even, groups(1)?]));
        bindings.groups = made.map_err(|message| (entry.clone(), message))?;
        if let Some(size) = size
            && let DispatchSize::Indirect(target, _) = *size
        {
            *size = dispatch_size(finder, target).map_err(|message| (entry, message))?;
        }
    }
    Ok(())
}

pub(crate) fn entry_of(step: Option<&PlanStep>) -> String {
    match step {
        Some(PlanStep::Compute { entry, .. }) => entry.clone(),
        Some(PlanStep::Draw { vertex, fragment, .. }) => format!("{vertex} + {fragment}"),
        None => String::new(),
    }
}

/// A number that changes whenever something that a host node depends on changes.
fn dependencies(host: &Host, externals: &Externals, bytes: &BTreeMap<ResourceIx, HostBytes>, data: HostData<'_>) -> u64 {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut hasher = DefaultHasher::new();
    (data.scene.is_some(), data.stamp).hash(&mut hasher);
    for name in &host.externals {
        externals.stamp(name).hash(&mut hasher);
    }
    for input in &host.inputs {
        bytes.get(input).map(|b| b.stamp).hash(&mut hasher);
    }
    hasher.finish()
}

fn nanoseconds(since: Instant) -> u64 {
    u64::try_from(since.elapsed().as_nanos()).unwrap_or(u64::MAX)
}
