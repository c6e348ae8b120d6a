//! Matches a shader with its node's declaration by name: ports, parameters, samplers, entry points.

use std::{collections::BTreeSet, sync::Arc};

use crate::{
    declaration::Declaration,
    diagnostics::{Diagnostic, Source, Span},
    reflect::NEAREST_SAMPLER,
    registry::{Direction, Over, Port, Repeat, Step},
    render::{and_also, suggest},
    shader::{Access, Global, GlobalKind, SampleKind, Shader},
    wgsl::Scan,
};

/// Samplers that every shader may declare.
pub const SAMPLERS: [&str; 3] = ["linear_sampler", "linear_repeat_sampler", NEAREST_SAMPLER];
/// The uniform whose members are parameters.
pub const PARAMS: &str = "params";

mod entries;
mod imported;
mod params;
mod ports;

use ports::{expected_wgsl, mismatch};

struct Binder<'a> {
    decl: &'a Declaration,
    shader: &'a Shader,
    scan: &'a Scan,
    /// A draw has another number of targets than its shader: which output is unused cannot be told.
    unsettled: bool,
    out: &'a mut Vec<Diagnostic>,
}

/// Reports everything in which the shader and the declaration disagree.
pub(crate) fn bind(decl: &Declaration, shader: &Shader, scan: &Scan, out: &mut Vec<Diagnostic>) {
    let mut binder = Binder { decl, shader, scan, unsettled: false, out };
    let reached = binder.steps();
    binder.globals();
    binder.ports(&reached);
    binder.overrides();
    binder.unused_params();
}

impl<'a> Binder<'a> {
    fn wgsl(&self) -> &Arc<Source> {
        &self.shader.source
    }

    fn has_step(&self, test: impl Fn(&Repeat) -> bool) -> bool {
        self.decl.steps.iter().any(|s| matches!(s, Step::Compute { repeat: Some(r), .. } if test(r)))
    }

    /// Every global must be a port, a sampler or `params`.
    fn globals(&mut self) {
        for global in &self.shader.globals {
            let name = global.name.as_str();
            if global.group > 3 {
                let fault =
                    Diagnostic::error(format!("`{name}` is in group {}, and there are groups 0 to 3", global.group), global.span.clone());
                self.out.push(fault.help("use a smaller `@group`"));
            }
            self.imported(global);
            if name == PARAMS {
                self.params(global);
            } else if SAMPLERS.contains(&name) {
                if global.kind != GlobalKind::Sampler {
                    let fault = Diagnostic::error(format!("`{name}` is the name of a sampler"), global.span.clone());
                    self.out.push(fault.help(format!("write `var {name}: sampler;`, or rename it")));
                }
            } else if let Some(port) = self.decl.ports.get(name) {
                self.port(global, port);
            } else if let Some((base, port, finer)) = self.neighbour(name) {
                self.neighbour_level(global, &base, port, finer);
            } else if global.module.is_some() && global.kind != GlobalKind::Sampler {
                self.lacks_imported(global);
            } else {
                let known = self.decl.ports.keys().map(String::as_str).chain(SAMPLERS).chain([PARAMS]);
                let help = suggest(name, known);
                self.out.push(
                    Diagnostic::error(format!("`{name}` is no port of this node"), global.span.clone())
                        .and(self.decl.span.clone(), "the node's declaration")
                        .help(and_also(
                            help,
                            &format!("Globals are bound by name: ports, `params`, and the samplers {}", SAMPLERS.join(", ")),
                        )),
                );
            }
        }
    }

    fn neighbour(&self, name: &str) -> Option<(String, &'a Port, bool)> {
        let (base, finer) = match (name.strip_suffix("_finer"), name.strip_suffix("_coarser")) {
            (Some(base), _) => (base, true),
            (_, Some(base)) => (base, false),
            _ => return None,
        };
        Some((base.to_owned(), self.decl.ports.get(base)?, finer))
    }

    fn neighbour_level(&mut self, global: &Global, base: &str, port: &Port, finer: bool) {
        let form = if finer { "Down" } else { "Up" };
        if !self.has_step(|r| matches!((r, finer), (Repeat::Down(p), true) | (Repeat::Up(p), false) if p == base)) {
            let fault = Diagnostic::error(
                format!("`{}` exists only in a step with `repeat: {form}(\"{base}\")`", global.name),
                global.span.clone(),
            );
            self.out.push(fault.and(port.span.clone(), "the port").help("add the repetition to the step, or remove the global"));
            return;
        }
        let read = Port { direction: Direction::Input, ..port.clone() };
        self.port(global, &read);
    }

    /// A global against its port.
    fn port(&mut self, global: &Global, port: &Port) {
        let expected = expected_wgsl(&global.name, port, self.drawn(&global.name));
        let problem = mismatch(global, port, self.drawn(&global.name), &self.decl.requires);
        if let Some(problem) = problem {
            self.out.push(
                Diagnostic::error(format!("`{}` does not fit its port: {problem}", global.name), global.span.clone())
                    .and(port.span.clone(), "the port")
                    .help(expected),
            );
        }
    }

    fn drawn(&self, name: &str) -> bool {
        self.decl.steps.iter().any(|s| match s {
            Step::Draw { targets, depth, .. } => targets.iter().any(|t| t == name) || depth.as_deref() == Some(name),
            Step::Compute { .. } => false,
        })
    }

    /// Whether a step gets its number of workgroups from the port.
    fn sizes_a_step(&self, name: &str) -> bool {
        self.decl.steps.iter().any(|s| matches!(s, Step::Compute { over: Over::Indirect(port), .. } if port == name))
    }

    /// Every port must be used, and outputs must be written.
    fn ports(&mut self, reached: &Option<BTreeSet<String>>) {
        for (name, port) in &self.decl.ports {
            if self.drawn(name) {
                continue;
            }
            let sizes_a_step = self.sizes_a_step(name);
            let Some(index) = self.shader.globals.iter().position(|g| g.name == *name) else {
                if sizes_a_step && port.direction == Direction::Input {
                    continue;
                }
                // A misspelt global is already reported with this port as the suggestion.
                let candidates = self.shader.globals.iter().filter(|g| !self.known_global(&g.name)).map(|g| g.name.as_str());
                if crate::render::nearest(name, candidates).is_some() {
                    continue;
                }
                if self.unsettled && port.direction == Direction::Output {
                    continue;
                }
                let help = expected_wgsl(name, port, false);
                self.out.push(
                    Diagnostic::error(format!("the shader does not use the port `{name}`"), port.span.clone())
                        .help(format!("{help}, or remove the port")),
                );
                continue;
            };
            let Some(reached) = reached else { continue };
            let mut used = sizes_a_step;
            let mut access = Access::default();
            for entry in self.shader.entries.iter().filter(|e| reached.contains(&e.name)) {
                for (_, one) in entry.uses.iter().filter(|(g, _)| *g == index) {
                    used = true;
                    access.read |= one.read;
                    access.write |= one.write;
                }
            }
            let place = self.shader.globals[index].span.clone();
            if !used {
                self.out.push(
                    Diagnostic::error(format!("no step uses the port `{name}`"), port.span.clone())
                        .and(place, "declared here, but no entry point of a step reaches it")
                        .help("use it or remove it"),
                );
            } else if port.direction == Direction::Output && !access.write {
                let kind = &self.shader.globals[index].kind;
                if matches!(kind, GlobalKind::Storage { access, .. } | GlobalKind::StorageTexture { access, .. } if access.write) {
                    self.out.push(
                        Diagnostic::error(format!("no step writes the output `{name}`"), port.span.clone())
                            .and(place, "read, but never written")
                            .help("write it, or make it an input"),
                    );
                }
            }
        }
    }

    fn known_global(&self, name: &str) -> bool {
        name == PARAMS || SAMPLERS.contains(&name) || self.decl.ports.contains_key(name) || self.neighbour(name).is_some()
    }

    fn item_span(&self, keyword: &str, name: &str) -> Span {
        let range = self.scan.item(keyword, name).map_or(0..0, |i| i.range.clone());
        Span::new(self.wgsl(), range)
    }
}

/// The place of `what` after the field `field` inside a span, or the span.
fn within_field(span: &Span, field: &str, what: &str) -> Span {
    let text = span.text();
    let from = text.find(&format!("{field}:")).unwrap_or(0);
    match text[from..].find(what) {
        Some(at) => Span::new(&span.source, span.range.start + from + at..span.range.start + from + at + what.len()),
        None => span.clone(),
    }
}

/// The place of `what` inside a span, or the span.
fn within(span: &Span, what: &str) -> Span {
    match span.text().find(what) {
        Some(at) => Span::new(&span.source, span.range.start + at..span.range.start + at + what.len()),
        None => span.clone(),
    }
}

fn kind_word(kind: SampleKind) -> &'static str {
    match kind {
        SampleKind::Float => "floats",
        SampleKind::Uint => "unsigned integers",
        SampleKind::Sint => "signed integers",
        SampleKind::Depth => "depth",
    }
}
