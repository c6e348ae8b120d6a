//! Combinations of values that a pipeline refuses.

use manylight_graph::{
    diagnostics::Diagnostics,
    pipeline::Pipeline,
    plan::PlanInput,
    planner::{plan, refusals},
};

use crate::kit::*;

const FILE: &str = "pipelines/test.ron";
const RULE: &str = r#"(when: All([Is("kind", "masked"), IsOn("blur"), AtLeast("radius", 8)]), because: "A mask is only 8 texels wide.")"#;

/// The pipeline with rules.
fn ruled(rules: &str) -> Files {
    with(FILE, "    resources: {", &format!("    refuse: [{rules}],\n    resources: {{"))
}

fn set(pairs: &[(&str, &str)]) -> PlanInput {
    PlanInput { set: pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect(), ..input() }
}

fn faults_of(files: &Files, name: &str) -> String {
    let (registry, faults) = registry(files, &[]);
    assert!(faults.is_empty(), "{faults}");
    manylight_graph::check::check_file(&library(files), name, &registry).render()
}

/// What planning a pipeline under values says, and the part of it that is refusals.
fn planned(files: &Files, name: &str, input: &PlanInput) -> (Diagnostics, Diagnostics) {
    let (registry, faults) = registry(files, &[]);
    assert!(faults.is_empty(), "{faults}");
    let pipeline = Pipeline::load(&library(files), name).unwrap_or_else(|faults| panic!("{faults}"));
    (plan(&pipeline, &registry, input).err().unwrap_or_default(), refusals(&pipeline, &registry, input))
}

#[test]
fn a_refused_combination_is_told_with_place_reason_values_and_remedy() {
    let files = ruled(RULE);
    assert_eq!(check_faults(&files), "");
    let (faults, refused) = planned(&files, "test", &set(&[("kind", "masked"), ("radius", "8")]));
    assert_eq!(faults, refused);
    assert_faults(
        &faults.render(),
        1,
        &[
            "error: these values are refused: A mask is only 8 texels wide\n",
            "test.ron:9:21",
            "`kind` is `masked`; `blur` is on; `radius` is 8, at least 8",
            "help: set `kind` to `plain`, or set `blur` to `false`, or set `radius` to `7`",
        ],
    );
    for accepted in [&[("kind", "masked")][..], &[("radius", "8")], &[("kind", "masked"), ("radius", "8"), ("blur", "off")]] {
        let (faults, refused) = planned(&files, "test", &set(accepted));
        assert!(faults.is_empty() && refused.is_empty(), "{accepted:?}: {faults}");
    }
}

#[test]
fn what_follows_from_refused_values_is_not_told() {
    // Without `hard`, nobody writes `blurred` when `blur` is off.
    let lacking =
        |files: Files| edit(files, FILE, "when: Not(IsOn(\"blur\"))", "when: All([Not(IsOn(\"blur\")), Is(\"kind\", \"masked\")])");
    assert_faults(&check_faults(&lacking(files())), 1, &["`blurred` is read, but not written in this frame", "when `blur` is `false`"]);
    let rule = r#"(when: All([Not(IsOn("blur")), Is("kind", "plain")]), because: "nothing is left to do")"#;
    let files = lacking(ruled(rule));
    assert_eq!(check_faults(&files), "");
    let faults = planned(&files, "test", &set(&[("blur", "false")])).0;
    assert_faults(&faults.render(), 1, &["refused: nothing is left to do", "set `blur` to `true`, or set `kind` to `masked`"]);
    // A rule that cannot be decided hides what may follow from it, too.
    for (from, to, told) in [
        ("Is(\"kind\", \"plain\")", "Is(\"kind\", \"plan\")", "`kind` has no option `plan`"),
        ("because:", "becase:", "unknown field `becase` in a refusal"),
    ] {
        assert_faults(&check_faults(&edit(files.clone(), FILE, rule, &rule.replace(from, to))), 1, &[told]);
    }
}

#[test]
fn conditions_of_refusals_are_checked() {
    for (rule, told) in [
        (r#"(when: Is("kid", "plain"), because: "x")"#, &["the pipeline has no parameter `kid`", "9:24", "did you mean `kind`?"][..]),
        (r#"(when: IsOn("kind"), because: "x")"#, &["`IsOn` tests a Bool, and `kind` is Choice", "9:26"]),
        (r#"(when: Feature("glosy"), because: "x")"#, &["there is no scene feature `glosy`", "`glossy`"]),
        (r#"(when: IsOn("blur"))"#, &["missing field `because` in a refusal"]),
        (r#"(because: "x")"#, &["missing field `when` in a refusal"]),
        (r#""blur""#, &["expected a refusal", "write `(when: All([…]), because: \"…\")`"]),
    ] {
        assert_faults(&check_faults(&ruled(rule)), 1, told);
    }
}

#[test]
fn a_pipeline_that_is_refused_by_itself_is_at_fault() {
    let rendered = check_faults(&ruled(r#"(when: Is("kind", "plain"), because: "it is dull")"#));
    assert_faults(&rendered, 1, &["these values are refused: it is dull", "test.ron:9:21", "set `kind` to `masked`"]);
    // Unless some scene is accepted.
    assert_eq!(check_faults(&ruled(r#"(when: All([Is("kind", "plain"), Feature("glossy")]), because: "it is dull")"#)), "");
}

#[test]
fn presets_inherit_refusals_and_add_their_own() {
    let preset = |set: &str, refuse: &str| {
        let text = format!("Pipeline(doc: \"x\", extends: \"test.ron\", set: {{{set}}}, refuse: [{refuse}])");
        add(ruled(RULE), "pipelines/preset.ron", &text)
    };
    assert_eq!(faults_of(&preset(r#""kind": "masked""#, ""), "preset"), "");
    let bad = preset(r#""kind": "masked", "radius": 9"#, "");
    let rendered = faults_of(&bad, "preset");
    assert_eq!(rendered.matches("set here").count(), 2, "{rendered}");
    assert_faults(&rendered, 1, &["these values are refused", "test.ron:9:21", "preset.ron:1:55"]);
    // What is given from outside was not set there.
    let (faults, _) = planned(&bad, "preset", &set(&[("radius", "10")]));
    let rendered = faults.render();
    assert_eq!(rendered.matches("set here").count(), 1, "{rendered}");
    assert!(rendered.contains("preset.ron:1:55"), "{rendered}");
    let own = preset("", r#"(when: Below("count", 2), because: "one cell is none")"#);
    let (faults, _) = planned(&own, "preset", &set(&[("count", "1"), ("kind", "masked"), ("radius", "30")]));
    assert_faults(&faults.render(), 2, &["A mask is only", "one cell is none", "set `count` to `2`", "preset.ron:1:"]);
}

#[test]
fn stages_bring_their_refusals() {
    let stage = r#"Stage(doc: "x", refuse: [(when: All([Feature("glossy"), Is("kind", "masked")]), because: "masks are matt")])"#;
    let files = with(FILE, "    resources: {", "    include: [\"stages/a.ron\", \"stages/b.ron\"],\n    resources: {");
    let files = add(files, "pipelines/stages/a.ron", stage);
    let files = add(files, "pipelines/stages/b.ron", "Stage(doc: \"again\", include: [\"a.ron\"])");
    assert_eq!(check_faults(&files), "");
    let mut glossy = set(&[("kind", "masked")]);
    assert!(planned(&files, "test", &glossy).0.is_empty());
    glossy.features.insert("glossy".to_owned(), true);
    let rendered = planned(&files, "test", &glossy).0.render();
    assert_faults(
        &rendered,
        1,
        &["masks are matt", "a.ron:1:33", "the scene has `glossy`", "set `kind` to `plain`, or take a scene without `glossy`"],
    );
}
