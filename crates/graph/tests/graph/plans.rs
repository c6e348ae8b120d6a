//! Plans: order, values, sizes, lives, switches.

use manylight_graph::{
    plan::{Debug, Idle, Lifetime, Plan, PlanInput, PlanStep, Target, Workgroups},
    registry::{External, HostDecl, PortKind},
    value::{ResourceDesc, Value},
};

use crate::kit::*;

const FILE: &str = "pipelines/test.ron";

fn ids(plan: &Plan) -> Vec<&str> {
    plan.nodes.iter().map(|n| n.id.as_str()).collect()
}

fn set(pairs: &[(&str, &str)]) -> PlanInput {
    PlanInput { set: pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect(), ..input() }
}

fn param<'p>(plan: &'p Plan, id: &str, name: &str) -> &'p Value {
    let node = plan.nodes.iter().find(|n| n.id == id).unwrap();
    &node.params.iter().find(|(n, _)| n == name).unwrap().1
}

#[test]
fn values_come_from_defaults_presets_and_the_user() {
    let plan = try_plan(&files(), &input()).unwrap();
    assert_eq!(param(&plan, "paint", "strength"), &Value::Float(0.5));
    assert_eq!(param(&plan, "soft", "radius"), &Value::Int(3), "the pipeline's parameter of the same name");
    assert_eq!(param(&plan, "show", "radius"), &Value::Int(1));
    let files = with(FILE, "    params: {", "    set: {\"count\": 7, \"paint.mode\": \"mean\"},\n    params: {");
    let plan = try_plan(&files, &set(&[("radius", "9"), ("show.radius", "11"), ("radius", "10")])).unwrap();
    assert_eq!(param(&plan, "paint", "mode"), &Value::Choice("mean".into()));
    assert_eq!(param(&plan, "soft", "radius"), &Value::Int(10), "later wins");
    assert_eq!(param(&plan, "show", "radius"), &Value::Int(11));
    assert_eq!(plan.params[1], ("count".to_owned(), Value::Int(7)));
    let cells = plan.resource("cells").unwrap();
    assert_eq!(plan.resources[cells].desc, ResourceDesc::Buffer { element: "Cell".into(), stride: 16, count: 14 });
}

#[test]
fn wrong_values_of_the_user_name_range_and_options() {
    let faults = try_plan(
        &files(),
        &set(&[("cont", "1"), ("count", "0"), ("kind", "plan"), ("blur", "maybe"), ("paint.strenth", "1"), ("radius", "1.5")]),
    )
    .unwrap_err();
    assert_faults(
        &faults.render(),
        6,
        &[
            "the pipeline `test` has no parameter `cont`\n = help: did you mean `count`?",
            "`0` is no value of `count`\n = help: it takes a whole number from 1 to 4096",
            "`plan` is no value of `kind`\n = help: it takes one of `plain`, `masked`; did you mean `plain`?",
            "`maybe` is no value of `blur`\n = help: it takes true or false",
            "the node `paint` (draw/paint) has no parameter `strenth`\n = help: did you mean `strength`?",
            "`1.5` is no value of `radius`",
        ],
    );
}

#[test]
fn draws_have_targets_and_vertices() {
    let plan = try_plan(&files(), &set(&[("blur", "false")])).unwrap();
    assert_eq!(ids(&plan), ["scene", "hard", "show"]);
    let albedo = plan.resource("albedo").unwrap();
    let step = PlanStep::Draw {
        vertex: "vs".into(),
        fragment: "fs".into(),
        vertices: 36,
        instances: 1,
        targets: vec![Some(albedo)],
        depth: plan.resource("depth"),
    };
    assert_eq!(plan.nodes[0].steps, [step]);
    assert!(plan.resources[albedo].usage.target && plan.resources[albedo].usage.read && !plan.resources[albedo].usage.storage);
    let reasons: Vec<_> = plan.idle.iter().map(|n| (n.id.as_str(), n.reason.clone())).collect();
    assert_eq!(reasons, [("paint", Idle::Dead), ("pyramid", Idle::Dead), ("soft", Idle::Off("`blur` is off".into()))]);
}

#[test]
fn nothing_follows_from_a_shader_with_faults() {
    let files = with("shaders/draw/paint.wgsl", "fn paint(", "fnn paint(");
    let (registry, faults) = registry(&files, &[]);
    assert_faults(&faults.render(), 1, &["found \"fnn\""]);
    let pipeline = manylight_graph::pipeline::Pipeline::load(&library(&files), "test").unwrap();
    assert_eq!(manylight_graph::check::check(&pipeline, &registry).render(), "");
    let input = PlanInput { keep: vec!["picture".into(), "cells".into()], ..input() };
    let faults = manylight_graph::planner::plan(&pipeline, &registry, &input).unwrap_err();
    assert_faults(&faults.render(), 1, &["the node `draw/paint` cannot be used"]);
}

#[test]
fn kept_resources_keep_their_nodes_alive() {
    let plan = try_plan(&files(), &PlanInput { keep: vec!["albedo".into()], ..input() }).unwrap();
    assert_eq!(ids(&plan), ["scene", "paint", "pyramid", "soft", "show"]);
    assert_eq!(plan.resources[plan.resource("albedo").unwrap()].lifetime, Lifetime::Kept);
    let faults = try_plan(&files(), &PlanInput { keep: vec!["albdo".into()], ..input() }).unwrap_err();
    assert_faults(&faults.render(), 1, &["the pipeline `test` has no resource `albdo`", "did you mean `albedo`?"]);
    let files = with(FILE, "(id: \"scene\", node: \"draw/scene\",", "(id: \"scene\", node: \"draw/scene\", when: Not(IsOn(\"blur\")),");
    let faults = try_plan(&files, &PlanInput { keep: vec!["albedo".into()], ..input() }).unwrap_err();
    assert_faults(&faults.render(), 1, &["`albedo` is not written in this frame: node `scene`, which writes it, is off: `blur` is on"]);
}

#[test]
fn transients_share_memory_when_their_lives_do_not_touch() {
    // picture → blurred → result have equal descriptions; picture and result do not meet.
    let files = with(FILE, "presents: \"result\"", "presents: \"last\"");
    let files = edit(files, FILE, "\"result\": Texture", "\"last\": Texture(format: Rgba16Float, size: Output), \"result\": Texture");
    let files = edit(
        files,
        FILE,
        "nodes: [",
        "nodes: [(id: \"end\", node: \"post/blur\", in: {\"source\": \"result\"}, out: {\"blurred\": \"last\"}),",
    );
    let plan = try_plan(&files, &input()).unwrap();
    let slot = |plan: &Plan, name: &str| match plan.resources[plan.resource(name).unwrap()].lifetime {
        Lifetime::Transient { slot, .. } => slot,
        other => panic!("{name}: {other:?}"),
    };
    assert_eq!(slot(&plan, "picture"), slot(&plan, "result"));
    assert_ne!(slot(&plan, "picture"), slot(&plan, "blurred"));
    assert_eq!(plan.slots, 4);
    let own = try_plan(&files, &PlanInput { debug: Debug { no_reuse: true, ..Debug::default() }, ..input() }).unwrap();
    assert_ne!(slot(&own, "picture"), slot(&own, "result"));
    assert_eq!(own.slots, 5);
}

#[test]
fn history_lives_on() {
    let files = with(FILE, "in: {\"source\": \"picture\", \"mask\": \"pyramid\"}", "in: {\"source\": Previous(\"result\")}");
    let files = edit(files, FILE, "size: Like(\"blurred\")", "size: Like(\"blurred\"), history: true");
    let plan = try_plan(&files, &input()).unwrap();
    let result = plan.resource("result").unwrap();
    assert_eq!(plan.resources[result].lifetime, Lifetime::History);
    assert_eq!(ids(&plan), ["soft", "show"]);
    assert_eq!(plan.nodes[0].bindings[0], ("source".into(), Target::Previous(result)));
    // Nobody reads the last frame: an ordinary resource.
    let files = with(FILE, "\"cells\": Buffer(", "\"cells\": Buffer(history: true, ");
    let plan = try_plan(&files, &input()).unwrap();
    assert!(matches!(plan.resources[plan.resource("cells").unwrap()].lifetime, Lifetime::Transient { .. }));
}

#[test]
fn an_optional_input_whose_producer_is_off_is_absent() {
    let files =
        with(FILE, "(id: \"pyramid\", node: \"post/pyramid\")", "(id: \"pyramid\", node: \"post/pyramid\", when: AtLeast(\"count\", 200))");
    let plan = try_plan(&files, &input()).unwrap();
    assert_eq!(plan.nodes.iter().find(|n| n.id == "soft").unwrap().bindings[1], ("mask".into(), Target::Absent));
    assert_eq!(plan.idle[1].reason, Idle::Off("`count` is 100, below 200".into()));
}

/// The mask is for one mode of the blur: otherwise nothing is bound, and who made it need not run.
#[test]
fn a_port_that_the_parameters_leave_unused_is_absent() {
    const NODE: &str = "shaders/post/blur.ron";
    let files = with(NODE, "Texture(format: R32Float, optional: true,", "Texture(format: R32Float, when: AtLeast(\"radius\", 8),");
    let mask = |plan: &Plan| plan.nodes.iter().find(|n| n.id == "soft").unwrap().bindings[1].1;
    // The node `show` has no mask and a radius of 1.
    let used = try_plan(&files, &set(&[("radius", "8")])).unwrap();
    assert_eq!(mask(&used), Target::Resource(used.resource("pyramid").unwrap()));
    let plan = try_plan(&files, &input()).unwrap();
    assert_eq!((mask(&plan), plan.resource("pyramid")), (Target::Absent, None));
    assert_eq!(ids(&plan), ["paint", "soft", "show"]);
    assert!(plan.idle.iter().any(|n| n.id == "pyramid" && n.reason == Idle::Dead));
    // Where it is used it must be there, as it is not optional.
    let faults = try_plan(&files, &set(&[("show.radius", "8")])).unwrap_err();
    let parts =
        ["the input `mask` of `show` is not connected", "which is used with these parameters", "set the node's parameters otherwise"];
    assert_faults(&faults.render(), 1, &parts);
    let off = edit(files, FILE, "node: \"post/pyramid\"", "node: \"post/pyramid\", when: AtLeast(\"count\", 200)");
    assert!(try_plan(&off, &input()).is_ok());
    let faults = try_plan(&off, &set(&[("radius", "8")])).unwrap_err();
    assert_faults(&faults.render(), 1, &["`pyramid` is read, but not written in this frame: node `pyramid`, which writes it, is off"]);
}

/// A draw leaves out the target that nobody asked for; the places of the others stay.
#[test]
fn an_optional_output_that_nobody_reads_is_not_made() {
    let ron = "shaders/draw/scene.ron";
    let files = with(ron, "outputs: {", "outputs: { \"gloss\": Texture(format: Rgba16Float, optional: true, doc: \"gloss\"),");
    let files = edit(files, ron, "targets: [", "targets: [\"gloss\", ");
    let files = edit(
        files,
        "shaders/draw/scene.wgsl",
        "@fragment\nfn fs() -> @location(0) vec4f {\n    return vec4f(1.0);\n}",
        "struct Out { @location(0) gloss: vec4f, @location(1) albedo: vec4f }\n@fragment\nfn fs() -> Out { return Out(vec4f(1.0), vec4f(2.0)); }",
    );
    let files = edit(files, FILE, "resources: {", "resources: { \"gloss\": Texture(format: Rgba16Float, size: Output),");
    let targets = |plan: &Plan| match &plan.nodes[0].steps[0] {
        PlanStep::Draw { targets, .. } => targets.clone(),
        other => panic!("{other:?}"),
    };
    let hard = set(&[("blur", "false")]);
    let plan = try_plan(&files, &hard).unwrap();
    assert_eq!(targets(&plan), [None, plan.resource("albedo")]);
    assert_eq!(plan.resource("gloss"), None);
    for keep in [vec!["gloss".to_owned()], Vec::new()] {
        let read =
            if keep.is_empty() { edit(files.clone(), FILE, "{\"source\": \"albedo\"}", "{\"source\": \"gloss\"}") } else { files.clone() };
        let plan = try_plan(&read, &PlanInput { keep: keep.clone(), ..hard.clone() }).unwrap();
        assert_eq!(targets(&plan), [plan.resource("gloss"), plan.resource("albedo")], "{keep:?}");
        assert!(plan.resource("gloss").is_some());
    }
}

#[test]
fn many_elements_fold_into_rows() {
    let files = with(FILE, "\"count\": Int(min: 1, max: 4096", "\"count\": Int(min: 1, max: 4000000");
    let plan = try_plan(&files, &set(&[("count", "3000000")])).unwrap();
    assert_eq!(plan.nodes[0].steps[0], PlanStep::Compute { entry: "clear".into(), groups: Workgroups::Fixed([65535, 2, 1]), mip: None });
}

#[test]
fn sizes_beyond_the_limits_name_the_resource_and_the_remedy() {
    let files = with(FILE, "\"count\": Int(min: 1, max: 4096", "\"count\": Int(min: 1, max: 1000000000");
    let faults = try_plan(&files, &set(&[("count", "90000000")])).unwrap_err();
    assert_faults(
        &faults.render(),
        1,
        &["the buffer `cells` is too large: 180000000 elements", "test.ron:13:44", "lower the parameter `count` (now 90000000)"],
    );
    let faults = try_plan(&crate::kit::files(), &PlanInput { output: (0, 4), ..input() }).unwrap_err();
    assert_faults(&faults.render(), 1, &["a picture of 0×4 pixels cannot be rendered", "sides are 1 to 16384"]);
    let faults = try_plan(&crate::kit::files(), &PlanInput { output: (20000, 4), ..input() }).unwrap_err();
    assert_faults(&faults.render(), 1, &["a picture of 20000×4 pixels"]);
    let plan = try_plan(&crate::kit::files(), &PlanInput { output: (1, 1), ..input() }).unwrap();
    assert_eq!(plan.nodes[1].steps.len(), 1, "a pyramid of one texel has one level");
}

#[test]
fn targets_of_a_draw_have_one_size() {
    let files = with(
        FILE,
        "\"depth\": Texture(format: Depth32Float, size: Like(\"albedo\"))",
        "\"depth\": Texture(format: Depth32Float, size: OutputScaled(1, 2))",
    );
    let faults = try_plan(&files, &set(&[("blur", "false")])).unwrap_err();
    assert_faults(
        &faults.render(),
        1,
        &["a step of node `scene` draws to `albedo` with 640×360 and to `depth` with 320×180 texels", "scene.ron:11:13"],
    );
}

#[test]
fn long_chains_of_sizes_are_faults() {
    let mut text = String::from("\"r0\": Texture(format: Rgba16Float, size: Output)");
    for i in 1..20_000 {
        text += &format!(", \"r{i}\": Texture(format: Rgba16Float, size: Like(\"r{}\"))", i - 1);
    }
    let files = with(
        FILE,
        "\"result\": Texture(format: Rgba16Float, size: Like(\"blurred\"))",
        &format!("{text}, \"result\": Texture(format: Rgba16Float, size: Like(\"r19999\"))"),
    );
    let faults = try_plan(&files, &input()).unwrap_err();
    assert_faults(&faults.render(), 1, &["sizes refer to each other through more than 256 resources"]);
}

#[test]
fn features_decide_and_must_be_known() {
    let files = with(FILE, "when: Not(IsOn(\"blur\"))", "when: Not(Any([IsOn(\"blur\"), Feature(\"glossy\")]))");
    let mut glossy = set(&[("blur", "false")]);
    glossy.features.insert("glossy".into(), true);
    let faults = try_plan(&files, &glossy).unwrap_err();
    assert_faults(&faults.render(), 1, &["`blurred` is read, but not written in this frame", "the scene has `glossy`"]);
    let faults = try_plan(&files, &PlanInput { features: [("textures".to_owned(), true)].into(), ..input() }).unwrap_err();
    assert_faults(&faults.render(), 1, &["there is no scene feature `glossy`", "test.ron:24:141"]);
}

#[test]
fn host_nodes_are_like_others() {
    let ron = r#"Node(doc: "Points.", inputs: {"scene_triangles": Buffer(of: "u32", doc: "x")}, outputs: {"cells": Buffer(of: "Cell", doc: "x")},
        params: {"seed": Int(min: 0, max: 9, default: 1, doc: "x")})"#;
    let host = [HostDecl { name: "host/points", ron }];
    let (registry, faults) = registry(&files(), &host);
    assert!(faults.is_empty(), "{faults}");
    let files = with(
        FILE,
        "(id: \"paint\", node: \"draw/paint\", in: {\"view\": \"scene_camera\"}, params: {\"strength\": 0.5})",
        "(id: \"points\", node: \"host/points\")",
    );
    let files = edit(files, FILE, "{\"source\": \"picture\", \"mask\": \"pyramid\"}", "{\"source\": \"albedo\", \"mask\": \"pyramid\"}");
    let pipeline = manylight_graph::pipeline::Pipeline::load(&library(&files), "test").unwrap();
    let plan = manylight_graph::planner::plan(&pipeline, &registry, &input()).unwrap();
    let node = plan.nodes.iter().find(|n| n.id == "points").unwrap();
    assert!(node.steps.is_empty() && node.decl.shader.is_none());
    assert_eq!(node.bindings.len(), 2);
    assert_eq!(node.params, [("seed".to_owned(), Value::Int(1))]);
    let steps = "Node(doc: \"x\", steps: [])";
    let faults = crate::kit::registry(&crate::kit::files(), &[HostDecl { name: "host/points", ron: steps }]).1;
    assert_faults(&faults.render(), 1, &["a node written in Rust has no steps", "declaration of host/points:1:23"]);
}

#[test]
fn a_faulty_node_is_not_also_unknown() {
    let broken = with("shaders/post/pyramid.wgsl", "cells[0]", "cels[0]");
    let (registry, faults) = registry(&broken, &[]);
    assert_faults(&faults.render(), 1, &["`cels`", "pyramid.wgsl:10:51"]);
    let library = library(&broken);
    assert_faults(&manylight_graph::check::check_file(&library, "test", &registry).render(), 0, &[]);
    let pipeline = manylight_graph::pipeline::Pipeline::load(&library, "test").unwrap();
    let faults = manylight_graph::planner::plan(&pipeline, &registry, &input()).unwrap_err();
    assert_faults(&faults.render(), 1, &["the node `post/pyramid` cannot be used: its declaration or shader has faults", "test.ron:22:31"]);
}

#[test]
fn externals_have_the_layout_that_rust_fills() {
    let mut externals = externals();
    externals.push(External {
        name: "other_camera".into(),
        kind: PortKind::Uniform { of: "View".into() },
        doc: String::new(),
        layout: None,
    });
    externals[0].layout = Some(manylight_graph::shader::Layout { size: 32, members: Vec::new() });
    let (_, faults) = manylight_graph::registry::Registry::load(&library(&files()), &[], externals);
    assert_faults(
        &faults.render(),
        2,
        &[
            "`View` differs from that of the external `scene_camera`: it has the member `origin` in addition",
            "paint.wgsl:7:8",
            "scene.wgsl:1:8",
        ],
    );
}

#[test]
fn quotients_round_down_or_up() {
    let count = |expr: &str| {
        let files = with(FILE, "count: Mul([Param(\"count\"), 2])", &format!("count: {expr}"));
        let plan = try_plan(&files, &input()).unwrap();
        match plan.resources[plan.resource("cells").unwrap()].desc {
            ResourceDesc::Buffer { count, .. } => count,
            _ => 0,
        }
    };
    assert_eq!((count("Div(Param(\"count\"), 96)"), count("DivCeil(Param(\"count\"), 96)")), (1, 2));
    assert_eq!((count("Div(192, 96)"), count("DivCeil(192, 96)")), (2, 2));
}

#[test]
fn of_many_views_the_one_that_was_chosen_is_told_of() {
    let choice = "\"view\": Choice(options: [\"a\", \"b\", \"c\", \"d\"], default: \"a\", doc: \"what to show\"),";
    let files = with(FILE, "    params: {", &format!("    params: {{ {choice}"));
    let show =
        "(id: \"show\", node: \"post/blur\", in: {\"source\": \"blurred\"}, out: {\"blurred\": \"result\"}, params: {\"radius\": 1}),";
    let view = |id: &str, when: &str| show.replace("\"show\"", &format!("\"{id}\"")).replace("1})", &format!("1}}, when: {when})"));
    let views = ["a", "b", "c"].map(|id| view(id, &format!("Is(\"view\", \"{id}\")"))).concat();
    let files = edit(files, FILE, show, &(views + &view("d", "All([Is(\"view\", \"d\"), IsOn(\"blur\")])")));
    let input = PlanInput { set: vec![("view".into(), "d".into()), ("blur".into(), "false".into())], ..input() };
    let faults = try_plan(&files, &input).unwrap_err().render();
    assert_faults(&faults, 1, &["`result` is read, but not written in this frame: node `d`, which writes it, is off: `blur` is off\n"]);
}
