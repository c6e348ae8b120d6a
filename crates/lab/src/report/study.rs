//! The records of a sweep as a report looks at them: by scene, by variant, by knob.

use indexmap::IndexSet;

use super::{
    front::pareto,
    names::{Metric, metric},
    text::count,
};
use crate::{
    record::Record,
    sheet::{Axis, Sheet},
};

/// What is said instead of a report without records.
pub(super) const EMPTY: &str = "There are no records: the sweep has not run, or none of its runs has ended.";
/// What is said above the runs that are left out.
pub(super) const REFUSED: &str = "The pipelines refuse these runs:";
/// Runs named in one sentence at most.
const NAMED: usize = 4;

/// A sweep with what all parts of its report ask of it.
pub(super) struct Study<'a> {
    pub sheet: &'a Sheet,
    pub records: &'a [Record],
    /// In the order of their first runs.
    pub variants: Vec<&'a str>,
    /// Number of pipelines.
    pub pipelines: usize,
    /// Short name of each run, beside the scene and the size.
    pub labels: Vec<String>,
    /// The stages of all runs: one colour each in all plots.
    pub stages: Vec<String>,
    /// Runs whose pictures can be compared.
    pub groups: Vec<Group<'a>>,
}

/// Runs of one scene at one size.
pub(super) struct Group<'a> {
    pub scene: &'a str,
    pub size: [u32; 2],
    /// Indices of their records.
    pub runs: Vec<usize>,
}

impl Group<'_> {
    /// The scene and the size in words.
    pub fn title(&self) -> String {
        format!("{}, {}×{}", self.scene, self.size[0], self.size[1])
    }
}

impl<'a> Study<'a> {
    pub fn new(sheet: &'a Sheet, records: &'a [Record]) -> Self {
        let variants: IndexSet<&str> = records.iter().map(|r| r.variant.as_str()).collect();
        let mut groups: Vec<Group<'a>> = Vec::new();
        for (index, record) in records.iter().enumerate() {
            match groups.iter_mut().find(|g| g.scene == record.scene.name && g.size == record.size) {
                Some(group) => group.runs.push(index),
                None => groups.push(Group { scene: &record.scene.name, size: record.size, runs: vec![index] }),
            }
        }
        let pipelines = records.iter().map(|r| r.pipeline.as_str()).collect::<IndexSet<_>>().len();
        Self {
            sheet,
            records,
            variants: variants.into_iter().collect(),
            pipelines,
            labels: labels(records),
            stages: all_stages(records),
            groups,
        }
    }

    /// What the sweep asks, paragraph by paragraph.
    pub fn doc(&self) -> impl Iterator<Item = &'a str> {
        self.sheet.doc.split("\n\n").filter(|p| !p.trim().is_empty())
    }

    /// The metric on error axes.
    pub fn metric(&self) -> Metric<'a> {
        metric(&self.sheet.metric)
    }

    /// The error of a run, where it is finite.
    pub fn error(&self, run: usize) -> Option<f64> {
        self.records[run].metrics.get(&self.sheet.metric).copied().filter(|v| v.is_finite())
    }

    /// The time of a run that the sheet wants on time axes, in milliseconds, where it is finite.
    pub fn time(&self, run: usize) -> Option<f64> {
        self.time_on(self.sheet.axis, run)
    }

    /// Either time of a run in milliseconds, where it is finite.
    pub fn time_on(&self, axis: Axis, run: usize) -> Option<f64> {
        Some(self.records[run].times.on(axis)).filter(|v| v.is_finite())
    }

    /// What [`Study::time`] is, in words.
    pub fn time_words(&self) -> &'static str {
        time_words(self.sheet.axis)
    }

    /// Title of an axis of such times, with the unit and a word on software adapters.
    pub fn time_title(&self, axis: Axis) -> String {
        let of_cpu = if self.records.iter().all(|r| r.times.software) { ", on a CPU" } else { "" };
        format!("{}{of_cpu} (ms)", time_words(axis))
    }

    /// Index of a run's variant.
    pub fn variant(&self, run: usize) -> usize {
        self.variants.iter().position(|v| *v == self.records[run].variant).unwrap_or(0)
    }

    /// The runs of a group that no other beats in both time and error.
    pub fn front(&self, group: &Group<'_>) -> Vec<usize> {
        let best = self.metric().best;
        let point = |&run: &usize| {
            let error = self.error(run).map_or(f64::NAN, |e| (e - best).abs());
            (self.time(run).unwrap_or(f64::NAN), error)
        };
        let points: Vec<(f64, f64)> = group.runs.iter().map(point).collect();
        pareto(&points).into_iter().map(|i| group.runs[i]).collect()
    }

    /// The metrics of tables: those that the sheet names, or all if it names none.
    pub fn metrics(&self) -> Vec<&'a str> {
        if !self.sheet.metrics.is_empty() {
            return self.sheet.metrics.iter().map(String::as_str).collect();
        }
        all_metrics(self.records)
    }

    /// A sentence on the runs of `all` that are not among `shown`; `None` if there are none.
    pub fn left_out(&self, all: &[usize], shown: &[usize], why: &str) -> Option<String> {
        let missing: Vec<&str> = all.iter().filter(|i| !shown.contains(i)).map(|&i| self.labels[i].as_str()).collect();
        if missing.is_empty() {
            return None;
        }
        let names = missing[..missing.len().min(NAMED)].join("; ");
        let more = if missing.len() > NAMED { "; …" } else { "" };
        Some(format!("{} of {} left out, {why}: {names}{more}.", missing.len(), count(all.len(), "run")))
    }
}

fn time_words(axis: Axis) -> &'static str {
    match axis {
        Axis::Frame => "time of a frame",
        Axis::Picture => "time until the picture",
    }
}

/// The names of all metrics, in the order in which they appear.
pub(super) fn all_metrics(records: &[Record]) -> Vec<&str> {
    records.iter().flat_map(|r| r.metrics.keys()).map(String::as_str).collect::<IndexSet<_>>().into_iter().collect()
}

/// Times of the stages of a run in milliseconds, but of those without a sample, whose medians a record gives as 0.
pub(super) fn stage_times(record: &Record) -> Vec<(String, f64)> {
    record.times.stages().into_iter().filter(|(_, time)| *time != 0.0).collect()
}

/// The time among them of a stage.
pub(super) fn time_of(stage: &str, times: &[(String, f64)]) -> Option<f64> {
    times.iter().find(|t| t.0 == stage).map(|t| t.1)
}

/// The stages of all records, each after those that it follows in its plan.
pub(super) fn all_stages(records: &[Record]) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for record in records {
        let mut next = 0;
        for (stage, _) in stage_times(record) {
            match all.iter().position(|s| *s == stage) {
                Some(at) => next = at + 1,
                None => {
                    all.insert(next, stage);
                    next += 1;
                }
            }
        }
    }
    all
}

/// The settings of a run that vary within its variant, but one, in words.
pub(super) fn settings(record: &Record, but: Option<&str>) -> String {
    let varied = record.varied.iter().filter(|name| Some(name.as_str()) != but);
    varied.filter_map(|name| Some(format!("{name}={}", record.set.get(name)?))).collect::<Vec<_>>().join(" ")
}

/// Variant and varied settings, with frames and seed where these differ between records.
fn labels(records: &[Record]) -> Vec<String> {
    let differ = |of: fn(&Record) -> u32| records.windows(2).any(|pair| of(&pair[0]) != of(&pair[1]));
    let (frames, seeds) = (differ(|r| r.frames), differ(|r| r.seed));
    let label = |record: &Record| {
        let mut words = vec![record.variant.clone(), settings(record, None)];
        words.extend(frames.then(|| count(record.frames as usize, "frame")));
        words.extend(seeds.then(|| format!("seed {}", record.seed)));
        words.retain(|w| !w.is_empty());
        words.join(" ")
    };
    records.iter().map(label).collect()
}
