//! What will run: an ordered list of nodes with every binding, size and lifetime resolved. Plain data.

use std::{collections::BTreeMap, sync::Arc};

use crate::{
    features::Measured,
    registry::{Direction, NodeDecl},
    value::{ResourceDesc, Value},
};

/// What a plan depends on besides the pipeline and the registry.
#[derive(Debug, Clone, Default)]
pub struct PlanInput {
    /// Size of the picture in pixels.
    pub output: (u32, u32),
    /// Values set by the user, by parameter name (`clusters`) or by node and parameter (`map.window`).
    pub set: Vec<(String, String)>,
    /// What the scene has, by feature name; a name that is absent is an unknown feature.
    pub features: BTreeMap<String, bool>,
    /// What was measured of the scene, by feature name; what is absent counts as above every bound, so that nothing is left out for it.
    pub measured: BTreeMap<String, Measured>,
    /// Sizes of externals; absent ones (in a check without a scene) get a small stand-in.
    pub externals: BTreeMap<String, ResourceDesc>,
    /// Resources to keep although nobody reads them (dumps).
    pub keep: Vec<String>,
    /// Keep what every node writes until it writes it anew, so that nodes whose inputs are unchanged need not run: no memory is shared.
    pub keep_unchanged: bool,
    /// Debug switches; none may change the picture.
    pub debug: Debug,
}

/// Debug switches of planning and execution.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Debug {
    /// Run nodes that nobody reads.
    pub no_culling: bool,
    /// Give each transient resource memory of its own.
    pub no_reuse: bool,
    /// Fill transient resources with NaN patterns when they are acquired.
    pub poison: bool,
    /// Look at every number that a node writes, right after it.
    pub watch_numbers: bool,
    /// Choose another legal order, by seed.
    pub shuffle: Option<u64>,
}

/// Index into [`Plan::resources`].
pub type ResourceIx = usize;

/// How a resource lives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lifetime {
    /// Given from outside each frame.
    External,
    /// Lives from the first to the last node that touches it (indices into [`Plan::nodes`], inclusive),
    /// in pool slot `slot`; transients with the same slot have equal descriptions and disjoint lives.
    Transient {
        /// First node.
        first: usize,
        /// Last node.
        last: usize,
        /// Memory.
        slot: usize,
    },
    /// Kept for the next frame, where `Previous` reads it; two copies that swap. Zero at first.
    History,
    /// Lives like a transient, but is read after the frame (presented or dumped): never shared.
    Kept,
}

/// How shaders and the host use a resource.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Usage {
    /// Sampled or read as a storage buffer.
    pub read: bool,
    /// Written by a compute step.
    pub storage: bool,
    /// Colour or depth attachment.
    pub target: bool,
    /// Says how many workgroups a dispatch has.
    pub indirect: bool,
}

/// A resource with its size.
#[derive(Debug, Clone, PartialEq)]
pub struct PlanResource {
    /// Name in the pipeline.
    pub name: String,
    /// Format and size.
    pub desc: ResourceDesc,
    /// Names of the parameters of the pipeline that its size is computed from.
    pub sized_by: Vec<String>,
    /// How it lives.
    pub lifetime: Lifetime,
    /// Usages over all nodes of the plan.
    pub usage: Usage,
}

/// What a port is connected to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// This frame's value.
    Resource(ResourceIx),
    /// The last frame's value.
    Previous(ResourceIx),
    /// Nothing: a placeholder is bound.
    Absent,
}

/// How many workgroups a dispatch has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Workgroups {
    /// So many in x, y and z.
    Fixed([u32; 3]),
    /// What the first three numbers of a buffer say when the dispatch comes to run.
    Indirect(Target),
}

/// A dispatch or draw with its size.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PlanStep {
    /// A compute dispatch.
    Compute {
        /// Entry point.
        entry: String,
        /// Workgroups.
        groups: Workgroups,
        /// For a step repeated over mips: the port and the level it writes. Such steps are already unrolled.
        mip: Option<(String, u32)>,
    },
    /// A draw.
    Draw {
        /// Vertex entry point.
        vertex: String,
        /// Fragment entry point.
        fragment: String,
        /// Number of vertices.
        vertices: u32,
        /// How often all of them are drawn.
        instances: u32,
        /// Colour attachments: resources in the order of `@location`; none where an optional output is not made.
        targets: Vec<Option<ResourceIx>>,
        /// Depth attachment.
        depth: Option<ResourceIx>,
    },
}

/// A value that a condition chose.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// The node's parameter.
    pub param: String,
    /// Its value.
    pub value: Value,
    /// What the condition came to: the clauses that decided, with the values they met.
    pub because: String,
}

/// A node that will run.
#[derive(Debug, Clone)]
pub struct PlanNode {
    /// Id in the pipeline: label, timer, span and dump name.
    pub id: String,
    /// File stem of the document that declares it (`gbuffer` for `stages/gbuffer.ron`).
    pub stage: String,
    /// The declaration.
    pub decl: Arc<NodeDecl>,
    /// Port by port, in the order of the declaration.
    pub bindings: Vec<(String, Target)>,
    /// Every parameter of the node with its value.
    pub params: Vec<(String, Value)>,
    /// Steps in order, repetitions unrolled; empty for a host node.
    pub steps: Vec<PlanStep>,
    /// Why its condition holds: the clauses that decided, with the values they met. `None` if it has no condition.
    pub because: Option<String>,
    /// Parameters whose values a condition chose, in the order of the usage.
    pub chosen: Vec<Chosen>,
    /// Frames after which it stops, when nothing but the frame's number and its own history changed; its outputs stay.
    pub settles: Option<u32>,
}

impl PlanStep {
    /// The buffer that says how many workgroups it has, if one does.
    pub fn indirect(&self) -> Option<ResourceIx> {
        match self {
            Self::Compute { groups: Workgroups::Indirect(Target::Resource(ix) | Target::Previous(ix)), .. } => Some(*ix),
            _ => None,
        }
    }
}

impl PlanNode {
    /// Resources that it writes.
    pub fn outputs(&self) -> impl Iterator<Item = ResourceIx> + '_ {
        self.bindings.iter().filter_map(|(port, target)| match target {
            Target::Resource(ix) if self.decl.ports.get(port).is_some_and(|p| p.direction == Direction::Output) => Some(*ix),
            _ => None,
        })
    }
}

/// Why a node will not run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Idle {
    /// Its condition does not hold; the clause that decided, as written with the values it met.
    Off(String),
    /// Nobody reads what it writes.
    Dead,
}

/// A node that will not run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct IdleNode {
    /// Id in the pipeline.
    pub id: String,
    /// Stage.
    pub stage: String,
    /// Node name in the registry.
    pub kind: String,
    /// Reason.
    pub reason: Idle,
}

/// What will run, in order.
#[derive(Debug, Clone)]
pub struct Plan {
    /// Nodes in order of execution.
    pub nodes: Vec<PlanNode>,
    /// Nodes that will not run, in document order.
    pub idle: Vec<IdleNode>,
    /// Resources used by the nodes.
    pub resources: Vec<PlanResource>,
    /// The picture to show (display-referred).
    pub presents: ResourceIx,
    /// Linear radiance before tone mapping, when the pipeline names it.
    pub radiance: Option<ResourceIx>,
    /// Every pipeline parameter with its value.
    pub params: Vec<(String, Value)>,
    /// Number of pool slots of transients.
    pub slots: usize,
}

impl Plan {
    /// The resource of that name, if the plan uses it.
    pub fn resource(&self, name: &str) -> Option<ResourceIx> {
        self.resources.iter().position(|r| r.name == name)
    }

    /// The value of a parameter of the pipeline.
    pub fn param(&self, name: &str) -> Option<&Value> {
        self.params.iter().find(|(known, _)| known == name).map(|(_, value)| value)
    }

    /// Whether the same nodes run with the same parameters on the same resources, whatever parameters of the pipeline differ that nothing reads.
    pub fn same_work(&self, other: &Self) -> bool {
        let same = |(a, b): (&PlanNode, &PlanNode)| {
            (&a.id, &a.decl.name, &a.bindings, &a.params, &a.steps, a.settles)
                == (&b.id, &b.decl.name, &b.bindings, &b.params, &b.steps, b.settles)
        };
        self.nodes.len() == other.nodes.len()
            && self.nodes.iter().zip(&other.nodes).all(same)
            && (&self.resources, self.presents, self.radiance) == (&other.resources, other.presents, other.radiance)
    }
}
