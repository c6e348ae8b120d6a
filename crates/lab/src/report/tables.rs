//! The tables of runs: errors and costs, stages, sequences.

use super::{
    names::metric,
    study::{Group, Study, stage_times, time_of},
    table::{Column, Table},
    text::{maybe, number},
};
use crate::{record::FrameError, sheet::Axis};

/// Bytes of a MiB.
const MIB: f64 = 1024.0 * 1024.0;

/// What is said beneath the tables of runs.
pub(super) fn front_note(study: &Study<'_>) -> String {
    let (error, time) = (study.metric().title, study.time_words());
    format!("● is on the Pareto front of {error} and {time}: no other run is at least as good in both and better in one.")
}

/// Errors and costs of the runs of a group; the Pareto front of time and error is marked. Where pipelines are compared, they have a column.
pub(super) fn runs(study: &Study<'_>, group: &Group<'_>, metrics: &[&str]) -> Table {
    let front = study.front(group);
    let mut columns = vec![Column::text("run"), Column::text("front")];
    let systems = study.pipelines > 1;
    columns.extend(systems.then(|| Column::text("pipeline")));
    columns.extend(metrics.iter().map(|name| Column::number(metric(name).title)));
    columns.extend(["frame (ms)", "95th percentile (ms)", "until picture (ms)", "memory (MiB)"].map(Column::number));
    let row = |&run: &usize| {
        let record = &study.records[run];
        let mut row = vec![study.labels[run].clone(), if front.contains(&run) { "●" } else { "" }.to_owned()];
        row.extend(systems.then(|| record.pipeline.clone()));
        row.extend(metrics.iter().map(|name| maybe(record.metrics.get(*name).copied())));
        let times = &record.times;
        row.extend([times.frame(), times.frame_summary().p95, times.until_picture, record.memory as f64 / MIB].map(number));
        row
    };
    Table { columns, rows: group.runs.iter().map(row).collect() }
}

/// Times of the stages of the runs of a group.
pub(super) fn stages(study: &Study<'_>, group: &Group<'_>) -> Table {
    let mut columns = vec![Column::text("run")];
    columns.extend(study.stages.iter().map(|stage| Column::number(format!("{stage} (ms)"))));
    columns.extend(["sum (ms)", "frame (ms)"].map(Column::number));
    let row = |&run: &usize| {
        let times = stage_times(&study.records[run]);
        let mut row = vec![study.labels[run].clone()];
        row.extend(study.stages.iter().map(|stage| maybe(time_of(stage, &times))));
        row.push(number(times.iter().map(|t| t.1).sum()));
        row.push(maybe(study.time_on(Axis::Frame, run)));
        row
    };
    Table { columns, rows: group.runs.iter().map(row).collect() }
}

/// How the error of the runs with a sequence moves; `None` if no run has one.
pub(super) fn sequences(study: &Study<'_>, group: &Group<'_>) -> Option<Table> {
    let runs: Vec<usize> = group.runs.iter().copied().filter(|&run| !study.records[run].sequence.is_empty()).collect();
    let title = study.metric().title;
    let mut columns = vec![Column::text("run")];
    columns.extend(["frames".to_owned(), format!("mean {title}"), format!("largest {title}"), "flicker".into()].map(Column::number));
    let row = |&run: &usize| {
        let record = &study.records[run];
        let errors: Vec<f64> = record.sequence.iter().filter_map(|frame| error_of(study, frame)).collect();
        let mean = (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64);
        let largest = errors.iter().copied().reduce(f64::max);
        let flicker = record.metrics.get("flicker").copied();
        vec![study.labels[run].clone(), record.sequence.len().to_string(), maybe(mean), maybe(largest), maybe(flicker)]
    };
    (!runs.is_empty()).then(|| Table { columns, rows: runs.iter().map(row).collect() })
}

/// The error of a frame of a sequence, where it is finite.
pub(super) fn error_of(study: &Study<'_>, frame: &FrameError) -> Option<f64> {
    frame.metrics.get(&study.sheet.metric).copied().filter(|v| v.is_finite())
}
