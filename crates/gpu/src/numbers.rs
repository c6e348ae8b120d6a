//! Debug switch: after each node every number that it wrote is looked at on the GPU. What is NaN, infinite or beyond what the port promises is
//! counted, and its first place kept.

use std::{collections::BTreeMap, fmt};

use manylight_graph::{
    plan::{Plan, PlanNode, Target},
    registry::Port,
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

/// Bytes of a scan's settings, padded to where the next uniform may start.
const SETTINGS_STRIDE: usize = 256;
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
struct Scan {
    resource: usize,
    port: Port,
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
        let failed = |message: String| Fault::Resource { resource: "the scan of numbers".to_owned(), message };
        let parts: Vec<Vec<(usize, Port, Part)>> = plan.nodes.iter().map(|node| parts(plan, node)).collect();
        let count = parts.iter().map(Vec::len).sum::<usize>();
        gpu.scoped(|| {
            let device = gpu.device();
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some("numbers"),
                source: wgpu::ShaderSource::Wgsl(SHADER.into()),
            });
            let pipeline = |entry: &'static str| {
                device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(entry),
                    layout: Some(&layout(device, entry)),
                    module: &module,
                    entry_point: Some(entry),
                    compilation_options: Default::default(),
                    cache: None,
                })
            };
            let buffer = |label, size: usize, usage| {
                let size = (size as u64).max(64);
                device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
            };
            use wgpu::BufferUsages as U;
            let size = count * FINDING_WORDS * 4;
            let findings = buffer("numbers found", size, U::STORAGE | U::COPY_DST | U::COPY_SRC);
            let nothing_found = buffer("no numbers found", size, U::COPY_SRC | U::COPY_DST);
            let empty = [0, 0, 0, 0, u32::MAX, u32::MAX, u32::MAX, u32::MAX];
            gpu.queue().write_buffer(&nothing_found, 0, &words_to_bytes(&empty.repeat(count)));
            let settings = buffer("scans of numbers", count * SETTINGS_STRIDE, U::UNIFORM | U::COPY_DST);
            let (texels, words) = (pipeline("look_at_texels"), pipeline("look_at_words"));
            let mut record = 0;
            let mut by_node = Vec::new();
            for parts in parts {
                let mut scans = Vec::new();
                for (resource, port, part) in parts {
                    gpu.queue().write_buffer(&settings, (record * SETTINGS_STRIDE) as u64, &settings_of(&part, &port, record as u32));
                    let at = wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                        buffer: &settings,
                        offset: (record * SETTINGS_STRIDE) as u64,
                        size: wgpu::BufferSize::new(32),
                    });
                    let masks = part.mask().map(|mask| {
                        let masks = buffer("words that are floats", mask.len() * 4, U::STORAGE | U::COPY_DST);
                        gpu.queue().write_buffer(&masks, 0, &words_to_bytes(&mask));
                        masks
                    });
                    let bind = [0, 1].map(|parity| {
                        let mut entries = vec![
                            wgpu::BindGroupEntry { binding: 0, resource: at.clone() },
                            wgpu::BindGroupEntry { binding: 1, resource: findings.as_entire_binding() },
                        ];
                        let image;
                        match (resources[resource].memory(parity), &masks) {
                            (Some(Memory::Texture(texture)), _) => {
                                image = view(texture, true, None);
                                entries.push(wgpu::BindGroupEntry { binding: 2, resource: wgpu::BindingResource::TextureView(&image) });
                            }
                            (Some(Memory::Buffer(buffer)), Some(masks)) => {
                                entries.push(wgpu::BindGroupEntry { binding: 3, resource: buffer.as_entire_binding() });
                                entries.push(wgpu::BindGroupEntry { binding: 4, resource: masks.as_entire_binding() });
                            }
                            // What is from outside, no node writes.
                            _ => {}
                        }
                        let pipeline = if masks.is_some() { &words } else { &texels };
                        let layout = &pipeline.get_bind_group_layout(0);
                        device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some("numbers"), layout, entries: &entries })
                    });
                    scans.push(Scan { groups: part.groups(&resources[resource].desc), resource, port, part, bind });
                    record += 1;
                }
                by_node.push(scans);
            }
            Self { texels, words, findings, nothing_found, by_node }
        })
        .map_err(failed)
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
                let bound = match what {
                    BadNumber::TooSmall => scan.port.at_least,
                    BadNumber::TooLarge => scan.port.at_most,
                    _ => None,
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

fn words_to_bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}

fn settings_of(part: &Part, port: &Port, record: u32) -> Vec<u8> {
    let [level, layer, numbers, count] = match *part {
        Part::Level { level, layer, channels, .. } => [level, layer, channels, 0],
        Part::Buffer { stride, count, .. } => [0, 0, stride, count],
    };
    let bounds = u32::from(port.at_least.is_some()) | u32::from(port.at_most.is_some()) << 1;
    let bits = |bound: Option<f64>| (bound.unwrap_or(0.0) as f32).to_bits();
    words_to_bytes(&[level, layer, numbers, count, bits(port.at_least), bits(port.at_most), bounds, record])
}

/// What a node writes that holds floats: index of the resource, port, and what of it is looked at in one go.
fn parts(plan: &Plan, node: &PlanNode) -> Vec<(usize, Port, Part)> {
    let mut all = Vec::new();
    for (name, target) in &node.bindings {
        let (Target::Resource(ix), true, Some(port)) = (*target, is_output(node, name), node.decl.ports.get(name)) else { continue };
        let resource = &plan.resources[ix];
        match &resource.desc {
            ResourceDesc::Texture { format, width, layers, mips, .. } => {
                // Whole numbers are no floats; depth that was drawn lies between 0 and 1.
                if matches!(format, Format::R32Uint | Format::Rg32Uint | Format::Rgba32Uint | Format::Depth32Float) {
                    continue;
                }
                let levels = (0..*mips).flat_map(|level| (0..*layers).map(move |layer| (level, layer)));
                all.extend(levels.map(|(level, layer)| {
                    let width = mip_size(*width, 1, level).0;
                    (ix, port.clone(), Part::Level { level, layer, width, channels: channels(*format) })
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
                    all.push((ix, port.clone(), Part::Buffer { fields, stride, count }));
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

    fn groups(&self, desc: &ResourceDesc) -> [u32; 2] {
        match (self, desc) {
            (Self::Level { level, .. }, ResourceDesc::Texture { width, height, .. }) => {
                let (width, height) = mip_size(*width, *height, *level);
                [width.div_ceil(8), height.div_ceil(8)]
            }
            (Self::Buffer { count, .. }, _) => [count.div_ceil(64).clamp(1, MOST_GROUPS), 1],
            (Self::Level { .. }, _) => [0, 0],
        }
    }

    fn place(&self, number: u32) -> NumberPlace {
        match self {
            Self::Level { level, layer, width, channels } => {
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
