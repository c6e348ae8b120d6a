//! Ladders of quality: what they come to, and what is wrong with them.

use manylight_graph::{pipeline::Pipeline, value::Value};

use crate::kit::*;

const FILE: &str = "pipelines/test.ron";

fn laddered(rungs: &str) -> Files {
    with(FILE, "    presents: \"result\",", &format!("    quality: [{rungs}],\n    presents: \"result\","))
}

/// The rungs of a pipeline, each as `name value`.
fn rungs(files: &Files, name: &str, fixed: &[&str]) -> Vec<String> {
    let pipeline = Pipeline::load(&library(files), name).unwrap_or_else(|faults| panic!("{faults}"));
    let (registry, _) = registry(files, &[]);
    let own = manylight_graph::planner::plan(&pipeline, &registry, &input()).unwrap().params;
    let fixed: Vec<String> = fixed.iter().map(|name| (*name).to_owned()).collect();
    let text = |values: &Vec<(String, Value)>| values.iter().map(|(name, value)| format!("{name} {value}")).collect::<Vec<_>>().join(", ");
    pipeline.rungs(&own, &fixed).iter().map(text).collect()
}

const LADDER: &str = r#"{"count": AtMost(64)}, {"radius": AtLeast(8), "kind": Instead("plain", "masked")}, {"count": AtMost(16), "blur": Instead(true, false)}"#;

#[test]
fn rungs_add_up() {
    let files = laddered(LADDER);
    assert_eq!(check_faults(&files), "");
    let all = ["", "count 64", "count 64, radius 8, kind masked", "blur false, count 16, radius 8, kind masked"];
    assert_eq!(rungs(&files, "test", &[]), all);
    // What the user sets stays.
    assert_eq!(rungs(&files, "test", &["count"]), ["", "radius 8, kind masked", "blur false, radius 8, kind masked"]);
    assert_eq!(rungs(&files, "test", &["count", "radius", "kind", "blur"]), [""]);
}

/// A pipeline that is below a bound by itself is not made slower by it.
#[test]
fn bounds_only_lead_onward() {
    let preset = r#"Pipeline(doc: "x", extends: "test.ron", set: {"count": 20, "radius": 9, "kind": "masked", "blur": false})"#;
    let files = add(laddered(LADDER), "pipelines/variant.ron", preset);
    assert_eq!(rungs(&files, "variant", &[]), ["", "count 16"]);
}

#[test]
fn a_ladder_is_inherited_and_replaced_whole() {
    let files = add(laddered(LADDER), "pipelines/a.ron", r#"Pipeline(doc: "x", extends: "test.ron")"#);
    assert_eq!(rungs(&files, "a", &[]).len(), 4);
    let files = add(files, "pipelines/b.ron", r#"Pipeline(doc: "x", extends: "test.ron", quality: [{"count": AtMost(5)}])"#);
    assert_eq!(rungs(&files, "b", &[]), ["", "count 5"]);
    let files = add(files, "pipelines/c.ron", r#"Pipeline(doc: "x", extends: "test.ron", quality: [])"#);
    assert_eq!(rungs(&files, "c", &[]), [""]);
}

#[test]
fn one_ladder_comes_from_stages_or_the_file_has_its_own() {
    let stage = r#"Stage(doc: "x", quality: [{"count": AtMost(50)}])"#;
    let include = "    include: [\"stages/a.ron\", \"stages/b.ron\"],\n    params: {\n        \"blur\"";
    let both = with(FILE, "    params: {\n        \"blur\"", include);
    let files = add(add(both, "pipelines/stages/a.ron", stage), "pipelines/stages/b.ron", r#"Stage(doc: "y")"#);
    assert_eq!(check_faults(&files), "");
    assert_eq!(rungs(&files, "test", &[]), ["", "count 50"]);
    let files = add(files, "pipelines/stages/b.ron", stage);
    assert_faults(
        &check_faults(&files),
        1,
        &["there are two ladders of quality", "stages/b.ron:1:26", "the other one", "stages/a.ron", "which replaces them"],
    );
    let files = edit(files, FILE, "    presents: \"result\",", "    quality: [{\"count\": AtMost(7)}],\n    presents: \"result\",");
    assert_eq!(check_faults(&files), "");
    assert_eq!(rungs(&files, "test", &[]), ["", "count 7"]);
}

#[test]
fn faults_of_ladders() {
    let fault = |rungs: &str, parts: &[&str]| assert_faults(&check_faults(&laddered(rungs)), 1, parts);
    fault(r#"{"cont": AtMost(5)}"#, &["has no parameter `cont`", "did you mean `count`?", "test.ron:26:16"]);
    fault(r#"{"paint.strength": AtMost(0.5)}"#, &["parameters of the pipeline, not of a node", "\"strength\": Param(\"…\")"]);
    fault(r#"{"count": AtMost(0)}"#, &["0 is no value of `count`", "a whole number from 1 to 4096"]);
    fault(r#"{"count": AtMost(2.5)}"#, &["2.5 is no value of `count`"]);
    fault(r#"{"kind": Instead("plain", "maskd")}"#, &["\"maskd\" is no value of `kind`", "did you mean `masked`?"]);
    fault(r#"{"kind": AtMost("plain")}"#, &["`AtMost` bounds no parameter of type Choice", "write `Instead(…, …)`"]);
    fault(r#"{"count": Instead(100, 5)}"#, &["`Instead` bounds no parameter of type Int", "`AtMost(…)` or `AtLeast(…)`"]);
    fault(r#"{"count": AtMost(50)}, {"count": AtMost(50)}"#, &["`count` is at most 50 already", "the earlier rung"]);
    fault(r#"{"radius": AtLeast(9)}, {"radius": AtLeast(5)}"#, &["`radius` is at least 9 already"]);
    fault(r#"{"count": AtMost(50)}, {"count": AtLeast(60)}"#, &["`count` goes one way on an earlier rung, and the other way on this one"]);
    fault(
        r#"{"kind": Instead("plain", "masked")}, {"kind": Instead("masked", "plain")}"#,
        &["`kind` goes back to \"plain\", which an earlier rung gave up"],
    );
    fault(r#"{"kind": Instead("plain", "plain")}"#, &["`kind` stays as it is"]);
    fault("{}", &["this rung changes nothing"]);
    fault(r#"{"count": 50}"#, &["expected a bound: AtMost(…), AtLeast(…) or Instead(…, …), found a number", "AtMost(16000)"]);
    fault(r#"{"count": AtMots(50)}"#, &["unknown bound `AtMots`", "did you mean `AtMost`?"]);
    fault(r#"{"count": AtMost(50, 60)}"#, &["`AtMost` is not used like this"]);
    fault(r#"("count", 5)"#, &["expected a map of bounds"]);
}

/// What is wrong only on a rung is told with it.
#[test]
fn rungs_are_planned_by_check() {
    let files = laddered(r#"{"blur": Instead(true, false), "radius": AtLeast(32)}"#);
    // With blurring off, the second writer of `blurred` is gone as well.
    let files = edit(files, FILE, "when: Not(IsOn(\"blur\"))", "when: All([Not(IsOn(\"blur\")), Below(\"radius\", 8)])");
    assert_faults(&check_faults(&files), 1, &["`blurred`", "(on the rung of `quality` where `blur` is `false` and `radius` is `32`)"]);
}
