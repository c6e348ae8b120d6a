//! Files in memory for tests.

use std::{collections::HashMap, io, path::Path};

use manylight_graph::diagnostics::Diagnostics;
use manylight_scene::Scene;

/// A triangle of area 0.5 in the xy plane.
pub const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A room of 2 × 2 × 2 around the origin.
pub const ROOM: &str = "
v -1 -1 -1\nv 1 -1 -1\nv 1 -1 1\nv -1 -1 1\nv -1 1 -1\nv 1 1 -1\nv 1 1 1\nv -1 1 1
usemtl floor\nf 1 2 3 4\nusemtl ceiling\nf 5 8 7 6\nusemtl walls\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n";

/// Loads `path` from files in memory.
pub fn load<B: AsRef<[u8]>>(path: &str, files: &[(&str, B)]) -> Result<Scene, Diagnostics> {
    let files: HashMap<&str, &[u8]> = files.iter().map(|(name, bytes)| (*name, bytes.as_ref())).collect();
    let reader = move |path: &Path| {
        let mut name = path.to_string_lossy().replace('\\', "/");
        if let Some((before, after)) = name.split_once("/../") {
            name = before.rsplit_once('/').map_or(after.to_owned(), |(parent, _)| format!("{parent}/{after}"));
        }
        files.get(name.as_str()).map(|bytes| bytes.to_vec()).ok_or_else(|| io::ErrorKind::NotFound.into())
    };
    Scene::load_with(path, &reader)
}

/// Loads an OBJ text.
pub fn obj(text: &str) -> Result<Scene, Diagnostics> {
    load("a.obj", &[("a.obj", text)])
}

/// Loads a scene text beside `tri.obj` and `room.obj`.
pub fn ron(text: &str) -> Result<Scene, Diagnostics> {
    load("s.ron", &[("s.ron", text), ("tri.obj", TRIANGLE), ("room.obj", ROOM)])
}

/// Asserts that a diagnostic says all of these words, and points at `place` if that is not empty.
#[track_caller]
pub fn assert_says(diagnostics: &Diagnostics, place: &str, words: &[&str]) {
    let found = diagnostics.0.iter().any(|d| {
        let help = d.help.clone().unwrap_or_default();
        let labels: String = d.labels.iter().map(|l| l.message.as_str()).collect();
        let text = format!("{} {help} {labels}", d.message);
        let at = d.labels.first().map_or("", |l| &l.span.source.text[l.span.range.clone()]);
        words.iter().all(|word| text.contains(word)) && (place.is_empty() || at == place)
    });
    assert!(found, "nothing says {words:?} at {place:?}: {:#?}", summary(diagnostics));
}

/// Messages and places, for failing tests.
pub fn summary(diagnostics: &Diagnostics) -> Vec<String> {
    let line = |d: &manylight_graph::diagnostics::Diagnostic| {
        let at = d.labels.first().map_or("", |l| &l.span.source.text[l.span.range.clone()]);
        format!("{:?}: {} | {:?} | {at:?}", d.severity, d.message, d.help)
    };
    diagnostics.0.iter().map(line).collect()
}
