//! Nodes written in Rust: work on the CPU whose results the shaders read from buffers.

use std::{
    any::Any,
    collections::BTreeMap,
    fmt,
    sync::{Arc, Mutex},
};

use manylight_graph::{
    plan::{PlanNode, ResourceIx, Target},
    registry::HostDecl,
    value::Value,
};

pub use crate::error::HostError;

/// A node written in Rust. Its outputs are buffers; it runs before the frame is recorded, when what it depends on changed.
pub trait HostNode: Send {
    /// Fills the outputs.
    fn run(&mut self, ctx: &mut HostContext<'_>) -> Result<(), HostError>;

    /// Whether it runs in every frame, also when nothing changed.
    fn every_frame(&self) -> bool {
        false
    }
}

/// A kind of host node: how pipelines name and connect it, and how one is made.
#[derive(Clone, Copy)]
pub struct HostKind {
    /// Name in pipelines (`points/static`).
    pub name: &'static str,
    /// Its declaration: RON as in `shaders/**/*.ron`, without `steps`.
    pub declaration: &'static str,
    /// Makes one for a node of a pipeline.
    pub make: fn() -> Box<dyn HostNode>,
}

impl fmt::Debug for HostKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HostKind").field("name", &self.name).finish_non_exhaustive()
    }
}

/// The kinds of host nodes there are.
#[derive(Debug, Default, Clone)]
pub struct HostNodes {
    kinds: Vec<HostKind>,
}

impl HostNodes {
    /// None at all.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a kind; one of the same name is replaced.
    #[must_use]
    pub fn with(mut self, kind: HostKind) -> Self {
        self.kinds.retain(|k| k.name != kind.name);
        self.kinds.push(kind);
        self
    }

    /// All kinds, in the order in which they were added.
    pub fn kinds(&self) -> &[HostKind] {
        &self.kinds
    }

    /// What the registry must know of them.
    pub fn declarations(&self) -> Vec<HostDecl> {
        self.kinds.iter().map(|k| HostDecl { name: k.name, ron: k.declaration }).collect()
    }

    pub(crate) fn find(&self, name: &str) -> Option<&HostKind> {
        self.kinds.iter().find(|k| k.name == name)
    }
}

/// What the caller hands to the host nodes of a frame.
#[derive(Clone, Copy, Default)]
pub struct HostData<'a> {
    /// Anything; nodes ask for its type with [`HostContext::scene`].
    pub scene: Option<&'a dyn Any>,
    /// Differs whenever the scene differs: nodes run again then.
    pub stamp: u64,
}

impl<'a> HostData<'a> {
    /// For frames without host nodes, or whose host nodes need nothing.
    pub fn none() -> Self {
        Self::default()
    }

    /// A scene and its stamp.
    pub fn new(scene: &'a dyn Any, stamp: u64) -> Self {
        Self { scene: Some(scene), stamp }
    }
}

impl fmt::Debug for HostData<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HostData").field("stamp", &self.stamp).finish_non_exhaustive()
    }
}

/// A host node of a frame, shared with the frame that replaces this one.
pub(crate) type SharedHost = Arc<Mutex<Box<dyn HostNode>>>;

/// Contents of a host node's output.
#[derive(Debug, Default, Clone)]
pub(crate) struct HostBytes {
    pub(crate) bytes: Vec<u8>,
    pub(crate) stride: u32,
    /// Changes whenever the node runs.
    pub(crate) stamp: u64,
}

/// What a host node sees while it runs.
pub struct HostContext<'a> {
    pub(crate) node: &'a PlanNode,
    pub(crate) data: HostData<'a>,
    pub(crate) frame: u64,
    pub(crate) stamp: u64,
    pub(crate) buffers: &'a mut BTreeMap<ResourceIx, HostBytes>,
}

impl fmt::Debug for HostContext<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("HostContext").field("node", &self.node.id).finish_non_exhaustive()
    }
}

impl HostContext<'_> {
    /// Id of the node in the pipeline.
    pub fn id(&self) -> &str {
        &self.node.id
    }

    /// Frames run so far.
    pub fn frame(&self) -> u64 {
        self.frame
    }

    /// Changes whenever something that the node depends on changes.
    pub fn stamp(&self) -> u64 {
        self.stamp
    }

    /// The scene, if the caller gave one of this type.
    pub fn scene<T: Any>(&self) -> Result<&T, HostError> {
        let scene = self.data.scene.and_then(|scene| scene.downcast_ref());
        scene.ok_or_else(|| HostError::new(format!("needs a {}, but the frame was given none", std::any::type_name::<T>())))
    }

    /// A parameter.
    pub fn param(&self, name: &str) -> Result<&Value, HostError> {
        let found = self.node.params.iter().find(|(n, _)| n == name);
        found.map(|(_, value)| value).ok_or_else(|| HostError::new(format!("has no parameter `{name}`")))
    }

    /// A parameter that is a whole number.
    pub fn int(&self, name: &str) -> Result<i64, HostError> {
        match self.param(name)? {
            Value::Int(v) => Ok(*v),
            other => Err(wrong(name, other, "a whole number")),
        }
    }

    /// A parameter that is a number.
    pub fn float(&self, name: &str) -> Result<f64, HostError> {
        match self.param(name)? {
            Value::Float(v) => Ok(*v),
            Value::Int(v) => Ok(*v as f64),
            other => Err(wrong(name, other, "a number")),
        }
    }

    /// A parameter that is a switch.
    pub fn bool(&self, name: &str) -> Result<bool, HostError> {
        match self.param(name)? {
            Value::Bool(v) => Ok(*v),
            other => Err(wrong(name, other, "a switch")),
        }
    }

    /// A parameter that is a choice.
    pub fn choice(&self, name: &str) -> Result<&str, HostError> {
        match self.param(name)? {
            Value::Choice(v) => Ok(v),
            other => Err(wrong(name, other, "a choice")),
        }
    }

    /// Whether something is connected to the port.
    pub fn is_connected(&self, port: &str) -> bool {
        self.resource(port).is_ok()
    }

    fn resource(&self, port: &str) -> Result<ResourceIx, HostError> {
        match self.node.bindings.iter().find(|(name, _)| name == port) {
            Some((_, Target::Resource(ix) | Target::Previous(ix))) => Ok(*ix),
            Some((_, Target::Absent)) => Err(HostError::new(format!("the port `{port}` is connected to nothing"))),
            None => Err(HostError::new(format!("has no port `{port}`"))),
        }
    }

    /// Bytes of an input that another host node wrote.
    pub fn input(&self, port: &str) -> Result<&[u8], HostError> {
        let ix = self.resource(port)?;
        let found = self.buffers.get(&ix).map(|b| b.bytes.as_slice());
        found.ok_or_else(|| HostError::new(format!("the port `{port}` is not on the host")))
    }

    /// Number of elements that an output holds.
    pub fn count(&self, port: &str) -> Result<usize, HostError> {
        let ix = self.resource(port)?;
        let found = self.buffers.get(&ix).map(|b| b.bytes.len() / b.stride.max(1) as usize);
        found.ok_or_else(|| HostError::new(format!("the port `{port}` is not on the host")))
    }

    /// The bytes of an output, as the last run left them; zero at first.
    pub fn output(&mut self, port: &str) -> Result<&mut [u8], HostError> {
        let ix = self.resource(port)?;
        let found = self.buffers.get_mut(&ix).map(|b| b.bytes.as_mut_slice());
        found.ok_or_else(|| HostError::new(format!("the port `{port}` is not on the host")))
    }

    /// Writes elements to the start of an output and zeroes the rest. Their size must be that of the WGSL type.
    pub fn write<T: bytemuck::NoUninit>(&mut self, port: &str, elements: &[T]) -> Result<(), HostError> {
        let ix = self.resource(port)?;
        let stride = self.buffers.get(&ix).map_or(0, |b| b.stride) as usize;
        if stride != size_of::<T>() {
            return Err(HostError::new(format!("the elements of `{port}` have {stride} bytes, not {}", size_of::<T>())));
        }
        let to = self.output(port)?;
        let from: &[u8] = bytemuck::cast_slice(elements);
        if from.len() > to.len() {
            let (have, want) = (to.len() / stride.max(1), elements.len());
            return Err(HostError::new(format!(
                "`{port}` holds {have} elements, but {want} are to be written; raise its count in the pipeline"
            )));
        }
        let (head, rest) = to.split_at_mut(from.len());
        head.copy_from_slice(from);
        rest.fill(0);
        Ok(())
    }
}

fn wrong(name: &str, value: &Value, expected: &str) -> HostError {
    HostError::new(format!("the parameter `{name}` is {value}, not {expected}"))
}
