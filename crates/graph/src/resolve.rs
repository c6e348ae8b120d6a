//! Links a pipeline with the registry: which declaration, resource and parameter every name means.
//! What is found wrong here is wrong whatever the parameters and the scene are.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use indexmap::IndexMap;

use crate::{
    condition::Condition,
    diagnostics::{Diagnostic, Span},
    fit,
    pipeline::{Connection, Mips, NodeUse, Pipeline, ResourceKind},
    quality,
    registry::{Direction, NodeDecl, Port, Registry, Repeat, Step},
    render::{nearest, suggest},
    value::Value,
};

/// A pipeline whose names are resolved.
pub(crate) struct Linked<'a> {
    pub pipeline: &'a Pipeline,
    pub registry: &'a Registry,
    /// In document order.
    pub nodes: Vec<LinkedNode<'a>>,
    /// Names of the conditions that can be decided, each after those that it names.
    pub conditions: Vec<&'a str>,
    /// Some node's ports are unknown, so anything may have been written by it.
    pub incomplete: bool,
    /// Resources whose connections are faulty: nothing more is said of them.
    pub tainted: BTreeSet<String>,
    /// Some refusal cannot be decided: what it refuses may be faulty.
    pub refusals_unclear: bool,
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
    /// Nothing, which is a fault while the port is used.
    Missing,
    /// Its fault is reported.
    Faulty,
    External(&'a str),
    Resource {
        name: &'a str,
        previous: bool,
        span: &'a Span,
    },
}

/// Where a node's parameter gets its value.
#[derive(Debug, Clone)]
pub(crate) enum ParamSource<'a> {
    Fixed(Value),
    Pipeline(&'a str),
    Default,
    If(&'a Condition, Box<ParamSource<'a>>, Box<ParamSource<'a>>),
}

impl<'a> LinkedNode<'a> {
    /// Ports with their names and wires.
    pub fn ports(&self) -> impl Iterator<Item = (&'a str, &'a Port, Wire<'a>)> + '_ {
        let ports = self.decl.map(|d| d.ports.iter()).into_iter().flatten();
        ports.zip(&self.wires).map(|((name, port), wire)| (name.as_str(), port, *wire))
    }
}

mod conditions;
mod params;
mod resources;
mod whole;

pub(crate) use params::settable;
pub(crate) use whole::preset_fault;

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
    /// Conditions with names, once they are looked at: whether they can be decided.
    decided: BTreeMap<&'a str, bool>,
    out: &'o mut Vec<Diagnostic>,
}

/// Resolves all names. `features` are those that conditions may test.
pub(crate) fn link<'a>(pipeline: &'a Pipeline, registry: &'a Registry, features: Vec<&str>, out: &mut Vec<Diagnostic>) -> Linked<'a> {
    let mut linker = Linker {
        pipeline,
        registry,
        features,
        incomplete: false,
        tainted: BTreeSet::new(),
        mistyped: BTreeSet::new(),
        undecided: false,
        decided: BTreeMap::new(),
        out,
    };
    linker.incomplete = pipeline.gaps.nodes || pipeline.gaps.files;
    linker.tainted.extend(pipeline.gaps.resources.iter().cloned());
    linker.resources();
    let conditions = linker.conditions();
    let nodes: Vec<_> = pipeline.nodes.values().map(|node| linker.node(node)).collect();
    linker.presets(&nodes);
    let refusals_unclear = linker.refusals();
    linker.out.extend(quality::faults(pipeline));
    linker.never_written(&nodes);
    linker.shown();
    let Linker { incomplete, tainted, .. } = linker;
    Linked { pipeline, registry, nodes, conditions, incomplete, tainted, refusals_unclear }
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
            self.tainted.extend(
                written.filter_map(|(_, _, wire)| if let Wire::Resource { name, .. } = wire { Some(name.to_owned()) } else { None }),
            );
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
        let misnamed =
            |given: &IndexMap<String, Connection>| given.keys().any(|n| decl.ports.get(n).is_none_or(|p| p.direction != port.direction));
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
            if matches!(&resource.kind, ResourceKind::Texture { mips: Mips::One, .. }) && repeats_over(decl, name) {
                let fault = Diagnostic::warning(
                    format!("`{}` works on the mip levels of `{target}`, which has only one", usage.id.text),
                    span.clone(),
                );
                self.push(fault.and(resource.span.clone(), "the resource").help("add `mips: Full` to the resource"));
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
                let fault = Diagnostic::error(
                    format!("`{target}` does not fit the input `{name}` of `{}`: {problem}", usage.id.text),
                    span.clone(),
                );
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
        if port.when.is_some() {
            return Wire::Missing;
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
                let fault = Diagnostic::error(
                    format!("`{}` writes `{name}` through `{other}` and `{port_name}`", node.usage.id.text),
                    span.clone(),
                );
                self.out.push(fault.help("give each output a resource of its own"));
            }
        }
    }
}

/// Whether a step of the node runs once for each mip level of the port.
fn repeats_over(decl: &NodeDecl, port: &str) -> bool {
    decl.steps.iter().any(|s| matches!(s, Step::Compute { repeat: Some(Repeat::Down(p) | Repeat::Up(p)), .. } if p == port))
}
