//! The rungs that a renderer can be on.

use manylight_graph::{
    diagnostics::{Diagnostic, Diagnostics},
    pipeline::Pipeline,
    value::Value,
};

use crate::renderer::{Renderer, Settings};

/// The rungs of a pipeline's `quality` that make a difference with a scene and with the values that the user sets.
#[derive(Debug, Clone, PartialEq)]
pub struct Ladder {
    /// Values of the pipeline's parameters on the first rung.
    own: Vec<(String, Value)>,
    /// Parameters that differ from the first rung's.
    rungs: Vec<Vec<(String, Value)>>,
    /// Why rungs are left out although they would change what runs.
    left_out: Vec<String>,
}

impl Ladder {
    /// Plans every rung on top of `base`, without a GPU. Left out are rungs that change nothing of what runs, and those that cannot be planned.
    ///
    /// # Errors
    /// There is nothing to move, or `base` itself cannot be planned.
    pub fn new(renderer: &Renderer, base: &Settings) -> Result<Self, Diagnostics> {
        let pipeline = renderer.pipeline();
        let first = renderer.plan_for(base)?;
        let fixed: Vec<String> = base.set.iter().map(|(name, _)| name.clone()).collect();
        let mut ladder = Self { own: first.params.clone(), rungs: vec![Vec::new()], left_out: Vec::new() };
        let mut last = first;
        for rung in pipeline.rungs(&ladder.own, &fixed).into_iter().skip(1) {
            match renderer.plan_for(&with(base, &rung)) {
                Ok(plan) if plan.same_work(&last) => {}
                Ok(plan) => {
                    ladder.rungs.push(rung);
                    last = plan;
                }
                Err(faults) => ladder.left_out.push(format!("{}: {}", list(&rung), faults.0.first().map_or("", |fault| &fault.message))),
            }
        }
        if ladder.rungs.len() == 1 { Err(ladder.nothing_to_move(pipeline, &fixed)) } else { Ok(ladder) }
    }

    fn nothing_to_move(&self, pipeline: &Pipeline, fixed: &[String]) -> Diagnostics {
        let Some(quality) = &pipeline.quality else {
            let fault =
                Diagnostic::error_nowhere(format!("the pipeline `{}` says not what it can give up to hold a budget", pipeline.name));
            return fault.help("give it a ladder, for example `quality: [{\"clusters\": AtMost(48)}, {\"clusters\": AtMost(32)}]`").into();
        };
        let mut named: Vec<&str> = quality.rungs.iter().flat_map(|rung| &rung.bounds).map(|(name, _)| name.text.as_str()).collect();
        named.retain(|name| fixed.iter().any(|other| other == name));
        named.dedup();
        let help = match (named.as_slice(), self.left_out.first()) {
            (_, Some(reason)) => format!("its rungs cannot be planned: {reason}"),
            ([], None) => "with these values and this scene its rungs change nothing of what runs".to_owned(),
            (names, None) => format!("leave some of these to the budget: {}", names.join(", ")),
        };
        Diagnostic::error(format!("`{}` has nothing left to give up to hold a budget", pipeline.name), quality.span.clone())
            .help(help)
            .into()
    }

    /// Number of rungs, with the first.
    pub fn len(&self) -> usize {
        self.rungs.len()
    }

    /// Never: there are at least two.
    pub fn is_empty(&self) -> bool {
        self.rungs.is_empty()
    }

    /// The settings of a rung.
    pub fn settings(&self, base: &Settings, rung: usize) -> Settings {
        with(base, &self.rungs[rung])
    }

    /// Parameters whose values differ between two rungs, with both values.
    pub fn moved(&self, from: usize, to: usize) -> Vec<(&str, &Value, &Value)> {
        let on = |rung: usize, name: &str, own| self.rungs[rung].iter().find(|(known, _)| known == name).map_or(own, |(_, value)| value);
        let all = self.own.iter().map(|(name, own)| (name.as_str(), on(from, name, own), on(to, name, own)));
        all.filter(|(_, before, after)| before != after).collect()
    }

    /// Rungs that cannot be planned, and why.
    pub fn left_out(&self) -> &[String] {
        &self.left_out
    }
}

fn with(base: &Settings, rung: &[(String, Value)]) -> Settings {
    let mut settings = base.clone();
    settings.set.extend(rung.iter().map(|(name, value)| (name.clone(), value.to_string())));
    settings
}

fn list(values: &[(String, Value)]) -> String {
    values.iter().map(|(name, value)| format!("`{name}` {value}")).collect::<Vec<_>>().join(", ")
}
