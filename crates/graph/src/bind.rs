//! Matches a shader with its node's declaration by name: ports, parameters, samplers, entry points.

use std::{collections::BTreeSet, sync::Arc};

use crate::{
    declaration::Declaration,
    diagnostics::{Diagnostic, Source, Span},
    reflect::{self, NEAREST_SAMPLER},
    registry::{Direction, Over, Param, Port, PortKind, Repeat, Step},
    render::{and_also, suggest},
    shader::{Access, Entry, Global, GlobalKind, MemberKind, SampleKind, Scalar, Shader, Stage},
    value::{Format, ParamKind},
    wgsl::{self, Scan},
};

/// Samplers that every shader may declare.
pub const SAMPLERS: [&str; 3] = ["linear_sampler", "linear_repeat_sampler", NEAREST_SAMPLER];
/// The uniform whose members are parameters.
pub const PARAMS: &str = "params";

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

    fn global_span(&self, global: &Global) -> Span {
        Span::new(self.wgsl(), global.span.clone())
    }

    fn has_step(&self, test: impl Fn(&Repeat) -> bool) -> bool {
        self.decl.steps.iter().any(|s| matches!(s, Step::Compute { repeat: Some(r), .. } if test(r)))
    }

    /// Checks entry points; returns those that steps use. `None` when a step names none that exists.
    fn steps(&mut self) -> Option<BTreeSet<String>> {
        let mut reached = BTreeSet::new();
        let mut complete = true;
        for step in &self.decl.steps {
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

    fn entry(&mut self, name: &str, stage: Stage, span: &Span) -> Option<Entry> {
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
                    Diagnostic::error(format!("`{name}` is a {} entry point, and this step needs a {} one", word(entry.stage), word(stage)), place)
                        .and(there, "declared here")
                        .help(format!("mark it `@{}`", word(stage))),
                );
                None
            }
            None => {
                let known = self.shader.entries.iter().filter(|e| e.stage == stage).map(|e| e.name.as_str());
                let fault = Diagnostic::error(format!("the shader has no {} entry point `{name}`", word(stage)), place).help(suggest(name, known));
                self.out.push(fault);
                None
            }
        }
    }

    fn targets(&mut self, entry: &Entry, targets: &[String], span: &Span) {
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
                Diagnostic::error(format!("the step has {} targets, and `{}` writes {} locations", targets.len(), entry.name, kinds.len()), within(span, "targets"))
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

    /// Every global must be a port, a sampler or `params`.
    fn globals(&mut self) {
        for global in &self.shader.globals {
            let name = global.name.as_str();
            if global.group > 3 {
                let fault = Diagnostic::error(format!("`{name}` is in group {}, and there are groups 0 to 3", global.group), self.global_span(global));
                self.out.push(fault.help("use a smaller `@group`"));
            }
            if name == PARAMS {
                self.params(global);
            } else if SAMPLERS.contains(&name) {
                if global.kind != GlobalKind::Sampler {
                    let fault = Diagnostic::error(format!("`{name}` is the name of a sampler"), self.global_span(global));
                    self.out.push(fault.help(format!("write `var {name}: sampler;`, or rename it")));
                }
            } else if let Some(port) = self.decl.ports.get(name) {
                self.port(global, port);
            } else if let Some((base, port, finer)) = self.neighbour(name) {
                self.neighbour_level(global, &base, port, finer);
            } else {
                let known = self.decl.ports.keys().map(String::as_str).chain(SAMPLERS).chain([PARAMS]);
                let help = suggest(name, known);
                self.out.push(
                    Diagnostic::error(format!("`{name}` is no port of this node"), self.global_span(global))
                        .and(self.decl.span.clone(), "the node's declaration")
                        .help(and_also(help, &format!("Globals are bound by name: ports, `params`, and the samplers {}", SAMPLERS.join(", ")))),
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
            let fault = Diagnostic::error(format!("`{}` exists only in a step with `repeat: {form}(\"{base}\")`", global.name), self.global_span(global));
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
                Diagnostic::error(format!("`{}` does not fit its port: {problem}", global.name), self.global_span(global))
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

    /// Every port must be used, and outputs must be written.
    fn ports(&mut self, reached: &Option<BTreeSet<String>>) {
        for (name, port) in &self.decl.ports {
            if self.drawn(name) {
                continue;
            }
            let Some(index) = self.shader.globals.iter().position(|g| g.name == *name) else {
                // A misspelt global is already reported with this port as the suggestion.
                let candidates = self.shader.globals.iter().filter(|g| !self.known_global(&g.name)).map(|g| g.name.as_str());
                if crate::render::nearest(name, candidates).is_some() {
                    continue;
                }
                if self.unsettled && port.direction == Direction::Output {
                    continue;
                }
                let help = expected_wgsl(name, port, false);
                self.out.push(Diagnostic::error(format!("the shader does not use the port `{name}`"), port.span.clone()).help(format!("{help}, or remove the port")));
                continue;
            };
            let Some(reached) = reached else { continue };
            let mut used = false;
            let mut access = Access::default();
            for entry in self.shader.entries.iter().filter(|e| reached.contains(&e.name)) {
                for (_, one) in entry.uses.iter().filter(|(g, _)| *g == index) {
                    used = true;
                    access.read |= one.read;
                    access.write |= one.write;
                }
            }
            let place = self.global_span(&self.shader.globals[index]);
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

    /// The uniform `params`: each member is a parameter.
    fn params(&mut self, global: &Global) {
        let GlobalKind::Uniform { element, .. } = &global.kind else {
            let fault = Diagnostic::error("`params` is the uniform of the node's parameters", self.global_span(global));
            self.out.push(fault.help("write `var<uniform> params: Params;`, or rename it"));
            return;
        };
        let Some(layout) = self.shader.layouts.get(element) else { return };
        for member in &layout.members {
            let range = wgsl::member(&self.wgsl().text, element, &member.name);
            let place = range.map_or_else(|| self.global_span(global), |r| Span::new(self.wgsl(), r));
            let Some(param) = self.decl.params.get(&member.name) else {
                let help = suggest(&member.name, self.decl.params.keys().map(String::as_str));
                self.out.push(
                    Diagnostic::error(format!("`{}` is no parameter of this node", member.name), place)
                        .and(self.decl.span.clone(), "the node's declaration")
                        .help(help),
                );
                continue;
            };
            let scalar = match member.kind {
                MemberKind::Numeric { scalar, rows: 1, columns: 1, .. } => Some(scalar),
                _ => None,
            };
            let (fits, wanted) = match param.kind {
                ParamKind::Int { .. } => (matches!(scalar, Some(Scalar::I32 | Scalar::U32)), "i32 or u32"),
                ParamKind::Float { .. } => (scalar == Some(Scalar::F32), "f32"),
                ParamKind::Bool { .. } => (scalar == Some(Scalar::U32), "u32 (0 or 1)"),
                ParamKind::Choice { .. } => (scalar == Some(Scalar::U32), "u32 (the index of the option)"),
            };
            if !fits {
                self.out.push(
                    Diagnostic::error(format!("`{}` has the wrong type for a parameter of type {}", member.name, param.kind.type_name()), place)
                        .and(param.span.clone(), "the parameter")
                        .help(format!("declare it as {wanted}")),
                );
            } else if scalar == Some(Scalar::U32) {
                self.check_sign(param, &member.name, place);
            }
        }
    }

    fn check_sign(&mut self, param: &Param, name: &str, place: Span) {
        if let ParamKind::Int { min, .. } = param.kind
            && min < 0
        {
            let fault = Diagnostic::error(format!("`{name}` can be negative, and u32 cannot"), place);
            self.out.push(fault.and(param.span.clone(), format!("it starts at {min}")).help("declare it as i32"));
        }
    }

    fn overrides(&mut self) {
        for (name, scalar) in &self.shader.overrides {
            let place = self.item_span("override", name);
            if let Some(param) = self.decl.params.get(name) {
                let (fits, wanted) = match param.kind {
                    ParamKind::Int { .. } => (matches!(scalar, Scalar::I32 | Scalar::U32), "i32 or u32"),
                    ParamKind::Float { .. } => (*scalar == Scalar::F32, "f32"),
                    ParamKind::Bool { .. } => (matches!(scalar, Scalar::Bool | Scalar::U32), "bool"),
                    ParamKind::Choice { .. } => (*scalar == Scalar::U32, "u32 (the index of the option)"),
                };
                if !fits {
                    self.out.push(
                        Diagnostic::error(format!("the override `{name}` has the wrong type for a parameter of type {}", param.kind.type_name()), place)
                            .and(param.span.clone(), "the parameter")
                            .help(format!("declare it as {wanted}")),
                    );
                } else if *scalar == Scalar::U32 {
                    self.check_sign(param, name, place);
                }
                continue;
            }
            match self.option_of(name) {
                Some((_, options, option)) if options.iter().any(|o| o == option) => {
                    if *scalar != Scalar::Bool {
                        let fault = Diagnostic::error(format!("the override `{name}` tests an option and must be bool"), place);
                        self.out.push(fault.help(format!("write `override {name}: bool = false;`")));
                    }
                }
                Some((param, options, option)) => {
                    let help = suggest(option, options.iter().map(String::as_str));
                    self.out.push(
                        Diagnostic::error(format!("the override `{name}` tests an option `{option}` that does not exist"), place)
                            .and(param.span.clone(), "the parameter")
                            .help(help),
                    );
                }
                None => {
                    let help = suggest(name, self.decl.params.keys().map(String::as_str));
                    self.out.push(
                        Diagnostic::error(format!("the override `{name}` is no parameter of this node"), place)
                            .and(self.decl.span.clone(), "the node's declaration")
                            .help(help),
                    );
                }
            }
        }
    }

    /// `flux_is_sum` is the option `sum` of the choice `flux`.
    fn option_of<'n>(&self, name: &'n str) -> Option<(&Param, &[String], &'n str)> {
        name.match_indices("_is_").find_map(|(at, mark)| {
            let param = self.decl.params.get(&name[..at])?;
            match &param.kind {
                ParamKind::Choice { options, .. } => Some((param, options.as_slice(), &name[at + mark.len()..])),
                _ => None,
            }
        })
    }

    fn unused_params(&mut self) {
        let uniform = self.shader.globals.iter().find(|g| g.name == PARAMS).and_then(|g| match &g.kind {
            GlobalKind::Uniform { element, .. } => self.shader.layouts.get(element),
            _ => None,
        });
        let mut used: BTreeSet<&str> = uniform.iter().flat_map(|l| l.members.iter().map(|m| m.name.as_str())).collect();
        for (name, _) in &self.shader.overrides {
            used.insert(name);
            if let Some((param, ..)) = self.option_of(name)
                && let Some((name, _)) = self.decl.params.iter().find(|(_, p)| std::ptr::eq(*p, param))
            {
                used.insert(name);
            }
        }
        let mut in_steps = BTreeSet::new();
        self.decl.steps.iter().for_each(|s| step_params(s, &mut in_steps));
        for (name, param) in &self.decl.params {
            if used.contains(name.as_str()) || in_steps.contains(name.as_str()) {
                continue;
            }
            // A misspelt member or override is reported with this parameter as the suggestion.
            let strangers = used.iter().copied().filter(|u| !self.decl.params.contains_key(*u));
            if crate::render::nearest(name, strangers).is_some() {
                continue;
            }
            self.out.push(
                Diagnostic::error(format!("nothing uses the parameter `{name}`"), param.span.clone())
                    .help("add it to the members of `params`, to the overrides or to a step, or remove it"),
            );
        }
    }

    fn item_span(&self, keyword: &str, name: &str) -> Span {
        let range = self.scan.item(keyword, name).map_or(0..0, |i| i.range.clone());
        Span::new(self.wgsl(), range)
    }
}

fn step_params(step: &Step, found: &mut BTreeSet<String>) {
    use crate::registry::Expr;
    fn walk(expr: &Expr, found: &mut BTreeSet<String>) {
        match expr {
            Expr::Param(name) => {
                found.insert(name.clone());
            }
            Expr::Mul(list) | Expr::Add(list) | Expr::Min(list) | Expr::Max(list) => list.iter().for_each(|e| walk(e, found)),
            Expr::DivCeil(a, b) => {
                walk(a, found);
                walk(b, found);
            }
            Expr::NextPowerOfTwo(a) => walk(a, found),
            _ => {}
        }
    }
    match step {
        Step::Compute { over, repeat, .. } => {
            if let Over::Threads(x, y, z) | Over::Groups(x, y, z) = over {
                [x, y, z].into_iter().for_each(|e| walk(e, found));
            }
            if let Some(Repeat::Times(count)) = repeat {
                walk(count, found);
            }
        }
        Step::Draw { vertices, .. } => walk(vertices, found),
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

/// Why a global cannot be the port, if it cannot.
fn mismatch(global: &Global, port: &Port, drawn: bool, requires: &[String]) -> Option<String> {
    let input = port.direction == Direction::Input;
    match (&port.kind, &global.kind) {
        (PortKind::Texture { .. }, _) if drawn && !input => Some("it is a draw target, and targets have no global".into()),
        (PortKind::Texture { format, array }, GlobalKind::Texture { sample, array: is_array, filtered }) if input => {
            if array != is_array {
                return Some(if *array { "the port is an array" } else { "the port is no array" }.into());
            }
            let fits = match format.map(Format::sample_kind) {
                None => matches!(sample, SampleKind::Float),
                Some(SampleKind::Depth) => matches!(sample, SampleKind::Depth) || (matches!(sample, SampleKind::Float) && !filtered),
                Some(kind) => kind == *sample,
            };
            if !fits {
                return Some(match format {
                    Some(format) => format!("{format} does not read as {}", kind_word(*sample)),
                    None => format!("the port reads as float, not as {}", kind_word(*sample)),
                });
            }
            let feature = requires.iter().any(|r| r == "FLOAT32_FILTERABLE");
            if *filtered && format.is_some_and(Format::is_float32) && !feature {
                return Some("it is sampled with a filter, which 32-bit floats allow only with `requires: [\"FLOAT32_FILTERABLE\"]`".into());
            }
            None
        }
        (PortKind::Texture { .. }, GlobalKind::StorageTexture { .. }) if input => Some("an input is not written".into()),
        (PortKind::Texture { .. }, GlobalKind::Texture { .. }) => Some("an output is written".into()),
        (PortKind::Texture { format, array }, GlobalKind::StorageTexture { format: written, array: is_array, access }) => {
            if let Some(format) = format
                && format != written
            {
                return Some(format!("the port has the format {format}, the shader {written}"));
            }
            if array != is_array {
                return Some(if *array { "the port is an array" } else { "the port is no array" }.into());
            }
            if !access.write {
                return Some("an output is written".into());
            }
            let both_ways = matches!(written, Format::R32Float | Format::R32Uint);
            let feature = requires.iter().any(|r| r == "TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES");
            if access.read && !both_ways && !feature {
                return Some(format!("{written} cannot be read and written in place; only r32float and r32uint can"));
            }
            None
        }
        (PortKind::Buffer { of }, GlobalKind::Storage { element, access, .. }) => {
            if of != element {
                return Some(format!("the port is of `{of}`, the shader of `{element}`"));
            }
            match (input, access.write) {
                (true, true) => Some("an input is not written".into()),
                (false, false) => Some("an output is written".into()),
                _ => None,
            }
        }
        (PortKind::Uniform { of }, GlobalKind::Uniform { element, .. }) if of == element => None,
        (PortKind::Uniform { of }, GlobalKind::Uniform { element, .. }) => Some(format!("the port is of `{of}`, the shader of `{element}`")),
        (PortKind::Texture { .. }, _) => Some("the port is a texture".into()),
        (PortKind::Buffer { .. }, _) => Some("the port is a storage buffer".into()),
        (PortKind::Uniform { .. }, _) => Some("the port is a uniform".into()),
    }
}

/// The declaration that the shader should have for a port.
fn expected_wgsl(name: &str, port: &Port, drawn: bool) -> String {
    let input = port.direction == Direction::Input;
    let declaration = match &port.kind {
        PortKind::Texture { .. } if drawn && !input => return "remove the global: the fragment shader returns the value".into(),
        PortKind::Texture { format, array } if input => {
            let suffix = if *array { "_array" } else { "" };
            match format.map_or(SampleKind::Float, Format::sample_kind) {
                SampleKind::Depth => format!("var {name}: texture_depth_2d{suffix};"),
                SampleKind::Uint => format!("var {name}: texture_2d{suffix}<u32>;"),
                _ => format!("var {name}: texture_2d{suffix}<f32>;"),
            }
        }
        PortKind::Texture { format, array } => {
            let suffix = if *array { "_array" } else { "" };
            let format = format.map_or_else(|| "FORMAT".to_owned(), |f| f.name().to_lowercase());
            format!("var {name}: texture_storage_2d{suffix}<{format}, write>;")
        }
        PortKind::Buffer { of } => format!("var<storage, {}> {name}: array<{of}>;", if input { "read" } else { "read_write" }),
        PortKind::Uniform { of } => format!("var<uniform> {name}: {of};"),
    };
    format!("write `@group(…) @binding(…) {declaration}`")
}
