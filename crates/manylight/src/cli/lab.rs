//! Options of `sweep` and `tune`.

use std::path::PathBuf;

use clap::{ArgGroup, Args};

use super::values;

/// Where records and references lie, and with what they are made.
#[derive(Debug, Args)]
pub struct LabArgs {
    /// Folder of path-traced references, kept by the hash of what they were made from [default: the user's cache folder]
    #[arg(long, value_name = "DIR")]
    pub cache: Option<PathBuf>,
    /// The sweep in its small size, for a first look
    #[arg(long)]
    pub small: bool,
    /// Size of the pictures instead of the sweep's
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    pub size: Option<(u32, u32)>,
    /// Use the adapter whose name contains this (see `manylight adapters`)
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}

/// `manylight sweep`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  manylight sweep val-64-vs-512 --out results\n  \
    manylight sweep my-sweep.ron --out results --shard 1/2\n  \
    manylight sweep convergence --scene rooms/hall.ron --out hall --small\n\
    A sweep that was stopped goes on where it was: runs whose record is in DIR are kept. Parts in one folder are put together by\n\
    running the command there once more, or with --report.")]
pub struct SweepArgs {
    /// A sweep: a path to a .ron file, or a name in `pipelines/sweeps`
    pub sweep: String,
    /// Folder for records, pictures, table and report
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Do part I of N parts
    #[arg(long, value_name = "I/N", value_parser = values::share, conflicts_with = "report")]
    pub shard: Option<(usize, usize)>,
    /// Scenes instead of the sweep's (repeatable)
    #[arg(long, value_name = "SCENE")]
    pub scene: Vec<String>,
    /// Reference of the one scene given by --scene: an EXR file of the runs' size
    #[arg(long, value_name = "FILE.exr", requires = "scene")]
    pub reference: Option<PathBuf>,
    /// Standard error of that reference
    #[arg(long, value_name = "FILE.exr", requires = "reference")]
    pub standard_error: Option<PathBuf>,
    /// Print the runs and end
    #[arg(long, conflicts_with = "report")]
    pub list: bool,
    /// Make table and report from the records in DIR, whatever machine they are of, and run nothing; needs no GPU
    #[arg(long)]
    pub report: bool,
    /// Also write the report as Markdown with its figures into this folder
    #[arg(long, value_name = "DIR", conflicts_with = "list")]
    pub markdown: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub lab: LabArgs,
}

/// `manylight tune`.
#[derive(Debug, Args)]
#[command(group = ArgGroup::new("goal").required(true).args(["budget", "error"]))]
#[command(after_help = "Examples:\n  manylight tune acrsm --scene cornell --budget 16ms --out fast.ron\n  \
    manylight tune acrsm --scene cornell --error 0.1 --sweep my-sweep.ron --out good.ron\n\
    The preset is a pipeline: manylight render good.ron --scene cornell --out picture.png")]
pub struct TuneArgs {
    /// A pipeline: a path to a .ron file, or a name such as `acrsm`
    pub pipeline: String,
    /// A scene: a path to a .ron, .obj, .gltf or .glb file, or a name such as `cornell`
    #[arg(long, value_name = "SCENE")]
    pub scene: String,
    /// Find the most accurate setting within this time a frame
    #[arg(long, value_name = "TIME", value_parser = values::milliseconds)]
    pub budget: Option<f64>,
    /// Find the fastest setting within this error, by the sweep's metric (a share of the mean by default: 0.1 is 10 %)
    #[arg(long, value_name = "ERROR", value_parser = values::error)]
    pub error: Option<f64>,
    /// The sweep whose settings are tried; those of its variants that use the pipeline count
    #[arg(long, value_name = "SWEEP", default_value = "tune")]
    pub sweep: String,
    /// Write the setting as a preset that `render` takes
    #[arg(long, value_name = "FILE.ron")]
    pub out: PathBuf,
    /// Keep records, pictures and report here, and take up those that are there [default: a folder in the user's cache]
    #[arg(long, value_name = "DIR")]
    pub records: Option<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub lab: LabArgs,
}
