//! Formats, descriptions and parameter values shared by declarations, pipelines and plans.

use std::fmt;

/// Formats of texture resources, named as in WebGPU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Format {
    R8Unorm,
    Rgba8Unorm,
    Rgba8UnormSrgb,
    R16Float,
    Rg16Float,
    Rgba16Float,
    R32Float,
    Rg32Float,
    Rgba32Float,
    R32Uint,
    Rg32Uint,
    Rgba32Uint,
    Depth32Float,
}

/// What the numbers in a texture mean, where the format alone does not say (used by dumps and views).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Encoding {
    /// The format's own meaning.
    #[default]
    Plain,
    /// Unit vectors in `R32Uint`: octahedral map, two 16-bit signed normalised numbers; 0 stands for "none".
    Octahedral,
}

/// What a resource is, with all sizes known.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum ResourceDesc {
    /// A 2D texture (`layers` > 1 or `array`: a 2D array).
    Texture {
        /// Texel format.
        format: Format,
        /// Width in texels, at least 1.
        width: u32,
        /// Height in texels, at least 1.
        height: u32,
        /// Array layers; 1 for a plain 2D texture.
        layers: u32,
        /// Whether shaders see it as `texture_2d_array`.
        array: bool,
        /// Mip levels, at least 1.
        mips: u32,
        /// Meaning of the texels.
        encoding: Encoding,
    },
    /// A storage buffer of equal elements.
    Buffer {
        /// Name of the WGSL type of an element (`Cluster`, `u32`, `vec4f`).
        element: String,
        /// Bytes from one element to the next.
        stride: u32,
        /// Number of elements, at least 1.
        count: u64,
    },
    /// A uniform buffer holding one structure.
    Uniform {
        /// Name of the WGSL structure.
        element: String,
        /// Bytes.
        size: u32,
    },
}

/// The value of a parameter.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A whole number.
    Int(i64),
    /// A real number.
    Float(f64),
    /// On or off.
    Bool(bool),
    /// One of the options.
    Choice(String),
}

impl Value {
    /// The number, if it is one.
    pub(crate) fn number(&self) -> Option<f64> {
        match self {
            Self::Int(v) => Some(*v as f64),
            Self::Float(v) => Some(*v),
            _ => None,
        }
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Int(v) => write!(f, "{v}"),
            Self::Float(v) => write!(f, "{v:?}"),
            Self::Bool(v) => write!(f, "{v}"),
            Self::Choice(v) => f.write_str(v),
        }
    }
}

/// What values a parameter takes.
#[derive(Debug, Clone, PartialEq)]
pub enum ParamKind {
    /// Whole numbers `min..=max`.
    Int {
        /// Smallest.
        min: i64,
        /// Largest.
        max: i64,
        /// When nothing is set.
        default: i64,
    },
    /// Real numbers `min..=max`.
    Float {
        /// Smallest.
        min: f64,
        /// Largest.
        max: f64,
        /// When nothing is set.
        default: f64,
    },
    /// On or off.
    Bool {
        /// When nothing is set.
        default: bool,
    },
    /// One of several names.
    Choice {
        /// The names, in the order of the declaration.
        options: Vec<String>,
        /// When nothing is set.
        default: String,
    },
}

impl ParamKind {
    /// The value when nothing is set.
    pub fn default_value(&self) -> Value {
        match self {
            Self::Int { default, .. } => Value::Int(*default),
            Self::Float { default, .. } => Value::Float(*default),
            Self::Bool { default } => Value::Bool(*default),
            Self::Choice { default, .. } => Value::Choice(default.clone()),
        }
    }
}
