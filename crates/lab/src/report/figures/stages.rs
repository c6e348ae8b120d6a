//! Where the time of a frame goes.

use super::Figure;
use crate::{
    report::{
        plot::{Axis, Bar, Bars},
        study::{Group, Study, stage_times, time_of},
    },
    sheet::Axis as TimeAxis,
};

/// Bars in one figure; more go to a further one.
const BARS: usize = 32;

/// Stacked bars of the times of the stages of each run of a group, in figures of equal scale.
pub(in crate::report) fn stages(study: &Study<'_>, group: &Group<'_>) -> Vec<Figure> {
    let times = |run: usize| stage_times(&study.records[run]);
    let usable = |run: usize| times(run).iter().all(|(_, t)| t.is_finite() && *t >= 0.0) && !times(run).is_empty();
    let shown: Vec<usize> = group.runs.iter().copied().filter(|&run| usable(run)).collect();
    let longest =
        || shown.iter().flat_map(|&run| [times(run).iter().map(|t| t.1).sum(), study.time_on(TimeAxis::Frame, run).unwrap_or(0.0)]);
    let bar = |&run: &usize| {
        let times = times(run);
        let lengths = study.stages.iter().map(|stage| time_of(stage, &times)).collect();
        Bar { label: study.labels[run].clone(), lengths, line: study.time_on(TimeAxis::Frame, run) }
    };
    let left_out = study.left_out(&group.runs, &shown, "they have no times of nodes, or such as are not finite");
    let figures = shown.chunks(BARS).count();
    let figure = |(index, chunk): (usize, &[usize])| {
        let of = if figures > 1 { format!(" ({} of {figures})", index + 1) } else { String::new() };
        let bars = Bars {
            title: format!("{}: time by stage{of}", group.title()),
            x: Axis::from_zero(study.time_title(TimeAxis::Frame), longest()),
            parts: &study.stages,
            bars: chunk.iter().map(bar).collect(),
            line: "whole frame, median",
        };
        let caption = format!("Time of a frame by stage, {}{of}", group.title());
        Figure::new("stages", caption, Some(bars.svg()), left_out.clone().filter(|_| index == 0).into_iter().collect())
    };
    if shown.is_empty() {
        return vec![Figure::new("stages", format!("Time of a frame by stage, {}", group.title()), None, left_out.into_iter().collect())];
    }
    shown.chunks(BARS).enumerate().map(figure).collect()
}
