//! Where a scene is loaded from, so that it can be loaded again.

use std::path::{Path, PathBuf};

use manylight_graph::diagnostics::Diagnostics;
use manylight_scene::{Scene, files::Embedded};

/// A scene file or mesh, on disk or in the program.
#[derive(Debug, Clone, Default)]
pub struct SceneSource {
    path: PathBuf,
    embedded: Embedded,
}

impl SceneSource {
    /// A `.ron` or `.obj` file on disk.
    pub fn file(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into(), embedded: Embedded::default() }
    }

    /// A path among files in the program (`assets/cornell.ron`); files on disk at the same paths win.
    pub fn embedded(path: impl Into<PathBuf>, files: Vec<(String, &'static [u8])>) -> Self {
        Self { path: path.into(), embedded: Embedded(files) }
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
        Scene::load_with(&self.path, &self.embedded)
    }
}
