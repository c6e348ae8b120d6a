//! Reads a node's declaration: `Node(doc, inputs, outputs, params, requires, steps)`.

use std::{collections::BTreeSet, sync::Arc};

use indexmap::IndexMap;

use crate::{
    diagnostics::{Diagnostic, Source, Span},
    expr::{self, ExprAt, RefKind},
    features, format,
    params::{check_identifier, read_params},
    reader::{Reader, Shape, Spanned, head},
    registry::{Direction, Expr, NodeDecl, Over, Param, Port, PortKind, Repeat, Step},
    render::suggest,
    tree::{Kind, Tree, keys},
};

pub(crate) mod when;

/// A declaration without its shader.
pub(crate) struct Declaration {
    pub doc: String,
    pub ports: IndexMap<String, Port>,
    pub params: IndexMap<String, Param>,
    pub steps: Vec<Step>,
    pub requires: Vec<String>,
    pub settles: Option<String>,
    pub span: Span,
}

impl Declaration {
    pub fn into_node(self, name: &str, shader: Option<Arc<crate::shader::Shader>>) -> NodeDecl {
        let Self { doc, ports, params, steps, requires, settles, span } = self;
        NodeDecl { name: name.to_owned(), doc, ports, params, steps, requires, settles, shader, span }
    }
}

const NODE: Shape = Shape { what: "Node", required: &["doc"], optional: &["inputs", "outputs", "params", "requires", "settles", "steps"] };

/// Reads the declaration in `source`. `None` when there is nothing to go on with; faults go to `out`.
pub(crate) fn read(source: &Arc<Source>, host: bool, out: &mut Vec<Diagnostic>) -> Option<Declaration> {
    let (mut reader, tree) = Reader::open(source);
    let declaration = tree.and_then(|tree| read_node(&mut reader, &tree, host));
    let faulty = reader.out.iter().any(|d| d.severity == crate::diagnostics::Severity::Error);
    out.append(&mut reader.out);
    declaration.filter(|_| !faulty)
}

fn read_node(reader: &mut Reader, tree: &Tree, host: bool) -> Option<Declaration> {
    match &tree.kind {
        Kind::Record(Some(name), _) | Kind::Tuple(Some(name), _) if name.text == "Node" => {}
        _ => {
            reader.expected(tree, "`Node(…)`", "a node's declaration has the form Node(doc: …, inputs: …, outputs: …)");
            return None;
        }
    }
    let fields = reader.record(tree, &NODE)?;
    let doc = fields.get("doc").and_then(|t| reader.text(t, "a sentence in quotes")).map(|d| d.text).unwrap_or_default();
    let mut ports = IndexMap::new();
    let mut declared = BTreeSet::new();
    for (field, direction) in [("inputs", Direction::Input), ("outputs", Direction::Output)] {
        if let Some(tree) = fields.get(field) {
            declared.extend(keys(tree));
            read_ports(reader, tree, direction, &mut ports);
        }
    }
    declared.extend(fields.get("params").map(keys).unwrap_or_default());
    let params = fields.get("params").map(|t| read_params(reader, t)).unwrap_or_default();
    when::check(reader, &ports, &params, &fields.get("params").map(keys).unwrap_or_default());
    let mut requires = Vec::new();
    if let Some(tree) = fields.get("requires") {
        for item in reader.list(tree, "device features") {
            let Some(name) = reader.text(item, "a device feature in quotes") else { continue };
            if features::DEVICE.contains(&name.text.as_str()) {
                requires.push(name.text);
            } else {
                let help = suggest(&name.text, features::DEVICE.iter().copied());
                reader.error(&item.range, format!("there is no device feature `{}`", name.text), help);
            }
        }
    }
    let settles = fields.get("settles").and_then(|tree| {
        let name = reader.text(tree, "the name of an Int parameter in quotes")?;
        let is_count = |param: &Param| matches!(param.kind, crate::value::ParamKind::Int { min: 0.., .. });
        if !params.get(&name.text).is_some_and(is_count) {
            let help = "declare it in `params` as Int(min: 0, …): the frames that the node takes to settle, 0 for never";
            reader.error(&tree.range, format!("`{}` is no Int parameter of this node that is never negative", name.text), help);
            return None;
        }
        Some(name.text)
    });
    let mut steps = Vec::new();
    match fields.get("steps") {
        Some(tree) if host => reader.error(&tree.range, "a node written in Rust has no steps", "remove `steps`"),
        Some(tree) => {
            let items = reader.list(tree, "steps");
            if items.is_empty() && matches!(tree.kind, Kind::List(_)) {
                reader.error(&tree.range, "a node without steps does nothing", "add `(entry: \"…\", over: …)`");
            }
            for item in items {
                steps.extend(read_step(reader, item, &Names { ports: &ports, params: &params, declared: &declared }));
            }
        }
        None if host || fields.tried("steps") => {}
        None => reader.error(&head(tree), "missing field `steps` in Node", "add `steps: [(entry: \"…\", over: …)]`"),
    }
    Some(Declaration { doc, ports, params, steps, requires, settles, span: reader.span(&head(tree)) })
}

fn read_ports(reader: &mut Reader, tree: &Tree, direction: Direction, ports: &mut IndexMap<String, Port>) {
    for (name, tree) in reader.map(tree, "ports") {
        check_identifier(reader, &name, "port");
        let Some(port) = read_port(reader, tree, direction, name.span.clone()) else { continue };
        let kind = &port.kind;
        if direction == Direction::Output && matches!(kind, PortKind::Texture { format: None, .. }) {
            reader.error(&head(tree), "an output texture needs a format", "add `format: …`");
            continue;
        }
        if direction == Direction::Output && matches!(kind, PortKind::Uniform { .. }) {
            reader.error(&head(tree), "a uniform cannot be an output", "write a buffer instead");
        }
        if let Some(first) = ports.get(&name.text) {
            let first = first.span.clone();
            reader.out.push(
                Diagnostic::error(format!("`{}` is an input and an output", name.text), name.span)
                    .and(first, "the input")
                    .help("rename one of them: what a node updates in place is an output only"),
            );
            continue;
        }
        ports.insert(name.text, port);
    }
}

const PORT_KINDS: &[&str] = &["Texture", "Buffer", "Uniform"];

fn read_port(reader: &mut Reader, tree: &Tree, direction: Direction, span: Span) -> Option<Port> {
    let kind_name = match &tree.kind {
        Kind::Record(Some(n), _) | Kind::Tuple(Some(n), _) => n.text.clone(),
        Kind::Name(n) => n.clone(),
        _ => {
            reader.expected(tree, "a port: Texture(…), Buffer(…) or Uniform(…)", "");
            return None;
        }
    };
    let shape = match kind_name.as_str() {
        "Texture" => {
            Shape { what: "Texture", required: &["doc"], optional: &["format", "array", "optional", "when", "at_least", "at_most"] }
        }
        "Buffer" => Shape { what: "Buffer", required: &["of", "doc"], optional: &["optional", "when", "at_least", "at_most"] },
        "Uniform" => Shape { what: "Uniform", required: &["of", "doc"], optional: &["optional", "when"] },
        other => {
            reader.error(&head(tree), format!("unknown kind of port `{other}`"), suggest(other, PORT_KINDS.iter().copied()));
            return None;
        }
    };
    let fields = reader.record(tree, &shape)?;
    let doc = fields.get("doc").and_then(|t| reader.text(t, "a sentence in quotes")).map(|d| d.text).unwrap_or_default();
    let optional = fields.get("optional").and_then(|t| reader.boolean(t)).unwrap_or(false);
    let when = match fields.get("when") {
        Some(tree) => Some(when::read(reader, tree, direction)?),
        None => None,
    };
    let kind = match kind_name.as_str() {
        "Texture" => {
            let format = match fields.get("format") {
                Some(tree) => Some(format::read(reader, tree)?),
                None => None,
            };
            PortKind::Texture { format, array: fields.get("array").and_then(|t| reader.boolean(t)).unwrap_or(false) }
        }
        "Buffer" => PortKind::Buffer { of: read_type(reader, fields.get("of")?)? },
        _ => PortKind::Uniform { of: read_type(reader, fields.get("of")?)? },
    };
    let [at_least, at_most] = ["at_least", "at_most"].map(|name| {
        let tree = fields.get(name)?;
        if direction == Direction::Input {
            reader.error(&tree.range, format!("`{name}` is a promise of who writes"), "give it to the output of the other node");
        }
        reader.float(tree, "a number")
    });
    Some(Port { direction, kind, optional, when, at_least, at_most, doc, span })
}

/// A WGSL type by name; long spellings of vectors become short ones.
pub(crate) fn read_type(reader: &mut Reader, tree: &Tree) -> Option<String> {
    let name = reader.text(tree, "the name of a WGSL type in quotes")?;
    Some(crate::reflect::canonical_type(&name.text))
}

const STEP: Shape = Shape { what: "a step", required: &["entry", "over"], optional: &["repeat"] };
const DRAW: Shape = Shape { what: "Draw", required: &["vertex", "fragment", "vertices", "targets"], optional: &["instances", "depth"] };

/// The names that a step may use.
struct Names<'a> {
    ports: &'a IndexMap<String, Port>,
    params: &'a IndexMap<String, Param>,
    /// All names of ports and parameters, those with faults too.
    declared: &'a BTreeSet<String>,
}

fn read_step(reader: &mut Reader, tree: &Tree, names: &Names<'_>) -> Option<Step> {
    let name = match &tree.kind {
        Kind::Record(name, _) | Kind::Tuple(name, _) => name.as_ref(),
        _ => {
            reader.expected(tree, "a step", "write `(entry: \"…\", over: …)` or `Draw(…)`");
            return None;
        }
    };
    let span = reader.span(&tree.range);
    match name.map(|n| n.text.as_str()) {
        None => {
            let fields = reader.record(tree, &STEP)?;
            let entry = fields.get("entry").and_then(|t| reader.text(t, "the name of an entry point in quotes"));
            let over = fields.get("over").and_then(|t| read_over(reader, t, names));
            let repeat = match fields.get("repeat") {
                Some(tree) => Some(read_repeat(reader, tree, names)?),
                None => None,
            };
            Some(Step::Compute { entry: entry?.text, over: over?, repeat, span })
        }
        Some("Draw") => {
            let fields = reader.record(tree, &DRAW)?;
            let vertex = fields.get("vertex").and_then(|t| reader.text(t, "the name of an entry point in quotes"));
            let fragment = fields.get("fragment").and_then(|t| reader.text(t, "the name of an entry point in quotes"));
            let vertices = fields.get("vertices").and_then(|t| read_expr(reader, t, names));
            let instances = match fields.get("instances") {
                Some(tree) => read_expr(reader, tree, names),
                None => Some(Expr::Const(1)),
            };
            let mut targets = Vec::new();
            if let Some(tree) = fields.get("targets") {
                for item in reader.list(tree, "output ports") {
                    targets.extend(target(reader, item, names, false));
                }
            }
            let depth = match fields.get("depth") {
                Some(tree) => Some(target(reader, tree, names, true)?),
                None => None,
            };
            if let Some(twice) = targets.iter().enumerate().find(|(n, t)| targets[..*n].contains(t)) {
                reader.error(&head(tree), format!("the step draws to `{}` twice", twice.1), "give each `@location` a port of its own");
            }
            if fields.get("depth").is_none()
                && matches!(fields.get("targets"), Some(Tree { kind: Kind::List(items), .. }) if items.is_empty())
            {
                reader.error(&head(tree), "the step draws to nothing", "name an output port in `targets` or `depth`");
            }
            let (vertex, fragment) = (vertex?.text, fragment?.text);
            Some(Step::Draw { vertex, fragment, vertices: vertices?, instances: instances?, targets, depth, span })
        }
        Some(other) => {
            reader.error(&head(tree), format!("unknown kind of step `{other}`"), "write `(entry: \"…\", over: …)` or `Draw(…)`");
            None
        }
    }
}

/// An attachment: an output texture of known format.
fn target(reader: &mut Reader, tree: &Tree, names: &Names<'_>, depth: bool) -> Option<String> {
    let name = reader.text(tree, "the name of an output port in quotes")?;
    let port = find_port(reader, &name, names)?;
    let is_depth = match port.kind {
        PortKind::Texture { format: Some(format), array: false } if port.direction == Direction::Output && (!depth || !port.optional) => {
            format == crate::value::Format::Depth32Float
        }
        _ => {
            let span = port.span.clone();
            reader.out.push(
                Diagnostic::error(format!("`{}` cannot be drawn to", name.text), name.span)
                    .and(span, "declared here")
                    .help("targets are output textures with a `format` and no arrays; that of depth is not optional"),
            );
            return None;
        }
    };
    if is_depth != depth {
        let span = port.span.clone();
        let help = if depth { "the depth attachment has the format Depth32Float" } else { "name it as `depth: …` instead" };
        let what = if depth { "depth attachment" } else { "colour target" };
        reader.out.push(Diagnostic::error(format!("`{}` cannot be a {what}", name.text), name.span).and(span, "declared here").help(help));
        return None;
    }
    Some(name.text)
}

fn find_port<'a>(reader: &mut Reader, name: &Spanned, names: &Names<'a>) -> Option<&'a Port> {
    let port = names.ports.get(&name.text);
    if port.is_none() && !names.declared.contains(&name.text) {
        reader.out.push(
            Diagnostic::error(format!("this node has no port `{}`", name.text), name.span.clone())
                .help(suggest(&name.text, names.ports.keys().map(String::as_str))),
        );
    }
    port
}

fn port_of_kind(reader: &mut Reader, name: &Spanned, names: &Names<'_>, texture: bool) -> Option<String> {
    let port = find_port(reader, name, names)?;
    if matches!(port.kind, PortKind::Texture { .. }) == texture && !matches!(port.kind, PortKind::Uniform { .. }) {
        return Some(name.text.clone());
    }
    let span = port.span.clone();
    let (wanted, help) = if texture {
        ("texture", "`Texels`, `Width` and `Height` name textures; use `Elements` for buffers")
    } else {
        ("buffer", "`Elements` names buffers; use `Texels`, `Width` and `Height` for textures")
    };
    reader.out.push(Diagnostic::error(format!("`{}` is no {wanted}", name.text), name.span.clone()).and(span, "declared here").help(help));
    None
}

/// Elements of a buffer that says how many workgroups run; a fourth number is the node's own.
const WORKGROUPS: [&str; 2] = ["vec3u", "vec4u"];

fn indirect_port(reader: &mut Reader, name: &Spanned, names: &Names<'_>) -> Option<String> {
    let port = find_port(reader, name, names)?;
    if matches!(&port.kind, PortKind::Buffer { of } if WORKGROUPS.contains(&of.as_str())) {
        return Some(name.text.clone());
    }
    let span = port.span.clone();
    let what = crate::fit::describe(&port.kind);
    reader.out.push(
        Diagnostic::error(format!("`{}` cannot say how many workgroups run: it is {what}", name.text), name.span.clone())
            .and(span, "declared here")
            .help("declare it as Buffer(of: \"vec4u\", …): workgroups in x, y and z; the fourth number is the node's own"),
    );
    None
}

fn read_expr(reader: &mut Reader, tree: &Tree, names: &Names<'_>) -> Option<Expr> {
    let ExprAt { expr, refs, .. } = expr::read(reader, tree)?;
    let mut good = true;
    for r in &refs {
        good &= match r.kind {
            RefKind::Texture => port_of_kind(reader, &r.name, names, true).is_some(),
            RefKind::Buffer => port_of_kind(reader, &r.name, names, false).is_some(),
            RefKind::Condition => {
                let fault = Diagnostic::error("a node has no conditions with names", r.name.span.clone());
                reader.out.push(fault.help("`Holds` belongs into the sizes of a pipeline's resources"));
                false
            }
            RefKind::Param => match names.params.get(&r.name.text) {
                Some(Param { kind: crate::value::ParamKind::Int { .. }, .. }) => true,
                Some(param) => {
                    reader.out.push(
                        Diagnostic::error(format!("parameter `{}` is no Int", r.name.text), r.name.span.clone())
                            .and(param.span.clone(), "declared here")
                            .help("sizes and counts are computed from whole numbers"),
                    );
                    false
                }
                None if names.declared.contains(&r.name.text) => false,
                None => {
                    reader.out.push(
                        Diagnostic::error(format!("this node has no parameter `{}`", r.name.text), r.name.span.clone())
                            .help(suggest(&r.name.text, names.params.keys().map(String::as_str))),
                    );
                    false
                }
            },
        };
    }
    good.then_some(expr)
}

fn read_over(reader: &mut Reader, tree: &Tree, names: &Names<'_>) -> Option<Over> {
    const FORMS: [&str; 5] = ["Texels", "Elements", "Threads", "Groups", "Indirect"];
    let Kind::Tuple(Some(name), items) = &tree.kind else {
        reader.expected(tree, "Texels(\"port\"), Elements(\"port\"), Threads(x, y, z), Groups(x, y, z) or Indirect(\"port\")", "");
        return None;
    };
    match (name.text.as_str(), items.as_slice()) {
        ("Indirect", [item]) => {
            let port = reader.text(item, "the name of a port in quotes")?;
            indirect_port(reader, &port, names).map(Over::Indirect)
        }
        (form @ ("Texels" | "Elements"), [item]) => {
            let port = reader.text(item, "the name of a port in quotes")?;
            let port = port_of_kind(reader, &port, names, form == "Texels")?;
            Some(if form == "Texels" { Over::Texels(port) } else { Over::Elements(port) })
        }
        (form @ ("Threads" | "Groups"), [x, y, z]) => {
            let (x, y, z) = (read_expr(reader, x, names), read_expr(reader, y, names), read_expr(reader, z, names));
            Some(if form == "Threads" { Over::Threads(x?, y?, z?) } else { Over::Groups(x?, y?, z?) })
        }
        (form, _) if FORMS.contains(&form) => {
            let usage = if matches!(form, "Texels" | "Elements" | "Indirect") {
                format!("write `{form}(\"port\")`")
            } else {
                format!("write `{form}(x, y, z)`")
            };
            reader.error(&tree.range, format!("`{form}` is not used like this"), usage);
            None
        }
        (form, _) => {
            reader.error(&name.range, format!("unknown size `{form}`"), suggest(form, FORMS));
            None
        }
    }
}

fn read_repeat(reader: &mut Reader, tree: &Tree, names: &Names<'_>) -> Option<Repeat> {
    const FORMS: [&str; 3] = ["Down", "Up", "Times"];
    let Kind::Tuple(Some(name), items) = &tree.kind else {
        reader.expected(tree, "Down(\"port\"), Up(\"port\") or Times(n)", "");
        return None;
    };
    match (name.text.as_str(), items.as_slice()) {
        (form @ ("Down" | "Up"), [item]) => {
            let name = reader.text(item, "the name of an output port in quotes")?;
            let port = find_port(reader, &name, names)?;
            if port.direction != Direction::Output || !matches!(port.kind, PortKind::Texture { .. }) {
                let span = port.span.clone();
                reader.out.push(
                    Diagnostic::error(format!("`{form}` needs an output texture, and `{}` is none", name.text), name.span)
                        .and(span, "declared here")
                        .help("name the texture whose mip levels the step writes"),
                );
                return None;
            }
            Some(if form == "Down" { Repeat::Down(name.text) } else { Repeat::Up(name.text) })
        }
        ("Times", [count]) => Some(Repeat::Times(read_expr(reader, count, names)?)),
        (form, _) if FORMS.contains(&form) => {
            reader.error(&tree.range, format!("`{form}` takes one thing"), "write Down(\"port\"), Up(\"port\") or Times(n)");
            None
        }
        (form, _) => {
            reader.error(&name.range, format!("unknown repetition `{form}`"), suggest(form, FORMS));
            None
        }
    }
}
