//! Records of runs: one JSON object a line, with everything that the numbers depend on.

use std::{
    fs::{self, OpenOptions},
    io::{ErrorKind, Write},
    path::{Path, PathBuf},
};

use indexmap::IndexMap;
use serde::{Deserialize, Serialize};

use crate::{
    files::{FileError, write_text},
    sheet::Axis,
    timing::{FrameSamples, Samples},
};

/// Version of the format of records; records of another one are not read.
pub const FORMAT: u32 = 1;

/// One run of a sweep: its inputs, what it cost and how far its picture is from the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// [`FORMAT`].
    pub format: u32,
    /// Which run of the sweep it is: variant, settings, scene, size and seed in words. Unique within a sweep.
    pub run: String,
    /// Hash of all inputs below, of the shaders and of the adapter: equal hash, equal picture.
    pub inputs: String,
    /// The sweep's name.
    pub sweep: String,
    /// The variant's name.
    pub variant: String,
    /// The pipeline's name.
    pub pipeline: String,
    /// Parameters that the sweep sets for this run, by pipeline or node parameter.
    pub set: IndexMap<String, String>,
    /// Those of them that vary within the variant, in the order of the sweep.
    pub varied: Vec<String>,
    /// Every parameter of the pipeline with its value.
    pub parameters: serde_json::Value,
    /// The scene.
    pub scene: SceneFacts,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Frames rendered before the picture was taken, that one included.
    pub frames: u32,
    /// Frames measured after that.
    pub measured: u32,
    /// Scene time of the first frame in seconds.
    pub time: f64,
    /// Frames a second of scene time; `None`: time stands still.
    pub fps: Option<f64>,
    /// Times, positions and targets of the first light, where the sweep moves it.
    #[serde(default)]
    pub light_path: Vec<(f64, [f32; 3], [f32; 3])>,
    /// Frames of the sequence after the picture, and every how many of them one is compared.
    #[serde(default)]
    pub sequence_frames: Option<[u32; 2]>,
    /// Seed of everything random.
    pub seed: u32,
    /// The resource that is compared.
    pub image: String,
    /// What it is compared with.
    pub reference: ReferenceFacts,
    /// What pixels count, in words; `None`: all.
    pub mask: Option<String>,
    /// Name, kind, backend and driver of the adapter, as [`crate::facts::adapter`] gives them.
    pub adapter: serde_json::Value,
    /// Version of manylight.
    pub manylight: String,
    /// When the run ended, UTC, RFC 3339.
    pub date: String,
    /// What it cost.
    pub times: Times,
    /// Memory of the frame in bytes, besides the scene.
    pub memory: u64,
    /// Errors by the names of [`crate::metrics`]; those that are not defined (a ratio to black) are absent.
    pub metrics: IndexMap<String, f64>,
    /// Pixels that count.
    #[serde(default)]
    pub counted: u64,
    /// Pixels that do not count because image or reference is not finite there.
    pub not_finite: u64,
    /// Errors over time, when the sweep asks for a sequence.
    pub sequence: Vec<FrameError>,
    /// Files of the pictures, relative to the folder of the records.
    pub pictures: Pictures,
}

/// A scene as a record names it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneFacts {
    /// Its name.
    pub name: String,
    /// Hash of the contents of its files, hexadecimal.
    pub hash: String,
    /// Triangles of all objects.
    pub triangles: u64,
}

/// A reference as a record names it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReferenceFacts {
    /// The component that was path-traced, or the name of the file.
    pub name: String,
    /// Hash of what it was made from, or of the file's contents, hexadecimal.
    pub hash: String,
    /// Paths a pixel, if it was path-traced.
    pub paths: Option<u64>,
    /// Root of the mean squared standard error of its pixels over its mean, where known.
    pub relative_standard_error: Option<f64>,
}

/// Times of a run in milliseconds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// How nodes were timed: `timestamps`, or `serial` (each submitted on its own and waited for).
    pub method: String,
    /// Times of a frame are those of a CPU.
    pub software: bool,
    /// From the start of recording until the GPU was done.
    pub wall: Summary,
    /// From the first pass to the last, where the adapter has timestamps.
    pub gpu: Option<Summary>,
    /// To record and submit.
    pub cpu: Option<Summary>,
    /// Of as many frames as there are until the picture: what a picture costs when it is not the next of many. Building the pipeline, the
    /// hierarchy and points that stay is not part of it.
    pub until_picture: f64,
    /// Node by node, in the order of the plan.
    pub nodes: Vec<NodeTime>,
}

impl Times {
    /// The time of a frame: the median of [`Times::frame_summary`].
    pub fn frame(&self) -> f64 {
        self.frame_summary().median
    }

    /// Measurements of a frame: the GPU's where it has timestamps and is one, else until it was done.
    pub fn frame_summary(&self) -> &Summary {
        self.gpu.as_ref().filter(|_| !self.software).unwrap_or(&self.wall)
    }

    /// The time that an axis shows.
    pub fn on(&self, axis: Axis) -> f64 {
        match axis {
            Axis::Frame => self.frame(),
            Axis::Picture => self.until_picture,
        }
    }

    /// Sum of the medians of each stage's nodes, in the order of their first nodes.
    pub fn stages(&self) -> Vec<(String, f64)> {
        let mut stages: IndexMap<&str, f64> = IndexMap::new();
        for node in &self.nodes {
            *stages.entry(&node.stage).or_default() += node.median;
        }
        stages.into_iter().map(|(stage, time)| (stage.to_owned(), time)).collect()
    }
}

/// Time of a node in milliseconds, on the processor that does its work.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NodeTime {
    /// Id in the pipeline.
    pub id: String,
    /// Its stage.
    pub stage: String,
    /// Median; 0 where there was no sample.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
}

/// Several measurements of one quantity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Summary {
    /// Middle value.
    pub median: f64,
    /// 95th percentile, nearest rank.
    pub p95: f64,
    /// Number of measurements.
    pub samples: usize,
}

impl Summary {
    /// Of samples; `None` without any.
    pub fn of(samples: &Samples) -> Option<Self> {
        Some(Self { median: samples.median()?, p95: samples.percentile(95.0)?, samples: samples.len() })
    }
}

/// Times of the nodes of several frames.
pub fn node_times(samples: &FrameSamples) -> Vec<NodeTime> {
    let time = |n: &crate::timing::NodeSamples| {
        let own = if n.host { &n.cpu } else { &n.gpu };
        let (median, p95) = (own.median().unwrap_or(0.0), own.percentile(95.0).unwrap_or(0.0));
        NodeTime { id: n.id.clone(), stage: n.stage.clone(), median, p95 }
    };
    samples.nodes.iter().map(time).collect()
}

/// Error at one time of a sequence.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameError {
    /// Scene time in seconds.
    pub time: f64,
    /// Errors by name.
    pub metrics: IndexMap<String, f64>,
}

/// Files of a run's pictures.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pictures {
    /// What was compared, tone mapped by one exposure for all runs of a scene.
    pub image: Option<String>,
    /// The reference, alike.
    pub reference: Option<String>,
    /// The error map.
    pub error: Option<String>,
}

/// A line of a file that is no record.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Damage {
    /// The file.
    pub file: PathBuf,
    /// From 1.
    pub line: usize,
    /// What is wrong.
    pub reason: String,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}: no record ({})", self.file.display(), self.line, self.reason)
    }
}

/// What a file of records holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lines {
    /// Its records, in order.
    pub records: Vec<Record>,
    /// Lines in another format than [`FORMAT`].
    pub foreign: Vec<String>,
    /// Lines that are no records.
    pub damaged: Vec<Damage>,
    /// Whether the last line has an end, so that another can be added.
    pub complete: bool,
}

/// Reads all records of a file; a file that is not there has none.
///
/// # Errors
/// The file is there and cannot be read.
pub fn read(file: &Path) -> Result<Lines, FileError> {
    let bytes = match fs::read(file) {
        Ok(bytes) => bytes,
        Err(e) if e.kind() == ErrorKind::NotFound => return Ok(Lines { complete: true, ..Lines::default() }),
        Err(e) => return Err(FileError::read(file, e)),
    };
    let mut lines = Lines { complete: bytes.is_empty() || bytes.ends_with(b"\n"), ..Lines::default() };
    for (index, line) in bytes.split(|b| *b == b'\n').enumerate() {
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        match serde_json::from_slice::<Record>(line) {
            Ok(record) if record.format == FORMAT => lines.records.push(record),
            _ if format_of(line).is_some_and(|format| format != FORMAT) => lines.foreign.push(String::from_utf8_lossy(line).into_owned()),
            Ok(_) => {}
            Err(e) => lines.damaged.push(Damage { file: file.to_owned(), line: index + 1, reason: e.to_string() }),
        }
    }
    Ok(lines)
}

/// The format of a line, if it is a record of any.
fn format_of(line: &[u8]) -> Option<u32> {
    let value: serde_json::Value = serde_json::from_slice(line).ok()?;
    u32::try_from(value.get("format")?.as_u64()?).ok()
}

/// Adds a record at the end of a file and sees that it is on the disk.
///
/// # Errors
/// The disk is full, or the file cannot be written.
pub fn append(file: &Path, record: &Record) -> Result<(), FileError> {
    let failed = |e: &std::io::Error| FileError::write(file, e);
    let line = line(record).map_err(|e| failed(&e))?;
    let mut out = OpenOptions::new().create(true).append(true).open(file).map_err(|e| failed(&e))?;
    let whole = out.metadata().map_err(|e| failed(&e))?.len();
    out.write_all(line.as_bytes()).and_then(|()| out.sync_data()).map_err(|e| {
        // No half of a line stays. Should that fail as well, the next run tells of the line and leaves it out.
        let _ = out.set_len(whole);
        failed(&e)
    })
}

/// Replaces a file by these records and lines of other formats.
///
/// # Errors
/// The file cannot be written; the old one stays.
pub fn write(file: &Path, records: &[Record], foreign: &[String]) -> Result<(), FileError> {
    let lines: Result<String, _> = records.iter().map(line).collect();
    let foreign: String = foreign.iter().map(|line| format!("{line}\n")).collect();
    write_text(file, &(lines.map_err(|e| FileError::write(file, &e))? + &foreign))
}

fn line(record: &Record) -> Result<String, std::io::Error> {
    Ok(serde_json::to_string(record)? + "\n")
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A record of a variant and one knob.
    pub(crate) fn example(variant: &str, clusters: u32, frame_ms: f64, error: f64) -> Record {
        let summary = Summary { median: frame_ms, p95: frame_ms * 1.1, samples: 8 };
        let node =
            |id: &str, stage: &str, share: f64| NodeTime { id: id.into(), stage: stage.into(), median: share * frame_ms, p95: frame_ms };
        Record {
            format: FORMAT,
            run: format!("{variant} clusters={clusters} | cornell | 256x256 | seed 0"),
            inputs: format!("{variant}{clusters}"),
            sweep: "example".into(),
            variant: variant.into(),
            pipeline: "acrsm".into(),
            set: [("clusters".to_owned(), clusters.to_string()), ("visibility".to_owned(), "pcss".to_owned())].into_iter().collect(),
            varied: vec!["clusters".into()],
            parameters: serde_json::json!({"clusters": clusters}),
            scene: SceneFacts { name: "cornell".into(), hash: "0123456789abcdef".into(), triangles: 34 },
            size: [256, 256],
            frames: 24,
            measured: 8,
            time: 0.0,
            fps: None,
            light_path: Vec::new(),
            sequence_frames: None,
            seed: 0,
            image: "indirect".into(),
            reference: ReferenceFacts {
                name: "one_bounce".into(),
                hash: "ab".into(),
                paths: Some(1024),
                relative_standard_error: Some(0.01),
            },
            mask: None,
            adapter: serde_json::json!({"name": "Example", "kind": "discrete GPU"}),
            manylight: "0.1.0".into(),
            date: "2026-01-02T03:04:05Z".into(),
            times: Times {
                method: "timestamps".into(),
                software: false,
                wall: summary,
                gpu: Some(summary),
                cpu: None,
                until_picture: 24.0 * frame_ms,
                nodes: vec![node("map", "clustering", 0.25), node("splat", "ism", 0.25), node("indirect", "indirect", 0.5)],
            },
            memory: 1 << 20,
            metrics: [("relative_mean_absolute_error".to_owned(), error), ("relative_rmse".to_owned(), 2.0 * error)].into_iter().collect(),
            counted: 65536,
            not_finite: 0,
            sequence: Vec::new(),
            pictures: Pictures::default(),
        }
    }

    #[test]
    fn records_come_back_and_damaged_lines_are_told() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let file = folder.path().join("records.jsonl");
        let records = [example("a", 16, 1.0, 0.3), example("b", 32, 1.0 / 3.0, 0.1 + 0.2)];
        for record in &records {
            append(&file, record).expect("writable");
        }
        let whole = read(&file).expect("readable");
        assert!(whole.records == records && whole.complete && whole.damaged.is_empty());
        let other = Record { format: FORMAT + 1, ..records[0].clone() };
        let text = fs::read_to_string(&file).expect("readable");
        fs::write(&file, format!("{{\"half\": \n\n{text}{}\n\u{0}", serde_json::to_string(&other).expect("JSON"))).expect("writable");
        let lines = read(&file).expect("readable");
        assert!(lines.records == records && !lines.complete);
        assert_eq!(lines.damaged.iter().map(|d| d.line).collect::<Vec<_>>(), [1, 6]);
        assert_eq!(lines.foreign, [serde_json::to_string(&other).expect("JSON")], "another format is not ours to throw away");
        assert!(read(&folder.path().join("nothing.jsonl")).expect("no file, no records").complete);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_full_disk_is_a_fault_that_says_so() {
        let fault = append(Path::new("/dev/full"), &example("a", 16, 1.0, 0.3)).expect_err("no space").to_string();
        assert!(fault.contains("/dev/full") && fault.contains("No space left"), "{fault}");
    }

    #[test]
    fn stages_are_sums_of_their_nodes() {
        let mut record = example("a", 16, 8.0, 0.1);
        record.times.nodes.push(NodeTime { id: "average".into(), stage: "clustering".into(), median: 1.0, p95: 1.0 });
        assert_eq!(record.times.stages(), [("clustering".to_owned(), 3.0), ("ism".to_owned(), 2.0), ("indirect".to_owned(), 4.0)]);
        record.times.software = true;
        record.times.wall.median = 9.0;
        assert_eq!((record.times.frame(), record.times.on(Axis::Picture)), (9.0, 192.0));
    }
}
