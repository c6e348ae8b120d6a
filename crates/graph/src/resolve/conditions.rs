//! Names in conditions: of nodes, of their parameters' values, of refusals, and of conditions that have names themselves.

use super::Linker;
use crate::{
    condition::{Bound, Condition, ConditionKind},
    diagnostics::Diagnostic,
    features,
    reader::Spanned,
    render::suggest,
    value::ParamKind,
};

impl<'a> Linker<'a, '_> {
    /// Checks the conditions with names, and puts those that can be decided in an order in which each comes after those that it names.
    pub(super) fn conditions(&mut self) -> Vec<&'a str> {
        let mut order = Vec::new();
        for name in self.pipeline.conditions.keys() {
            self.named(name, &mut Vec::new(), &mut order);
        }
        order
    }

    /// Whether the condition of a name can be decided. `path` holds those that lead to it.
    fn named(&mut self, name: &'a str, path: &mut Vec<&'a str>, order: &mut Vec<&'a str>) -> bool {
        if let Some(decided) = self.decided.get(name) {
            return *decided;
        }
        if let Some(at) = path.iter().position(|other| *other == name) {
            self.circle(&path[at..]);
            return false;
        }
        path.push(name);
        let when = &self.pipeline.conditions[name].when;
        let mut inner = Vec::new();
        when.clauses(&mut |clause| inner.extend(if let ConditionKind::Holds(other) = &clause.kind { Some(other) } else { None }));
        let mut decided = true;
        for other in inner {
            if let Some((other, _)) = self.pipeline.conditions.get_key_value(&other.text) {
                decided &= self.named(other, path, order);
            }
        }
        path.pop();
        // One that waits for itself is met again on the way back.
        if let Some(decided) = self.decided.get(name) {
            return *decided;
        }
        let before = self.out.len();
        self.undecided = false;
        self.condition(when);
        decided &= !self.undecided && self.out.len() == before;
        self.decided.insert(name, decided);
        if decided {
            order.push(name);
        }
        decided
    }

    fn circle(&mut self, names: &[&'a str]) {
        let place = |at: usize| {
            let (from, to) = (names[at], names[(at + 1) % names.len()]);
            let mut span = None;
            self.pipeline.conditions[from].when.clauses(&mut |clause| match &clause.kind {
                ConditionKind::Holds(name) if name.text == to => span = span.take().or(Some(name.span.clone())),
                _ => {}
            });
            (span, format!("`{from}` names `{to}`"))
        };
        let shown: Vec<&str> = names.iter().chain(names.first()).copied().collect();
        let mut places = (0..names.len()).map(place);
        let Some((Some(first), _)) = places.next() else { return };
        let mut fault = Diagnostic::error(format!("conditions wait for each other in a circle: {}", shown.join(" → ")), first);
        for (span, said) in places {
            if let Some(span) = span {
                fault = fault.and(span, said);
            }
        }
        self.decided.extend(names.iter().map(|name| (*name, false)));
        self.push(fault.help("say what one of them means without the others"));
    }

    /// Whether some refusal cannot be decided, because it could not be read or names what is not there.
    pub(super) fn refusals(&mut self) -> bool {
        let before = self.out.len();
        self.undecided = self.pipeline.gaps.refuse;
        for refusal in &self.pipeline.refuse {
            self.condition(&refusal.when);
        }
        self.undecided || self.out.len() > before
    }

    pub(super) fn condition(&mut self, condition: &'a Condition) {
        let mut clauses = Vec::new();
        condition.clauses(&mut |clause| clauses.push(clause));
        for clause in clauses {
            match &clause.kind {
                ConditionKind::Feature(name) => self.flag(name),
                ConditionKind::Above(name, bound) => {
                    self.measured(name);
                    if let Bound::Param(param) = bound {
                        self.condition_param(param, "Above", "number");
                    }
                }
                ConditionKind::Holds(name) => self.condition_name(name),
                ConditionKind::Is(name, option) => {
                    if let Some(ParamKind::Choice { options, .. }) = self.condition_param(name, "Is", "Choice")
                        && !options.contains(&option.text)
                    {
                        let help = suggest(&option.text, options.iter().map(String::as_str));
                        self.push(
                            Diagnostic::error(format!("`{}` has no option `{}`", name.text, option.text), option.span.clone()).help(help),
                        );
                    }
                }
                ConditionKind::Switch(name, _) => self.switch(name),
                ConditionKind::IsOn(name) => {
                    self.condition_param(name, "IsOn", "Bool");
                }
                ConditionKind::AtLeast(name, _) => {
                    self.condition_param(name, "AtLeast", "number");
                }
                ConditionKind::Below(name, _) => {
                    self.condition_param(name, "Below", "number");
                }
                ConditionKind::All(_) | ConditionKind::Any(_) | ConditionKind::Not(_) => {}
            }
        }
    }

    fn flag(&mut self, name: &Spanned) {
        if self.features.contains(&name.text.as_str()) {
            return;
        }
        let help = if features::measured().any(|known| known == name.text) {
            format!("it is measured: write Above(\"{}\", 0.02)", name.text)
        } else {
            suggest(&name.text, self.features.iter().copied())
        };
        self.push(Diagnostic::error(format!("there is no scene feature `{}`", name.text), name.span.clone()).help(help));
    }

    fn measured(&mut self, name: &Spanned) {
        if features::measured().any(|known| known == name.text) {
            return;
        }
        let help = if self.pipeline.params.get(&name.text).is_some_and(|param| matches!(param.kind.type_name(), "Int" | "Float")) {
            format!("it is a parameter: write AtLeast(\"{}\", n) or Below(\"{0}\", n)", name.text)
        } else if features::flags().any(|known| known == name.text) {
            format!("a scene has it or not: write Feature(\"{}\")", name.text)
        } else {
            suggest(&name.text, features::measured())
        };
        self.push(Diagnostic::error(format!("there is no measured feature `{}`", name.text), name.span.clone()).help(help));
    }

    pub(super) fn condition_name(&mut self, name: &Spanned) {
        let (known, gaps) = (&self.pipeline.conditions, &self.pipeline.gaps);
        if known.contains_key(&name.text) {
            self.undecided |= self.decided.get(name.text.as_str()) == Some(&false);
        } else if gaps.files || gaps.conditions.contains(&name.text) {
            self.undecided = true;
        } else {
            let help = suggest(&name.text, known.keys().map(String::as_str));
            self.push(Diagnostic::error(format!("the pipeline has no condition `{}`", name.text), name.span.clone()).help(help));
        }
    }

    fn switch(&mut self, name: &Spanned) {
        let Some(param) = self.pipeline.params.get(&name.text) else { return self.unknown_param(&name.text, &name.span) };
        if param.kind.is_switch() {
            return;
        }
        let found = match &param.kind {
            ParamKind::Choice { .. } => param.kind.describe(),
            other => other.type_name().to_owned(),
        };
        let fault = Diagnostic::error(
            format!("`Switch` tests a choice of `auto`, `on` and `off`, and `{}` is {found}", name.text),
            name.span.clone(),
        );
        let help = format!("declare it as `\"{}\": Switch(default: \"auto\", doc: \"…\")`", name.text);
        self.push(fault.and(param.span.clone(), "declared here").help(help));
    }

    pub(super) fn condition_param(&mut self, name: &Spanned, form: &str, wanted: &str) -> Option<&'a ParamKind> {
        let Some(param) = self.pipeline.params.get(&name.text) else {
            self.unknown_param(&name.text, &name.span);
            return None;
        };
        let kind = param.kind.type_name();
        if kind == wanted || (wanted == "number" && matches!(kind, "Int" | "Float")) {
            return Some(&param.kind);
        }
        let help = match (form, kind) {
            ("Above", _) => "compare with a number, or with a parameter that is one",
            (_, "Choice") => "write Is(\"parameter\", \"option\")",
            (_, "Bool") => "write IsOn(\"parameter\")",
            _ => "write AtLeast(\"parameter\", n) or Below(\"parameter\", n)",
        };
        let tests = if form == "Above" { "compares with" } else { "tests" };
        let fault = Diagnostic::error(format!("`{form}` {tests} a {wanted}, and `{}` is {kind}", name.text), name.span.clone());
        self.push(fault.and(param.span.clone(), "declared here").help(help));
        None
    }
}
