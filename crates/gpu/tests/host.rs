//! Nodes written in Rust: run when something changed, and only then; state survives a rebuild; errors name the node.

use manylight_gpu::{HostContext, HostData, HostError, HostKind, HostNode, HostNodes, RunError};

use crate::support::{SHOW, World};

#[derive(Default)]
struct Series {
    runs: f32,
}

impl HostNode for Series {
    fn run(&mut self, ctx: &mut HostContext<'_>) -> Result<(), HostError> {
        self.runs += 1.0;
        let start = *ctx.scene::<f32>()?;
        if start < 0.0 {
            return Err(HostError::new("the start is negative"));
        }
        let step = ctx.float("step")? as f32;
        let count = ctx.count("values")?;
        let mut values: Vec<f32> = (0..count).map(|i| start + step * i as f32).collect();
        values[count - 1] = self.runs;
        ctx.write("values", &values)
    }
}

const SERIES: HostKind = HostKind {
    name: "test/series",
    declaration: r#"Node(doc: "An arithmetic series.", outputs: {"values": Buffer(of: "f32", doc: "numbers; the last is the number of runs")},
        params: {"step": Float(min: 0.0, max: 10.0, default: 2.0, doc: "difference")})"#,
    make: || Box::new(Series::default()),
};

const PIPELINE: &str = r#"Pipeline(doc: "t", resources: {
    "values": Buffer(of: "f32", count: 4), "picture": Texture(format: Rgba32Float, size: Fixed(1, 1)),
}, nodes: [(id: "series", node: "test/series"), (id: "show", node: "test/show")], presents: "picture")"#;

fn world() -> World {
    let mut files = vec![("pipelines/test.ron", PIPELINE)];
    files.extend(SHOW);
    let mut world = World::new(&files);
    world.hosts = HostNodes::new().with(SERIES);
    world
}

#[test]
fn runs_again_only_when_the_stamp_or_the_frame_changes() {
    let mut world = world();
    let mut frame = world.build();
    let run = |world: &World, frame: &mut manylight_gpu::Frame, start: f32, stamp| {
        frame.record_and_submit(&world.gpu, &world.externals, HostData::new(&start, stamp)).unwrap();
        world.floats(frame, "values")
    };
    assert_eq!(run(&world, &mut frame, 5.0, 1), [5.0, 7.0, 9.0, 1.0]);
    assert_eq!(world.image(&frame, "picture").data[0], 5.0);
    assert_eq!(run(&world, &mut frame, 6.0, 1), [5.0, 7.0, 9.0, 1.0], "the stamp says that nothing changed");
    assert_eq!(run(&world, &mut frame, 6.0, 2), [6.0, 8.0, 10.0, 2.0]);
    world.input.set = vec![("series.step".to_owned(), "3.0".to_owned())];
    let (mut rebuilt, _) = world.try_build(Some(&frame)).unwrap();
    assert_eq!(run(&world, &mut rebuilt, 6.0, 2), [6.0, 9.0, 12.0, 3.0], "state is kept, the new parameter is seen");
}

#[test]
fn errors_name_the_node_and_are_tried_again() {
    let world = world();
    let mut frame = world.build();
    let error = frame.record_and_submit(&world.gpu, &world.externals, HostData::none()).unwrap_err();
    assert!(error.to_string().contains("`series`") && error.to_string().contains("f32"), "{error}");
    let error = frame.record_and_submit(&world.gpu, &world.externals, HostData::new(&-1.0f32, 1)).unwrap_err();
    assert!(matches!(&error, RunError::Host { node, .. } if node == "series"), "{error}");
    frame.record_and_submit(&world.gpu, &world.externals, HostData::new(&1.0f32, 1)).unwrap();
    assert_eq!(world.floats(&frame, "values")[..3], [1.0, 3.0, 5.0]);
}

#[test]
fn host_nodes_nobody_registered_are_faults() {
    let mut world = world();
    let plan = world.plan();
    world.hosts = HostNodes::new();
    let built = manylight_gpu::Frame::build(&world.gpu, &plan, &world.externals, &world.hosts, None, world.options);
    let error = built.unwrap_err().to_string();
    assert!(error.contains("`series`") && error.contains("test/series"), "{error}");
}
