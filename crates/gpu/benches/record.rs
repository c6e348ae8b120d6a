//! What the executor costs on the CPU: recording and submitting 40 trivial compute nodes as a frame, and the same passes
//! written by hand on wgpu. The frame should take at most 1.3 times as long.
#![allow(missing_docs)]

use std::{
    borrow::Cow,
    fmt::Write,
    time::{Duration, Instant},
};

use criterion::{Criterion, criterion_group, criterion_main};
use manylight_gpu::{BuildOptions, Externals, Frame, Gpu, GpuOptions, HostData, HostNodes};
use manylight_graph::{library::Library, pipeline::Pipeline, plan::PlanInput, planner, registry::Registry};

const NODES: usize = 40;

const NODE: &str = r#"Node(doc: "Adds one.", inputs: {"source": Buffer(of: "u32", doc: "numbers")}, outputs: {"to": Buffer(of: "u32", doc: "numbers")},
    params: {"step": Int(min: 0, max: 9, default: 1, doc: "what is added")}, steps: [(entry: "add", over: Elements("to"))])"#;

const FIRST: &str =
    r#"Node(doc: "Starts.", outputs: {"to": Buffer(of: "u32", doc: "numbers")}, steps: [(entry: "start", over: Elements("to"))])"#;

const FIRST_SHADER: &str = r"
@group(0) @binding(0) var<storage, read_write> to: array<u32>;
@compute @workgroup_size(64) fn start(@builtin(global_invocation_id) id: vec3u) { to[id.x] = id.x; }";

const LAST: &str = r#"Node(doc: "Shows.", inputs: {"source": Buffer(of: "u32", doc: "numbers")}, outputs: {"picture": Texture(format: R32Uint, doc: "the first")},
    steps: [(entry: "show", over: Texels("picture"))])"#;

const LAST_SHADER: &str = r"
@group(0) @binding(0) var<storage, read> source: array<u32>;
@group(0) @binding(1) var picture: texture_storage_2d<r32uint, write>;
@compute @workgroup_size(1) fn show(@builtin(global_invocation_id) id: vec3u) { textureStore(picture, id.xy, vec4u(source[0])); }";

const SHADER: &str = r"
struct Params { step: u32 }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> source: array<u32>;
@group(0) @binding(2) var<storage, read_write> to: array<u32>;
@compute @workgroup_size(64) fn add(@builtin(global_invocation_id) id: vec3u) { to[id.x] = source[id.x] + params.step; }";

/// The frame: a chain of [`NODES`] nodes.
fn frame(gpu: &Gpu, timestamps: bool) -> Frame {
    let mut resources = String::new();
    let mut nodes = String::from(r#"(id: "n0", node: "bench/first", out: {"to": "b0"}),"#);
    for i in 0..NODES - 1 {
        let _ = write!(resources, r#""b{i}": Buffer(of: "u32", count: 64),"#);
        if i > 0 {
            let _ = write!(nodes, r#"(id: "n{i}", node: "bench/add", in: {{"source": "b{}"}}, out: {{"to": "b{i}"}}),"#, i - 1);
        }
    }
    let _ = write!(nodes, r#"(id: "last", node: "bench/last", in: {{"source": "b{}"}}),"#, NODES - 2);
    let pipeline = format!(
        r#"Pipeline(doc: "bench", resources: {{{resources} "picture": Texture(format: R32Uint, size: Fixed(1, 1))}}, nodes: [{nodes}], presents: "picture")"#
    );
    let files = [
        ("shaders/bench/first.ron", FIRST),
        ("shaders/bench/first.wgsl", FIRST_SHADER),
        ("shaders/bench/add.ron", NODE),
        ("shaders/bench/add.wgsl", SHADER),
        ("shaders/bench/last.ron", LAST),
        ("shaders/bench/last.wgsl", LAST_SHADER),
        ("pipelines/bench.ron", String::leak(pipeline)),
    ];
    let library = Library::new(None, files.map(|(path, text)| (path.to_owned(), text)).to_vec());
    let (registry, faults) = Registry::load(&library, &[], Vec::new());
    assert!(!faults.has_errors(), "{faults}");
    let pipeline = Pipeline::load(&library, "pipelines/bench.ron").expect("the pipeline is right");
    let input = PlanInput { output: (1, 1), ..Default::default() };
    let plan = planner::plan(&pipeline, &registry, &input).expect("the pipeline is right");
    assert_eq!(plan.nodes.len(), NODES);
    let options = BuildOptions { timestamps, ..Default::default() };
    Frame::build(gpu, &plan, &Externals::new(), &HostNodes::new(), None, options).expect("any device runs it").0
}

/// The same by hand: one pass a node with its own pipeline, bind group and dispatch.
struct ByHand {
    pipeline: wgpu::ComputePipeline,
    groups: Vec<wgpu::BindGroup>,
    labels: Vec<String>,
}

impl ByHand {
    fn new(gpu: &Gpu) -> Self {
        let device = gpu.device();
        let module = device
            .create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source: wgpu::ShaderSource::Wgsl(Cow::Borrowed(SHADER)) });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &module,
            entry_point: Some("add"),
            compilation_options: Default::default(),
            cache: None,
        });
        let buffer = |usage| device.create_buffer(&wgpu::BufferDescriptor { label: None, size: 256, usage, mapped_at_creation: false });
        let params = buffer(wgpu::BufferUsages::UNIFORM);
        let buffers = [buffer(wgpu::BufferUsages::STORAGE), buffer(wgpu::BufferUsages::STORAGE)];
        let layout = pipeline.get_bind_group_layout(0);
        let group = |i: usize| {
            let entry = |binding, buffer: &'_ wgpu::Buffer| (binding, buffer.clone());
            let bound = [entry(0, &params), entry(1, &buffers[i % 2]), entry(2, &buffers[(i + 1) % 2])];
            let entries = [0, 1, 2].map(|e| wgpu::BindGroupEntry { binding: bound[e].0, resource: bound[e].1.as_entire_binding() });
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &layout, entries: &entries })
        };
        Self { groups: (0..NODES).map(group).collect(), labels: (0..NODES).map(|i| format!("n{i}")).collect(), pipeline }
    }

    fn run(&self, gpu: &Gpu) {
        let mut encoder = gpu.device().create_command_encoder(&Default::default());
        for (group, label) in self.groups.iter().zip(&self.labels) {
            let descriptor = wgpu::ComputePassDescriptor { label: Some(label), timestamp_writes: None };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, group, &[]);
            pass.dispatch_workgroups(1, 1, 1);
        }
        gpu.queue().submit([encoder.finish()]);
    }
}

fn record(c: &mut Criterion) {
    let gpu = Gpu::new(&GpuOptions::default()).expect("a device");
    println!("{} ({})", gpu.adapter_info().name, gpu.kind());
    let externals = Externals::new();
    let by_hand = ByHand::new(&gpu);
    let [mut plain, mut timed] = [false, true].map(|timestamps| frame(&gpu, timestamps));
    let run = |frame: &mut Frame| frame.record_and_submit(&gpu, &externals, HostData::none()).expect("the frame runs");
    ratio(
        &gpu,
        &mut [
            ("by hand", &mut || by_hand.run(&gpu)),
            ("frame", &mut || run(&mut plain)),
            ("frame with timestamps", &mut || run(&mut timed)),
        ],
    );
    let mut group = c.benchmark_group("record 40 nodes");
    group.bench_function("by hand", |b| b.iter_custom(|n| total(&gpu, n, || by_hand.run(&gpu))));
    group.bench_function("frame", |b| b.iter_custom(|n| total(&gpu, n, || run(&mut plain))));
    group.bench_function("frame with timestamps", |b| b.iter_custom(|n| total(&gpu, n, || run(&mut timed))));
    group.finish();
}

/// Prints the medians of runs that take turns, so that whatever else the machine does meets all of them alike.
fn ratio(gpu: &Gpu, ways: &mut [(&str, &mut dyn FnMut())]) {
    const ROUNDS: usize = 401;
    let mut times = vec![Vec::with_capacity(ROUNDS); ways.len()];
    for round in 0..ROUNDS + 20 {
        for ((_, way), times) in ways.iter_mut().zip(&mut times) {
            let time = total(gpu, 1, &mut *way);
            if round >= 20 {
                times.push(time);
            }
        }
    }
    let medians = times.iter_mut().map(|times| *times.select_nth_unstable(ROUNDS / 2).1);
    let medians: Vec<Duration> = medians.collect();
    for ((name, _), median) in ways.iter().zip(&medians) {
        println!("{name}: {median:?}, {:.2} × by hand (median of {ROUNDS}, in turns)", median.as_secs_f64() / medians[0].as_secs_f64());
    }
}

/// Time to record and submit `n` times; the GPU is done before the next.
fn total(gpu: &Gpu, n: u64, mut work: impl FnMut()) -> Duration {
    let mut total = Duration::ZERO;
    for _ in 0..n {
        let start = Instant::now();
        work();
        total += start.elapsed();
        gpu.wait();
    }
    total
}

criterion_group!(benches, record);
criterion_main!(benches);
