//! Links a pipeline with the registry: which declaration, resource and parameter every name means.
//! What is found wrong here is wrong whatever the parameters and the scene are.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use indexmap::IndexMap;

use crate::{
    condition::ConditionKind,
    diagnostics::{Diagnostic, Span},
    expr::{ExprAt, RefKind},
    fit,
    pipeline::{ArgumentValue, Connection, Mips, NodeUse, Pipeline, ResourceKind, Size},
    reader::Spanned,
    registry::{Direction, NodeDecl, Port, PortKind, Registry},
    render::{nearest, suggest},
    value::{ParamKind, Value},
};

/// A pipeline whose names are resolved.
pub(crate) struct Linked<'a> {
    pub pipeline: &'a Pipeline,
    pub registry: &'a Registry,
    /// In document order.
    pub nodes: Vec<LinkedNode<'a>>,
    /// Some node's ports are unknown, so anything may have been written by it.
    pub incomplete: bool,
    /// Resources whose connections are faulty: nothing more is said of them.
    pub tainted: BTreeSet<String>,
}

/// A node with its declaration.
pub(crate) struct LinkedNode<'a> {
    pub usage: &'a NodeUse,
    /// `None` when its name is unknown or its declaration is faulty.
    pub decl: Option<&'a Arc<NodeDecl>>,
    /// In the order of the declaration.
    pub wires: Vec<Wire<'a>>,
    /// Parameters in the order of the declaration.
    pub params: Vec<(&'a str, ParamSource<'a>)>,
}

/// What a port is wired to.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Wire<'a> {
    Absent,
    /// Its fault is reported.
    Faulty,
    External(&'a str),
    Resource { name: &'a str, previous: bool, span: &'a Span },
}

/// Where a node's parameter gets its value.
#[derive(Debug, Clone)]
pub(crate) enum ParamSource<'a> {
    Fixed(Value),
    Pipeline(&'a str),
    Default,
}

impl<'a> LinkedNode<'a> {
    /// Ports with their names and wires.
    pub fn ports(&self) -> impl Iterator<Item = (&'a str, &'a Port, Wire<'a>)> + '_ {
        let ports = self.decl.map(|d| d.ports.iter()).into_iter().flatten();
        ports.zip(&self.wires).map(|((name, port), wire)| (name.as_str(), port, *wire))
    }
}

struct Linker<'a, 'o> {
    pipeline: &'a Pipeline,
    registry: &'a Registry,
    features: Vec<&'o str>,
    incomplete: bool,
    tainted: BTreeSet<String>,
    /// Resources whose own type is faulty: they fit nothing.
    mistyped: BTreeSet<String>,
    /// Something that the condition at hand names is not known.
    undecided: bool,
    out: &'o mut Vec<Diagnostic>,
}

/// Resolves all names. `features` are those that conditions may test.
pub(crate) fn link<'a>(pipeline: &'a Pipeline, registry: &'a Registry, features: Vec<&str>, out: &mut Vec<Diagnostic>) -> Linked<'a> {
    let mut linker = Linker { pipeline, registry, features, incomplete: false, tainted: BTreeSet::new(), mistyped: BTreeSet::new(), undecided: false, out };
    linker.incomplete = pipeline.gaps.nodes || pipeline.gaps.files;
    linker.tainted.extend(pipeline.gaps.resources.iter().cloned());
    linker.resources();
    let nodes: Vec<_> = pipeline.nodes.values().map(|node| linker.node(node)).collect();
    linker.presets(&nodes);
    linker.never_written(&nodes);
    linker.shown();
    let Linker { incomplete, tainted, .. } = linker;
    Linked { pipeline, registry, nodes, incomplete, tainted }
}

impl<'a> Linker<'a, '_> {
    fn push(&mut self, fault: Diagnostic) {
        self.out.push(fault);
    }

    fn readable_names(&self) -> Vec<&'a str> {
        self.pipeline.resources.keys().chain(self.registry.externals.keys()).map(String::as_str).collect()
    }

    fn unknown_param(&mut self, name: &str, span: &Span) {
        self.undecided = true;
        if self.pipeline.gaps.files || self.pipeline.gaps.params.contains(name) {
            return;
        }
        let help = suggest(name, self.pipeline.params.keys().map(String::as_str));
        self.push(Diagnostic::error(format!("the pipeline has no parameter `{name}`"), span.clone()).help(help));
    }

    fn unknown_resource(&mut self, name: &str, span: &Span, known: Vec<&str>) {
        if self.pipeline.gaps.files || self.pipeline.gaps.resources.contains(name) {
            return;
        }
        // What was meant may now look unwritten.
        if let Some(meant) = nearest(name, known.iter().copied()) {
            self.tainted.insert(meant.to_owned());
        }
        self.push(Diagnostic::error(format!("there is no resource `{name}`"), span.clone()).help(suggest(name, known)));
    }

    // ---- resources ----

    fn resources(&mut self) {
        let mut needs: BTreeMap<&'a str, Vec<&'a Spanned>> = BTreeMap::new();
        for (name, resource) in &self.pipeline.resources {
            if self.registry.externals.contains_key(name) {
                let fault = Diagnostic::error(format!("`{name}` is the name of scene data"), resource.span.clone());
                self.push(fault.help("rename the resource"));
                self.mistyped.insert(name.clone());
                self.tainted.insert(name.clone());
            }
            let mut exprs: Vec<&'a ExprAt> = Vec::new();
            let mut like = None;
            match &resource.kind {
                ResourceKind::Texture { size, mips, .. } => {
                    match size {
                        Size::Exact(w, h) => exprs.extend([&**w, &**h]),
                        Size::Like(other) => like = Some(other),
                        Size::Output | Size::OutputScaled(..) => {}
                    }
                    if let Mips::Count(count) = mips {
                        exprs.push(count);
                    }
                }
                ResourceKind::Buffer { of, count } => {
                    exprs.push(count);
                    if self.registry.layout(of).is_none() && self.registry.faulty.is_empty() {
                        let known = self.registry.types.keys().map(String::as_str).chain(["u32", "i32", "f32", "vec2f", "vec4f", "vec4u"]);
                        let help = suggest(of, known);
                        self.mistyped.insert(name.clone());
                        self.push(Diagnostic::error(format!("no shader of a node has the type `{of}`"), resource.span.clone()).help(help));
                    }
                }
            }
            let mut needed = Vec::new();
            if let Some(other) = like
                && self.size_ref(other, RefKind::Texture)
            {
                needed.push(other);
            }
            for r in exprs.iter().flat_map(|e| &e.refs) {
                if r.kind == RefKind::Param {
                    self.int_param(&r.name);
                } else if self.size_ref(&r.name, r.kind) {
                    needed.push(&r.name);
                }
            }
            needs.insert(name, needed);
        }
        self.size_cycles(&needs);
    }

    fn int_param(&mut self, name: &Spanned) {
        match self.pipeline.params.get(&name.text) {
            Some(param) if matches!(param.kind, ParamKind::Int { .. }) => {}
            Some(param) => {
                let fault = Diagnostic::error(format!("parameter `{}` is {}, and sizes need Int", name.text, param.kind.type_name()), name.span.clone());
                self.push(fault.and(param.span.clone(), "declared here").help("use a parameter of whole numbers"));
            }
            None => self.unknown_param(&name.text, &name.span),
        }
    }

    /// Whether a resource named in a size exists and is of the right kind; true only for the pipeline's own.
    fn size_ref(&mut self, name: &Spanned, kind: RefKind) -> bool {
        let texture = match (self.pipeline.resources.get(&name.text), self.registry.externals.get(&name.text)) {
            (Some(resource), _) => matches!(resource.kind, ResourceKind::Texture { .. }),
            (None, Some(external)) => matches!(external.kind, PortKind::Texture { .. }),
            (None, None) => {
                self.unknown_resource(&name.text, &name.span, self.readable_names());
                return false;
            }
        };
        if texture != (kind == RefKind::Texture) {
            let (is, form) = if texture { ("texture", "Width and Height") } else { ("buffer", "Elements") };
            let fault = Diagnostic::error(format!("`{}` is a {is}", name.text), name.span.clone());
            self.push(fault.help(format!("sizes of a {is} are asked for with {form}")));
            return false;
        }
        self.pipeline.resources.contains_key(&name.text)
    }

    fn size_cycles(&mut self, needs: &BTreeMap<&'a str, Vec<&'a Spanned>>) {
        let mut reported: BTreeSet<&str> = BTreeSet::new();
        for start in self.pipeline.resources.keys() {
            let mut path: Vec<&Spanned> = Vec::new();
            if !reported.contains(start.as_str()) && walk(start, start, needs, &mut path, &mut BTreeSet::new()) {
                let names: Vec<&str> = std::iter::once(start.as_str()).chain(path.iter().map(|s| s.text.as_str())).collect();
                reported.extend(path.iter().map(|s| s.text.as_str()));
                let fault = Diagnostic::error(format!("the size of `{start}` depends on itself: {}", names.join(" → ")), path[0].span.clone());
                self.tainted.extend(names.iter().map(|n| (*n).to_owned()));
                self.push(fault.help("give one of them a size of its own"));
            }
        }
    }

    // ---- nodes ----

    fn node(&mut self, usage: &'a NodeUse) -> LinkedNode<'a> {
        let before = self.out.len();
        self.undecided = usage.broken;
        if let Some(when) = &usage.when {
            self.condition(when);
        }
        let undecided = self.undecided || self.out.len() > before;
        let name = &usage.node.text;
        let Some(decl) = self.registry.nodes.get(name) else {
            if !self.registry.faulty.contains(name) {
                let help = suggest(name, self.registry.nodes.keys().map(String::as_str));
                self.push(Diagnostic::error(format!("there is no node `{name}`"), usage.node.span.clone()).help(help));
            }
            self.incomplete = true;
            return LinkedNode { usage, decl: None, wires: Vec::new(), params: Vec::new() };
        };
        self.unknown_ports(usage, decl);
        let wires = decl.ports.iter().map(|(name, port)| self.wire(usage, decl, name, port)).collect();
        let params = self.arguments(usage, decl);
        let linked = LinkedNode { usage, decl: Some(decl), wires, params };
        self.written_twice(&linked);
        // It may have been meant to write anything.
        self.incomplete |= linked.ports().any(|(_, port, wire)| port.direction == Direction::Output && matches!(wire, Wire::Faulty));
        if undecided {
            // Whether it runs is unknown, so nothing is said of what it writes.
            let written = linked.ports().filter(|(_, port, _)| port.direction == Direction::Output);
            self.tainted.extend(written.filter_map(|(_, _, wire)| if let Wire::Resource { name, .. } = wire { Some(name.to_owned()) } else { None }));
        }
        linked
    }

    fn unknown_ports(&mut self, usage: &'a NodeUse, decl: &NodeDecl) {
        for (given, direction) in [(&usage.inputs, Direction::Input), (&usage.outputs, Direction::Output)] {
            let (here, there) = if direction == Direction::Input { ("input", "out") } else { ("output", "in") };
            for (name, connection) in given {
                match decl.ports.get(name) {
                    Some(port) if port.direction == direction => {}
                    Some(port) => {
                        let other = if direction == Direction::Input { "an output" } else { "an input" };
                        self.tainted.insert(connection.resource.text.clone());
                        let fault = Diagnostic::error(format!("`{name}` is {other} of `{}`", decl.name), connection.port_span.clone());
                        self.push(fault.and(port.span.clone(), "declared here").help(format!("move it to `{there}`")));
                    }
                    None => {
                        self.tainted.insert(connection.resource.text.clone());
                        let known = decl.ports.iter().filter(|(_, p)| p.direction == direction).map(|(n, _)| n.as_str());
                        let fault = Diagnostic::error(format!("`{}` has no {here} `{name}`", decl.name), connection.port_span.clone());
                        self.push(fault.help(suggest(name, known)));
                    }
                }
            }
        }
    }

    fn wire(&mut self, usage: &'a NodeUse, decl: &'a NodeDecl, name: &'a str, port: &'a Port) -> Wire<'a> {
        let input = port.direction == Direction::Input;
        let given = if input { usage.inputs.get(name) } else { usage.outputs.get(name) };
        let misnamed = |given: &IndexMap<String, Connection>| given.keys().any(|n| decl.ports.get(n).is_none_or(|p| p.direction != port.direction));
        if given.is_none() && usage.broken {
            self.tainted.insert(name.to_owned());
            return if port.optional { Wire::Absent } else { Wire::Faulty };
        }
        if given.is_none() && misnamed(if input { &usage.inputs } else { &usage.outputs }) {
            // Perhaps this port was meant.
            self.tainted.insert(name.to_owned());
            return if port.optional { Wire::Absent } else { Wire::Faulty };
        }
        let (target, span, previous) = match given {
            Some(Connection { resource, previous, .. }) => (resource.text.as_str(), &resource.span, *previous),
            None => (name, &usage.id.span, false),
        };
        if let Some((target, resource)) = self.pipeline.resources.get_key_value(target) {
            if previous && !resource.history {
                let fault = Diagnostic::error(format!("`{target}` is not kept from frame to frame"), span.clone());
                self.push(fault.and(resource.span.clone(), "declared here").help("add `history: true` to the resource"));
            }
            if !self.mistyped.contains(target)
                && let Some(problem) = fit::resource(port, resource, decl, name)
            {
                self.unfit(usage, name, port, target, span, &resource.span, &problem);
                self.tainted.insert(target.clone());
            }
            return Wire::Resource { name: target, previous, span };
        }
        if let Some((target, external)) = self.registry.externals.get_key_value(target) {
            if !input {
                if given.is_none() {
                    return self.unconnected(usage, name, port);
                }
                let fault = Diagnostic::error(format!("`{target}` is scene data and cannot be written"), span.clone());
                self.push(fault.help("write a resource of the pipeline"));
                return Wire::Faulty;
            }
            if previous {
                let fault = Diagnostic::error(format!("`{target}` is scene data and has no last frame's value"), span.clone());
                self.push(fault.help(format!("write \"{target}\"")));
            }
            if let Some(problem) = fit::external(port, &external.kind, decl, name) {
                let fault = Diagnostic::error(format!("`{target}` does not fit the input `{name}` of `{}`: {problem}", usage.id.text), span.clone());
                self.push(fault.and(port.span.clone(), "the port"));
            }
            return Wire::External(target);
        }
        match given {
            None => self.unconnected(usage, name, port),
            Some(connection) => {
                let known = if input { self.readable_names() } else { self.pipeline.resources.keys().map(String::as_str).collect() };
                self.unknown_resource(target, &connection.resource.span, known);
                Wire::Faulty
            }
        }
    }

    fn unconnected(&mut self, usage: &'a NodeUse, name: &str, port: &'a Port) -> Wire<'a> {
        if port.optional {
            return Wire::Absent;
        }
        if self.pipeline.gaps.files || self.pipeline.gaps.resources.contains(name) {
            return Wire::Faulty;
        }
        let (word, field) = if port.direction == Direction::Input { ("input", "in") } else { ("output", "out") };
        self.push(
            Diagnostic::error(format!("the {word} `{name}` of `{}` is not connected", usage.id.text), usage.id.span.clone())
                .and(port.span.clone(), "the port")
                .help(format!("add `\"{name}\": \"resource\"` to `{field}`, or declare a resource `{name}`")),
        );
        Wire::Faulty
    }

    #[allow(clippy::too_many_arguments)]
    fn unfit(&mut self, usage: &NodeUse, name: &str, port: &Port, target: &str, span: &Span, resource: &Span, problem: &str) {
        let word = if port.direction == Direction::Input { "input" } else { "output" };
        self.push(
            Diagnostic::error(format!("`{target}` does not fit the {word} `{name}` of `{}`: {problem}", usage.id.text), span.clone())
                .and(resource.clone(), "the resource")
                .and(port.span.clone(), "the port")
                .help("change the resource, or connect another one"),
        );
    }

    fn written_twice(&mut self, node: &LinkedNode<'a>) {
        let mut seen: BTreeMap<&str, &str> = BTreeMap::new();
        for (port_name, port, wire) in node.ports() {
            if let (Direction::Output, Wire::Resource { name, span, .. }) = (port.direction, wire)
                && let Some(other) = seen.insert(name, port_name)
            {
                let fault = Diagnostic::error(format!("`{}` writes `{name}` through `{other}` and `{port_name}`", node.usage.id.text), span.clone());
                self.out.push(fault.help("give each output a resource of its own"));
            }
        }
    }

    fn arguments(&mut self, usage: &'a NodeUse, decl: &'a NodeDecl) -> Vec<(&'a str, ParamSource<'a>)> {
        for (name, argument) in &usage.params {
            if !decl.params.contains_key(name) {
                let known = decl.params.keys().map(String::as_str);
                let fault = Diagnostic::error(format!("`{}` has no parameter `{name}`", decl.name), argument.name_span.clone());
                self.push(fault.help(suggest(name, known)));
            }
        }
        decl.params.iter().map(|(name, param)| (name.as_str(), self.argument(usage, name, param))).collect()
    }

    fn argument(&mut self, usage: &'a NodeUse, name: &str, param: &'a crate::registry::Param) -> ParamSource<'a> {
        let Some(argument) = usage.params.get(name) else {
            return match self.pipeline.params.get_key_value(name) {
                Some((name, own)) if own.kind.same_type(&param.kind) => {
                    if let Err(why) = own.kind.fits_into(&param.kind) {
                        self.push(
                            Diagnostic::error(format!("parameter `{name}` does not fit `{name}` of node `{}`: {why}", usage.id.text), own.span.clone())
                                .and(param.span.clone(), "the node's parameter")
                                .help("narrow the pipeline's parameter, or set the node's one in `params`"),
                        );
                    }
                    ParamSource::Pipeline(name)
                }
                _ => ParamSource::Default,
            };
        };
        match &argument.value {
            ArgumentValue::Literal(literal) => match param.kind.accept(literal) {
                Ok(value) => ParamSource::Fixed(value),
                Err(remedy) => {
                    self.push(
                        Diagnostic::error(format!("{literal} is no value of the parameter `{name}`"), argument.span.clone())
                            .and(param.span.clone(), "the parameter")
                            .help(remedy),
                    );
                    ParamSource::Default
                }
            },
            ArgumentValue::Param(own_name) => match self.pipeline.params.get_key_value(own_name) {
                Some((own_name, own)) => {
                    if let Err(why) = own.kind.fits_into(&param.kind) {
                        self.push(
                            Diagnostic::error(format!("parameter `{own_name}` does not fit `{name}` of node `{}`: {why}", usage.id.text), argument.span.clone())
                                .and(own.span.clone(), "the pipeline's parameter")
                                .and(param.span.clone(), "the node's parameter")
                                .help("change the range, the options or the type"),
                        );
                    }
                    ParamSource::Pipeline(own_name)
                }
                None => {
                    self.unknown_param(own_name, &argument.span);
                    ParamSource::Default
                }
            },
        }
    }

    // ---- conditions ----

    fn condition(&mut self, condition: &'a crate::condition::Condition) {
        let mut leaves = Vec::new();
        condition.leaves(&mut |leaf| leaves.push(leaf));
        for leaf in leaves {
            match &leaf.kind {
                ConditionKind::Feature(name) => {
                    if !self.features.contains(&name.text.as_str()) {
                        let help = suggest(&name.text, self.features.iter().copied());
                        self.push(Diagnostic::error(format!("there is no scene feature `{}`", name.text), name.span.clone()).help(help));
                    }
                }
                ConditionKind::Is(name, option) => {
                    if let Some(ParamKind::Choice { options, .. }) = self.condition_param(name, "Is", "Choice")
                        && !options.contains(&option.text)
                    {
                        let help = suggest(&option.text, options.iter().map(String::as_str));
                        self.push(Diagnostic::error(format!("`{}` has no option `{}`", name.text, option.text), option.span.clone()).help(help));
                    }
                }
                ConditionKind::IsOn(name) => {
                    self.condition_param(name, "IsOn", "Bool");
                }
                ConditionKind::AtLeast(name, _) => {
                    self.condition_param(name, "AtLeast", "number");
                }
                ConditionKind::Below(name, _) => {
                    self.condition_param(name, "Below", "number");
                }
                _ => {}
            }
        }
    }

    fn condition_param(&mut self, name: &Spanned, form: &str, wanted: &str) -> Option<&'a ParamKind> {
        let Some(param) = self.pipeline.params.get(&name.text) else {
            self.unknown_param(&name.text, &name.span);
            return None;
        };
        let kind = param.kind.type_name();
        if kind == wanted || (wanted == "number" && matches!(kind, "Int" | "Float")) {
            return Some(&param.kind);
        }
        let instead = match kind {
            "Choice" => "Is(\"parameter\", \"option\")",
            "Bool" => "IsOn(\"parameter\")",
            _ => "AtLeast(\"parameter\", n) or Below(\"parameter\", n)",
        };
        let fault = Diagnostic::error(format!("`{form}` tests a {wanted}, and `{}` is {kind}", name.text), name.span.clone());
        self.push(fault.and(param.span.clone(), "declared here").help(format!("write {instead}")));
        None
    }

    // ---- presets, presented resources, unwritten resources ----

    fn presets(&mut self, nodes: &[LinkedNode<'a>]) {
        for (name, preset) in &self.pipeline.set {
            if self.pipeline.gaps != crate::pipeline::Gaps::default() && settable(self.pipeline, nodes, name).is_err() {
                continue;
            }
            let kind = match self.settable(name, nodes) {
                Ok(Some(kind)) => kind,
                Ok(None) => continue,
                Err((message, help)) => {
                    self.push(Diagnostic::error(message, preset.name_span.clone()).help(help));
                    continue;
                }
            };
            if let Err(remedy) = kind.accept(&preset.value) {
                self.push(Diagnostic::error(format!("{} is no value of `{name}`", preset.shown()), preset.span.clone()).help(remedy));
            }
        }
    }

    fn settable(&self, name: &str, nodes: &[LinkedNode<'a>]) -> Result<Option<&'a ParamKind>, (String, String)> {
        settable(self.pipeline, nodes, name)
    }

    /// A resource that is read, but that no node writes under any condition.
    fn never_written(&mut self, nodes: &[LinkedNode<'a>]) {
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
                if written.contains(name) || port.optional || self.tainted.contains(name) || !said.insert(name) {
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
            if self.pipeline.resources.contains_key(&name.text) && !written.contains(name.text.as_str()) && self.tainted.insert(name.text.clone()) {
                let fault = Diagnostic::error(format!("no node writes `{}`", name.text), name.span.clone());
                self.push(fault.help(format!("add a node with `{}` in `out`", name.text)));
            }
        }
    }

    fn shown(&mut self) {
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

/// The parameter that `name` or `node.name` sets; `Ok(None)` when its node is faulty. Otherwise message and help.
pub(crate) fn settable<'a>(pipeline: &'a Pipeline, nodes: &[LinkedNode<'a>], name: &str) -> Result<Option<&'a ParamKind>, (String, String)> {
    let Some((id, param)) = name.split_once('.') else {
        return match pipeline.params.get(name) {
            Some(param) => Ok(Some(&param.kind)),
            None => {
                let known = pipeline.params.keys().map(String::as_str);
                Err((format!("the pipeline `{}` has no parameter `{name}`", pipeline.name), suggest(name, known)))
            }
        };
    };
    let Some(node) = nodes.iter().find(|n| n.usage.id.text == id) else {
        let known = pipeline.nodes.keys().map(String::as_str);
        return Err((format!("the pipeline `{}` has no node `{id}`", pipeline.name), suggest(id, known)));
    };
    let Some(decl) = node.decl else { return Ok(None) };
    match decl.params.get(param) {
        Some(param) => Ok(Some(&param.kind)),
        None => {
            let known = decl.params.keys().map(String::as_str);
            Err((format!("the node `{id}` ({}) has no parameter `{param}`", decl.name), suggest(param, known)))
        }
    }
}

/// Finds a way from `at` back to `start` through sizes that need each other.
fn walk<'a>(start: &str, at: &str, needs: &BTreeMap<&'a str, Vec<&'a Spanned>>, path: &mut Vec<&'a Spanned>, seen: &mut BTreeSet<&'a str>) -> bool {
    for next in needs.get(at).into_iter().flatten() {
        path.push(next);
        if next.text == start {
            return true;
        }
        if seen.insert(&next.text) && walk(start, &next.text, needs, path, seen) {
            return true;
        }
        path.pop();
    }
    false
}
