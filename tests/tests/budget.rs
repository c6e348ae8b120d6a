//! A frame time that is held: a low one leads to a cheaper rung, the picture stays good, and a recorded run can be repeated.

use std::{fs, path::Path};

use manylight_passes::{
    Budget,
    budget::{BudgetTrace, controller::Why},
};
use serde_json::{Value, json};

use crate::{
    renders::{Job, read},
    support::{Run, copy_of_library, manylight, manylight_in},
};

/// Small, and with parameters that the ladder would move otherwise.
const SMALL: &[&str] =
    &["--scene", "cornell", "--size", "48x48", "--set", "rsm_size=64", "--set", "window=32", "--set", "point_count=2000"];

fn render(frames: &str, more: &[&str]) -> Run {
    manylight(&[&["render", "acrsm", "--frames", frames][..], SMALL, more].concat())
}

fn json_of(file: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(file).expect("a file")).expect("JSON")
}

#[test]
fn a_low_budget_leads_to_a_cheaper_rung_and_a_good_picture() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    let run = render("16", &["--budget", "0.001ms", "--stats", &at("low.json"), "--out", &at("low.png")]).expect(0);
    run.says(&[
        "budget: frame",
        "is over the budget of 0.001 ms: rung 0",
        "not held: this is the cheapest rung",
        "visibility pcss → simple",
    ]);
    render("16", &["--stats", &at("own.json"), "--out", &at("own.png")]).expect(0);
    let (low, own) = (json_of(&folder.path().join("low.json")), json_of(&folder.path().join("own.json")));
    let budget = &low["budget"];
    assert_eq!((&budget["rung"], &budget["held"]), (&json!(budget["rungs"].as_u64().expect("rungs") - 1), &json!(false)), "{budget:#}");
    assert_eq!(budget["moved"]["clusters"], json!({"from": 64, "to": 32}));
    assert_eq!(low["parameters"]["clusters"], 32);
    // What the user sets stays.
    assert_eq!((&low["parameters"]["rsm_size"], &low["parameters"]["point_count"]), (&json!(64), &json!(2000)));
    assert!(budget["moved"].get("rsm_size").is_none());
    assert!(own.get("budget").is_none());
    for channel in 0..3 {
        let of = |stats: &Value| stats["sums"]["composed"]["channels"][channel].clone();
        let (cheap, best) = (of(&low), of(&own));
        assert_eq!(cheap["non_finite"], 0);
        let ratio = cheap["mean"].as_f64().expect("a mean") / best["mean"].as_f64().expect("a mean");
        assert!((0.85..1.15).contains(&ratio), "the picture's mean is {ratio} of what it was");
    }
}

#[test]
fn a_budget_that_is_met_leaves_every_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| folder.path().join(name).display().to_string();
    render("8", &["--budget", "1000s", "--out", &at("held.exr")]).expect(0).says(&["held; rung 0 of"]);
    render("8", &["--out", &at("own.exr")]).expect(0);
    assert!(fs::read(at("held.exr")).expect("a picture") == fs::read(at("own.exr")).expect("a picture"));
}

#[test]
fn a_recorded_run_is_repeated_to_the_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let at = |name: &str| path(name).display().to_string();
    render("12", &["--budget", "0.001ms", "--budget-trace", &at("a.json"), "--out", &at("a.exr")]).expect(0);
    render("12", &["--budget-replay", &at("a.json"), "--out", &at("b.exr")]).expect(0);
    assert!(fs::read(at("a.exr")).expect("a picture") == fs::read(at("b.exr")).expect("a picture"));
    let mut trace: BudgetTrace = serde_json::from_value(json_of(&path("a.json"))).expect("a trace");
    assert!(!trace.changes.is_empty() && trace.replay() == trace.changes);

    // Times of another machine: down, and up again.
    trace.budget_ms = 16.0;
    let times = [[30.0; 5], [9.0; 5], [9.0; 5], [12.0; 5]].concat();
    let sample = |(n, ms): (usize, &f64)| manylight_passes::budget::Sample { frame: n as u64 + 2, ms: Some(*ms) };
    trace.times = times.iter().enumerate().map(sample).collect();
    trace.changes = trace.replay();
    let whys: Vec<Why> = trace.changes.iter().map(|change| change.step.why).collect();
    assert_eq!(whys, [Why::OverBudget, Why::Fits]);
    fs::write(path("b.json"), serde_json::to_string(&trace).expect("writable")).expect("written");
    let stats = |name: &str| {
        render("24", &["--budget-replay", &at("b.json"), "--stats", &at(name)]).expect(0);
        json_of(&path(name))
    };
    let (first, second) = (stats("first.json"), stats("second.json"));
    assert_eq!(first["budget"], second["budget"]);
    assert_eq!(first["sums"], second["sums"]);
    let rungs = |changes: &Value| changes.as_array().expect("changes").iter().map(|c| c["to"].as_u64()).collect::<Vec<_>>();
    let expected: Vec<Option<u64>> = trace.changes.iter().map(|change| Some(change.step.to as u64)).collect();
    assert_eq!(rungs(&first["budget"]["changes"]), expected);
    trace.rungs += 1;
    fs::write(path("b.json"), serde_json::to_string(&trace).expect("writable")).expect("written");
    render("2", &["--budget-replay", &at("b.json"), "--out", &at("c.png")])
        .expect(1)
        .says(&["the times are of a ladder of", "replay with"]);
}

/// As a window does it: nothing waits, and times arrive some frames later.
#[test]
fn nothing_waits_for_times() {
    let job = Job::asset("cornell").small().set("rsm_size", 64);
    let mut renderer = Job { size: (32, 32), ..job }.renderer();
    let mut budget = Budget::new(0.001, &renderer).unwrap_or_else(|e| panic!("{e}"));
    let last = budget.ladder().len() - 1;
    for _ in 0..2000 {
        renderer.render_frame(0.0).expect("a frame");
        if let Some(change) = budget.follow(&mut renderer, None).expect("a rung") {
            assert!(change.step.to > change.step.from && !budget.describe(&change).is_empty());
        }
        if budget.rung() == last && budget.is_settled() {
            break;
        }
    }
    assert!(budget.rung() == last && budget.is_settled(), "rung {} of {last}: {:?}", budget.rung(), budget.trace().times);
    renderer.render_frame(0.0).expect("a frame");
    assert!(read(&renderer, "composed").data.iter().all(|v| v.is_finite()));
    // The first rung is where it came from.
    budget.first_rung(&mut renderer).expect("settings");
    assert_eq!(renderer.settings().set.len(), 2 + 1);
}

#[test]
fn profile_tells_what_a_budget_came_to() {
    let run = manylight(&[&["profile", "acrsm", "--frames", "2", "--warm-up", "1", "--budget", "0.001ms"][..], SMALL].concat()).expect(0);
    run.says(&[
        "budget of 0.001 ms: not held: this is the cheapest rung",
        "on the first rung",
        "clusters 64 → 32",
        "skipping unchanged nodes",
    ]);
    let json = ["profile", "acrsm", "--frames", "2", "--warm-up", "1", "--budget", "1000s", "--format", "json"];
    let report: Value = serde_json::from_str(&manylight(&[&json[..], SMALL].concat()).expect(0).stdout).expect("JSON");
    assert_eq!(
        (&report["budget"]["rung"], &report["budget"]["held"], &report["budget"]["settled"]),
        (&json!(0), &json!(true), &json!(true))
    );
    assert_eq!(report["memory"]["skipping"]["on"], false);
    assert!(report["memory"]["skipping"]["bytes"].as_u64().is_some_and(|bytes| bytes > 0), "{:#}", report["memory"]["skipping"]);
}

/// What skipping takes is the same whether it is told beforehand or afterwards.
#[test]
fn memory_for_skipping_is_what_sharing_saves() {
    let job = |skip_unchanged| Job { skip_unchanged, ..Job::asset("cornell").small() };
    let (shared, skipping) = (job(false).renderer(), job(true).renderer());
    let report = shared.memory_report();
    assert_eq!(shared.memory_for_skipping(), report.pool_unshared - report.pool);
    assert_eq!(skipping.memory_for_skipping(), shared.memory_for_skipping());
    assert_eq!(skipping.memory_report().total() - report.total(), shared.memory_for_skipping());
}

#[test]
fn faults_of_budgets() {
    for wrong in ["0ms", "-3ms", "soon", "16", ""] {
        render("2", &["--out", "target/never.png", &format!("--budget={wrong}")])
            .expect(2)
            .says(&["expected a time above 0, for example `16ms`"]);
    }
    render("2", &["--out", "target/never.png", "--budget-trace", "x.json"]).expect(2).says(&["--budget"]);
    let library = copy_of_library();
    fs::write(library.path().join("pipelines/bare.ron"), "Pipeline(doc: \"bare\", extends: \"acrsm.ron\", quality: [])").expect("written");
    let bare = |more: &[&str]| {
        let line = ["render", "bare", "--scene", "cornell", "--size", "32x32", "--budget", "16ms", "--out", "never.png"];
        manylight_in(library.path(), &[&line[..], more].concat())
    };
    bare(&[]).expect(1).says(&["`bare` has nothing left to give up to hold a budget", "bare.ron:1"]);
    let text = "Pipeline(doc: \"bare\", extends: \"acrsm.ron\", quality: [{\"clusters\": AtMost(48)}])";
    fs::write(library.path().join("pipelines/bare.ron"), text).expect("written");
    bare(&["--set", "clusters=80"]).expect(1).says(&["leave some of these to the budget: clusters", "bare.ron:1"]);
    // Nothing of what runs reads the points.
    let text = "Pipeline(doc: \"bare\", extends: \"acrsm.ron\", quality: [{\"point_count\": AtMost(1000)}])";
    fs::write(library.path().join("pipelines/bare.ron"), text).expect("written");
    bare(&["--set", "visibility=none"]).expect(1).says(&["change nothing of what runs"]);
    let text = "Pipeline(doc: \"x\", include: [\"stages/gbuffer.ron\"], presents: \"gbuffer_albedo\")";
    fs::write(library.path().join("pipelines/bare.ron"), text).expect("written");
    bare(&[]).expect(1).says(&["says not what it can give up", "quality: [{"]);
}
