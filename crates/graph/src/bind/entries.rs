//! Entry points that steps name.

use std::collections::BTreeSet;

use super::{Binder, kind_word, within, within_field};
use crate::{
    diagnostics::{Diagnostic, Span},
    reflect,
    registry::{Direction, Over, PortKind, Step},
    render::suggest,
    shader::{Entry, Stage},
};

impl Binder<'_> {
    /// Checks entry points; returns those that steps use. `None` when a step names none that exists.
    pub(super) fn steps(&mut self) -> Option<BTreeSet<String>> {
        let mut reached = BTreeSet::new();
        let mut complete = true;
        for (index, step) in self.decl.steps.iter().enumerate() {
            match step {
                Step::Compute { entry: name, over, span, .. } => match self.entry(name, Stage::Compute, span) {
                    Some(entry) => {
                        reached.insert(name.clone());
                        if matches!(over, Over::Elements(_)) && (entry.workgroup_size[1] > 1 || entry.workgroup_size[2] > 1) {
                            let [x, y, z] = entry.workgroup_size;
                            let place = self.item_span("fn", name);
                            self.out.push(
                                Diagnostic::error(format!("`{name}` runs over elements, in one dimension"), within(span, "Elements"))
                                    .and(place, format!("its workgroup has the size {x}×{y}×{z}"))
                                    .help("write `@workgroup_size(64)`, or give the step another size"),
                            );
                        }
                        if let Over::Indirect(port) = over {
                            self.indirect(index, &entry, port, span);
                        }
                    }
                    None => complete = false,
                },
                Step::Draw { vertex, fragment, targets, span, .. } => {
                    let found = self.entry(vertex, Stage::Vertex, span).is_some();
                    complete &= found;
                    if found {
                        reached.insert(vertex.clone());
                    }
                    match self.entry(fragment, Stage::Fragment, span) {
                        Some(entry) => {
                            reached.insert(fragment.clone());
                            self.targets(&entry, targets, span);
                        }
                        None => complete = false,
                    }
                }
            }
        }
        if complete {
            for entry in self.shader.entries.iter().filter(|e| !reached.contains(&e.name)) {
                let place = self.item_span("fn", &entry.name);
                let message = format!("no step runs the entry point `{}`", entry.name);
                self.out.push(Diagnostic::warning(message, place).help("remove it, or add a step to the declaration"));
            }
        }
        complete.then_some(reached)
    }

    /// The number of workgroups in an output of the node itself: written before, and not in the same dispatch.
    fn indirect(&mut self, index: usize, entry: &Entry, port: &str, span: &Span) {
        if self.decl.ports.get(port).is_none_or(|p| p.direction == Direction::Input) {
            return;
        }
        let Some(global) = self.shader.globals.iter().position(|g| g.name == port) else { return };
        let place = within_field(span, "over", &format!("\"{port}\""));
        if entry.uses.iter().any(|(used, _)| *used == global) {
            let there = self.item_span("fn", &entry.name);
            let fault = Diagnostic::error(format!("`{}` uses `{port}`, which says how often it runs", entry.name), place);
            let help = "a dispatch cannot write what it is sized by; copy what it needs of it to another output in an earlier step";
            self.out.push(fault.and(there, "a global of an output may be written").help(help));
            return;
        }
        let writes = |step: &Step| {
            let Step::Compute { entry, .. } = step else { return false };
            let entry = self.shader.entries.iter().find(|e| e.name == *entry);
            entry.is_some_and(|e| e.uses.iter().any(|(used, access)| *used == global && access.write))
        };
        if !self.decl.steps[..index].iter().any(writes) {
            let fault = Diagnostic::error(format!("no step before this one writes `{port}`"), place);
            self.out.push(fault.help("move the step behind the one that writes it, or make it an input"));
        }
    }

    pub(super) fn entry(&mut self, name: &str, stage: Stage, span: &Span) -> Option<Entry> {
        let field = match stage {
            Stage::Compute => "entry",
            Stage::Vertex => "vertex",
            Stage::Fragment => "fragment",
        };
        let place = within_field(span, field, &format!("\"{name}\""));
        let word = |s: Stage| match s {
            Stage::Compute => "compute",
            Stage::Vertex => "vertex",
            Stage::Fragment => "fragment",
        };
        match self.shader.entries.iter().find(|e| e.name == name) {
            Some(entry) if entry.stage == stage => Some(entry.clone()),
            Some(entry) => {
                let there = self.item_span("fn", name);
                self.out.push(
                    Diagnostic::error(
                        format!("`{name}` is a {} entry point, and this step needs a {} one", word(entry.stage), word(stage)),
                        place,
                    )
                    .and(there, "declared here")
                    .help(format!("mark it `@{}`", word(stage))),
                );
                None
            }
            None => {
                let known = self.shader.entries.iter().filter(|e| e.stage == stage).map(|e| e.name.as_str());
                let fault =
                    Diagnostic::error(format!("the shader has no {} entry point `{name}`", word(stage)), place).help(suggest(name, known));
                self.out.push(fault);
                None
            }
        }
    }

    pub(super) fn targets(&mut self, entry: &Entry, targets: &[String], span: &Span) {
        let kinds = self
            .shader
            .module
            .entry_points
            .iter()
            .find(|e| e.name == entry.name)
            .map(|e| reflect::targets(&self.shader.module, e))
            .unwrap_or_default();
        let there = self.item_span("fn", &entry.name);
        if kinds.len() != targets.len() {
            self.unsettled = true;
            self.out.push(
                Diagnostic::error(
                    format!("the step has {} targets, and `{}` writes {} locations", targets.len(), entry.name, kinds.len()),
                    within(span, "targets"),
                )
                .and(there, "declared here")
                .help("name one output port for each `@location`, in order"),
            );
            return;
        }
        for (location, (name, kind)) in targets.iter().zip(kinds).enumerate() {
            let format = match self.decl.ports.get(name).map(|p| &p.kind) {
                Some(PortKind::Texture { format: Some(format), .. }) => *format,
                _ => continue,
            };
            if format.sample_kind() != kind {
                self.out.push(
                    Diagnostic::error(
                        format!("location {location} of `{}` writes {}, and `{name}` has the format {format}", entry.name, kind_word(kind)),
                        there.clone(),
                    )
                    .and(within(span, &format!("\"{name}\"")), "the target")
                    .help("change the type of the output or the port's format"),
                );
            }
        }
    }
}
