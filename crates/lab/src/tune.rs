//! The setting to use, from the records of a sweep.

use thiserror::Error;

use crate::{metrics::Known, record::Record};

/// What a setting must keep to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Milliseconds a frame; within them, the most accurate setting.
    Budget(f64),
    /// Distance of the metric from its best value; within it, the fastest setting.
    Error(f64),
}

/// No setting keeps to the goal.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NoSetting {
    /// There is no run with a time and an error.
    #[error("no run has both a time and the metric `{0}`")]
    Nothing(String),
    /// The fastest one is slower than the budget.
    #[error("the fastest setting takes {0:.2} ms: `{1}`")]
    TooSlow(f64, String),
    /// The most accurate one is less so than asked for.
    #[error("the most accurate setting has an error of {0:.4}: `{1}`")]
    TooFar(f64, String),
}

/// The best of `records` for a goal; a tie goes to the one that is better in the other respect.
///
/// # Errors
/// None keeps to it; the nearest one is told.
pub fn choose<'a>(records: &'a [Record], metric: &str, goal: Goal) -> Result<&'a Record, NoSetting> {
    let best = Known::find(metric).map_or(0.0, |known| known.best.value());
    let error = |r: &Record| r.metrics.get(metric).map(|value| (value - best).abs()).filter(|error| error.is_finite());
    let points: Vec<(f64, f64, &Record)> = records.iter().filter_map(|r| Some((r.times.frame(), error(r)?, r))).collect();
    let first = |order: fn(&(f64, f64, &Record)) -> (f64, f64), within: &dyn Fn(&(f64, f64, &Record)) -> bool| {
        let key = |point: &(f64, f64, &'a Record)| order(point);
        points.iter().filter(|p| within(p)).min_by(|a, b| {
            let (a, b) = (key(a), key(b));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
        })
    };
    let (by_time, by_error) = (|p: &(f64, f64, &Record)| (p.0, p.1), |p: &(f64, f64, &Record)| (p.1, p.0));
    let found = match goal {
        Goal::Budget(most) => first(by_error, &|p| p.0 <= most),
        Goal::Error(most) => first(by_time, &|p| p.1 <= most),
    };
    found.map(|point| point.2).ok_or_else(|| {
        match goal {
            Goal::Budget(_) => first(by_time, &|_| true).map(|p| NoSetting::TooSlow(p.0, p.2.run.clone())),
            Goal::Error(_) => first(by_error, &|_| true).map(|p| NoSetting::TooFar(p.1, p.2.run.clone())),
        }
        .unwrap_or_else(|| NoSetting::Nothing(metric.to_owned()))
    })
}

/// A pipeline document that extends `pipeline` by a record's settings.
pub fn preset(record: &Record, pipeline: &str, doc: &str) -> String {
    let values = record.set.iter().map(|(name, value)| format!("        {name:?}: {},\n", literal(value)));
    format!("Pipeline(\n    doc: {doc:?},\n    extends: {pipeline:?},\n    set: {{\n{}    }},\n)\n", values.collect::<String>())
}

/// A setting's text as a RON value: numbers and switches as they are, options in quotes.
fn literal(text: &str) -> String {
    if text.parse::<f64>().is_ok_and(f64::is_finite) || matches!(text, "true" | "false") { text.to_owned() } else { format!("{text:?}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::tests::example;

    const METRIC: &str = "relative_mean_absolute_error";

    #[test]
    fn the_best_within_the_goal_is_chosen() {
        let records = [example("a", 16, 1.0, 0.3), example("a", 32, 2.0, 0.2), example("a", 64, 2.0, 0.1), example("a", 128, 4.0, 0.1)];
        let clusters = |goal| choose(&records, METRIC, goal).map(|r| r.set["clusters"].clone());
        assert_eq!(clusters(Goal::Budget(1.5)), Ok("16".into()));
        assert_eq!(clusters(Goal::Budget(9.0)), Ok("64".into()), "as accurate as the slowest, but faster");
        assert_eq!(clusters(Goal::Error(0.25)), Ok("64".into()), "as fast as another, but more accurate");
        assert_eq!(clusters(Goal::Error(0.3)), Ok("16".into()));
        assert_eq!(clusters(Goal::Budget(0.5)), Err(NoSetting::TooSlow(1.0, records[0].run.clone())));
        assert_eq!(clusters(Goal::Error(0.05)), Err(NoSetting::TooFar(0.1, records[2].run.clone())));
    }

    #[test]
    fn distance_is_from_the_best_value_and_what_is_undefined_does_not_count() {
        let mut records = [example("a", 16, 1.0, 0.0), example("b", 16, 2.0, 0.0), example("c", 16, 3.0, f64::NAN)];
        for (record, energy) in records.iter_mut().zip([0.7, 1.1, f64::NAN]) {
            record.metrics.insert("energy_ratio".into(), energy);
        }
        let best = choose(&records, "energy_ratio", Goal::Budget(9.0)).map(|r| r.variant.as_str());
        assert_eq!(best, Ok("b"));
        assert_eq!(choose(&records[2..], METRIC, Goal::Budget(9.0)), Err(NoSetting::Nothing(METRIC.into())));
    }

    #[test]
    fn presets_are_pipelines() {
        let text = preset(&example("a", 64, 1.0, 0.1), "acrsm.ron", "A \"good\" one.");
        assert_eq!(
            text,
            "Pipeline(\n    doc: \"A \\\"good\\\" one.\",\n    extends: \"acrsm.ron\",\n    set: {\n        \"clusters\": 64,\n        \"visibility\": \"pcss\",\n    },\n)\n"
        );
    }
}
