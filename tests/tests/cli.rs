//! The command line as a user meets it: what is wrong, where, what to do, and the exit code.

use std::{fs, path::Path};

use crate::support::{copy_of_library, manylight, manylight_in};

const SMALL: [&str; 4] = ["--size", "32x32", "--frames", "1"];

fn replace(file: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(file).expect("a text");
    assert!(text.contains(from), "`{from}` is not in {}", file.display());
    fs::write(file, text.replacen(from, to, 1)).expect("written");
}

#[test]
fn every_pipeline_and_node_of_the_repository_checks() {
    manylight(&["check"]).expect(0);
}

#[test]
fn help_has_an_example_for_every_subcommand() {
    for command in ["render", "check", "nodes", "graph", "explain", "profile", "watch", "compare", "sweep", "tune", "bake"] {
        manylight(&[command, "--help"]).expect(0).says(&["Example", &format!("manylight {command}")]);
    }
}

#[test]
fn usage_errors_exit_with_2() {
    manylight(&[]).expect(2);
    manylight(&["rendr"]).expect(2);
    manylight(&["render"]).expect(2);
    manylight(&["render", "acrsm", "--scene", "cornell", "--size", "0x0"]).expect(2);
    manylight(&["render", "acrsm", "--scene", "cornell", "--size", "12"]).expect(2);
    manylight(&["render", "acrsm", "--scene", "cornell", "--size", "99999999x2"]).expect(2);
    manylight(&["render", "acrsm", "--scene", "cornell", "--frames", "-1"]).expect(2);
}

#[test]
fn a_wrong_parameter_is_named_with_the_nearest_right_one() {
    let set = |value: &str| {
        manylight(&[&["render", "acrsm", "--scene", "cornell", "--set", value, "--out", "target/never.png"][..], &SMALL[..]].concat())
    };
    set("clusers=64").expect(1).says(&["clusers", "clusters"]);
    set("clusters=5000").expect(1).says(&["clusters", "16", "4096"]);
    set("clusters=many").expect(1).says(&["clusters"]);
    set("visibility=pcs").expect(1).says(&["pcss"]);
}

/// `check` tries the ends of other parameters' ranges beside it, which may be too much together: no fault of the preset.
#[test]
fn a_preset_at_the_end_of_a_range_is_no_fault() {
    let library = copy_of_library();
    fs::write(library.path().join("pipelines/many.ron"), "Pipeline(doc: \"many\", extends: \"acrsm.ron\", set: {\"clusters\": 512})")
        .expect("written");
    let run = manylight_in(library.path(), &["check", "pipelines/many.ron"]).expect(0).says(&["no errors"]);
    assert!(!run.stderr.contains("ism_size"), "{}", run.stderr);
}

#[test]
fn a_typo_in_a_pipeline_is_shown_with_line_and_caret() {
    let library = copy_of_library();
    let file = library.path().join("pipelines/stages/shadow_maps.ron");
    replace(&file, "node: \"ism/splat\"", "node: \"ism/spalt\"");
    manylight_in(library.path(), &["check"]).expect(1).says(&["shadow_maps.ron", "ism/spalt", "ism/splat", "^"]);
}

#[test]
fn all_faults_of_a_file_are_shown_at_once() {
    let library = copy_of_library();
    let file = library.path().join("pipelines/stages/indirect.ron");
    replace(&file, "node: \"lighting/split\"", "node: \"lighting/splt\"");
    replace(&file, "id: \"merge\"", "idd: \"merge\"");
    replace(&file, "format: Rgba32Float", "format: Rgba32Flot");
    manylight_in(library.path(), &["check"]).expect(1).says(&["lighting/splt", "idd", "Rgba32Flot"]);
}

#[test]
fn a_broken_shader_is_shown_in_its_own_file() {
    let library = copy_of_library();
    replace(&library.path().join("shaders/lighting/compose.wgsl"), "vec4f(textureLoad(direct", "vec4f(textureLod(direct");
    manylight_in(library.path(), &["check"]).expect(1).says(&["compose.wgsl", "textureLod", "^"]);
}

#[test]
fn a_fault_in_an_imported_file_points_there() {
    let library = copy_of_library();
    replace(&library.path().join("shaders/common/tiles.wgsl"), "return (pixel % n)", "return (pixle % n)");
    manylight_in(library.path(), &["check"]).expect(1).says(&["tiles.wgsl", "pixle", "^"]);
}

#[test]
fn documents_that_are_no_documents_are_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let deep = "(".repeat(100_000);
    let cases: [(&str, &[u8]); 6] = [
        ("empty.ron", b""),
        ("truncated.ron", b"Pipeline(doc: \"x\", nodes: [(id: \"a\""),
        ("binary.ron", &[0xff, 0xfe, 0x00, 0x01, 0x80]),
        ("deep.ron", deep.as_bytes()),
        ("other.ron", b"Scone(1, 2)"),
        ("number.ron", b"42"),
    ];
    for (name, bytes) in cases {
        let file = folder.path().join(name);
        fs::write(&file, bytes).expect("written");
        manylight(&["check", &file.to_string_lossy()]).expect(1).says(&[name]);
        manylight(&[&["render", &file.to_string_lossy(), "--scene", "cornell", "--out", "x.png"][..], &SMALL[..]].concat())
            .expect(1)
            .says(&[name]);
    }
}

#[test]
fn missing_files_are_named() {
    manylight(&[&["render", "acrsmm", "--scene", "cornell", "--out", "x.png"][..], &SMALL[..]].concat()).expect(1).says(&["acrsmm"]);
    manylight(&[&["render", "acrsm", "--scene", "no/such/scene.ron", "--out", "x.png"][..], &SMALL[..]].concat())
        .expect(1)
        .says(&["no/such/scene.ron"]);
    manylight(&["compare", "no.exr", "nor-this.exr"]).expect(1).says(&["no.exr"]);
}

#[test]
fn outputs_are_refused_before_anything_runs() {
    let render = |out: &str| manylight(&[&["render", "acrsm", "--scene", "cornell", "--out", out][..], &SMALL[..]].concat());
    render("/no/such/folder/x.png").expect(1).says(&["/no/such/folder"]);
    render("x.tiff").expect(2);
    manylight(&[&["render", "acrsm", "--scene", "cornell", "--dump", "indirct=x.exr"][..], &SMALL[..]].concat())
        .expect(1)
        .says(&["indirct", "indirect"]);
}

#[test]
fn an_odd_size_renders() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for size in ["1x1", "37x5", "3x64"] {
        let out = folder.path().join(format!("{size}.exr"));
        let set = ["--set", "rsm_size=64", "--set", "point_count=2000"];
        manylight(
            &[&["render", "acrsm", "--scene", "cornell", "--size", size, "--frames", "2", "--out", &out.to_string_lossy()][..], &set[..]]
                .concat(),
        )
        .expect(0);
        assert!(out.is_file());
    }
}

#[test]
fn the_installed_program_needs_no_source_tree() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    manylight_in(folder.path(), &["check"]).expect(0);
    manylight_in(
        folder.path(),
        &["render", "acrsm", "--scene", "cornell", "--size", "32x32", "--frames", "1", "--set", "rsm_size=64", "--out", "x.png"],
    )
    .expect(0);
    assert!(folder.path().join("x.png").is_file());
}

#[test]
fn comparing_pictures_of_different_sizes_is_refused() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, size) in [("a.exr", "16x16"), ("b.exr", "8x8")] {
        let out = folder.path().join(name);
        manylight(&[
            "render",
            "acrsm",
            "--scene",
            "cornell",
            "--size",
            size,
            "--frames",
            "1",
            "--set",
            "rsm_size=32",
            "--out",
            &out.to_string_lossy(),
        ])
        .expect(0);
    }
    manylight_in(folder.path(), &["compare", "a.exr", "b.exr"]).expect(1).says(&["16", "8"]);
    manylight_in(folder.path(), &["compare", "a.exr", "a.exr"]).expect(0);
}
