//! Finds conditions that can never hold or always hold, whatever the parameters and the scene are, and says why.

use std::collections::{BTreeMap, BTreeSet};

use super::variables::{Point, Variable, points, variables_of};
use crate::{
    condition::{Bound, Condition, ConditionKind},
    diagnostics::{Diagnostic, Span},
    features::MEASURED,
    reader::Spanned,
    resolve::Linked,
    value::ParamKind,
};

/// Clauses that are looked at for one condition; of one that asks for more, nothing is said.
const MOST_CLAUSES: usize = 50_000;

/// A warning for each condition that has only one outcome.
pub(super) fn find(linked: &Linked<'_>) -> Vec<Diagnostic> {
    let mut out = Vec::new();
    let mut search = Search { linked, settled: BTreeSet::new() };
    for name in &linked.conditions {
        if search.warn(&linked.pipeline.conditions[*name].when, &format!("the condition `{name}`"), &mut out) {
            search.settled.insert(name);
        }
    }
    for node in linked.pipeline.nodes.values() {
        let id = &node.id.text;
        if let Some(when) = &node.when {
            search.warn(when, &format!("the condition of node `{id}`"), &mut out);
        }
        for (name, argument) in &node.params {
            for when in argument.value.conditions() {
                search.warn(when, &format!("the condition for `{name}` of node `{id}`"), &mut out);
            }
        }
    }
    for refusal in &linked.pipeline.refuse {
        search.warn(&refusal.when, "what is refused", &mut out);
    }
    out
}

struct Search<'l, 'a> {
    linked: &'l Linked<'a>,
    /// Conditions with names that have only one outcome. They are reported themselves, and taken as if they could go either way.
    settled: BTreeSet<&'a str>,
}

/// The search for outcomes of one condition: values are given to one variable after the other until it is decided.
struct Outcomes<'t> {
    condition: &'t Condition,
    /// Conditions with names that it depends on, each after those that it names.
    named: Vec<&'t str>,
    variables: Vec<(Variable<'t>, Vec<Point>)>,
    assigned: BTreeMap<Variable<'t>, Point>,
    /// Whether it can fail, and whether it can hold.
    found: [bool; 2],
    looked_at: usize,
}

impl Search<'_, '_> {
    /// Warns where a condition has only one outcome.
    fn warn(&self, condition: &Condition, what: &str, out: &mut Vec<Diagnostic>) -> bool {
        let Some(holds) = self.outcome(condition) else { return false };
        let (place, reason) = self.reason(condition, holds);
        let (verb, help) =
            if holds { ("always holds", "mend it, or leave it out") } else { ("can never hold", "mend it, or remove what it decides") };
        out.push(Diagnostic::warning(format!("{what} {verb}"), place).at(reason).help(help));
        true
    }

    /// The outcome of a condition that has only one.
    fn outcome(&self, condition: &Condition) -> Option<bool> {
        let mut clauses = Vec::new();
        let mut needed: BTreeSet<&str> = BTreeSet::new();
        let mut open = vec![condition];
        while let Some(condition) = open.pop() {
            condition.clauses(&mut |clause| {
                clauses.push(clause);
                if let ConditionKind::Holds(name) = &clause.kind
                    && !self.settled.contains(name.text.as_str())
                    && let Some(named) = self.linked.pipeline.conditions.get(&name.text)
                    && needed.insert(&name.text)
                {
                    open.push(&named.when);
                }
            });
        }
        let params = &self.linked.pipeline.params;
        let variables = variables_of(&clauses, |name| self.settled.contains(name));
        let mut outcomes = Outcomes {
            condition,
            named: self.linked.conditions.iter().copied().filter(|name| needed.contains(name)).collect(),
            variables: variables.into_iter().map(|variable| (variable, points(variable, &clauses, params))).collect(),
            assigned: BTreeMap::new(),
            found: [false; 2],
            looked_at: 0,
        };
        self.descend(&mut outcomes, 0);
        match outcomes.found {
            _ if outcomes.looked_at > MOST_CLAUSES => None,
            [true, false] => Some(false),
            [false, true] => Some(true),
            _ => None,
        }
    }

    fn descend(&self, outcomes: &mut Outcomes<'_>, depth: usize) {
        if outcomes.looked_at > MOST_CLAUSES || outcomes.found == [true; 2] {
            return;
        }
        let mut named = BTreeMap::new();
        for name in &outcomes.named {
            let holds = decide(&self.linked.pipeline.conditions[*name].when, &outcomes.assigned, &named, &mut outcomes.looked_at);
            named.insert(*name, holds);
        }
        if let Some(holds) = decide(outcomes.condition, &outcomes.assigned, &named, &mut outcomes.looked_at) {
            outcomes.found[usize::from(holds)] = true;
            return;
        }
        let Some((variable, count)) = outcomes.variables.get(depth).map(|(variable, points)| (*variable, points.len())) else { return };
        for index in 0..count {
            let point = outcomes.variables[depth].1[index].clone();
            outcomes.assigned.insert(variable, point);
            self.descend(outcomes, depth + 1);
        }
        outcomes.assigned.remove(&variable);
    }

    /// Why a condition has only this outcome, and the place of what is to blame.
    fn reason(&self, condition: &Condition, holds: bool) -> (Span, String) {
        let here = |reason: String| (condition.span.clone(), reason);
        match &condition.kind {
            ConditionKind::All(list) | ConditionKind::Any(list) => {
                let all = matches!(condition.kind, ConditionKind::All(_));
                if list.is_empty() {
                    return here(if all { "nothing is asked for" } else { "there is nothing to choose from" }.to_owned());
                }
                if let Some(clause) = list.iter().find(|clause| self.outcome(clause) == Some(holds)) {
                    return self.reason(clause, holds);
                }
                let with = |list: &[Condition]| match &condition.kind {
                    ConditionKind::All(_) => ConditionKind::All(list.to_vec()),
                    _ => ConditionKind::Any(list.to_vec()),
                };
                let first = |count: usize| Condition { kind: with(&list[..count]), span: condition.span.clone() };
                let decisive = (2..=list.len()).find(|count| self.outcome(&first(*count)) == Some(holds)).unwrap_or(list.len());
                let reason =
                    if holds { "this holds wherever those before it do not" } else { "this does not hold where those before it do" };
                (list[decisive - 1].span.clone(), reason.to_owned())
            }
            ConditionKind::Not(inner) => self.reason(inner, !holds),
            _ => here(self.reason_of_clause(&condition.kind)),
        }
    }

    fn reason_of_clause(&self, kind: &ConditionKind) -> String {
        let range = |name: &Spanned| match self.linked.pipeline.params.get(&name.text).map(|param| &param.kind) {
            Some(ParamKind::Int { min, max, .. }) => format!("`{}` is from {min} to {max}", name.text),
            Some(ParamKind::Float { min, max, .. }) => format!("`{}` is from {min} to {max}", name.text),
            _ => format!("`{}` has only one value", name.text),
        };
        match kind {
            ConditionKind::Is(name, option) => format!("`{}` has no option but `{}`", name.text, option.text),
            ConditionKind::AtLeast(name, _) | ConditionKind::Below(name, _) => range(name),
            ConditionKind::Above(name, bound) => {
                let most = MEASURED.iter().find(|feature| feature.name == name.text).map_or(f64::INFINITY, |feature| feature.most);
                let own = if most.is_finite() { format!("from 0 to {most}") } else { "at least 0".to_owned() };
                let bound = if let Bound::Param(param) = bound { format!(", and {}", range(param)) } else { String::new() };
                format!("`{}` is {own}{bound}", name.text)
            }
            _ => "it has only one outcome".to_owned(),
        }
    }
}

/// Whether a condition holds, if what is known decides that.
fn decide(
    condition: &Condition,
    assigned: &BTreeMap<Variable<'_>, Point>,
    named: &BTreeMap<&str, Option<bool>>,
    looked_at: &mut usize,
) -> Option<bool> {
    *looked_at += 1;
    let number = |variable: Variable<'_>| match assigned.get(&variable) {
        Some(Point::Number(number)) => Some(*number),
        _ => None,
    };
    let truth = |variable: Variable<'_>| match assigned.get(&variable) {
        Some(Point::Is(is)) => Some(*is),
        _ => None,
    };
    let is_at = |name: &Spanned, wanted: &str| match assigned.get(&Variable::Param(&name.text)) {
        Some(Point::Option(option)) => Some(option == wanted),
        _ => None,
    };
    match &condition.kind {
        ConditionKind::All(list) | ConditionKind::Any(list) => {
            // What decides by itself: one that fails, or one that holds.
            let decisive = matches!(condition.kind, ConditionKind::Any(_));
            let mut outcome = Some(!decisive);
            for clause in list {
                match decide(clause, assigned, named, looked_at) {
                    Some(holds) if holds == decisive => return Some(decisive),
                    Some(_) => {}
                    None => outcome = None,
                }
            }
            outcome
        }
        ConditionKind::Not(inner) => decide(inner, assigned, named, looked_at).map(|holds| !holds),
        ConditionKind::Switch(name, _) if is_at(name, "on")? => Some(true),
        ConditionKind::Switch(name, inner) if is_at(name, "auto")? => decide(inner, assigned, named, looked_at),
        ConditionKind::Switch(..) => Some(false),
        ConditionKind::Holds(name) => truth(Variable::Named(&name.text)).or_else(|| named.get(name.text.as_str()).copied().flatten()),
        ConditionKind::Feature(name) => truth(Variable::Flag(&name.text)),
        ConditionKind::IsOn(name) => truth(Variable::Param(&name.text)),
        ConditionKind::Is(name, wanted) => is_at(name, &wanted.text),
        ConditionKind::AtLeast(name, bound) => number(Variable::Param(&name.text)).map(|value| value >= *bound),
        ConditionKind::Below(name, bound) => number(Variable::Param(&name.text)).map(|value| value < *bound),
        ConditionKind::Above(name, bound) => {
            let bound = match bound {
                Bound::Number(bound) => *bound,
                Bound::Param(param) => number(Variable::Param(&param.text))?,
            };
            number(Variable::Measured(&name.text)).map(|value| value > bound)
        }
    }
}
