//! Steps repeated over mip levels: each level sees the finer or coarser one.

use crate::support::World;

const NODE: &str = r#"Node(doc: "Sums down, counts up.",
    outputs: {"pyramid": Texture(format: R32Float, doc: "sums")},
    steps: [
        (entry: "base", over: Texels("pyramid")),
        (entry: "down", over: Texels("pyramid"), repeat: Down("pyramid")),
        (entry: "up", over: Texels("pyramid"), repeat: Up("pyramid")),
    ])"#;

const SHADER: &str = r"
@group(0) @binding(0) var pyramid: texture_storage_2d<r32float, write>;
@group(0) @binding(1) var pyramid_finer: texture_2d<f32>;
@group(0) @binding(2) var pyramid_coarser: texture_2d<f32>;
@compute @workgroup_size(4, 4) fn base(@builtin(global_invocation_id) id: vec3u) {
    textureStore(pyramid, id.xy, vec4f(f32(id.x + 8u * id.y)));
}
@compute @workgroup_size(4, 4) fn down(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(pyramid_finer);
    var sum = 0.0;
    for (var y = 2u * id.y; y < min(2u * id.y + 2u, size.y); y++) {
        for (var x = 2u * id.x; x < min(2u * id.x + 2u, size.x); x++) {
            sum += textureLoad(pyramid_finer, vec2u(x, y), 0).x;
        }
    }
    textureStore(pyramid, id.xy, vec4f(sum));
}
@compute @workgroup_size(4, 4) fn up(@builtin(global_invocation_id) id: vec3u) {
    let at = min(id.xy / 2u, textureDimensions(pyramid_coarser) - 1u);
    textureStore(pyramid, id.xy, textureLoad(pyramid_coarser, at, 0) + 1.0);
}";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: { "pyramid": Texture(format: R32Float, size: Fixed(8, 4), mips: Full) },
    nodes: [(id: "sum", node: "test/sum")], presents: "pyramid")"#;

fn world(node: &str) -> World {
    World::new(&[("shaders/test/sum.ron", node), ("shaders/test/sum.wgsl", SHADER), ("pipelines/test.ron", PIPELINE)])
}

#[test]
fn down_and_up_visit_every_level_in_order() {
    let world = world(NODE);
    let frame = world.once();
    let total = (0..32).sum::<u32>() as f32;
    // 8×4, 4×2, 2×1, 1×1: the last level holds the sum, and each finer one adds 1.
    for (mip, size) in [(3, 1), (2, 2), (1, 8), (0, 32)] {
        let image = world.image_at(&frame, "pyramid", mip);
        assert_eq!(image.data, vec![total + (3 - mip) as f32; size], "level {mip}");
    }
}

#[test]
fn levels_and_layers_that_are_not_there_are_errors() {
    let world = world(NODE);
    let frame = world.once();
    let part = manylight_gpu::Subresource { mip: 4, layer: 0 };
    let error = frame.read_image(&world.gpu, &world.externals, "pyramid", part).unwrap_err().to_string();
    assert!(error.contains("4 mip levels"), "{error}");
}
