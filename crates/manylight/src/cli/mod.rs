//! The command line: subcommands, options and their help.

mod bake;
mod budget;
mod lab;
pub mod values;

use std::path::PathBuf;

pub use bake::{BakeArgs, CriterionArg, LookupArg};
pub use budget::{BudgetArgs, BudgetTimeArgs};
use clap::{Args, Parser, Subcommand, ValueEnum};
pub use lab::{LabArgs, SweepArgs, TuneArgs};

/// Many-light global illumination from render graphs written in RON.
#[derive(Debug, Parser)]
#[command(name = "manylight", version, about, after_help = EXIT_CODES, subcommand_required = true, arg_required_else_help = true)]
pub struct Cli {
    /// Folder with `shaders/` and `pipelines/` to use instead of those built in; by default the nearest one at or above
    /// the current folder. The environment variable MANYLIGHT_ROOT says the same
    #[arg(long, global = true, value_name = "DIR")]
    pub root: Option<PathBuf>,
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

const EXIT_CODES: &str = "Exit codes: 0 done, 1 the input is at fault, 2 usage, 3 no usable GPU.\n\
    Example: manylight render acrsm --scene cornell --out picture.png";

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene with a pipeline and write pictures
    Render(RenderArgs),
    /// Check pipelines, nodes, sweeps and scenes without a GPU
    Check(CheckArgs),
    /// List the nodes that pipelines can use, or describe one
    Nodes(NodesArgs),
    /// Draw a pipeline as a graph
    Graph(GraphArgs),
    /// Say which nodes will run, which not, and why
    Explain(ExplainArgs),
    /// Measure what each node costs
    Profile(ProfileArgs),
    /// Render again whenever a shader, pipeline or scene file changes
    Watch(WatchArgs),
    /// Measure how far an image is from a reference
    Compare(CompareArgs),
    /// Run many settings, and report what each costs and how far it is from the truth
    Sweep(SweepArgs),
    /// Find the best setting within a time, or the fastest within an error
    Tune(TuneArgs),
    /// Trace indirect light over a day beforehand, for the pipeline `precomputed`
    Bake(BakeArgs),
    /// List the adapters (GPUs and software) of this machine
    Adapters(AdaptersArgs),
}

/// A pipeline with its parameters.
#[derive(Debug, Args)]
pub struct PipelineArgs {
    /// A pipeline: a path to a .ron file, or a name such as `acrsm`
    #[arg(value_name = "PIPELINE")]
    pub pipeline: String,
    /// Set a parameter of the pipeline, or of a node as `NODE.PARAMETER` (repeatable; the last one wins)
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = values::assignment)]
    pub set: Vec<(String, String)>,
}

/// Size of the picture.
#[derive(Debug, Args)]
pub struct SizeArgs {
    /// Size of the picture in pixels
    #[arg(long, value_name = "WxH", default_value = "512x512", value_parser = values::size)]
    pub size: (u32, u32),
}

/// Debug switches of the executor; none changes the picture.
#[derive(Debug, Args)]
#[command(next_help_heading = "Debug switches (none may change the picture)")]
pub struct DebugArgs {
    /// Run nodes that nobody reads
    #[arg(long)]
    pub no_culling: bool,
    /// Run nodes whose inputs are as they were as well, and let resources share memory
    #[arg(long)]
    pub no_skipping: bool,
    /// Give every resource memory of its own
    #[arg(long)]
    pub no_reuse: bool,
    /// Fill transient resources with NaN patterns before their first use
    #[arg(long)]
    pub poison: bool,
    /// Look at every number that a node writes, right after it: what is NaN, infinite or beyond what a port promises (negative radiance) is told
    /// with its node and texel
    #[arg(long)]
    pub watch_numbers: bool,
    /// Run the nodes in another legal order, chosen by a seed
    #[arg(long, value_name = "SEED")]
    pub shuffle: Option<u64>,
}

/// What to render with and how.
#[derive(Debug, Args)]
pub struct FrameArgs {
    /// A scene: a path to a .ron, .obj, .gltf or .glb file, or a name such as `cornell`
    #[arg(long, value_name = "SCENE")]
    pub scene: String,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub size: SizeArgs,
    /// Scene time in seconds
    #[arg(long, value_name = "SECONDS", default_value = "0", value_parser = values::seconds, allow_negative_numbers = true)]
    pub time: f64,
    /// Step the scene time by 1/F from frame to frame, starting at --time; without it the time stands still
    #[arg(long, value_name = "F", value_parser = values::rate)]
    pub fps: Option<f64>,
    /// Seed of everything random
    #[arg(long, default_value_t = 0)]
    pub seed: u32,
    /// Precomputed light for the pipeline, a file of `manylight bake`
    #[arg(long, value_name = "FILE")]
    pub baked: Option<PathBuf>,
    /// Use the adapter whose name contains this (see `manylight adapters`)
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub debug: DebugArgs,
}

/// `manylight render`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    manylight render acrsm --scene cornell --out picture.png\n  \
    manylight render pipelines/acrsm.ron --scene assets/cornell.ron --set lights=vpl --set clusters=128 \\\n      \
    --size 256x256 --out linear.exr --dump clusters=clusters.json --dump ism=ism.png --stats stats.json")]
pub struct RenderArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub pipeline: PipelineArgs,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub frame: FrameArgs,
    /// Frames to render; the last is written. Iterative clustering needs some to settle
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: u32,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub budget: BudgetArgs,
    /// Write the last frame: .png as presented, .exr as linear radiance before tone mapping (repeatable)
    #[arg(long, value_name = "FILE")]
    pub out: Vec<PathBuf>,
    /// Write a resource of the graph: textures as .exr or .png (one channel: scaled to its range), buffers as .json (repeatable)
    #[arg(long, value_name = "RESOURCE=FILE", value_parser = values::dump)]
    pub dump: Vec<(String, PathBuf)>,
    /// Write adapter, timings, memory, plan, parameters and sums of the dumped resources as JSON
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
}

/// `manylight check`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  manylight check\n  manylight check pipelines/acrsm.ron shaders/ism/splat.ron scenes/room.ron")]
pub struct CheckArgs {
    /// Pipelines, node declarations, sweeps or scenes (.ron); without any: everything in the library
    #[arg(value_name = "FILE")]
    pub files: Vec<PathBuf>,
}

/// Output of lists.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs)]
pub enum TextOrJson {
    Text,
    Json,
}

/// Output of `nodes`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs)]
pub enum NodesFormat {
    Text,
    Json,
    Markdown,
}

/// `manylight nodes`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  manylight nodes\n  manylight nodes ism/splat --format markdown")]
pub struct NodesArgs {
    /// Only this node, in full
    pub name: Option<String>,
    /// How to print
    #[arg(long, value_enum, default_value = "text")]
    pub format: NodesFormat,
}

/// Output of `graph`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
#[allow(missing_docs)]
pub enum GraphFormat {
    Svg,
    Dot,
    Mermaid,
    Json,
}

/// `manylight graph`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  manylight graph acrsm --set visibility=pcss --format svg > acrsm.svg")]
pub struct GraphArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub pipeline: PipelineArgs,
    /// A scene, whose features conditions may test; without one a scene without textures or motion is assumed
    #[arg(long, value_name = "SCENE")]
    pub scene: Option<String>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub size: SizeArgs,
    /// How to draw
    #[arg(long, value_enum, default_value = "svg")]
    pub format: GraphFormat,
    /// Write to a file instead of the standard output
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
}

/// `manylight explain`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  manylight explain acrsm --scene cornell --set visibility=none\n  \
    manylight explain acrsm --scene cornell --size 256x256 --frames 40 --fps 30\n\
    Without --frames it needs no GPU.")]
pub struct ExplainArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub pipeline: PipelineArgs,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub frame: FrameArgs,
    /// Render so many frames, and say which nodes ran in the last and for what change, which were skipped, and the time that is saved
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: Option<u32>,
    /// How to print
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// How nodes are timed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Timing {
    /// Serial on software adapters, timestamps elsewhere.
    Auto,
    /// GPU timestamps in ordinary frames.
    Timestamps,
    /// Each node submitted on its own and waited for.
    Serial,
}

/// `manylight profile`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  manylight profile acrsm --scene cornell --size 256x256 --frames 32 --trace trace.json\n\
    The trace opens in https://ui.perfetto.dev. Times of a software adapter are labelled as such.")]
pub struct ProfileArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub pipeline: PipelineArgs,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub frame: FrameArgs,
    /// Frames to measure
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: u32,
    /// Frames to render first that are not measured
    #[arg(long, value_name = "N", default_value_t = 4)]
    pub warm_up: u32,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub budget: BudgetArgs,
    /// Measure frames as they are in a window: nodes whose inputs are as they were are skipped. Without it every node runs in every frame
    #[arg(long)]
    pub skip_unchanged: bool,
    /// How nodes are timed. Timestamps of software adapters are not tied to the work around them
    #[arg(long, value_enum, default_value = "auto")]
    pub timing: Timing,
    /// Write a Chrome trace of the measured frames
    #[arg(long, value_name = "FILE.json")]
    pub trace: Option<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// `manylight watch`.
#[derive(Debug, Args)]
#[command(
    after_help = "Example:\n  manylight watch acrsm --scene cornell --out picture.png\nEdit a file under shaders/ or pipelines/ and save it. Ctrl+C ends."
)]
pub struct WatchArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub pipeline: PipelineArgs,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub frame: FrameArgs,
    /// Frames to render after each change before the picture is written
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub frames: u32,
    /// Picture to write: .png as presented, .exr as linear radiance (repeatable)
    #[arg(long, value_name = "FILE", required = true)]
    pub out: Vec<PathBuf>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub budget: BudgetTimeArgs,
    /// End after this many pictures instead of running until Ctrl+C (for scripts)
    #[arg(long, value_name = "N")]
    pub pictures: Option<u32>,
}

/// What an error map shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ErrorMapArg {
    /// Image less reference: blue where the image is darker, red where it is brighter
    Difference,
    /// The magnitude of that, from black to pale yellow
    Absolute,
    /// Relative to the reference, dark pixels counting as a tenth of its mean
    Relative,
    /// How visible the difference is
    Flip,
}

/// `manylight compare`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  manylight compare picture.exr reference.exr\n  \
    manylight compare normal.exr gbuffer.exr --reference-layer normal --format json\n  \
    manylight compare picture.exr reference.exr --error-map error.png --error-map-kind flip\n  \
    manylight compare picture.exr reference.exr --mask depth.exr --mask-below 10\n  \
    manylight compare truth.exr reference.exr --standard-error error.exr \\\n      \
    --reference-standard-error reference_stderr.exr --reference-batches 12")]
pub struct CompareArgs {
    /// The image: .exr (linear values) or .png (display values)
    pub image: PathBuf,
    /// The reference, of the same size and kind
    pub reference: PathBuf,
    /// Layer of the image: `albedo` for the channels albedo.R, albedo.G, albedo.B
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Layer of the reference
    #[arg(long, value_name = "NAME")]
    pub reference_layer: Option<String>,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub mask: MaskArgs,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub map: ErrorMapArgs,
    #[command(flatten)]
    #[allow(missing_docs)]
    pub noise: NoiseArgs,
    /// How to print
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

/// Which pixels count.
#[derive(Debug, Args)]
#[command(next_help_heading = "Which pixels count")]
#[group(id = "mask_options")]
pub struct MaskArgs {
    /// Count only pixels where this picture is above or below a threshold (of several channels: their mean)
    #[arg(long, value_name = "FILE", requires = "threshold")]
    pub mask: Option<PathBuf>,
    /// Layer of the mask
    #[arg(long, value_name = "NAME", requires = "mask")]
    pub mask_layer: Option<String>,
    /// Pixels count where the mask is above this
    #[arg(long, value_name = "X", requires = "mask", group = "threshold", value_parser = values::finite, allow_negative_numbers = true)]
    pub mask_above: Option<f32>,
    /// Pixels count where the mask is below this
    #[arg(long, value_name = "X", requires = "mask", group = "threshold", value_parser = values::finite, allow_negative_numbers = true)]
    pub mask_below: Option<f32>,
}

/// The picture of the error.
#[derive(Debug, Args)]
#[command(next_help_heading = "Error map")]
#[group(id = "error_map_options")]
pub struct ErrorMapArgs {
    /// Write a map of the error: .png in colours, .exr as numbers
    #[arg(long, value_name = "FILE")]
    pub error_map: Option<PathBuf>,
    /// What the map shows [default: difference]
    #[arg(long, value_enum, value_name = "KIND", requires = "error_map")]
    pub error_map_kind: Option<ErrorMapArg>,
    /// Value at the end of the map's colours [default: half of the reference's mean; relative 0.5; flip 1]
    #[arg(long, value_name = "X", requires = "error_map", value_parser = values::positive)]
    pub error_map_range: Option<f32>,
}

/// What is known about noise.
#[derive(Debug, Args)]
#[command(next_help_heading = "Test against noise")]
#[group(id = "noise_options")]
pub struct NoiseArgs {
    /// Standard error of every pixel of the image (.exr): tests whether noise explains the difference
    #[arg(long, value_name = "FILE")]
    pub standard_error: Option<PathBuf>,
    /// Batches that it is from; by default its alpha channel, without one it counts as exact
    #[arg(long, value_name = "N", requires = "standard_error", value_parser = clap::value_parser!(u32).range(2..))]
    pub batches: Option<u32>,
    /// Standard error of every pixel of the reference (.exr)
    #[arg(long, value_name = "FILE")]
    pub reference_standard_error: Option<PathBuf>,
    /// Batches that it is from; by default its alpha channel, without one it counts as exact
    #[arg(long, value_name = "N", requires = "reference_standard_error", value_parser = clap::value_parser!(u32).range(2..))]
    pub reference_batches: Option<u32>,
}

/// `manylight adapters`.
#[derive(Debug, Args)]
#[command(after_help = "Example:\n  manylight adapters --format json")]
pub struct AdaptersArgs {
    /// How to print
    #[arg(long, value_enum, default_value = "text")]
    pub format: TextOrJson,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn every_subcommand_has_an_example() {
        for command in Cli::command().get_subcommands() {
            let help = command.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(help.contains("Example") && help.contains(&format!("manylight {}", command.get_name())), "{}", command.get_name());
        }
    }

    #[test]
    fn malformed_values_are_faults_of_usage() {
        for wrong in [
            &["--size", "0x0"][..],
            &["--size", "99999x1"],
            &["--set", "clusters"],
            &["--frames", "0"],
            &["--fps", "0"],
            &["--time", "soon"],
            &["--dump", "ism"],
            &["--shuffle", "-1"],
        ] {
            let line = ["manylight", "render", "acrsm", "--scene", "cornell"].iter().chain(wrong);
            let error = Cli::try_parse_from(line).expect_err("malformed");
            assert_eq!(error.exit_code(), 2, "{wrong:?}");
        }
    }
}
