//! Finds declared resources and parameters that nothing mentions.

use std::collections::BTreeSet;

use crate::{
    condition::{Condition, ConditionKind},
    diagnostics::Diagnostic,
    expr::RefKind,
    pipeline::{Mips, ResourceKind, Size},
    resolve::{Linked, ParamSource, Wire},
};

/// A warning for each.
pub(crate) fn find(linked: &Linked<'_>) -> Vec<Diagnostic> {
    if linked.incomplete {
        return Vec::new();
    }
    let mut resources: BTreeSet<&str> = BTreeSet::new();
    let mut params: BTreeSet<&str> = BTreeSet::new();
    let mut conditions: BTreeSet<&str> = BTreeSet::new();
    for resource in linked.pipeline.resources.values() {
        let mut exprs = Vec::new();
        match &resource.kind {
            ResourceKind::Texture { size, mips, .. } => {
                match size {
                    Size::Exact(w, h) => exprs.extend([&**w, &**h]),
                    Size::Like(other) => {
                        resources.insert(&other.text);
                    }
                    _ => {}
                }
                if let Mips::Count(count) = mips {
                    exprs.push(count);
                }
            }
            ResourceKind::Buffer { count, .. } => exprs.push(count),
        }
        for r in exprs.iter().flat_map(|e| &e.refs) {
            match r.kind {
                RefKind::Param => params.insert(&r.name.text),
                RefKind::Condition => conditions.insert(&r.name.text),
                RefKind::Texture | RefKind::Buffer => resources.insert(&r.name.text),
            };
        }
    }
    for node in &linked.nodes {
        for (_, _, wire) in node.ports() {
            if let Wire::Resource { name, .. } = wire {
                resources.insert(name);
            }
        }
        for (_, source) in &node.params {
            taken(source, &mut params);
        }
    }
    let named = linked.pipeline.conditions.values().map(|condition| &condition.when);
    let refusals = linked.pipeline.refuse.iter().map(|refusal| &refusal.when);
    let nodes = linked.pipeline.nodes.values().flat_map(|node| {
        let values = node.params.values().flat_map(|argument| argument.value.conditions());
        node.when.iter().chain(values)
    });
    // To refuse a value of a parameter is no use of it.
    for (condition, uses) in named.chain(nodes).map(|c| (c, true)).chain(refusals.map(|c| (c, false))) {
        condition.clauses(&mut |clause: &Condition| {
            if let ConditionKind::Holds(name) = &clause.kind {
                conditions.insert(&name.text);
            }
            params.extend(clause.params().filter(|_| uses).map(|name| name.text.as_str()));
        });
    }
    let mut out = Vec::new();
    for (name, resource) in
        linked.pipeline.resources.iter().filter(|(n, _)| !resources.contains(n.as_str()) && !linked.tainted.contains(*n))
    {
        out.push(Diagnostic::warning(format!("nothing uses the resource `{name}`"), resource.span.clone()).help("connect it or remove it"));
    }
    for (name, param) in linked.pipeline.params.iter().filter(|(n, _)| !params.contains(n.as_str())) {
        out.push(Diagnostic::warning(format!("nothing uses the parameter `{name}`"), param.span.clone()).help("use it or remove it"));
    }
    for (name, condition) in linked.pipeline.conditions.iter().filter(|(n, _)| !conditions.contains(n.as_str())) {
        out.push(Diagnostic::warning(format!("nothing uses the condition `{name}`"), condition.span.clone()).help("use it or remove it"));
    }
    out
}

/// Parameters of the pipeline that a node's parameter takes its value from.
fn taken<'a>(source: &ParamSource<'a>, params: &mut BTreeSet<&'a str>) {
    match source {
        ParamSource::Pipeline(name) => {
            params.insert(name);
        }
        ParamSource::If(_, then, otherwise) => {
            taken(then, params);
            taken(otherwise, params);
        }
        ParamSource::Fixed(_) | ParamSource::Default => {}
    }
}
