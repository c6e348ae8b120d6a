//! Tests that cross the crates: the command line, images against references, energy, determinism, reload.
//! One binary, so that the workspace links once.

mod cli;
mod support;
