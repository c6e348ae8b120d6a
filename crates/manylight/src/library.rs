//! Where pipelines, shaders and scenes come from: a folder on disk when there is one, else the copies in the program.

use std::{
    env,
    path::{Path, PathBuf},
};

use include_dir::{Dir, include_dir};
use manylight_graph::library::Library;

use crate::fault::Fault;

static SHADERS: Dir = include_dir!("$CARGO_MANIFEST_DIR/shaders");
static PIPELINES: Dir = include_dir!("$CARGO_MANIFEST_DIR/pipelines");
static ASSETS: Dir = include_dir!("$CARGO_MANIFEST_DIR/assets");

/// The environment variable that names the root folder.
pub const ROOT_VARIABLE: &str = "MANYLIGHT_ROOT";

/// The library with the root given, else the one that `MANYLIGHT_ROOT` names, else the nearest folder at or above the
/// current one that has `shaders/` and `pipelines/`, else only what is embedded.
pub fn open(root: Option<&Path>) -> Result<Library, Fault> {
    let named = match (root, env::var_os(ROOT_VARIABLE)) {
        (Some(root), _) => Some((root.to_owned(), "--root")),
        (None, Some(value)) if !value.is_empty() => Some((PathBuf::from(value), ROOT_VARIABLE)),
        _ => None,
    };
    let root = match named {
        Some((root, _)) if is_root(&root) => Some(root),
        Some((root, origin)) => {
            return Err(Fault::Input(format!("{origin}: `{}` has no folders `shaders` and `pipelines`", root.display())));
        }
        None => env::current_dir().ok().and_then(|folder| root_above(&folder)),
    };
    Ok(Library::new(root, embedded()))
}

/// The nearest folder at or above `folder` with `shaders/` and `pipelines/`.
pub fn root_above(folder: &Path) -> Option<PathBuf> {
    folder.ancestors().find(|f| is_root(f)).map(Path::to_owned)
}

fn is_root(folder: &Path) -> bool {
    folder.join("shaders").is_dir() && folder.join("pipelines").is_dir()
}

/// Every text file built into the program, by its path below the root (`shaders/ism/splat.wgsl`).
pub fn embedded() -> Vec<(String, &'static str)> {
    let mut files = Vec::new();
    for (folder, dir) in [("shaders", &SHADERS), ("pipelines", &PIPELINES), ("assets", &ASSETS)] {
        collect(folder, dir, &mut files);
    }
    files.sort();
    files
}

fn collect(folder: &str, dir: &Dir<'static>, files: &mut Vec<(String, &'static str)>) {
    for file in dir.files() {
        if let Some(text) = file.contents_utf8() {
            files.push((format!("{folder}/{}", slashes(file.path())), text));
        }
    }
    for inner in dir.dirs() {
        collect(folder, inner, files);
    }
}

fn slashes(path: &Path) -> String {
    path.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shaders_are_embedded_under_their_library_paths() {
        let files = embedded();
        assert!(files.iter().any(|(name, text)| name == "shaders/common/scene.wgsl" && text.contains("struct View")));
    }

    #[test]
    fn the_root_is_found_from_below() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for name in ["shaders", "pipelines/stages/deep"] {
            std::fs::create_dir_all(folder.path().join(name)).expect("creatable");
        }
        assert_eq!(root_above(&folder.path().join("pipelines/stages/deep")).as_deref(), Some(folder.path()));
    }

    #[test]
    fn a_root_without_shaders_is_refused() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let fault = open(Some(folder.path())).err().expect("no root");
        assert!(matches!(&fault, Fault::Input(text) if text.contains("--root")), "{fault}");
    }
}
