//! One module a subcommand, and what they share.

pub mod adapters;
pub mod bake;
mod budget;
pub mod check;
pub mod compare;
pub mod explain;
pub mod graph;
pub mod nodes;
pub mod profile;
pub mod render;
pub mod sweep;
pub mod tune;
pub mod watch;

mod costs;
mod lab;
mod outputs;
mod session;
pub mod states;
mod stats;
mod table;

use std::{
    io::{self, Write},
    path::Path,
};

use manylight::{
    fault::Fault,
    files::{FileError, check_writable},
    gpu::{Gpu, GpuError, GpuOptions},
    graph::diagnostics::Diagnostics,
};

use crate::cli::{Cli, Command};

/// Does what the command line asks for.
pub fn run(cli: &Cli) -> Result<(), Fault> {
    match &cli.command {
        Command::Render(args) => render::run(cli, args),
        Command::Check(args) => check::run(cli, args),
        Command::Nodes(args) => nodes::run(cli, args),
        Command::Graph(args) => graph::run(cli, args),
        Command::Explain(args) => explain::run(cli, args),
        Command::Profile(args) => profile::run(cli, args),
        Command::Watch(args) => watch::run(cli, args),
        Command::Compare(args) => compare::run(args),
        Command::Sweep(args) => sweep::run(cli, args),
        Command::Tune(args) => tune::run(cli, args),
        Command::Bake(args) => bake::run(cli, args),
        Command::Adapters(args) => adapters::run(args),
    }
}

/// Prints to the standard output; a reader that has gone away (`| head`) is no fault.
fn print(text: &str) -> Result<(), Fault> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Fault::Input(format!("cannot write to the standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Prints to the standard error.
fn note(text: &str) {
    // There is nowhere to report a failure to.
    let _ = writeln!(io::stderr().lock(), "{}", text.trim_end());
}

/// Prints warnings to the standard error.
fn warn(warnings: &Diagnostics) {
    if !warnings.is_empty() {
        note(&warnings.render());
    }
}

/// Opens the adapter of that name, or the best.
fn open_gpu(adapter: Option<&String>) -> Result<Gpu, Fault> {
    Gpu::new(&GpuOptions { adapter: adapter.cloned() }).map_err(|error| match &error {
        GpuError::NoSuchAdapter { found, .. } if !found.is_empty() => Fault::Input(error.to_string()),
        GpuError::NoSuchAdapter { .. } => Fault::NoGpu(GpuError::NoAdapter.to_string()),
        _ => Fault::NoGpu(error.to_string()),
    })
}

/// Checks that a file can be written, before any work.
fn writable(path: &Path) -> Result<(), Fault> {
    check_writable(path).map_err(of_file)
}

/// A wrong extension is a fault of usage, the rest of the input.
fn of_file(error: FileError) -> Fault {
    match error {
        FileError::Extension { .. } => Fault::Usage(error.to_string()),
        _ => Fault::Input(error.to_string()),
    }
}

/// The adapter in words, with its kind.
fn adapter_line(gpu: &Gpu) -> String {
    let info = gpu.adapter_info();
    let remark = if gpu.kind() == manylight::gpu::GpuKind::Software { ": the times are those of a CPU" } else { "" };
    format!("{} · {:?} · {}{remark}", info.name, info.backend, gpu.kind())
}
