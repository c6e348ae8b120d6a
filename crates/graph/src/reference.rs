//! What nodes there are: their documentation as text, Markdown and JSON.

use std::{fmt::Write as _, sync::Arc};

use serde_json::{Value as Json, json};

use crate::{
    diagnostics::Diagnostic,
    draw::value,
    features::{KNOWN, MEASURED},
    fit::describe,
    registry::{Direction, NodeDecl, Port, Registry},
    render::suggest,
    value::ParamKind,
};

/// The node of that name.
///
/// # Errors
/// When there is none; the help names the nearest.
pub fn find<'a>(registry: &'a Registry, name: &str) -> Result<&'a Arc<NodeDecl>, Diagnostic> {
    registry.nodes.get(name).ok_or_else(|| {
        let known = registry.nodes.keys().map(String::as_str);
        Diagnostic::error_nowhere(format!("there is no node `{name}`")).help(suggest(name, known))
    })
}

/// A line for each node: name and first sentence; then what conditions can ask of a scene.
pub fn text(registry: &Registry) -> String {
    let width = registry.nodes.keys().map(String::len).max().unwrap_or(0);
    let mut out = String::new();
    for node in registry.nodes.values() {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{:width$}  {}", node.name, first_sentence(&node.doc));
    }
    let width = features().map(|(condition, _)| condition.len()).max().unwrap_or(0);
    out.push_str("\nfeatures of a scene, for conditions:\n");
    for (condition, doc) in features() {
        let _ = writeln!(out, "  {condition:width$}  {doc}");
    }
    out
}

/// How conditions ask for each feature of a scene, and what it is.
fn features() -> impl Iterator<Item = (String, &'static str)> {
    let flags = KNOWN.iter().map(|flag| (format!("Feature(\"{}\")", flag.name), flag.doc));
    flags.chain(MEASURED.iter().map(|feature| (format!("Above(\"{}\", …)", feature.name), feature.doc)))
}

/// All of a node, for a terminal.
pub fn node_text(node: &NodeDecl) -> String {
    let mut out = format!("{}\n{}\n", node.name, node.doc);
    for (title, direction) in [("inputs", Direction::Input), ("outputs", Direction::Output)] {
        let ports: Vec<_> = node.ports.iter().filter(|(_, p)| p.direction == direction).collect();
        if ports.is_empty() {
            continue;
        }
        let width = ports.iter().map(|(n, _)| n.len()).max().unwrap_or(0);
        let _ = writeln!(out, "\n{title}:");
        for (name, port) in ports {
            let optional = if port.optional { ", optional" } else { "" };
            let when = port.when.as_ref().map(|when| format!(", used when {}", when.span.text())).unwrap_or_default();
            let _ = writeln!(out, "  {name:width$}  {}{optional}{when}. {}", what(port), port.doc);
        }
    }
    if !node.params.is_empty() {
        let width = node.params.keys().map(String::len).max().unwrap_or(0);
        out.push_str("\nparameters:\n");
        for (name, param) in &node.params {
            let _ = writeln!(out, "  {name:width$}  {}, by default {}. {}", param.kind.describe(), param.kind.default_value(), param.doc);
        }
    }
    if !node.requires.is_empty() {
        let _ = writeln!(out, "\nrequires: {}", node.requires.join(", "));
    }
    let _ = writeln!(out, "\n{}", made_of(node));
    out
}

/// The kind of a port and what its numbers promise.
fn what(port: &Port) -> String {
    let bounds = [("at least", port.at_least), ("at most", port.at_most)]
        .map(|(word, bound)| bound.map(|b| format!(", {word} {b}")).unwrap_or_default());
    describe(&port.kind) + &bounds.concat()
}

/// A page with every node, by stage, the scene's data and its features.
pub fn markdown(registry: &Registry) -> String {
    let mut out = String::from("# Nodes\n");
    let mut stage = "";
    for (name, node) in &registry.nodes {
        let folder = name.split_once('/').map_or("", |(folder, _)| folder);
        if folder != stage {
            stage = folder;
            let _ = writeln!(out, "\n## {stage}");
        }
        let _ = write!(out, "\n{}", node_markdown(node));
    }
    if !registry.externals.is_empty() {
        out.push_str("\n## Scene data\n\n| name | is | what |\n|---|---|---|\n");
        for external in registry.externals.values() {
            let _ = writeln!(out, "| `{}` | {} | {} |", external.name, cell(&describe(&external.kind)), cell(&external.doc));
        }
    }
    out.push_str("\n## Scene features\n\n| condition | what |\n|---|---|\n");
    for (condition, doc) in features() {
        let _ = writeln!(out, "| `{condition}` | {} |", cell(doc));
    }
    out
}

/// A node's section of the page.
pub fn node_markdown(node: &NodeDecl) -> String {
    let mut out = format!("### {}\n\n{}\n", node.name, node.doc);
    if !node.ports.is_empty() {
        out.push_str("\n| port | is | what |\n|---|---|---|\n");
        for (name, port) in &node.ports {
            let way = match (port.direction, port.optional) {
                (Direction::Input, false) => "in",
                (Direction::Input, true) => "in, optional",
                (Direction::Output, false) => "out",
                (Direction::Output, true) => "out, optional",
            };
            let when = port.when.as_ref().map(|when| format!("; used when `{}`", when.span.text())).unwrap_or_default();
            let _ = writeln!(out, "| `{name}` ({way}) | {} | {} |", cell(&(what(port) + &when)), cell(&port.doc));
        }
    }
    if !node.params.is_empty() {
        out.push_str("\n| parameter | takes | default | what |\n|---|---|---|---|\n");
        for (name, param) in &node.params {
            let _ =
                writeln!(out, "| `{name}` | {} | {} | {} |", cell(&param.kind.describe()), param.kind.default_value(), cell(&param.doc));
        }
    }
    if !node.requires.is_empty() {
        let _ = writeln!(out, "\nRequires {}.", node.requires.iter().map(|r| format!("`{r}`")).collect::<Vec<_>>().join(", "));
    }
    let _ = writeln!(out, "\n{}", made_of(node));
    out
}

/// Every node, the scene's data and its features; what is measured has a greatest value, where it has one.
pub fn json(registry: &Registry) -> Json {
    let externals = registry.externals.values().map(|e| json!({ "name": e.name, "is": describe(&e.kind), "doc": e.doc }));
    // JSON has no infinity: a feature without a greatest value has none.
    let measured = MEASURED.iter().map(|f| json!({ "name": f.name, "doc": f.doc, "at_most": f.most }));
    json!({
        "nodes": registry.nodes.values().map(|node| node_json(node)).collect::<Vec<_>>(),
        "externals": externals.collect::<Vec<_>>(),
        "features": KNOWN.iter().map(|flag| json!({ "name": flag.name, "doc": flag.doc })).collect::<Vec<_>>(),
        "measured_features": measured.collect::<Vec<_>>(),
    })
}

/// A node.
pub fn node_json(node: &NodeDecl) -> Json {
    let ports = |direction: Direction| -> Json {
        let ports = node.ports.iter().filter(|(_, p)| p.direction == direction);
        Json::Object(ports.map(|(name, p)| (name.clone(), json!({ "is": what(p), "optional": p.optional, "when": p.when.as_ref().map(|when| when.span.text()), "doc": p.doc }))).collect())
    };
    let params = node.params.iter().map(|(name, param)| {
        let mut object = json!({ "type": param.kind.type_name(), "default": value(&param.kind.default_value()), "doc": param.doc });
        match &param.kind {
            ParamKind::Int { min, max, .. } => {
                object["min"] = json!(min);
                object["max"] = json!(max);
            }
            ParamKind::Float { min, max, .. } => {
                object["min"] = json!(min);
                object["max"] = json!(max);
            }
            ParamKind::Choice { options, .. } => object["options"] = json!(options),
            ParamKind::Bool { .. } => {}
        }
        (name.clone(), object)
    });
    json!({
        "name": node.name, "doc": node.doc, "inputs": ports(Direction::Input), "outputs": ports(Direction::Output),
        "params": params.collect::<serde_json::Map<_, _>>(), "requires": node.requires, "shader": node.shader.as_ref().map(|s| s.source.name.clone()),
    })
}

fn made_of(node: &NodeDecl) -> String {
    match &node.shader {
        Some(shader) => format!("Shader: {}", shader.source.name),
        None => "Written in Rust.".to_owned(),
    }
}

/// Up to the first full stop before a capital letter: "eqs. 4.4" and "cf. fig. 2" end no sentence.
fn first_sentence(doc: &str) -> &str {
    let ends = |&(at, _): &(usize, &str)| doc[at + 2..].starts_with(char::is_uppercase);
    doc.match_indices(". ").find(ends).map_or(doc, |(at, _)| &doc[..=at])
}

/// Text for a table's cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}
