//! Every format is decoded, and buffers are dumped with the names of their fields.

use manylight_gpu::TextureArray;
use manylight_graph::{
    registry::{External, PortKind},
    value::Format,
};

use crate::support::World;

/// Writes one texel of a format and reads it back.
fn texel(format: &str, wgsl: &str, value: &str, encoding: &str) -> Vec<f32> {
    let node = format!(
        r#"Node(doc: "Writes a texel.", outputs: {{"picture": Texture(format: {format}, doc: "it")}}, steps: [(entry: "put", over: Texels("picture"))])"#
    );
    let shader = format!(
        "@group(0) @binding(0) var picture: texture_storage_2d<{wgsl}, write>;
         @compute @workgroup_size(1) fn put(@builtin(global_invocation_id) id: vec3u) {{ textureStore(picture, id.xy, {value}); }}"
    );
    let pipeline = format!(
        r#"Pipeline(doc: "t", resources: {{"picture": Texture(format: {format}, size: Fixed(3, 2){encoding})}},
        nodes: [(id: "put", node: "test/put")], presents: "picture")"#
    );
    let world =
        World::new(&[("shaders/test/put.ron", node.as_str()), ("shaders/test/put.wgsl", &shader), ("pipelines/test.ron", &pipeline)]);
    let image = world.image(&world.once(), "picture");
    assert_eq!((image.width, image.height), (3, 2));
    assert_eq!(image.pixel(0, 0), image.pixel(2, 1));
    image.pixel(1, 1).to_vec()
}

#[test]
fn float_formats() {
    let value = "vec4f(0.2, -3.0, 1.0 / 3.0, 0.5)";
    let third = 1.0 / 3.0;
    for (format, wgsl, expected) in [
        ("R32Float", "r32float", vec![0.2]),
        ("Rg32Float", "rg32float", vec![0.2, -3.0]),
        ("Rgba32Float", "rgba32float", vec![0.2, -3.0, third, 0.5]),
        ("Rgba16Float", "rgba16float", vec![0.199_951_17, -3.0, 0.333_251_95, 0.5]),
        ("Rgba8Unorm", "rgba8unorm", vec![0.2, 0.0, third, 128.0 / 255.0]),
        ("R16Float", "r16float", vec![0.199_951_17]),
        ("Rg16Float", "rg16float", vec![0.199_951_17, -3.0]),
        ("R8Unorm", "r8unorm", vec![0.2]),
    ] {
        let read = texel(format, wgsl, value, "");
        assert_eq!(read.len(), expected.len(), "{format}");
        for (a, b) in read.iter().zip(&expected) {
            // Halves may be rounded either way by the driver.
            assert!((a - b).abs() <= 2f32.powi(-11) * b.abs().max(1e-3), "{format}: {read:?} is not {expected:?}");
        }
    }
}

#[test]
fn whole_number_formats() {
    assert_eq!(texel("R32Uint", "r32uint", "vec4u(70000u)", ""), [70000.0]);
    assert_eq!(texel("Rg32Uint", "rg32uint", "vec4u(1u, 2u, 0u, 0u)", ""), [1.0, 2.0]);
    assert_eq!(texel("Rgba32Uint", "rgba32uint", "vec4u(1u, 2u, 3u, 4u)", ""), [1.0, 2.0, 3.0, 4.0]);
}

#[test]
fn octahedral_codes_are_vectors_and_zero_is_none() {
    let encoding = ", encoding: Octahedral";
    let at = |value: &str| texel("R32Uint", "r32uint", value, encoding);
    assert_eq!(at("vec4u(0u)"), [0.0, 0.0, 0.0]);
    assert_eq!(at("vec4u(pack2x16snorm(vec2f(-1.0, 0.0)))"), [-1.0, 0.0, 0.0]);
    let v = at("vec4u(pack2x16snorm(vec2f(0.5, 0.25)))");
    assert!((v[0] / v[2] - 2.0).abs() < 1e-3 && (v[1] / v[2] - 1.0).abs() < 1e-3, "{v:?}");
}

#[test]
fn srgb_arrays_are_decoded_to_linear() {
    let world = {
        let mut world = World::new(&[
            (
                "shaders/test/sample.ron",
                r#"Node(doc: "Reads a layer.", inputs: {"layers": Texture(format: Rgba8UnormSrgb, array: true, doc: "textures")},
                outputs: {"picture": Texture(format: Rgba32Float, doc: "a texel")}, steps: [(entry: "sample", over: Texels("picture"))])"#,
            ),
            (
                "shaders/test/sample.wgsl",
                r"@group(0) @binding(0) var layers: texture_2d_array<f32>;
                @group(0) @binding(1) var linear_repeat_sampler: sampler;
                @group(0) @binding(2) var picture: texture_storage_2d<rgba32float, write>;
                @compute @workgroup_size(1) fn sample(@builtin(global_invocation_id) id: vec3u) {
                    textureStore(picture, id.xy, textureSampleLevel(layers, linear_repeat_sampler, vec2f(1.25, 0.25), 1, 0.0));
                }",
            ),
            (
                "pipelines/test.ron",
                r#"Pipeline(doc: "t", resources: {"picture": Texture(format: Rgba32Float, size: Fixed(1, 1))},
                nodes: [(id: "sample", node: "test/sample")], presents: "picture")"#,
            ),
        ]);
        let kind = PortKind::Texture { format: Some(Format::Rgba8UnormSrgb), array: true };
        world.declared = vec![External { name: "layers".into(), kind, doc: "textures".into(), layout: None }];
        let (black, grey) = ([0u8; 20], [188u8, 188, 188, 255].repeat(5));
        let data = TextureArray { format: Format::Rgba8UnormSrgb, width: 2, height: 2, mips: 2, layers: &[&black, &grey] };
        world.externals.set_texture_array(&world.gpu, "layers", data).unwrap();
        world
    };
    let frame = world.once();
    let grey = world.image(&frame, "picture").data;
    assert!((grey[0] - 0.503).abs() < 1e-3 && grey[3] == 1.0, "{grey:?}");
    let part = manylight_gpu::Subresource { mip: 1, layer: 1 };
    let dumped = frame.read_image(&world.gpu, &world.externals, "layers", part).unwrap();
    assert_eq!((dumped.width, dumped.channels), (1, 4));
    // Drivers decode sRGB with tables; the dump is exact.
    assert!((dumped.data[0] - grey[0]).abs() < 2e-3);
}

#[test]
fn buffers_are_dumped_with_field_names() {
    let world = World::new(&[
        (
            "shaders/test/cast.ron",
            r#"Node(doc: "Fills a buffer.", outputs: {"lights": Buffer(of: "Light", doc: "lights"), "picture": Texture(format: R32Float, doc: "none")},
            steps: [(entry: "fill", over: Elements("lights"))])"#,
        ),
        (
            "shaders/test/cast.wgsl",
            r"struct Inner { a: u32, b: array<i32, 2> }
            struct Light { position: vec3f, power: f32, frame: mat2x2f, inner: Inner }
            @group(0) @binding(0) var<storage, read_write> lights: array<Light>;
            @group(0) @binding(1) var picture: texture_storage_2d<r32float, write>;
            @compute @workgroup_size(1) fn fill(@builtin(global_invocation_id) id: vec3u) {
                let zero = f32(id.y);
                let powers = array(0.1, 1.0 / zero, zero / zero);
                lights[id.x] = Light(vec3f(1.0, 2.0, f32(id.x)), powers[id.x], mat2x2f(1.0, 2.0, 3.0, 4.0), Inner(id.x, array(-1, 5)));
                textureStore(picture, id.xy, vec4f());
            }",
        ),
        (
            "pipelines/test.ron",
            r#"Pipeline(doc: "t", resources: {"lights": Buffer(of: "Light", count: 3), "picture": Texture(format: R32Float, size: Output)},
            nodes: [(id: "cast", node: "test/cast")], presents: "picture")"#,
        ),
    ])
    .keep(&["lights"]);
    let frame = world.once();
    let dumped = world.json(&frame, "lights");
    let first =
        serde_json::json!({"position": [1.0, 2.0, 0.0], "power": 0.1, "frame": [[1.0, 2.0], [3.0, 4.0]], "inner": {"a": 0, "b": [-1, 5]}});
    assert_eq!(dumped[0], first);
    assert_eq!((&dumped[1]["power"], &dumped[2]["power"]), (&serde_json::json!("inf"), &serde_json::json!("NaN")));
    let error = frame.read_json(&world.gpu, &world.externals, "picture").unwrap_err().to_string();
    assert!(error.contains("`picture`") && error.contains("a buffer"), "{error}");
    let error = frame.read_json(&world.gpu, &world.externals, "nothing").unwrap_err().to_string();
    assert!(error.contains("`nothing`"), "{error}");
}
