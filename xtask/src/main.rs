//! Chores of the workspace, started as `cargo xtask COMMAND`: set-up, demo, tests and documentation.
//!
//! It uses nothing but the standard library, so that it is built in a second and runs on a machine that has Rust and nothing else.
//!
//! - [`shell`]: running other programs
//! - [`setup`], [`vulkan`], [`packages`]: finding or installing a C++ compiler and a Vulkan driver
//! - [`demo`]: the first picture
//! - [`test`]: everything continuous integration checks; [`package`] is one of its steps
//! - [`docs`], [`links`]: the node reference and the book; [`numbers`]: how exact and stable the methods are, for the book
//! - [`json`]: what other programs and tests write

mod demo;
mod docs;
mod json;
mod links;
mod numbers;
mod package;
mod packages;
mod setup;
mod shell;
mod test;
mod vulkan;

use std::process::ExitCode;

use shell::{Shell, Stop};

const USAGE: &str = "\
Usage: cargo xtask COMMAND

Commands:
  demo [--size WxH] [--out FILE]   set up, build, render the Cornell box and print what each pass cost
                                   (default: --size 512x512 --out out/demo.png)
  test [--quick]                   set up, then run every check of continuous integration;
                                   --quick leaves out doc tests, documentation, demo, licences and packages
  docs [--check]                   write the node reference and the tables of the book, and build the book;
                                   --check changes nothing and fails when one of them is stale
  numbers                          run the tests that measure errors and stability, and keep what they
                                   record in docs/records/numbers for the book (some minutes)
  setup [--software]               make sure that there are a C++ compiler and a usable Vulkan driver;
                                   --software installs the software driver even beside a hardware one

Exit codes: 0 done, 1 a check failed, 2 usage, 3 no usable Vulkan driver (the command that installs one is printed).
";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(stop) => {
            eprintln!("{}", stop.message);
            ExitCode::from(stop.code)
        }
    }
}

fn run(arguments: &[String]) -> Result<(), Stop> {
    let (command, rest) = arguments.split_first().ok_or_else(|| Stop::usage("a command is missing"))?;
    let shell = Shell::new();
    if rest.iter().any(|a| a == "--help" || a == "-h") {
        print!("{USAGE}");
        return Ok(());
    }
    match command.as_str() {
        "demo" => demo::demo(&shell, &demo::Options::parse(rest)?),
        "test" => test::test(&shell, flag(rest, "--quick")?),
        "docs" => docs::docs(&shell, flag(rest, "--check")?),
        "numbers" => {
            if let Some(word) = rest.first() {
                return Err(Stop::usage(format!("unexpected argument `{word}`")));
            }
            numbers::numbers(&shell)
        }
        "setup" => setup::setup(&shell, flag(rest, "--software")?),
        "help" | "--help" | "-h" => {
            print!("{USAGE}");
            Ok(())
        }
        other => Err(Stop::usage(format!("there is no command `{other}`"))),
    }
}

/// Whether the only allowed flag is given.
fn flag(arguments: &[String], name: &str) -> Result<bool, Stop> {
    match arguments.iter().find(|a| *a != name) {
        Some(other) => Err(Stop::usage(format!("unexpected argument `{other}`"))),
        None => Ok(!arguments.is_empty()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flag_is_on_off_or_an_error() {
        let words = |list: &[&str]| list.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>();
        assert!(!flag(&[], "--quick").unwrap());
        assert!(flag(&words(&["--quick"]), "--quick").unwrap());
        assert_eq!(flag(&words(&["--quik"]), "--quick").unwrap_err().code, 2);
    }

    #[test]
    fn an_unknown_command_is_a_usage_error() {
        let stop = run(&["dmeo".to_owned()]).unwrap_err();
        assert_eq!(stop.code, 2);
        assert!(stop.message.contains("dmeo"));
    }
}
