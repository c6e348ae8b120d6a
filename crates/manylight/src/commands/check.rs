//! `manylight check`: every fault that can be found without a GPU.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use manylight::{
    SceneSource,
    fault::Fault,
    graph::{
        check::{check_file, check_with_sources},
        diagnostics::{Diagnostic, Diagnostics},
        library::Library,
        registry::Registry,
    },
    lab::sweep::Sweep,
    library, load_registry,
};

use super::lab;
use crate::cli::{CheckArgs, Cli};

/// Checks the files, or everything in the library.
pub fn run(cli: &Cli, args: &CheckArgs) -> Result<(), Fault> {
    let library = library::open(cli.root.as_deref())?;
    let mut checker = Checker::default();
    if args.files.is_empty() {
        checker.everything(library);
    } else {
        for file in &args.files {
            checker.file(&library, file);
        }
    }
    let Checker { found, counts, .. } = checker;
    let found = found.sorted();
    super::warn(&found);
    let errors = found.0.iter().filter(|d| d.severity == manylight::graph::diagnostics::Severity::Error).count();
    let what: Vec<String> = counts.iter().map(|(what, n)| plural(*n, what)).collect();
    let what = if what.is_empty() { "nothing".to_owned() } else { what.join(", ") };
    if errors > 0 {
        super::note(&format!("checked {what}: {}", plural(errors, "error")));
        return Err(Fault::Reported);
    }
    let warnings = if found.is_empty() { String::new() } else { format!(", {}", plural(found.0.len(), "warning")) };
    super::print(&format!("checked {what}: no errors{warnings}\n"))
}

fn plural(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// A library with its nodes, loaded once.
struct Loaded {
    library: Library,
    registry: Registry,
    faults: Diagnostics,
}

impl Loaded {
    fn new(library: Library) -> Self {
        let (registry, faults) = load_registry(&library);
        Self { library, registry, faults }
    }

    fn pipelines(&self) -> Vec<String> {
        let part = |path: &String| path.starts_with("pipelines/stages/") || path.starts_with("pipelines/sweeps/");
        self.library.list("pipelines", "ron").into_iter().filter(|path| !part(path)).collect()
    }
}

/// What a RON file is, by its outermost name.
enum Document {
    Pipeline,
    Stage,
    Node,
    Sweep,
    Scene,
    Other(String),
}

#[derive(Default)]
struct Checker {
    found: Diagnostics,
    counts: BTreeMap<&'static str, usize>,
    /// Libraries by root: files of several checkouts may be checked in one go.
    loaded: BTreeMap<Option<PathBuf>, Loaded>,
}

impl Checker {
    fn everything(&mut self, library: Library) {
        let loaded = Loaded::new(library);
        self.found.extend(loaded.faults.clone());
        *self.counts.entry("node").or_default() += loaded.registry.nodes.len() + loaded.registry.faulty.len();
        for path in loaded.pipelines() {
            let place = loaded.library.root().map(|root| root.join(&path)).filter(|p| p.is_file()).unwrap_or_else(|| path.clone().into());
            self.pipeline(&loaded, &place);
        }
        for name in library::sweep_names(&loaded.library) {
            self.sweep(&loaded, &name);
        }
    }

    fn pipeline(&mut self, loaded: &Loaded, path: &Path) {
        *self.counts.entry("pipeline").or_default() += 1;
        self.found.extend(check_file(&loaded.library, path, &loaded.registry));
    }

    /// Both sizes of a sweep, with the scenes that it names.
    fn sweep(&mut self, loaded: &Loaded, name: &str) {
        *self.counts.entry("sweep").or_default() += 1;
        let source = match library::sweep(&loaded.library, name) {
            Ok(source) => source,
            Err(Fault::Documents(faults)) => return self.found.extend(faults),
            Err(fault) => return self.found.push(Diagnostic::error_nowhere(fault.to_string())),
        };
        for small in [false, true] {
            let faults = match Sweep::read(&source, small) {
                Ok(sweep) => sweep.check(&loaded.library, &loaded.registry, &lab::find_scene(&loaded.library)),
                Err(faults) => faults,
            };
            for fault in faults.0 {
                if !self.found.0.contains(&fault) {
                    self.found.push(fault);
                }
            }
        }
    }

    fn file(&mut self, library: &Library, path: &Path) {
        let is = |extension: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension));
        if is("obj") || is("gltf") || is("glb") {
            return self.scene(path);
        }
        let document = if is("wgsl") { Ok(Document::Node) } else { kind_of(path) };
        let document = match document {
            Ok(document) => document,
            Err(fault) => return self.found.push(fault),
        };
        if matches!(document, Document::Scene) {
            return self.scene(path);
        }
        // A node belongs to the library in whose `shaders/` it lies; a pipeline may lie anywhere.
        let own = path.canonicalize().ok().and_then(|file| library::root_above(&file));
        let root = own.or_else(|| library.root().map(Path::to_owned));
        let loaded = self.loaded.remove(&root).unwrap_or_else(|| Loaded::new(library::at(root.clone())));
        match document {
            Document::Node => self.node(&loaded, path),
            Document::Stage => self.stage(&loaded, path),
            Document::Sweep => self.sweep(&loaded, &path.to_string_lossy()),
            Document::Other(name) => self.found.push(
                Diagnostic::error_nowhere(format!("`{}` holds a `{name}`, which cannot be checked", path.display()))
                    .help("files that can be checked hold a `Pipeline`, `Stage`, `Node`, `Sweep` or `Scene`"),
            ),
            _ => {
                // Faults of nodes that the pipeline uses are its own.
                let before = self.found.0.len();
                self.pipeline(&loaded, path);
                if self.found.0.len() > before || loaded.faults.has_errors() {
                    self.found.extend(loaded.faults.clone());
                }
            }
        }
        self.loaded.insert(root, loaded);
    }

    fn scene(&mut self, path: &Path) {
        *self.counts.entry("scene").or_default() += 1;
        match SceneSource::file(path).load() {
            Ok(scene) => self.found.extend(scene.warnings),
            Err(faults) => self.found.extend(faults),
        }
    }

    fn node(&mut self, loaded: &Loaded, path: &Path) {
        *self.counts.entry("node").or_default() += 1;
        let stem = |path: &Path| path.canonicalize().ok().map(|p| p.with_extension(""));
        let own = stem(path);
        let inside = loaded.library.root().and_then(|root| root.canonicalize().ok()).map(|root| root.join("shaders"));
        if !own.as_ref().zip(inside).is_some_and(|(file, shaders)| file.starts_with(shaders)) {
            let fault = Diagnostic::error_nowhere(format!("the node `{}` lies in no library", path.display()));
            return self
                .found
                .push(fault.help("nodes are `shaders/STAGE/NAME.ron` beside `NAME.wgsl`, under a folder that has `pipelines/` as well"));
        }
        let about = |d: &Diagnostic| {
            d.labels.iter().any(|l| l.span.source.path.as_deref().and_then(stem) == own)
                || (d.labels.is_empty() && path.file_stem().is_some_and(|s| d.message.contains(&*s.to_string_lossy())))
        };
        self.found.0.extend(loaded.faults.0.iter().filter(|d| about(d)).cloned());
        // A fault in a shared module that the node imports.
        let name = own.as_ref().and_then(|o| Some(format!("{}/{}", o.parent()?.file_name()?.to_str()?, o.file_name()?.to_str()?)));
        if name.is_some_and(|name| loaded.registry.faulty.contains(&name)) && !self.found.has_errors() {
            self.found.extend(loaded.faults.clone());
        }
    }

    /// A stage is checked in every pipeline of its library that includes it.
    fn stage(&mut self, loaded: &Loaded, path: &Path) {
        *self.counts.entry("stage").or_default() += 1;
        let own = path.canonicalize().ok();
        let mut used = false;
        for name in loaded.pipelines() {
            let Some(file) = loaded.library.root().map(|root| root.join(&name)) else { continue };
            let (found, sources) = check_with_sources(&loaded.library, &file, &loaded.registry);
            if sources.iter().any(|s| s.path.as_deref().and_then(|p| p.canonicalize().ok()) == own) {
                used = true;
                self.found.extend(found);
            }
        }
        if !used {
            let fault = Diagnostic::error_nowhere(format!("no pipeline of the library includes the stage `{}`", path.display()));
            self.found.push(fault.help("a stage is checked in the pipelines that include it: add it to one, and check that"));
        }
    }
}

/// Reads the outermost name of a RON document.
fn kind_of(path: &Path) -> Result<Document, Diagnostic> {
    let source = Library::read_file(path).map_err(|e| e.diagnostic())?;
    let name = outermost_name(&source.text);
    Ok(match name.as_str() {
        "Pipeline" | "" => Document::Pipeline,
        "Stage" => Document::Stage,
        "Node" => Document::Node,
        "Sweep" => Document::Sweep,
        "Scene" => Document::Scene,
        _ => Document::Other(name),
    })
}

/// The first name of a RON text, past comments and `#![…]` attributes; "" if there is none.
fn outermost_name(text: &str) -> String {
    let mut rest = text.trim_start();
    loop {
        let after = if rest.starts_with("//") || rest.starts_with("#!") {
            rest.split_once('\n').map_or("", |(_, after)| after)
        } else if rest.starts_with("/*") {
            rest.split_once("*/").map_or("", |(_, after)| after)
        } else {
            break;
        };
        rest = after.trim_start();
    }
    rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

#[cfg(test)]
mod tests {
    use super::outermost_name;

    #[test]
    fn documents_tell_what_they_are() {
        assert_eq!(outermost_name("// a comment\n/* another */ #![enable(x)]\n  Scene(\n"), "Scene");
        assert_eq!(outermost_name("Node(doc: \"Pipeline\")"), "Node");
        for nothing in ["", "(doc: \"\")", "// only", "/* open", "\u{0}\u{1}"] {
            assert_eq!(outermost_name(nothing), "", "{nothing:?}");
        }
    }
}
