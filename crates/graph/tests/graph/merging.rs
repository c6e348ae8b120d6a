//! `extends` and `include`.

use manylight_graph::{pipeline::Pipeline, plan::PlanInput};

use crate::kit::*;

const FILE: &str = "pipelines/test.ron";

fn variant(text: &str) -> Files {
    add(files(), "pipelines/variant.ron", text)
}

fn faults(files: &Files, name: &str) -> String {
    let (registry, faults) = registry(files, &[]);
    assert!(faults.is_empty(), "{faults}");
    manylight_graph::check::check_file(&library(files), name, &registry).render()
}

#[test]
fn a_variant_replaces_what_it_names() {
    let files = variant(
        r#"Pipeline(
    doc: "A variant.",
    extends: "test.ron",
    set: {"blur": false, "paint.strength": 2.0},
    nodes: [(id: "hard", node: "post/blur", in: {"source": "picture"}, params: {"radius": 7}, when: Not(IsOn("blur")))],
)"#,
    );
    assert_eq!(faults(&files, "variant"), "");
    let (registry, _) = registry(&files, &[]);
    let pipeline = Pipeline::load(&library(&files), "pipelines/variant.ron").unwrap();
    assert_eq!((pipeline.name.as_str(), pipeline.doc.as_str()), ("variant", "A variant."));
    let names: Vec<_> = pipeline.sources.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["pipelines/variant.ron", "pipelines/test.ron"]);
    let plan = manylight_graph::planner::plan(&pipeline, &registry, &input()).unwrap();
    let ids: Vec<_> = plan.nodes.iter().map(|n| n.id.as_str()).collect();
    assert_eq!(ids, ["paint", "hard", "show"]);
    assert_eq!(plan.nodes[0].params[0].1, manylight_graph::value::Value::Float(2.0));
    assert_eq!(plan.nodes[1].params[0].1, manylight_graph::value::Value::Int(7));
    // What the user sets wins.
    let set = PlanInput { set: vec![("blur".into(), "on".into())], ..input() };
    let plan = manylight_graph::planner::plan(&pipeline, &registry, &set).unwrap();
    assert!(plan.nodes.iter().any(|n| n.id == "soft"));
}

#[test]
fn stages_are_included_once_and_keep_their_name() {
    let stage = r#"Stage(doc: "blurs", resources: {"late": Texture(format: Rgba16Float, size: Output)},
        nodes: [(id: "late", node: "post/blur", in: {"source": "result"}, out: {"blurred": "late"})])"#;
    let files = variant("Pipeline(doc: \"x\", extends: \"test.ron\", include: [\"stages/a.ron\", \"stages/b.ron\"], presents: \"late\")");
    let files = add(files, "pipelines/stages/a.ron", stage);
    let files = add(files, "pipelines/stages/b.ron", "Stage(doc: \"again\", include: [\"a.ron\"])");
    assert_eq!(faults(&files, "variant"), "");
    let pipeline = Pipeline::load(&library(&files), "variant").unwrap();
    assert_eq!(pipeline.nodes["late"].stage, "a");
    assert_eq!(pipeline.nodes["soft"].stage, "test");
}

#[test]
fn faults_of_files() {
    let rendered = faults(&variant("Pipeline(doc: \"x\", extends: \"tst.ron\")"), "variant");
    assert_faults(&rendered, 1, &["there is no file `tst.ron`", "variant.ron:1:29", "did you mean `test.ron`?"]);
    let rendered = faults(&variant("Pipeline(doc: \"x\", extends: \"variant.ron\")"), "variant");
    assert_faults(&rendered, 1, &["the file extends itself: pipelines/variant.ron → pipelines/variant.ron", "1:29"]);
    let files = add(
        variant("Pipeline(doc: \"x\", extends: \"other.ron\")"),
        "pipelines/other.ron",
        "Pipeline(doc: \"x\", extends: \"variant.ron\")",
    );
    let rendered = faults(&files, "variant");
    assert_faults(&rendered, 1, &["itself: pipelines/variant.ron → pipelines/other.ron → pipelines/variant.ron", "other.ron:1:29"]);
    let rendered = faults(&variant("Pipeline(doc: \"x\", extends: \"test.ron\", include: [\"test.ron\"])"), "variant");
    assert_faults(&rendered, 0, &[]);
    let rendered = faults(&variant("Pipeline(doc: \"x\", include: [\"test.ron\"], presents: \"result\")"), "variant");
    assert_faults(&rendered, 1, &["a pipeline cannot be included", "test.ron:1:1"]);
    let stage = "Stage(doc: \"x\", nodes: [(id: \"paint\", node: \"draw/paint\", in: {\"view\": \"scene_camera\"})])";
    let files = add(with(FILE, "nodes: [", "include: [\"stages/a.ron\"], nodes: ["), "pipelines/stages/a.ron", stage);
    assert_faults(&check_faults(&files), 1, &["there are two nodes `paint`", "test.ron:21:14", "a.ron:1:30"]);
    let files = with(FILE, "nodes: [", "include: [\"stages/none.ron\"], nodes: [");
    assert_faults(&check_faults(&files), 1, &["there is no file `stages/none.ron`", "18:15"]);
    let files =
        add(with(FILE, "nodes: [", "include: [\"stages/a.ron\"], nodes: ["), "pipelines/stages/a.ron", "Stage(doc: \"x\", nods: [])");
    assert_faults(&check_faults(&files), 1, &["unknown field `nods` in Stage", "a.ron:1:17"]);
}
