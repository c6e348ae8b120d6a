//! manylight-graph
mod assign;
mod bind;
pub mod check;
mod compose;
pub mod condition;
mod declaration;
pub mod diagnostics;
mod document;
pub mod expr;
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
mod reader;
mod reflect;
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
        reader::{Fields, Reader, Shape, Spanned, head},
        render::suggest,
        tree::{Kind, Name, Tree},
    };
}
