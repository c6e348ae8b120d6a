//! What can go wrong on the way to a picture, one enum per operation.

use std::fmt;

use manylight_graph::diagnostics::{Diagnostic, Diagnostics, Span};

/// Why no device could be opened.
#[derive(Debug, Clone, thiserror::Error)]
pub enum GpuError {
    /// The system offers no adapter at all.
    #[error(
        "no usable GPU: neither a graphics card with a Vulkan, Metal or Direct3D 12 driver nor a software renderer was found\n\
         help: on Debian or Ubuntu `apt-get install libvulkan1 mesa-vulkan-drivers` installs the loader, the drivers of \
         common cards and a software renderer"
    )]
    NoAdapter,
    /// None of the adapters has the wanted name.
    #[error("no GPU is named like `{wanted}`; there is {}", list(found))]
    NoSuchAdapter {
        /// What was asked for.
        wanted: String,
        /// Names of the adapters there are.
        found: Vec<String>,
    },
    /// No adapter can show pictures in the given window.
    #[error("no GPU can draw into this window; there is {}", list(found))]
    NoSurface {
        /// Names of the adapters there are.
        found: Vec<String>,
    },
    /// The adapter is there but refuses to open.
    #[error("the GPU `{adapter}` cannot be opened: {message}")]
    Device {
        /// Its name.
        adapter: String,
        /// What wgpu says.
        message: String,
    },
}

fn list(names: &[String]) -> String {
    if names.is_empty() {
        return "none".to_owned();
    }
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

/// A size that the device does not allow.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{subject} needs {needed}{unit}, but this GPU allows {allowed}{unit} ({limit}){}", help(remedy))]
pub struct LimitError {
    /// What needs it (``resource `ism` (R32Float 32768×32768)``).
    pub subject: String,
    /// How much it needs.
    pub needed: u64,
    /// How much the device allows.
    pub allowed: u64,
    /// Unit with a leading space, or empty.
    pub unit: &'static str,
    /// The limit's name in WebGPU.
    pub limit: &'static str,
    /// What to lower, or empty.
    pub remedy: String,
}

fn help(remedy: &str) -> String {
    if remedy.is_empty() { String::new() } else { format!("\nhelp: {remedy}") }
}

/// One reason why a frame cannot be built.
#[derive(Debug, Clone, thiserror::Error)]
#[allow(missing_docs)]
pub enum Fault {
    #[error("node `{node}` needs the device feature {feature}, which this GPU ({adapter}) lacks")]
    MissingFeature { node: String, feature: String, adapter: String },
    #[error("node `{node}` requires {feature}, which is no device feature that wgpu knows")]
    UnknownFeature { node: String, feature: String },
    #[error(transparent)]
    Limit(#[from] LimitError),
    #[error("{resource} cannot be created: {message}")]
    Resource { resource: String, message: String },
    #[error("there is not enough memory for {resource}: the resources of the frame need {needed}{}", help(remedy))]
    OutOfMemory { resource: String, needed: String, remedy: String },
    #[error("external `{name}` is not there: the plan reads it, but nobody set it")]
    MissingExternal { name: String },
    #[error("external `{name}` is {actual}, but the plan was made for {expected}")]
    WrongExternal { name: String, expected: String, actual: String },
    #[error("node `{node}`: the shader {shader} is refused by the GPU: {message}")]
    Module { node: String, shader: String, message: String },
    #[error("node `{node}`: entry point `{entry}` of {shader} is refused by the GPU: {message}")]
    Pipeline { node: String, entry: String, shader: String, message: String },
    #[error("node `{node}`: entry point `{entry}` cannot be bound: {message}")]
    Binding { node: String, entry: String, message: String },
    #[error("node `{node}` is written in Rust, but no host node is registered as `{kind}`")]
    UnknownHost { node: String, kind: String },
    #[error("host node `{node}`, port `{port}`: {message}")]
    HostPort { node: String, port: String, message: String },
    #[error("{}", lost(reason))]
    Lost { reason: String },
    #[error("the frame cannot be recorded: {message}")]
    Recording { message: String },
}

/// Why a frame cannot be built: every fault found in one go. The frame that ran before is untouched.
#[derive(Debug, Clone)]
pub struct BuildError {
    /// Faults in the order of the plan, each with the declaration it belongs to where there is one.
    pub faults: Vec<(Fault, Option<Span>)>,
}

impl BuildError {
    /// The faults as diagnostics that point at the declarations of the nodes at fault.
    pub fn diagnostics(&self) -> Diagnostics {
        let of = |(fault, span): &(Fault, Option<Span>)| match span {
            Some(span) => Diagnostic::error(fault.to_string(), span.clone()),
            None => Diagnostic::error_nowhere(fault.to_string()),
        };
        Diagnostics(self.faults.iter().map(of).collect())
    }
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, (fault, _)) in self.faults.iter().enumerate() {
            if i > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{fault}")?;
        }
        Ok(())
    }
}

impl std::error::Error for BuildError {}

impl From<Fault> for BuildError {
    fn from(fault: Fault) -> Self {
        Self { faults: vec![(fault, None)] }
    }
}

/// Why a frame could not be run.
#[derive(Debug, Clone, thiserror::Error)]
pub enum RunError {
    /// A host node failed.
    #[error("node `{node}`: {source}")]
    Host {
        /// Its id.
        node: String,
        /// What it says.
        source: HostError,
    },
    /// An external changed in a way that the plan does not fit, or is gone.
    #[error(transparent)]
    External(#[from] Fault),
    /// The GPU reported an error that belongs to no build.
    #[error("the GPU reported an error while the frame was run: {0}")]
    Gpu(String),
    /// The device is gone.
    #[error("{}", lost(.0))]
    Lost(String),
}

/// What is to be said and done about a lost device.
pub(crate) fn lost(reason: &str) -> String {
    format!(
        "the GPU was lost: {reason}\n\
         help: drivers reset a GPU that is busy for seconds, and when they are updated: run it again, if it happens again with a smaller picture or with fewer \
         clusters, points or rays"
    )
}

/// Why a host node could not do its work.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{0}")]
pub struct HostError(pub String);

impl HostError {
    /// An error that says `message`.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }
}

/// Why a resource could not be read back.
#[derive(Debug, Clone, thiserror::Error)]
pub enum ReadError {
    /// The frame has no resource of that name.
    #[error("the frame has no resource `{0}`")]
    Unknown(String),
    /// A buffer was asked for as a picture or the other way round.
    #[error("`{name}` is {actual}, not {expected}")]
    Kind {
        /// The resource.
        name: String,
        /// What was asked for.
        expected: &'static str,
        /// What it is.
        actual: String,
    },
    /// There is no such mip level or layer.
    #[error("`{name}` has {mips} mip levels and {layers} layers; level {mip} of layer {layer} is not among them")]
    Subresource {
        /// The resource.
        name: String,
        /// Levels it has.
        mips: u32,
        /// Layers it has.
        layers: u32,
        /// Level asked for.
        mip: u32,
        /// Layer asked for.
        layer: u32,
    },
    /// No shader of the frame tells the layout of the elements.
    #[error("`{name}` has elements of type `{element}`, whose layout no shader of the frame tells")]
    Layout {
        /// The resource.
        name: String,
        /// Element type.
        element: String,
    },
    /// The GPU could not copy or map.
    #[error("`{name}` cannot be read back: {message}")]
    Gpu {
        /// The resource.
        name: String,
        /// What wgpu says.
        message: String,
    },
}

/// What [`tidy`] makes of an error of memory.
pub(crate) const OUT_OF_MEMORY: &str = "out of memory";

/// wgpu's message without its headline and indentation.
pub(crate) fn tidy(error: &wgpu::Error) -> String {
    let text = match error {
        wgpu::Error::OutOfMemory { .. } => return OUT_OF_MEMORY.to_owned(),
        other => other.to_string(),
    };
    let body = text.split_once("Caused by:").map_or(text.as_str(), |(_, body)| body);
    let lines: Vec<&str> = body.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    lines.join(": ")
}
