//! Render graphs as data: RON pipelines and WGSL nodes become a plan, with every fault told at its place.
//!
//! A [`Library`](library::Library) holds the files, a [`Registry`](registry::Registry) the nodes that pipelines can name, a
//! [`Pipeline`](pipeline::Pipeline) what a document says, and a [`Plan`](plan::Plan) what will run. Nothing here needs a GPU.
//!
//! ```
//! use manylight_graph::{library::Library, pipeline::Pipeline, plan::PlanInput, planner::plan, registry::Registry};
//!
//! let files = [
//!     ("shaders/post/grey.ron", r#"Node(doc: "Grey.", outputs: {"grey": Texture(format: Rgba16Float, doc: "the same everywhere")},
//!         steps: [(entry: "main", over: Texels("grey"))])"#),
//!     ("shaders/post/grey.wgsl", "@group(0) @binding(0) var grey: texture_storage_2d<rgba16float, write>;
//!         @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) { textureStore(grey, id.xy, vec4f(0.5)); }"),
//!     ("pipelines/grey.ron", r#"Pipeline(doc: "Grey.", resources: {"grey": Texture(format: Rgba16Float, size: Output)},
//!         nodes: [(id: "fill", node: "post/grey")], presents: "grey")"#),
//! ];
//! let library = Library::new(None, files.map(|(name, text)| (name.to_owned(), text)).to_vec());
//! let (registry, faults) = Registry::load(&library, &[], Vec::new());
//! assert!(faults.is_empty(), "{faults}");
//! let pipeline = Pipeline::load(&library, "grey")?;
//! let plan = plan(&pipeline, &registry, &PlanInput { output: (640, 360), ..PlanInput::default() })?;
//! assert_eq!(plan.nodes[0].id, "fill");
//! # Ok::<(), manylight_graph::diagnostics::Diagnostics>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`diagnostics`] | faults with places and remedies, as text and JSON |
//! | [`library`] | files on disk and embedded |
//! | [`registry`] | nodes, ports, steps; loading and reloading |
//! | [`shader`] | composed WGSL and what reflection says of it |
//! | [`value`], [`params`], [`expr`], [`condition`], [`features`] | formats and descriptions, parameters, sizes, conditions |
//! | [`pipeline`] | documents with `extends` and `include` carried out |
//! | [`quality`] | what a pipeline gives up, rung after rung, to hold a time |
//! | [`check`] | all that can be known without a scene |
//! | [`planner`], [`plan`] | from a pipeline to what will run |
//! | [`mod@draw`] | plans as DOT, Mermaid, JSON and SVG |
//! | [`mod@reference`] | the nodes' documentation |
//! | [`ron`] | reading RON with places, for other documents |
//!
//! The way of a text: `tree` (RON with places) → `reader` → `declaration` or `document` → `merge` → `resolve` (names) → `planner` (`assign`,
//! `facts`, `refuse`, `order`, `sizes`, `steps`, `slots`). The way of a shader: `wgsl` (a look at the text) → `compose` → `reflect` → `bind` (against the declaration).

mod assign;
mod bind;
pub mod check;
mod compose;
pub mod condition;
mod declaration;
pub mod diagnostics;
mod document;
pub mod draw;
pub mod expr;
mod facts;
pub mod features;
mod fit;
mod format;
pub mod library;
mod load;
mod merge;
mod order;
pub mod params;
pub mod pipeline;
pub mod plan;
pub mod planner;
pub mod quality;
mod reader;
pub mod reference;
mod reflect;
mod refuse;
pub mod registry;
mod render;
mod resolve;
pub mod shader;
mod sizes;
mod slots;
mod steps;
mod tree;
mod unused;
pub mod value;
mod wgsl;

pub use bind::SAMPLERS;
pub use reader::Spanned;
pub use render::nearest;

/// Reading RON with the place of every value: what documents of other crates (scenes) are read with, too.
pub mod ron {
    pub use crate::{
        params::read_literal,
        reader::{Fields, Reader, Shape, Spanned, head},
        render::suggest,
        tree::{Kind, Name, Tree},
    };
}
