//! The ladder of quality: what a pipeline gives up, rung after rung, to hold a time.
//!
//! The first rung is the pipeline as its parameters are. Each rung of `quality` bounds some of them further; what it does not name stays as on the
//! rung above. Bounds, not values: a pipeline that is below a bound by itself (few lights, say) is not made better, hence slower, by it, so that
//! one ladder serves all pipelines that include a stage.

use std::collections::BTreeMap;

use crate::{
    diagnostics::{Diagnostic, Span},
    params::{Literal, read_literal},
    pipeline::Pipeline,
    reader::{Reader, Spanned},
    registry::Param,
    render::{and_also, suggest},
    tree::{Kind, Tree},
    value::{ParamKind, Value},
};

/// The rungs below the first, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// From the best to the cheapest.
    pub rungs: Vec<Rung>,
    /// Where the list stands.
    pub span: Span,
}

/// What a rung changes.
#[derive(Debug, Clone, PartialEq)]
pub struct Rung {
    /// Bounds by parameter.
    pub bounds: Vec<(Spanned, Bound)>,
    /// Where it stands.
    pub span: Span,
}

/// What a parameter must be.
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// The form.
    pub kind: BoundKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of a bound.
#[derive(Debug, Clone, PartialEq)]
pub enum BoundKind {
    /// A number is lowered to this where it is above.
    AtMost(Literal),
    /// A number is raised to this where it is below.
    AtLeast(Literal),
    /// The second in place of the first.
    Instead(Literal, Literal),
}

impl BoundKind {
    fn form(&self) -> &'static str {
        match self {
            Self::AtMost(_) => "AtMost",
            Self::AtLeast(_) => "AtLeast",
            Self::Instead(..) => "Instead",
        }
    }

    /// The value under this bound.
    fn applied(&self, kind: &ParamKind, value: &Value) -> Value {
        let number = |value: &Value| match value {
            Value::Int(v) => *v as f64,
            Value::Float(v) => *v,
            _ => f64::NAN,
        };
        let bounded = match self {
            Self::AtMost(bound) => kind.accept(bound).ok().filter(|bound| number(bound) < number(value)),
            Self::AtLeast(bound) => kind.accept(bound).ok().filter(|bound| number(bound) > number(value)),
            Self::Instead(from, to) => kind.accept(to).ok().filter(|_| kind.accept(from).as_ref() == Ok(value)),
        };
        bounded.unwrap_or_else(|| value.clone())
    }
}

impl Pipeline {
    /// The rungs of the ladder as values to set, from the first, which sets none. `own` are the values of all parameters on it; those named in
    /// `fixed` stay. A rung that changes none of the others is left out.
    pub fn rungs(&self, own: &[(String, Value)], fixed: &[String]) -> Vec<Vec<(String, Value)>> {
        let mut rungs = vec![Vec::new()];
        let mut values: BTreeMap<&str, Value> = own.iter().map(|(name, value)| (name.as_str(), value.clone())).collect();
        for rung in self.quality.iter().flat_map(|quality| &quality.rungs) {
            for (name, bound) in rung.bounds.iter().filter(|(name, _)| !fixed.contains(&name.text)) {
                if let (Some(param), Some(value)) = (self.params.get(&name.text), values.get_mut(name.text.as_str())) {
                    *value = bound.kind.applied(&param.kind, value);
                }
            }
            let moved = own.iter().filter(|(name, value)| values[name.as_str()] != *value);
            let moved: Vec<_> = moved.map(|(name, _)| (name.clone(), values[name.as_str()].clone())).collect();
            if rungs.last() != Some(&moved) {
                rungs.push(moved);
            }
        }
        rungs
    }
}

/// Reads `quality: […]`.
pub(crate) fn read(reader: &mut Reader, tree: &Tree) -> Quality {
    let mut rungs = Vec::new();
    for item in reader.list(tree, "rungs, each a map of bounds") {
        let mut bounds = Vec::new();
        for (name, tree) in reader.map(item, "bounds") {
            bounds.extend(read_bound(reader, tree).map(|bound| (name, bound)));
        }
        if matches!(&item.kind, Kind::Map(entries) if entries.is_empty()) {
            reader.error(&item.range, "this rung changes nothing", "remove it; the pipeline as it is is the first rung by itself");
        }
        rungs.push(Rung { bounds, span: reader.span(&item.range) });
    }
    Quality { rungs, span: reader.span(&tree.range) }
}

const FORMS: &[&str] = &["AtMost", "AtLeast", "Instead"];
const USAGE: &str = "write `AtMost(16000)`, `AtLeast(4)` or `Instead(\"pcss\", \"simple\")`";

fn read_bound(reader: &mut Reader, tree: &Tree) -> Option<Bound> {
    let Kind::Tuple(Some(form), items) = &tree.kind else {
        reader.expected(tree, "a bound: AtMost(…), AtLeast(…) or Instead(…, …)", USAGE);
        return None;
    };
    let kind = match (form.text.as_str(), items.as_slice()) {
        ("AtMost", [bound]) => BoundKind::AtMost(read_literal(reader, bound)?),
        ("AtLeast", [bound]) => BoundKind::AtLeast(read_literal(reader, bound)?),
        ("Instead", [from, to]) => {
            let (from, to) = (read_literal(reader, from), read_literal(reader, to));
            BoundKind::Instead(from?, to?)
        }
        (name, _) if FORMS.contains(&name) => {
            reader.error(&tree.range, format!("`{name}` is not used like this"), USAGE);
            return None;
        }
        (name, _) => {
            reader.error(&form.range, format!("unknown bound `{name}`"), and_also(suggest(name, FORMS.iter().copied()), USAGE));
            return None;
        }
    };
    Some(Bound { kind, span: reader.span(&tree.range) })
}

/// What is wrong with the bounds of a ladder: names, types, ranges, and rungs that do not lead onward.
pub(crate) fn faults(pipeline: &Pipeline) -> Vec<Diagnostic> {
    let mut out = Vec::new();
    let mut earlier: BTreeMap<&str, Vec<&Bound>> = BTreeMap::new();
    for (name, bound) in pipeline.quality.iter().flat_map(|quality| &quality.rungs).flat_map(|rung| &rung.bounds) {
        match pipeline.params.get(&name.text) {
            Some(param) => {
                let before = earlier.entry(&name.text).or_default();
                out.extend(misfit(&name.text, param, bound).or_else(|| turn(&name.text, bound, before)));
                before.push(bound);
            }
            None => out.extend(unknown(pipeline, name)),
        }
    }
    out
}

fn unknown(pipeline: &Pipeline, name: &Spanned) -> Option<Diagnostic> {
    if pipeline.gaps.files || pipeline.gaps.params.contains(&name.text) {
        return None;
    }
    if let Some((_, param)) = name.text.split_once('.') {
        let fault = Diagnostic::error("a rung bounds parameters of the pipeline, not of a node", name.span.clone());
        return Some(fault.help(format!("give the pipeline a parameter, and the node `params: {{\"{param}\": Param(\"…\")}}`")));
    }
    let help = suggest(&name.text, pipeline.params.keys().map(String::as_str));
    Some(Diagnostic::error(format!("the pipeline has no parameter `{}`", name.text), name.span.clone()).help(help))
}

/// A bound that is not one for this parameter.
fn misfit(name: &str, param: &Param, bound: &Bound) -> Option<Diagnostic> {
    let is_number = matches!(param.kind, ParamKind::Int { .. } | ParamKind::Float { .. });
    let values = match &bound.kind {
        BoundKind::AtMost(value) | BoundKind::AtLeast(value) if is_number => vec![value],
        BoundKind::Instead(from, to) if !is_number => vec![from, to],
        kind => {
            let help = if is_number {
                "write `AtMost(…)` or `AtLeast(…)`"
            } else {
                "write `Instead(…, …)`: what it is, and what it becomes"
            };
            let message = format!("`{}` bounds no parameter of type {}, and `{name}` is one", kind.form(), param.kind.type_name());
            return Some(Diagnostic::error(message, bound.span.clone()).and(param.span.clone(), "declared here").help(help));
        }
    };
    values.into_iter().find_map(|value| {
        let remedy = param.kind.accept(value).err()?;
        Some(Diagnostic::error(format!("{value} is no value of `{name}`"), bound.span.clone()).help(remedy))
    })
}

/// A bound that does not lead on from the earlier ones of the same parameter.
fn turn(name: &str, bound: &Bound, earlier: &[&Bound]) -> Option<Diagnostic> {
    let number = |literal: &Literal| match literal {
        Literal::Int(v) => *v as f64,
        Literal::Float(v) => *v,
        _ => f64::NAN,
    };
    let last = *earlier.last().unwrap_or(&bound);
    let (message, other) = match (&bound.kind, &last.kind) {
        (BoundKind::Instead(from, to), _) if from == to => (format!("`{name}` stays as it is"), None),
        (BoundKind::Instead(_, to), _) => {
            // An option that was given up would come back.
            let given_up = earlier.iter().find(|e| matches!(&e.kind, BoundKind::Instead(from, _) if from == to))?;
            (format!("`{name}` goes back to {to}, which an earlier rung gave up"), Some(*given_up))
        }
        _ if earlier.is_empty() => return None,
        (BoundKind::AtMost(new), BoundKind::AtMost(old)) if number(new) >= number(old) => {
            (format!("`{name}` is at most {old} already"), Some(last))
        }
        (BoundKind::AtLeast(new), BoundKind::AtLeast(old)) if number(new) <= number(old) => {
            (format!("`{name}` is at least {old} already"), Some(last))
        }
        (BoundKind::AtMost(_), BoundKind::AtMost(_)) | (BoundKind::AtLeast(_), BoundKind::AtLeast(_)) => return None,
        _ => (format!("`{name}` goes one way on an earlier rung, and the other way on this one"), Some(last)),
    };
    let fault = Diagnostic::error(message, bound.span.clone()).help("each rung leads on from those before it, and costs less");
    Some(match other {
        Some(other) => fault.and(other.span.clone(), "the earlier rung"),
        None => fault,
    })
}
