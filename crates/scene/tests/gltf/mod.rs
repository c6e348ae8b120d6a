//! glTF files, written by the tests.

mod build;
mod faults;
mod materials;
mod meshes;
mod motion;
mod robustness;
mod views;
