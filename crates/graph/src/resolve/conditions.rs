//! Names in conditions, of nodes and of refusals.

use super::Linker;
use crate::{condition::ConditionKind, diagnostics::Diagnostic, reader::Spanned, render::suggest, value::ParamKind};

impl<'a> Linker<'a, '_> {
    /// Whether some refusal cannot be decided, because it could not be read or names what is not there.
    pub(super) fn refusals(&mut self) -> bool {
        let before = self.out.len();
        self.undecided = self.pipeline.gaps.refuse;
        for refusal in &self.pipeline.refuse {
            self.condition(&refusal.when);
        }
        self.undecided || self.out.len() > before
    }

    pub(super) fn condition(&mut self, condition: &'a crate::condition::Condition) {
        let mut leaves = Vec::new();
        condition.leaves(&mut |leaf| leaves.push(leaf));
        for leaf in leaves {
            match &leaf.kind {
                ConditionKind::Feature(name) if !self.features.contains(&name.text.as_str()) => {
                    let help = suggest(&name.text, self.features.iter().copied());
                    self.push(Diagnostic::error(format!("there is no scene feature `{}`", name.text), name.span.clone()).help(help));
                }
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
                ConditionKind::IsOn(name) => {
                    self.condition_param(name, "IsOn", "Bool");
                }
                ConditionKind::AtLeast(name, _) => {
                    self.condition_param(name, "AtLeast", "number");
                }
                ConditionKind::Below(name, _) => {
                    self.condition_param(name, "Below", "number");
                }
                _ => {}
            }
        }
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
        let instead = match kind {
            "Choice" => "Is(\"parameter\", \"option\")",
            "Bool" => "IsOn(\"parameter\")",
            _ => "AtLeast(\"parameter\", n) or Below(\"parameter\", n)",
        };
        let fault = Diagnostic::error(format!("`{form}` tests a {wanted}, and `{}` is {kind}", name.text), name.span.clone());
        self.push(fault.and(param.span.clone(), "declared here").help(format!("write {instead}")));
        None
    }
}
