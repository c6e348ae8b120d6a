//! Debug switch: after each node every number that it wrote is looked at on the GPU. What is NaN, infinite or beyond what the port promises is
//! counted, and its first place kept.

use std::{collections::BTreeMap, fmt};

use manylight_graph::{
    plan::{Plan, PlanNode, Target},
    shader::{Layout, MemberKind, Scalar},
    value::{Format, ResourceDesc},
};

use crate::{
    bind::view,
    device::Gpu,
    error::{Fault, ReadError},
    format::{channels, mip_size},
    pool::{Memory, Resource},
    readback::{layouts_for, read_bytes},
    uses::is_output,
};

const SHADER: &str = include_str!("numbers.wgsl");

/// Words of a scan's settings, and from one to the next: where a uniform may start.
const SETTINGS_WORDS: usize = 8;
const SETTINGS_STRIDE: usize = 64;
/// Numbers that a scan finds: counts by kind, then first places by kind.
const FINDING_WORDS: usize = 8;
/// Workgroups of a scan of a buffer; each takes many words.
const MOST_GROUPS: u32 = 1024;

/// What is wrong with a number, in the order of `numbers.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum BadNumber {
    NotANumber,
    Infinite,
    /// Less than the port's `at_least`.
    TooSmall,
    /// More than the port's `at_most`.
    TooLarge,
}

const KINDS: [BadNumber; 4] = [BadNumber::NotANumber, BadNumber::Infinite, BadNumber::TooSmall, BadNumber::TooLarge];

/// Where a number is.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum NumberPlace {
    Texel { x: u32, y: u32, level: u32, layer: u32, channel: u32 },
    Element { index: u64, field: String },
}

impl fmt::Display for NumberPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Texel { x, y, level, layer, channel } => write!(f, "texel ({x}, {y}) of level {level}, layer {layer}, channel {channel}"),
            Self::Element { index, field } => write!(f, "element {index}{field}"),
        }
    }
}

/// Numbers of one kind in what a node wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BadNumbers {
    /// Id of the node.
    pub node: String,
    /// Its name in the registry.
    pub kind: String,
    /// The resource.
    pub resource: String,
    /// What they are.
    pub what: BadNumber,
    /// The bound that they break, where the port has one.
    pub bound: Option<String>,
    /// The first of them.
    pub place: NumberPlace,
    /// How many there are in this level and layer, or in this buffer.
    pub count: u32,
}

impl fmt::Display for BadNumbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { node, kind, resource, place, .. } = self;
        let what = match self.what {
            BadNumber::NotANumber => "is NaN",
            BadNumber::Infinite => "is infinite",
            BadNumber::TooSmall => "is less than ",
            BadNumber::TooLarge => "is more than ",
        };
        let bound = self.bound.as_deref().unwrap_or_default();
        write!(f, "node `{node}` ({kind}) writes `{resource}`: {place} {what}{bound}")?;
        match self.count {
            1 => Ok(()),
            more => write!(f, ", and so are {} numbers after it", more - 1),
        }
    }
}

/// Scans of all nodes of a frame.
pub(crate) struct Numbers {
    texels: wgpu::ComputePipeline,
    words: wgpu::ComputePipeline,
    findings: wgpu::Buffer,
    /// What `findings` is before a frame.
    nothing_found: wgpu::Buffer,
    by_node: Vec<Vec<Scan>>,
}

/// One level and layer of a texture, or a buffer, that a node writes.
struct Written {
    resource: usize,
    /// What the port promises: `at_least`, `at_most`.
    bounds: [Option<f64>; 2],
    part: Part,
}

/// How it is looked at.
struct Scan {
    resource: usize,
    bounds: [Option<f64>; 2],
    part: Part,
    /// By parity of the frame.
    bind: [wgpu::BindGroup; 2],
    groups: [u32; 2],
}

/// What is looked at.
enum Part {
    Level {
        level: u32,
        layer: u32,
        width: u32,
        height: u32,
        channels: u32,
    },
    /// Fields of an element that hold floats, by word; words an element.
    Buffer {
        fields: BTreeMap<u32, String>,
        stride: u32,
        count: u32,
    },
}

impl Numbers {
    /// Prepares the scans of everything that the nodes of a plan write.
    pub(crate) fn new(gpu: &Gpu, plan: &Plan, resources: &[Resource]) -> Result<Self, Fault> {
        use wgpu::BufferUsages as U;
        let parts: Vec<Vec<Written>> = plan.nodes.iter().map(|node| written(plan, node)).collect();
        let count = parts.iter().map(Vec::len).sum::<usize>();
        let made = gpu.scoped(|| {
            let device = gpu.device();
            let source = wgpu::ShaderSource::Wgsl(SHADER.into());
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("numbers"), source });
            let settings: Vec<u32> = parts.iter().flatten().enumerate().flat_map(|(record, part)| settings_of(part, record)).collect();
            let settings = buffer(gpu, "scans of numbers", U::UNIFORM, &settings);
            let nothing = [0, 0, 0, 0, u32::MAX, u32::MAX, u32::MAX, u32::MAX].repeat(count);
            let mut numbers = Self {
                texels: pipeline(device, &module, "look_at_texels"),
                words: pipeline(device, &module, "look_at_words"),
                findings: buffer(gpu, "numbers found", U::STORAGE | U::COPY_SRC, &nothing),
                nothing_found: buffer(gpu, "no numbers found", U::COPY_SRC, &nothing),
                by_node: Vec::new(),
            };
            let mut record = 0..;
            for parts in parts {
                let scans =
                    parts.into_iter().zip(&mut record).map(|(part, record)| numbers.prepare(gpu, &settings, resources, part, record));
                let scans = scans.collect();
                numbers.by_node.push(scans);
            }
            numbers
        });
        made.map_err(|message| Fault::Resource { resource: "the scan of numbers".to_owned(), message })
    }

    /// The scan of a part, whose settings and findings are those of a record.
    fn prepare(&self, gpu: &Gpu, settings: &wgpu::Buffer, resources: &[Resource], written: Written, record: u64) -> Scan {
        let Written { resource, bounds, part } = written;
        let size = wgpu::BufferSize::new(4 * SETTINGS_WORDS as u64);
        let own = wgpu::BufferBinding { buffer: settings, offset: 4 * SETTINGS_STRIDE as u64 * record, size };
        let is_float = part.mask().map(|mask| buffer(gpu, "words that are floats", wgpu::BufferUsages::STORAGE, &mask));
        let bind = [0, 1].map(|parity| {
            let image;
            let (pipeline, seen) = match (resources[resource].memory(parity), &is_float) {
                (Some(Memory::Buffer(buffer)), Some(is_float)) => {
                    (&self.words, vec![(3, buffer.as_entire_binding()), (4, is_float.as_entire_binding())])
                }
                (Some(Memory::Texture(texture)), _) => {
                    image = view(texture, true, None);
                    (&self.texels, vec![(2, wgpu::BindingResource::TextureView(&image))])
                }
                // What is from outside, no node writes.
                _ => (&self.texels, Vec::new()),
            };
            let shared = [(0, wgpu::BindingResource::Buffer(own.clone())), (1, self.findings.as_entire_binding())];
            let all = shared.into_iter().chain(seen).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource });
            gpu.device().create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("numbers"),
                layout: &pipeline.get_bind_group_layout(0),
                entries: &all.collect::<Vec<_>>(),
            })
        });
        Scan { resource, bounds, groups: part.groups(), part, bind }
    }

    /// Forgets what the frame before found.
    pub(crate) fn begin(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(&self.nothing_found, 0, &self.findings, 0, self.findings.size());
    }

    /// Whether a node writes something that can be looked at.
    pub(crate) fn looks_at(&self, node: usize) -> bool {
        !self.by_node[node].is_empty()
    }

    /// Looks at all that a node wrote.
    pub(crate) fn scan(&self, encoder: &mut wgpu::CommandEncoder, node: usize, parity: usize) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some("numbers"), timestamp_writes: None });
        for scan in &self.by_node[node] {
            pass.set_pipeline(if matches!(scan.part, Part::Buffer { .. }) { &self.words } else { &self.texels });
            pass.set_bind_group(0, &scan.bind[parity], &[]);
            let [x, y] = scan.groups;
            pass.dispatch_workgroups(x, y, 1);
        }
    }

    /// What the latest frame found, in the order of execution. Waits for the GPU.
    pub(crate) fn found(&self, gpu: &Gpu, plan: &Plan) -> Result<Vec<BadNumbers>, ReadError> {
        let desc = ResourceDesc::Uniform { element: String::new(), size: u32::try_from(self.findings.size()).unwrap_or(u32::MAX) };
        let bytes = read_bytes(gpu, "numbers found", &Memory::Buffer(self.findings.clone()), &desc)?;
        let words: Vec<u32> = bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
        let scans = plan.nodes.iter().zip(&self.by_node).flat_map(|(node, scans)| scans.iter().map(move |scan| (node, scan)));
        let mut all = Vec::new();
        for ((node, scan), finding) in scans.zip(words.chunks_exact(FINDING_WORDS)) {
            let (counts, firsts) = finding.split_at(KINDS.len());
            for (what, (count, first)) in KINDS.into_iter().zip(counts.iter().zip(firsts)).filter(|(_, (count, _))| **count > 0) {
                let [at_least, at_most] = scan.bounds;
                let bound = match what {
                    BadNumber::TooSmall => at_least,
                    BadNumber::TooLarge => at_most,
                    BadNumber::NotANumber | BadNumber::Infinite => None,
                };
                all.push(BadNumbers {
                    node: node.id.clone(),
                    kind: node.decl.name.clone(),
                    resource: plan.resources[scan.resource].name.clone(),
                    what,
                    bound: bound.map(|b| b.to_string()),
                    place: scan.part.place(*first),
                    count: *count,
                });
            }
        }
        Ok(all)
    }
}

fn layout(device: &wgpu::Device, entry: &str) -> wgpu::PipelineLayout {
    let entry_of = |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None };
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    let storage = |read_only| buffer(wgpu::BufferBindingType::Storage { read_only });
    let mut entries = vec![entry_of(0, buffer(wgpu::BufferBindingType::Uniform)), entry_of(1, storage(false))];
    if entry == "look_at_texels" {
        let sample_type = wgpu::TextureSampleType::Float { filterable: false };
        let image = wgpu::BindingType::Texture { sample_type, view_dimension: wgpu::TextureViewDimension::D2Array, multisampled: false };
        entries.push(entry_of(2, image));
    } else {
        entries.extend([entry_of(3, storage(true)), entry_of(4, storage(true))]);
    }
    let group = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(entry), entries: &entries });
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some(entry),
        bind_group_layouts: &[Some(&group)],
        ..Default::default()
    })
}

fn pipeline(device: &wgpu::Device, module: &wgpu::ShaderModule, entry: &str) -> wgpu::ComputePipeline {
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(entry),
        layout: Some(&layout(device, entry)),
        module,
        entry_point: Some(entry),
        compilation_options: Default::default(),
        cache: None,
    })
}

/// A buffer with these contents; of at least one finding, as bindings must not be empty.
fn buffer(gpu: &Gpu, label: &str, usage: wgpu::BufferUsages, contents: &[u32]) -> wgpu::Buffer {
    let size = (4 * contents.len().max(FINDING_WORDS)) as u64;
    let usage = usage | wgpu::BufferUsages::COPY_DST;
    let buffer = gpu.device().create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false });
    gpu.queue().write_buffer(&buffer, 0, bytemuck::cast_slice(contents));
    buffer
}

/// The structure `Scan` of `numbers.wgsl`, padded to where the next one may start.
fn settings_of(written: &Written, record: usize) -> [u32; SETTINGS_STRIDE] {
    let [level, layer, numbers, count] = match written.part {
        Part::Level { level, layer, channels, .. } => [level, layer, channels, 0],
        Part::Buffer { stride, count, .. } => [0, 0, stride, count],
    };
    let [at_least, at_most] = written.bounds;
    let bounds = u32::from(at_least.is_some()) | u32::from(at_most.is_some()) << 1;
    let bits = |bound: Option<f64>| (bound.unwrap_or(0.0) as f32).to_bits();
    let own: [u32; SETTINGS_WORDS] = [level, layer, numbers, count, bits(at_least), bits(at_most), bounds, record as u32];
    let mut padded = [0; SETTINGS_STRIDE];
    padded[..SETTINGS_WORDS].copy_from_slice(&own);
    padded
}

/// What a node writes that holds floats.
fn written(plan: &Plan, node: &PlanNode) -> Vec<Written> {
    let mut all = Vec::new();
    for (name, target) in &node.bindings {
        let (Target::Resource(ix), true, Some(port)) = (*target, is_output(node, name), node.decl.ports.get(name)) else { continue };
        let resource = &plan.resources[ix];
        let of = |part| Written { resource: ix, bounds: [port.at_least, port.at_most], part };
        match &resource.desc {
            ResourceDesc::Texture { format, width, height, layers, mips, .. } => {
                // Whole numbers are no floats; depth that was drawn lies between 0 and 1.
                if matches!(format, Format::R32Uint | Format::Rg32Uint | Format::Rgba32Uint | Format::Depth32Float) {
                    continue;
                }
                let levels = (0..*mips).flat_map(|level| (0..*layers).map(move |layer| (level, layer)));
                all.extend(levels.map(|(level, layer)| {
                    let (width, height) = mip_size(*width, *height, level);
                    of(Part::Level { level, layer, width, height, channels: channels(*format) })
                }));
            }
            ResourceDesc::Buffer { element, stride, count } => {
                let mut fields = BTreeMap::new();
                match layouts_for(plan, &resource.name, element) {
                    Some(layouts) => structure(element, layouts, 0, "", &mut fields),
                    None => fields.extend(plain(element).map(|word| (word, format!("[{word}]")))),
                }
                let stride = (*stride / 4).max(1);
                if !fields.is_empty() {
                    let count = u32::try_from(u64::from(stride) * count).unwrap_or(u32::MAX);
                    all.push(of(Part::Buffer { fields, stride, count }));
                }
            }
            ResourceDesc::Uniform { .. } => {}
        }
    }
    all
}

/// Words of a plain type that are floats.
fn plain(element: &str) -> std::ops::Range<u32> {
    let vector = |rest: &str| rest.strip_suffix('f').and_then(|n| n.parse().ok());
    0..if element == "f32" { 1 } else { element.strip_prefix("vec").and_then(vector).unwrap_or(0) }
}

/// Collects the floats of a structure that begins at byte `at`.
fn structure(name: &str, layouts: &BTreeMap<String, Layout>, at: u32, path: &str, to: &mut BTreeMap<u32, String>) {
    for m in layouts.get(name).map(|layout| layout.members.as_slice()).unwrap_or_default() {
        let path = if m.name.is_empty() { path.to_owned() } else { format!("{path}.{}", m.name) };
        member(&m.kind, layouts, at + m.offset, &path, to);
    }
}

fn member(kind: &MemberKind, layouts: &BTreeMap<String, Layout>, at: u32, path: &str, to: &mut BTreeMap<u32, String>) {
    match kind {
        MemberKind::Struct(name) => structure(name, layouts, at, path, to),
        MemberKind::Array { of, count, stride } => {
            (0..*count).for_each(|i| member(of, layouts, at + i * stride, &format!("{path}[{i}]"), to));
        }
        MemberKind::Numeric { scalar: Scalar::F32, rows, columns, column_stride } => {
            for (column, row) in (0..*columns).flat_map(|column| (0..*rows).map(move |row| (column, row))) {
                let column_path = if *columns > 1 { format!("[{column}]") } else { String::new() };
                let row_path = if *rows > 1 { format!("[{row}]") } else { String::new() };
                to.insert((at + column * column_stride + 4 * row) / 4, format!("{path}{column_path}{row_path}"));
            }
        }
        MemberKind::Numeric { .. } => {}
    }
}

impl Part {
    /// One for each word of an element that is a float.
    fn mask(&self) -> Option<Vec<u32>> {
        match self {
            Self::Level { .. } => None,
            Self::Buffer { fields, stride, .. } => Some((0..*stride).map(|word| u32::from(fields.contains_key(&word))).collect()),
        }
    }

    fn groups(&self) -> [u32; 2] {
        match self {
            Self::Level { width, height, .. } => [width.div_ceil(8), height.div_ceil(8)],
            Self::Buffer { count, .. } => [count.div_ceil(64).clamp(1, MOST_GROUPS), 1],
        }
    }

    fn place(&self, number: u32) -> NumberPlace {
        match self {
            Self::Level { level, layer, width, channels, .. } => {
                let texel = number / channels;
                NumberPlace::Texel { x: texel % width, y: texel / width, level: *level, layer: *layer, channel: number % channels }
            }
            Self::Buffer { fields, stride, .. } => {
                let field = fields.get(&(number % stride)).cloned().unwrap_or_default();
                NumberPlace::Element { index: u64::from(number / stride), field }
            }
        }
    }
}
