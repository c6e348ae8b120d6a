//! Globals that a node has from a file of `shaders/common/`: bound by name like its own, and declared as ports like its own.

use super::Binder;
use crate::{
    compose::IMPORTED_GROUP,
    diagnostics::{Diagnostic, Span},
    render::{and_also, suggest},
    shader::{Global, GlobalKind},
};

impl Binder<'_> {
    /// What may not be beside an imported global, or be one.
    pub(super) fn imported(&mut self, global: &Global) {
        let Some(module) = &global.module else { return };
        if let GlobalKind::Storage { access, .. } | GlobalKind::StorageTexture { access, .. } = global.kind
            && access.write
        {
            let fault = Diagnostic::error(format!("`{}` is written in a file of shaders/common", global.name), global.span.clone());
            self.out.push(fault.help("let it only be read there: what a node writes is to be seen in its own shader"));
        }
        // A group is told of once, whatever number of globals is in it.
        let first = self.shader.globals.iter().find(|g| g.module.is_some()).is_some_and(|g| std::ptr::eq(g, global));
        for own in self.shader.globals.iter().filter(|g| g.module.is_none()) {
            let (message, help) = if own.name == global.name {
                (format!("`{}` is declared twice", own.name), format!("remove it here, and import it: `{module}::{}`", own.name))
            } else if first && own.group == IMPORTED_GROUP {
                (format!("group {IMPORTED_GROUP} belongs to what imported files declare"), "use another `@group`".to_owned())
            } else {
                continue;
            };
            let fault = Diagnostic::error(message, own.span.clone()).and(global.span.clone(), format!("declared by `{module}`"));
            self.out.push(fault.help(help));
        }
    }

    /// A function of an imported file reads a global, no sampler, that the node has no port for.
    pub(super) fn lacks_imported(&mut self, global: &Global) {
        let name = &global.name;
        let Some(module) = &global.module else { return };
        let port = port_for(&global.kind);
        let inside = |path: &str| path.strip_prefix(module.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"));
        let import = self.scan.paths.iter().find(|p| p.import && inside(&p.text));
        let mut fault = Diagnostic::error(format!("`{name}`, which `{module}` reads, is no port of this node"), self.decl.span.clone());
        if let Some(import) = import {
            fault = fault.and(Span::new(self.wgsl(), import.range.clone()), "imported here");
        }
        let help = suggest(name, self.decl.ports.keys().map(String::as_str));
        fault = fault.and(global.span.clone(), "declared here");
        self.out
            .push(fault.help(and_also(help, &format!("Add `\"{name}\": {port}` to the node's inputs, or import nothing that reads it"))));
    }
}

/// The port that a declaration needs for a global.
fn port_for(kind: &GlobalKind) -> String {
    match kind {
        GlobalKind::Storage { element, .. } => format!("Buffer(of: \"{element}\", doc: \"…\")"),
        GlobalKind::Uniform { element, .. } => format!("Uniform(of: \"{element}\", doc: \"…\")"),
        _ => "Texture(format: …, doc: \"…\")".to_owned(),
    }
}
