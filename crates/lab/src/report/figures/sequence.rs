//! Error over scene time.

use super::Figure;
use crate::report::{
    plot::{Axis, Line, Look, Plot, Point, Series},
    study::{Group, Study},
    tables::error_of,
    text::count,
};

/// Lines in one figure, which colours and dashes tell apart; more go to a further one.
const LINES: usize = 2 * Look::COLOURS;

/// Error over time of the runs of a group that have a sequence, in figures of equal axes.
pub(in crate::report) fn sequence(study: &Study<'_>, group: &Group<'_>) -> Vec<Figure> {
    let title = study.metric().title;
    let all: Vec<usize> = group.runs.iter().copied().filter(|&run| !study.records[run].sequence.is_empty()).collect();
    let points = |run: usize| -> Vec<Point> {
        let frames = study.records[run].sequence.iter().filter(|frame| frame.time.is_finite());
        frames.filter_map(|frame| Some(Point { at: (frame.time, error_of(study, frame)?), ..Point::default() })).collect()
    };
    let at: Vec<(f64, f64)> = all.iter().flat_map(|&run| points(run)).map(|p| p.at).collect();
    let figures = all.chunks(LINES).count();
    let figure = |(index, runs): (usize, &[usize])| {
        let line = |(index, &run): (usize, &usize)| Series {
            name: study.labels[run].clone(),
            look: Look::of(index, 0),
            line: if index < Look::COLOURS { Line::Solid } else { Line::Dashed },
            marks: false,
            points: points(run),
        };
        let series: Vec<Series> = runs.iter().enumerate().map(line).collect();
        let frames: usize = runs.iter().map(|&run| study.records[run].sequence.len()).sum();
        let missing = frames - series.iter().map(|s| s.points.len()).sum::<usize>();
        let note = (missing > 0).then(|| format!("{} left out, their {title} or time is missing or not finite.", count(missing, "frame")));
        let of = if figures > 1 { format!(" ({} of {figures})", index + 1) } else { String::new() };
        let plot = Plot {
            title: format!("{}: {title} over time{of}", group.title()),
            x: Axis::of_time("scene time (s)", at.iter().map(|p| p.0)),
            y: Axis::of(study.metric().axis, at.iter().map(|p| p.1)),
            series,
            ring: None,
        };
        let drawn = (missing < frames).then(|| plot.svg());
        Figure::new("sequence", format!("{title} over scene time, {}{of}", group.title()), drawn, note.into_iter().collect())
    };
    all.chunks(LINES).enumerate().map(figure).collect()
}
