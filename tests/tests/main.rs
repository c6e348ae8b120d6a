//! Tests that cross the crates: the command line, images against references, energy, determinism, reload.
//! One binary, so that the workspace links once.

mod blocks;
mod cli;
mod clustering;
mod culling;
mod deforming;
mod determinism;
mod energy;
mod explain;
mod faults;
mod functions;
mod fuzz;
mod gather;
mod hard_scenes;
mod incremental;
mod light_kinds;
mod lights;
mod matrix;
mod measured;
mod metrics;
mod moving_light;
mod path_tracer;
mod precomputed;
mod records;
mod reference;
mod renders;
mod samples;
mod second_order;
mod shadow_maps;
mod skipping;
mod support;
mod sweeps;
mod temporal;
mod twin;
mod visibility;
mod walkthrough;
