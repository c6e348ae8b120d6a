//! Finds declared resources and parameters that nothing mentions.

use std::collections::BTreeSet;

use crate::{
    condition::ConditionKind,
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
            if r.kind == RefKind::Param {
                params.insert(&r.name.text)
            } else {
                resources.insert(&r.name.text)
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
            if let ParamSource::Pipeline(name) = source {
                params.insert(name);
            }
        }
        if let Some(when) = &node.usage.when {
            when.leaves(&mut |leaf| {
                if let ConditionKind::Is(name, _)
                | ConditionKind::IsOn(name)
                | ConditionKind::AtLeast(name, _)
                | ConditionKind::Below(name, _) = &leaf.kind
                {
                    params.insert(&name.text);
                }
            });
        }
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
    out
}
