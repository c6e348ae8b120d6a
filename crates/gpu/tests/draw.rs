//! Draws: several targets, reverse depth, both windings, a node that mixes draws and dispatches, and absent ports.

use crate::support::World;

const NODE: &str = r#"Node(doc: "Two triangles, then a count of texels.",
    outputs: {
        "color": Texture(format: Rgba8Unorm, doc: "colour"), "id": Texture(format: R32Uint, doc: "triangle + 1"),
        "depth": Texture(format: Depth32Float, doc: "depth"), "done": Buffer(of: "u32", doc: "a mark"),
    },
    steps: [
        Draw(vertex: "vs", fragment: "fs", vertices: 6, targets: ["color", "id"], depth: "depth"),
        (entry: "mark", over: Elements("done")),
    ])"#;

const SHADER: &str = r"
struct Between { @builtin(position) at: vec4f, @location(0) @interpolate(flat) triangle: u32 }
@vertex fn vs(@builtin(vertex_index) index: u32) -> Between {
    let triangle = index / 3u;
    var corners = array(vec2f(-1.0, -1.0), vec2f(3.0, -1.0), vec2f(-1.0, 3.0));
    var corner = corners[index % 3u];
    // The second covers the left half, has the other winding and lies behind.
    if triangle == 1u { corner = vec2f(corners[2u - index % 3u]); }
    if triangle == 0u { corner.x = max(corner.x, 0.0) * 3.0; if index == 1u { corner = vec2f(3.0, -1.0); } }
    return Between(vec4f(corner, select(0.75, 0.25, triangle == 1u), 1.0), triangle);
}
struct Out { @location(0) color: vec4f, @location(1) id: u32 }
@fragment fn fs(between: Between) -> Out {
    return Out(vec4f(f32(between.triangle), 0.5, 1.0, 1.0), between.triangle + 1u);
}
@group(0) @binding(0) var<storage, read_write> done: array<u32>;
@compute @workgroup_size(1) fn mark() { done[0] = 7u; }
";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "color": Texture(format: Rgba8Unorm, size: Output), "id": Texture(format: R32Uint, size: Output),
    "depth": Texture(format: Depth32Float, size: Output), "done": Buffer(of: "u32", count: 1),
}, nodes: [(id: "draw", node: "test/draw")], presents: "color")"#;

#[test]
fn nearer_wins_whatever_the_order_and_winding() {
    let files = [("shaders/test/draw.ron", NODE), ("shaders/test/draw.wgsl", SHADER), ("pipelines/test.ron", PIPELINE)];
    let world = World::new(&files).keep(&["id", "depth", "done"]);
    let frame = world.once();
    let (id, depth, color) = (world.image(&frame, "id"), world.image(&frame, "depth"), world.image(&frame, "color"));
    let mut seen = [0; 3];
    for y in 0..id.height {
        for x in 0..id.width {
            let triangle = id.pixel(x, y)[0];
            seen[triangle as usize] += 1;
            let expected = match triangle as u32 {
                1 => (0.75, 0.0),
                2 => (0.25, 1.0),
                _ => panic!("the second triangle covers everything"),
            };
            assert_eq!((depth.pixel(x, y)[0], color.pixel(x, y)[0]), expected, "{x}, {y}");
        }
    }
    assert!(seen[1] > 0 && seen[2] > 0, "both can be seen: {seen:?}");
    assert_eq!(world.json(&frame, "done"), serde_json::json!([7]));
    assert!(world.gpu.take_errors().is_empty());
}

const EMPTY: &str = r#"Node(doc: "A draw of nothing.", outputs: {"color": Texture(format: Rgba16Float, doc: "colour"),
    "depth": Texture(format: Depth32Float, doc: "depth")},
    steps: [Draw(vertex: "vs", fragment: "fs", vertices: 0, targets: ["color"], depth: "depth")])"#;

const EMPTY_SHADER: &str = r"
@vertex fn vs() -> @builtin(position) vec4f { return vec4f(); }
@fragment fn fs() -> @location(0) vec4f { return vec4f(1.0); }";

#[test]
fn targets_are_cleared_to_zero() {
    let pipeline = r#"Pipeline(doc: "t", resources: {
        "color": Texture(format: Rgba16Float, size: Output), "depth": Texture(format: Depth32Float, size: Output),
    }, nodes: [(id: "draw", node: "test/draw")], presents: "color")"#;
    let files = [("shaders/test/draw.ron", EMPTY), ("shaders/test/draw.wgsl", EMPTY_SHADER), ("pipelines/test.ron", pipeline)];
    let mut world = World::new(&files).keep(&["depth"]);
    // Even where memory was poisoned before.
    world.options.poison = true;
    let frame = world.once();
    assert!(world.image(&frame, "color").data.iter().chain(&world.image(&frame, "depth").data).all(|v| *v == 0.0));
}

/// A target that nobody reads is left out; the others keep their places.
#[test]
fn a_draw_without_one_of_its_targets_writes_the_others() {
    let node = NODE.replace("\"color\": Texture(format: Rgba8Unorm,", "\"color\": Texture(format: Rgba8Unorm, optional: true,");
    let pipeline = PIPELINE.replace(
        "\"id\": Texture(format: R32Uint, size: Output)",
        "\"id\": Texture(format: R32Uint, size: Output), \"seen\": Texture(format: Rgba8Unorm, size: Output)",
    );
    let pipeline =
        pipeline.replace("nodes: [", "nodes: [(id: \"see\", node: \"test/see\"),").replace("presents: \"color\"", "presents: \"seen\"");
    let see = r#"Node(doc: "Shows it.", inputs: {"id": Texture(format: R32Uint, doc: "triangle + 1")},
        outputs: {"seen": Texture(format: Rgba8Unorm, doc: "the same")}, steps: [(entry: "see", over: Texels("seen"))])"#;
    let see_shader = r"
@group(0) @binding(0) var id: texture_2d<u32>;
@group(0) @binding(1) var seen: texture_storage_2d<rgba8unorm, write>;
@compute @workgroup_size(1) fn see(@builtin(global_invocation_id) at: vec3u) {
    textureStore(seen, at.xy, vec4f(f32(textureLoad(id, at.xy, 0).x) / 255.0));
}";
    let files = [
        ("shaders/test/draw.ron", node.as_str()),
        ("shaders/test/draw.wgsl", SHADER),
        ("shaders/test/see.ron", see),
        ("shaders/test/see.wgsl", see_shader),
        ("pipelines/test.ron", pipeline.as_str()),
    ];
    let world = World::new(&files).keep(&["id", "depth"]);
    let frame = world.once();
    assert_eq!(frame.plan().resource("color"), None);
    let (id, seen) = (world.image(&frame, "id"), world.image(&frame, "seen"));
    assert!(
        (0..id.height)
            .all(|y| (0..id.width).all(|x| (seen.pixel(x, y)[0] * 255.0).round() == id.pixel(x, y)[0] && id.pixel(x, y)[0] > 0.0))
    );
    assert!(world.gpu.take_errors().is_empty());
    // With somebody who keeps it, all is as before.
    let world = World::new(&files).keep(&["id", "color"]);
    let frame = world.once();
    assert!(world.image(&frame, "color").data.iter().any(|v| *v != 0.0));
}

const OPTIONAL: &str = r#"Node(doc: "Looks at ports that may be absent.",
    inputs: {
        "map": Texture(optional: true, doc: "floats"), "codes": Texture(format: R32Uint, optional: true, doc: "codes"),
        "list": Buffer(of: "vec4f", optional: true, doc: "vectors"), "deep": Texture(format: Depth32Float, optional: true, doc: "depth"),
    },
    outputs: {"picture": Texture(format: Rgba32Float, doc: "what is there")},
    steps: [(entry: "look", over: Texels("picture"))])"#;

const OPTIONAL_SHADER: &str = r"
@group(0) @binding(0) var map: texture_2d<f32>;
@group(0) @binding(1) var codes: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> list: array<vec4f>;
@group(0) @binding(3) var deep: texture_depth_2d;
@group(0) @binding(4) var linear_sampler: sampler;
@group(1) @binding(0) var picture: texture_storage_2d<rgba32float, write>;
@compute @workgroup_size(1) fn look(@builtin(global_invocation_id) id: vec3u) {
    let sizes = vec4f(f32(textureDimensions(map).x), f32(textureDimensions(codes).y), f32(arrayLength(&list)), f32(textureDimensions(deep).x));
    let values = textureSampleLevel(map, linear_sampler, vec2f(0.5), 0.0) + vec4f(textureLoad(codes, vec2u(0), 0)) + list[0]
        + vec4f(textureLoad(deep, vec2u(0), 0));
    textureStore(picture, id.xy, sizes + 100.0 * vec4f(values.xyz, 0.0));
}";

#[test]
fn absent_ports_are_one_zeroed_element() {
    let pipeline = r#"Pipeline(doc: "t", resources: { "picture": Texture(format: Rgba32Float, size: Output) },
        nodes: [(id: "look", node: "test/look")], presents: "picture")"#;
    let files = [("shaders/test/look.ron", OPTIONAL), ("shaders/test/look.wgsl", OPTIONAL_SHADER), ("pipelines/test.ron", pipeline)];
    let world = World::new(&files);
    let frame = world.once();
    assert!(world.image(&frame, "picture").data.iter().all(|v| *v == 1.0));
}
