//! Checks a pipeline without a scene and without a GPU, for every option of every parameter.

use std::{path::Path, sync::Arc};

use crate::{
    assign::Values,
    diagnostics::{Diagnostic, Diagnostics, Severity, Source},
    facts::Seen,
    features,
    library::Library,
    pipeline::{Gaps, Pipeline, Preset},
    plan::PlanInput,
    planner::Planner,
    refuse::refused,
    registry::Registry,
    resolve::{Linked, link, preset_fault},
    unused,
    value::{ParamKind, Value},
};

mod constant;
mod scenes;
mod variables;

use scenes::{extremes, scenes};

/// The picture's size that sizes are checked with.
const OUTPUT: (u32, u32) = (1920, 1080);

/// Everything that can be known without a scene: names, types, connections, cycles and sizes, for the defaults and for every option of every
/// choice and both values of every switch, one at a time, with and without what a scene may have, and with what is measured of it on either side
/// of every bound. What the pipeline refuses is not looked at, unless it is what the pipeline does by itself. Conditions that have only one
/// outcome, whatever the values and the scene are, are warnings.
pub fn check(pipeline: &Pipeline, registry: &Registry) -> Diagnostics {
    let mut out = Vec::new();
    let linked = link(pipeline, registry, features::flags().collect(), &mut out);
    let values = Values::assign(&linked, &[], &mut out);
    let mut known: Vec<Diagnostic> = Vec::new();
    let scenes = scenes(&linked, &values);
    if scenes.iter().all(|scene| !refused(&linked, &values, &[], scene.seen()).is_empty())
        && let Some(every) = scenes.first()
    {
        out.extend(refused(&linked, &values, &[], every.seen()));
    }
    let mut attempt = |values: &Values<'_>, scene: Seen<'_>, when: &str, worst: Severity| {
        if !refused(&linked, values, &[], scene).is_empty() {
            return;
        }
        for fault in faults(&linked, values, scene) {
            // One cause shows in many variants: it is told once, with the first variant that has it.
            let same = |other: &Diagnostic| {
                other.labels.first().map(|l| &l.span) == fault.labels.first().map(|l| &l.span) && kind(other) == kind(&fault)
            };
            if known.iter().any(same) {
                continue;
            }
            known.push(fault.clone());
            let severity = fault.severity.min(worst);
            let message = if when.is_empty() { fault.message } else { format!("{} ({when})", fault.message) };
            out.push(Diagnostic { message, severity, ..fault });
        }
    };
    for scene in &scenes {
        attempt(&values, scene.seen(), &scene.when, Severity::Error);
    }
    // Without knowing what is refused, all that would follow from it would be told.
    let is_preset = !pipeline.set.is_empty();
    // The ends of ranges are for the values that a pipeline has by itself; a preset is one choice of them.
    let is_tried = |kind: &ParamKind| !linked.refusals_unclear && (!is_preset || !matches!(kind, ParamKind::Int { .. }));
    for (name, param) in pipeline.params.iter().filter(|(_, param)| is_tried(&param.kind)) {
        let current = values.get(name).cloned();
        // The end of a range may be too much beside another parameter's value (memory, say), and a preset may set what another option needs:
        // that is good to know, and no fault of the pipeline.
        let worst = if is_preset || matches!(param.kind, ParamKind::Int { .. }) { Severity::Warning } else { Severity::Error };
        for value in variants(&param.kind).into_iter().filter(|v| Some(v) != current.as_ref()) {
            let when = format!("when `{name}` is `{value}`");
            let mut changed = values.clone();
            changed.replace(name, value);
            for scene in extremes(&linked, &changed) {
                attempt(&changed, scene.seen(), &and_also(&when, &scene), worst);
            }
        }
    }
    let own = values.pipeline.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect::<Vec<_>>();
    for rung in pipeline.rungs(&own, &[]).into_iter().skip(1).filter(|_| !linked.refusals_unclear) {
        let mut changed = values.clone();
        for (name, value) in &rung {
            if let Some((name, _)) = pipeline.params.get_key_value(name) {
                changed.replace(name, value.clone());
            }
        }
        let listed: Vec<String> = rung.iter().map(|(name, value)| format!("`{name}` is `{value}`")).collect();
        let when = format!("on the rung of `quality` where {}", listed.join(" and "));
        for scene in extremes(&linked, &changed) {
            attempt(&changed, scene.seen(), &and_also(&when, &scene), Severity::Error);
        }
    }
    if pipeline.gaps == Gaps::default() && !out.iter().any(|d| d.severity == Severity::Error) {
        out.extend(unused::find(&linked));
        out.extend(constant::find(&linked));
    }
    Diagnostics(out).sorted()
}

/// Checks values that another document (a sweep) gives to parameters of a pipeline, each at its place. Faults of the pipeline itself are not told.
pub fn check_values<'a>(pipeline: &Pipeline, registry: &Registry, values: impl IntoIterator<Item = (&'a str, &'a Preset)>) -> Diagnostics {
    let linked = link(pipeline, registry, features::flags().collect(), &mut Vec::new());
    Diagnostics(values.into_iter().filter_map(|(name, value)| preset_fault(pipeline, &linked.nodes, name, value)).collect())
}

/// Reads a pipeline and checks it: all faults of its text and of its meaning at once.
/// `path` is a file on disk, a path of the library, or a name in `pipelines/`.
pub fn check_file(library: &Library, path: impl AsRef<Path>, registry: &Registry) -> Diagnostics {
    check_with_sources(library, path, registry).0
}

/// As [`check_file`], with every file that was read: the pipeline's own first, and those that it extends and includes.
pub fn check_with_sources(library: &Library, path: impl AsRef<Path>, registry: &Registry) -> (Diagnostics, Vec<Arc<Source>>) {
    let (pipeline, sources, mut faults) = Pipeline::load_with_gaps(library, path.as_ref());
    if let Some(pipeline) = pipeline {
        faults.extend(check(&pipeline, registry));
    }
    (faults.sorted(), sources)
}

fn and_also(when: &str, scene: &scenes::Tried) -> String {
    if scene.when.is_empty() { when.to_owned() } else { format!("{when} and {}", scene.when) }
}

/// The sentence without the values in it.
fn kind(fault: &Diagnostic) -> &str {
    fault.message.split(": ").next().unwrap_or("")
}

/// The values to try besides the default; numbers are tried at both ends of their range.
fn variants(kind: &ParamKind) -> Vec<Value> {
    match kind {
        ParamKind::Bool { .. } => vec![Value::Bool(false), Value::Bool(true)],
        ParamKind::Choice { options, .. } => options.iter().cloned().map(Value::Choice).collect(),
        ParamKind::Int { min, max, .. } => vec![Value::Int(*min), Value::Int(*max)],
        ParamKind::Float { .. } => Vec::new(),
    }
}

fn faults(linked: &Linked<'_>, values: &Values<'_>, scene: Seen<'_>) -> Vec<Diagnostic> {
    let mut out = Vec::new();
    let input = PlanInput { output: OUTPUT, features: scene.features.clone(), measured: scene.measured.clone(), ..PlanInput::default() };
    // Values hold names of the same pipeline; a plan is made only for its faults.
    let _ = Planner::new(linked, values, &input, &mut out).run();
    out
}
