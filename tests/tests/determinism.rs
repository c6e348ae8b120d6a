//! The same input gives the same bits, and no debug switch changes the picture.

use manylight_graph::plan::Debug;

use crate::{
    renders::{Job, read},
    support::project_with,
};

fn radiance(debug: Debug) -> Vec<u32> {
    bits(&Job { debug, ..Job::asset("moving").small() })
}

fn bits(job: &Job) -> Vec<u32> {
    let mut renderer = job.renderer();
    for frame in 0..4 {
        renderer.render_frame(f64::from(frame) * 0.5).unwrap_or_else(|e| panic!("{e}"));
    }
    read(&renderer, "composed").data.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn two_renders_have_the_same_bits() {
    let first = radiance(Debug::default());
    assert!(first.iter().any(|&bits| bits != 0), "the picture is black");
    assert_eq!(first, radiance(Debug::default()));
}

#[test]
fn debug_switches_leave_the_picture_as_it_is() {
    let plain = radiance(Debug::default());
    let switches = [
        ("no culling", Debug { no_culling: true, ..Debug::default() }),
        ("no reuse", Debug { no_reuse: true, ..Debug::default() }),
        ("poison", Debug { poison: true, ..Debug::default() }),
        ("shuffle 1", Debug { shuffle: Some(1), ..Debug::default() }),
        ("shuffle 2", Debug { shuffle: Some(2), ..Debug::default() }),
        ("watched numbers", Debug { watch_numbers: true, ..Debug::default() }),
        ("all", Debug { no_culling: true, no_reuse: true, poison: true, watch_numbers: true, shuffle: Some(3) }),
    ];
    for (name, debug) in switches {
        assert!(plain == radiance(debug), "{name} changes the picture");
    }
}

/// What the tests above are there to find: numbers that are added in the order in which threads come by.
#[test]
fn a_sum_in_the_order_of_chance_is_found() {
    const DECLARATION: &str = r#"Node(
        doc: "Adds two kinds of light, and a sum over the picture as large as its rounding.",
        inputs: {
            "direct": Texture(format: Rgba32Float, doc: "W/(m² sr)"),
            "indirect": Texture(format: Rgba32Float, doc: "W/(m² sr)"),
        },
        outputs: { "sum": Buffer(of: "u32", doc: "bits of a float"), "composed": Texture(format: Rgba32Float, doc: "W/(m² sr)") },
        steps: [(entry: "clear", over: Groups(1, 1, 1)), (entry: "add", over: Texels("composed")), (entry: "compose", over: Texels("composed"))],
    )"#;
    const SHADER: &str = "
        @group(0) @binding(0) var direct: texture_2d<f32>;
        @group(0) @binding(1) var indirect: texture_2d<f32>;
        @group(0) @binding(2) var<storage, read_write> sum: array<atomic<u32>>;
        @group(0) @binding(3) var composed: texture_storage_2d<rgba32float, write>;
        @compute @workgroup_size(1) fn clear() {
            atomicStore(&sum[0], 0u);
        }
        @compute @workgroup_size(8, 8) fn add(@builtin(global_invocation_id) id: vec3u) {
            let value = 1e-3 * f32((id.x * 7919u + id.y * 104729u) % 1000u) + textureLoad(direct, id.xy, 0).x;
            var old = atomicLoad(&sum[0]);
            loop {
                let tried = atomicCompareExchangeWeak(&sum[0], old, bitcast<u32>(bitcast<f32>(old) + value));
                if tried.exchanged { break; }
                old = tried.old_value;
            }
        }
        @compute @workgroup_size(8, 8) fn compose(@builtin(global_invocation_id) id: vec3u) {
            let both = textureLoad(direct, id.xy, 0).rgb + textureLoad(indirect, id.xy, 0).rgb;
            textureStore(composed, id.xy, vec4f(both + bitcast<f32>(atomicLoad(&sum[0])), 1.0));
        }";
    // Threads come by in another order now and then: often enough to be seen in so many tries on two cores.
    const TRIES: usize = 60;
    let project = project_with(&[
        ("shaders/test/chance.ron", DECLARATION),
        ("shaders/test/chance.wgsl", SHADER),
        (
            "pipelines/chance.ron",
            r#"Pipeline(doc: "With chance.", extends: "acrsm.ron", resources: {"sum": Buffer(of: "u32", count: 1, doc: "bits")},
                nodes: [(id: "compose", node: "test/chance")])"#,
        ),
    ]);
    let job = Job { root: project.path().to_owned(), pipeline: "chance".to_owned(), ..Job::asset("moving").small() };
    let job = Job { size: (256, 256), ..job };
    let first = bits(&job);
    assert!((0..TRIES).any(|_| bits(&job) != first), "{TRIES} renders have the same bits");
}
