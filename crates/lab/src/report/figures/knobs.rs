//! What a knob does to error and time, all others fixed.

use indexmap::{IndexMap, IndexSet};

use super::{Figure, along, number_of};
use crate::report::{
    fit::PowerLaw,
    plot::{Axis, Line, Look, Plot, Point, Series},
    study::{Group, Study, settings},
    text::number,
};

/// Part of the way from one name to the next over which series are spread.
const SPREAD: f64 = 0.5;

/// Error and time over each knob that varies in a group.
pub(in crate::report) fn knobs(study: &Study<'_>, group: &Group<'_>) -> Vec<Figure> {
    let varied: IndexSet<&str> = group.runs.iter().flat_map(|&run| &study.records[run].varied).map(String::as_str).collect();
    varied.into_iter().filter_map(|name| Knob::new(study, group, name)).flat_map(|knob| knob.figures()).collect()
}

/// A knob in a group of runs.
struct Knob<'a> {
    study: &'a Study<'a>,
    group: &'a Group<'a>,
    name: &'a str,
    /// All its values in the order of the sweep.
    values: IndexSet<&'a str>,
    /// They are all numbers.
    numeric: bool,
    /// Runs that differ in the knob and in the seed alone, by variant, the other settings and frames.
    lines: IndexMap<(usize, String, u32), Vec<usize>>,
}

/// What is drawn over a knob.
struct Quantity<'q> {
    words: &'q str,
    /// Title of its axis.
    title: &'q str,
    of: &'q dyn Fn(usize) -> Option<f64>,
    /// Power laws are fitted.
    slopes: bool,
}

impl<'a> Knob<'a> {
    /// `None` if it has one value only.
    fn new(study: &'a Study<'a>, group: &'a Group<'a>, name: &'a str) -> Option<Self> {
        let mut values = IndexSet::new();
        let mut lines: IndexMap<_, Vec<usize>> = IndexMap::new();
        for &run in &group.runs {
            let record = &study.records[run];
            if let (true, Some(value)) = (record.varied.iter().any(|v| v == name), record.set.get(name)) {
                values.insert(value.as_str());
                lines.entry((study.variant(run), settings(record, Some(name)), record.frames)).or_default().push(run);
            }
        }
        let numeric = values.iter().all(|v| number_of(v).is_some());
        (values.len() > 1).then_some(Self { study, group, name, values, numeric, lines })
    }

    fn figures(&self) -> [Figure; 2] {
        let error = |run| self.study.error(run);
        let time = |run| self.study.time(run);
        let metric = self.study.metric();
        let time_title = self.study.time_title(self.study.sheet.axis);
        [
            self.figure(&Quantity { words: metric.title, title: &metric.axis, of: &error, slopes: true }),
            self.figure(&Quantity { words: self.study.time_words(), title: &time_title, of: &time, slopes: false }),
        ]
    }

    fn figure(&self, quantity: &Quantity<'_>) -> Figure {
        let all: Vec<usize> = self.lines.values().flatten().copied().collect();
        let shown: Vec<usize> = all.iter().copied().filter(|&run| (quantity.of)(run).is_some()).collect();
        let why = format!("their {} is missing or not finite", quantity.words);
        let mut notes: Vec<String> = self.study.left_out(&all, &shown, &why).into_iter().collect();
        let values: Vec<f64> = self.values.iter().filter_map(|v| number_of(v)).collect();
        let names: Vec<&str> = self.values.iter().copied().collect();
        let x = if self.numeric { Axis::of_knob(self.name, &values) } else { Axis::of_names(self.name, &names) };
        // A power law is a line only where both axes are logarithmic.
        let log_log = x.is_log() && shown.iter().filter_map(|&run| (quantity.of)(run)).all(|v| v > 0.0);
        let series = self.series(quantity, log_log && quantity.slopes, &mut notes);
        let drawn = series.iter().flat_map(|s| &s.points).map(|p| p.at.1);
        let plot = Plot {
            title: format!("{}: {} over {}", self.group.title(), quantity.words, self.name),
            x,
            y: if log_log { Axis::log(quantity.title, drawn) } else { Axis::of(quantity.title, drawn) },
            series,
            ring: None,
        };
        let caption = format!("{} over {}, {}", quantity.words, self.name, self.group.title());
        Figure::new(format!("{} over {}", quantity.words, self.name), caption, (!shown.is_empty()).then(|| plot.svg()), notes)
    }

    fn series(&self, quantity: &Quantity<'_>, slopes: bool, notes: &mut Vec<String>) -> Vec<Series> {
        let mut all = Vec::new();
        let mut members = vec![0; self.study.variants.len()];
        for (index, ((variant, others, frames), runs)) in self.lines.iter().enumerate() {
            let look = Look::of(*variant, members[*variant]);
            members[*variant] += 1;
            let mut name = self.study.variants[*variant].to_owned();
            if !others.is_empty() {
                name += &format!(" {others}");
            }
            if self.lines.keys().any(|k| (k.0, &k.1) == (*variant, others) && k.2 != *frames) {
                name += &format!(" {frames} frames");
            }
            let offset = SPREAD * ((index as f64 + 0.5) / self.lines.len() as f64 - 0.5);
            let point = |run: usize| Some(self.point(run, offset, (quantity.of)(run)?));
            // Each seed has a line of its own: their distance shows what chance does.
            let mut seeds: IndexMap<u32, Vec<usize>> = IndexMap::new();
            runs.iter().for_each(|&run| seeds.entry(self.study.records[run].seed).or_default().push(run));
            let lines: Vec<Vec<Point>> =
                seeds.into_values().map(|runs| along(self.study, self.name, runs).into_iter().filter_map(point).collect()).collect();
            let at: Vec<(f64, f64)> = lines.iter().flatten().map(|p| p.at).collect();
            let law = if slopes { PowerLaw::fit(&at) } else { None };
            if let Some(law) = law {
                notes.push(format!("{name}: {} ∝ {}^{}, fitted to {} points.", quantity.words, self.name, slope(&law), law.points));
                name = format!("slope {}: {name}", slope(&law));
                all.push(fitted(&law, &at, look));
            }
            let line = if self.numeric { Line::Solid } else { Line::None };
            all.extend(lines.into_iter().map(|points| Series { name: name.clone(), look, line, marks: true, points }));
        }
        all
    }

    fn point(&self, run: usize, offset: f64, y: f64) -> Point {
        let value = self.study.records[run].set.get(self.name).map_or("", String::as_str);
        let x = match number_of(value) {
            Some(x) if self.numeric => x,
            _ => self.values.get_index_of(value).unwrap_or(0) as f64 + offset,
        };
        Point { at: (x, y), tip: format!("{}: {}", self.study.labels[run], number(y)), ..Point::default() }
    }
}

/// The line of a power law over the range of the points.
fn fitted(law: &PowerLaw, points: &[(f64, f64)], look: Look) -> Series {
    let low = points.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let high = points.iter().map(|p| p.0).fold(0.0, f64::max);
    let points = [low, high].map(|x| Point { at: (x, law.at(x)), ..Point::default() }).to_vec();
    Series { name: String::new(), look, line: Line::Dashed, marks: false, points }
}

fn slope(law: &PowerLaw) -> String {
    format!("{:.2}", law.slope).replace('-', "−")
}
