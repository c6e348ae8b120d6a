//! Where a scene is loaded from, so that it can be loaded again.

use std::path::{Path, PathBuf};

use manylight_graph::diagnostics::Diagnostics;
use manylight_scene::{Scene, files::Embedded};

/// A scene file or mesh, on disk or in the program.
#[derive(Debug, Clone, Default)]
pub struct SceneSource {
    path: PathBuf,
    embedded: Embedded,
    measures: Option<PathBuf>,
}

impl SceneSource {
    /// A `.ron`, `.obj`, `.gltf` or `.glb` file on disk.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), ..Self::default() }
    }

    /// A path among files in the program (`assets/cornell.ron`); files on disk at the same paths win.
    pub fn embedded(path: impl Into<PathBuf>, files: Vec<(String, &'static [u8])>) -> Self {
        Self { path: path.into(), embedded: Embedded(files), measures: None }
    }

    /// With a folder in which what is measured of the scene is kept ([`Scene::keep_measures_in`]).
    #[must_use]
    pub fn keeping_measures_in(self, folder: Option<PathBuf>) -> Self {
        Self { measures: folder, ..self }
    }

    /// The path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Reads it.
    ///
    /// # Errors
    /// The scene's faults; what was mended is in [`Scene::warnings`].
    pub fn load(&self) -> Result<Scene, Diagnostics> {
        let mut scene = Scene::load_with(&self.path, &self.embedded)?;
        if let Some(folder) = &self.measures {
            scene.keep_measures_in(folder.clone());
        }
        Ok(scene)
    }
}
