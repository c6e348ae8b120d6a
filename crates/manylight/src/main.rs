//! The command line `manylight`.
#![allow(dead_code)]

mod cli;
mod commands;
mod progress;
fn main() {}
