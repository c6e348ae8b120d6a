//! Debug switch: memory that a node is about to fill is filled with NaN first, so that reading what nobody wrote shows.

use manylight_graph::value::{Format, ResourceDesc};

use crate::{
    bind::view,
    device::Gpu,
    format::{byte_size, mip_size, texel_bytes},
    pool::{Memory, Resource},
};

/// NaN as one 32-bit float and as two 16-bit floats; as a whole number, an index beyond everything.
const WORD: u32 = 0x7fff_7fff;

/// Depth attachments cannot hold NaN (the clear value must lie in 0..=1): a depth in the middle of nowhere.
const DEPTH: f32 = 0.5;

/// A buffer full of poison, as large as the largest resource to be filled.
pub(crate) struct Poison {
    buffer: wgpu::Buffer,
}

/// What to fill, worked out when the frame is built.
pub(crate) enum Fill {
    Buffer(wgpu::Buffer),
    /// Texture, mip level, size of the level with its layers, and bytes of a padded row.
    Level(wgpu::Texture, u32, wgpu::Extent3d, u32),
    Depth(wgpu::TextureView),
}

fn padded_row(format: Format, width: u32) -> u32 {
    (width * texel_bytes(format)).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

impl Poison {
    /// Large enough for all resources that can be poisoned; `None` when there is none.
    pub(crate) fn new(gpu: &Gpu, resources: &[Resource]) -> Result<Option<Self>, String> {
        let need = |r: &Resource| match r.desc {
            ResourceDesc::Texture { format, width, height, layers, .. } => {
                u64::from(padded_row(format, width)) * u64::from(height) * u64::from(layers)
            }
            _ => byte_size(&r.desc),
        };
        let poisonable = resources.iter().filter(|r| r.can_be_poisoned());
        let Some(size) = poisonable.map(need).max() else {
            return Ok(None);
        };
        if size > gpu.limits().max_buffer_size {
            return Err(format!(
                "poison needs a buffer of {size} bytes, but this GPU allows {} (max_buffer_size)",
                gpu.limits().max_buffer_size
            ));
        }
        let buffer = gpu.scoped(|| {
            gpu.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some("poison"),
                size: size.next_multiple_of(4),
                usage: wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })?;
        let words: Vec<u8> = WORD.to_le_bytes().repeat((1 << 20) / 4);
        let mut at = 0;
        while at < buffer.size() {
            let part = (buffer.size() - at).min(words.len() as u64);
            gpu.queue().write_buffer(&buffer, at, &words[..part as usize]);
            at += part;
        }
        Ok(Some(Self { buffer }))
    }

    /// Fills one.
    pub(crate) fn fill(&self, encoder: &mut wgpu::CommandEncoder, fill: &Fill) {
        match fill {
            Fill::Buffer(to) => {
                encoder.copy_buffer_to_buffer(&self.buffer, 0, to, 0, to.size());
            }
            Fill::Level(texture, mip_level, size, row) => {
                let from = wgpu::TexelCopyBufferInfo {
                    buffer: &self.buffer,
                    layout: wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(*row), rows_per_image: Some(size.height) },
                };
                let to = wgpu::TexelCopyTextureInfo {
                    texture,
                    mip_level: *mip_level,
                    origin: wgpu::Origin3d::ZERO,
                    aspect: wgpu::TextureAspect::All,
                };
                encoder.copy_buffer_to_texture(from, to, *size);
            }
            Fill::Depth(view) => {
                encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("poison"),
                    depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                        view,
                        depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(DEPTH), store: wgpu::StoreOp::Store }),
                        stencil_ops: None,
                    }),
                    ..Default::default()
                });
            }
        }
    }
}

/// What must be filled to poison a resource.
pub(crate) fn fills(resource: &Resource) -> Vec<Fill> {
    match (resource.memory(0), &resource.desc) {
        (Some(Memory::Buffer(buffer)), _) => vec![Fill::Buffer(buffer.clone())],
        (Some(Memory::Texture(texture)), ResourceDesc::Texture { format, width, height, layers, mips, .. }) => {
            let level = |mip| {
                let (width, height) = mip_size(*width, *height, mip);
                if *format == Format::Depth32Float {
                    return Fill::Depth(view(texture, false, Some(mip)));
                }
                let size = wgpu::Extent3d { width, height, depth_or_array_layers: *layers };
                Fill::Level(texture.clone(), mip, size, padded_row(*format, width))
            };
            (0..*mips).map(level).collect()
        }
        _ => Vec::new(),
    }
}
