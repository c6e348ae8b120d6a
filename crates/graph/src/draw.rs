//! A plan as a picture or as data: Graphviz, Mermaid, JSON, and SVG without other programs.

use std::{collections::BTreeMap, fmt::Write as _};

use serde_json::{Value as Json, json};

use crate::{
    plan::{Idle, Lifetime, Plan, PlanStep, Target, Workgroups},
    registry::Direction,
    value::Value,
};

mod layout;
mod svg;

/// A line from the node that writes a resource to one that reads it.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Edge {
    pub from: usize,
    pub to: usize,
    pub resource: usize,
    /// Read in the next frame.
    pub previous: bool,
}

/// All lines of a plan; scene data have none.
pub(crate) fn edges(plan: &Plan) -> Vec<Edge> {
    let mut writer = BTreeMap::new();
    let bindings = |index: usize| {
        let node = &plan.nodes[index];
        node.bindings.iter().zip(node.decl.ports.values()).map(|((_, target), port)| (*target, port.direction))
    };
    for index in 0..plan.nodes.len() {
        for (target, direction) in bindings(index) {
            if let (Target::Resource(ix), Direction::Output) = (target, direction) {
                writer.insert(ix, index);
            }
        }
    }
    let mut found = Vec::new();
    for to in 0..plan.nodes.len() {
        for (target, direction) in bindings(to) {
            let (resource, previous) = match (target, direction) {
                (Target::Resource(ix), Direction::Input) => (ix, false),
                (Target::Previous(ix), Direction::Input) => (ix, true),
                _ => continue,
            };
            if let Some(from) = writer.get(&resource) {
                found.push(Edge { from: *from, to, resource, previous });
            }
        }
    }
    found.sort();
    found.dedup();
    found
}

impl Plan {
    /// The graph for Graphviz.
    pub fn to_dot(&self) -> String {
        let quote = |text: &str| format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""));
        let mut out = String::from(
            "digraph plan {\n  rankdir=TB;\n  node [shape=box, fontname=\"sans-serif\"];\n  edge [fontname=\"sans-serif\", fontsize=10];\n",
        );
        // Writing to a string cannot fail.
        for (number, (stage, ids)) in self.stages().into_iter().enumerate() {
            let _ = writeln!(out, "  subgraph cluster_{number} {{\n    label={};", quote(stage));
            for index in ids {
                let node = &self.nodes[index];
                let _ = writeln!(
                    out,
                    "    {} [label={}];",
                    quote(&node.id),
                    quote(&format!("{}\n{}", node.id, node.decl.name)).replace('\n', "\\n")
                );
            }
            out.push_str("  }\n");
        }
        for edge in edges(self) {
            let style = if edge.previous { ", style=dashed, constraint=false" } else { "" };
            let (from, to) = (quote(&self.nodes[edge.from].id), quote(&self.nodes[edge.to].id));
            let _ = writeln!(out, "  {from} -> {to} [label={}{style}];", quote(&self.resources[edge.resource].name));
        }
        for idle in &self.idle {
            let _ = writeln!(
                out,
                "  {} [style=dashed, color=gray, fontcolor=gray, tooltip={}];",
                quote(&idle.id),
                quote(&reason(&idle.reason))
            );
        }
        out.push_str("}\n");
        out
    }

    /// The graph for Mermaid, as Markdown pages show it.
    pub fn to_mermaid(&self) -> String {
        let mut out = String::from("flowchart TB\n");
        for (stage, ids) in self.stages() {
            let _ = writeln!(out, "  subgraph stage_{stage}[\"{stage}\"]");
            for index in ids {
                let node = &self.nodes[index];
                let _ = writeln!(out, "    {}[\"{}<br/>{}\"]", node.id, node.id, node.decl.name);
            }
            out.push_str("  end\n");
        }
        for edge in edges(self) {
            let arrow = if edge.previous { "-.->" } else { "-->" };
            let _ =
                writeln!(out, "  {} {arrow}|{}| {}", self.nodes[edge.from].id, self.resources[edge.resource].name, self.nodes[edge.to].id);
        }
        out
    }

    /// The whole plan as JSON.
    pub fn to_json(&self) -> Json {
        let name = |ix: usize| self.resources[ix].name.as_str();
        let target = |target: &Target| match target {
            Target::Resource(ix) => json!(name(*ix)),
            Target::Previous(ix) => json!({ "previous": name(*ix) }),
            Target::Absent => Json::Null,
        };
        let values = |list: &[(String, Value)]| Json::Object(list.iter().map(|(n, v)| (n.clone(), value(v))).collect());
        let nodes = self.nodes.iter().map(|node| {
            let bindings = node.bindings.iter().map(|(port, bound)| (port.clone(), target(bound)));
            let steps = node.steps.iter().map(|step| match step {
                PlanStep::Compute { entry, groups, mip } => {
                    let groups = match groups {
                        Workgroups::Fixed(groups) => json!(groups),
                        Workgroups::Indirect(bound) => json!({ "indirect": target(bound) }),
                    };
                    json!({ "entry": entry, "groups": groups, "mip": mip.as_ref().map(|(port, level)| json!({ "port": port, "level": level })) })
                }
                PlanStep::Draw { vertex, fragment, vertices, instances, targets, depth } => json!({
                    "vertex": vertex, "fragment": fragment, "vertices": vertices, "instances": instances,
                    "targets": targets.iter().map(|ix| ix.map(name)).collect::<Vec<_>>(), "depth": depth.map(name),
                }),
            });
            json!({
                "id": node.id, "stage": node.stage, "node": node.decl.name, "params": values(&node.params),
                "bindings": bindings.collect::<serde_json::Map<_, _>>(), "steps": steps.collect::<Vec<_>>(),
            })
        });
        let resources = self.resources.iter().map(|resource| {
            let (lifetime, slot) = match resource.lifetime {
                Lifetime::External => ("external", None),
                Lifetime::Transient { slot, .. } => ("transient", Some(slot)),
                Lifetime::History => ("history", None),
                Lifetime::Kept => ("kept", None),
            };
            let life = if let Lifetime::Transient { first, last, .. } = resource.lifetime { json!([first, last]) } else { Json::Null };
            json!({
                "name": resource.name, "is": resource.desc.to_string(), "bytes": resource.desc.bytes(), "lifetime": lifetime, "slot": slot, "nodes": life,
            })
        });
        let idle = self.idle.iter().map(|n| {
            let state = if n.reason == Idle::Dead { "dead" } else { "off" };
            json!({ "id": n.id, "stage": n.stage, "node": n.kind, "state": state, "reason": reason(&n.reason) })
        });
        json!({
            "nodes": nodes.collect::<Vec<_>>(), "idle": idle.collect::<Vec<_>>(), "resources": resources.collect::<Vec<_>>(),
            "presents": name(self.presents), "radiance": self.radiance.map(name), "params": values(&self.params), "slots": self.slots,
        })
    }

    /// The graph as an SVG picture: a row for each rank, boxes coloured by stage, dashed lines to the next frame.
    pub fn to_svg(&self) -> String {
        svg::draw(self)
    }

    /// Stages in the order of their first node, with their nodes.
    fn stages(&self) -> Vec<(&str, Vec<usize>)> {
        let mut stages: Vec<(&str, Vec<usize>)> = Vec::new();
        for (index, node) in self.nodes.iter().enumerate() {
            match stages.iter_mut().find(|(stage, _)| *stage == node.stage) {
                Some((_, ids)) => ids.push(index),
                None => stages.push((&node.stage, vec![index])),
            }
        }
        stages
    }
}

/// Why a node does not run, in words.
pub(crate) fn reason(idle: &Idle) -> String {
    match idle {
        Idle::Off(why) => why.clone(),
        Idle::Dead => "nobody reads what it writes".to_owned(),
    }
}

/// A parameter's value as JSON.
pub(crate) fn value(value: &Value) -> Json {
    match value {
        Value::Int(v) => json!(v),
        Value::Float(v) => json!(v),
        Value::Bool(v) => json!(v),
        Value::Choice(v) => json!(v),
    }
}
