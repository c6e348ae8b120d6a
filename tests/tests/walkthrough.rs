//! The book's walk-through, followed to the letter: its files, its mistake, its commands.

use std::{fs, path::Path};

use crate::{
    support::copy_of_library,
    support::{manylight_in, root},
};

/// Files of a page: blocks whose first line is `// file: PATH`.
fn files_of(page: &str) -> Vec<(String, String)> {
    let text = fs::read_to_string(root().join("docs/src/guide").join(page)).expect("a page");
    text.split("```")
        .skip(1)
        .step_by(2)
        .filter_map(|block| {
            let body = block.split_once('\n')?.1;
            let (first, rest) = body.split_once('\n')?;
            Some((first.strip_prefix("// file: ")?.trim().to_owned(), rest.to_owned()))
        })
        .collect()
}

fn write_all(folder: &Path, files: &[(String, String)]) {
    for (path, text) in files {
        let path = folder.join(path);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, text).expect("written");
    }
}

#[test]
fn a_node_in_ten_minutes() {
    let library = copy_of_library();
    let folder = library.path();
    let files = files_of("first-node.md");
    assert_eq!(files.len(), 3, "declaration, shader and pipeline");
    write_all(folder, &files);
    manylight_in(folder, &["check", "shaders/views/edges.ron"]).expect(0);
    manylight_in(folder, &["check", "pipelines/edges.ron"]).expect(0);
    manylight_in(folder, &["nodes", "views/edges"]).expect(0).says(&["angle_deg", "strength"]);
    fs::create_dir(folder.join("out")).expect("made");
    let render = |out: &str, set: &[&str]| {
        let all = ["render", "pipelines/edges.ron", "--scene", "assets/cornell.ron", "--size", "64x64", "--frames", "1", "--out", out];
        manylight_in(folder, &[&all[..], set].concat()).expect(0);
        fs::read(folder.join(out)).expect("a picture")
    };
    let with_lines = render("out/edges.png", &[]);
    let without = render("out/plain.png", &["--set", "edges.strength=0"]);
    assert_ne!(with_lines, without, "the node draws nothing");
    // The page's mistake.
    let shader = folder.join("shaders/views/edges.wgsl");
    let text = fs::read_to_string(&shader).expect("a shader");
    fs::write(&shader, text.replace("strength", "strenght")).expect("written");
    manylight_in(folder, &["check", "shaders/views/edges.ron"]).expect(1).says(&["edges.wgsl", "strenght", "strength"]);
}

#[test]
fn the_pipelines_of_the_guide_check() {
    let library = copy_of_library();
    let files = files_of("pipelines.md");
    assert!(!files.is_empty(), "no file in the page");
    write_all(library.path(), &files);
    for (path, _) in files {
        manylight_in(library.path(), &["check", &path]).expect(0);
    }
}

/// Shaders cite papers by keys that `docs/src/references.md` resolves.
#[test]
fn every_citation_resolves() {
    let references = fs::read_to_string(root().join("docs/src/references.md")).expect("references");
    let known: Vec<&str> = references.lines().filter_map(|l| l.strip_prefix("- **[")?.split_once(']').map(|(key, _)| key)).collect();
    let mut unknown = Vec::new();
    let mut folders = vec![root().join("shaders"), root().join("pipelines")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let text = fs::read_to_string(&path).expect("a text");
            for part in text.split('[').skip(1) {
                let Some((key, _)) = part.split_once(']') else { continue };
                let is_key = key.len() > 1 && key.chars().all(|c| c.is_ascii_uppercase());
                if is_key && !known.contains(&key) {
                    unknown.push(format!("[{key}] in {}", path.display()));
                }
            }
        }
    }
    assert!(unknown.is_empty(), "not in docs/src/references.md: {unknown:?}");
}
