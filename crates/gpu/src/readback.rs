//! Resources of a frame on the host: textures as floats, buffers as bytes or JSON. These functions wait for the GPU.

use std::{collections::BTreeMap, sync::mpsc, time::Duration};

use manylight_graph::{
    plan::{Plan, Target},
    shader::Layout,
    value::{Encoding, Format, ResourceDesc},
};

use crate::{
    decode::{decode_texel, elements_to_json},
    device::Gpu,
    error::{ReadError, lost},
    externals::Externals,
    format::{channels, describe, mip_size, texel_bytes},
    frame::Frame,
    pool::Memory,
};

/// No thread takes longer to tell another that its buffer is mapped, unless the device is lost.
const TELLING: Duration = Duration::from_secs(10);

/// A picture of 32-bit floats, rows from top to bottom, channels interleaved.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Numbers a pixel: 1, 2, 3 or 4.
    pub channels: u32,
    /// `width * height * channels` numbers. Unsigned integers are given as floats, sRGB is decoded to linear.
    pub data: Vec<f32>,
}

impl Image {
    /// The numbers of a pixel. Panics when it is outside.
    pub fn pixel(&self, x: u32, y: u32) -> &[f32] {
        assert!(x < self.width && y < self.height, "pixel {x}, {y} of {}×{}", self.width, self.height);
        let at = (y as usize * self.width as usize + x as usize) * self.channels as usize;
        &self.data[at..at + self.channels as usize]
    }
}

/// Which part of a texture to read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Subresource {
    /// Mip level.
    pub mip: u32,
    /// Array layer.
    pub layer: u32,
}

impl Frame {
    /// Reads a texture of the plan as the latest frame left it; externals are looked up in `externals`.
    pub fn read_image(&self, gpu: &Gpu, externals: &Externals, name: &str, part: Subresource) -> Result<Image, ReadError> {
        let (memory, desc) = self.find(externals, name)?;
        read_image(gpu, name, memory, desc, part)
    }

    /// Reads the bytes of a buffer of the plan, without padding.
    pub fn read_bytes(&self, gpu: &Gpu, externals: &Externals, name: &str) -> Result<Vec<u8>, ReadError> {
        let (memory, desc) = self.find(externals, name)?;
        read_bytes(gpu, name, memory, desc)
    }

    /// Reads a buffer of the plan as JSON: an array of its elements, with the field names of the shaders' structure (one object
    /// for a uniform). Numbers that JSON lacks are the texts `NaN`, `inf` and `-inf`.
    pub fn read_json(&self, gpu: &Gpu, externals: &Externals, name: &str) -> Result<serde_json::Value, ReadError> {
        let (memory, desc) = self.find(externals, name)?;
        let bytes = read_bytes(gpu, name, memory, desc)?;
        let (element, stride) = match desc {
            ResourceDesc::Buffer { element, stride, .. } => (element, *stride),
            ResourceDesc::Uniform { element, size } => (element, *size),
            ResourceDesc::Texture { .. } => return Err(kind(name, "a buffer", desc)),
        };
        let layouts =
            layouts_for(&self.plan, name, element).ok_or_else(|| ReadError::Layout { name: name.to_owned(), element: element.clone() })?;
        let mut elements = elements_to_json(&bytes, element, stride, layouts);
        if matches!(desc, ResourceDesc::Uniform { .. }) && elements.len() == 1 {
            return Ok(elements.remove(0));
        }
        Ok(serde_json::Value::Array(elements))
    }

    fn find<'a>(&'a self, externals: &'a Externals, name: &str) -> Result<(&'a Memory, &'a ResourceDesc), ReadError> {
        if let (Some(memory), Some(ix)) = (self.memory(name), self.plan.resource(name)) {
            return Ok((memory, &self.plan.resources[ix].desc));
        }
        let external = externals.memory(name).zip(externals.desc(name));
        external.ok_or_else(|| ReadError::Unknown(name.to_owned()))
    }
}

/// The layouts of a shader that knows `element`; one that binds the resource is preferred, for names may stand for different
/// structures in different shaders.
pub(crate) fn layouts_for<'a>(plan: &'a Plan, name: &str, element: &str) -> Option<&'a BTreeMap<String, Layout>> {
    let resource = plan.resource(name);
    let knows = plan.nodes.iter().filter_map(|node| {
        let layouts = &node.decl.shader.as_ref()?.layouts;
        let binds = node.bindings.iter().any(|(_, target)| match target {
            Target::Resource(ix) | Target::Previous(ix) => Some(*ix) == resource,
            Target::Absent => false,
        });
        layouts.contains_key(element).then_some((!binds, layouts))
    });
    knows.min_by_key(|(stranger, _)| *stranger).map(|(_, layouts)| layouts)
}

fn kind(name: &str, expected: &'static str, desc: &ResourceDesc) -> ReadError {
    ReadError::Kind { name: name.to_owned(), expected, actual: describe(desc) }
}

fn failed(name: &str, message: impl Into<String>) -> ReadError {
    ReadError::Gpu { name: name.to_owned(), message: message.into() }
}

/// Reads one level and layer of a texture.
pub fn read_image(gpu: &Gpu, name: &str, memory: &Memory, desc: &ResourceDesc, part: Subresource) -> Result<Image, ReadError> {
    let &ResourceDesc::Texture { format, width, height, layers, mips, encoding, .. } = desc else {
        return Err(kind(name, "a texture", desc));
    };
    let Memory::Texture(texture) = memory else {
        return Err(kind(name, "a texture", desc));
    };
    let Subresource { mip, layer } = part;
    if mip >= mips || layer >= layers {
        return Err(ReadError::Subresource { name: name.to_owned(), mips, layers, mip, layer });
    }
    let (width, height) = mip_size(width, height, mip);
    let row = width * texel_bytes(format);
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let bytes = fetch(gpu, name, u64::from(padded) * u64::from(height), |encoder, to| {
        let from = wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: mip,
            origin: wgpu::Origin3d { x: 0, y: 0, z: layer },
            aspect: wgpu::TextureAspect::All,
        };
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: Some(height) };
        let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
        encoder.copy_texture_to_buffer(from, wgpu::TexelCopyBufferInfo { buffer: to, layout }, size);
    })?;
    let channels = match (encoding, format) {
        (Encoding::Octahedral, Format::R32Uint) => 3,
        _ => channels(format),
    };
    let mut data = Vec::with_capacity(width as usize * height as usize * channels as usize);
    for line in bytes.chunks_exact(padded as usize) {
        for texel in line[..row as usize].chunks_exact(texel_bytes(format) as usize) {
            decode_texel(format, encoding, texel, &mut data);
        }
    }
    Ok(Image { width, height, channels, data })
}

/// Reads a buffer without its padding.
pub fn read_bytes(gpu: &Gpu, name: &str, memory: &Memory, desc: &ResourceDesc) -> Result<Vec<u8>, ReadError> {
    let Memory::Buffer(buffer) = memory else {
        return Err(kind(name, "a buffer", desc));
    };
    let length = match desc {
        ResourceDesc::Buffer { stride, count, .. } => u64::from(*stride) * count,
        ResourceDesc::Uniform { size, .. } => u64::from(*size),
        ResourceDesc::Texture { .. } => return Err(kind(name, "a buffer", desc)),
    };
    let size = buffer.size();
    let mut bytes = fetch(gpu, name, size, |encoder, to| {
        encoder.copy_buffer_to_buffer(buffer, 0, to, 0, size);
    })?;
    bytes.truncate(usize::try_from(length).unwrap_or(usize::MAX));
    Ok(bytes)
}

/// Copies into a buffer of `size` bytes, waits and returns them.
fn fetch(gpu: &Gpu, name: &str, size: u64, copy: impl FnOnce(&mut wgpu::CommandEncoder, &wgpu::Buffer)) -> Result<Vec<u8>, ReadError> {
    if let Some(reason) = gpu.lost() {
        return Err(failed(name, lost(&reason)));
    }
    if size > gpu.limits().max_buffer_size {
        return Err(failed(
            name,
            format!("it needs a buffer of {size} bytes, but this GPU allows {} (max_buffer_size)", gpu.limits().max_buffer_size),
        ));
    }
    let copied = gpu.scoped(|| {
        let buffer = gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size,
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        copy(&mut encoder, &buffer);
        gpu.queue().submit([encoder.finish()]);
        buffer
    });
    let buffer = copied.map_err(|message| failed(name, message))?;
    let (tell, told) = mpsc::channel();
    buffer.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver is gone only when the wait below failed.
        let _ = tell.send(result);
    });
    gpu.wait();
    // The work is done; where several threads wait on one device, another may still be on its way to tell.
    match told.recv_timeout(TELLING) {
        Ok(Ok(())) => {}
        _ => {
            let reason = gpu.lost().map_or_else(|| "the buffer could not be mapped".to_owned(), |reason| lost(&reason));
            return Err(failed(name, reason));
        }
    }
    let view = buffer.get_mapped_range(..).map_err(|e| failed(name, e.to_string()))?;
    Ok(view.to_vec())
}
