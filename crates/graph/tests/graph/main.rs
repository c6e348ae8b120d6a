//! Tests of the crate from outside.
#![allow(clippy::unwrap_used, reason = "tests")]

mod conditions;
mod drawing;
mod good;
mod indirect;
mod invariants;
mod kit;
mod merging;
mod nodes;
mod pipelines;
mod plans;
mod quality;
mod refusals;
mod reload;
mod text;
