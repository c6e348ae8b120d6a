//! What all numbers of a report depend on, and what makes them hard to compare.

use indexmap::IndexSet;
use serde_json::Value;

use super::{
    study::Study,
    text::{count, number},
};
use crate::record::Record;

/// Facts above the plots, in sentences.
pub(super) struct Heading {
    pub facts: Vec<(&'static str, String)>,
    pub warnings: Vec<String>,
}

impl Heading {
    pub fn of(study: &Study<'_>) -> Self {
        let records = study.records;
        let adapters = distinct(records, adapter);
        let versions = distinct(records, |r| r.manylight.clone());
        let methods = distinct(records, |r| r.times.method.clone());
        let mut dates: Vec<&str> = records.iter().map(|r| r.date.as_str()).collect();
        dates.sort_unstable();
        let date = match (dates.first(), dates.last()) {
            (Some(first), Some(last)) if first != last => format!("{first} to {last}"),
            (Some(date), _) => (*date).to_owned(),
            _ => String::new(),
        };
        let facts = vec![
            ("Runs", records.len().to_string()),
            ("Adapter", adapters.join("; ")),
            ("Date", date),
            ("manylight", versions.join(", ")),
            ("Nodes timed by", methods.join(", ")),
            ("Compared with", distinct(records, reference).join("; ")),
        ];
        let mut warnings = Vec::new();
        for (what, values) in [("adapters", &adapters), ("versions of manylight", &versions), ("ways of timing nodes", &methods)] {
            if values.len() > 1 {
                warnings.push(format!("The runs are of different {what}, their times do not compare: {}.", values.join("; ")));
            }
        }
        let compared = |r: &Record| (r.scene.hash.clone(), r.reference.hash.clone(), r.mask.clone());
        for group in &study.groups {
            let counted = |run: &usize| records[*run].counted;
            if group.runs.iter().map(counted).min() != group.runs.iter().map(counted).max() {
                warnings.push(format!(
                    "The runs of {} count different pixels, as their masks differ: their errors hardly compare.",
                    group.title()
                ));
            }
            let first = compared(&records[group.runs[0]]);
            if group.runs.iter().any(|&run| compared(&records[run]) != first) {
                let what = "differ in scene files, reference or mask, their errors do not compare";
                warnings.push(format!("The runs of {} {what}.", group.title()));
            }
        }
        for record in records.iter().filter(|r| r.not_finite > 0) {
            let run = &record.run;
            warnings.push(format!(
                "{} of {run} are not finite in the image or the reference and do not count.",
                count(record.not_finite as usize, "pixel")
            ));
        }
        Self { facts, warnings }
    }
}

fn distinct(records: &[Record], of: impl Fn(&Record) -> String) -> Vec<String> {
    records.iter().map(of).collect::<IndexSet<_>>().into_iter().collect()
}

fn adapter(record: &Record) -> String {
    let text = |key: &str| record.adapter.get(key).and_then(Value::as_str).unwrap_or("unknown");
    let of_cpu = if record.times.software { ": times are those of a CPU" } else { "" };
    format!("{} ({}{of_cpu})", text("name"), text("kind"))
}

fn reference(record: &Record) -> String {
    let facts = &record.reference;
    let mut text = format!("{}: {}", record.scene.name, facts.name);
    if let Some(paths) = facts.paths {
        text += &format!(", {paths} paths a pixel");
    }
    if let Some(error) = facts.relative_standard_error {
        text += &format!(", relative standard error {}", number(error));
    }
    text
}
