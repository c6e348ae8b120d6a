//! Formats of the graph as wgpu knows them, and sizes of what they describe.

use manylight_graph::value::{Format, ResourceDesc};
use wgpu::TextureFormat;

/// The same format in wgpu's words.
pub fn texture_format(format: Format) -> TextureFormat {
    match format {
        Format::R8Unorm => TextureFormat::R8Unorm,
        Format::Rgba8Unorm => TextureFormat::Rgba8Unorm,
        Format::Rgba8UnormSrgb => TextureFormat::Rgba8UnormSrgb,
        Format::R16Float => TextureFormat::R16Float,
        Format::Rg16Float => TextureFormat::Rg16Float,
        Format::Rgba16Float => TextureFormat::Rgba16Float,
        Format::R32Float => TextureFormat::R32Float,
        Format::Rg32Float => TextureFormat::Rg32Float,
        Format::Rgba32Float => TextureFormat::Rgba32Float,
        Format::R32Uint => TextureFormat::R32Uint,
        Format::Rg32Uint => TextureFormat::Rg32Uint,
        Format::Rgba32Uint => TextureFormat::Rgba32Uint,
        Format::Depth32Float => TextureFormat::Depth32Float,
    }
}

/// Bytes of a texel in memory.
pub fn texel_bytes(format: Format) -> u32 {
    match format {
        Format::R8Unorm => 1,
        Format::R16Float => 2,
        Format::Rgba8Unorm | Format::Rgba8UnormSrgb | Format::Rg16Float | Format::R32Float | Format::R32Uint | Format::Depth32Float => 4,
        Format::Rgba16Float | Format::Rg32Float | Format::Rg32Uint => 8,
        Format::Rgba32Float | Format::Rgba32Uint => 16,
    }
}

/// Numbers in a texel.
pub fn channels(format: Format) -> u32 {
    match format {
        Format::R8Unorm | Format::R16Float | Format::R32Float | Format::R32Uint | Format::Depth32Float => 1,
        Format::Rg16Float | Format::Rg32Float | Format::Rg32Uint => 2,
        Format::Rgba8Unorm | Format::Rgba8UnormSrgb | Format::Rgba16Float | Format::Rgba32Float | Format::Rgba32Uint => 4,
    }
}

/// Width and height of a mip level.
pub fn mip_size(width: u32, height: u32, mip: u32) -> (u32, u32) {
    let shrink = |size: u32| size.checked_shr(mip).unwrap_or(0).max(1);
    (shrink(width), shrink(height))
}

/// Bytes that a resource takes, without the driver's padding.
pub fn byte_size(desc: &ResourceDesc) -> u64 {
    match *desc {
        ResourceDesc::Texture { format, width, height, layers, mips, .. } => {
            let level = |mip| {
                let (w, h) = mip_size(width, height, mip);
                u64::from(w) * u64::from(h)
            };
            let texels: u64 = (0..mips).map(level).sum();
            texels * u64::from(layers) * u64::from(texel_bytes(format))
        }
        ResourceDesc::Buffer { stride, count, .. } => buffer_bytes(stride, count),
        ResourceDesc::Uniform { size, .. } => u64::from(size.max(4)).next_multiple_of(4),
    }
}

/// Bytes of a storage buffer: at least one element, and a multiple of the copy alignment.
pub(crate) fn buffer_bytes(stride: u32, count: u64) -> u64 {
    u64::from(stride.max(4)).saturating_mul(count.max(1)).checked_next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT).unwrap_or(u64::MAX - 3)
}

/// A resource's description for messages (`R32Float 512×512, 10 mips`).
pub fn describe(desc: &ResourceDesc) -> String {
    match desc {
        ResourceDesc::Texture { format, width, height, layers, array, mips, .. } => {
            let mut text = format!("{format:?} {width}×{height}");
            if *array || *layers > 1 {
                text += &format!(", {layers} layers");
            }
            if *mips > 1 {
                text += &format!(", {mips} mips");
            }
            text
        }
        ResourceDesc::Buffer { element, stride, count } => {
            format!("a buffer of {count} {element} ({stride} bytes each)")
        }
        ResourceDesc::Uniform { element, size } => format!("a uniform {element} of {size} bytes"),
    }
}

#[cfg(test)]
mod tests {
    use manylight_graph::value::Encoding;

    use super::*;

    #[test]
    fn mip_chains_are_summed_down_to_one_texel() {
        let desc = ResourceDesc::Texture {
            format: Format::R32Float,
            width: 4,
            height: 2,
            layers: 1,
            array: false,
            mips: 3,
            encoding: Encoding::Plain,
        };
        assert_eq!(byte_size(&desc), (8 + 2 + 1) * 4);
    }

    #[test]
    fn buffer_sizes_do_not_overflow() {
        assert_eq!(buffer_bytes(16, 0), 16);
        assert_eq!(buffer_bytes(1, 3), 12);
        assert!(buffer_bytes(u32::MAX, u64::MAX) > u64::from(u32::MAX));
    }
}
