//! Options of `bake`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::values;

/// What is compared to split an interval.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CriterionArg {
    /// The interpolated middle with the rendered one.
    Middle,
    /// The interpolated middle with the ends of the interval, as in the paper.
    Ends,
}

/// How baked light is found for a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LookupArg {
    /// At its place in the picture: for a camera that stands still.
    Image,
    /// On six faces of a cube round the camera: for one that turns.
    Cube,
    /// In an atlas over the surfaces: for a camera that moves.
    Atlas,
}

/// `manylight bake`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    manylight bake day --out day.baked\n  \
    manylight bake rooms/hall.ron --out hall.baked --size 400x300 --paths 256 --threshold 0.02 --variance 0.998\n  \
    manylight render precomputed --scene day --baked day.baked --time 36000 --out morning.png\n  \
    manylight bake day --lookup atlas --texels 16384 --out walk.baked\n  \
    manylight bake day --size 64x48 --report tables\n\
    A bake that was stopped goes on where it was: finished key frames are in the work folder.")]
pub struct BakeArgs {
    /// A scene: a path to a .ron, .obj, .gltf or .glb file, or a name such as `day`
    #[arg(value_name = "SCENE")]
    pub scene: String,
    /// Write baked light to this file
    #[arg(long, value_name = "FILE", required_unless_present = "report")]
    pub out: Option<PathBuf>,
    /// How light is found for a pixel
    #[arg(long, value_enum, default_value = "image")]
    pub lookup: LookupArg,
    /// With the look-up `image`: size of the key frames in pixels; pictures of other sizes and the same proportions are interpolated [default: 160x120]
    #[arg(long, value_name = "WxH", value_parser = values::size)]
    pub size: Option<(u32, u32)>,
    /// With the look-up `cube`: texels along a side of each face [default: 64]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..=2048))]
    pub side: Option<u32>,
    /// With the look-up `atlas`: the most texels of a key frame, over both sides of all surfaces [default: 32768]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(64..=16_777_216))]
    pub texels: Option<u32>,
    /// Paths a texel of each key frame; time is linear in it
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub paths: u32,
    /// Time between key frames, or with --threshold the shortest
    #[arg(long, value_name = "TIME", default_value = "5min", value_parser = values::duration)]
    pub interval: f64,
    /// Choose key frames by bisection: intervals are halved while they make a larger mean FLIP than this
    #[arg(long, value_name = "FLIP", value_parser = values::error)]
    pub threshold: Option<f64>,
    /// With --threshold: what is compared
    #[arg(long, value_enum, default_value = "middle", requires = "threshold")]
    pub criterion: CriterionArg,
    /// With --threshold: longer intervals are halved whatever is in their middle
    #[arg(long, value_name = "TIME", default_value = "3h", value_parser = values::duration, requires = "threshold")]
    pub longest: f64,
    /// Time after which the light repeats
    #[arg(long, value_name = "TIME", default_value = "24h", value_parser = values::duration)]
    pub period: f64,
    /// Keep so many principal components
    #[arg(long, value_name = "K", conflicts_with = "variance", value_parser = clap::value_parser!(u16).range(1..=254))]
    pub components: Option<u16>,
    /// Keep so many components that they hold this share of the variance [default: 0.986, the paper's ten components]
    #[arg(long, value_name = "SHARE", value_parser = values::share_of_one)]
    pub variance: Option<f64>,
    /// Find the components of the key frames themselves instead of their differences from the mean
    #[arg(long)]
    pub keep_mean: bool,
    /// Folder of finished key frames [default: a folder in the user's cache]
    #[arg(long, value_name = "DIR")]
    pub work: Option<PathBuf>,
    /// Write tables of errors by number of components and by key frames into this folder
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Use the adapter whose name contains this (see `manylight adapters`)
    #[arg(long, value_name = "NAME")]
    pub adapter: Option<String>,
}
