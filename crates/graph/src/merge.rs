//! Loads a pipeline with all it extends and includes, and merges the files.

use std::{collections::BTreeSet, path::Path, sync::Arc};

use indexmap::{IndexMap, map::Entry};

use crate::{
    condition::NamedCondition,
    diagnostics::{Diagnostic, Diagnostics, Source, Span},
    document::{self, Document},
    library::{Library, ReadError, stem},
    pipeline::{Gaps, NodeUse, Pipeline, Preset, Refusal, Resource},
    quality::Quality,
    reader::Spanned,
    registry::Param,
    render::and_also,
};

impl Pipeline {
    /// Reads a pipeline: a file on disk, a path of the library, or a name in `pipelines/` (`acrsm`).
    ///
    /// # Errors
    /// All faults of all files that it reads.
    pub fn load(library: &Library, path: impl AsRef<Path>) -> Result<Self, Diagnostics> {
        match Self::load_with_gaps(library, path.as_ref()) {
            (Some(pipeline), _, faults) if !faults.has_errors() => Ok(pipeline),
            (_, _, faults) => Err(faults),
        }
    }

    /// As [`load`](Self::load), but what can be read of a pipeline with faults is returned, too, and every file that was read.
    pub(crate) fn load_with_gaps(library: &Library, path: &Path) -> (Option<Self>, Vec<Arc<Source>>, Diagnostics) {
        let (source, library_path) = match library.find(path) {
            Ok(found) => found,
            Err(error) => {
                let fault = error.diagnostic();
                let fault = match error {
                    ReadError::Missing(name) => fault.help(library.suggest_document(&name)),
                    ReadError::Unreadable { .. } => fault,
                };
                return (None, Vec::new(), fault.into());
            }
        };
        let mut loader = Loader { library, out: Vec::new(), sources: Vec::new(), stack: Vec::new(), loaded: BTreeSet::new() };
        let layer = loader.file(&source, library_path.as_deref(), false);
        let Loader { mut out, sources, .. } = loader;
        let pipeline = layer.and_then(|layer| layer.finish(stem(&source.name), sources.clone(), &mut out));
        if pipeline.is_none() && out.is_empty() {
            out.push(Diagnostic::error("the file has no pipeline", Span::new(&source, 0..0)));
        }
        (pipeline, sources, Diagnostics(out).sorted())
    }
}

/// What one file with its extended and included files comes to.
#[derive(Default)]
struct Layer {
    doc: String,
    head: Option<Span>,
    params: IndexMap<String, Param>,
    conditions: IndexMap<String, NamedCondition>,
    set: IndexMap<String, Preset>,
    resources: IndexMap<String, Resource>,
    nodes: IndexMap<String, NodeUse>,
    refuse: Vec<Refusal>,
    quality: Option<Quality>,
    presents: Option<Spanned>,
    radiance: Option<Spanned>,
    gaps: Gaps,
}

struct Loader<'a> {
    library: &'a Library,
    out: Vec<Diagnostic>,
    sources: Vec<Arc<Source>>,
    /// Files being read, from the pipeline inwards.
    stack: Vec<String>,
    /// Files read: a stage included twice counts once.
    loaded: BTreeSet<String>,
}

impl Loader<'_> {
    fn file(&mut self, source: &Arc<Source>, path: Option<&str>, as_stage: bool) -> Option<Layer> {
        let key = path.map_or_else(|| source.name.clone(), str::to_owned);
        self.sources.push(Arc::clone(source));
        self.loaded.insert(key.clone());
        let document = document::read(source, &stem(&source.name), &mut self.out)?;
        if document.is_stage != as_stage {
            let message = if as_stage { "a pipeline cannot be included" } else { "a stage is no pipeline" };
            let help = if as_stage {
                "name it as `extends`, or make it a Stage(…)"
            } else {
                "name a pipeline that includes it, or make it a Pipeline(…)"
            };
            self.out.push(Diagnostic::error(message, document.head.clone()).help(help));
            return None;
        }
        self.stack.push(key.clone());
        let mut base = Layer::default();
        if let Some(extends) = &document.extends {
            let found = self.beside(source, path, extends, "extends");
            let layer = found.and_then(|(source, path)| self.file(&source, path.as_deref(), false));
            base = layer.unwrap_or_else(|| Layer { gaps: Gaps { files: true, ..Gaps::default() }, ..Layer::default() });
        }
        let mut own = Layer::default();
        for include in &document.include {
            let Some((source, path)) = self.beside(source, path, include, "includes") else {
                own.gaps.files = true;
                continue;
            };
            let key = path.clone().unwrap_or_else(|| source.name.clone());
            if self.loaded.contains(&key) {
                continue;
            }
            match self.file(&source, path.as_deref(), true) {
                // An order over everything is best said by who has everything: its own ladder replaces those of stages.
                Some(stage) if document.quality.is_some() => self.join(&mut own, Layer { quality: None, ..stage }),
                Some(stage) => self.join(&mut own, stage),
                None => own.gaps.files = true,
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
            Err(ReadError::Missing(_)) => {
                let help = self.library.suggest_document(&name.text);
                self.out.push(
                    Diagnostic::error(format!("there is no file `{}`", name.text), name.span.clone())
                        .help(and_also(help, "Paths are relative to this file, then to `pipelines/`")),
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
        own.gaps.extend(stage.gaps);
        let before = self.out.len();
        for (name, param) in stage.params {
            let span = param.span.clone();
            self.insert(&mut own.params, name, param, "parameter", |p| p.span.clone(), span);
        }
        for (name, condition) in stage.conditions {
            let span = condition.span.clone();
            self.insert(&mut own.conditions, name, condition, "condition", |c| c.span.clone(), span);
        }
        for (name, resource) in stage.resources {
            let span = resource.span.clone();
            self.insert(&mut own.resources, name, resource, "resource", |r| r.span.clone(), span);
        }
        for (id, node) in stage.nodes {
            let span = node.id.span.clone();
            self.insert(&mut own.nodes, id, node, "node", |n| n.id.span.clone(), span);
        }
        own.refuse.extend(stage.refuse);
        match (&own.quality, stage.quality) {
            (Some(first), Some(second)) => self.out.push(
                Diagnostic::error("there are two ladders of quality", second.span)
                    .and(first.span.clone(), "the other one")
                    .help("give the file that includes both a `quality` of its own, which replaces them"),
            ),
            (None, second) => own.quality = second,
            (Some(_), None) => {}
        }
        // What was given twice was left out once.
        own.gaps.nodes |= self.out.len() > before;
    }

    fn join_document(&mut self, own: &mut Layer, document: Document) {
        let Document { doc, head, set, params, conditions, resources, nodes, refuse, quality, presents, radiance, gaps, .. } = document;
        let mut layer =
            Layer { doc, head: Some(head), params, conditions, resources, refuse, quality, presents, radiance, gaps, ..Layer::default() };
        layer.set.extend(set);
        let before = self.out.len();
        for node in nodes {
            let span = node.id.span.clone();
            self.insert(&mut layer.nodes, node.id.text.clone(), node, "node", |n| n.id.span.clone(), span);
        }
        layer.gaps.nodes |= self.out.len() > before;
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
        let Self { doc, head, params, conditions, set, resources, nodes, refuse, quality, presents, radiance, gaps } = over;
        self.doc = doc;
        self.head = head;
        self.params.extend(params);
        self.conditions.extend(conditions);
        self.set.extend(set);
        self.resources.extend(resources);
        self.nodes.extend(nodes);
        self.refuse.extend(refuse);
        self.quality = quality.or(self.quality.take());
        self.presents = presents.or(self.presents.take());
        self.radiance = radiance.or(self.radiance.take());
        self.gaps.extend(gaps);
    }

    fn finish(self, name: String, sources: Vec<Arc<Source>>, out: &mut Vec<Diagnostic>) -> Option<Pipeline> {
        let Self { doc, head, params, conditions, set, resources, nodes, refuse, quality, presents, radiance, gaps } = self;
        let Some(presents) = presents else {
            if !gaps.files {
                let fault = Diagnostic::error("missing field `presents` in Pipeline", head?);
                out.push(fault.help("add `presents: \"…\"` with the name of the texture to show"));
            }
            return None;
        };
        Some(Pipeline { name, doc, params, conditions, set, resources, nodes, refuse, quality, presents, radiance, sources, gaps })
    }
}
