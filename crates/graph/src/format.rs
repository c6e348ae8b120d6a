//! What is known of texture formats.

use std::fmt;

use crate::{
    reader::Reader,
    render::suggest,
    shader::SampleKind,
    tree::{Kind, Tree},
    value::{Encoding, Format, ResourceDesc},
};

impl Format {
    /// Every format.
    pub const ALL: [Self; 13] = [
        Self::R8Unorm,
        Self::Rgba8Unorm,
        Self::Rgba8UnormSrgb,
        Self::R16Float,
        Self::Rg16Float,
        Self::Rgba16Float,
        Self::R32Float,
        Self::Rg32Float,
        Self::Rgba32Float,
        Self::R32Uint,
        Self::Rg32Uint,
        Self::Rgba32Uint,
        Self::Depth32Float,
    ];

    /// The name in documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::R8Unorm => "R8Unorm",
            Self::Rgba8Unorm => "Rgba8Unorm",
            Self::Rgba8UnormSrgb => "Rgba8UnormSrgb",
            Self::R16Float => "R16Float",
            Self::Rg16Float => "Rg16Float",
            Self::Rgba16Float => "Rgba16Float",
            Self::R32Float => "R32Float",
            Self::Rg32Float => "Rg32Float",
            Self::Rgba32Float => "Rgba32Float",
            Self::R32Uint => "R32Uint",
            Self::Rg32Uint => "Rg32Uint",
            Self::Rgba32Uint => "Rgba32Uint",
            Self::Depth32Float => "Depth32Float",
        }
    }

    /// The format of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }

    /// What a shader gets when it reads a texel. A depth texture can also be read as float.
    pub fn sample_kind(self) -> SampleKind {
        match self {
            Self::R32Uint | Self::Rg32Uint | Self::Rgba32Uint => SampleKind::Uint,
            Self::Depth32Float => SampleKind::Depth,
            _ => SampleKind::Float,
        }
    }

    /// Whether filtering it needs the device feature `FLOAT32_FILTERABLE`.
    pub fn is_float32(self) -> bool {
        matches!(self, Self::R32Float | Self::Rg32Float | Self::Rgba32Float)
    }

    /// Bytes of a texel.
    pub fn bytes(self) -> u32 {
        match self {
            Self::R8Unorm => 1,
            Self::R16Float => 2,
            Self::Rgba8Unorm | Self::Rgba8UnormSrgb | Self::Rg16Float | Self::R32Float | Self::R32Uint | Self::Depth32Float => 4,
            Self::Rgba16Float | Self::Rg32Float | Self::Rg32Uint => 8,
            Self::Rgba32Float | Self::Rgba32Uint => 16,
        }
    }

    /// Number of components.
    pub fn channels(self) -> u32 {
        match self {
            Self::R8Unorm | Self::R16Float | Self::R32Float | Self::R32Uint | Self::Depth32Float => 1,
            Self::Rg16Float | Self::Rg32Float | Self::Rg32Uint => 2,
            _ => 4,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl ResourceDesc {
    /// Bytes of memory, all layers and mip levels counted.
    pub fn bytes(&self) -> u64 {
        match *self {
            Self::Texture { format, width, height, layers, mips, .. } => (0..mips)
                .map(|level| u64::from((width >> level).max(1)) * u64::from((height >> level).max(1)))
                .sum::<u64>()
                .saturating_mul(u64::from(layers) * u64::from(format.bytes())),
            Self::Buffer { stride, count, .. } => u64::from(stride).saturating_mul(count),
            Self::Uniform { size, .. } => size.into(),
        }
    }
}

/// In a few words: `R32Float 512×512, 10 mips`, `64 × Cluster`.
impl fmt::Display for ResourceDesc {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Texture { format, width, height, layers, mips, .. } => {
                write!(f, "{format} {width}×{height}")?;
                if *layers > 1 {
                    write!(f, "×{layers}")?;
                }
                if *mips > 1 {
                    write!(f, ", {mips} mips")?;
                }
                Ok(())
            }
            Self::Buffer { element, count, .. } => write!(f, "{count} × {element}"),
            Self::Uniform { element, .. } => write!(f, "uniform {element}"),
        }
    }
}

/// Reads `format: R32Uint`.
pub(crate) fn read(reader: &mut Reader, tree: &Tree) -> Option<Format> {
    match &tree.kind {
        Kind::Name(name) => {
            let found = Format::from_name(name);
            if found.is_none() {
                reader.error(&tree.range, format!("unknown format `{name}`"), suggest(name, Format::ALL.iter().map(|f| f.name())));
            }
            found
        }
        Kind::Text(name) => {
            reader.error(&tree.range, "expected a format, found a string", format!("write it without quotes: {name}"));
            None
        }
        _ => {
            reader.expected(tree, "a format such as Rgba16Float", "");
            None
        }
    }
}

/// Reads `encoding: Octahedral`.
pub(crate) fn read_encoding(reader: &mut Reader, tree: &Tree) -> Option<Encoding> {
    match &tree.kind {
        Kind::Name(name) if name == "Plain" => Some(Encoding::Plain),
        Kind::Name(name) if name == "Octahedral" => Some(Encoding::Octahedral),
        Kind::Name(name) => {
            reader.error(&tree.range, format!("unknown encoding `{name}`"), suggest(name, ["Plain", "Octahedral"]));
            None
        }
        _ => {
            reader.expected(tree, "an encoding: Plain or Octahedral", "");
            None
        }
    }
}
