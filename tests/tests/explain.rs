//! What `explain`, `profile` and traces say of nodes: whether they run, why not, and what that saves.

use std::{fs, path::Path};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{copy_of_library, manylight_in};

/// Shows the distance of surfaces, with or without a second look at scenes that have textures.
const PIPELINE: &str = r#"Pipeline(
    doc: "Distance, looked at twice where it matters.",
    include: ["stages/gbuffer.ron"],
    params: {"twice": Switch(default: "auto", doc: "whether to look twice")},
    conditions: {"looks_twice": (doc: "The scene is worth it.", when: Switch("twice", Feature("textures")))},
    resources: {
        "once": Texture(format: Rgba8Unorm, size: Output),
        "shown": Texture(format: Rgba8Unorm, size: Output),
    },
    nodes: [
        (id: "plain", node: "views/scalar", in: {"scalar": "gbuffer_depth"}, out: {"view": "shown"}, params: {"high": If(Holds("looks_twice"), 9.0, 10.0)}, when: Not(Holds("looks_twice"))),
        (id: "again", node: "views/scalar", in: {"scalar": "gbuffer_depth"}, out: {"view": "shown"}, params: {"high": 20.0}, when: Holds("looks_twice")),
        (id: "unread", node: "views/scalar", in: {"scalar": "gbuffer_depth"}, out: {"view": "once"}),
    ],
    presents: "shown",
)"#;

/// A camera that moves for two seconds and then rests.
const SCENE: &str = r#"Scene(
    meshes: ["assets/cornell_empty.obj"],
    camera: (origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 39.3, motion: [
        (time: 0.0), (time: 2.0, origin: (3.78, 2.73, -8.0))]),
    lights: [Spot(position: (2.0, 3.9, 1.2), target: (5.4, 4.9, 5.3), intensity: (200.0, 200.0, 200.0), beam_deg: 15.0, cutoff_deg: 20.0)],
)"#;

fn project() -> TempDir {
    let project = copy_of_library();
    fs::write(project.path().join("pipelines/twice.ron"), PIPELINE).expect("writable");
    fs::write(project.path().join("moving.ron"), SCENE).expect("writable");
    project
}

fn run(project: &Path, command: &str, options: &[&str]) -> String {
    let all = [&[command, "pipelines/twice.ron", "--scene", "moving.ron", "--size", "32x32"][..], options].concat();
    manylight_in(project, &all).expect(0).stdout
}

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

/// The object of a node in a list of them.
fn node<'a>(nodes: &'a Value, id: &str) -> &'a Value {
    nodes.as_array().expect("a list").iter().find(|node| node["id"] == id).unwrap_or_else(|| panic!("no node `{id}` in {nodes:#}"))
}

#[test]
fn a_plan_says_what_runs_and_what_does_not_and_why() {
    let project = project();
    let said = run(project.path(), "explain", &[]);
    for line in [
        "gbuffer  runs  ",
        "plain    runs  `shown` is presented; its condition holds: `twice` is auto; the scene does not have `textures`",
        "again    off   its condition does not hold: `twice` is auto; the scene does not have `textures`",
        "unread   dead  nothing that is shown, kept or remembered needs what it writes",
    ] {
        assert!(said.lines().any(|said| said.starts_with(line)), "no line `{line}` in\n{said}");
    }
    let on = run(project.path(), "explain", &["--set", "twice=on", "--format", "json"]);
    let nodes = &json(&on)["nodes"];
    assert_eq!((&node(nodes, "plain")["state"], &node(nodes, "plain")["condition"]), (&"off".into(), &"`twice` is on".into()));
    assert_eq!((&node(nodes, "again")["state"], &node(nodes, "again")["condition"]), (&"runs".into(), &"`twice` is on".into()));
    assert!(node(nodes, "unread")["condition"].is_null() && node(nodes, "again").get("saved_ms").is_none(), "{nodes:#}");
}

#[test]
fn frames_say_what_was_skipped_for_which_inputs_and_what_that_saves() {
    let project = project();
    let after = |frames: &str, options: &[&str]| {
        let all = [&["--frames", frames, "--format", "json"][..], options].concat();
        json(&run(project.path(), "explain", &all))
    };
    let first = after("1", &[]);
    assert!(node(&first["nodes"], "plain")["reason"].as_str().is_some_and(|r| r.ends_with("it ran for the first time")), "{first:#}");
    assert_eq!(node(&first["nodes"], "gbuffer")["unchanged"], Value::Array(Vec::new()));
    // The camera moves.
    let moving = after("3", &["--fps", "10"]);
    let gbuffer = node(&moving["nodes"], "gbuffer");
    assert_eq!((&gbuffer["state"], &gbuffer["changed"]), (&"runs".into(), &serde_json::json!(["scene_camera"])));
    assert!(gbuffer["reason"].as_str().is_some_and(|r| r.contains("it ran for the change of `scene_camera`")), "{gbuffer:#}");
    assert!(gbuffer["unchanged"].as_array().is_some_and(|all| all.contains(&"scene_vertices".into())), "{gbuffer:#}");
    assert_eq!(node(&moving["nodes"], "plain")["changed"], serde_json::json!(["gbuffer_depth"]));
    assert!(gbuffer["time_ms"].as_f64().is_some_and(|ms| ms > 0.0) && gbuffer["saved_ms"].is_null(), "{gbuffer:#}");
    // It rests.
    let still = after("4", &["--time", "3", "--fps", "10"]);
    for id in ["gbuffer", "plain"] {
        let skipped = node(&still["nodes"], id);
        assert_eq!((&skipped["state"], &skipped["changed"]), (&"skipped".into(), &Value::Array(Vec::new())));
        assert!(skipped["saved_ms"].as_f64().is_some_and(|ms| ms > 0.0), "{skipped:#}");
    }
    assert_eq!(node(&still["nodes"], "plain")["reason"], "unchanged since it ran: `gbuffer_depth`");
    // What is off is measured with the switch on.
    assert!(node(&still["nodes"], "again")["saved_ms"].as_f64().is_some_and(|ms| ms > 0.0), "{still:#}");
    assert!(node(&still["nodes"], "unread")["saved_ms"].is_null());
    assert_eq!(still["time_ms"]["ran"], 0.0);
    assert!(still["time_ms"]["everything"].as_f64().is_some_and(|ms| ms > 0.0) && still["adapter"]["name"].is_string(), "{still:#}");
    // With the switch, nothing is skipped.
    let all = after("4", &["--no-skipping"]);
    assert!(
        node(&all["nodes"], "gbuffer")["reason"].as_str().is_some_and(|r| r.ends_with("as every node does where none is skipped")),
        "{all:#}"
    );
    let text = run(project.path(), "explain", &["--frames", "4"]);
    assert!(
        text.contains("nodes that ran in frame 4: 0.000 ms; with every switch on and nothing skipped ") && text.contains("adapter: "),
        "{text}"
    );
    assert!(text.contains("unchanged since it ran: `gbuffer_depth`; saves "), "{text}");
}

#[test]
fn what_has_settled_says_after_how_many_frames() {
    let project = project();
    let options = ["--scene", "moving.ron", "--time", "3", "--size", "32x32", "--set", "rsm_size=64", "--set", "point_count=2000"];
    let all = [&["explain", "acrsm", "--set", "settle=3", "--frames", "12"][..], &options].concat();
    let said = manylight_in(project.path(), &all).expect(0).stdout;
    let settled = "  skipped  it has settled after 3 frames in which nothing changed but the number of the frame and what it writes itself; unchanged: ";
    assert!(said.contains(settled), "{said}");
}

#[test]
fn profiles_and_traces_carry_states_and_reasons() {
    let project = project();
    let options = ["--frames", "3", "--time", "3", "--skip-unchanged"];
    let report = json(&run(project.path(), "profile", &[&options[..], &["--format", "json", "--trace", "trace.json"]].concat()));
    let states = &report["states"];
    for (id, state, reason) in [
        ("plain", "skipped", "unchanged since it ran: `gbuffer_depth`"),
        ("again", "off", "its condition does not hold: `twice` is auto; the scene does not have `textures`"),
    ] {
        let node = node(states, id);
        assert_eq!((&node["state"], &node["reason"]), (&state.into(), &reason.into()));
        assert!(node["saved_ms"].as_f64().is_some_and(|ms| ms > 0.0), "{node:#}");
    }
    assert_eq!(node(states, "unread")["state"], "dead");
    let trace = json(&fs::read_to_string(project.path().join("trace.json")).expect("written"));
    let of = |name: &str| -> Vec<&Value> {
        let events = trace.as_array().expect("events").iter();
        events.filter(|event| event["name"] == name && event["args"]["state"].is_string()).collect()
    };
    let [off] = of("again")[..] else { panic!("one mark of what is off: {trace:#}") };
    assert_eq!((&off["args"]["state"], &off["ph"]), (&"off".into(), &"i".into()));
    let skipped = of("plain");
    assert_eq!(skipped.len(), 3, "{skipped:?}");
    for event in skipped {
        assert_eq!(
            (&event["args"]["state"], &event["args"]["reason"]),
            (&"skipped".into(), &"unchanged since it ran: `gbuffer_depth`".into())
        );
    }
    // Where everything runs, only what the plan leaves out is listed, and has a time with the switch on.
    let text = run(project.path(), "profile", &["--frames", "2", "--trace", "trace.json"]);
    assert!(text.contains("\ndoes not run") && text.contains("the scene does not have `textures`") && !text.contains("skipped"), "{text}");
    let trace = json(&fs::read_to_string(project.path().join("trace.json")).expect("written"));
    let ran = trace.as_array().expect("events").iter().find(|event| event["name"] == "gbuffer" && event["args"]["state"] == "runs");
    assert!(ran.is_some_and(|event| event["ph"] == "X"), "{trace:#}");
}
