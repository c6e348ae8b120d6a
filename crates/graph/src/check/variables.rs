//! What conditions depend on, and the values of it that make a difference to them.

use indexmap::IndexMap;

use crate::{
    condition::{Bound, Condition, ConditionKind},
    features::MEASURED,
    registry::Param,
    value::ParamKind,
};

/// Something that a condition depends on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Variable<'c> {
    Param(&'c str),
    Flag(&'c str),
    Measured(&'c str),
    /// A condition with a name that is not looked into.
    Named(&'c str),
}

/// What it may be.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Point {
    Is(bool),
    Option(String),
    Number(f64),
}

/// The variables of clauses, in the order in which they are met.
pub(super) fn variables_of<'c>(clauses: &[&'c Condition], is_closed: impl Fn(&str) -> bool) -> Vec<Variable<'c>> {
    let mut variables = Vec::new();
    for clause in clauses {
        let own = match &clause.kind {
            ConditionKind::Feature(name) => Some(Variable::Flag(&name.text)),
            ConditionKind::Above(name, _) => Some(Variable::Measured(&name.text)),
            ConditionKind::Holds(name) if is_closed(&name.text) => Some(Variable::Named(&name.text)),
            _ => None,
        };
        for variable in own.into_iter().chain(clause.params().map(|name| Variable::Param(&name.text))) {
            if !variables.contains(&variable) {
                variables.push(variable);
            }
        }
    }
    variables
}

/// The values of a variable between which some clause goes from one outcome to the other.
pub(super) fn points(variable: Variable<'_>, clauses: &[&Condition], params: &IndexMap<String, Param>) -> Vec<Point> {
    match variable {
        Variable::Flag(_) | Variable::Named(_) => [false, true].map(Point::Is).to_vec(),
        Variable::Param(name) => match params.get(name).map(|param| &param.kind) {
            Some(ParamKind::Bool { .. }) => [false, true].map(Point::Is).to_vec(),
            Some(ParamKind::Choice { options, .. }) => options.iter().cloned().map(Point::Option).collect(),
            Some(kind) => numbers(name, kind, clauses).into_iter().map(Point::Number).collect(),
            None => Vec::new(),
        },
        Variable::Measured(name) => measures(name, clauses, params).into_iter().map(Point::Number).collect(),
    }
}

/// Both ends of a parameter's range, and both sides of every bound in it.
fn numbers(name: &str, kind: &ParamKind, clauses: &[&Condition]) -> Vec<f64> {
    let (min, max, is_whole) = match kind {
        ParamKind::Int { min, max, .. } => (*min as f64, *max as f64, true),
        ParamKind::Float { min, max, .. } => (*min, *max, false),
        _ => return Vec::new(),
    };
    let mut numbers = vec![min, max];
    for clause in clauses {
        if let ConditionKind::AtLeast(tested, bound) | ConditionKind::Below(tested, bound) = &clause.kind
            && tested.text == name
        {
            numbers.extend(if is_whole { [bound.ceil() - 1.0, bound.ceil()] } else { [bound.next_down(), *bound] });
        }
    }
    numbers.retain(|number| (min..=max).contains(number));
    in_order(numbers)
}

/// Both ends of a measured feature's range, every bound in it, and something between each two.
fn measures(name: &str, clauses: &[&Condition], params: &IndexMap<String, Param>) -> Vec<f64> {
    let most = MEASURED.iter().find(|feature| feature.name == name).map_or(0.0, |feature| feature.most);
    let mut numbers = vec![0.0];
    for clause in clauses {
        match &clause.kind {
            ConditionKind::Above(tested, Bound::Number(bound)) if tested.text == name => numbers.push(*bound),
            ConditionKind::Above(tested, Bound::Param(param)) if tested.text == name => {
                numbers.extend(params.get(&param.text).map(|p| self::numbers(&param.text, &p.kind, clauses)).unwrap_or_default());
            }
            _ => {}
        }
    }
    numbers.retain(|number| (0.0..=most).contains(number));
    let last = numbers.iter().copied().fold(0.0, f64::max);
    numbers.push(if most.is_finite() { most } else { last + 1.0 });
    let numbers = in_order(numbers);
    let between = numbers.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0).collect::<Vec<_>>();
    in_order([numbers, between].concat())
}

fn in_order(mut numbers: Vec<f64>) -> Vec<f64> {
    numbers.sort_by(f64::total_cmp);
    numbers.dedup();
    numbers
}
