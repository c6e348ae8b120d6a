//! A composed WGSL module and what reflection says of it.

use std::{collections::BTreeMap, sync::Arc};

/// How a shader uses a global.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Access {
    /// Loads, samples or reads.
    pub read: bool,
    /// Stores, or atomics.
    pub write: bool,
}

/// What kind of thing a WGSL global is.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum GlobalKind {
    /// `texture_2d<f32>` (or `<u32>`, or `texture_depth_2d`), `texture_2d_array`.
    Texture {
        /// Component type.
        sample: SampleKind,
        /// `texture_2d_array`.
        array: bool,
        /// Whether any entry point uses it with a sampler other than `nearest_sampler` (then a 32-bit float texture needs a device feature).
        filtered: bool,
    },
    /// `texture_storage_2d<format, access>`.
    StorageTexture {
        /// Format as written in WGSL.
        format: crate::value::Format,
        /// `texture_storage_2d_array`.
        array: bool,
        /// Declared access.
        access: Access,
    },
    /// `var<storage, read|read_write> x: array<T>`.
    Storage {
        /// Name of the element type, demangled (`atomic<u32>` reads as `u32`).
        element: String,
        /// Bytes from one element to the next.
        stride: u32,
        /// Declared access.
        access: Access,
    },
    /// `var<uniform> x: T`.
    Uniform {
        /// Name of the structure, demangled.
        element: String,
        /// Bytes.
        size: u32,
    },
    /// `sampler`.
    Sampler,
}

/// Component type of a sampled texture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum SampleKind {
    Float,
    Uint,
    Sint,
    Depth,
}

/// A module-scope variable with a binding.
#[derive(Debug, Clone, PartialEq)]
pub struct Global {
    /// Name in WGSL: the name of a port, with an optional suffix `_finer` or `_coarser` (see `Step`), or `params`, or a sampler.
    pub name: String,
    /// `@group`.
    pub group: u32,
    /// `@binding`.
    pub binding: u32,
    /// Its type.
    pub kind: GlobalKind,
    /// The module of `shaders/common/` that declares it (`common::rays`); `None`: the shader itself.
    pub module: Option<String>,
    /// Where it is declared.
    pub span: crate::diagnostics::Span,
}

/// Pipeline stage of an entry point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Stage {
    Compute,
    Vertex,
    Fragment,
}

/// A function marked `@compute`, `@vertex` or `@fragment`.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Name in WGSL.
    pub name: String,
    /// Stage.
    pub stage: Stage,
    /// `@workgroup_size`; `[1, 1, 1]` for other stages.
    pub workgroup_size: [u32; 3],
    /// Globals it uses (index into [`Shader::globals`]) and how.
    pub uses: Vec<(usize, Access)>,
    /// For a fragment entry: number of `@location` outputs.
    pub color_targets: u32,
    /// Bytes of the `var<workgroup>` that it uses.
    pub workgroup_bytes: u64,
}

/// A scalar or vector type of a structure's member or of an override.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum MemberKind {
    /// `f32`, `u32`, `i32`, `bool`, and vectors and matrices of them: component kind and count (columns × rows).
    Numeric {
        /// Component type.
        scalar: Scalar,
        /// Rows of a matrix or components of a vector; 1 for a scalar.
        rows: u32,
        /// Columns of a matrix; 1 otherwise.
        columns: u32,
        /// Bytes between columns of a matrix; 0 otherwise.
        column_stride: u32,
    },
    /// A fixed-size array of such.
    Array {
        /// Element.
        of: Box<MemberKind>,
        /// Number of elements.
        count: u32,
        /// Bytes from one to the next.
        stride: u32,
    },
    /// A nested structure, by name.
    Struct(String),
}

/// Component types.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Scalar {
    F32,
    U32,
    I32,
    Bool,
}

/// A member of a structure.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Member {
    /// Name.
    pub name: String,
    /// Bytes from the start of the structure.
    pub offset: u32,
    /// Type.
    pub kind: MemberKind,
}

/// The layout of a WGSL structure, or of a plain type as one member named "".
#[derive(Debug, Clone, PartialEq, Eq, Hash, Default)]
pub struct Layout {
    /// Bytes, rounded up to the alignment.
    pub size: u32,
    /// Members by offset.
    pub members: Vec<Member>,
}

/// A composed shader module, ready for pipeline creation.
#[derive(Debug)]
pub struct Shader {
    /// File name for messages (`shaders/clustering/average.wgsl`).
    pub source: Arc<crate::diagnostics::Source>,
    /// The module with all imports in it.
    pub module: naga::Module,
    /// Globals with bindings.
    pub globals: Vec<Global>,
    /// Entry points.
    pub entries: Vec<Entry>,
    /// Pipeline-overridable constants: name and type.
    pub overrides: Vec<(String, Scalar)>,
    /// Structures reachable from globals, by demangled name, and plain element types.
    pub layouts: BTreeMap<String, Layout>,
    /// Files of `shaders/` that it imports, directly or not.
    pub imports: Vec<String>,
    /// Hash of the source and of all imports: equal hash, equal module.
    pub hash: u64,
}
