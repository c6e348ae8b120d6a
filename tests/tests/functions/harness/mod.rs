//! Calls functions of `shaders/common` on the GPU over arrays of arguments and compares what they return with a twin in 64 bits.
//!
//! The shader around a function is made here and goes through everything that a node's shader goes through: composition, planning, execution.

mod case;
mod comparison;
mod world;

pub use case::{Case, check};
pub use comparison::{Bound, EXACT, Outcome, Want, absolute, judge, relative, ulps, values, values_of};
pub use world::{Ran, Resource, World, modules};
