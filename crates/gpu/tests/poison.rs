//! Poison shows what is read but never written, and changes nothing else.

use manylight_gpu::memory::Holding;

use crate::support::World;

const FILL: &str = r#"Node(doc: "Writes a texture, whole or in part.", params: {"all": Bool(default: true, doc: "every texel")},
    outputs: {"a": Texture(format: R32Float, doc: "numbers")}, steps: [(entry: "fill", over: Texels("a"))])"#;

const FILL_SHADER: &str = r"
override all: bool = true;
@group(0) @binding(0) var a: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8) fn fill(@builtin(global_invocation_id) id: vec3u) {
    if all || id.x > 0u { textureStore(a, id.xy, vec4f(f32(id.x))); }
}";

const NEXT: &str = r#"Node(doc: "Adds one.", inputs: {"source": Texture(format: R32Float, doc: "numbers")},
    outputs: {"to": Texture(format: R32Float, doc: "numbers")}, steps: [(entry: "add", over: Texels("to"))])"#;

const NEXT_SHADER: &str = r"
@group(0) @binding(0) var source: texture_2d<f32>;
@group(0) @binding(1) var to: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8) fn add(@builtin(global_invocation_id) id: vec3u) {
    textureStore(to, id.xy, textureLoad(source, id.xy, 0) + 1.0);
}";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "a": Texture(format: R32Float, size: Output), "b": Texture(format: R32Float, size: Output),
    "c": Texture(format: R32Float, size: Output), "d": Texture(format: R32Float, size: Output),
    "picture": Texture(format: R32Float, size: Output),
}, nodes: [
    (id: "fill", node: "test/fill"),
    (id: "one", node: "test/next", in: {"source": "a"}, out: {"to": "b"}),
    (id: "two", node: "test/next", in: {"source": "b"}, out: {"to": "c"}),
    (id: "three", node: "test/next", in: {"source": "c"}, out: {"to": "d"}),
    (id: "four", node: "test/next", in: {"source": "d"}, out: {"to": "picture"}),
], presents: "picture")"#;

fn world() -> World {
    World::new(&[
        ("shaders/test/fill.ron", FILL),
        ("shaders/test/fill.wgsl", FILL_SHADER),
        ("shaders/test/next.ron", NEXT),
        ("shaders/test/next.wgsl", NEXT_SHADER),
        ("pipelines/test.ron", PIPELINE),
    ])
}

#[test]
fn a_complete_pipeline_is_bit_equal_with_poison_and_without_reuse() {
    let mut world = world();
    let clean = world.image(&world.once(), "picture");
    assert_eq!(clean.pixel(3, 2), [7.0]);
    for (poison, no_reuse) in [(true, false), (true, true), (false, true)] {
        world.options.poison = poison;
        world.input.debug.no_reuse = no_reuse;
        let mut frame = world.build();
        for _ in 0..2 {
            world.run(&mut frame);
            assert_eq!(world.image(&frame, "picture"), clean, "poison: {poison}, no reuse: {no_reuse}");
        }
    }
}

#[test]
fn what_nobody_wrote_turns_into_nan() {
    let mut world = world();
    world.input.set = vec![("fill.all".to_owned(), "false".to_owned())];
    world.options.poison = true;
    let image = world.image(&world.once(), "picture");
    assert!(image.pixel(0, 1)[0].is_nan());
    assert_eq!(image.pixel(1, 1), [5.0]);
}

#[test]
fn transients_share_slots_and_the_report_says_so() {
    let mut world = world();
    let frame = world.build();
    let report = frame.memory_report();
    let picture = 8 * 4 * 4;
    assert_eq!((report.kept, report.pool, report.pool_unshared), (picture, 2 * picture, 4 * picture));
    assert_eq!(report.total(), 3 * picture);
    let slots = report.resources.iter().filter(|r| matches!(r.holding, Holding::Pool { .. }));
    assert_eq!(slots.count(), 4);
    world.input.debug.no_reuse = true;
    assert_eq!(world.build().memory_report().pool, 4 * picture);
}

#[test]
fn a_rebuild_takes_over_memory_of_equal_shape() {
    let world = world();
    let first = world.once();
    let (second, _) = world.try_build(Some(&first)).unwrap();
    for name in ["a", "b", "c", "d", "picture"] {
        assert_eq!(first.memory(name), second.memory(name), "{name}");
    }
}
