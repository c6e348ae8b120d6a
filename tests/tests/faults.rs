//! What is not the fault of documents: a device that is lost, a disk that is full, a process that is killed, sizes that nobody means.

use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
    sync::Arc,
    time::Duration,
};

use manylight::{
    Gpu, GpuOptions, RenderError, Renderer, SceneSource, Settings,
    files::{Picture, read_picture, write_exr},
    gpu::RunError,
    graph::{diagnostics::Source, library::Library, plan::Lifetime},
    lab::sweep::{Event, Options, Sweep, execute, prepare},
};

use crate::{
    clustering::sums,
    renders::{Job, gpu, read},
    support::{Run, command, manylight, root},
};

fn own_gpu() -> Gpu {
    Gpu::new(&GpuOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn repository() -> Library {
    Library::new(Some(root()), Vec::new())
}

fn small_settings() -> Settings {
    let set = [("rsm_size", "64"), ("point_count", "1000"), ("clusters", "16")];
    Settings { size: (32, 24), set: set.map(|(name, value)| (name.to_owned(), value.to_owned())).to_vec(), ..Settings::default() }
}

fn small(gpu: &Gpu) -> Renderer {
    let scene = SceneSource::file(root().join("assets/cornell.ron"));
    Renderer::new(gpu, repository(), "acrsm", scene, small_settings()).unwrap_or_else(|e| panic!("{e}"))
}

fn bits(renderer: &Renderer) -> Vec<u32> {
    read(renderer, "composed").data.iter().map(|v| v.to_bits()).collect()
}

#[track_caller]
fn says_lost(text: &str) {
    assert!(text.contains("the GPU was lost") && text.contains("help:"), "{text}");
}

#[test]
fn a_lost_device_is_told_with_a_remedy_and_a_new_one_renders_the_same() {
    let lost = own_gpu();
    let mut renderer = small(&lost);
    renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
    let good = bits(&renderer);
    lost.device().destroy();
    match renderer.render_frame(0.0) {
        Err(error @ RenderError::Run(RunError::Lost(_))) => says_lost(&error.to_string()),
        other => panic!("{other:?}"),
    }
    says_lost(&renderer.read("composed").expect_err("gone").to_string());
    says_lost(&renderer.read_json("clusters").expect_err("gone").to_string());
    says_lost(&renderer.set_parameter("clusters", "32").expect_err("gone").render());
    says_lost(&renderer.reload(&[]).expect_err("gone").render());
    renderer.wait_timings();
    says_lost(&renderer.on(&lost).expect_err("gone").to_string());

    let mut again = renderer.on(&own_gpu()).unwrap_or_else(|e| panic!("{e}"));
    again.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
    assert!(bits(&again) == good);
}

/// The device goes in the middle of a frame that is measured node by node, as `profile` and `sweep` do.
#[test]
fn a_device_lost_while_nodes_are_timed_is_told() {
    let lost = own_gpu();
    let mut renderer = small(&lost);
    renderer.measure_serially(true);
    renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
    let other = lost.clone();
    let thief = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(30));
        other.device().destroy();
    });
    let failed = (0..10_000).find_map(|_| renderer.render_frame(0.0).err()).expect("the device goes");
    thief.join().expect("no panic");
    says_lost(&failed.to_string());
}

const SWEEP: &str = r#"Sweep(doc: "?", variants: {"none": (pipeline: "acrsm", set: {"visibility": "none", "rsm_size": 64})},
    vary: [{"clusters": [16, 32, 64]}], scenes: ["cornell"], sizes: [(16, 16)], frames: 1, measure: 1, reference: (paths: 4))"#;

#[test]
fn a_sweep_ends_with_the_device_and_goes_on_with_another() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let source = Arc::new(Source { name: "small.ron".to_owned(), path: None, text: Arc::from(SWEEP) });
    let sweep = Sweep::read(&source, false).unwrap_or_else(|e| panic!("{e}"));
    let find = |name: &str| Ok(SceneSource::file(root().join("assets").join(name).with_extension("ron")));
    let prepared = prepare(sweep, &repository(), &find).unwrap_or_else(|e| panic!("{e}"));
    let (out, cache) = (folder.path().join("out"), folder.path().join("cache"));
    let options = Options { out: &out, cache: &cache, shard: None };
    let lost = own_gpu();
    let mut done = 0;
    let failed = execute(&lost, &prepared, options, &mut |event| {
        if let Event::Done { .. } = event {
            done += 1;
            lost.device().destroy();
        }
    });
    let failed = failed.expect_err("the device is gone after the first run").to_string();
    says_lost(&failed);
    assert!(failed.contains("the same command does the others") && done == 1, "{failed}");
    let outcome = execute(&own_gpu(), &prepared, options, &mut |_| ()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((outcome.kept, outcome.records.len(), outcome.failed), (1, 3, 0));
}

/// The program, which may write files of 512 or 1024 times `blocks` bytes at most, by the shell: what a full disk is to it.
#[cfg(unix)]
fn with_little_room(blocks: u32, arguments: &[&str]) -> Run {
    let program = command(arguments);
    let mut shell = Command::new("sh");
    // Without the signal, writing fails as on a full disk.
    shell
        .args(["-c", &format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"")])
        .arg(program.get_program())
        .args(program.get_args());
    let output = shell.current_dir(root()).output().expect("the shell starts");
    Run {
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
    }
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[cfg(unix)]
#[test]
fn what_does_not_fit_on_the_disk_is_not_there_and_the_message_says_so() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let render = ["render", "acrsm", "--scene", "cornell", "--size", "96x96", "--frames", "1", "--set", "rsm_size=64"];
    let (png, exr, json) = (at("x.png"), at("x.exr"), at("x.json"));
    let outputs: [(&str, &[&str]); 4] = [
        ("x.png", &["--out", &png]),
        ("x.exr", &["--out", &exr]),
        ("x.json", &["--dump", &format!("clusters={json}")]),
        ("x.json", &["--stats", &json]),
    ];
    for (name, output) in outputs {
        fs::write(folder.path().join(name), "the old one").expect("writable");
        with_little_room(1, &[&render[..], output].concat()).expect(1).says(&[name, "too large", "ulimit"]);
        assert_eq!(names(folder.path()), [name]);
        assert_eq!(fs::read_to_string(folder.path().join(name)).expect("readable"), "the old one");
        fs::remove_file(folder.path().join(name)).expect("there");
    }
    let (baked, work) = (at("x.baked"), at("work"));
    let bake = ["bake", "day", "--size", "32x32", "--paths", "1", "--interval", "12h", "--out", &baked, "--work", &work];
    with_little_room(1, &bake).expect(1).says(&["too large", "ulimit"]);
    assert_eq!((names(folder.path()), names(Path::new(&work))), (vec!["work".to_owned()], Vec::new()));
    // With room it goes on.
    manylight(&bake).expect(0);
    assert_eq!(names(folder.path()), ["work", "x.baked"]);
}

#[cfg(unix)]
#[test]
fn a_sweep_without_room_for_a_record_keeps_whole_ones_and_goes_on_when_there_is() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let at = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    let (file, out, cache) = (at("small.ron"), at("out"), at("cache"));
    fs::write(&file, SWEEP).expect("writable");
    let sweep = ["sweep", &file, "--out", &out, "--cache", &cache];
    manylight(&sweep).expect(0).says(&["3 of 3 runs"]);
    let records = folder.path().join("out/records.jsonl");
    let whole = fs::read_to_string(&records).expect("readable");
    let first: String = whole.split_inclusive('\n').take(1).collect();
    fs::write(&records, &first).expect("writable");
    // Room for all pictures of 16×16 pixels, and for one record and a half.
    let blocks = (first.len() * 3 / 2).div_ceil(block_size()) as u32;
    with_little_room(blocks, &sweep).expect(1).says(&["records.jsonl", "too large", "ulimit"]);
    let kept = fs::read_to_string(&records).expect("readable");
    assert!(kept.ends_with('\n') && (1..3).contains(&kept.lines().count()), "{} lines", kept.lines().count());
    manylight(&sweep).expect(0).says(&["3 of 3 runs"]);
    assert_eq!(fs::read_to_string(&records).expect("readable").lines().count(), 3);
}

/// Bytes in a unit of `ulimit -f`, which shells do not agree on.
#[cfg(unix)]
fn block_size() -> usize {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let script = "trap '' XFSZ; ulimit -f 1; head -c 4096 /dev/zero > x 2> /dev/null; wc -c < x";
    let output =
        Command::new("sh").args(["-c", script]).current_dir(folder.path()).stderr(Stdio::null()).output().expect("the shell starts");
    String::from_utf8_lossy(&output.stdout).trim().parse().expect("a number of bytes")
}

#[test]
fn a_killed_writer_leaves_the_old_file_or_the_new_one() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("x.exr");
    let old = Picture::linear(8, 8, 3, vec![0.5; 8 * 8 * 3]);
    write_exr(&out, &old).expect("writable");
    let shown = out.to_string_lossy().into_owned();
    let size = ["--size", "640x480", "--frames", "1", "--set", "rsm_size=32", "--set", "visibility=none"];
    let line = [&["render", "acrsm", "--scene", "cornell", "--out", &shown][..], &size].concat();
    let mut killed = 0;
    for wait_ms in [0, 1, 3, 8, 20] {
        let mut child = command(&line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the program starts");
        // As soon as it writes, or has written.
        let writes = || names(folder.path()).len() > 1 || fs::metadata(&out).is_ok_and(|m| m.len() > 10_000);
        while child.try_wait().expect("a child").is_none() && !writes() {
            std::thread::sleep(Duration::from_micros(200));
        }
        std::thread::sleep(Duration::from_millis(wait_ms));
        killed += u32::from(child.try_wait().expect("a child").is_none());
        // It may have ended by itself.
        let _ = child.kill();
        child.wait().expect("ended");
        let picture = read_picture(&out).unwrap_or_else(|e| panic!("{e}"));
        assert!([(8, 8), (640, 480)].contains(&(picture.width, picture.height)));
        write_exr(&out, &old).expect("writable");
    }
    assert!(killed > 0, "no run was killed while it wrote");
    assert_eq!(names(folder.path()), ["x.exr"], "what was left is removed by the next writer");
}

#[test]
fn files_that_cannot_be_read_are_named() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let shown = folder.path().to_string_lossy().into_owned();
    let small = ["--size", "16x16", "--frames", "1", "--out", "never.png"];
    manylight(&[&["render", "acrsm", "--scene", &shown], &small[..]].concat()).expect(1).says(&["is a folder"]);
    manylight(&[&["render", &shown, "--scene", "cornell"], &small[..]].concat()).expect(1).says(&["it is a folder"]);
    manylight(&[&["render", "precomputed", "--scene", "day", "--baked", &shown], &small[..]].concat()).expect(1).says(&[&shown]);
    manylight(&["compare", &shown, &shown]).expect(1).says(&[&shown]);
    if cfg!(target_os = "linux") {
        // A file that is there and that nobody can read from its beginning.
        let unreadable = "/proc/self/mem";
        manylight(&[&["render", "precomputed", "--scene", "day", "--baked", unreadable], &small[..]].concat())
            .expect(1)
            .says(&[unreadable]);
    }
}

#[test]
fn sizes_that_nobody_means_are_refused_and_odd_ones_rendered() {
    let render = |size: &str| manylight(&["render", "acrsm", "--scene", "cornell", "--size", size, "--out", "never.png"]);
    for size in ["0x0", "0x16", "100000x100000", "4294967296x1"] {
        render(size).expect(2).says(&["between 1 and 16384"]);
    }
    let scene = || SceneSource::file(root().join("assets/cornell.ron"));
    for size in [(0, 0), (16, 0), (100_000, 100_000), (u32::MAX, u32::MAX)] {
        let settings = Settings { size, ..small_settings() };
        let fault = Renderer::new(gpu(), repository(), "acrsm", scene(), settings).expect_err("no picture");
        assert!(fault.to_string().contains(&format!("{}×{}", size.0, size.1)), "{fault}");
    }
}

/// Sizes and numbers of clusters change between frames, and come back.
#[test]
fn no_state_of_another_size_is_left() {
    for pipeline in ["acrsm", "rsm_gather", "instant_radiosity", "second_order"] {
        let job = Job { pipeline: pipeline.to_owned(), size: (48, 32), frames: 2, ..Job::asset("cornell") };
        let mut renderer = job.set("rsm_size", 64).renderer();
        let first = {
            renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
            bits(&renderer)
        };
        let forgets = !renderer.plan().resources.iter().any(|r| r.lifetime == Lifetime::History);
        let settings = renderer.settings().clone();
        for size in [(1, 1), (4096, 1), (1, 4096), (17, 5), (48, 32)] {
            renderer.set(Settings { size, ..settings.clone() }).unwrap_or_else(|e| panic!("{pipeline}, {size:?}: {e}"));
            renderer.restart();
            renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{pipeline}, {size:?}: {e}"));
            let image = read(&renderer, "composed");
            assert_eq!((image.width, image.height), size);
            assert!(image.data.iter().all(|v| v.is_finite() && *v >= 0.0), "{pipeline}, {size:?}");
        }
        assert!(!forgets || bits(&renderer) == first, "{pipeline}: the picture is another one than before");
    }
    assert_eq!(gpu().take_errors(), Vec::<String>::new());
}

#[test]
fn clusters_come_and_go_between_frames_without_losing_light() {
    let mut renderer =
        Job { frames: 1, ..Job::asset("cornell").small() }.set("visibility", "none").keep(&["clusters", "rsm_flux"]).renderer();
    for clusters in [16, 512, 16, 512, 512, 16, 64] {
        renderer.set_parameter("clusters", &clusters.to_string()).unwrap_or_else(|e| panic!("{clusters}: {e}"));
        renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{clusters}: {e}"));
        let (rsm, sum) = sums(&renderer);
        for i in 0..3 {
            let error = (sum[i] / rsm[i] - 1.0).abs();
            assert!(error < 1e-3, "{clusters} clusters, channel {i}: {} W against {} W", sum[i], rsm[i]);
        }
        assert!(read(&renderer, "composed").data.iter().all(|v| v.is_finite() && *v >= 0.0), "{clusters}");
    }
    assert_eq!(gpu().take_errors(), Vec::<String>::new());
}
