//! When a port is used: a condition over the node's own parameters.

use indexmap::IndexMap;

use crate::{
    condition::{self, Condition, ConditionKind},
    diagnostics::Diagnostic,
    reader::{Reader, Spanned},
    registry::{Direction, Param, Port},
    render::suggest,
    tree::Tree,
    value::{ParamKind, Value},
};

/// Reads the condition of a port.
pub(super) fn read(reader: &mut Reader, tree: &Tree, direction: Direction) -> Option<Condition> {
    if direction == Direction::Output {
        let help = "write `optional: true`: an optional output that nobody reads is not made";
        reader.error(&tree.range, "an output has no condition of its own", help);
        return None;
    }
    condition::read(reader, tree)
}

/// Whether a port is used with these values of the node's parameters.
pub(crate) fn holds(when: &Condition, params: &[(String, Value)]) -> bool {
    let value = |name: &Spanned| params.iter().find(|(known, _)| *known == name.text).map(|(_, value)| value);
    let number = |name: &Spanned| match value(name) {
        Some(Value::Int(v)) => Some(*v as f64),
        Some(Value::Float(v)) => Some(*v),
        _ => None,
    };
    match &when.kind {
        ConditionKind::All(list) => list.iter().all(|inner| holds(inner, params)),
        ConditionKind::Any(list) => list.iter().any(|inner| holds(inner, params)),
        ConditionKind::Not(inner) => !holds(inner, params),
        ConditionKind::Is(name, option) => matches!(value(name), Some(Value::Choice(v)) if *v == option.text),
        ConditionKind::IsOn(name) => value(name) == Some(&Value::Bool(true)),
        ConditionKind::AtLeast(name, bound) => number(name).is_some_and(|v| v >= *bound),
        ConditionKind::Below(name, bound) => number(name).is_some_and(|v| v < *bound),
        // Other forms are refused where the declaration is read.
        _ => false,
    }
}

/// The parameters that decide whether a port is used.
pub(crate) fn tested(ports: &IndexMap<String, Port>) -> impl Iterator<Item = &Spanned> {
    let mut names = Vec::new();
    for when in ports.values().filter_map(|port| port.when.as_ref()) {
        when.clauses(&mut |leaf| names.extend(tested_by(&leaf.kind)));
    }
    names.into_iter()
}

fn tested_by(leaf: &ConditionKind) -> Option<&Spanned> {
    match leaf {
        ConditionKind::Is(name, _) | ConditionKind::IsOn(name) | ConditionKind::AtLeast(name, _) | ConditionKind::Below(name, _) => {
            Some(name)
        }
        _ => None,
    }
}

/// Reports what the conditions of ports test and the node does not have. `declared`: all names of parameters, those with faults too.
pub(super) fn check(reader: &mut Reader, ports: &IndexMap<String, Port>, params: &IndexMap<String, Param>, declared: &[String]) {
    for when in ports.values().filter_map(|port| port.when.as_ref()) {
        let mut faults = Vec::new();
        when.clauses(&mut |leaf| faults.extend(fault(leaf, params, declared)));
        reader.out.extend(faults);
    }
}

fn fault(leaf: &Condition, params: &IndexMap<String, Param>, declared: &[String]) -> Option<Diagnostic> {
    let Some(name) = tested_by(&leaf.kind) else {
        let fault = Diagnostic::error("a port depends on the node's own parameters only", leaf.span.clone());
        return Some(fault.help("test the scene in a pipeline, and set a parameter of the node by it"));
    };
    let Some(param) = params.get(&name.text) else {
        let fault = Diagnostic::error(format!("this node has no parameter `{}`", name.text), name.span.clone());
        return (!declared.contains(&name.text)).then(|| fault.help(suggest(&name.text, params.keys().map(String::as_str))));
    };
    match (&leaf.kind, &param.kind) {
        (ConditionKind::Is(_, option), ParamKind::Choice { options, .. }) if !options.contains(&option.text) => {
            let fault = Diagnostic::error(format!("`{}` has no option `{}`", name.text, option.text), option.span.clone());
            Some(fault.help(suggest(&option.text, options.iter().map(String::as_str))))
        }
        (ConditionKind::Is(..), ParamKind::Choice { .. })
        | (ConditionKind::IsOn(_), ParamKind::Bool { .. })
        | (ConditionKind::AtLeast(..) | ConditionKind::Below(..), ParamKind::Int { .. } | ParamKind::Float { .. }) => None,
        (_, kind) => {
            let instead = match kind {
                ParamKind::Choice { .. } => "Is(\"parameter\", \"option\")",
                ParamKind::Bool { .. } => "IsOn(\"parameter\")",
                _ => "AtLeast(\"parameter\", n) or Below(\"parameter\", n)",
            };
            let fault = Diagnostic::error(format!("`{}` is {}", name.text, kind.type_name()), name.span.clone());
            Some(fault.and(param.span.clone(), "declared here").help(format!("write {instead}")))
        }
    }
}
