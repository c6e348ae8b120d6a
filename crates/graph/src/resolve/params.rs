//! Parameters of nodes: what is given, what is taken over, what can be set.

use super::{LinkedNode, Linker, ParamSource};
use crate::{
    diagnostics::{Diagnostic, Span},
    pipeline::{ArgumentValue, NodeUse, Pipeline, ValueAt},
    registry::NodeDecl,
    render::suggest,
    value::ParamKind,
};

impl<'a> Linker<'a, '_> {
    pub(super) fn arguments(&mut self, usage: &'a NodeUse, decl: &'a NodeDecl) -> Vec<(&'a str, ParamSource<'a>)> {
        for (name, argument) in &usage.params {
            if !decl.params.contains_key(name) {
                let known = decl.params.keys().map(String::as_str);
                let fault = Diagnostic::error(format!("`{}` has no parameter `{name}`", decl.name), argument.name_span.clone());
                self.push(fault.help(suggest(name, known)));
            }
        }
        decl.params.iter().map(|(name, param)| (name.as_str(), self.argument(usage, name, param))).collect()
    }

    pub(super) fn argument(&mut self, usage: &'a NodeUse, name: &str, param: &'a crate::registry::Param) -> ParamSource<'a> {
        let Some(argument) = usage.params.get(name) else {
            return match self.pipeline.params.get_key_value(name) {
                Some((name, own)) if own.kind.same_type(&param.kind) => {
                    if let Err(why) = own.kind.fits_into(&param.kind) {
                        self.push(
                            Diagnostic::error(
                                format!("parameter `{name}` does not fit `{name}` of node `{}`: {why}", usage.id.text),
                                own.span.clone(),
                            )
                            .and(param.span.clone(), "the node's parameter")
                            .help("narrow the pipeline's parameter, or set the node's one in `params`"),
                        );
                    }
                    ParamSource::Pipeline(name)
                }
                _ => ParamSource::Default,
            };
        };
        self.value(usage, name, param, &argument.value, &argument.span)
    }

    fn value(
        &mut self,
        usage: &'a NodeUse,
        name: &str,
        param: &'a crate::registry::Param,
        value: &'a ArgumentValue,
        span: &'a Span,
    ) -> ParamSource<'a> {
        match value {
            ArgumentValue::Literal(literal) => match param.kind.accept(literal) {
                Ok(value) => ParamSource::Fixed(value),
                Err(remedy) => {
                    self.push(
                        Diagnostic::error(format!("{literal} is no value of the parameter `{name}`"), span.clone())
                            .and(param.span.clone(), "the parameter")
                            .help(remedy),
                    );
                    ParamSource::Default
                }
            },
            ArgumentValue::Param(own_name) => match self.pipeline.params.get_key_value(own_name) {
                Some((own_name, own)) => {
                    if let Err(why) = own.kind.fits_into(&param.kind) {
                        self.push(
                            Diagnostic::error(
                                format!("parameter `{own_name}` does not fit `{name}` of node `{}`: {why}", usage.id.text),
                                span.clone(),
                            )
                            .and(own.span.clone(), "the pipeline's parameter")
                            .and(param.span.clone(), "the node's parameter")
                            .help("change the range, the options or the type"),
                        );
                    }
                    ParamSource::Pipeline(own_name)
                }
                None => {
                    self.unknown_param(own_name, span);
                    ParamSource::Default
                }
            },
            ArgumentValue::If { when, then, otherwise } => {
                self.condition(when);
                let mut branch = |of: &'a ValueAt| Box::new(self.value(usage, name, param, &of.value, &of.span));
                let (then, otherwise) = (branch(then), branch(otherwise));
                ParamSource::If(when, then, otherwise)
            }
        }
    }
}

/// The parameter that `name` or `node.name` sets; `Ok(None)` when its node is faulty. Otherwise message and help.
pub(crate) fn settable<'a>(
    pipeline: &'a Pipeline,
    nodes: &[LinkedNode<'a>],
    name: &str,
) -> Result<Option<&'a ParamKind>, (String, String)> {
    let Some((id, param)) = name.split_once('.') else {
        return match pipeline.params.get(name) {
            Some(param) => Ok(Some(&param.kind)),
            None => {
                let known = pipeline.params.keys().map(String::as_str);
                Err((format!("the pipeline `{}` has no parameter `{name}`", pipeline.name), suggest(name, known)))
            }
        };
    };
    let Some(node) = nodes.iter().find(|n| n.usage.id.text == id) else {
        let known = pipeline.nodes.keys().map(String::as_str);
        return Err((format!("the pipeline `{}` has no node `{id}`", pipeline.name), suggest(id, known)));
    };
    let Some(decl) = node.decl else { return Ok(None) };
    match decl.params.get(param) {
        Some(param) => Ok(Some(&param.kind)),
        None => {
            let known = decl.params.keys().map(String::as_str);
            Err((format!("the node `{id}` ({}) has no parameter `{param}`", decl.name), suggest(param, known)))
        }
    }
}
