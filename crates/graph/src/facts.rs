//! What conditions come to: parameter values and a scene's features decide, and say which clause did.

use std::collections::BTreeMap;

use crate::{
    assign::Values,
    condition::{Bound, Condition, ConditionKind},
    features::Measured,
    plan::PlanInput,
    reader::Spanned,
    resolve::Linked,
    value::Value,
};

/// What is known of a scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen<'f> {
    pub features: &'f BTreeMap<String, bool>,
    pub measured: &'f BTreeMap<String, Measured>,
}

impl<'f> From<&'f PlanInput> for Seen<'f> {
    fn from(input: &'f PlanInput) -> Self {
        Self { features: &input.features, measured: &input.measured }
    }
}

/// What a condition came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Verdict {
    pub holds: bool,
    /// The clauses that decided, with the values that they met; each once.
    clauses: Vec<String>,
}

impl Verdict {
    pub fn why(&self) -> String {
        self.clauses.join("; ")
    }

    fn of(holds: bool, why: String) -> Self {
        Self { holds, clauses: vec![why] }
    }

    /// A verdict to which all of them led.
    fn all_of(holds: bool, verdicts: Vec<Self>) -> Self {
        let mut clauses: Vec<String> = Vec::new();
        for clause in verdicts.into_iter().flat_map(|verdict| verdict.clauses) {
            if !clauses.contains(&clause) {
                clauses.push(clause);
            }
        }
        Self { holds, clauses }
    }
}

/// Everything that conditions depend on. Names that are unknown count as "does not hold"; they are reported elsewhere.
#[derive(Debug, Clone)]
pub(crate) struct Facts<'f> {
    values: &'f Values<'f>,
    seen: Seen<'f>,
    /// Verdicts of the conditions with names.
    named: BTreeMap<&'f str, Verdict>,
}

impl<'f> Facts<'f> {
    pub fn new(linked: &Linked<'f>, values: &'f Values<'f>, seen: Seen<'f>) -> Self {
        let mut facts = Self { values, seen, named: BTreeMap::new() };
        for name in &linked.conditions {
            let verdict = facts.verdict(&linked.pipeline.conditions[*name].when);
            facts.named.insert(name, verdict);
        }
        facts
    }

    pub fn holds(&self, condition: &Condition) -> bool {
        self.verdict(condition).holds
    }

    /// What the conditions with names came to.
    pub fn named(&self) -> BTreeMap<&'f str, bool> {
        self.named.iter().map(|(name, verdict)| (*name, verdict.holds)).collect()
    }

    pub fn verdict(&self, condition: &Condition) -> Verdict {
        match &condition.kind {
            ConditionKind::All(list) => {
                let mut verdicts: Vec<Verdict> = list.iter().map(|c| self.verdict(c)).collect();
                match verdicts.iter().position(|v| !v.holds) {
                    Some(first) => verdicts.swap_remove(first),
                    None => Verdict::all_of(true, verdicts),
                }
            }
            ConditionKind::Any(list) => {
                let mut verdicts: Vec<Verdict> = list.iter().map(|c| self.verdict(c)).collect();
                match verdicts.iter().position(|v| v.holds) {
                    Some(first) => verdicts.swap_remove(first),
                    None => Verdict::all_of(false, verdicts),
                }
            }
            ConditionKind::Not(inner) => {
                let inner = self.verdict(inner);
                Verdict { holds: !inner.holds, ..inner }
            }
            ConditionKind::Switch(name, inner) => {
                let position = self.met(name);
                let auto = Verdict::of(false, format!("`{}` is {position}", name.text));
                match position.as_str() {
                    "on" => Verdict { holds: true, ..auto },
                    "auto" => {
                        let inner = self.verdict(inner);
                        Verdict::all_of(inner.holds, vec![auto, inner])
                    }
                    _ => auto,
                }
            }
            ConditionKind::Holds(name) => {
                let unknown = || Verdict::of(false, format!("the condition `{}` is unknown", name.text));
                self.named.get(name.text.as_str()).cloned().unwrap_or_else(unknown)
            }
            _ => self.leaf(&condition.kind),
        }
    }

    fn leaf(&self, kind: &ConditionKind) -> Verdict {
        match kind {
            ConditionKind::Is(name, option) => {
                let holds = matches!(self.values.get(&name.text), Some(Value::Choice(v)) if *v == option.text);
                let verb = if holds { "is" } else { "is not" };
                let met = if holds { String::new() } else { format!(" but `{}`", self.met(name)) };
                Verdict::of(holds, format!("`{}` {verb} `{}`{met}", name.text, option.text))
            }
            ConditionKind::IsOn(name) => {
                let holds = self.values.get(&name.text) == Some(&Value::Bool(true));
                Verdict::of(holds, format!("`{}` is {}", name.text, if holds { "on" } else { "off" }))
            }
            ConditionKind::AtLeast(name, bound) => {
                let holds = self.number(name).is_some_and(|v| v >= *bound);
                let verb = if holds { "at least" } else { "below" };
                Verdict::of(holds, format!("`{}` is {}, {verb} {bound}", name.text, self.met(name)))
            }
            ConditionKind::Below(name, bound) => {
                let holds = self.number(name).is_some_and(|v| v < *bound);
                let verb = if holds { "below" } else { "not below" };
                Verdict::of(holds, format!("`{}` is {}, {verb} {bound}", name.text, self.met(name)))
            }
            ConditionKind::Feature(name) => {
                let holds = self.seen.features.get(&name.text).copied().unwrap_or(false);
                let verb = if holds { "has" } else { "does not have" };
                Verdict::of(holds, format!("the scene {verb} `{}`", name.text))
            }
            ConditionKind::Above(name, bound) => self.above(name, bound),
            _ => Verdict::of(false, "unknown".to_owned()),
        }
    }

    fn above(&self, name: &Spanned, bound: &Bound) -> Verdict {
        let (bound, shown) = match bound {
            Bound::Number(bound) => (Some(*bound), bound.to_string()),
            Bound::Param(param) => (self.number(param), format!("{} (`{}`)", self.met(param), param.text)),
        };
        let Some(bound) = bound else { return Verdict::of(false, format!("`{}` has no bound", name.text)) };
        match self.seen.measured.get(&name.text) {
            None => Verdict::of(true, format!("`{}` is not measured, which counts as above {shown}", name.text)),
            Some(measured) => {
                let holds = measured.above(bound);
                let verb = match holds {
                    true if measured.value <= bound => "which may be above",
                    true => "above",
                    false => "not above",
                };
                Verdict::of(holds, format!("`{}` is {measured}, {verb} {shown}", name.text))
            }
        }
    }

    /// The value of a number parameter.
    fn number(&self, name: &Spanned) -> Option<f64> {
        self.values.get(&name.text)?.number()
    }

    fn met(&self, name: &Spanned) -> String {
        self.values.get(&name.text).map_or_else(|| "unknown".to_owned(), Value::to_string)
    }
}
