//! Sweeps: what is done is kept, parts make a whole, faults are told at their place, and those of the papers run.

use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    process::Stdio,
    time::{Duration, Instant},
};

use manylight::{
    files::{Picture, write_exr},
    lab::record::{self, Record},
};

use crate::support::{command, manylight, root};

/// Five runs, each well below a second.
const SWEEP: &str = r#"Sweep(
    doc: "Does it matter?",
    variants: {
        "simple": (pipeline: "acrsm", set: {"visibility": "simple", "rsm_size": 64, "ism_size": 32, "atlas_width": 256}),
        "none": (pipeline: "acrsm", set: {"visibility": "none", "rsm_size": 64}, vary: [{"tiles": [1]}]),
    },
    vary: [{"clusters": [16, 32]}, {"tiles": [1, 2]}],
    scenes: ["cornell"],
    sizes: [(32, 24)],
    frames: 3,
    measure: 2,
    reference: (paths: 16),
)"#;

/// A sweep's document in a folder of its own.
fn with_sweep(text: &str) -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().expect("temporary folder");
    let file = folder.path().join("small.ron");
    fs::write(&file, text).expect("writable");
    let file = file.to_string_lossy().into_owned();
    (folder, file)
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_string_lossy().into_owned()
}

/// Everything but when it was done and how long it took.
fn timeless(folder: &Path) -> Vec<Record> {
    let record::Lines { mut records, damaged, .. } = record::read(&folder.join("records.jsonl")).expect("readable");
    assert!(damaged.is_empty(), "{damaged:?}");
    for record in &mut records {
        record.date.clear();
        let times = &mut record.times;
        for summary in [Some(&mut times.wall), times.gpu.as_mut(), times.cpu.as_mut()].into_iter().flatten() {
            (summary.median, summary.p95) = (0.0, 0.0);
        }
        times.until_picture = 0.0;
        times.nodes.iter_mut().for_each(|node| (node.median, node.p95) = (0.0, 0.0));
    }
    records
}

#[test]
fn a_stopped_sweep_and_one_in_parts_give_the_records_of_one_that_ran_through() {
    let (folder, file) = with_sweep(SWEEP);
    let out = |name: &str| path(folder.path(), name);
    let cache = out("cache");
    let sweep = |name: &str, more: &[&str]| manylight(&[&["sweep", &file, "--out", &out(name), "--cache", &cache], more].concat());
    sweep("whole", &[]).expect(0).says(&["6 of 6 runs have records"]);
    let whole = timeless(&folder.path().join("whole"));
    assert_eq!(whole.iter().map(|r| &r.run).collect::<BTreeSet<_>>().len(), 6);
    assert!(whole.iter().all(|r| r.metrics.contains_key("relative_mean_absolute_error") && r.pictures.error.is_some()));

    // Killed as soon as something is on the disk, then started again.
    let stopped = folder.path().join("stopped");
    let mut child = command(&["sweep", &file, "--out", &out("stopped"), "--cache", &cache])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the program starts");
    let start = Instant::now();
    let lines = || fs::read_to_string(stopped.join("records.jsonl")).map_or(0, |text| text.lines().count());
    while lines() < 2 && start.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(5));
    }
    child.kill().expect("running");
    child.wait().expect("ended");
    let kept = lines();
    assert!((2..6).contains(&kept), "{kept} records when it was killed");
    // As if it had been killed in the middle of a write.
    let text = fs::read_to_string(stopped.join("records.jsonl")).expect("readable");
    fs::write(stopped.join("records.jsonl"), format!("{text}{}", &text[..100])).expect("writable");
    let kept = format!("({} were there already)", text.lines().count());
    sweep("stopped", &[]).expect(0).says(&[&format!("records.jsonl:{}", text.lines().count() + 1), "done again", &kept]);
    assert_eq!(timeless(&stopped), whole);

    // Two parts in one folder.
    sweep("parts", &["--shard", "2/2"]).expect(0).says(&["3 of 6 runs", "3 runs are still to be done"]);
    sweep("parts", &["--shard", "1/2"]).expect(0).says(&["6 of 6 runs"]);
    sweep("parts", &["--report"]).expect(0).says(&["6 of 6 runs"]);
    sweep("parts", &[]).expect(0).says(&["(6 were there already)"]);
    assert_eq!(timeless(&folder.path().join("parts")), whole);

    // A last line without an end is no trouble for the next.
    let records = folder.path().join("whole/records.jsonl");
    let text = fs::read_to_string(&records).expect("readable");
    let lines: Vec<&str> = text.lines().collect();
    fs::write(&records, lines[..5].join("\n")).expect("writable");
    sweep("whole", &[]).expect(0).says(&["(5 were there already)"]);
    assert_eq!(timeless(&folder.path().join("whole")), whole);

    // A damaged line is told, and its run alone is done again.
    let text = fs::read_to_string(&records).expect("readable");
    let damaged: Vec<String> =
        text.lines().enumerate().map(|(i, l)| if i == 2 { l.replace("\"rmse\"", "\"rm") } else { l.to_owned() }).collect();
    fs::write(&records, damaged.join("\n") + "\n").expect("writable");
    sweep("whole", &[]).expect(0).says(&["records.jsonl:3", "(5 were there already)"]);
    assert_eq!(timeless(&folder.path().join("whole")), whole);
    let html = fs::read_to_string(folder.path().join("whole/report.html")).expect("readable");
    for link in ["src=\"http", "href=\"http", "url(http", "@import"] {
        assert!(!html.contains(link), "the report must not need a network: {link}");
    }
}

#[test]
fn faults_of_sweeps_are_told_at_their_place() {
    let (folder, _) = with_sweep("");
    let out = path(folder.path(), "out");
    let fault = |text: &str, says: &[&str]| {
        let (_folder, file) = with_sweep(text);
        manylight(&["sweep", &file, "--out", &out]).expect(1).says(says);
        manylight(&["check", &file]).expect(1).says(says);
    };
    let good = |variant: &str, more: &str| format!("Sweep(doc: \"?\", variants: {{ {variant} }}, scenes: [\"cornell\"]{more})");
    fault("", &["small.ron"]);
    fault(&good("", ""), &["no variants", "small.ron:1"]);
    fault(&good("\"a\": (pipeline: \"acrms\")", ""), &["acrms", "did you mean `acrsm`"]);
    fault(
        &good("\"a\": (pipeline: \"acrsm\", set: {\"cluster\": 64})", ""),
        &["no parameter `cluster`", "did you mean `clusters`", "small.ron:1"],
    );
    fault(&good("\"a\": (pipeline: \"acrsm\", set: {\"clusters\": 5})", ""), &["`5` is no value of `clusters`", "16"]);
    fault(
        &good("\"a\": (pipeline: \"acrsm\")", ", vary: [{\"visibility\": [\"pcss\", \"pcs\"]}]"),
        &["`pcs` is no value", "did you mean `pcss`"],
    );
    fault(
        &good("\"a\": (pipeline: \"acrsm\")", ", vary: [{\"clusters\": [16, 32], \"tiles\": [1]}]"),
        &["`clusters` has 2 values, `tiles` has 1"],
    );
    fault(&good("\"a\": (pipeline: \"acrsm\")", ", vary: [{\"clusters\": []}]"), &["there are no values"]);
    fault(&good("\"a\": (pipeline: \"acrsm\")", ", vary: [{\"clusters\": [16, 16]}]"), &["would be done 2 times"]);
    fault(&good("\"a\": (pipeline: \"acrsm\")", ", image: \"indirec\""), &["no texture `indirec`", "did you mean `indirect`"]);
    fault(&good("\"a\": (pipeline: \"acrsm\")", ", metric: \"flipp\""), &["no metric `flipp`", "did you mean `flip`"]);
    fault(&good("\"a\": (pipeline: \"acrsm\")", ", reference: (component: \"one\")"), &["no component `one`"]);
    fault(&good("\"a\": (pipeline: \"acrsm\")", ", frames: 0"), &["0 is out of range"]);
    fault(&good("\"a\": (pipeline: \"acrsm\")", ", claims: [(variant: \"a\", than: \"b\")]"), &["no variant `b`"]);
    fault(
        &good("\"a\": (pipeline: \"acrsm\", set: {\"tiles\": 1})", ", vary: [{\"tiles\": [1, 2]}]"),
        &["`tiles` varies in the whole sweep, but variant `a` sets it"],
    );
    fault(
        "Sweep(doc: \"?\", variants: {\"a\": (pipeline: \"acrsm\")}, scenes: [\"cornel\"])",
        &["no scene `cornel`", "did you mean `cornell`"],
    );
    manylight(&["sweep", "val-counts", "--out", &out]).expect(1).says(&["no sweep `val-counts`", "did you mean `val-count`"]);
    manylight(&["sweep", "val-count", "--out", &out, "--shard", "3/2"]).expect(2);
    assert!(!Path::new(&out).exists(), "nothing was run, nothing may be written");
}

/// Pipelines beside variants: runs and records of each; what one of them refuses is left out with the reason, also by later commands.
#[test]
fn pipelines_are_compared_and_what_they_refuse_is_left_out_with_the_reason() {
    let sweep = r#"Sweep(
        doc: "?", pipelines: ["acrsm", "ruled.ron"], variants: {"plain": (pipeline: "acrsm", set: {"visibility": "none"})},
        vary: [{"clusters": [16, 32]}, {"rsm_size": [64]}, {"tiles": [1]}, {"ism_size": [16]}, {"atlas_width": [256]}],
        scenes: ["cornell"], sizes: [(16, 16)], frames: 2, measure: 1, reference: (paths: 16),
    )"#;
    let rule = "(when: AtLeast(\"clusters\", 32), because: \"it is too many\")";
    let ruled = |rule: &str| format!("Pipeline(doc: \"x\", extends: \"acrsm.ron\", refuse: [{rule}])");
    let (folder, file) = with_sweep(sweep);
    let out = path(folder.path(), "out");
    fs::write(folder.path().join("ruled.ron"), ruled(rule)).expect("writable");
    let own = ["sweep", &file, "--out", &out, "--cache", &path(folder.path(), "cache")];
    let run = |more: &[&str]| manylight(&[&own, more].concat());
    let reason = "ruled clusters=32 rsm_size=64 tiles=1 ism_size=16 atlas_width=256 | cornell | 16x16 | seed 0: these values are refused: it is too many (`clusters` is 32, at least 32)";
    run(&[]).expect(0).says(&["5 of 5 runs have records", &format!("left out: {reason}")]);
    run(&["--report"]).expect(0).says(&["5 of 5 runs have records"]);
    run(&["--markdown", &out]).expect(0).says(&["(5 were there already)"]);
    let read = |name: &str| fs::read_to_string(Path::new(&out).join(name)).expect("readable");
    assert!(read("report.html").contains(reason), "the report says what is left out");
    assert!(read("small.md").contains("too many") && read("small.md").contains("| pipeline |"));
    let records = record::read(&Path::new(&out).join("records.jsonl")).expect("readable").records;
    let pipelines: Vec<_> = records.iter().map(|r| (r.variant.as_str(), r.pipeline.as_str())).collect();
    assert_eq!(pipelines, [("acrsm", "acrsm"), ("acrsm", "acrsm"), ("ruled", "ruled"), ("plain", "acrsm"), ("plain", "acrsm")]);
    assert_eq!(records[0].metrics, records[2].metrics, "the same nodes and values, the same picture");
    // Without the rule, only what it left out is done.
    fs::write(folder.path().join("ruled.ron"), ruled("")).expect("writable");
    run(&[]).expect(0).says(&["6 of 6 runs have records (5 were there already)"]);
    assert!(!read("report.html").contains("too many"));
    fs::write(folder.path().join("small.ron"), sweep.replace("\"acrsm\", \"ruled.ron\"", "\"acrms\"")).expect("writable");
    run(&[]).expect(1).says(&["small.ron:2", "did you mean `acrsm`"]);
    fs::write(folder.path().join("small.ron"), "Sweep(doc: \"?\", scenes: [\"cornell\"])").expect("writable");
    run(&[]).expect(1).says(&["the sweep names no pipeline", "add `pipelines:"]);
    fs::write(folder.path().join("ruled.ron"), ruled("(when: AtLeast(\"tiles\", 1), because: \"none will do\")")).expect("writable");
    fs::write(folder.path().join("small.ron"), "Sweep(doc: \"?\", pipelines: [\"ruled.ron\"], scenes: [\"cornell\"])").expect("writable");
    manylight(&["check", &file]).expect(0);
    run(&[]).expect(1).says(&["every run of the sweep `small` is refused", "none will do", "ruled.ron:1"]);
}

/// Every pipeline of `pipelines/` but the one that makes the references, and what needs a file of light that was traced before.
#[test]
fn the_sweep_of_systems_has_them_all() {
    let stems = |folder: &str| -> BTreeSet<String> {
        let files = fs::read_dir(root().join(folder)).expect("readable").map(|entry| entry.expect("entry").path());
        files.filter(|path| path.is_file()).map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned()).collect()
    };
    let listed = manylight(&["sweep", "systems", "--list", "--out", "unused"]).expect(0).stdout;
    let runs: BTreeSet<&str> = listed.lines().filter_map(|line| line.split([' ', ',']).next()).collect();
    let needs_a_file = |name: &str| {
        fs::read_to_string(root().join("pipelines").join(name).with_extension("ron")).expect("readable").contains("precomputed/")
    };
    for system in stems("pipelines").iter().filter(|name| *name != "reference" && !needs_a_file(name)) {
        assert!(runs.contains(system.as_str()), "add `{system}` to `pipelines` in pipelines/sweeps/systems.ron");
    }
}

/// A sequence is compared with a reference of each time, and its light goes where the sweep says.
#[test]
fn sequences_follow_the_path_of_the_light() {
    let path_of_light = "light_path: [(time: 0.0, position: (2.0, 3.9, 1.2), target: (5.4, 4.9, 5.3)), (time: 1.0, position: (3.5, 3.9, 1.2), target: (0.2, 1.0, 5.3))]";
    let still = r#"Sweep(
        doc: "?", variants: {"a": (pipeline: "acrsm", set: {"visibility": "none", "rsm_size": 64, "clusters": 16, "tiles": 1})},
        scenes: ["cornell"], sizes: [(16, 16)], frames: 2, measure: 1, fps: 4.0, reference: (paths: 16),
        sequence: (frames: 4, every: 2),
    )"#;
    let run = |text: &str| {
        let (folder, file) = with_sweep(text);
        manylight(&["sweep", &file, "--out", &path(folder.path(), "out"), "--cache", &path(folder.path(), "cache")]).expect(0);
        record::read(&folder.path().join("out/records.jsonl")).expect("readable").records.remove(0)
    };
    let moving = still.replace("sequence:", &format!("{path_of_light}, sequence:"));
    let (still, moving) = (run(still), run(&moving));
    assert_ne!(still.scene.hash, moving.scene.hash);
    for record in [&still, &moving] {
        assert_eq!(record.sequence.iter().map(|frame| frame.time).collect::<Vec<_>>(), [0.5, 1.0]);
        // Compared with the right time, the error is that of the method: with a wrong one, light would be on another wall.
        for frame in &record.sequence {
            let error = frame.metrics["relative_mean_absolute_error"];
            assert!(error < 0.8, "{error} at {} s", frame.time);
        }
    }
    assert!(moving.metrics["flicker"] > still.metrics["flicker"]);
}

#[test]
fn references_on_disk_must_fit() {
    let (folder, file) = with_sweep(SWEEP);
    let out = path(folder.path(), "out");
    let reference = root().join("tests/data/cornell_blocks/onebounce.exr").to_string_lossy().into_owned();
    let sweep = |more: &[&str]| manylight(&[&["sweep", &file, "--out", &out, "--scene", "cornell"], more].concat());
    sweep(&["--reference", &reference]).expect(1).says(&["onebounce.exr", "256×256", "32×24"]);
    sweep(&["--reference", "nowhere.exr"]).expect(1).says(&["nowhere.exr"]);
    sweep(&["--reference", &reference, "--scene", "moving"]).expect(2).says(&["--scene once"]);
    assert!(!Path::new(&out).exists(), "nothing was run, nothing may be written");
    // What is not a number is left out, and said.
    let holey = path(folder.path(), "holey.exr");
    let mut data = vec![0.1; 32 * 24 * 3];
    data[100] = f32::NAN;
    write_exr(Path::new(&holey), &Picture::linear(32, 24, 3, data)).expect("writable");
    sweep(&["--reference", &holey]).expect(0).says(&["(1 pixels are not finite"]);
    let report = fs::read_to_string(Path::new(&out).join("report.html")).expect("readable");
    assert!(report.contains("1 pixel of simple clusters=16"), "the report says so");
}

/// Every sweep of `pipelines/sweeps`, in its small size.
#[test]
fn the_sweeps_of_the_papers_run() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let cache = path(folder.path(), "cache");
    let mut names: Vec<_> = fs::read_dir(root().join("pipelines/sweeps"))
        .expect("readable")
        .map(|entry| entry.expect("entry").path().file_stem().expect("a name").to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert!(names.len() >= 10, "{names:?}");
    for name in names {
        let out = folder.path().join(&name);
        let start = Instant::now();
        manylight(&["sweep", &name, "--small", "--out", &out.to_string_lossy(), "--cache", &cache]).expect(0);
        let record::Lines { records, damaged, .. } = record::read(&out.join("records.jsonl")).expect("readable");
        println!("{name}: {} runs in {:.1} s", records.len(), start.elapsed().as_secs_f64());
        assert!(damaged.is_empty() && records.len() >= 2, "{name}");
        for record in &records {
            let error = record.metrics.get("relative_rmse").copied().unwrap_or(f64::NAN);
            assert!(error.is_finite() && error > 0.0, "{name}, {}: {error}", record.run);
            assert!(record.times.frame() > 0.0 && !record.times.nodes.is_empty(), "{name}, {}", record.run);
        }
        assert!(fs::read_to_string(out.join("report.html")).expect("readable").contains(&records[0].variant), "{name}");
    }
}

#[test]
fn a_tuned_preset_renders() {
    let (folder, file) = with_sweep(SWEEP);
    let at = |name: &str| path(folder.path(), name);
    let tune = |more: &[&str]| {
        let own = ["tune", "acrsm", "--scene", "cornell", "--sweep", &file, "--records", &at("records"), "--cache", &at("cache")];
        manylight(&[&own, more].concat())
    };
    tune(&["--error", "1e9", "--out", &at("fast.ron")]).expect(0).says(&["ms a frame", "fast.ron"]);
    let records = record::read(&folder.path().join("records/records.jsonl")).expect("readable").records;
    let fastest = records.iter().min_by(|a, b| a.times.frame().total_cmp(&b.times.frame())).expect("records");
    let preset = fs::read_to_string(folder.path().join("fast.ron")).expect("readable");
    for (name, value) in &fastest.set {
        assert!(
            preset.contains(&format!("\"{name}\": {value}")) || preset.contains(&format!("\"{name}\": \"{value}\"")),
            "{name} in {preset}"
        );
    }
    tune(&["--budget", "1000s", "--out", &at("good.ron")]).expect(0);
    manylight(&["check", &at("good.ron")]).expect(0);
    manylight(&["render", &at("good.ron"), "--scene", "cornell", "--size", "32x24", "--frames", "2", "--out", &at("x.png")]).expect(0);
    tune(&["--error", "1e-9", "--out", &at("no.ron")]).expect(1).says(&["the most accurate setting"]);
    assert!(!folder.path().join("no.ron").exists());
}
