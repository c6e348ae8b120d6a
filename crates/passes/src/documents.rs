//! A library, its nodes and one pipeline: everything that is known before a scene and a GPU are.

use std::path::{Path, PathBuf};

use manylight_gpu::{HostNodes, WatchSet};
use manylight_graph::{
    check,
    diagnostics::{Diagnostic, Diagnostics},
    library::Library,
    pipeline::Pipeline,
    plan::{Plan, PlanInput},
    planner,
    registry::{HostDecl, Registry},
};

use crate::{externals, host};

/// Loads every node of a library, with the host nodes and externals of this crate. Faulty nodes are left out; their faults are returned.
pub fn load_registry(library: &Library) -> (Registry, Diagnostics) {
    Registry::load(library, &host_declarations(&host::nodes()), externals::declarations())
}

fn host_declarations(hosts: &HostNodes) -> Vec<HostDecl> {
    hosts.kinds().iter().map(|kind| HostDecl { name: kind.name, ron: kind.declaration }).collect()
}

/// A pipeline with the nodes that it can use.
#[derive(Debug, Clone)]
pub struct Documents {
    library: Library,
    registry: Registry,
    registry_faults: Diagnostics,
    pipeline: Pipeline,
    path: PathBuf,
}

impl Documents {
    /// Loads the nodes of a library and a pipeline: a file on disk, a path in the library or a name in its `pipelines/`.
    ///
    /// # Errors
    /// The pipeline's faults. Faulty nodes only matter to pipelines that use them: see [`Documents::plan`].
    pub fn load(library: Library, pipeline: &Path) -> Result<Self, Diagnostics> {
        let (registry, registry_faults) = load_registry(&library);
        Self::with(library, registry, registry_faults, pipeline)
    }

    /// Loads everything again; shaders that are as before are not composed anew.
    ///
    /// # Errors
    /// As [`Documents::load`].
    pub fn reload(&self) -> Result<Self, Diagnostics> {
        let hosts = host_declarations(&host::nodes());
        let (registry, faults) = self.registry.reload(&self.library, &hosts, externals::declarations());
        Self::with(self.library.clone(), registry, faults, &self.path)
    }

    /// As [`Documents::load`], with nodes that are loaded already.
    ///
    /// # Errors
    /// As [`Documents::load`].
    pub fn with(library: Library, registry: Registry, registry_faults: Diagnostics, path: &Path) -> Result<Self, Diagnostics> {
        match Pipeline::load(&library, path) {
            Ok(pipeline) => Ok(Self { library, registry, registry_faults, pipeline, path: path.to_owned() }),
            // Faults of its meaning are told together with those of its text.
            Err(faults) => {
                let all = check::check_file(&library, path, &registry);
                // Mended between the two readings: the faults are those of the first.
                Err(together(registry_faults, if all.has_errors() { all } else { faults }))
            }
        }
    }

    /// What will run.
    ///
    /// # Errors
    /// The pipeline's faults under this input, or why it refuses it. If it uses faulty nodes, the faults of the nodes themselves.
    pub fn plan(&self, input: &PlanInput) -> Result<Plan, Diagnostics> {
        planner::plan(&self.pipeline, &self.registry, input).map_err(|faults| {
            // That a faulty node cannot be used follows from its own faults: those are told instead.
            let follows = |fault: &Diagnostic| {
                self.registry.faulty.iter().any(|n| fault.message.starts_with(&format!("the node `{n}` cannot be used")))
            };
            let (secondary, own): (Vec<_>, Vec<_>) = faults.0.into_iter().partition(follows);
            if secondary.is_empty() || !self.registry_faults.has_errors() {
                return Diagnostics([own, secondary].concat());
            }
            together(self.registry_faults.clone(), Diagnostics(own))
        })
    }

    /// Why the pipeline refuses this input; empty if it does not.
    pub fn refusals(&self, input: &PlanInput) -> Diagnostics {
        planner::refusals(&self.pipeline, &self.registry, input)
    }

    /// Where documents and shaders come from.
    pub fn library(&self) -> &Library {
        &self.library
    }

    /// The nodes.
    pub fn registry(&self) -> &Registry {
        &self.registry
    }

    /// Faults of nodes that are left out of the registry, and warnings.
    pub fn registry_faults(&self) -> &Diagnostics {
        &self.registry_faults
    }

    /// The pipeline.
    pub fn pipeline(&self) -> &Pipeline {
        &self.pipeline
    }

    /// Folders and files on disk that all this is made of: when one changes, [`Documents::reload`] may give something else.
    pub fn watch_set(&self) -> WatchSet {
        let root = self.library.root();
        let folders: Vec<PathBuf> = root.map(|root| ["shaders", "pipelines"].map(|f| root.join(f)).to_vec()).unwrap_or_default();
        let outside = |file: &PathBuf| !folders.iter().any(|folder| file.starts_with(folder));
        let files = self.pipeline.sources.iter().filter_map(|s| s.path.clone()).filter(outside).collect();
        WatchSet { files, folders, extensions: ["ron", "wgsl"].map(str::to_owned).to_vec() }
    }
}

fn together(mut first: Diagnostics, second: Diagnostics) -> Diagnostics {
    first.extend(second);
    first.sorted()
}
