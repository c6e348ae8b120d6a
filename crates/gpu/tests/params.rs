//! Parameters of every type reach the shader through the uniform and through overridable constants.

use crate::support::{SHOW, World};

const NODE: &str = r#"Node(
    doc: "Writes down its parameters.",
    outputs: {"values": Buffer(of: "f32", doc: "the parameters")},
    params: {
        "whole": Int(min: -10, max: 10, default: -3, doc: "a whole number"),
        "count": Int(min: 0, max: 10, default: 7, doc: "a whole number"),
        "real": Float(min: 0.0, max: 1.0, default: 0.25, doc: "a real number"),
        "on": Bool(default: true, doc: "a switch"),
        "mode": Choice(options: ["first", "second", "third"], default: "third", doc: "a choice"),
        "scale": Float(min: 0.0, max: 9.0, default: 1.5, doc: "an override"),
        "fast": Bool(default: true, doc: "an override"),
        "way": Choice(options: ["left", "right"], default: "right", doc: "an override"),
    },
    steps: [(entry: "write", over: Groups(1, 1, 1))],
)"#;

const SHADER: &str = r"
struct Params { real: f32, whole: i32, count: u32, on: u32, mode: u32 }
@group(1) @binding(3) var<uniform> params: Params;
@group(0) @binding(2) var<storage, read_write> values: array<f32>;
override scale: f32 = 0.0;
override fast: bool = false;
override way: u32 = 9u;
override way_is_left: bool = true;
override way_is_right: bool = false;
@compute @workgroup_size(1) fn write() {
    values[0] = params.real;
    values[1] = f32(params.whole);
    values[2] = f32(params.count);
    values[3] = f32(params.on);
    values[4] = f32(params.mode);
    values[5] = scale;
    values[6] = f32(fast);
    values[7] = f32(way);
    values[8] = f32(way_is_left);
    values[9] = f32(way_is_right);
}";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "values": Buffer(of: "f32", count: 10), "picture": Texture(format: Rgba32Float, size: Fixed(1, 1)),
}, nodes: [(id: "write", node: "test/write"), (id: "show", node: "test/show")], presents: "picture")"#;

fn world() -> World {
    let mut files = vec![("shaders/test/write.ron", NODE), ("shaders/test/write.wgsl", SHADER), ("pipelines/test.ron", PIPELINE)];
    files.extend(SHOW);
    World::new(&files).keep(&["values"])
}

#[test]
fn defaults_reach_uniform_fields_and_overrides() {
    let world = world();
    let frame = world.once();
    assert_eq!(world.floats(&frame, "values"), [0.25, -3.0, 7.0, 1.0, 2.0, 1.5, 1.0, 1.0, 0.0, 1.0]);
    assert_eq!(world.image(&frame, "picture").data, [0.25; 4]);
}

#[test]
fn set_values_reach_them_and_only_overrides_compile_again() {
    let mut world = world();
    let frame = world.once();
    let set = |name: &str, value: &str| (name.to_owned(), value.to_owned());
    world.input.set = vec![set("write.real", "0.5"), set("write.on", "false"), set("write.mode", "first")];
    let (mut uniforms, report) = world.try_build(Some(&frame)).unwrap();
    assert_eq!((report.compiled, report.reused), (0, 2));
    assert_eq!(report.kept, ["write", "show"]);
    world.run(&mut uniforms);
    assert_eq!(world.floats(&uniforms, "values")[..5], [0.5, -3.0, 7.0, 0.0, 0.0]);
    world.input.set = vec![set("write.way", "left"), set("write.fast", "false")];
    let (mut overrides, report) = world.try_build(Some(&frame)).unwrap();
    assert_eq!((report.compiled, report.reused), (1, 1));
    assert_eq!((report.kept, report.rebuilt), (vec!["show".to_owned()], vec!["write".to_owned()]));
    world.run(&mut overrides);
    assert_eq!(world.floats(&overrides, "values")[6..], [0.0, 0.0, 1.0, 0.0]);
}
