//! Conditions of nodes: RON values over parameters and scene features.

use std::collections::BTreeMap;

use crate::{
    diagnostics::Span,
    reader::{Reader, Spanned},
    render::suggest,
    tree::{Kind, Tree},
    value::Value,
};

/// When a node runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// What must hold.
    pub kind: ConditionKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of a condition.
#[derive(Debug, Clone, PartialEq)]
pub enum ConditionKind {
    /// All of them hold.
    All(Vec<Condition>),
    /// At least one of them holds.
    Any(Vec<Condition>),
    /// It does not hold.
    Not(Box<Condition>),
    /// A choice parameter has this option.
    Is(Spanned, Spanned),
    /// A boolean parameter is on.
    IsOn(Spanned),
    /// A number parameter is not below.
    AtLeast(Spanned, f64),
    /// A number parameter is below.
    Below(Spanned, f64),
    /// The scene has this.
    Feature(Spanned),
}

/// What a condition came to, with the clause that decided and the values it met.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Verdict {
    pub holds: bool,
    pub why: String,
}

impl Condition {
    /// Evaluates against parameter values and features; names that are unknown count as "does not hold" (they are reported elsewhere).
    pub(crate) fn eval(&self, params: &dyn Fn(&str) -> Option<Value>, features: &BTreeMap<String, bool>) -> Verdict {
        let number = |name: &Spanned| match params(&name.text) {
            Some(Value::Int(v)) => Some(v as f64),
            Some(Value::Float(v)) => Some(v),
            _ => None,
        };
        let met = |name: &Spanned| params(&name.text).map_or_else(|| "unknown".to_owned(), |v| v.to_string());
        match &self.kind {
            ConditionKind::All(list) => {
                let verdicts: Vec<_> = list.iter().map(|c| c.eval(params, features)).collect();
                match verdicts.iter().find(|v| !v.holds) {
                    Some(first) => first.clone(),
                    None => Verdict { holds: true, why: join(&verdicts) },
                }
            }
            ConditionKind::Any(list) => {
                let verdicts: Vec<_> = list.iter().map(|c| c.eval(params, features)).collect();
                match verdicts.iter().find(|v| v.holds) {
                    Some(first) => first.clone(),
                    None => Verdict { holds: false, why: join(&verdicts) },
                }
            }
            ConditionKind::Not(inner) => {
                let Verdict { holds, why } = inner.eval(params, features);
                Verdict { holds: !holds, why }
            }
            ConditionKind::Is(name, option) => {
                let holds = matches!(params(&name.text), Some(Value::Choice(v)) if v == option.text);
                let verb = if holds { "is" } else { "is not" };
                let met = if holds { String::new() } else { format!(" but `{}`", met(name)) };
                Verdict { holds, why: format!("`{}` {verb} `{}`{met}", name.text, option.text) }
            }
            ConditionKind::IsOn(name) => {
                let holds = params(&name.text) == Some(Value::Bool(true));
                Verdict { holds, why: format!("`{}` is {}", name.text, if holds { "on" } else { "off" }) }
            }
            ConditionKind::AtLeast(name, bound) => {
                let holds = number(name).is_some_and(|v| v >= *bound);
                let verb = if holds { "at least" } else { "below" };
                Verdict { holds, why: format!("`{}` is {}, {verb} {bound}", name.text, met(name)) }
            }
            ConditionKind::Below(name, bound) => {
                let holds = number(name).is_some_and(|v| v < *bound);
                let verb = if holds { "below" } else { "not below" };
                Verdict { holds, why: format!("`{}` is {}, {verb} {bound}", name.text, met(name)) }
            }
            ConditionKind::Feature(name) => {
                let holds = features.get(&name.text).copied().unwrap_or(false);
                let verb = if holds { "has" } else { "does not have" };
                Verdict { holds, why: format!("the scene {verb} `{}`", name.text) }
            }
        }
    }

    /// Calls `visit` for every condition in it that names a parameter or feature.
    pub(crate) fn leaves<'a>(&'a self, visit: &mut dyn FnMut(&'a Condition)) {
        match &self.kind {
            ConditionKind::All(list) | ConditionKind::Any(list) => list.iter().for_each(|c| c.leaves(visit)),
            ConditionKind::Not(inner) => inner.leaves(visit),
            _ => visit(self),
        }
    }
}

fn join(verdicts: &[Verdict]) -> String {
    verdicts.iter().map(|v| v.why.as_str()).collect::<Vec<_>>().join("; ")
}

const FORMS: &[&str] = &["All", "Any", "Not", "Is", "IsOn", "AtLeast", "Below", "Feature"];

/// Reads a condition.
pub(crate) fn read(reader: &mut Reader, tree: &Tree) -> Option<Condition> {
    let Kind::Tuple(Some(name), items) = &tree.kind else {
        match &tree.kind {
            Kind::Name(name) if FORMS.contains(&name.as_str()) => {
                reader.error(&tree.range, format!("`{name}` needs something in parentheses"), usage(name));
            }
            Kind::Name(name) => reader.error(&tree.range, format!("unknown condition `{name}`"), suggest(name, FORMS.iter().copied())),
            _ => reader.expected(tree, "a condition", "conditions are All, Any, Not, Is, IsOn, AtLeast, Below and Feature"),
        }
        return None;
    };
    let form = name.text.as_str();
    let kind = match (form, items.as_slice()) {
        ("All" | "Any", [list]) => {
            let items: Vec<_> = reader.list(list, "conditions").iter().map(|item| read(reader, item)).collect();
            let items: Vec<_> = items.into_iter().collect::<Option<_>>()?;
            if form == "All" { ConditionKind::All(items) } else { ConditionKind::Any(items) }
        }
        ("Not", [inner]) => ConditionKind::Not(Box::new(read(reader, inner)?)),
        ("Is", [name, option]) => {
            let name = reader.text(name, "the name of a parameter in quotes");
            let option = reader.text(option, "an option in quotes");
            ConditionKind::Is(name?, option?)
        }
        ("IsOn", [name]) => ConditionKind::IsOn(reader.text(name, "the name of a parameter in quotes")?),
        ("Feature", [name]) => ConditionKind::Feature(reader.text(name, "the name of a scene feature in quotes")?),
        ("AtLeast" | "Below", [name, bound]) => {
            let name = reader.text(name, "the name of a parameter in quotes");
            let bound = reader.float(bound, "a number");
            if form == "AtLeast" { ConditionKind::AtLeast(name?, bound?) } else { ConditionKind::Below(name?, bound?) }
        }
        _ if FORMS.contains(&form) => {
            reader.error(&tree.range, format!("`{form}` is not used like this"), usage(form));
            return None;
        }
        _ => {
            reader.error(&name.range, format!("unknown condition `{form}`"), suggest(form, FORMS.iter().copied()));
            return None;
        }
    };
    Some(Condition { kind, span: reader.span(&tree.range) })
}

fn usage(form: &str) -> &'static str {
    match form {
        "All" => "write `All([a, b])`",
        "Any" => "write `Any([a, b])`",
        "Not" => "write `Not(a)`",
        "Is" => "write `Is(\"parameter\", \"option\")`",
        "IsOn" => "write `IsOn(\"parameter\")`",
        "AtLeast" => "write `AtLeast(\"parameter\", 32)`",
        "Below" => "write `Below(\"parameter\", 32)`",
        _ => "write `Feature(\"name\")`",
    }
}
