//! Tests of scenes: files, import, motion, GPU data and points.

#![allow(clippy::unwrap_used)]

mod assets;
mod bvh;
mod deform;
mod gltf;
mod gpu_data;
mod import;
mod measure;
mod memory;
mod motion;
#[path = "../../../tests/tests/fuzz/mutate.rs"]
#[allow(dead_code, reason = "shared with the tests that cross the crates")]
mod mutate;
mod points;
mod rays;
mod robustness;
mod scene_file;
mod sky;
mod state;
#[path = "../../../tests/tests/support.rs"]
#[allow(dead_code, reason = "shared with the tests that cross the crates")]
mod support;
mod textures;
