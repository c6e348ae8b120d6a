//! Values of parameters: defaults, then presets, then what the user sets.

use std::collections::BTreeMap;

use crate::{
    condition::Condition,
    diagnostics::Diagnostic,
    resolve::{Linked, LinkedNode, ParamSource, settable},
    value::{ParamKind, Value},
};

/// The value of every parameter.
#[derive(Debug, Clone)]
pub(crate) struct Values<'a> {
    /// Of the pipeline, in document order.
    pub pipeline: Vec<(&'a str, Value)>,
    by_name: BTreeMap<&'a str, Value>,
    /// Of single nodes, by `node.parameter`.
    nodes: BTreeMap<String, Value>,
}

impl<'a> Values<'a> {
    /// Defaults and presets, then `set`. Faults of presets are reported by linking, those of `set` go to `out`.
    pub fn assign(linked: &Linked<'a>, set: &[(String, String)], out: &mut Vec<Diagnostic>) -> Self {
        let mut by_name: BTreeMap<&str, Value> = linked.pipeline.params.iter().map(|(n, p)| (n.as_str(), p.kind.default_value())).collect();
        let mut nodes = BTreeMap::new();
        let mut put = |name: &str, value: Value| match by_name.get_mut(name) {
            Some(slot) => *slot = value,
            None => {
                nodes.insert(name.to_owned(), value);
            }
        };
        for (name, preset) in &linked.pipeline.set {
            if let Ok(Some(kind)) = settable(linked.pipeline, &linked.nodes, name)
                && let Ok(value) = kind.accept(&preset.value)
            {
                put(name, value);
            }
        }
        for (name, text) in set {
            match settable(linked.pipeline, &linked.nodes, name) {
                Ok(Some(kind)) => match kind.parse(text) {
                    Ok(value) => put(name, value),
                    Err(remedy) => out.push(Diagnostic::error_nowhere(format!("`{text}` is no value of `{name}`")).help(remedy)),
                },
                Ok(None) => {}
                Err((message, help)) => out.push(Diagnostic::error_nowhere(message).help(help)),
            }
        }
        let pipeline = linked.pipeline.params.keys().map(|n| (n.as_str(), by_name[n.as_str()].clone())).collect();
        Self { pipeline, by_name, nodes }
    }

    /// A pipeline parameter.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.by_name.get(name)
    }

    /// Gives a pipeline parameter another value.
    pub fn replace(&mut self, name: &'a str, value: Value) {
        if let Some((_, slot)) = self.pipeline.iter_mut().find(|(n, _)| *n == name) {
            slot.clone_from(&value);
        }
        self.by_name.insert(name, value);
    }

    /// All parameters of a node; `holds` decides where a condition does.
    pub fn of_node(&self, node: &LinkedNode<'_>, holds: &dyn Fn(&Condition) -> bool) -> Vec<(String, Value)> {
        let Some(decl) = node.decl else { return Vec::new() };
        node.params
            .iter()
            .map(|(name, source)| {
                let kind = &decl.params[*name].kind;
                let value =
                    self.nodes.get(&format!("{}.{name}", node.usage.id.text)).cloned().unwrap_or_else(|| self.from(source, kind, holds));
                ((*name).to_owned(), value)
            })
            .collect()
    }

    /// Whether a parameter of a node is set from outside.
    pub fn is_set(&self, node: &str, name: &str) -> bool {
        self.nodes.contains_key(&format!("{node}.{name}"))
    }

    fn from(&self, source: &ParamSource<'_>, kind: &ParamKind, holds: &dyn Fn(&Condition) -> bool) -> Value {
        match source {
            ParamSource::Fixed(value) => value.clone(),
            ParamSource::Pipeline(own) => convert(self.get(own), kind),
            ParamSource::Default => kind.default_value(),
            ParamSource::If(when, then, otherwise) => self.from(if holds(when) { then } else { otherwise }, kind, holds),
        }
    }
}

fn convert(value: Option<&Value>, kind: &ParamKind) -> Value {
    match (value, kind) {
        (Some(Value::Int(v)), ParamKind::Float { .. }) => Value::Float(*v as f64),
        (Some(value), _) => value.clone(),
        (None, _) => kind.default_value(),
    }
}
