//! A made-up sweep for tests.

use indexmap::IndexMap;
use serde_json::json;

use crate::{
    record::{FrameError, NodeTime, Pictures, Record, Times, tests::example},
    sheet::{Axis, Curve, Paper, Sheet},
};

/// A run whose error falls with the root of its clusters and whose time grows with them.
pub fn run(variant: &str, scene: &str, clusters: u32, filter: &str) -> Record {
    let quality = f64::from(variant.len() as u32) + f64::from(scene.len() as u32) / 8.0;
    let blur = if filter == "box" { 1.2 } else { 1.0 };
    let error = 0.3 * quality * blur / f64::from(clusters).sqrt();
    let node = |id: &str, stage: &str, median: f64| NodeTime { id: id.into(), stage: stage.into(), median, p95: median * 1.1 };
    let c = f64::from(clusters);
    let nodes = vec![
        node("rsm", "rsm", 1.5),
        node("splat", "ism", 2.0 + c / 80.0),
        node("pull", "ism", 1.0),
        node("gather", "lighting", 0.05 * c * quality / 3.0),
        node("filter", "filter", 2.5 * blur),
    ];
    let sum: f64 = nodes.iter().map(|n| n.median).sum();
    let metrics = |error: f64| IndexMap::from([("relative_rmse".to_owned(), error), ("energy_ratio".to_owned(), 1.0 - error / 2.0)]);
    let picture = |what: &str| Some(format!("{what}/{variant}-{scene}-{clusters}-{filter}.png"));
    let mut record = example(variant, clusters, sum * 1.05, error);
    record.run = format!("{variant} clusters={clusters} filter={filter} | {scene} | 256x256 | seed 0");
    record.set = IndexMap::from([("clusters".to_owned(), clusters.to_string()), ("filter".to_owned(), filter.to_owned())]);
    record.varied = vec!["clusters".into(), "filter".into()];
    record.scene.name = scene.into();
    record.adapter = json!({"name": "llvmpipe", "kind": "software"});
    record.times = Times { method: "serial".into(), software: true, gpu: None, nodes, ..record.times };
    record.metrics = metrics(error);
    let frame = |i: u32| FrameError { time: f64::from(i) / 24.0, metrics: metrics(error * (1.2 + (f64::from(i) / 3.0 + c).sin() / 5.0)) };
    record.sequence = (0..24).map(frame).collect();
    record.pictures = Pictures { image: picture("image"), reference: Some(format!("reference/{scene}.png")), error: picture("error") };
    record
}

/// Two variants in two scenes over two knobs, a paper's table and another renderer's curve.
pub fn sweep() -> (Sheet, Vec<Record>) {
    let mut records = Vec::new();
    for scene in ["cornell", "sponza"] {
        for variant in ["val", "vpl-simple"] {
            for filter in ["tent", "box"] {
                records.extend([16, 32, 64, 128, 256].map(|clusters| run(variant, scene, clusters, filter)));
            }
        }
    }
    let value = |row: &str, column: &str, ms: f64| (row.to_owned(), column.to_owned(), ms);
    let values = vec![
        value("val", "lighting", 11.0),
        value("val", "frame", 26.0),
        value("vpl-simple", "lighting", 30.0),
        value("vpl-simple", "frame", 52.0),
    ];
    let sheet = Sheet {
        name: "counts".into(),
        doc: "How does the error fall with the number of lights?\n\nAnd what does it cost?".into(),
        axis: Axis::Frame,
        metric: "relative_rmse".into(),
        metrics: vec!["relative_rmse".into(), "energy_ratio".into()],
        refused: Vec::new(),
        claims: Vec::new(),
        papers: vec![Paper { source: "[VAL] table 1".into(), unit: "ms".into(), values }],
        curves: vec![Curve {
            name: "Mitsuba path, 16 cores".into(),
            scene: "cornell".into(),
            size: [256, 256],
            metric: "relative_rmse".into(),
            points: vec![(20.0, 0.9), (80.0, 0.45), (320.0, 0.22)],
        }],
    };
    (sheet, records)
}
