//! Scene and frame data that the caller owns and the graph reads by name.

use std::collections::BTreeMap;

use manylight_graph::value::{Encoding, Format, ResourceDesc};

use crate::{
    device::Gpu,
    error::Fault,
    format::{buffer_bytes, byte_size, describe, mip_size, texel_bytes, texture_format},
    limits::check_resource,
    pool::Memory,
};

/// Named buffers and textures. Setting one again writes into the same memory where it fits; where it does not, the memory is
/// replaced and a running frame binds the new one by itself.
#[derive(Debug, Default)]
pub struct Externals {
    entries: BTreeMap<String, Entry>,
    stamp: u64,
}

#[derive(Debug)]
struct Entry {
    desc: ResourceDesc,
    memory: Memory,
    stamp: u64,
}

/// The texels of an array of equally large textures.
#[derive(Debug, Clone, Copy)]
pub struct TextureArray<'a> {
    /// Format of the texels.
    pub format: Format,
    /// Width of level 0.
    pub width: u32,
    /// Height of level 0.
    pub height: u32,
    /// Mip levels that every layer has.
    pub mips: u32,
    /// The layers: all mip levels one after another, rows tightly packed. Without layers, one zeroed layer stands in.
    pub layers: &'a [&'a [u8]],
}

impl Externals {
    /// None at all.
    pub fn new() -> Self {
        Self::default()
    }

    /// Sets a uniform structure of the named WGSL type.
    pub fn set_uniform(&mut self, gpu: &Gpu, name: &str, element: &str, bytes: &[u8]) -> Result<(), Fault> {
        let size = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        let desc = ResourceDesc::Uniform { element: element.to_owned(), size };
        self.set_bytes(gpu, name, desc, bytes)
    }

    /// Sets a storage buffer of elements of the named WGSL type, `stride` bytes each. Without bytes, one zeroed element stands in.
    pub fn set_buffer(&mut self, gpu: &Gpu, name: &str, element: &str, stride: u32, bytes: &[u8]) -> Result<(), Fault> {
        let count = (bytes.len() as u64 / u64::from(stride.max(1))).max(1);
        let desc = ResourceDesc::Buffer { element: element.to_owned(), stride, count };
        self.set_bytes(gpu, name, desc, bytes)
    }

    fn set_bytes(&mut self, gpu: &Gpu, name: &str, desc: ResourceDesc, bytes: &[u8]) -> Result<(), Fault> {
        let size = byte_size(&desc);
        let fits = self.entries.get(name).and_then(|e| e.memory.buffer()).filter(|b| b.size() == size && b.usage() == usages(&desc));
        let buffer = match fits {
            Some(buffer) => buffer.clone(),
            None => {
                let subject = format!("external `{name}`");
                check_resource(gpu.limits(), &subject, &desc)?;
                let make = || {
                    gpu.device().create_buffer(&wgpu::BufferDescriptor {
                        label: Some(name),
                        size,
                        usage: usages(&desc),
                        mapped_at_creation: false,
                    })
                };
                gpu.scoped(make).map_err(|message| Fault::Resource { resource: subject, message })?
            }
        };
        write_padded(gpu, &buffer, bytes);
        self.insert(name, desc, Memory::Buffer(buffer));
        Ok(())
    }

    /// Sets an array of textures (`texture_2d_array` in shaders).
    pub fn set_texture_array(&mut self, gpu: &Gpu, name: &str, data: TextureArray<'_>) -> Result<(), Fault> {
        let TextureArray { format, width, height, mips, layers } = data;
        let count = u32::try_from(layers.len()).unwrap_or(u32::MAX).max(1);
        let desc = ResourceDesc::Texture {
            format,
            width: width.max(1),
            height: height.max(1),
            layers: count,
            array: true,
            mips: mips.max(1),
            encoding: Encoding::Plain,
        };
        let subject = format!("external `{name}`");
        let per_layer = byte_size(&desc) / u64::from(count);
        for (i, layer) in layers.iter().enumerate() {
            if layer.len() as u64 != per_layer {
                let message = format!("layer {i} has {} bytes, but {} needs {per_layer} a layer", layer.len(), describe(&desc));
                return Err(Fault::Resource { resource: subject, message });
            }
        }
        let same = self.entries.get(name).filter(|e| e.desc == desc).and_then(|e| e.memory.texture());
        let texture = match same {
            Some(texture) => texture.clone(),
            None => {
                check_resource(gpu.limits(), &subject, &desc)?;
                let make = || gpu.device().create_texture(&texture_descriptor(name, &desc, format));
                gpu.scoped(make).map_err(|message| Fault::Resource { resource: subject, message })?
            }
        };
        for (layer, bytes) in (0..).zip(layers) {
            write_layer(gpu, &texture, format, layer, bytes);
        }
        self.insert(name, desc, Memory::Texture(texture));
        Ok(())
    }

    /// Gives memory made elsewhere; the caller answers for its usages (`UNIFORM`, `STORAGE` or `TEXTURE_BINDING`).
    pub fn insert(&mut self, name: &str, desc: ResourceDesc, memory: Memory) {
        self.stamp += 1;
        let stamp = self.stamp;
        match self.entries.get_mut(name) {
            Some(entry) => *entry = Entry { desc, memory, stamp },
            None => {
                self.entries.insert(name.to_owned(), Entry { desc, memory, stamp });
            }
        }
    }

    /// Takes one away.
    pub fn remove(&mut self, name: &str) {
        self.entries.remove(name);
    }

    /// Memory of one.
    pub fn memory(&self, name: &str) -> Option<&Memory> {
        self.entries.get(name).map(|e| &e.memory)
    }

    /// Description of one.
    pub fn desc(&self, name: &str) -> Option<&ResourceDesc> {
        self.entries.get(name).map(|e| &e.desc)
    }

    /// A number that grows whenever that external is set; 0 when it is not there.
    pub fn stamp(&self, name: &str) -> u64 {
        self.entries.get(name).map_or(0, |e| e.stamp)
    }

    /// Descriptions of all, for [`manylight_graph::plan::PlanInput::externals`].
    pub fn descs(&self) -> BTreeMap<String, ResourceDesc> {
        self.entries.iter().map(|(name, e)| (name.clone(), e.desc.clone())).collect()
    }

    /// Bytes they take.
    pub fn bytes(&self) -> u64 {
        self.entries.values().map(|e| byte_size(&e.desc)).sum()
    }
}

fn usages(desc: &ResourceDesc) -> wgpu::BufferUsages {
    use wgpu::BufferUsages as U;
    let kind = match desc {
        ResourceDesc::Uniform { .. } => U::UNIFORM,
        // It may say how many workgroups run.
        ResourceDesc::Buffer { element, .. } if matches!(element.as_str(), "vec3u" | "vec4u") => U::STORAGE | U::INDIRECT,
        _ => U::STORAGE,
    };
    kind | U::COPY_DST | U::COPY_SRC
}

/// Writes bytes whose number need not be a multiple of the copy alignment.
pub(crate) fn write_padded(gpu: &Gpu, buffer: &wgpu::Buffer, bytes: &[u8]) {
    let whole = bytes.len() / 4 * 4;
    let (body, tail) = bytes.split_at(whole);
    if !body.is_empty() {
        gpu.queue().write_buffer(buffer, 0, body);
    }
    if !tail.is_empty() && buffer_bytes(4, (whole as u64 + 4) / 4) <= buffer.size() {
        let mut last = [0; 4];
        last[..tail.len()].copy_from_slice(tail);
        gpu.queue().write_buffer(buffer, whole as u64, &last);
    }
}

fn texture_descriptor<'a>(name: &'a str, desc: &ResourceDesc, format: Format) -> wgpu::TextureDescriptor<'a> {
    let (width, height, layers, mips) = match *desc {
        ResourceDesc::Texture { width, height, layers, mips, .. } => (width, height, layers, mips),
        _ => (1, 1, 1, 1),
    };
    wgpu::TextureDescriptor {
        label: Some(name),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
        mip_level_count: mips,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: texture_format(format),
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    }
}

fn write_layer(gpu: &Gpu, texture: &wgpu::Texture, format: Format, layer: u32, bytes: &[u8]) {
    let mut rest = bytes;
    for mip in 0..texture.mip_level_count() {
        let (width, height) = mip_size(texture.width(), texture.height(), mip);
        let row = width * texel_bytes(format);
        let (level, after) = rest.split_at(row as usize * height as usize);
        rest = after;
        let to = wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: mip,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        };
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(height) };
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        gpu.queue().write_texture(to, level, layout, size);
    }
}
