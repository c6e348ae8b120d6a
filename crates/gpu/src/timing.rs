//! Times of a frame's nodes: GPU timestamps read back some frames later through a ring of buffers, without ever waiting.

use std::sync::{
    Arc,
    atomic::{AtomicU8, Ordering},
};

use crate::{device::Gpu, skip::Decision};

/// Frames whose timestamps can be under way at once.
const RING: usize = 4;

/// Queries that a query set may have in WebGPU.
const MOST_QUERIES: u32 = 4096;

/// Times of a node in one frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NodeTiming {
    /// Id in the pipeline.
    pub id: String,
    /// Stage.
    pub stage: String,
    /// Time the CPU took to record it (or to run it, for a host node).
    pub cpu_ns: u64,
    /// Time the GPU took from the begin of its first pass to the end of its last; `None` when there is no sample.
    pub gpu_ns: Option<u64>,
    /// Whether it ran; if not, its times are zero and its outputs are those of an earlier frame.
    pub ran: bool,
    /// If it did not run, whether that is because it has settled ([`Decision::Settled`]).
    pub settled: bool,
}

impl NodeTiming {
    fn decided(&mut self, decision: Decision) {
        (self.ran, self.settled) = (decision.ran(), decision == Decision::Settled);
    }
}

/// Times of one frame.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct FrameTimings {
    /// Which frame, counted from the first that was built with this history.
    pub frame: u64,
    /// All nodes in order of execution.
    pub nodes: Vec<NodeTiming>,
    /// Time to record and submit the frame.
    pub cpu_ns: u64,
    /// Time from the begin of the first pass to the end of the last.
    pub gpu_ns: Option<u64>,
}

const FREE: u8 = 0;
const PENDING: u8 = 1;
const MAPPED: u8 = 2;
const FAILED: u8 = 3;

struct Slot {
    buffer: wgpu::Buffer,
    state: Arc<AtomicU8>,
    frame: u64,
    cpu_ns: u64,
    node_cpu_ns: Vec<u64>,
    decisions: Vec<Decision>,
}

struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    count: u32,
    /// Index of each node's first query; `None` for nodes without passes, since a query that is never written must not be resolved.
    first: Vec<Option<u32>>,
    ring: Vec<Slot>,
    /// Slot that the frame being recorded will use.
    chosen: Option<usize>,
    period_ns: f64,
}

/// Measures the nodes of one frame after the other.
pub(crate) struct Timer {
    queries: Option<Queries>,
    latest: FrameTimings,
    has_sample: bool,
    node_cpu_ns: Vec<u64>,
    decisions: Vec<Decision>,
}

impl Timer {
    /// For these nodes (id, stage, whether it has passes); without `gpu_times` only the CPU is measured.
    pub(crate) fn new(gpu: &Gpu, nodes: impl Iterator<Item = (String, String, bool)>, gpu_times: bool) -> Self {
        let mut first = Vec::new();
        let mut count = 0;
        let name = |(id, stage, has_passes)| {
            let fits = has_passes && count + 2 <= MOST_QUERIES;
            first.push(fits.then_some(count));
            count += if fits { 2 } else { 0 };
            NodeTiming { id, stage, cpu_ns: 0, gpu_ns: None, ran: true, settled: false }
        };
        let nodes: Vec<_> = nodes.map(name).collect();
        let wanted = gpu_times && gpu.has_timestamps() && count > 0;
        let queries = wanted.then(|| Queries::new(gpu, first, count));
        Self {
            queries,
            node_cpu_ns: vec![0; nodes.len()],
            decisions: vec![Decision::First; nodes.len()],
            latest: FrameTimings { nodes, ..Default::default() },
            has_sample: false,
        }
    }

    /// The newest frame whose times are known.
    pub(crate) fn latest(&self) -> Option<&FrameTimings> {
        self.has_sample.then_some(&self.latest)
    }

    /// The query set and the indices for begin and end of a node's passes.
    pub(crate) fn span(&self, node: usize) -> Option<(&wgpu::QuerySet, u32, u32)> {
        let queries = self.queries.as_ref()?;
        queries.chosen?;
        let begin = (*queries.first.get(node)?)?;
        Some((&queries.set, begin, begin + 1))
    }

    pub(crate) fn set_cpu(&mut self, node: usize, ns: u64) {
        if let Some(slot) = self.node_cpu_ns.get_mut(node) {
            *slot = ns;
        }
    }

    /// What becomes of a node in the frame being recorded; if it does not run, it costs nothing.
    pub(crate) fn decided(&mut self, node: usize, decision: Decision) {
        if let Some(slot) = self.decisions.get_mut(node) {
            *slot = decision;
        }
        if !decision.ran() {
            self.set_cpu(node, 0);
        }
    }

    /// Time of a node that was submitted and waited for on its own.
    pub(crate) fn set_serial(&mut self, node: usize, gpu_ns: u64) {
        if let Some(node) = self.latest.nodes.get_mut(node) {
            node.gpu_ns = Some(gpu_ns);
        }
    }

    /// After a frame whose nodes were waited for one after the other.
    pub(crate) fn ran_serially(&mut self, frame: u64, cpu_ns: u64, gpu_ns: u64) {
        (self.latest.frame, self.latest.cpu_ns, self.latest.gpu_ns) = (frame, cpu_ns, Some(gpu_ns));
        self.take_cpu_times();
        self.has_sample = true;
    }

    fn take_cpu_times(&mut self) {
        for (node, (ns, decision)) in self.latest.nodes.iter_mut().zip(self.node_cpu_ns.iter().zip(&self.decisions)) {
            node.cpu_ns = *ns;
            node.decided(*decision);
        }
    }

    /// Collects what has arrived and chooses a slot for the frame to be recorded.
    pub(crate) fn begin(&mut self) {
        self.collect();
        if let Some(queries) = &mut self.queries {
            let free = |s: &Slot| s.state.load(Ordering::Acquire) == FREE;
            queries.chosen = queries.ring.iter().position(free);
        }
    }

    /// Copies the frame's timestamps into its slot.
    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(queries) = &self.queries
            && let Some(chosen) = queries.chosen
        {
            let to = &queries.ring[chosen].buffer;
            encoder.resolve_query_set(&queries.set, 0..queries.count, &queries.resolved, 0);
            encoder.copy_buffer_to_buffer(&queries.resolved, 0, to, 0, to.size());
        }
    }

    /// After the frame was submitted: asks for its timestamps.
    pub(crate) fn submitted(&mut self, frame: u64, cpu_ns: u64) {
        match &mut self.queries {
            Some(queries) => {
                let Some(chosen) = queries.chosen.take() else {
                    return;
                };
                let slot = &mut queries.ring[chosen];
                (slot.frame, slot.cpu_ns) = (frame, cpu_ns);
                slot.node_cpu_ns.copy_from_slice(&self.node_cpu_ns);
                slot.decisions.copy_from_slice(&self.decisions);
                slot.state.store(PENDING, Ordering::Release);
                let state = slot.state.clone();
                slot.buffer.map_async(wgpu::MapMode::Read, .., move |result| {
                    state.store(if result.is_ok() { MAPPED } else { FAILED }, Ordering::Release);
                });
            }
            None => {
                (self.latest.frame, self.latest.cpu_ns) = (frame, cpu_ns);
                self.take_cpu_times();
                self.has_sample = true;
            }
        }
    }

    /// Takes over the newest timestamps that have arrived. Never waits.
    pub(crate) fn collect(&mut self) {
        let Some(queries) = &mut self.queries else {
            return;
        };
        let period = queries.period_ns;
        for slot in &mut queries.ring {
            let first = &queries.first;
            match slot.state.load(Ordering::Acquire) {
                MAPPED => {
                    if !self.has_sample || slot.frame >= self.latest.frame {
                        self.has_sample |= take(slot, first, period, &mut self.latest);
                    }
                    slot.buffer.unmap();
                    slot.state.store(FREE, Ordering::Release);
                }
                FAILED => slot.state.store(FREE, Ordering::Release),
                _ => {}
            }
        }
    }
}

fn take(slot: &Slot, firsts: &[Option<u32>], period_ns: f64, into: &mut FrameTimings) -> bool {
    let Ok(bytes) = slot.buffer.get_mapped_range(..) else {
        return false;
    };
    let tick = |i: u32| {
        let i = i as usize;
        let eight = bytes.get(i * 8..i * 8 + 8)?.try_into().ok()?;
        Some(u64::from_le_bytes(eight)).filter(|t| *t != 0)
    };
    let nanoseconds = |from: u64, to: u64| Some((to.checked_sub(from)? as f64 * period_ns) as u64);
    let (mut first, mut last) = (u64::MAX, 0);
    for (i, node) in into.nodes.iter_mut().enumerate() {
        node.cpu_ns = slot.node_cpu_ns[i];
        node.decided(slot.decisions[i]);
        if !node.ran {
            // Its queries hold what an earlier frame wrote.
            node.gpu_ns = firsts[i].map(|_| 0);
            continue;
        }
        let ticks = firsts[i].and_then(|query| tick(query).zip(tick(query + 1)));
        node.gpu_ns = ticks.and_then(|(from, to)| {
            (first, last) = (first.min(from), last.max(to));
            nanoseconds(from, to)
        });
    }
    into.gpu_ns = match last {
        0 if slot.decisions.iter().any(|decision| decision.ran()) => None,
        0 => Some(0),
        last => nanoseconds(first, last),
    };
    (into.frame, into.cpu_ns) = (slot.frame, slot.cpu_ns);
    true
}

impl Queries {
    fn new(gpu: &Gpu, first: Vec<Option<u32>>, count: u32) -> Self {
        let nodes = first.len();
        let size = u64::from(count) * 8;
        let device = gpu.device();
        let buffer =
            |label, usage| device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false });
        let slot = || Slot {
            buffer: buffer("timestamps read back", wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ),
            state: Arc::new(AtomicU8::new(FREE)),
            frame: 0,
            cpu_ns: 0,
            node_cpu_ns: vec![0; nodes],
            decisions: vec![Decision::First; nodes],
        };
        Self {
            set: device.create_query_set(&wgpu::QuerySetDescriptor { label: Some("timestamps"), ty: wgpu::QueryType::Timestamp, count }),
            resolved: buffer("timestamps resolved", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            count,
            first,
            ring: (0..RING).map(|_| slot()).collect(),
            chosen: None,
            period_ns: f64::from(gpu.timestamp_period_ns()),
        }
    }
}
