//! Times of the nodes, and the choice of the device.

use manylight_gpu::{Gpu, GpuError, GpuOptions};

use crate::support::{SHOW, World};

const NODE: &str =
    r#"Node(doc: "Works.", outputs: {"values": Buffer(of: "f32", doc: "numbers")}, steps: [(entry: "work", over: Elements("values"))])"#;

const SHADER: &str = r"
@group(0) @binding(0) var<storage, read_write> values: array<f32>;
@compute @workgroup_size(64) fn work(@builtin(global_invocation_id) id: vec3u) {
    var v = f32(id.x);
    for (var i = 0u; i < 1000u; i++) { v = sin(v) + 1.0; }
    values[id.x] = v;
}";

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "values": Buffer(of: "f32", count: 4096), "picture": Texture(format: Rgba32Float, size: Fixed(1, 1)),
}, nodes: [(id: "work", node: "test/work"), (id: "show", node: "test/show")], presents: "picture")"#;

fn world() -> World {
    let mut files = vec![("shaders/test/work.ron", NODE), ("shaders/test/work.wgsl", SHADER), ("pipelines/test.ron", PIPELINE)];
    files.extend(SHOW);
    World::new(&files)
}

#[test]
fn every_node_has_a_sample_of_the_newest_frame() {
    let world = world();
    let mut frame = world.build();
    assert!(frame.timings().is_none(), "nothing ran: no sample");
    for _ in 0..10 {
        world.run(&mut frame);
    }
    let has_timestamps = world.gpu.has_timestamps();
    let times = frame.wait_timings(&world.gpu).expect("frames have run").clone();
    assert!(times.frame >= 6, "of the newest frames that fit into the ring: {}", times.frame);
    assert_eq!(times.nodes.iter().map(|n| n.id.as_str()).collect::<Vec<_>>(), ["work", "show"]);
    assert!(times.cpu_ns > 0 && times.nodes.iter().all(|n| n.cpu_ns > 0));
    if has_timestamps {
        let [work, show] = [0, 1].map(|i| times.nodes[i].gpu_ns.expect("a sample"));
        assert!(work > show, "a million sines take longer than a copy: {work} ns, {show} ns");
        assert!(times.gpu_ns.expect("a sample") >= work + show);
    } else {
        assert!(times.nodes.iter().all(|n| n.gpu_ns.is_none()));
    }
}

#[test]
fn without_timestamps_there_is_no_gpu_sample_but_a_cpu_sample() {
    let mut world = world();
    world.options.timestamps = false;
    let frame = world.once();
    let times = frame.timings().expect("CPU times are known at once");
    assert!(times.gpu_ns.is_none() && times.nodes.iter().all(|n| n.gpu_ns.is_none() && n.cpu_ns > 0));
}

#[test]
fn an_unknown_adapter_name_lists_what_there_is() {
    let options = GpuOptions { adapter: Some("no such card".to_owned()) };
    match Gpu::new(&options) {
        Err(GpuError::NoSuchAdapter { wanted, found }) => assert!(wanted == "no such card" && !found.is_empty()),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("there is one"),
    }
}
