//! Every node a pipeline can name: those declared as data in `shaders/` and those written in Rust.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use indexmap::IndexMap;

use crate::{
    condition::Condition,
    diagnostics::Span,
    shader::{Layout, Shader},
    value::{Format, ParamKind},
};

/// Whether a port takes or gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Direction {
    Input,
    Output,
}

/// What a port accepts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PortKind {
    /// A 2D texture; `format: None` accepts any format that reads as float.
    Texture {
        /// Required format.
        format: Option<Format>,
        /// Seen as an array by the shader.
        array: bool,
    },
    /// A storage buffer of elements of the named WGSL type.
    Buffer {
        /// Element type.
        of: String,
    },
    /// A uniform structure (scene and frame data).
    Uniform {
        /// Structure.
        of: String,
    },
}

/// A named input or output of a node.
#[derive(Debug, Clone)]
pub struct Port {
    /// Input or output.
    pub direction: Direction,
    /// What fits.
    pub kind: PortKind,
    /// An input may be left unconnected or connected to a resource whose producer is off; an output that nobody reads is not made.
    /// An empty placeholder is bound then, or the draw target left out.
    pub optional: bool,
    /// Values of the node's own parameters with which it is used; always, if absent. Otherwise it is as if it were left unconnected.
    pub when: Option<Condition>,
    /// Of an output: no number written is less. Told by `Debug::watch_numbers` where it does not hold.
    pub at_least: Option<f64>,
    /// Of an output: no number written is greater.
    pub at_most: Option<f64>,
    /// What it is: units, space, meaning.
    pub doc: String,
    /// Where the port is declared.
    pub span: Span,
}

/// A parameter with its documentation.
#[derive(Debug, Clone)]
pub struct Param {
    /// Type, range and default.
    pub kind: ParamKind,
    /// What it does, its unit, what it costs.
    pub doc: String,
    /// Where it is declared.
    pub span: Span,
}

/// A whole-number expression over sizes and parameters.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Expr {
    Const(u64),
    Param(String),
    OutputWidth,
    OutputHeight,
    /// Sizes of a resource (in a pipeline) or of a port (in a node declaration).
    Width(String),
    Height(String),
    Elements(String),
    /// 1 if the condition of this name holds, 0 if not; in a pipeline only.
    Holds(String),
    Mul(Vec<Expr>),
    Add(Vec<Expr>),
    /// Quotient rounded up; division by zero is an error of the check.
    DivCeil(Box<Expr>, Box<Expr>),
    /// Quotient rounded down; division by zero is an error of the check.
    Div(Box<Expr>, Box<Expr>),
    Min(Vec<Expr>),
    Max(Vec<Expr>),
    /// Smallest power of two that is not below.
    NextPowerOfTwo(Box<Expr>),
}

/// How many invocations a compute step needs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Over {
    /// A thread for each texel of the port's texture (at the step's mip level).
    Texels(String),
    /// A thread for each element of the port's buffer, in one dimension.
    /// More groups than a dimension allows are folded into rows: shaders use `linear_index` of `common::dispatch`.
    Elements(String),
    /// Threads in x, y, z.
    Threads(Expr, Expr, Expr),
    /// Workgroups in x, y, z.
    Groups(Expr, Expr, Expr),
    /// As many workgroups as the first three numbers of the port's buffer say when the step comes to run: a number that the GPU found itself.
    Indirect(String),
}

/// Runs a step once a mip level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Repeat {
    /// Level 1 to the last of the port's texture. The global named as the port is level L (written),
    /// `PORT_finer` is level L−1 (read).
    Down(String),
    /// Level last−1 to 0: the port's global is level L, `PORT_coarser` is level L+1.
    Up(String),
    /// A number of times; each repetition sees the same bindings.
    Times(Expr),
}

/// One dispatch or draw of a node.
#[derive(Debug, Clone)]
pub enum Step {
    /// A compute dispatch.
    Compute {
        /// Entry point.
        entry: String,
        /// Size.
        over: Over,
        /// Repetition.
        repeat: Option<Repeat>,
        /// Place in the declaration.
        span: Span,
    },
    /// A draw of triangles whose vertices the vertex shader reads from buffers.
    Draw {
        /// Vertex entry point.
        vertex: String,
        /// Fragment entry point.
        fragment: String,
        /// Number of vertices.
        vertices: Expr,
        /// How often all of them are drawn (`@builtin(instance_index)`).
        instances: Expr,
        /// Output ports in the order of `@location`; cleared to zero first.
        targets: Vec<String>,
        /// Output port of format `Depth32Float` for the depth test (reverse z: cleared to 0, nearer is greater).
        depth: Option<String>,
        /// Place in the declaration.
        span: Span,
    },
}

/// A node that pipelines can name.
#[derive(Debug)]
pub struct NodeDecl {
    /// Folder and stem (`clustering/average`).
    pub name: String,
    /// What it does, with its source.
    pub doc: String,
    /// Ports in the order of the declaration.
    pub ports: IndexMap<String, Port>,
    /// Parameters in the order of the declaration.
    pub params: IndexMap<String, Param>,
    /// Steps; empty for a host node.
    pub steps: Vec<Step>,
    /// Device features it cannot do without, as wgpu names them (`FLOAT32_FILTERABLE`).
    pub requires: Vec<String>,
    /// Int parameter that says after how many frames the node stops, when nothing but the frame's number and its own history changed; 0: never.
    pub settles: Option<String>,
    /// The shader; `None` for a host node.
    pub shader: Option<Arc<Shader>>,
    /// Where it is declared.
    pub span: Span,
}

/// A resource that exists outside the graph: scene and frame data.
#[derive(Debug, Clone)]
pub struct External {
    /// Name in pipelines (`scene_camera`).
    pub name: String,
    /// What it is.
    pub kind: PortKind,
    /// Documentation.
    pub doc: String,
    /// The layout that Rust fills; compared member by member with every shader that reads it.
    pub layout: Option<Layout>,
}

/// All nodes and externals by name.
#[derive(Debug, Default, Clone)]
pub struct Registry {
    /// Nodes by name.
    pub nodes: BTreeMap<String, Arc<NodeDecl>>,
    /// Externals by name.
    pub externals: BTreeMap<String, External>,
    /// Nodes that were left out because of faults; what uses them is not reported again.
    pub faulty: BTreeSet<String>,
    /// Layouts of the structures that ports and externals share.
    pub types: BTreeMap<String, Layout>,
    /// Every shader that composes, by node, for the next reload.
    pub(crate) shaders: BTreeMap<String, Arc<Shader>>,
    /// Hashes of the common modules known to be good.
    pub(crate) good_modules: BTreeSet<u64>,
}

/// The declaration of a node written in Rust.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HostDecl {
    /// Name in pipelines (`stage/name`).
    pub name: &'static str,
    /// `Node(…)` without `steps`.
    pub ron: &'static str,
}
