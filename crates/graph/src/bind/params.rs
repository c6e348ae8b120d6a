//! Parameters in a shader: members of `params` and overrides.

use std::collections::BTreeSet;

use super::{Binder, PARAMS};
use crate::{
    diagnostics::{Diagnostic, Span},
    registry::{Over, Param, Repeat, Step},
    render::suggest,
    shader::{Global, GlobalKind, MemberKind, Scalar},
    value::ParamKind,
    wgsl,
};

impl Binder<'_> {
    /// The uniform `params`: each member is a parameter.
    pub(super) fn params(&mut self, global: &Global) {
        let GlobalKind::Uniform { element, .. } = &global.kind else {
            let fault = Diagnostic::error("`params` is the uniform of the node's parameters", global.span.clone());
            self.out.push(fault.help("write `var<uniform> params: Params;`, or rename it"));
            return;
        };
        let Some(layout) = self.shader.layouts.get(element) else { return };
        for member in &layout.members {
            let range = wgsl::member(&self.wgsl().text, element, &member.name);
            let place = range.map_or_else(|| global.span.clone(), |r| Span::new(self.wgsl(), r));
            let Some(param) = self.decl.params.get(&member.name) else {
                let help = suggest(&member.name, self.decl.params.keys().map(String::as_str));
                self.out.push(
                    Diagnostic::error(format!("`{}` is no parameter of this node", member.name), place)
                        .and(self.decl.span.clone(), "the node's declaration")
                        .help(help),
                );
                continue;
            };
            let scalar = match member.kind {
                MemberKind::Numeric { scalar, rows: 1, columns: 1, .. } => Some(scalar),
                _ => None,
            };
            let (fits, wanted) = match param.kind {
                ParamKind::Int { .. } => (matches!(scalar, Some(Scalar::I32 | Scalar::U32)), "i32 or u32"),
                ParamKind::Float { .. } => (scalar == Some(Scalar::F32), "f32"),
                ParamKind::Bool { .. } => (scalar == Some(Scalar::U32), "u32 (0 or 1)"),
                ParamKind::Choice { .. } => (scalar == Some(Scalar::U32), "u32 (the index of the option)"),
            };
            if !fits {
                self.out.push(
                    Diagnostic::error(
                        format!("`{}` has the wrong type for a parameter of type {}", member.name, param.kind.type_name()),
                        place,
                    )
                    .and(param.span.clone(), "the parameter")
                    .help(format!("declare it as {wanted}")),
                );
            } else if scalar == Some(Scalar::U32) {
                self.check_sign(param, &member.name, place);
            }
        }
    }

    pub(super) fn check_sign(&mut self, param: &Param, name: &str, place: Span) {
        if let ParamKind::Int { min, .. } = param.kind
            && min < 0
        {
            let fault = Diagnostic::error(format!("`{name}` can be negative, and u32 cannot"), place);
            self.out.push(fault.and(param.span.clone(), format!("it starts at {min}")).help("declare it as i32"));
        }
    }

    pub(super) fn overrides(&mut self) {
        for (name, scalar) in &self.shader.overrides {
            let place = self.item_span("override", name);
            if let Some(param) = self.decl.params.get(name) {
                let (fits, wanted) = match param.kind {
                    ParamKind::Int { .. } => (matches!(scalar, Scalar::I32 | Scalar::U32), "i32 or u32"),
                    ParamKind::Float { .. } => (*scalar == Scalar::F32, "f32"),
                    ParamKind::Bool { .. } => (matches!(scalar, Scalar::Bool | Scalar::U32), "bool"),
                    ParamKind::Choice { .. } => (*scalar == Scalar::U32, "u32 (the index of the option)"),
                };
                if !fits {
                    self.out.push(
                        Diagnostic::error(
                            format!("the override `{name}` has the wrong type for a parameter of type {}", param.kind.type_name()),
                            place,
                        )
                        .and(param.span.clone(), "the parameter")
                        .help(format!("declare it as {wanted}")),
                    );
                } else if *scalar == Scalar::U32 {
                    self.check_sign(param, name, place);
                }
                continue;
            }
            match self.option_of(name) {
                Some((_, options, option)) if options.iter().any(|o| o == option) => {
                    if *scalar != Scalar::Bool {
                        let fault = Diagnostic::error(format!("the override `{name}` tests an option and must be bool"), place);
                        self.out.push(fault.help(format!("write `override {name}: bool = false;`")));
                    }
                }
                Some((param, options, option)) => {
                    let help = suggest(option, options.iter().map(String::as_str));
                    self.out.push(
                        Diagnostic::error(format!("the override `{name}` tests an option `{option}` that does not exist"), place)
                            .and(param.span.clone(), "the parameter")
                            .help(help),
                    );
                }
                None => {
                    let help = suggest(name, self.decl.params.keys().map(String::as_str));
                    self.out.push(
                        Diagnostic::error(format!("the override `{name}` is no parameter of this node"), place)
                            .and(self.decl.span.clone(), "the node's declaration")
                            .help(help),
                    );
                }
            }
        }
    }

    /// `flux_is_sum` is the option `sum` of the choice `flux`.
    pub(super) fn option_of<'n>(&self, name: &'n str) -> Option<(&Param, &[String], &'n str)> {
        name.match_indices("_is_").find_map(|(at, mark)| {
            let param = self.decl.params.get(&name[..at])?;
            match &param.kind {
                ParamKind::Choice { options, .. } => Some((param, options.as_slice(), &name[at + mark.len()..])),
                _ => None,
            }
        })
    }

    pub(super) fn unused_params(&mut self) {
        let uniform = self.shader.globals.iter().find(|g| g.name == PARAMS).and_then(|g| match &g.kind {
            GlobalKind::Uniform { element, .. } => self.shader.layouts.get(element),
            _ => None,
        });
        let mut used: BTreeSet<&str> = uniform.iter().flat_map(|l| l.members.iter().map(|m| m.name.as_str())).collect();
        for (name, _) in &self.shader.overrides {
            used.insert(name);
            if let Some((param, ..)) = self.option_of(name)
                && let Some((name, _)) = self.decl.params.iter().find(|(_, p)| std::ptr::eq(*p, param))
            {
                used.insert(name);
            }
        }
        used.extend(self.decl.settles.as_deref());
        used.extend(crate::declaration::when::tested(&self.decl.ports).map(|name| name.text.as_str()));
        let mut in_steps = BTreeSet::new();
        self.decl.steps.iter().for_each(|s| step_params(s, &mut in_steps));
        for (name, param) in &self.decl.params {
            if used.contains(name.as_str()) || in_steps.contains(name.as_str()) {
                continue;
            }
            // A misspelt member or override is reported with this parameter as the suggestion.
            let strangers = used.iter().copied().filter(|u| !self.decl.params.contains_key(*u));
            if crate::render::nearest(name, strangers).is_some() {
                continue;
            }
            self.out.push(
                Diagnostic::error(format!("nothing uses the parameter `{name}`"), param.span.clone())
                    .help("add it to the members of `params`, to the overrides or to a step, or remove it"),
            );
        }
    }
}

fn step_params(step: &Step, found: &mut BTreeSet<String>) {
    use crate::registry::Expr;
    fn walk(expr: &Expr, found: &mut BTreeSet<String>) {
        match expr {
            Expr::Param(name) => {
                found.insert(name.clone());
            }
            Expr::Mul(list) | Expr::Add(list) | Expr::Min(list) | Expr::Max(list) => list.iter().for_each(|e| walk(e, found)),
            Expr::DivCeil(a, b) | Expr::Div(a, b) => {
                walk(a, found);
                walk(b, found);
            }
            Expr::NextPowerOfTwo(a) => walk(a, found),
            _ => {}
        }
    }
    match step {
        Step::Compute { over, repeat, .. } => {
            if let Over::Threads(x, y, z) | Over::Groups(x, y, z) = over {
                [x, y, z].into_iter().for_each(|e| walk(e, found));
            }
            if let Some(Repeat::Times(count)) = repeat {
                walk(count, found);
            }
        }
        Step::Draw { vertices, instances, .. } => [vertices, instances].into_iter().for_each(|e| walk(e, found)),
    }
}
