//! Error against time: what an error costs.

use indexmap::IndexMap;

use super::{Figure, along};
use crate::report::{
    plot::{Axis, Line, Look, Plot, Point, Series},
    study::{Group, Study},
    text::number,
};

/// Error against time of the runs of a group, with the Pareto front and the curves of other renderers.
pub(in crate::report) fn scatter(study: &Study<'_>, group: &Group<'_>) -> Figure {
    let title = study.metric().title;
    let shown: Vec<usize> = group.runs.iter().copied().filter(|&run| study.error(run).is_some() && study.time(run).is_some()).collect();
    let mut notes: Vec<String> =
        study.left_out(&group.runs, &shown, &format!("their {title} or time is missing or not finite")).into_iter().collect();
    let mut series = measured(study, group, &shown);
    series.extend(curves(study, group, &mut notes));
    let points = || series.iter().flat_map(|s| &s.points).map(|p| p.at);
    let plot = Plot {
        title: format!("{}: {title} against {}", group.title(), study.time_words()),
        x: Axis::of(study.time_title(study.sheet.axis), points().map(|p| p.0)),
        y: Axis::of(study.metric().axis, points().map(|p| p.1)),
        ring: (!shown.is_empty()).then_some("Pareto front"),
        series,
    };
    let drawn = plot.series.iter().any(|s| !s.points.is_empty()).then(|| plot.svg());
    let caption = format!("{title} against the {}, {}", study.time_words(), group.title());
    Figure::new("error-time", caption, drawn, notes)
}

fn measured(study: &Study<'_>, group: &Group<'_>, shown: &[usize]) -> Vec<Series> {
    let front = study.front(group);
    let point = |run: usize| {
        let (time, error) = (study.time(run).unwrap_or(f64::NAN), study.error(run).unwrap_or(f64::NAN));
        let (ring, label) = (front.contains(&run), &study.labels[run]);
        let tip = format!("{label}: {} ms, {} {}", number(time), study.metric().title, number(error));
        Point { at: (time, error), tip, label: ring.then(|| label.clone()), ring }
    };
    // A line is drawn where one knob alone varies: frames and seeds start another.
    let mut lines: IndexMap<(usize, Option<&str>, u32, u32), Vec<usize>> = IndexMap::new();
    for &run in shown {
        let record = &study.records[run];
        let key = match record.varied.as_slice() {
            [knob] => (study.variant(run), Some(knob.as_str()), record.frames, record.seed),
            _ => (study.variant(run), None, 0, 0),
        };
        lines.entry(key).or_default().push(run);
    }
    let series = |((variant, knob, ..), runs): ((usize, Option<&str>, u32, u32), Vec<usize>)| {
        let runs = knob.map_or(runs.clone(), |knob| along(study, knob, runs));
        Series {
            name: study.variants[variant].to_owned(),
            look: Look::of(variant, 0),
            line: if knob.is_some() { Line::Solid } else { Line::None },
            marks: true,
            points: runs.into_iter().map(point).collect(),
        }
    };
    lines.into_iter().map(series).collect()
}

/// Curves of other renderers for this scene; those of another metric and points that are not finite are noted.
fn curves(study: &Study<'_>, group: &Group<'_>, notes: &mut Vec<String>) -> Vec<Series> {
    let mut series = Vec::new();
    for (index, curve) in study.sheet.curves.iter().enumerate().filter(|(_, c)| c.scene == group.scene && c.size == group.size) {
        if curve.metric != study.sheet.metric {
            notes.push(format!("The curve `{}` is left out, it is of the metric `{}`.", curve.name, curve.metric));
            continue;
        }
        let finite = |p: &&(f64, f64)| p.0.is_finite() && p.1.is_finite();
        let points: Vec<Point> = curve.points.iter().filter(finite).map(|&at| Point { at, ..Point::default() }).collect();
        if points.len() < curve.points.len() {
            notes.push(format!("{} points of the curve `{}` are not finite and left out.", curve.points.len() - points.len(), curve.name));
        }
        let look = Look::of(study.variants.len() + index, 0);
        series.push(Series { name: curve.name.clone(), look, line: Line::Dashed, marks: false, points });
    }
    series
}
