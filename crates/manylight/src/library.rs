//! Where pipelines, shaders and scenes come from: a folder on disk when there is one, else the copies in the program.

use std::{
    env,
    path::{Path, PathBuf},
    sync::Arc,
};

use etcetera::BaseStrategy;
use include_dir::{Dir, include_dir};
use manylight_graph::{
    diagnostics::Source,
    library::{Library, ReadError},
    nearest,
};
use manylight_passes::SceneSource;

use crate::fault::Fault;

static SHADERS: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/shaders");
static PIPELINES: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/pipelines");
static ASSETS: Dir<'static> = include_dir!("$CARGO_MANIFEST_DIR/assets");

const SWEEPS: &str = "pipelines/sweeps";

/// The environment variable that names the root folder.
pub const ROOT_VARIABLE: &str = "MANYLIGHT_ROOT";

/// The library with the root given, else the one that `MANYLIGHT_ROOT` names, else the nearest folder at or above the
/// current one that has `shaders/` and `pipelines/`, else only what is embedded.
///
/// # Errors
/// The folder that was named is no root.
pub fn open(root: Option<&Path>) -> Result<Library, Fault> {
    let named = match (root, env::var_os(ROOT_VARIABLE)) {
        (Some(root), _) => Some((root.to_owned(), "--root")),
        (None, Some(value)) if !value.is_empty() => Some((PathBuf::from(value), ROOT_VARIABLE)),
        _ => None,
    };
    let root = match named {
        Some((root, _)) if is_root(&root) => Some(root),
        Some((root, origin)) => {
            return Err(Fault::Input(format!("{origin}: `{}` does not have the folders `shaders` and `pipelines`", root.display())));
        }
        None => env::current_dir().ok().and_then(|folder| root_above(&folder)),
    };
    Ok(at(root))
}

/// The library of a root folder, or the embedded one.
pub fn at(root: Option<PathBuf>) -> Library {
    let texts = [("shaders", &SHADERS), ("pipelines", &PIPELINES)].map(|(folder, dir)| embedded(folder, dir));
    let text = |(name, bytes): (String, &'static [u8])| std::str::from_utf8(bytes).ok().map(|text| (name, text));
    Library::new(root, texts.into_iter().flatten().filter_map(text).collect())
}

/// The nearest folder at or above `folder` with `shaders/` and `pipelines/`.
pub fn root_above(folder: &Path) -> Option<PathBuf> {
    folder.ancestors().find(|f| is_root(f)).map(Path::to_owned)
}

fn is_root(folder: &Path) -> bool {
    folder.join("shaders").is_dir() && folder.join("pipelines").is_dir()
}

/// The folder of this name among what the program keeps for the user, if the system has a place for that.
pub fn cache(name: &str) -> Option<PathBuf> {
    etcetera::choose_base_strategy().ok().map(|strategy| strategy.cache_dir().join("manylight").join(name))
}

/// A scene by path (`rooms/hall.ron`, `mesh.obj`, `model.glb`) or by name in `assets/` (`cornell`), on disk or embedded. What is measured of it is kept in the user's
/// cache.
///
/// # Errors
/// There is no such scene; the nearest name is told.
pub fn scene(library: &Library, name: &str) -> Result<SceneSource, Fault> {
    if Path::new(name).is_file() {
        return Ok(SceneSource::file(name).keeping_measures_in(cache("measures")));
    }
    let plain = name.replace('\\', "/");
    let built_in = embedded("assets", &ASSETS);
    for path in [
        plain.clone(),
        format!("assets/{plain}"),
        format!("assets/{plain}.ron"),
        format!("assets/{plain}.obj"),
        format!("assets/{plain}.gltf"),
        format!("assets/{plain}.glb"),
    ] {
        if let Some(file) = library.root().map(|root| root.join(&path)).filter(|file| file.is_file()) {
            return Ok(SceneSource::file(file).keeping_measures_in(cache("measures")));
        }
        if built_in.iter().any(|(known, _)| *known == path) {
            return Ok(SceneSource::embedded(path, built_in).keeping_measures_in(cache("measures")));
        }
    }
    if Path::new(name).is_dir() {
        return Err(Fault::Input(format!("the scene `{name}` is a folder: name a .ron, .obj, .gltf or .glb file in it")));
    }
    let known = scene_names(library);
    let help = match nearest(name, known.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None if known.is_empty() => "name a .ron, .obj, .gltf or .glb file".to_owned(),
        None => format!("name a .ron, .obj, .gltf or .glb file, or one of {}", known.join(", ")),
    };
    Err(Fault::Input(format!("there is no scene `{name}`; {help}")))
}

/// A sweep by path or by name in `pipelines/sweeps/`.
///
/// # Errors
/// There is no such sweep, or it cannot be read; the nearest name is told.
pub fn sweep(library: &Library, name: &str) -> Result<Arc<Source>, Fault> {
    if Path::new(name).is_file() {
        return Library::read_file(Path::new(name)).map_err(|e| Fault::Documents(e.diagnostic().into()));
    }
    let path = format!("{SWEEPS}/{}.ron", name.trim_end_matches(".ron"));
    library.fetch(&path).map_err(|error| {
        let known = sweep_names(library);
        let help = match nearest(name, known.iter().map(String::as_str)) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("name a .ron file, or one of {}", known.join(", ")),
        };
        match error {
            ReadError::Missing(_) => Fault::Input(format!("there is no sweep `{name}`; {help}")),
            ReadError::Unreadable { .. } => Fault::Documents(error.diagnostic().into()),
        }
    })
}

/// Names of the sweeps in `pipelines/sweeps/`.
pub fn sweep_names(library: &Library) -> Vec<String> {
    let name = |path: String| Some(path.strip_prefix(SWEEPS)?.trim_start_matches('/').strip_suffix(".ron")?.to_owned());
    library.list(SWEEPS, "ron").into_iter().filter_map(name).collect()
}

/// Names of the scenes in `assets/`.
pub fn scene_names(library: &Library) -> Vec<String> {
    let mut names: Vec<String> = embedded("assets", &ASSETS).into_iter().map(|(name, _)| name).collect();
    names.extend(library.list("assets", "ron"));
    let stem = |name: &String| Some(name.strip_prefix("assets/")?.strip_suffix(".ron")?.to_owned());
    let mut stems: Vec<String> = names.iter().filter_map(stem).collect();
    stems.sort();
    stems.dedup();
    stems
}

/// Every file built into the program below a folder, by its path (`shaders/ism/splat.wgsl`).
fn embedded(folder: &str, dir: &Dir<'static>) -> Vec<(String, &'static [u8])> {
    let mut files: Vec<_> = dir.files().map(|f| (format!("{folder}/{}", slashes(f.path())), f.contents())).collect();
    files.extend(dir.dirs().flat_map(|inner| embedded(folder, inner)));
    files
}

fn slashes(path: &Path) -> String {
    path.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shaders_are_embedded_under_their_library_paths() {
        let text = at(None).read("shaders/common/scene.wgsl").expect("embedded").text.clone();
        assert!(text.contains("struct View"));
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
        let fault = open(Some(folder.path())).expect_err("no root");
        assert!(matches!(&fault, Fault::Input(text) if text.contains("--root")), "{fault}");
    }

    #[test]
    fn an_unknown_scene_is_an_error() {
        let fault = scene(&at(None), "no_such_scene_at_all").expect_err("unknown");
        assert!(fault.to_string().contains("no_such_scene_at_all"), "{fault}");
        assert!(scene(&at(None), "/").expect_err("a folder").to_string().contains("folder"));
    }
}
