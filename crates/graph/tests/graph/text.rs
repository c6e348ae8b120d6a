//! Texts that are no documents: broken, empty, huge, deep, binary. None may panic.

use std::path::Path;

use manylight_graph::{library::Library, pipeline::Pipeline};
use proptest::prelude::*;

use crate::kit::*;

const FILE: &str = "pipelines/test.ron";

#[track_caller]
fn one(from: &str, to: &str, parts: &[&str]) {
    assert_faults(&check_faults(&with(FILE, from, to)), 1, parts);
}

#[track_caller]
fn text(text: &str, parts: &[&str]) {
    assert_faults(&check_faults(&add(files(), FILE, text)), 1, parts);
}

#[track_caller]
fn text_of(text: &str, shown: usize, parts: &[&str]) {
    assert_faults(&check_faults(&add(files(), FILE, text)), shown, parts);
}

#[test]
fn syntax() {
    one(
        "doc: \"A pipeline that is right.\",",
        "doc: \"A pipeline that is right.\"",
        &["expected a comma or the closing `)`", "test.ron:3:5"],
    );
    one("size: Like(\"albedo\"))", "size: Like(\"albedo\")", &["`(` is closed by `}`", "17:5", "opened here"]);
    one("presents: \"result\",\n)", "", &["`(` is never closed", "1:9", "add the missing `)`"]);
    one("presents: \"result\",\n)", "presents: \"result\",\n))", &["`)` closes nothing", "27:2"]);
    one("presents: \"result\",\n)", "presents: \"result,\n)", &["the string is never closed", "26:15"]);
    one(
        "presents: \"result\"",
        "presents: result",
        &["expected the name of a resource in quotes, found the name `result`", "26:15", "write it in quotes"],
    );
    one("\"blur\": Bool", "\"blur\" Bool", &["expected `:` after the key", "4:16"]);
}

#[test]
fn odd_files() {
    text("", &["the file is empty", "test.ron:1:1"]);
    text("// nothing but a comment", &["the file is empty"]);
    text("3", &["expected `Pipeline(…)` or `Stage(…)`, found a number"]);
    text("Stage(doc: \"x\")", &["a stage is no pipeline"]);
    assert_faults(&check_faults(&add(files(), FILE, "Pipeline()")), 2, &["missing field `doc`", "missing field `presents`"]);
    let params: String = (0..1500).map(|i| format!("\"p{i}\": Bool(default: true, doc: \"\"),")).collect();
    text(
        &format!("Pipeline(doc: \"x\", presents: \"\", params: {{{params}}})"),
        &["there are 1500 parameters, more than the 1000 allowed"],
    );
    let nodes = "(id: \"a\", node: \"b\"),\n".repeat(50_000);
    text_of(&format!("Pipeline(doc: \"x\", presents: \"\", nodes: [{nodes}])"), 200, &["and 49800 more, which are not shown"]);
    text(&"[".repeat(1_000_000), &["brackets are nested more than 96 deep"]);
    text(&"Not(".repeat(100_000), &["brackets are nested more than 96 deep"]);
    text(&format!("{}\u{0}\u{1}", "x".repeat(100_000)), &["error"]);
    let nested = format!("when: {}IsOn(\"blur\"){}", "Not(".repeat(80), ")".repeat(80));
    assert_faults(
        &check_faults(&with(FILE, "when: Not(IsOn(\"blur\"))", &nested)),
        2,
        &["written by two nodes", "not written in this frame"],
    );
}

#[test]
fn files_that_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    std::fs::write(path("binary.ron"), [b'P', b'(', 0xff, 0xfe, b'\n']).unwrap();
    std::fs::write(path("huge.ron"), vec![b' '; 5 << 20]).unwrap();
    let library = library(&files());
    let fault = |path: &Path| Pipeline::load(&library, path).unwrap_err().render();
    assert_faults(&fault(&path("binary.ron")), 1, &["binary.ron", "it is no UTF-8 text (byte 2, line 1)"]);
    assert_faults(&fault(&path("huge.ron")), 1, &["it has 5242880 bytes"]);
    assert_faults(&fault(Path::new("tst")), 1, &["there is no file `tst`", "did you mean `test`?"]);
    assert_faults(&fault(folder.path()), 1, &["cannot read", "it is a folder"]);
    assert_faults(&fault(&path("gone.ron")), 1, &["there is no file"]);
}

#[test]
fn the_disk_wins_over_the_embedded_copy() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    write("pipelines/b.ron", "disk");
    let embedded = vec![("pipelines/a.ron".to_owned(), "embedded"), ("pipelines/b.ron".to_owned(), "embedded")];
    let library = Library::new(Some(folder.path().to_path_buf()), embedded);
    assert_eq!(&*library.read("pipelines/a.ron").unwrap().text, "embedded");
    assert_eq!(&*library.read("pipelines/b.ron").unwrap().text, "disk");
    assert_eq!(library.list("pipelines", "ron"), ["pipelines/a.ron", "pipelines/b.ron"]);
    write("shaders/x/y.wgsl", "");
    assert_eq!(library.list("pipelines", "ron"), ["pipelines/b.ron"]);
    assert_eq!(library.list("shaders", "wgsl"), ["shaders/x/y.wgsl"]);
}

#[test]
fn truncated_files_are_faults_without_panic() {
    let (registry, _) = registry(&files(), &[]);
    let text = files().into_iter().find(|(name, _)| name == FILE).unwrap().1;
    for end in (0..text.len() - 3).step_by(7) {
        let library = library(&vec![(FILE.to_owned(), text[..end].to_owned())]);
        assert!(manylight_graph::check::check_file(&library, "test", &registry).has_errors(), "{}", &text[..end]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any bytes in any place are answered with diagnostics, rendered without a panic.
    #[test]
    fn damaged_pipelines_never_panic(at in 0usize..4000, cut in 0usize..40, junk in "[\\PC\\n\"(){}\\[\\],:r#'/*]{0,12}") {
        let mut text = crate::conditions::measuring().into_iter().find(|(name, _)| name == FILE).unwrap().1;
        let start = at % text.len();
        let end = (start + cut).min(text.len());
        if text.is_char_boundary(start) && text.is_char_boundary(end) {
            text.replace_range(start..end, &junk);
        }
        let library = library(&vec![(FILE.to_owned(), text)]);
        let registry = manylight_graph::registry::Registry::default();
        let faults = manylight_graph::check::check_file(&library, "test", &registry);
        let _ = (faults.render(), faults.to_json());
    }

    #[test]
    fn damaged_shaders_never_panic(at in 0usize..3000, cut in 0usize..40, junk in "[\\PC\\n\"(){}\\[\\],:;#@<>/*]{0,12}", which in 0usize..3) {
        let mut files = files();
        let name = ["shaders/draw/paint.wgsl", "shaders/common/cell.wgsl", "shaders/draw/paint.ron"][which];
        let (_, text) = files.iter_mut().find(|(n, _)| n == name).unwrap();
        let start = at % text.len();
        let end = (start + cut).min(text.len());
        if text.is_char_boundary(start) && text.is_char_boundary(end) {
            text.replace_range(start..end, &junk);
        }
        files.retain(|(n, _)| n.contains("draw/paint") || n.contains("common"));
        let (_, faults) = registry(&files, &[]);
        let _ = (faults.render(), faults.to_json());
    }
}

#[test]
fn deeply_nested_shaders_are_faults() {
    let deep = |open: &str, close: &str, count: usize| format!("fn f() {{ var x = {}1{}; }}\n", open.repeat(count), close.repeat(count));
    let blocks = format!("fn f() {}{}\n", "{".repeat(20_000), "}".repeat(20_000));
    let elses = format!("fn f() {{ {} {{}} }}\n", "if true {} else ".repeat(5_000));
    let types = format!("alias A = {}u32{};\n", "array<".repeat(5_000), ", 1>".repeat(5_000));
    let chain = format!("fn f() {{ var x = 1{}; }}\n", " + 1".repeat(20_000));
    for text in [deep("(", ")", 20_000), deep("-", "", 20_000), deep("abs(", ")", 5_000), blocks, elses, types, chain] {
        let (_, faults) = registry(&vec![("shaders/common/deep.wgsl".to_owned(), text)], &[]);
        assert_faults(&faults.render(), 1, &["are nested too deeply", "deep.wgsl:1:"]);
    }
    // What is allowed does not overflow either.
    let legal = [
        deep("(", ")", 100),
        deep("- ", "", 100),
        deep("abs(", ")", 100),
        format!("fn f() {{ {} {{}} }}\n", "if true {} else ".repeat(100)),
    ];
    for text in legal.into_iter().chain([format!("fn f() {{ var x = 1{}; }}\n", " + 1".repeat(3_900))]) {
        let (_, faults) = registry(&vec![("shaders/common/deep.wgsl".to_owned(), text)], &[]);
        assert_faults(&faults.render(), 0, &[]);
    }
}
