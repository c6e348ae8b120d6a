//! A frame time that is held: what `render`, `watch` and `profile` share.

use std::fs;

use manylight::{
    Budget,
    budget::BudgetTrace,
    fault::Fault,
    files::{FileKind, write_text},
    graph::value::Value as Parameter,
    renderer::Renderer,
};
use serde_json::{Value, json};

use super::{note, of_file, writable};
use crate::cli::BudgetArgs;

/// Checks files before any work.
pub fn check(args: &BudgetArgs) -> Result<(), Fault> {
    for file in [&args.budget_trace, &args.budget_replay].into_iter().flatten() {
        if !matches!(FileKind::of(file), Ok(FileKind::Json)) {
            return Err(Fault::Usage(format!("`{}`: times of a budget are in a .json file", file.display())));
        }
    }
    args.budget_trace.as_deref().map_or(Ok(()), writable)
}

/// The budget that the command line asks for.
pub fn open(args: &BudgetArgs, renderer: &Renderer) -> Result<Option<Budget>, Fault> {
    if let Some(file) = &args.budget_replay {
        let fault = |reason: String| Fault::Input(format!("cannot replay `{}`: {reason}", file.display()));
        let text = fs::read_to_string(file).map_err(|e| fault(e.to_string()))?;
        let trace: BudgetTrace = serde_json::from_str(&text).map_err(|e| fault(e.to_string()))?;
        return Ok(Some(Budget::replay(&trace, renderer)?));
    }
    Ok(args.time.budget.map(|ms| Budget::new(ms, renderer)).transpose()?)
}

/// To be called after each frame; tells changes, and returns whether there was one.
pub fn follow(budget: &mut Budget, renderer: &mut Renderer, wall_ms: Option<f64>) -> bool {
    match budget.follow(renderer, wall_ms) {
        Ok(Some(change)) => {
            note(&format!("budget: {}", budget.describe(&change)));
            true
        }
        Ok(None) => false,
        Err(faults) => {
            note(&format!("{}\nthe rung cannot be had and is not tried again", faults.render().trim_end()));
            false
        }
    }
}

/// Writes times and changes, if asked for.
pub fn write_trace(args: &BudgetArgs, budget: &Budget) -> Result<(), Fault> {
    let Some(file) = &args.budget_trace else { return Ok(()) };
    let text = serde_json::to_string_pretty(budget.trace()).map_err(|e| Fault::Input(e.to_string()))?;
    write_text(file, &format!("{text}\n")).map_err(of_file)
}

fn ms(value: Option<f64>) -> String {
    value.map_or("no sample".to_owned(), |ms| format!("{ms:.2} ms"))
}

/// Whether the newest times are within the budget; nothing without a sample.
fn is_met(budget: &Budget) -> Option<bool> {
    budget.median_ms().map(|ms| ms <= budget.trace().budget_ms)
}

/// Where it got to, and by what.
pub fn text(budget: &Budget) -> String {
    let (last, changes) = (budget.ladder().len() - 1, &budget.trace().changes);
    let state = match (is_met(budget), budget.rung() == last) {
        (Some(true), _) => "held",
        (Some(false), true) => "not held: this is the cheapest rung",
        (Some(false), false) => "not held yet",
        (None, _) => "not known: too few frames",
    };
    let count = match changes.len() {
        0 => "no change".to_owned(),
        1 => "one change".to_owned(),
        more => format!("{more} changes"),
    };
    let mut lines = vec![
        format!("budget of {} ms: {state}; rung {} of {last}; {count}", budget.trace().budget_ms, budget.rung()),
        format!("  {} on the first rung, {} at last", ms(budget.before_ms()), ms(budget.median_ms())),
    ];
    lines.extend(budget.ladder().moved(0, budget.rung()).iter().map(|(name, before, after)| format!("  {name} {before} → {after}")));
    lines.extend(changes.iter().map(|change| format!("  {}", budget.describe(change))));
    lines.extend(budget.ladder().left_out().iter().map(|reason| format!("  a rung cannot be had: {reason}")));
    lines.join("\n") + "\n"
}

/// The same for scripts.
pub fn to_json(budget: &Budget) -> Value {
    let value = |value: &Parameter| match value {
        Parameter::Int(v) => json!(v),
        Parameter::Float(v) => json!(v),
        Parameter::Bool(v) => json!(v),
        Parameter::Choice(v) => json!(v),
    };
    let moved = budget.ladder().moved(0, budget.rung());
    let moved = moved.iter().map(|(name, before, after)| ((*name).to_owned(), json!({"from": value(before), "to": value(after)})));
    let changes: Vec<Value> = budget
        .trace()
        .changes
        .iter()
        .map(|change| {
            let mut entry = json!(change);
            entry["reason"] = json!(budget.describe(change));
            entry
        })
        .collect();
    json!({
        "budget_ms": budget.trace().budget_ms,
        "rung": budget.rung(),
        "rungs": budget.ladder().len(),
        "before_ms": budget.before_ms(),
        "median_ms": budget.median_ms(),
        "held": is_met(budget),
        "settled": budget.is_settled(),
        "moved": Value::Object(moved.collect()),
        "changes": changes,
        "left_out": budget.ladder().left_out(),
    })
}
