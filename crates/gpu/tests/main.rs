//! The executor on a real device (software is enough): small libraries written inline, planned, built, run and read back.
#![allow(missing_docs, clippy::unwrap_used)]

mod draw;
mod externals;
mod failures;
mod formats;
mod history;
mod host;
mod indirect;
mod mips;
mod numbers;
mod params;
mod poison;
mod support;
mod timing;
mod watch;
