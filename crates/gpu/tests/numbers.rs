//! Bad numbers are found where they are written: in levels and layers of textures, in fields of structures, by every node that writes.

use manylight_gpu::{BadNumber, NumberPlace};

use crate::support::World;

const WRITE: &str = r#"Node(doc: "Writes.", outputs: {
        "a": Texture(format: Rg32Float, doc: "numbers", at_least: -1.0, at_most: 100.0),
        "list": Buffer(of: "Item", doc: "items"),
        "plain": Buffer(of: "vec3f", doc: "vectors, padded"),
    }, steps: [(entry: "level_0", over: Texels("a")), (entry: "down", over: Texels("a"), repeat: Down("a")), (entry: "items", over: Elements("list"))])"#;

const SHADER: &str = r"
struct Inner { weights: array<f32, 3>, id: u32 }
struct Item { place: vec3f, count: u32, inner: Inner }
@group(0) @binding(0) var a: texture_storage_2d<rg32float, write>;
@group(0) @binding(1) var a_finer: texture_2d<f32>;
@group(0) @binding(2) var<storage, read_write> list: array<Item>;
@group(0) @binding(3) var<storage, read_write> plain: array<vec3f>;
@compute @workgroup_size(8, 8) fn level_0(@builtin(global_invocation_id) id: vec3u) {
    textureStore(a, id.xy, vec4f(f32(id.x)));
}
@compute @workgroup_size(8, 8) fn down(@builtin(global_invocation_id) id: vec3u) {
    let v = textureLoad(a_finer, id.xy, 0).xy;
    textureStore(a, id.xy, vec4f(v TEXEL, 0.0, 1.0));
}
@compute @workgroup_size(64) fn items(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&list) { return; }
    let zero = f32(id.x) * 0.0;
    // All bits set is NaN, but not as a whole number.
    list[id.x] = Item(vec3f(1.0), 0xffffffffu, Inner(array<f32, 3>(1.0, WEIGHT, 3.0), 0x7f800000u));
    plain[id.x] = vec3f(1.0, 1.0, PLAIN);
}";

const SHOW: &str = r#"Node(doc: "Shows.", inputs: {"a": Texture(format: Rg32Float, doc: "numbers"), "list": Buffer(of: "Item", doc: "items"),
        "plain": Buffer(of: "vec3f", doc: "vectors")},
    outputs: {"picture": Texture(format: R32Float, doc: "numbers", at_most: 50.0)}, steps: [(entry: "show", over: Texels("picture"))])"#;

const SHOW_SHADER: &str = r"
struct Inner { weights: array<f32, 3>, id: u32 }
struct Item { place: vec3f, count: u32, inner: Inner }
@group(0) @binding(0) var a: texture_2d<f32>;
@group(0) @binding(1) var<storage, read> list: array<Item>;
@group(0) @binding(2) var<storage, read> plain: array<vec3f>;
@group(0) @binding(3) var picture: texture_storage_2d<r32float, write>;
@compute @workgroup_size(8, 8) fn show(@builtin(global_invocation_id) id: vec3u) {
    let sum = list[0].inner.weights[0] + plain[0].x;
    textureStore(picture, id.xy, vec4f(textureLoad(a, id.xy, 0).x * sum PICTURE));
}";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "a": Texture(format: Rg32Float, size: Size(8, 4), mips: Count(3)), "list": Buffer(of: "Item", count: 70), "plain": Buffer(of: "vec3f", count: 70),
    "picture": Texture(format: R32Float, size: Output),
}, nodes: [(id: "write", node: "test/write"), (id: "show", node: "test/show")], presents: "picture")"#;

/// What is found with these terms in the shaders.
fn found(texel: &str, weight: &str, plain: &str, picture: &str) -> Vec<String> {
    let shader = SHADER.replace("TEXEL", texel).replace("WEIGHT", weight).replace("PLAIN", plain);
    let mut world = World::new(&[
        ("shaders/test/write.ron", WRITE),
        ("shaders/test/write.wgsl", &shader),
        ("shaders/test/show.ron", SHOW),
        ("shaders/test/show.wgsl", &SHOW_SHADER.replace("PICTURE", picture)),
        ("pipelines/test.ron", PIPELINE),
    ]);
    world.options.watch_numbers = true;
    let mut frame = world.build();
    for serial in [true, false] {
        frame.measure_serially(serial);
        world.run(&mut frame);
    }
    let all = frame.bad_numbers(&world.gpu).unwrap_or_else(|e| panic!("{e}"));
    assert!(all.iter().all(|bad| (bad.what == BadNumber::NotANumber) == bad.to_string().contains("NaN")));
    assert!(all.iter().all(|bad| matches!(bad.place, NumberPlace::Texel { .. }) == (bad.resource == "a" || bad.resource == "picture")));
    all.iter().map(ToString::to_string).collect()
}

#[test]
fn good_numbers_are_not_told() {
    assert_eq!(found("", "2.0", "1.0", ""), Vec::<String>::new());
}

#[test]
fn what_is_bad_is_told_with_its_node_and_place() {
    let write = |rest: &str| vec![format!("node `write` (test/write) writes {rest}")];
    assert_eq!(
        found("* select(vec2f(1.0), vec2f(1.0, -20.0), all(id.xy == vec2u(1, 0)) && textureDimensions(a).x == 2)", "2.0", "1.0", ""),
        write("`a`: texel (1, 0) of level 2, layer 0, channel 1 is less than -1")
    );
    assert_eq!(found("", "select(2.0, log(zero), id.x == 66u)", "1.0", ""), write("`list`: element 66.inner.weights[1] is infinite"));
    assert_eq!(
        found("", "2.0", "select(2.0, sqrt(zero - 1.0), id.x % 10u == 3u)", ""),
        write("`plain`: element 3[2] is NaN, and so are 6 numbers after it")
    );
    let all = found("", "2.0", "1.0", "+ 47.0");
    assert_eq!(all.len(), 1);
    assert!(
        all[0].starts_with("node `show` (test/show) writes `picture`: texel (2, 0) of level 0, layer 0, channel 0 is more than 50"),
        "{}",
        all[0]
    );
}
