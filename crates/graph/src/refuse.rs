//! Combinations of values that a pipeline refuses, and what to do instead.

use crate::{
    assign::Values,
    condition::{Bound, Condition, ConditionKind},
    diagnostics::Diagnostic,
    facts::{Facts, Seen},
    features::Measured,
    pipeline::Refusal,
    resolve::Linked,
    value::{ParamKind, Value},
};

/// An error for each refusal that the values meet. `given` are those from outside: of the others, the place where a preset sets them is shown.
pub(crate) fn refused(linked: &Linked<'_>, values: &Values<'_>, given: &[(String, String)], seen: Seen<'_>) -> Vec<Diagnostic> {
    let refusals = Refusals { linked, values, seen, facts: Facts::new(linked, values, seen) };
    let met = linked.pipeline.refuse.iter().filter(|refusal| refusals.facts.holds(&refusal.when));
    met.map(|refusal| refusals.fault(refusal, given)).collect()
}

struct Refusals<'l, 'a> {
    linked: &'l Linked<'a>,
    values: &'l Values<'a>,
    seen: Seen<'l>,
    facts: Facts<'l>,
}

impl<'a> Refusals<'_, 'a> {
    fn fault(&self, refusal: &'a Refusal, given: &[(String, String)]) -> Diagnostic {
        let met = self.facts.verdict(&refusal.when);
        let reason = refusal.because.trim_end_matches('.');
        let mut fault = Diagnostic::error(format!("these values are refused: {reason}"), refusal.when.span.clone()).at(met.why());
        let mut remedies: Vec<String> = Vec::new();
        let mut names: Vec<&str> = Vec::new();
        self.linked.pipeline.clauses(&refusal.when, &mut |clause| {
            for name in clause.params().map(|name| name.text.as_str()) {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
            remedies.extend(self.scene(clause, refusal).filter(|remedy| !remedies.contains(remedy)));
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
            let changed = Facts::new(self.linked, &changed, self.seen);
            let others = &self.linked.pipeline.refuse;
            !changed.holds(&refusal.when) && others.iter().all(|other| !changed.holds(&other.when) || self.facts.holds(&other.when))
        };
        let good: Vec<String> =
            self.candidates(&param.kind, name, &refusal.when).into_iter().filter(better).map(|v| v.to_string()).collect();
        let last = good.last()?;
        let list = match &good[..good.len() - 1] {
            [] => format!("`{last}`"),
            others => format!("{} or `{last}`", others.iter().map(|v| format!("`{v}`")).collect::<Vec<_>>().join(", ")),
        };
        Some(format!("set `{name}` to {list}"))
    }

    /// The other kind of scene, where that would be accepted.
    fn scene(&self, clause: &Condition, refusal: &Refusal) -> Option<String> {
        let (mut features, mut measured) = (self.seen.features.clone(), self.seen.measured.clone());
        let remedy = match &clause.kind {
            ConditionKind::Feature(name) => {
                let has = features.insert(name.text.clone(), true).unwrap_or(false);
                features.insert(name.text.clone(), !has);
                format!("take a scene {} `{}`", if has { "without" } else { "with" }, name.text)
            }
            ConditionKind::Above(name, _) => {
                let other = if self.facts.holds(clause) { 0.0 } else { f64::INFINITY };
                measured.insert(name.text.clone(), Measured { value: other, standard_error: 0.0 });
                format!("take a scene with {} `{}`", if other > 0.0 { "more" } else { "less" }, name.text)
            }
            _ => return None,
        };
        let seen = Seen { features: &features, measured: &measured };
        (!Facts::new(self.linked, self.values, seen).holds(&refusal.when)).then_some(remedy)
    }

    /// Values that may end a refusal: all options; of numbers, those on both sides of the bounds that it tests, and of what was measured.
    fn candidates(&self, kind: &ParamKind, name: &str, when: &'a Condition) -> Vec<Value> {
        let mut bounds = Vec::new();
        let mut estimates = Vec::new();
        self.linked.pipeline.clauses(when, &mut |clause| match &clause.kind {
            ConditionKind::AtLeast(tested, bound) | ConditionKind::Below(tested, bound) if tested.text == name => bounds.push(*bound),
            ConditionKind::Above(feature, Bound::Param(tested)) if tested.text == name => {
                estimates.extend(self.seen.measured.get(&feature.text).map(Measured::at_most));
            }
            _ => {}
        });
        match kind {
            ParamKind::Bool { .. } => vec![Value::Bool(false), Value::Bool(true)],
            ParamKind::Choice { options, .. } => options.iter().cloned().map(Value::Choice).collect(),
            ParamKind::Int { min, max, .. } => {
                let sides =
                    bounds.iter().chain(&estimates).flat_map(|bound| [(bound.ceil() as i64).saturating_sub(1), bound.ceil() as i64]);
                sides.filter(|value| (*min..=*max).contains(value)).map(Value::Int).collect()
            }
            // Just below a bound is no number that anyone would write.
            ParamKind::Float { min, max, .. } => {
                let sides = bounds.iter().flat_map(|bound| [*min, *bound]);
                let around = estimates.iter().flat_map(|estimate| [*min, short_above(*estimate)]);
                sides.chain(around).filter(|value| (*min..=*max).contains(value)).map(Value::Float).collect()
            }
        }
    }
}

/// A number that is not below, with two digits.
fn short_above(value: f64) -> f64 {
    if !value.is_finite() || value <= 0.0 {
        return value;
    }
    let step = 10f64.powi(value.log10().floor() as i32 - 1);
    let steps = (value / step).ceil();
    // Through its text: so many steps of a power of ten are seldom the number that it would be written as.
    let exponent = step.log10().round() as i32;
    format!("{steps}e{exponent}").parse().unwrap_or(value)
}
