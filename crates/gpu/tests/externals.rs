//! Externals: read by name, written again in place, followed when their memory is replaced, refused when they do not fit.

use manylight_gpu::{Fault, HostData, RunError};
use manylight_graph::registry::{External, PortKind};

use crate::support::World;

const NODE: &str = r#"Node(doc: "Sums.", inputs: {"weights": Buffer(of: "f32", doc: "numbers"), "view": Uniform(of: "View", doc: "a factor")},
    outputs: {"picture": Texture(format: Rgba32Float, doc: "sum, count")}, steps: [(entry: "sum", over: Texels("picture"))])"#;

const SHADER: &str = r"
struct View { factor: f32 }
@group(0) @binding(0) var<storage, read> weights: array<f32>;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var picture: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(1) fn sum(@builtin(global_invocation_id) id: vec3u) {
    var sum = 0.0;
    for (var i = 0u; i < arrayLength(&weights); i++) { sum += weights[i]; }
    textureStore(picture, id.xy, vec4f(sum * view.factor, f32(arrayLength(&weights)), 0.0, 0.0));
}";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {"picture": Texture(format: Rgba32Float, size: Fixed(1, 1))},
    nodes: [(id: "sum", node: "test/sum")], presents: "picture")"#;

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn world() -> World {
    let mut world = World::new(&[("shaders/test/sum.ron", NODE), ("shaders/test/sum.wgsl", SHADER), ("pipelines/test.ron", PIPELINE)]);
    let external = |name: &str, kind| External { name: name.into(), kind, doc: "test data".into(), layout: None };
    world.declared =
        vec![external("weights", PortKind::Buffer { of: "f32".into() }), external("view", PortKind::Uniform { of: "View".into() })];
    world.externals.set_buffer(&world.gpu, "weights", "f32", 4, &bytes(&[1.0, 2.0])).unwrap();
    world.externals.set_uniform(&world.gpu, "view", "View", &bytes(&[10.0])).unwrap();
    world
}

fn sum(world: &World, frame: &manylight_gpu::Frame) -> [f32; 2] {
    let image = world.image(frame, "picture");
    [image.data[0], image.data[1]]
}

#[test]
fn a_frame_follows_externals_whose_memory_is_replaced() {
    let mut world = world();
    let mut frame = world.once();
    assert_eq!(sum(&world, &frame), [30.0, 2.0]);
    world.externals.set_uniform(&world.gpu, "view", "View", &bytes(&[2.0])).unwrap();
    world.run(&mut frame);
    assert_eq!(sum(&world, &frame), [6.0, 2.0]);
    world.externals.set_buffer(&world.gpu, "weights", "f32", 4, &bytes(&[1.0, 2.0, 4.0])).unwrap();
    world.run(&mut frame);
    assert_eq!(sum(&world, &frame), [14.0, 3.0]);
    world.externals.set_buffer(&world.gpu, "weights", "f32", 4, &[]).unwrap();
    world.run(&mut frame);
    assert_eq!(sum(&world, &frame), [0.0, 1.0]);
    assert!(world.gpu.take_errors().is_empty());
}

#[test]
fn stamps_grow_with_every_write() {
    let mut world = world();
    let before = world.externals.stamp("view");
    world.externals.set_uniform(&world.gpu, "view", "View", &bytes(&[2.0])).unwrap();
    assert!(world.externals.stamp("view") > before);
    assert_eq!(world.externals.stamp("nothing"), 0);
}

#[test]
fn externals_that_vanish_or_change_their_kind_are_errors() {
    let mut world = world();
    let mut frame = world.once();
    world.externals.set_buffer(&world.gpu, "weights", "vec2f", 8, &bytes(&[1.0, 2.0])).unwrap();
    let error = frame.record_and_submit(&world.gpu, &world.externals, HostData::none());
    // The memory still fits, so nobody needs to look: same buffer, same frame.
    assert!(error.is_ok());
    world.externals.set_buffer(&world.gpu, "weights", "vec2f", 8, &bytes(&[1.0; 8])).unwrap();
    let error = frame.record_and_submit(&world.gpu, &world.externals, HostData::none()).unwrap_err();
    assert!(matches!(error, RunError::External(Fault::WrongExternal { .. })), "{error}");
    world.externals.remove("weights");
    let error = frame.record_and_submit(&world.gpu, &world.externals, HostData::none()).unwrap_err();
    assert!(matches!(error, RunError::External(Fault::MissingExternal { .. })), "{error}");
}

#[test]
fn layers_of_the_wrong_size_are_refused() {
    let mut world = world();
    let data = manylight_gpu::TextureArray {
        format: manylight_graph::value::Format::Rgba8Unorm,
        width: 2,
        height: 2,
        mips: 1,
        layers: &[&[0; 15]],
    };
    let error = world.externals.set_texture_array(&world.gpu, "t", data).unwrap_err().to_string();
    assert!(error.contains("15 bytes") && error.contains("16"), "{error}");
}
