//! Memory of a frame's resources: pool slots shared by transients, kept resources, histories and host outputs.

use manylight_graph::{
    plan::{Lifetime, Plan, Usage},
    value::{Format, ResourceDesc},
};

use crate::{
    device::Gpu,
    error::Fault,
    format::{buffer_bytes, byte_size, describe, mip_size, texture_format},
    limits::{check_planned, out_of_memory},
};

/// Memory of a resource.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Memory {
    /// A texture.
    Texture(wgpu::Texture),
    /// A storage or uniform buffer.
    Buffer(wgpu::Buffer),
}

impl Memory {
    /// The texture, if it is one.
    pub fn texture(&self) -> Option<&wgpu::Texture> {
        match self {
            Self::Texture(texture) => Some(texture),
            Self::Buffer(_) => None,
        }
    }

    /// The buffer, if it is one.
    pub fn buffer(&self) -> Option<&wgpu::Buffer> {
        match self {
            Self::Buffer(buffer) => Some(buffer),
            Self::Texture(_) => None,
        }
    }
}

/// What memory must look like: resources that agree in this can share it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Shape {
    texture: Option<(Format, u32, u32, u32, u32)>,
    bytes: u64,
    usage: Usage,
}

impl Shape {
    fn of(desc: &ResourceDesc, usage: Usage) -> Self {
        let texture = match *desc {
            ResourceDesc::Texture { format, width, height, layers, mips, .. } => Some((format, width, height, layers, mips)),
            _ => None,
        };
        // Buffers have all usages but one at once, and every texture can be read.
        let usage = match texture {
            Some((format, ..)) => {
                Usage { read: true, storage: usage.storage, target: usage.target || format == Format::Depth32Float, indirect: false }
            }
            None => Usage { indirect: usage.indirect, ..Usage::default() },
        };
        Self { texture, bytes: byte_size(desc), usage }
    }
}

/// One piece of memory and what it is good for.
#[derive(Debug, Clone)]
pub(crate) struct Allocation {
    shape: Shape,
    pub(crate) memory: Memory,
}

/// Where a resource of the frame lives.
#[derive(Debug, Clone)]
pub(crate) enum Place {
    /// In [`crate::externals::Externals`].
    External,
    /// In a slot of the pool.
    Pool { slot: usize, at: Allocation },
    /// Alone, read after the frame.
    Kept(Allocation),
    /// Alone, written by a host node whenever its inputs change.
    Host(Allocation),
    /// Two copies that swap each frame.
    History([Allocation; 2]),
}

/// A resource of the plan with its memory.
#[derive(Debug, Clone)]
pub(crate) struct Resource {
    pub(crate) name: String,
    pub(crate) desc: ResourceDesc,
    pub(crate) place: Place,
}

impl Resource {
    /// Memory of this frame's value when the frame's parity is `parity`; `None` for externals.
    pub(crate) fn memory(&self, parity: usize) -> Option<&Memory> {
        match &self.place {
            Place::External => None,
            Place::Pool { at, .. } | Place::Kept(at) | Place::Host(at) => Some(&at.memory),
            Place::History(copies) => Some(&copies[parity & 1].memory),
        }
    }

    /// Whether poison may be written before its first use.
    pub(crate) fn can_be_poisoned(&self) -> bool {
        matches!(self.place, Place::Pool { .. } | Place::Kept(_))
    }
}

/// All resources of a plan, in its order, and what became of the histories.
pub(crate) struct Allocated {
    pub(crate) resources: Vec<Resource>,
    pub(crate) history_kept: Vec<String>,
    pub(crate) history_reset: Vec<String>,
}

/// Allocates what `plan` needs. Memory of the previous frame is taken over where it fits: histories and kept resources by
/// name, transients by shape.
pub(crate) fn allocate(
    gpu: &Gpu,
    plan: &Plan,
    usage: &[Usage],
    host_outputs: &[bool],
    previous: Option<&[Resource]>,
) -> Result<Allocated, Vec<Fault>> {
    let mut faults = Vec::new();
    for r in plan.resources.iter().filter(|r| r.lifetime != Lifetime::External) {
        if let Err(fault) = check_planned(gpu.limits(), plan, r) {
            faults.push(Fault::Limit(fault));
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let mut state = State {
        gpu,
        previous: previous.unwrap_or_default(),
        slots: slot_usage(plan, usage, host_outputs),
        made: vec![None; plan.slots],
        taken: Vec::new(),
    };
    let mut out = Allocated { resources: Vec::new(), history_kept: Vec::new(), history_reset: Vec::new() };
    for (ix, r) in plan.resources.iter().enumerate() {
        let shape = Shape::of(&r.desc, usage[ix]);
        let place = match r.lifetime {
            Lifetime::External => Ok(Place::External),
            Lifetime::History => state.history(&r.name, &r.desc, shape, &mut out),
            _ if host_outputs[ix] => {
                let old = state.by_name(&r.name, |p| match p {
                    Place::Host(at) => Some(at),
                    _ => None,
                });
                state.reuse_or_make(&r.name, &r.desc, shape, old).map(Place::Host)
            }
            Lifetime::Kept => {
                let old = state.by_name(&r.name, |p| match p {
                    Place::Kept(at) => Some(at),
                    _ => None,
                });
                state.reuse_or_make(&r.name, &r.desc, shape, old).map(Place::Kept)
            }
            Lifetime::Transient { slot, .. } => state.transient(&r.name, &r.desc, slot).map(|at| Place::Pool { slot, at }),
        };
        match place {
            Ok(place) => out.resources.push(Resource { name: r.name.clone(), desc: r.desc.clone(), place }),
            Err(fault) => faults.push(out_of_memory(plan, fault)),
        }
    }
    if faults.is_empty() { Ok(out) } else { Err(faults) }
}

/// The usages of all transients of a slot together.
fn slot_usage(plan: &Plan, usage: &[Usage], host_outputs: &[bool]) -> Vec<Usage> {
    let mut slots = vec![Usage::default(); plan.slots];
    for (ix, r) in plan.resources.iter().enumerate() {
        if let Lifetime::Transient { slot, .. } = r.lifetime
            && !host_outputs[ix]
            && let Some(all) = slots.get_mut(slot)
        {
            all.read |= usage[ix].read;
            all.storage |= usage[ix].storage;
            all.target |= usage[ix].target;
            all.indirect |= usage[ix].indirect;
        }
    }
    slots
}

struct State<'a> {
    gpu: &'a Gpu,
    previous: &'a [Resource],
    slots: Vec<Usage>,
    made: Vec<Option<Allocation>>,
    /// Slots of the previous frame that a slot of this one has taken over.
    taken: Vec<usize>,
}

impl<'a> State<'a> {
    fn by_name(&self, name: &str, of: impl Fn(&'a Place) -> Option<&'a Allocation>) -> Option<&'a Allocation> {
        self.previous.iter().find(|r| r.name == name).and_then(|r| of(&r.place))
    }

    fn reuse_or_make(&self, name: &str, desc: &ResourceDesc, shape: Shape, old: Option<&Allocation>) -> Result<Allocation, Fault> {
        match old {
            Some(old) if old.shape == shape => Ok(old.clone()),
            _ => make(self.gpu, name, desc, shape),
        }
    }

    fn history(&self, name: &str, desc: &ResourceDesc, shape: Shape, out: &mut Allocated) -> Result<Place, Fault> {
        let old = self.previous.iter().find(|r| r.name == name && same_but_for_count(&r.desc, desc));
        let Some(Place::History(copies)) = old.map(|r| &r.place) else {
            out.history_reset.push(name.to_owned());
            let zeroed = || make(self.gpu, name, desc, shape);
            return Ok(Place::History([zeroed()?, zeroed()?]));
        };
        out.history_kept.push(name.to_owned());
        if copies[0].shape == shape {
            return Ok(Place::History(copies.clone()));
        }
        // A buffer of another length, or a new producer writes it in another way: the contents move to new memory.
        let moved = |from: &Allocation| {
            let to = make(self.gpu, name, desc, shape)?;
            let copied = self.gpu.scoped(|| {
                let mut encoder = self.gpu.device().create_command_encoder(&Default::default());
                copy(&mut encoder, &from.memory, &to.memory);
                self.gpu.queue().submit([encoder.finish()]);
            });
            copied.map_err(|message| Fault::Resource { resource: format!("resource `{name}` ({})", describe(desc)), message })?;
            Ok::<_, Fault>(to)
        };
        Ok(Place::History([moved(&copies[0])?, moved(&copies[1])?]))
    }

    fn transient(&mut self, name: &str, desc: &ResourceDesc, slot: usize) -> Result<Allocation, Fault> {
        if self.made.len() <= slot {
            self.made.resize(slot + 1, None);
            self.slots.resize(slot + 1, Usage::default());
        }
        let shape = Shape::of(desc, self.slots[slot]);
        if let Some(made) = &self.made[slot]
            && made.shape == shape
        {
            return Ok(made.clone());
        }
        let old = self.previous.iter().find_map(|r| match &r.place {
            Place::Pool { slot, at } if at.shape == shape && !self.taken.contains(slot) => Some((*slot, at.clone())),
            _ => None,
        });
        let allocation = match old {
            Some((old, at)) => {
                self.taken.push(old);
                at
            }
            None => make(self.gpu, &format!("slot {slot}: {name}"), desc, shape)?,
        };
        self.made[slot] = Some(allocation.clone());
        Ok(allocation)
    }
}

fn make(gpu: &Gpu, label: &str, desc: &ResourceDesc, shape: Shape) -> Result<Allocation, Fault> {
    let made = gpu.scoped(|| match *desc {
        ResourceDesc::Texture { format, width, height, layers, mips, .. } => {
            Memory::Texture(gpu.device().create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: layers },
                mip_level_count: mips,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: texture_format(format),
                usage: texture_usages(format, shape.usage),
                view_formats: &[],
            }))
        }
        ResourceDesc::Buffer { .. } | ResourceDesc::Uniform { .. } => Memory::Buffer(gpu.device().create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: shape.bytes,
            usage: buffer_usages(shape.usage),
            mapped_at_creation: false,
        })),
    });
    let memory = made.map_err(|message| Fault::Resource { resource: format!("resource `{label}` ({})", describe(desc)), message })?;
    Ok(Allocation { shape, memory })
}

/// Whether one description is the other, or that of a longer or shorter buffer of the same elements.
fn same_but_for_count(a: &ResourceDesc, b: &ResourceDesc) -> bool {
    match (a, b) {
        (ResourceDesc::Buffer { element: a, stride: x, .. }, ResourceDesc::Buffer { element: b, stride: y, .. }) => a == b && x == y,
        _ => a == b,
    }
}

/// Copies a texture with all levels and layers into another of the same shape, or of a buffer what has room in another.
pub(crate) fn copy(encoder: &mut wgpu::CommandEncoder, from: &Memory, to: &Memory) {
    match (from, to) {
        (Memory::Texture(from), Memory::Texture(to)) => {
            for mip_level in 0..from.mip_level_count() {
                let (width, height) = mip_size(from.width(), from.height(), mip_level);
                let size = wgpu::Extent3d { width, height, depth_or_array_layers: from.depth_or_array_layers() };
                let (origin, aspect) = (wgpu::Origin3d::ZERO, wgpu::TextureAspect::All);
                let level = |texture| wgpu::TexelCopyTextureInfo { texture, mip_level, origin, aspect };
                encoder.copy_texture_to_texture(level(from), level(to), size);
            }
        }
        (Memory::Buffer(from), Memory::Buffer(to)) => encoder.copy_buffer_to_buffer(from, 0, to, 0, from.size().min(to.size())),
        _ => {}
    }
}

fn texture_usages(format: Format, usage: Usage) -> wgpu::TextureUsages {
    use wgpu::TextureUsages as U;
    let mut all = U::TEXTURE_BINDING | U::COPY_SRC;
    all |= if format == Format::Depth32Float { U::RENDER_ATTACHMENT } else { U::COPY_DST };
    if usage.storage {
        all |= U::STORAGE_BINDING;
    }
    if usage.target {
        all |= U::RENDER_ATTACHMENT;
    }
    all
}

fn buffer_usages(usage: Usage) -> wgpu::BufferUsages {
    use wgpu::BufferUsages as U;
    let indirect = if usage.indirect { U::INDIRECT } else { U::empty() };
    U::STORAGE | U::COPY_SRC | U::COPY_DST | indirect
}

/// A zeroed stand-in for a port that is connected to nothing.
pub(crate) fn placeholder_texture(gpu: &Gpu, format: wgpu::TextureFormat, storage: bool) -> wgpu::Texture {
    use wgpu::TextureUsages as U;
    let usage = if storage { U::STORAGE_BINDING } else { U::TEXTURE_BINDING };
    gpu.device().create_texture(&wgpu::TextureDescriptor {
        label: Some("absent"),
        size: wgpu::Extent3d::default(),
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// A buffer of one zeroed element, for the same purpose.
pub(crate) fn placeholder_buffer(gpu: &Gpu, bytes: u32, uniform: bool) -> wgpu::Buffer {
    let usage = if uniform { wgpu::BufferUsages::UNIFORM } else { wgpu::BufferUsages::STORAGE };
    let size = buffer_bytes(bytes, 1).next_multiple_of(16);
    gpu.device().create_buffer(&wgpu::BufferDescriptor { label: Some("absent"), size, usage, mapped_at_creation: false })
}
