//! One row a run, for programs that draw and count themselves.

use indexmap::IndexSet;
use serde_json::Value;

use super::study::{all_metrics, all_stages, stage_times, time_of};
use crate::record::Record;

/// The records as comma-separated values with a row of names: inputs, adapter, metrics, times by stage, memory.
///
/// Knobs are `set.NAME`, stages `stage.NAME_ms`; what a run does not have is empty.
pub fn csv(records: &[Record]) -> String {
    let knobs: IndexSet<&str> = records.iter().flat_map(|r| r.set.keys()).map(String::as_str).collect();
    let (metrics, stages) = (all_metrics(records), all_stages(records));
    let mut names: Vec<String> = [
        "run",
        "variant",
        "pipeline",
        "scene",
        "triangles",
        "width",
        "height",
        "frames",
        "measured",
        "time_s",
        "fps",
        "seed",
        "image",
        "mask",
        "reference",
        "reference_paths",
        "adapter",
        "adapter_kind",
        "manylight",
        "date",
    ]
    .map(str::to_owned)
    .to_vec();
    names.extend(knobs.iter().map(|k| format!("set.{k}")));
    names.extend(metrics.iter().map(|&m| m.to_owned()));
    names.extend(["frame_ms", "frame_p95_ms", "until_picture_ms", "memory_bytes"].map(str::to_owned));
    names.extend(stages.iter().map(|s| format!("stage.{s}_ms")));
    let rows = records.iter().map(|record| {
        let mut row = inputs(record);
        row.extend(knobs.iter().map(|&k| record.set.get(k).cloned().unwrap_or_default()));
        row.extend(metrics.iter().map(|&m| optional(record.metrics.get(m))));
        let times = &record.times;
        row.extend([times.frame(), times.frame_summary().p95, times.until_picture].map(|t| t.to_string()));
        row.push(record.memory.to_string());
        let times = stage_times(record);
        row.extend(stages.iter().map(|s| optional(time_of(s, &times))));
        row
    });
    written(std::iter::once(names).chain(rows))
}

fn inputs(record: &Record) -> Vec<String> {
    let adapter = |key: &str| record.adapter.get(key).and_then(Value::as_str).unwrap_or_default().to_owned();
    vec![
        record.run.clone(),
        record.variant.clone(),
        record.pipeline.clone(),
        record.scene.name.clone(),
        record.scene.triangles.to_string(),
        record.size[0].to_string(),
        record.size[1].to_string(),
        record.frames.to_string(),
        record.measured.to_string(),
        record.time.to_string(),
        optional(record.fps),
        record.seed.to_string(),
        record.image.clone(),
        record.mask.clone().unwrap_or_default(),
        record.reference.name.clone(),
        optional(record.reference.paths),
        adapter("name"),
        adapter("kind"),
        record.manylight.clone(),
        record.date.clone(),
    ]
}

fn optional(value: Option<impl ToString>) -> String {
    value.map(|v| v.to_string()).unwrap_or_default()
}

/// Rows of equal length as text.
fn written(rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut writer = ::csv::Writer::from_writer(Vec::new());
    for row in rows {
        // Rows are of one length and memory does not refuse to be written to: nothing else can fail.
        let _ = writer.write_record(row);
    }
    writer.into_inner().ok().and_then(|bytes| String::from_utf8(bytes).ok()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::synthetic::sweep;

    #[test]
    fn every_value_comes_back_with_quotes_and_commas() {
        let (_, mut records) = sweep();
        records[0].run = "a \"quoted\", broken\nname".into();
        records[0].set.insert("only, here".into(), "1;2".into());
        records[1].metrics.clear();
        let text = csv(&records);
        let mut reader = ::csv::Reader::from_reader(text.as_bytes());
        let names = reader.headers().expect("names").clone();
        let rows: Vec<_> = reader.records().collect::<Result<_, _>>().expect("rows of one length");
        let cell = |row: usize, name: &str| &rows[row][names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no {name}"))];
        assert_eq!(rows.len(), records.len());
        assert_eq!(cell(0, "run"), records[0].run);
        assert_eq!(cell(0, "set.only, here"), "1;2");
        assert_eq!(cell(1, "set.only, here"), "");
        assert_eq!(cell(1, "relative_rmse"), "");
        for (i, record) in records.iter().enumerate().skip(2) {
            assert_eq!(cell(i, "relative_rmse").parse::<f64>(), Ok(record.metrics["relative_rmse"]));
            assert_eq!(cell(i, "frame_ms").parse::<f64>(), Ok(record.times.frame()));
            assert_eq!(cell(i, "set.clusters"), record.set["clusters"]);
            assert_eq!(cell(i, "stage.ism_ms").parse::<f64>(), Ok(record.times.stages()[1].1));
        }
    }
}
