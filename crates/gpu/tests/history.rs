//! Histories: zero at first, the last frame's value afterwards, and kept across builds where name and description are equal.

use manylight_gpu::Frame;

use crate::support::World;

const NODE: &str = r#"Node(doc: "Counts frames.",
    inputs: {"old": Buffer(of: "u32", doc: "last count"), "old_map": Texture(format: R32Uint, doc: "last count")},
    outputs: {"counter": Buffer(of: "u32", doc: "count"), "map": Texture(format: R32Uint, doc: "count"),
              "picture": Texture(format: Rgba32Float, doc: "count")},
    steps: [(entry: "count", over: Texels("map"))])"#;

const SHADER: &str = r"
@group(0) @binding(0) var<storage, read> old: array<u32>;
@group(0) @binding(1) var<storage, read_write> counter: array<u32>;
@group(0) @binding(2) var old_map: texture_2d<u32>;
@group(0) @binding(3) var map: texture_storage_2d<r32uint, write>;
@group(0) @binding(4) var picture: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(1) fn count(@builtin(global_invocation_id) id: vec3u) {
    counter[0] = old[0] + 1u;
    let before = textureLoad(old_map, id.xy, 0).x;
    textureStore(map, id.xy, vec4u(before + 10u));
    textureStore(picture, id.xy, vec4f(f32(before)));
}";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "counter": Buffer(of: "u32", count: 1, history: true),
    "map": Texture(format: R32Uint, size: Fixed(2, 1), history: true),
    "picture": Texture(format: Rgba32Float, size: Fixed(2, 1)),
}, nodes: [(id: "count", node: "test/count", in: {"old": Previous("counter"), "old_map": Previous("map")})], presents: "picture")"#;

fn world() -> World {
    World::new(&[("shaders/test/count.ron", NODE), ("shaders/test/count.wgsl", SHADER), ("pipelines/test.ron", PIPELINE)])
}

#[test]
fn each_frame_reads_what_the_last_one_wrote() {
    let world = world();
    let mut frame = world.build();
    for i in 1..=5u32 {
        world.run(&mut frame);
        assert_eq!(world.json(&frame, "counter"), serde_json::json!([i]));
        assert_eq!(world.image(&frame, "map").data, [10.0 * i as f32; 2]);
        assert_eq!(world.image(&frame, "picture").pixel(1, 0)[0], 10.0 * (i - 1) as f32);
    }
}

#[test]
fn a_rebuild_keeps_histories_that_fit_and_resets_the_others() {
    let mut world = world();
    let mut first = world.build();
    for _ in 0..3 {
        world.run(&mut first);
    }
    let wider = "\"map\": Texture(format: R32Uint, size: Fixed(3, 1)";
    world.write("pipelines/test.ron", &PIPELINE.replace("\"map\": Texture(format: R32Uint, size: Fixed(2, 1)", wider));
    let (mut second, report) = world.try_build(Some(&first)).unwrap();
    assert_eq!((report.history_kept, report.reset), (vec!["counter".to_owned()], vec!["map".to_owned()]));
    world.run(&mut second);
    assert_eq!(world.json(&second, "counter"), serde_json::json!([4]));
    assert_eq!(world.image(&second, "map").data, [10.0; 3]);
}

#[test]
fn a_buffer_of_another_length_keeps_what_has_room() {
    let mut world = world();
    let mut first = world.build();
    for _ in 0..3 {
        world.run(&mut first);
    }
    let mut build = |count: &str, previous: &Frame| {
        world.write("pipelines/test.ron", &PIPELINE.replace("count: 1", count));
        let (mut frame, report) = world.try_build(Some(previous)).unwrap();
        assert!(report.reset.is_empty(), "{:?}", report.reset);
        world.run(&mut frame);
        let counter = world.json(&frame, "counter");
        (frame, counter)
    };
    // The frame in between writes the first element only, so the last one stays zero.
    let (longer, counter) = build("count: 3", &first);
    assert_eq!(counter, serde_json::json!([4, 0, 0]));
    let (_, counter) = build("count: 2", &longer);
    assert_eq!(counter, serde_json::json!([5, 0]));
}

#[test]
fn without_a_previous_frame_everything_starts_from_zero() {
    let world = world();
    let first = world.once();
    drop(first);
    let (mut second, report) = world.try_build(None).unwrap();
    assert_eq!((report.compiled, report.reused), (0, 1));
    world.run(&mut second);
    assert_eq!(world.json(&second, "counter"), serde_json::json!([1]));
}

const DRAWN: &str = r#"Node(doc: "Counts frames by drawing.", inputs: {"old_map": Texture(format: R32Uint, doc: "last count")},
    outputs: {"map": Texture(format: R32Uint, doc: "count")},
    steps: [Draw(vertex: "vs", fragment: "fs", vertices: 3, targets: ["map"])])"#;

const DRAWN_SHADER: &str = r"
@group(0) @binding(0) var old_map: texture_2d<u32>;
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(vec2f(vec2u(i & 1u, i >> 1u)) * 4.0 - 1.0, 0.5, 1.0);
}
@fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4u { return textureLoad(old_map, vec2u(at.xy), 0) + 100u; }";

#[test]
fn a_history_survives_when_another_kind_of_node_writes_it() {
    let mut world = world();
    world.write("shaders/test/drawn.ron", DRAWN);
    world.write("shaders/test/drawn.wgsl", DRAWN_SHADER);
    let mut first = world.build();
    for _ in 0..3 {
        world.run(&mut first);
    }
    world.write(
        "pipelines/test.ron",
        r#"Pipeline(doc: "t", resources: {"map": Texture(format: R32Uint, size: Fixed(2, 1), history: true)},
        nodes: [(id: "draw", node: "test/drawn", in: {"old_map": Previous("map")})], presents: "map")"#,
    );
    let (mut second, report) = world.try_build(Some(&first)).unwrap();
    assert_eq!((report.history_kept, report.reset), (vec!["map".to_owned()], vec![]));
    world.run(&mut second);
    assert_eq!(world.image(&second, "map").data, [130.0; 2]);
    world.run(&mut second);
    assert_eq!(world.image(&second, "map").data, [230.0; 2]);
}
