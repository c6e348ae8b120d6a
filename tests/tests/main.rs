//! Tests that cross the crates: the command line, images against references, energy, determinism, reload.
//! One binary, so that the workspace links once.

mod cli;
mod clustering;
mod determinism;
mod lights;
mod moving_light;
mod path_tracer;
mod reference;
mod renders;
mod support;
mod twin;
mod walkthrough;
