//! What components and intervals cost: the tables of `manylight bake --report`.

use manylight_passes::baked::bracket;

use super::{BakeError, Criterion, Event, Eye, Keep, Light, Options, Pca, SEED, Tracer, bisect, decode, encoded, mixed, uniform};
use crate::{
    files::Picture,
    metrics::{compare, exposure_of},
};

/// Numbers of components that are tried.
const MOST_COMPONENTS: usize = 20;
/// Mean FLIP from which on an interval is split.
const THRESHOLDS: [f64; 6] = [0.32, 0.16, 0.08, 0.04, 0.02, 0.01];
/// Times between key frames at which the file's light is compared with paths of its own.
const BETWEEN: usize = 6;
/// Paths there over those of a key frame.
const MORE_PATHS: u32 = 4;
/// Random numbers there, which must not be those of the key frames.
const OTHER_SEED: u32 = 0x7472_7565;
/// As in a bake: intervals longer than this are always halved, as a share of the period.
const LONGEST: f64 = 1.0 / 8.0;

/// A table for people and for scripts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Table {
    /// Stem of its files.
    pub name: &'static str,
    /// What it shows.
    pub title: String,
    /// Heads of the columns.
    pub head: Vec<&'static str>,
    /// Rows of as many cells.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// As Markdown.
    pub fn markdown(&self) -> String {
        let line = |cells: &[&str]| format!("| {} |\n", cells.join(" | "));
        let rows: String = self.rows.iter().map(|row| line(&row.iter().map(String::as_str).collect::<Vec<_>>())).collect();
        format!("{}\n\n{}{}{rows}", self.title, line(&self.head), line(&vec!["---"; self.head.len()]))
    }

    /// As comma-separated values. No cell has a comma.
    pub fn csv(&self) -> String {
        let rows: String = self.rows.iter().map(|row| format!("{}\n", row.join(","))).collect();
        format!("{}\n{rows}", self.head.join(","))
    }
}

/// The tables.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Study {
    /// Kept variance, errors and size by the number of components.
    pub components: Table,
    /// Key frames and errors of uniform schedules and of bisections.
    pub intervals: Table,
}

/// All frames of a uniform schedule.
struct Day {
    keys: Vec<f64>,
    frames: Vec<Picture>,
    lit: Vec<Option<usize>>,
    eye: Eye,
}

impl Day {
    fn lit_frames(&self) -> impl Iterator<Item = (usize, &Picture)> {
        self.frames.iter().enumerate().filter(|(i, _)| self.lit[*i].is_some())
    }

    /// Light at a time from the frames at `keys`.
    fn interpolated(&self, keys: &[usize], period_s: f64, time: f64) -> Picture {
        let times: Vec<f64> = keys.iter().map(|key| self.keys[*key]).collect();
        let (before, after, alpha) = bracket(&times, period_s, time);
        mixed(&self.frames[keys[before]], &self.frames[keys[after]], alpha as f32)
    }

    /// Mean and largest FLIP over the lit frames of what the frames at `keys` give.
    fn error(&self, keys: &[usize], period_s: f64) -> Result<(f64, f64), BakeError> {
        let (mut sum, mut most, mut count) = (0.0, 0.0_f64, 0);
        for (i, frame) in self.lit_frames() {
            let flip = self.eye.difference(&self.interpolated(keys, period_s, self.keys[i]), frame)?;
            (sum, most, count) = (sum + flip, most.max(flip), count + 1);
        }
        Ok((sum / f64::from(count.max(1)), most))
    }

    fn lit_of(&self, keys: &[usize]) -> usize {
        keys.iter().filter(|key| self.lit[**key].is_some()).count()
    }
}

/// Measures over a day with a key frame every `interval_s` or a little less or more: so many as are a power of two.
///
/// # Errors
/// As [`bake`](super::bake).
pub fn study(tracer: &mut Tracer<'_>, options: &Options, interval_s: f64, tell: &mut dyn FnMut(Event)) -> Result<Study, BakeError> {
    let day = day(tracer, options.period_s, interval_s, tell)?;
    if day.lit_frames().next().is_none() {
        return Err(BakeError::Input(format!("no light of `{}` shines at any key frame", tracer.scene().name)));
    }
    Ok(Study { components: components(tracer, options, &day, tell)?, intervals: intervals(options.period_s, &day)? })
}

fn day(tracer: &mut Tracer<'_>, period_s: f64, interval_s: f64, tell: &mut dyn FnMut(Event)) -> Result<Day, BakeError> {
    let halvings = (period_s / interval_s).log2().round().clamp(1.0, 16.0) as i32;
    let keys = uniform(period_s, period_s / 2.0_f64.powi(halvings));
    let paths = tracer.task().paths;
    let mut frames = Vec::with_capacity(keys.len());
    let mut lit = Vec::with_capacity(keys.len());
    for (index, time) in keys.iter().enumerate() {
        tell(Event::Frame { time: *time, index, of: Some(keys.len()) });
        let dark = tracer.is_dark(*time);
        lit.push((!dark).then(|| lit.iter().flatten().count()));
        frames.push(tracer.frame(Light::Indirect, *time, paths, SEED)?);
    }
    let eye = Eye { exposure: exposure_of(&frames[frames.len() / 2]), used: tracer.used_share() };
    Ok(Day { keys, frames, lit, eye })
}

fn components(tracer: &mut Tracer<'_>, options: &Options, day: &Day, tell: &mut dyn FnMut(Event)) -> Result<Table, BakeError> {
    tell(Event::Components);
    let slices: Vec<&[f32]> = day.lit_frames().map(|(_, frame)| frame.data.as_slice()).collect();
    let pca = Pca::of(&slices, options.subtract_mean);
    let truth = between(tracer, options.period_s, day)?;
    let raw: usize = slices.iter().map(|frame| 4 * frame.len() / 3 * 2).sum();
    let mut rows = Vec::new();
    for k in 1..=MOST_COMPONENTS.min(pca.components.len()) {
        let baked = encoded(tracer, &Options { keep: Keep::Components(k), ..*options }, &pca, &day.keys, &day.lit)?;
        let (mut squares, mut light, mut flip) = (0.0, 0.0, 0.0);
        for (i, frame) in day.lit_frames() {
            let image = decode(&baked, day.keys[i]);
            let metrics = compare(&image, frame)?;
            squares += metrics.rmse.powi(2);
            light += metrics.mean_reference;
            flip += day.eye.difference(&image, frame)?;
        }
        let n = slices.len() as f64;
        let mut beyond = 0.0;
        for (time, frame) in &truth {
            beyond += day.eye.difference(&decode(&baked, *time), frame)? / truth.len() as f64;
        }
        let paper = match k {
            5 => "95 %",
            10 => "98.6 %",
            20 => "99.83 %",
            _ => "",
        };
        let bytes = baked.to_bytes().map_err(|e| BakeError::Render(e.to_string()))?.len();
        rows.push(vec![
            k.to_string(),
            format!("{:.3} %", 100.0 * pca.kept[k - 1]),
            paper.to_owned(),
            format!("{:.4}", (squares / n).sqrt() / (light / n)),
            format!("{:.4}", flip / n),
            format!("{beyond:.4}"),
            bytes.to_string(),
            format!("{:.1} %", 100.0 * (1.0 - bytes as f64 / raw as f64)),
        ]);
    }
    let title = format!(
        "{} lit of {} key frames, {}×{}, {} paths a texel; unpacked half floats take {raw} bytes. FLIP between key frames is against {} paths of other random numbers \
         at {} times, and has their noise in it.",
        slices.len(),
        day.keys.len(),
        tracer.size().0,
        tracer.size().1,
        tracer.task().paths,
        MORE_PATHS * tracer.task().paths,
        truth.len()
    );
    let head = vec![
        "components",
        "kept variance",
        "the paper's",
        "RMSE / mean at key frames",
        "FLIP at key frames",
        "FLIP between key frames",
        "bytes on disk",
        "saved",
    ];
    Ok(Table { name: "pca-components", title, head, rows })
}

/// Frames half-way between lit key frames, spread over the day.
fn between(tracer: &mut Tracer<'_>, period_s: f64, day: &Day) -> Result<Vec<(f64, Picture)>, BakeError> {
    let lit: Vec<usize> = day.lit_frames().map(|(i, _)| i).collect();
    let paths = MORE_PATHS * tracer.task().paths;
    let half = 0.5 * period_s / day.keys.len() as f64;
    (0..BETWEEN.min(lit.len()))
        .map(|i| {
            let time = day.keys[lit[(2 * i + 1) * lit.len() / (2 * BETWEEN.min(lit.len()))]] + half;
            Ok((time, tracer.frame(Light::Indirect, time, paths, OTHER_SEED)?))
        })
        .collect()
}

fn intervals(period_s: f64, day: &Day) -> Result<Table, BakeError> {
    let count = day.keys.len();
    let mut rows = Vec::new();
    // Of uniform schedules: mean and largest FLIP with the lit frames that they take.
    let mut by_mean: Vec<(f64, f64)> = Vec::new();
    let mut by_largest: Vec<(f64, f64)> = Vec::new();
    let mut row = |what: String, keys: &[usize], errors: (f64, f64), saved: [String; 2]| {
        let [mean, largest] = saved;
        let cells =
            [keys.len().to_string(), day.lit_of(keys).to_string(), format!("{:.4}", errors.0), format!("{:.4}", errors.1), mean, largest];
        rows.push([what].into_iter().chain(cells).collect());
    };
    for halvings in 0..=count.ilog2().saturating_sub(3) {
        let keys: Vec<usize> = (0..count).step_by(1 << halvings).collect();
        let errors = day.error(&keys, period_s)?;
        by_mean.push((errors.0, day.lit_of(&keys) as f64));
        by_largest.push((errors.1, day.lit_of(&keys) as f64));
        row(format!("every {:.1} min", period_s / keys.len() as f64 / 60.0), &keys, errors, [String::new(), String::new()]);
    }
    let shortest = period_s / count as f64;
    for criterion in [Criterion::Middle, Criterion::Ends] {
        for threshold in THRESHOLDS {
            let index = |time: f64| (time / shortest).round() as usize % count;
            let frame = |time: f64| Ok::<_, BakeError>(day.frames[index(time)].clone());
            let schedule = (shortest, LONGEST * period_s, threshold, criterion);
            let times = bisect(period_s, schedule, frame, |a, b| mixed(a, b, 0.5), |a, b| day.eye.difference(a, b))?;
            let keys: Vec<usize> = times.into_iter().map(index).collect();
            let errors = day.error(&keys, period_s)?;
            let saved = |known: &[(f64, f64)], error: f64| {
                let share = |uniform: f64| format!("{:.0} %", 100.0 * (1.0 - day.lit_of(&keys) as f64 / uniform));
                uniform_frames(known, error).map_or("–".to_owned(), share)
            };
            let saved = [saved(&by_mean, errors.0), saved(&by_largest, errors.1)];
            let name = if criterion == Criterion::Middle { "middle" } else { "ends" };
            row(format!("bisection by the {name}: {threshold}"), &keys, errors, saved);
        }
    }
    let title = format!(
        "Errors are mean FLIP of {} lit frames against what the key frames give at their times; the savings are in lit key frames against a uniform \
         schedule of equal mean and of equal largest FLIP, between the measured ones.",
        day.lit_frames().count()
    );
    let head = vec!["key frames", "all", "lit", "mean FLIP", "largest FLIP", "saved at equal mean FLIP", "saved at equal largest FLIP"];
    Ok(Table { name: "pca-intervals", title, head, rows })
}

/// Lit frames of a uniform schedule with this mean error, by logarithms of frames and linearly in the error; `None` beyond what was measured.
fn uniform_frames(known: &[(f64, f64)], error: f64) -> Option<f64> {
    let pair = known.windows(2).find(|pair| pair[0].0 <= error && error <= pair[1].0)?;
    let share = if pair[1].0 > pair[0].0 { (error - pair[0].0) / (pair[1].0 - pair[0].0) } else { 0.0 };
    Some((pair[0].1.ln() * (1.0 - share) + pair[1].1.ln() * share).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_equal_error_lie_between_those_measured() {
        let known = [(0.0, 64.0), (0.1, 16.0), (0.2, 4.0)];
        assert!((uniform_frames(&known, 0.05).expect("within") - 32.0).abs() < 1e-9);
        assert_eq!(uniform_frames(&known, 0.3), None);
    }

    #[test]
    fn tables_have_a_cell_for_each_head() {
        let table = Table { name: "x", title: "T.".into(), head: vec!["a", "b"], rows: vec![vec!["1".into(), "2 %".into()]] };
        assert_eq!(table.markdown(), "T.\n\n| a | b |\n| --- | --- |\n| 1 | 2 % |\n");
        assert_eq!(table.csv(), "a,b\n1,2 %\n");
    }
}
