//! Dispatches whose number of workgroups the GPU finds itself.

use manylight_gpu::Frame;
use manylight_graph::{
    registry::{External, PortKind},
    value::ResourceDesc,
};

use crate::support::World;

const FIND: &str = r#"Node(doc: "Says how many workgroups run.", params: {"rows": Int(min: 0, max: 4000000000, default: 3, doc: "rows")},
    outputs: {"found": Buffer(of: "vec4u", doc: "workgroups")}, steps: [(entry: "find", over: Elements("found"))])"#;

const FIND_SHADER: &str = r"
override rows: u32;
@group(0) @binding(0) var<storage, read_write> found: array<vec4u>;
@compute @workgroup_size(1) fn find() { found[0] = vec4u(2u, rows, 1u, 7u); }";

const FILL: &str = r#"Node(doc: "Counts the workgroups that run.", inputs: {"found": Buffer(of: "vec4u", doc: "workgroups")},
    outputs: {"picture": Texture(format: R32Float, doc: "1 where one ran")},
    steps: [(entry: "clear", over: Texels("picture")), (entry: "fill", over: Indirect("found"))])"#;

const FILL_SHADER: &str = r"
@group(0) @binding(0) var picture: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8) fn clear(@builtin(global_invocation_id) id: vec3u) { textureStore(picture, id.xy, vec4f(0.0)); }
@compute @workgroup_size(1) fn fill(@builtin(workgroup_id) id: vec3u) { textureStore(picture, id.xy, vec4f(1.0)); }";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "found": Buffer(of: "vec4u", count: 1), "picture": Texture(format: R32Float, size: Output),
}, nodes: [(id: "find", node: "test/find"), (id: "fill", node: "test/fill")], presents: "picture")"#;

fn world() -> World {
    World::new(&[
        ("shaders/test/find.ron", FIND),
        ("shaders/test/find.wgsl", FIND_SHADER),
        ("shaders/test/fill.ron", FILL),
        ("shaders/test/fill.wgsl", FILL_SHADER),
        ("pipelines/test.ron", PIPELINE),
    ])
}

/// Where workgroups ran: columns and rows of a picture of 8×4 texels.
fn ran(world: &World, frame: &Frame) -> (usize, usize) {
    let image = world.image(frame, "picture");
    let at = |x: u32, y: u32| image.pixel(x, y)[0] == 1.0;
    let (columns, rows) = ((0..8).filter(|x| at(*x, 0)).count(), (0..4).filter(|y| at(0, *y)).count());
    let all = (0..32).filter(|i| at(i % 8, i / 8)).count();
    assert_eq!(all, columns * rows, "they ran in a rectangle");
    (columns, rows)
}

fn with_rows(mut world: World, rows: &str) -> World {
    world.input.set = vec![("find.rows".to_owned(), rows.to_owned())];
    world
}

#[test]
fn as_many_workgroups_run_as_a_node_found() {
    for (rows, expected) in [("3", (2, 3)), ("1", (2, 1)), ("0", (0, 0))] {
        let world = with_rows(world(), rows);
        assert_eq!(ran(&world, &world.once()), expected, "{rows}");
    }
}

#[test]
fn more_workgroups_than_the_device_allows_are_none() {
    // As with poison: 0x7fff7fff workgroups would never end.
    let world = with_rows(world(), "2147450879");
    assert_eq!(ran(&world, &world.once()), (0, 0));
}

#[test]
fn a_node_can_find_its_own_number_in_an_earlier_step() {
    let mut world = world();
    world.write(
        "shaders/test/both.ron",
        r#"Node(doc: "Both.", outputs: {"found": Buffer(of: "vec4u", doc: "workgroups"), "picture": Texture(format: R32Float, doc: "p")},
            params: {"rows": Int(min: 0, max: 9, default: 2, doc: "rows")},
            steps: [(entry: "find", over: Elements("found")), (entry: "clear", over: Texels("picture")), (entry: "fill", over: Indirect("found"))])"#,
    );
    let shader = FIND_SHADER.to_owned() + &FILL_SHADER.replace("@binding(0)", "@binding(1)");
    world.write("shaders/test/both.wgsl", &shader);
    let nodes = r#"nodes: [(id: "both", node: "test/both")]"#;
    let (resources, _) = PIPELINE.split_once("nodes:").unwrap();
    world.write("pipelines/test.ron", &format!("{resources}{nodes}, presents: \"picture\")"));
    assert_eq!(ran(&world, &world.once()), (2, 2));
}

#[test]
fn the_number_may_be_the_last_frames() {
    let mut world = world();
    let grow = FIND_SHADER.replace("vec4u(2u, rows, 1u, 7u)", "vec4u(1u, before[0].y + 1u, 1u, 0u)");
    let grow = grow.replace("override rows: u32;", "@group(0) @binding(1) var<storage, read> before: array<vec4u>;");
    world.write("shaders/test/find.wgsl", &grow);
    let inputs = r#"inputs: {"before": Buffer(of: "vec4u", doc: "the last frame's")},"#;
    let params = r#"params: {"rows": Int(min: 0, max: 4000000000, default: 3, doc: "rows")},"#;
    world.write("shaders/test/find.ron", &FIND.replace(params, inputs));
    let pipeline = PIPELINE.replace("count: 1", "count: 1, history: true");
    let pipeline = pipeline.replace("node: \"test/find\"", "node: \"test/find\", in: {\"before\": Previous(\"found\")}");
    let pipeline = pipeline.replace("node: \"test/fill\"", "node: \"test/fill\", in: {\"found\": Previous(\"found\")}");
    world.write("pipelines/test.ron", &pipeline);
    let mut frame = world.build();
    for rows in 0..4 {
        world.run(&mut frame);
        assert_eq!(ran(&world, &frame), (rows.min(1), rows));
    }
}

fn words(count: &[[u32; 4]]) -> Vec<u8> {
    count.iter().flatten().flat_map(|word| word.to_le_bytes()).collect()
}

/// The number comes from outside.
fn external_world() -> World {
    let mut world = world();
    let kind = PortKind::Buffer { of: "vec4u".to_owned() };
    world.declared.push(External { name: "given".to_owned(), kind, doc: "workgroups".to_owned(), layout: None });
    let (_, pipeline) = PIPELINE.split_once(r#""found": Buffer(of: "vec4u", count: 1), "#).unwrap();
    let pipeline = pipeline.replace(r#"(id: "find", node: "test/find"), "#, "");
    let pipeline = pipeline.replace("node: \"test/fill\"", "node: \"test/fill\", in: {\"found\": \"given\"}");
    world.write("pipelines/test.ron", &format!("Pipeline(doc: \"t\", resources: {{ {pipeline}"));
    world.externals.set_buffer(&world.gpu, "given", "vec4u", 16, &words(&[[3, 1, 1, 0]])).unwrap();
    world
}

#[test]
fn the_number_may_come_from_outside_and_move_to_other_memory() {
    let mut world = external_world();
    let mut frame = world.build();
    world.run(&mut frame);
    assert_eq!(ran(&world, &frame), (3, 1));
    world.externals.set_buffer(&world.gpu, "given", "vec4u", 16, &words(&[[3, 2, 1, 0]])).unwrap();
    world.run(&mut frame);
    assert_eq!(ran(&world, &frame), (3, 2));
    // A longer buffer is other memory.
    world.externals.set_buffer(&world.gpu, "given", "vec4u", 16, &words(&[[5, 4, 1, 0]; 9])).unwrap();
    world.run(&mut frame);
    assert_eq!(ran(&world, &frame), (5, 4));
}

#[test]
fn memory_of_another_program_must_be_made_for_it() {
    let mut world = external_world();
    let buffer = world.gpu.device().create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: 16,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    });
    let desc = ResourceDesc::Buffer { element: "vec4u".to_owned(), stride: 16, count: 1 };
    world.externals.insert("given", desc, manylight_gpu::Memory::Buffer(buffer));
    let error = world.try_build(None).unwrap_err().to_string();
    assert!(error.contains("`fill`") && error.contains("usage INDIRECT"), "{error}");
}

#[test]
fn debug_switches_do_not_change_how_many_run() {
    for poison in [false, true] {
        for watch_numbers in [false, true] {
            for no_reuse in [false, true] {
                let mut world = world();
                world.options.poison = poison;
                world.options.watch_numbers = watch_numbers;
                world.input.debug.no_reuse = no_reuse;
                world.input.debug.shuffle = Some(5);
                let mut frame = world.build();
                for _ in 0..2 {
                    world.run(&mut frame);
                    assert_eq!(ran(&world, &frame), (2, 3));
                    assert!(frame.bad_numbers(&world.gpu).unwrap().is_empty());
                }
            }
        }
    }
}

#[test]
fn who_is_sized_by_an_unchanged_number_is_skipped() {
    let mut world = external_world();
    world.options.skip_unchanged = true;
    world.input.keep_unchanged = true;
    let mut frame = world.build();
    let mut runs = |given: Option<[u32; 4]>| {
        if let Some(given) = given {
            world.externals.set_buffer(&world.gpu, "given", "vec4u", 16, &words(&[given])).unwrap();
        }
        world.run(&mut frame);
        let fill = frame.wait_timings(&world.gpu).unwrap().nodes[0].ran;
        (ran(&world, &frame), fill)
    };
    assert_eq!(runs(None), ((3, 1), true));
    assert_eq!(runs(None), ((3, 1), false));
    assert_eq!(runs(Some([1, 2, 1, 0])), ((1, 2), true));
    assert_eq!(runs(None), ((1, 2), false));
}
