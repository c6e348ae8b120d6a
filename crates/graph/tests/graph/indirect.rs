//! Steps whose number of workgroups a buffer says: what is right comes to the plan, what is not is told with place and remedy.

use crate::kit::*;
use manylight_graph::plan::{Debug, PlanStep, Target, Workgroups};

const MAIN: &str = "pipelines/test.ron";
const PAINT: &str = "shaders/draw/paint.ron";
const PAINT_WGSL: &str = "shaders/draw/paint.wgsl";

const FIND: &str = r#"Node(
    doc: "Says how many workgroups run.",
    outputs: { "tiles": Buffer(of: "vec4u", doc: "workgroups") },
    steps: [(entry: "find", over: Elements("tiles"))],
)
"#;

const FIND_WGSL: &str = "\
@group(0) @binding(0) var<storage, read_write> tiles: array<vec4u>;
@compute @workgroup_size(1)
fn find() {
    tiles[0] = vec4u(1u);
}
";

/// The kit, with a node that finds how often `paint` runs.
fn found() -> Files {
    let mut files = with(PAINT, "\"view\": Uniform", "\"tiles\": Buffer(of: \"vec4u\", doc: \"workgroups\"),\n        \"view\": Uniform");
    files = edit(files, PAINT, "over: Texels(\"picture\")", "over: Indirect(\"tiles\")");
    files.push(("shaders/draw/find.ron".into(), FIND.into()));
    files.push(("shaders/draw/find.wgsl".into(), FIND_WGSL.into()));
    files = edit(files, MAIN, "nodes: [", "nodes: [\n        (id: \"find\", node: \"draw/find\"),");
    edit(files, MAIN, "resources: {", "resources: {\n        \"tiles\": Buffer(of: \"vec4u\", count: 1),")
}

/// The kit with `paint` finding the number itself, in the step before.
fn finds_itself() -> Files {
    let files = with(PAINT, "\"picture\": Texture", "\"tiles\": Buffer(of: \"vec4u\", doc: \"workgroups\"),\n        \"picture\": Texture");
    let files = edit(files, PAINT, "over: Texels(\"picture\")", "over: Indirect(\"tiles\")");
    let files = edit(
        files,
        PAINT_WGSL,
        "@compute @workgroup_size(64)",
        "@group(0) @binding(4) var<storage, read_write> tiles: array<vec4u>;\n@compute @workgroup_size(64)",
    );
    edit(files, PAINT_WGSL, "    if id.x < arrayLength(&cells) {", "    tiles[0] = vec4u(1u);\n    if id.x < arrayLength(&cells) {")
}

#[track_caller]
fn one(files: Files, parts: &[&str]) {
    assert_faults(&registry_faults(&files), 1, parts);
}

#[test]
fn a_step_is_sized_by_a_buffer_that_the_shader_need_not_read() {
    assert_eq!(registry_faults(&found()), "");
    let plan = try_plan(&found(), &input()).unwrap();
    let tiles = plan.resource("tiles").unwrap();
    let paint = plan.nodes.iter().find(|n| n.id == "paint").unwrap();
    let groups = Workgroups::Indirect(Target::Resource(tiles));
    assert_eq!(paint.steps[1], PlanStep::Compute { entry: "paint".into(), groups, mip: None });
    assert_eq!(paint.steps[1].indirect(), Some(tiles));
    assert!(plan.resources[tiles].usage.indirect);
    assert!(plan.resources.iter().enumerate().all(|(ix, r)| ix == tiles || !r.usage.indirect));
    let json = plan.to_json();
    let steps = json["nodes"].as_array().unwrap().iter().find(|n| n["id"] == "paint").unwrap()["steps"].clone();
    assert_eq!(steps[1]["groups"], serde_json::json!({ "indirect": "tiles" }));
}

#[test]
fn who_finds_the_number_comes_first_in_every_order() {
    for seed in 0..20 {
        let mut input = input();
        input.debug = Debug { shuffle: Some(seed), ..Default::default() };
        let plan = try_plan(&found(), &input).unwrap();
        let at = |id: &str| plan.nodes.iter().position(|n| n.id == id).unwrap();
        assert!(at("find") < at("paint"), "{seed}");
    }
}

#[test]
fn a_node_may_find_the_number_in_an_earlier_step() {
    assert_eq!(registry_faults(&finds_itself()), "");
}

#[test]
fn the_number_must_be_found_before_and_not_be_written_meanwhile() {
    let files = finds_itself();
    let swapped = edit(
        files.clone(),
        PAINT,
        "(entry: \"clear\", over: Elements(\"cells\")),\n        (entry: \"paint\", over: Indirect(\"tiles\")),",
        "(entry: \"paint\", over: Indirect(\"tiles\")),\n        (entry: \"clear\", over: Elements(\"cells\")),",
    );
    one(swapped, &["no step before this one writes `tiles`", "paint.ron:16:41", "move the step behind"]);
    let read = edit(files, PAINT_WGSL, "area(cells[0])", "area(cells[tiles[0].w])");
    one(read, &["`paint` uses `tiles`, which says how often it runs", "paint.ron:17:41", "to another output"]);
}

#[test]
fn what_cannot_be_a_number_of_workgroups_is_refused() {
    let over = "over: Texels(\"picture\")";
    one(with(PAINT, over, "over: Indirect(\"picture\")"), &["`picture` cannot say how many workgroups run", "16:41", "vec4u"]);
    one(with(PAINT, over, "over: Indirect(\"cells\")"), &["`cells` cannot say how many workgroups run", "16:41", "vec4u"]);
    one(with(PAINT, over, "over: Indirect(\"view\")"), &["`view` cannot say how many workgroups run", "16:41"]);
    one(with(PAINT, over, "over: Indirect(\"cels\")"), &["this node has no port `cels`", "16:41", "`cells`"]);
    one(with(PAINT, over, "over: Indirect(\"cells\", 1, 1)"), &["`Indirect` is not used like this", "write `Indirect(\"port\")`"]);
    one(with(PAINT, over, "over: Indirekt(\"cells\")"), &["unknown size `Indirekt`", "`Indirect`"]);
}

#[test]
fn an_output_that_only_sizes_a_step_must_be_written_as_well() {
    let files = edit(finds_itself(), PAINT_WGSL, "    tiles[0] = vec4u(1u);\n", "");
    let faults = registry_faults(&files);
    assert!(faults.contains("no step before this one writes `tiles`") || faults.contains("no step uses the port"), "{faults}");
}

#[test]
fn an_unconnected_optional_number_is_no_work() {
    let files = edit(found(), PAINT, "of: \"vec4u\", doc", "of: \"vec4u\", optional: true, doc");
    let files =
        edit(files, MAIN, "(id: \"find\", node: \"draw/find\"),", "(id: \"find\", node: \"draw/find\", when: Is(\"kind\", \"masked\")),");
    let plan = try_plan(&files, &input()).unwrap();
    let paint = plan.nodes.iter().find(|n| n.id == "paint").unwrap();
    assert_eq!(paint.steps.len(), 1, "{:?}", paint.steps);
}

#[test]
fn both_kinds_of_numbers_are_read() {
    for of in ["vec3u", "vec3<u32>", "vec4u", "vec4<u32>"] {
        let files = edit(found(), PAINT, "of: \"vec4u\"", &format!("of: \"{of}\""));
        assert_eq!(registry_faults(&files), "", "{of}");
    }
}
