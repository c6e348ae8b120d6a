//! Conditions over measured features, switches, conditions with names, and values that depend on a condition.

use manylight_graph::{
    features::{MEASURED, Measured},
    pipeline::Pipeline,
    plan::{Idle, Plan, PlanInput},
    value::Value,
};

use crate::kit::*;

const FILE: &str = "pipelines/test.ron";
const PARAMS: &str = "    params: {";
const RESOURCES: &str = "    resources: {";
const SOFT: &str = "when: All([IsOn(\"blur\"), Any([Is(\"kind\", \"plain\"), Is(\"kind\", \"masked\")])])";
const HARD: &str = "when: Not(IsOn(\"blur\"))";
const SWITCH: &str = "\"shadows\": Switch(default: \"auto\", doc: \"whether to blur softly\"), \
     \"threshold\": Float(min: 0.0, max: 1.0, default: 0.02, doc: \"least share\"),";
const NAMED: &str =
    "\"soft\": (doc: \"Where it matters.\", when: Switch(\"shadows\", Above(\"indirect_occlusion\", Param(\"threshold\")))),";

/// The kit's pipeline, which blurs softly where the condition `soft` holds, and hard where it does not; with these conditions.
fn named(conditions: &str) -> Files {
    let files = with(FILE, PARAMS, &format!("{PARAMS} {SWITCH}"));
    let files = edit(files, FILE, "        \"blur\": Bool(default: true, doc: \"whether to blur\"),\n", "");
    let files = edit(files, FILE, RESOURCES, &format!("    conditions: {{ {conditions} }},\n{RESOURCES}"));
    let files = edit(files, FILE, SOFT, "when: All([Holds(\"soft\"), Any([Is(\"kind\", \"plain\"), Is(\"kind\", \"masked\")])])");
    edit(files, FILE, HARD, "when: Not(Holds(\"soft\"))")
}

/// The kit's pipeline with a condition over what is measured, by name and in a value.
pub fn measuring() -> Files {
    let value = "params: {\"radius\": If(Holds(\"soft\"), Param(\"radius\"), 1)}";
    edit(named(NAMED), FILE, "params: {\"radius\": 1}", value)
}

fn measured(value: f64, standard_error: f64) -> PlanInput {
    PlanInput { measured: [("indirect_occlusion".to_owned(), Measured { value, standard_error })].into(), ..input() }
}

fn set(input: PlanInput, pairs: &[(&str, &str)]) -> PlanInput {
    PlanInput { set: pairs.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect(), ..input }
}

/// Why a node is on or off.
fn why(plan: &Plan, id: &str) -> (bool, String) {
    if let Some(node) = plan.nodes.iter().find(|node| node.id == id) {
        return (true, node.because.clone().unwrap_or_default());
    }
    let node = plan.idle.iter().find(|node| node.id == id).expect("the node is in the pipeline");
    match &node.reason {
        Idle::Off(why) => (false, why.clone()),
        Idle::Dead => panic!("{id} is dead"),
    }
}

#[track_caller]
fn one(files: &Files, parts: &[&str]) {
    assert_faults(&check_faults(files), 1, parts);
}

#[test]
fn a_switch_follows_what_is_measured_only_when_it_is_auto() {
    let files = named(NAMED);
    assert_eq!(check_faults(&files), "");
    let auto = "`shadows` is auto; `indirect_occlusion`";
    for (input, holds, told) in [
        (input(), true, format!("{auto} is not measured, which counts as above 0.02 (`threshold`)")),
        (measured(0.031, 0.0008), true, format!("{auto} is 0.0310 ± 0.0008, above 0.02 (`threshold`)")),
        (measured(0.0031, 0.0008), false, format!("{auto} is 0.0031 ± 0.0008, not above 0.02 (`threshold`)")),
        // Within two standard errors it is not known to be small.
        (measured(0.019, 0.0006), true, format!("{auto} is 0.0190 ± 0.0006, which may be above 0.02 (`threshold`)")),
        (measured(0.019, 0.0004), false, format!("{auto} is 0.0190 ± 0.0004, not above 0.02 (`threshold`)")),
        (measured(f64::NAN, 0.0), true, format!("{auto} is NaN ± 0, above 0.02 (`threshold`)")),
        (set(measured(0.0031, 0.0), &[("threshold", "0.003")]), true, format!("{auto} is 0.00310 ± 0, above 0.003 (`threshold`)")),
        (set(measured(0.0, 0.0), &[("shadows", "on")]), true, "`shadows` is on".to_owned()),
        (set(measured(1.0, 0.0), &[("shadows", "off")]), false, "`shadows` is off".to_owned()),
    ] {
        let plan = try_plan(&files, &input).unwrap();
        let (soft, because) = why(&plan, "soft");
        assert_eq!(soft, holds, "{told}");
        assert_eq!(because.split("; `kind`").next(), Some(told.as_str()));
        let (hard, because) = why(&plan, "hard");
        assert_eq!((hard, because), (!holds, told));
    }
}

#[test]
fn each_bound_decides_on_its_own_side_of_it() {
    for bound in ["0.02", "Param(\"threshold\")"] {
        let files = named(&NAMED.replace("Param(\"threshold\")", bound));
        let files = if bound == "0.02" { edit(files, FILE, ", \"threshold\"", ", \"unused\"") } else { files };
        let runs = |value: f64| why(&try_plan(&files, &measured(value, 0.0)).unwrap(), "soft").0;
        assert!(!runs(0.02) && runs(0.02f64.next_up()) && !runs(0.02f64.next_down()), "{bound}");
    }
}

#[test]
fn a_pipeline_knows_what_must_be_measured() {
    let names = |files: &Files| -> Vec<String> {
        let pipeline = Pipeline::load(&library(files), "test").unwrap();
        pipeline.measured_features().into_iter().map(str::to_owned).collect()
    };
    assert_eq!(names(&files()), Vec::<String>::new());
    assert_eq!(names(&named(NAMED)), ["indirect_occlusion"]);
    let value = "params: {\"radius\": If(Above(\"depth_spread\", 2.0), 1, 2)}";
    assert_eq!(names(&with(FILE, "params: {\"radius\": 1}", value)), ["depth_spread"]);
    let refused = format!("refuse: [(when: Above(\"lit_share\", 0.5), because: \"x\")],\n{RESOURCES}");
    assert_eq!(names(&with(FILE, RESOURCES, &refused)), ["lit_share"]);
}

#[test]
fn names_and_types_in_the_new_forms() {
    let when = |when: &str| named(&NAMED.replace("Switch(\"shadows\", Above(\"indirect_occlusion\", Param(\"threshold\")))", when));
    let above = "Above(\"indirect_occlusion\", Param(\"threshold\"))";
    let auto = |inner: &str| when(&format!("Switch(\"shadows\", {inner})"));
    one(
        &auto("Above(\"indirect_oclusion\", Param(\"threshold\"))"),
        &["there is no measured feature `indirect_oclusion`", "8:84", "did you mean `indirect_occlusion`?"],
    );
    one(&auto("Above(\"glossy\", Param(\"threshold\"))"), &["there is no measured feature `glossy`", "write Feature(\"glossy\")"]);
    one(&auto("Above(\"radius\", Param(\"threshold\"))"), &["there is no measured feature `radius`", "write AtLeast(\"radius\", n)"]);
    one(
        &auto("Above(\"indirect_occlusion\", Param(\"treshold\"))"),
        &["the pipeline has no parameter `treshold`", "did you mean `threshold`?"],
    );
    one(
        &auto("Above(\"indirect_occlusion\", Param(\"kind\"))"),
        &["`Above` compares with a number, and `kind` is Choice", "compare with a number, or with a parameter that is one"],
    );
    one(&auto("Above(\"indirect_occlusion\", \"threshold\")"), &["expected a number or Param(\"parameter\"), found a string"]);
    one(&auto("Above(\"indirect_occlusion\")"), &["`Above` is not used like this", "write `Above(\"feature\", 0.02)`"]);
    one(
        &auto("Feature(\"indirect_occlusion\")"),
        &["there is no scene feature `indirect_occlusion`", "write Above(\"indirect_occlusion\", 0.02)"],
    );
    one(&when(&format!("Switch(\"shadow\", {above})")), &["the pipeline has no parameter `shadow`", "did you mean `shadows`?"]);
    one(
        &when(&format!("Switch(\"kind\", {above})")),
        &[
            "`Switch` tests a choice of `auto`, `on` and `off`, and `kind` is one of `plain`, `masked`",
            "Switch(default: \"auto\", doc: \"…\")",
        ],
    );
    one(&when(&format!("Switch(\"radius\", {above})")), &["and `radius` is Int", "declared here"]);
    one(&when("Switch(\"shadows\")"), &["`Switch` is not used like this", "write `Switch(\"parameter\", a)`"]);
    one(&when("Holds(soft)"), &["expected the name of a condition in quotes", "write it in quotes: \"soft\""]);
    let files = edit(named(NAMED), FILE, "Not(Holds(\"soft\"))", "Not(Holds(\"sift\"))");
    one(&files, &["the pipeline has no condition `sift`", "24:120", "did you mean `soft`?"]);
    // The same of a parameter.
    one(&edit(files, FILE, "Not(Holds(\"sift\"))", "Not(IsOn(\"shadow\"))"), &["the pipeline has no parameter `shadow`"]);
    // What cannot be read is not missing.
    one(&named("\"soft\": (doc: \"x\", wen: IsOn(\"blur\"))"), &["unknown field `wen` in a condition with a name", "`when`"]);
    one(&named("\"soft\": IsOn(\"blur\")"), &["expected a condition with a name", "write `(doc: \"…\", when: …)`"]);
    one(&named(&NAMED.replace("doc: \"Where it matters.\", ", "")), &["missing field `doc` in a condition with a name"]);
    one(
        &edit(named(NAMED), FILE, "Switch(default: \"auto\"", "Switch(default: \"aut\""),
        &["the default \"aut\" of `shadows` is not allowed"],
    );
}

#[test]
fn conditions_in_a_circle() {
    let circle = "\"soft\": (doc: \"x\", when: Not(Holds(\"b\"))), \"b\": (doc: \"x\", when: Any([Holds(\"c\"), Feature(\"glossy\")])), \
         \"c\": (doc: \"x\", when: Holds(\"soft\")), \"d\": (doc: \"x\", when: Holds(\"c\")),";
    one(&named(circle), &["conditions wait for each other in a circle: soft → b → c → soft", "8:54", "`b` names `c`", "`c` names `soft`"]);
    one(&named("\"soft\": (doc: \"x\", when: Holds(\"soft\")),"), &["in a circle: soft → soft", "8:50"]);
}

#[test]
fn conditions_are_merged_like_parameters() {
    let stage = |name: &str, condition: &str| add(named(NAMED), name, &format!("Stage(doc: \"x\", conditions: {{{condition}}})"));
    let other = "\"soft\": (doc: \"x\", when: Feature(\"glossy\"))";
    let files = edit(stage("pipelines/stages/a.ron", other), FILE, "    nodes: [", "    include: [\"stages/a.ron\"],\n    nodes: [");
    one(&files, &["there are two conditions `soft`", "a.ron:1:30", "the other one"]);
    // What extends may say it anew; the nodes that it takes over follow.
    let variant = format!("Pipeline(doc: \"x\", extends: \"test.ron\", conditions: {{{other}}})");
    let files = add(named(NAMED), "pipelines/variant.ron", &variant);
    let (registry, _) = registry(&files, &[]);
    let pipeline = Pipeline::load(&library(&files), "variant").unwrap();
    let plan = manylight_graph::planner::plan(&pipeline, &registry, &input()).unwrap();
    assert_eq!(why(&plan, "soft"), (false, "the scene does not have `glossy`".to_owned()));
    let rendered = manylight_graph::check::check_file(&library(&files), "variant", &registry).render();
    assert_faults(&rendered, 2, &["nothing uses the parameter `shadows`", "nothing uses the parameter `threshold`"]);
}

#[test]
fn a_value_may_depend_on_a_condition() {
    let value = |value: &str| edit(named(NAMED), FILE, "params: {\"radius\": 1}", &format!("params: {{\"radius\": {value}}}"));
    let files = value("If(Holds(\"soft\"), Param(\"radius\"), If(Feature(\"glossy\"), 2, 1))");
    assert_eq!(check_faults(&files), "");
    let radius = |input: PlanInput| {
        let plan = try_plan(&files, &input).unwrap();
        plan.nodes.iter().find(|node| node.id == "show").unwrap().params[0].1.clone()
    };
    assert_eq!(radius(input()), Value::Int(3));
    assert_eq!(radius(measured(0.0, 0.0)), Value::Int(1));
    let mut glossy = measured(0.0, 0.0);
    glossy.features.insert("glossy".into(), true);
    assert_eq!(radius(glossy), Value::Int(2));
    assert_eq!(radius(set(measured(0.0, 0.0), &[("show.radius", "9")])), Value::Int(9));
    one(&value("If(Holds(\"soft\"), 100, 1)"), &["100 is no value of the parameter `radius`", "19:133", "from 1 to 64"]);
    one(&value("If(Holds(\"soft\"), 1, \"x\")"), &["\"x\" is no value of the parameter `radius`", "19:136"]);
    one(&value("If(Holds(\"soft\"), Param(\"count\"), 1)"), &["parameter `count` does not fit `radius` of node `show`", "19:133"]);
    one(&value("If(Holds(\"soft\"), Param(\"coun\"), 1)"), &["the pipeline has no parameter `coun`", "did you mean `count`?"]);
    one(&value("If(Holds(\"sof\"), 2, 1)"), &["the pipeline has no condition `sof`", "did you mean `soft`?"]);
    one(&value("If(Holds(\"soft\"), 2)"), &["`If` is not used like this", "write `If(condition, value, other value)`"]);
    one(&value("Param(2, 3)"), &["`Param` is not used like this", "write `Param(\"parameter\")`"]);
    one(
        &value("If(Not(Any([])), 2, 1)"),
        &["warning: the condition for `radius` of node `show` always holds", "there is nothing to choose from"],
    );
}

#[test]
fn both_sides_of_every_bound_are_checked() {
    // Nobody blurs between the bounds.
    let files = named("\"soft\": (doc: \"x\", when: Above(\"indirect_occlusion\", 0.02)),");
    let files = edit(files, FILE, "\"shadows\": Switch(default: \"auto\", doc: \"whether to blur softly\"), ", "");
    let files = edit(files, FILE, "Not(Holds(\"soft\"))", "Not(Above(\"indirect_occlusion\", Param(\"threshold\")))");
    assert_eq!(check_faults(&files), "");
    let hard_from = |threshold: &str| edit(files.clone(), FILE, "default: 0.02", &format!("default: {threshold}"));
    one(&hard_from("0.01"), &["`blurred` is read, but not written in this frame", "(when `indirect_occlusion` is 0.02)"]);
    one(&hard_from("0.03"), &["`blurred` is written by two nodes: `soft` and `hard`", "(when `indirect_occlusion` is 0.03)"]);
    // One feature alone.
    let files =
        edit(files, FILE, "Above(\"indirect_occlusion\", 0.02)", "Any([Above(\"indirect_occlusion\", 0.02), Above(\"lit_share\", 0.1)])");
    one(&files, &["`blurred` is written by two nodes", "(when `indirect_occlusion` is 0.02)"]);
    let both = "Not(Any([Above(\"indirect_occlusion\", Param(\"threshold\")), Above(\"lit_share\", 0.1), Above(\"depth_spread\", 3)]))";
    let files = edit(files, FILE, "Not(Above(\"indirect_occlusion\", Param(\"threshold\")))", both);
    one(&files, &["`blurred` is read, but not written in this frame", "(when nothing measured but `depth_spread` is above a bound)"]);
}

#[test]
fn other_values_are_checked_with_little_measured_too() {
    let files = named(NAMED);
    // Off, it is written by both where little is measured.
    let files = edit(
        files,
        FILE,
        "Not(Holds(\"soft\"))",
        "Any([Not(Holds(\"soft\")), All([Is(\"kind\", \"masked\"), Not(Above(\"lit_share\", 0.1))])])",
    );
    let files = edit(
        files,
        FILE,
        "Above(\"indirect_occlusion\", Param(\"threshold\"))",
        "Not(Above(\"indirect_occlusion\", Param(\"threshold\")))",
    );
    one(&files, &["`blurred` is written by two nodes", "(when `kind` is `masked` and nothing measured of the scene is above a bound)"]);
}

#[test]
fn conditions_with_one_outcome_are_warnings_with_the_reason() {
    let when = |when: &str| {
        let files = with(FILE, "(id: \"pyramid\", node", "(id: \"other\", node");
        let show = "(id: \"third\", node: \"post/blur\", in: {\"source\": \"result\"}, out: {\"blurred\": \"third\"}, when: WHEN),\n        (id: \"other\"";
        let files = edit(files, FILE, "(id: \"other\"", &show.replace("WHEN", when));
        edit(files, FILE, RESOURCES, &format!("{RESOURCES} \"third\": Texture(format: Rgba16Float, size: Output),"))
    };
    let never = |condition: &str, reason: &str| one(&when(condition), &["warning: the condition of node `third` can never hold", reason]);
    let always = |condition: &str, reason: &str| one(&when(condition), &["warning: the condition of node `third` always holds", reason]);
    never("AtLeast(\"count\", 5000)", "`count` is from 1 to 4096");
    never("Below(\"count\", 1)", "`count` is from 1 to 4096");
    always("AtLeast(\"count\", 1)", "`count` is from 1 to 4096");
    always("Below(\"count\", 4096.5)", "`count` is from 1 to 4096");
    never("All([IsOn(\"blur\"), Is(\"kind\", \"plain\"), Is(\"kind\", \"masked\")])", "this does not hold where those before it do");
    always("Any([Is(\"kind\", \"plain\"), Is(\"kind\", \"masked\"), IsOn(\"blur\")])", "this holds wherever those before it do not");
    never("All([AtLeast(\"count\", 100), Below(\"count\", 100)])", "this does not hold where those before it do");
    never("All([AtLeast(\"count\", 99.5), Below(\"count\", 99.7)])", "this does not hold where those before it do");
    never("Not(Any([Not(AtLeast(\"count\", 5000)), IsOn(\"blur\")]))", "`count` is from 1 to 4096");
    never("Above(\"lit_share\", 1)", "`lit_share` is from 0 to 1");
    always("Above(\"depth_spread\", -0.5)", "`depth_spread` is at least 0");
    never("All([Above(\"lit_share\", 0.5), Not(Above(\"lit_share\", 0.25))])", "this does not hold where those before it do");
    never("All([Feature(\"glossy\"), Not(Feature(\"glossy\"))])", "this does not hold where those before it do");
    never("Any([])", "there is nothing to choose from");
    for contingent in [
        "AtLeast(\"count\", 4096)",
        "Below(\"count\", 2)",
        "All([AtLeast(\"count\", 99.5), Below(\"count\", 100.5)])",
        "All([Not(Above(\"lit_share\", 0.5)), Above(\"lit_share\", 0.25)])",
        "Above(\"depth_spread\", 1000)",
        "Above(\"lit_share\", 0)",
        "All([Feature(\"glossy\"), Not(Feature(\"textures\")), Is(\"kind\", \"masked\"), Not(IsOn(\"blur\"))])",
    ] {
        assert_eq!(check_faults(&when(contingent)), "", "{contingent}");
    }
}

#[test]
fn a_condition_with_one_outcome_is_told_once() {
    // A switch that is on holds, whatever it switches.
    let all = "All([Above(\"lit_share\", 1.5), Above(\"indirect_occlusion\", Param(\"threshold\"))])";
    assert_eq!(check_faults(&named(&NAMED.replace("Above(\"indirect_occlusion\", Param(\"threshold\"))", all))), "");
    let files = named("\"soft\": (doc: \"x\", when: Holds(\"least\")), \"least\": (doc: \"x\", when: Below(\"radius\", 0)),");
    let files = edit(files, FILE, SWITCH, "");
    one(&files, &["warning: the condition `least` can never hold", "8:87", "`radius` is from 1 to 32"]);
}

#[test]
fn what_nothing_uses() {
    let files = named(&format!("{NAMED} \"other\": (doc: \"x\", when: Feature(\"glossy\")),"));
    one(&files, &["warning: nothing uses the condition `other`", "use it or remove it"]);
    // Named in a value or by another condition, it is used.
    let value = "params: {\"radius\": If(Holds(\"other\"), 2, 1)}";
    assert_eq!(check_faults(&edit(files, FILE, "params: {\"radius\": 1}", value)), "");
}

#[test]
fn refusals_know_the_new_forms_and_their_remedies() {
    let rule = |when: &str| {
        let rule = format!("    refuse: [(when: {when}, because: \"x\")],\n{RESOURCES}");
        edit(named(NAMED), FILE, RESOURCES, &rule)
    };
    let help = |files: &Files, input: &PlanInput| try_plan(files, input).unwrap_err().0[0].help.clone().unwrap();
    let files = rule("All([Is(\"kind\", \"masked\"), Holds(\"soft\")])");
    assert_eq!(
        help(&files, &set(measured(0.0312, 0.0), &[("kind", "masked")])),
        "set `kind` to `plain`, or set `shadows` to `off`, or set `threshold` to `0.032`, or take a scene with less `indirect_occlusion`"
    );
    // Another threshold changes nothing where the switch is on.
    assert_eq!(help(&files, &set(measured(0.0312, 0.0), &[("kind", "masked"), ("shadows", "on")])).matches("threshold").count(), 0);
    let files = rule("All([Is(\"kind\", \"masked\"), Not(Holds(\"soft\"))])");
    assert_eq!(
        help(&files, &set(measured(0.01, 0.0), &[("kind", "masked")])),
        "set `kind` to `plain`, or set `shadows` to `on`, or set `threshold` to `0.0`, or take a scene with more `indirect_occlusion`"
    );
}

#[test]
fn what_cannot_be_measured_is_not_listed() {
    let page = manylight_graph::reference::markdown(&registry(&files(), &[]).0);
    let json = manylight_graph::reference::json(&registry(&files(), &[]).0);
    for feature in MEASURED {
        assert!(page.contains(&format!("| `Above(\"{}\", …)` | {} |", feature.name, feature.doc)), "{page}");
    }
    assert!(page.contains("| `Feature(\"glossy\")` |"));
    assert_eq!(json["features"][0]["name"], "textures");
    assert_eq!(
        (&json["measured_features"][0]["name"], &json["measured_features"][0]["at_most"]),
        (&"indirect_occlusion".into(), &1.0.into())
    );
    assert!(json["measured_features"][5]["at_most"].is_null());
}
