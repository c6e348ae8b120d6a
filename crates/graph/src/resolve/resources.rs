//! Names in the sizes of resources.

use std::collections::{BTreeMap, BTreeSet};

use super::Linker;
use crate::{
    diagnostics::Diagnostic,
    expr::{ExprAt, RefKind},
    pipeline::{Mips, ResourceKind, Size},
    reader::Spanned,
    registry::PortKind,
    render::suggest,
    sizes::LONGEST_CHAIN,
    value::ParamKind,
};

impl<'a> Linker<'a, '_> {
    pub(super) fn resources(&mut self) {
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
                match r.kind {
                    RefKind::Param => self.int_param(&r.name),
                    RefKind::Condition => self.condition_name(&r.name),
                    RefKind::Texture | RefKind::Buffer => {
                        if self.size_ref(&r.name, r.kind) {
                            needed.push(&r.name);
                        }
                    }
                }
            }
            needs.insert(name, needed);
        }
        self.size_cycles(&needs);
    }

    pub(super) fn int_param(&mut self, name: &Spanned) {
        match self.pipeline.params.get(&name.text) {
            Some(param) if matches!(param.kind, ParamKind::Int { .. }) => {}
            Some(param) => {
                let fault = Diagnostic::error(
                    format!("parameter `{}` is {}, and sizes need Int", name.text, param.kind.type_name()),
                    name.span.clone(),
                );
                self.push(fault.and(param.span.clone(), "declared here").help("use a parameter of whole numbers"));
            }
            None => self.unknown_param(&name.text, &name.span),
        }
    }

    /// Whether a resource named in a size exists and is of the right kind; true only for the pipeline's own.
    pub(super) fn size_ref(&mut self, name: &Spanned, kind: RefKind) -> bool {
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

    pub(super) fn size_cycles(&mut self, needs: &BTreeMap<&'a str, Vec<&'a Spanned>>) {
        let mut reported: BTreeSet<&str> = BTreeSet::new();
        for start in self.pipeline.resources.keys() {
            let mut path: Vec<&Spanned> = Vec::new();
            if !reported.contains(start.as_str()) && walk(start, start, needs, &mut path, &mut BTreeSet::new()) {
                let names: Vec<&str> = std::iter::once(start.as_str()).chain(path.iter().map(|s| s.text.as_str())).collect();
                reported.extend(path.iter().map(|s| s.text.as_str()));
                let fault =
                    Diagnostic::error(format!("the size of `{start}` depends on itself: {}", names.join(" → ")), path[0].span.clone());
                self.tainted.extend(names.iter().map(|n| (*n).to_owned()));
                self.push(fault.help("give one of them a size of its own"));
            }
        }
    }
}

/// Finds a way from `at` back to `start` through sizes that need each other.
fn walk<'a>(
    start: &str,
    at: &str,
    needs: &BTreeMap<&'a str, Vec<&'a Spanned>>,
    path: &mut Vec<&'a Spanned>,
    seen: &mut BTreeSet<&'a str>,
) -> bool {
    for next in needs.get(at).into_iter().flatten() {
        // Longer chains are refused when sizes are computed.
        if path.len() >= LONGEST_CHAIN {
            return false;
        }
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
