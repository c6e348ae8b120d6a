//! What the device refuses is an error that says who and why, and the frame that ran before goes on.

use manylight_gpu::{BuildError, Fault, Frame};
use manylight_graph::{
    plan::{Plan, PlanStep, Target, Workgroups},
    value::ResourceDesc,
};

use crate::support::{SHOW, World};

const DRAW: &str = r#"Node(doc: "Draws.", outputs: {"picture": Texture(format: Rgba8Unorm, doc: "colour")},
    params: {"n": Int(min: 0, max: 9, default: 1, doc: "a divisor")},
    steps: [Draw(vertex: "vs", fragment: "fs", vertices: 3, targets: ["picture"])])"#;

const GOOD: &str = r"
override n: u32 = 1u;
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(vec2u(i & 1u, i >> 1u)) * 4.0 - 1.0, 0.5, 1.0);
}
@fragment fn fs() -> @location(0) vec4f { return vec4f(f32(4u / n) * 0.25); }";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {"picture": Texture(format: Rgba8Unorm, size: Output)},
    nodes: [(id: "paint", node: "test/draw")], presents: "picture")"#;

fn world() -> World {
    World::new(&[("shaders/test/draw.ron", DRAW), ("shaders/test/draw.wgsl", GOOD), ("pipelines/test.ron", PIPELINE)])
}

#[test]
fn a_pipeline_that_cannot_be_made_names_node_and_entry_and_the_old_frame_survives() {
    let mut world = world();
    let mut frame = world.once();
    let good = world.image(&frame, "picture");
    assert_eq!(good.pixel(3, 3), [1.0; 4]);
    // Each entry point is valid; together they do not fit.
    world.write("shaders/test/draw.wgsl", &GOOD.replace("fn fs()", "fn fs(@location(3) extra: vec4f)"));
    let error = world.try_build(Some(&frame)).unwrap_err();
    match &error.faults[..] {
        [(Fault::Pipeline { node, entry, shader, message }, Some(_))] => {
            assert_eq!((node.as_str(), entry.as_str()), ("paint", "vs + fs"));
            assert!(shader.ends_with("test/draw.wgsl"), "{shader}");
            assert!(message.contains('3'), "wgpu says which location: {message}");
        }
        other => panic!("{other:?}"),
    }
    assert!(error.diagnostics().has_errors());
    world.run(&mut frame);
    assert_eq!(world.image(&frame, "picture"), good);
    assert!(world.gpu.take_errors().is_empty(), "the error was caught");
    world.write("shaders/test/draw.wgsl", GOOD);
    let (_, report) = world.try_build(Some(&frame)).unwrap();
    assert_eq!((report.compiled, report.reused), (0, 1), "the good pipeline is still known");
}

/// A world with a compute node `work` that fills a buffer.
fn working(shader: &str) -> World {
    let node = r#"Node(doc: "Works.", outputs: {"values": Buffer(of: "f32", doc: "numbers")},
        params: {"n": Int(min: 0, max: 9, default: 1, doc: "a size")}, steps: [(entry: "work", over: Groups(1, 1, 1))])"#;
    let pipeline = r#"Pipeline(doc: "t", resources: {"values": Buffer(of: "f32", count: 1), "picture": Texture(format: Rgba32Float, size: Output)},
        nodes: [(id: "work", node: "test/work"), (id: "show", node: "test/show")], presents: "picture")"#;
    let mut files = vec![("shaders/test/work.ron", node), ("shaders/test/work.wgsl", shader), ("pipelines/test.ron", pipeline)];
    files.extend(SHOW);
    World::new(&files)
}

const WORK: &str = "override n: u32 = 1u; @group(0) @binding(0) var<storage, read_write> values: array<f32>;
    @compute @workgroup_size(1) fn work() { values[0] = f32(4u / n); }";

#[test]
fn overrides_that_cannot_be_evaluated_are_pipeline_errors() {
    let mut world = working(WORK);
    world.once();
    world.input.set = vec![("work.n".to_owned(), "0".to_owned())];
    let error = world.try_build(None).unwrap_err();
    assert!(matches!(&error.faults[..], [(Fault::Pipeline { node, .. }, _)] if node == "work"), "{error}");
}

fn build_error(world: &World, plan: &Plan) -> BuildError {
    Frame::build(&world.gpu, plan, &world.externals, &world.hosts, None, world.options).unwrap_err()
}

#[test]
fn sizes_beyond_the_limits_name_the_resource_and_both_numbers() {
    let world = world();
    let side = world.gpu.limits().max_texture_dimension_2d;
    let mut plan = world.plan();
    if let ResourceDesc::Texture { width, .. } = &mut plan.resources[0].desc {
        *width = side + 1;
    }
    let error = build_error(&world, &plan).to_string();
    for part in ["`picture`", &side.to_string(), &(side + 1).to_string(), "max_texture_dimension_2d"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn sizes_beyond_the_limits_name_the_parameters_to_lower() {
    let mut world = working(WORK);
    world.write(
        "pipelines/test.ron",
        r#"Pipeline(doc: "t", params: {"most": Int(min: 1, max: 9, default: 3, doc: "numbers"), "other": Int(min: 1, max: 9, default: 1, doc: "nothing")},
        resources: {"values": Buffer(of: "f32", count: Elements("more")), "more": Buffer(of: "f32", count: Mul([Param("most"), 2])),
            "picture": Texture(format: Rgba32Float, size: Output)},
        nodes: [(id: "more", node: "test/work", out: {"values": "more"}), (id: "work", node: "test/work"), (id: "show", node: "test/show")],
        presents: "picture")"#,
    );
    let most = world.gpu.limits().max_storage_buffer_binding_size;
    let mut plan = world.plan();
    let values = plan.resource("values").unwrap();
    if let ResourceDesc::Buffer { count, .. } = &mut plan.resources[values].desc {
        *count = most / 4 + 1;
    }
    let error = build_error(&world, &plan).to_string();
    for part in ["`values`", &most.to_string(), "help: lower `most` (now 3)"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn memory_that_a_workgroup_cannot_share_names_the_node() {
    let world = working(
        "override n: u32 = 1u; @group(0) @binding(0) var<storage, read_write> values: array<f32>; var<workgroup> all: array<vec4f, 1048576>;
        @compute @workgroup_size(1) fn work() { all[n] = vec4f(1.0); values[0] = all[n].x; }",
    );
    let error = world.try_build(None).unwrap_err().to_string();
    for part in ["`work`", "16777216", "max_compute_workgroup_storage_size", "var<workgroup>"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn dispatches_beyond_the_limits_name_the_node() {
    let world = working(WORK);
    let most = world.gpu.limits().max_compute_workgroups_per_dimension;
    let mut plan = world.plan();
    let work = plan.nodes.iter_mut().find(|n| n.id == "work").unwrap();
    if let PlanStep::Compute { groups: Workgroups::Fixed(groups), .. } = &mut work.steps[0] {
        groups[1] = most + 1;
    }
    let error = build_error(&world, &plan).to_string();
    for part in ["`work`", &(most + 1).to_string(), "max_compute_workgroups_per_dimension"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn features_that_are_missing_are_named() {
    let mut world = world();
    world.write("shaders/test/draw.ron", &DRAW.replace("steps:", r#"requires: ["EXPERIMENTAL_COOPERATIVE_MATRIX"], steps:"#));
    let error = world.try_build(None).unwrap_err().to_string();
    for part in ["`paint`", "EXPERIMENTAL_COOPERATIVE_MATRIX", world.gpu.adapter_info().name.as_str()] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn a_resource_read_and_written_in_one_dispatch_is_found_when_the_frame_is_built() {
    let mut world = world();
    world.write(
        "shaders/test/twice.ron",
        r#"Node(doc: "Reads what it writes.", inputs: {"before": Texture(format: R32Float, optional: true, doc: "numbers")},
        outputs: {"after": Texture(format: R32Float, doc: "numbers")}, steps: [(entry: "go", over: Texels("after"))])"#,
    );
    world.write(
        "shaders/test/twice.wgsl",
        "@group(0) @binding(0) var before: texture_2d<f32>; @group(0) @binding(1) var after: texture_storage_2d<r32float, write>;
        @compute @workgroup_size(1) fn go(@builtin(global_invocation_id) id: vec3u) { textureStore(after, id.xy, textureLoad(before, id.xy, 0)); }",
    );
    world.write(
        "pipelines/test.ron",
        r#"Pipeline(doc: "t", resources: {"after": Texture(format: R32Float, size: Output)}, nodes: [(id: "go", node: "test/twice")], presents: "after")"#,
    );
    let mut plan = world.plan();
    let ix = plan.resource("after").unwrap();
    for (_, target) in &mut plan.nodes[0].bindings {
        *target = Target::Resource(ix);
    }
    let error = build_error(&world, &plan);
    assert!(matches!(&error.faults[..], [(Fault::Recording { .. }, _)]), "{error}");
    assert!(world.gpu.take_errors().is_empty());
}
