//! What concerns the pipeline as a whole: presets, what is shown, what nobody writes.

use std::collections::BTreeSet;

use super::{LinkedNode, Linker, Wire, settable};
use crate::{
    diagnostics::Diagnostic,
    pipeline::{Pipeline, Preset, ResourceKind},
    registry::Direction,
};

impl<'a> Linker<'a, '_> {
    pub(super) fn presets(&mut self, nodes: &[LinkedNode<'a>]) {
        for (name, preset) in &self.pipeline.set {
            if self.pipeline.gaps != crate::pipeline::Gaps::default() && settable(self.pipeline, nodes, name).is_err() {
                continue;
            }
            if let Some(fault) = preset_fault(self.pipeline, nodes, name, preset) {
                self.push(fault);
            }
        }
    }

    /// A resource that is read, but that no node writes under any condition.
    pub(super) fn never_written(&mut self, nodes: &[LinkedNode<'a>]) {
        let mut written: BTreeSet<&str> = BTreeSet::new();
        for node in nodes {
            // Outputs named in the document count even where the declaration is unknown.
            written.extend(node.usage.outputs.values().map(|c| c.resource.text.as_str()));
            for (_, port, wire) in node.ports() {
                if let (Direction::Output, Wire::Resource { name, .. }) = (port.direction, wire) {
                    written.insert(name);
                }
            }
        }
        if self.incomplete {
            return;
        }
        let mut said: BTreeSet<&str> = BTreeSet::new();
        for node in nodes {
            for (port_name, port, wire) in node.ports() {
                let (Direction::Input, Wire::Resource { name, span, .. }) = (port.direction, wire) else { continue };
                if written.contains(name) || port.optional || port.when.is_some() || self.tainted.contains(name) || !said.insert(name) {
                    continue;
                }
                let mut fault = Diagnostic::error(format!("`{name}` is read before it is written: no node writes it"), span.clone())
                    .at(format!("read by the input `{port_name}` of `{}`", node.usage.id.text));
                if let Some(resource) = self.pipeline.resources.get(name) {
                    fault = fault.and(resource.span.clone(), "declared here");
                }
                self.out.push(fault.help(format!("add a node with `{name}` in `out`")));
            }
        }
        self.tainted.extend(said.into_iter().map(str::to_owned));
        let shown = [Some(&self.pipeline.presents), self.pipeline.radiance.as_ref()];
        for name in shown.into_iter().flatten() {
            if self.pipeline.resources.contains_key(&name.text)
                && !written.contains(name.text.as_str())
                && self.tainted.insert(name.text.clone())
            {
                let fault = Diagnostic::error(format!("no node writes `{}`", name.text), name.span.clone());
                self.push(fault.help(format!("add a node with `{}` in `out`", name.text)));
            }
        }
    }

    pub(super) fn shown(&mut self) {
        let shown = [("presents", Some(&self.pipeline.presents)), ("radiance", self.pipeline.radiance.as_ref())];
        for (field, name) in shown {
            let Some(name) = name else { continue };
            match self.pipeline.resources.get(&name.text) {
                Some(resource) if matches!(resource.kind, ResourceKind::Texture { .. }) => {}
                Some(resource) => {
                    let fault = Diagnostic::error(format!("`{field}` names a texture, and `{}` is a buffer", name.text), name.span.clone());
                    self.push(fault.and(resource.span.clone(), "declared here").help("name a texture"));
                }
                None => {
                    self.tainted.insert(name.text.clone());
                    if !name.text.is_empty() {
                        self.unknown_resource(&name.text, &name.span, self.pipeline.resources.keys().map(String::as_str).collect());
                    }
                }
            }
        }
    }
}

/// What is wrong with a value that a document sets.
pub(crate) fn preset_fault(pipeline: &Pipeline, nodes: &[LinkedNode<'_>], name: &str, preset: &Preset) -> Option<Diagnostic> {
    match settable(pipeline, nodes, name) {
        Ok(Some(kind)) => {
            let remedy = kind.accept(&preset.value).err()?;
            Some(Diagnostic::error(format!("{} is no value of `{name}`", preset.shown()), preset.span.clone()).help(remedy))
        }
        Ok(None) => None,
        Err((message, help)) => Some(Diagnostic::error(message, preset.name_span.clone()).help(help)),
    }
}
