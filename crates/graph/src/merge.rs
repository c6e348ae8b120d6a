//! Loads a pipeline with all it extends and includes, and merges the files.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    sync::Arc,
};

use indexmap::{IndexMap, map::Entry};

use crate::{
    diagnostics::{Diagnostic, Diagnostics, Severity, Source, Span},
    document::{self, Document},
    library::{Library, stem},
    pipeline::{NodeUse, Pipeline, Preset, Resource},
    reader::Spanned,
    registry::Param,
};

impl Pipeline {
    /// Reads a pipeline: a file on disk, a path of the library, or a name in `pipelines/` (`acrsm`).
    ///
    /// # Errors
    /// All faults of all files that it reads.
    pub fn load(library: &Library, path: impl AsRef<Path>) -> Result<Self, Diagnostics> {
        let path = path.as_ref();
        let (source, library_path) = library.find(path).map_err(|error| {
            let fault = error.diagnostic();
            Diagnostics::from(match error {
                crate::library::ReadError::Missing(name) => fault.help(library.suggest_document(&name)),
                crate::library::ReadError::Unreadable { .. } => fault,
            })
        })?;
        let mut loader = Loader { library, out: Vec::new(), sources: Vec::new(), stack: Vec::new(), parsed: BTreeMap::new() };
        let layer = loader.file(&source, library_path.as_deref(), false);
        let Loader { mut out, sources, .. } = loader;
        let pipeline = layer.and_then(|layer| layer.finish(stem(&source.name), sources, &mut out));
        if out.iter().any(|d| d.severity == Severity::Error) {
            return Err(Diagnostics(out).sorted());
        }
        pipeline.ok_or_else(|| Diagnostic::error("the file has no pipeline", Span::new(&source, 0..0)).into())
    }
}

/// What one file with its extended and included files comes to.
#[derive(Default)]
struct Layer {
    doc: String,
    head: Option<Span>,
    params: IndexMap<String, Param>,
    set: IndexMap<String, Preset>,
    resources: IndexMap<String, Resource>,
    nodes: IndexMap<String, NodeUse>,
    presents: Option<Spanned>,
    radiance: Option<Spanned>,
    /// Files in it, so that a stage included twice counts once.
    files: BTreeSet<String>,
}

struct Loader<'a> {
    library: &'a Library,
    out: Vec<Diagnostic>,
    sources: Vec<Arc<Source>>,
    /// Files being read, from the pipeline inwards.
    stack: Vec<String>,
    /// Texts read, so that a fault in a file read twice is reported once.
    parsed: BTreeMap<String, ()>,
}

impl Loader<'_> {
    fn file(&mut self, source: &Arc<Source>, path: Option<&str>, as_stage: bool) -> Option<Layer> {
        let key = path.map_or_else(|| source.name.clone(), str::to_owned);
        let first_time = self.parsed.insert(key.clone(), ()).is_none();
        if first_time {
            self.sources.push(Arc::clone(source));
        }
        let before = self.out.len();
        let document = document::read(source, &stem(&source.name), &mut self.out);
        if !first_time {
            self.out.truncate(before);
        }
        let document = document?;
        if document.is_stage != as_stage {
            let message = if as_stage { "a pipeline cannot be included" } else { "a stage is no pipeline" };
            let help = if as_stage { "name it as `extends`, or make it a Stage(…)" } else { "name a pipeline that includes it, or make it a Pipeline(…)" };
            self.out.push(Diagnostic::error(message, document.head.clone()).help(help));
            return None;
        }
        self.stack.push(key.clone());
        let mut base = Layer::default();
        if let Some(extends) = &document.extends
            && let Some((source, path)) = self.beside(source, path, extends, "extends")
        {
            base = self.file(&source, path.as_deref(), false).unwrap_or_default();
        }
        let mut own = Layer::default();
        own.files.insert(key);
        for include in &document.include {
            let Some((source, path)) = self.beside(source, path, include, "includes") else { continue };
            let key = path.clone().unwrap_or_else(|| source.name.clone());
            if own.files.contains(&key) || base.files.contains(&key) {
                continue;
            }
            if let Some(stage) = self.file(&source, path.as_deref(), true) {
                self.join(&mut own, stage);
            }
        }
        self.stack.pop();
        self.join_document(&mut own, document);
        base.overlay(own);
        Some(base)
    }

    /// Finds a file that another names; a circle is a fault.
    fn beside(&mut self, from: &Arc<Source>, from_path: Option<&str>, name: &Spanned, verb: &str) -> Option<(Arc<Source>, Option<String>)> {
        match self.library.find_beside(from, from_path, &name.text) {
            Ok((source, path)) => {
                let key = path.clone().unwrap_or_else(|| source.name.clone());
                if let Some(at) = self.stack.iter().position(|k| *k == key) {
                    let mut circle: Vec<&str> = self.stack[at..].iter().map(String::as_str).collect();
                    circle.push(&key);
                    let message = format!("the file {verb} itself: {}", circle.join(" → "));
                    self.out.push(Diagnostic::error(message, name.span.clone()).help("remove one of these lines"));
                    return None;
                }
                Some((source, path))
            }
            Err(crate::library::ReadError::Missing(_)) => {
                let help = self.library.suggest_document(&name.text);
                self.out.push(
                    Diagnostic::error(format!("there is no file `{}`", name.text), name.span.clone())
                        .help(format!("{help} Paths are relative to this file, then to `pipelines/`")),
                );
                None
            }
            Err(error) => {
                self.out.push(Diagnostic::error(error.to_string(), name.span.clone()));
                None
            }
        }
    }

    /// Puts an included stage beside what is there; nothing may be given twice.
    fn join(&mut self, own: &mut Layer, stage: Layer) {
        own.files.extend(stage.files);
        for (name, param) in stage.params {
            let span = param.span.clone();
            self.insert(&mut own.params, name, param, "parameter", |p| p.span.clone(), span);
        }
        for (name, resource) in stage.resources {
            let span = resource.span.clone();
            self.insert(&mut own.resources, name, resource, "resource", |r| r.span.clone(), span);
        }
        for (id, node) in stage.nodes {
            let span = node.id.span.clone();
            self.insert(&mut own.nodes, id, node, "node", |n| n.id.span.clone(), span);
        }
    }

    fn join_document(&mut self, own: &mut Layer, document: Document) {
        let Document { doc, head, set, params, resources, nodes, presents, radiance, .. } = document;
        let mut layer = Layer { doc, head: Some(head), params, resources, presents, radiance, ..Layer::default() };
        layer.set.extend(set);
        for node in nodes {
            let span = node.id.span.clone();
            self.insert(&mut layer.nodes, node.id.text.clone(), node, "node", |n| n.id.span.clone(), span);
        }
        let Layer { doc, head, set, presents, radiance, .. } = &mut layer;
        own.doc = std::mem::take(doc);
        own.head = head.take();
        own.set = std::mem::take(set);
        own.presents = presents.take();
        own.radiance = radiance.take();
        self.join(own, layer);
    }

    fn insert<T>(&mut self, into: &mut IndexMap<String, T>, name: String, value: T, what: &str, place: impl Fn(&T) -> Span, span: Span) {
        match into.entry(name) {
            Entry::Occupied(first) => {
                let there = place(first.get());
                self.out.push(
                    Diagnostic::error(format!("there are two {what}s `{}`", first.key()), span)
                        .and(there, "the other one")
                        .help("rename or remove one of them"),
                );
            }
            Entry::Vacant(slot) => {
                slot.insert(value);
            }
        }
    }
}

impl Layer {
    /// Lays another over this one: what it gives wins.
    fn overlay(&mut self, over: Self) {
        let Self { doc, head, params, set, resources, nodes, presents, radiance, files } = over;
        self.doc = doc;
        self.head = head;
        self.params.extend(params);
        self.set.extend(set);
        self.resources.extend(resources);
        self.nodes.extend(nodes);
        self.presents = presents.or(self.presents.take());
        self.radiance = radiance.or(self.radiance.take());
        self.files.extend(files);
    }

    fn finish(self, name: String, sources: Vec<Arc<Source>>, out: &mut Vec<Diagnostic>) -> Option<Pipeline> {
        let Self { doc, head, params, set, resources, nodes, presents, radiance, .. } = self;
        let Some(presents) = presents else {
            let fault = Diagnostic::error("missing field `presents` in Pipeline", head?);
            out.push(fault.help("add `presents: \"…\"` with the name of the texture to show"));
            return None;
        };
        Some(Pipeline { name, doc, params, set, resources, nodes, presents, radiance, sources })
    }
}
