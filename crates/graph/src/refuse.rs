//! Combinations of values that a pipeline refuses, and what to do instead.

use std::collections::BTreeMap;

use crate::{
    assign::Values,
    condition::{Condition, ConditionKind},
    diagnostics::Diagnostic,
    pipeline::Refusal,
    resolve::Linked,
    value::{ParamKind, Value},
};

/// An error for each refusal that the values meet. `given` are those from outside: of the others, the place where a preset sets them is shown.
pub(crate) fn refused(
    linked: &Linked<'_>,
    values: &Values<'_>,
    given: &[(String, String)],
    features: &BTreeMap<String, bool>,
) -> Vec<Diagnostic> {
    let refusals = Refusals { linked, values, features };
    let met = linked.pipeline.refuse.iter().filter(|refusal| refusals.holds(refusal, values));
    met.map(|refusal| refusals.fault(refusal, given)).collect()
}

struct Refusals<'l, 'a> {
    linked: &'l Linked<'a>,
    values: &'l Values<'a>,
    features: &'l BTreeMap<String, bool>,
}

impl<'a> Refusals<'_, 'a> {
    fn holds(&self, refusal: &Refusal, values: &Values<'_>) -> bool {
        refusal.when.eval(&|name| values.get(name).cloned(), self.features).holds
    }

    fn fault(&self, refusal: &'a Refusal, given: &[(String, String)]) -> Diagnostic {
        let met = refusal.when.eval(&|name| self.values.get(name).cloned(), self.features);
        let reason = refusal.because.trim_end_matches('.');
        let mut fault = Diagnostic::error(format!("these values are refused: {reason}"), refusal.when.span.clone()).at(met.why);
        let mut remedies: Vec<String> = Vec::new();
        let mut names: Vec<&str> = Vec::new();
        refusal.when.leaves(&mut |leaf| {
            names.extend(named(leaf).filter(|name| !names.contains(name)));
            remedies.extend(self.scene(leaf, refusal));
        });
        for name in &names {
            let preset = self.linked.pipeline.set.get(*name).filter(|_| !given.iter().any(|(other, _)| other == name));
            if let Some(preset) = preset {
                fault = fault.and(preset.span.clone(), "set here");
            }
        }
        let values: Vec<String> = names.iter().filter_map(|name| self.remedy(name, refusal)).collect();
        remedies.splice(0..0, values);
        fault.help(if remedies.is_empty() { "change more than one of these values".to_owned() } else { remedies.join(", or ") })
    }

    /// What to set a parameter to, so that the refusal no longer holds and no other begins to.
    fn remedy(&self, name: &'a str, refusal: &'a Refusal) -> Option<String> {
        let (own, param) = self.linked.pipeline.params.get_key_value(name)?;
        let better = |value: &Value| {
            let mut changed = self.values.clone();
            changed.replace(own, value.clone());
            let others = &self.linked.pipeline.refuse;
            !self.holds(refusal, &changed) && others.iter().all(|other| !self.holds(other, &changed) || self.holds(other, self.values))
        };
        let good: Vec<String> = candidates(&param.kind, name, &refusal.when).into_iter().filter(better).map(|v| v.to_string()).collect();
        let last = good.last()?;
        let list = match &good[..good.len() - 1] {
            [] => format!("`{last}`"),
            others => format!("{} or `{last}`", others.iter().map(|v| format!("`{v}`")).collect::<Vec<_>>().join(", ")),
        };
        Some(format!("set `{name}` to {list}"))
    }

    /// The other kind of scene, where that would be accepted.
    fn scene(&self, leaf: &Condition, refusal: &Refusal) -> Option<String> {
        let ConditionKind::Feature(name) = &leaf.kind else { return None };
        let has = self.features.get(&name.text).copied().unwrap_or(false);
        let mut features = self.features.clone();
        features.insert(name.text.clone(), !has);
        let other = Refusals { features: &features, linked: self.linked, values: self.values };
        (!other.holds(refusal, self.values)).then(|| format!("take a scene {} `{}`", if has { "without" } else { "with" }, name.text))
    }
}

/// The parameter that a clause tests.
fn named(leaf: &Condition) -> Option<&str> {
    match &leaf.kind {
        ConditionKind::Is(name, _) | ConditionKind::IsOn(name) | ConditionKind::AtLeast(name, _) | ConditionKind::Below(name, _) => {
            Some(&name.text)
        }
        _ => None,
    }
}

/// Values that may end a refusal: all options; of numbers, those on both sides of the bounds that it tests.
fn candidates(kind: &ParamKind, name: &str, when: &Condition) -> Vec<Value> {
    let mut bounds = Vec::new();
    when.leaves(&mut |leaf| {
        if let ConditionKind::AtLeast(tested, bound) | ConditionKind::Below(tested, bound) = &leaf.kind
            && tested.text == name
        {
            bounds.push(*bound);
        }
    });
    match kind {
        ParamKind::Bool { .. } => vec![Value::Bool(false), Value::Bool(true)],
        ParamKind::Choice { options, .. } => options.iter().cloned().map(Value::Choice).collect(),
        ParamKind::Int { min, max, .. } => {
            let sides = bounds.iter().flat_map(|bound| [bound.ceil() as i64 - 1, bound.ceil() as i64]);
            sides.filter(|value| (*min..=*max).contains(value)).map(Value::Int).collect()
        }
        // Just below a bound is no number that anyone would write.
        ParamKind::Float { min, max, .. } => {
            let sides = bounds.iter().flat_map(|bound| [*min, *bound]);
            sides.filter(|value| (*min..=*max).contains(value)).map(Value::Float).collect()
        }
    }
}
