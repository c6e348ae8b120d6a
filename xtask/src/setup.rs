//! Makes sure that there is a usable Vulkan driver, installing the software one where there is none.

use crate::{
    packages::{Manager, Right},
    shell::{Shell, Stop},
    vulkan::{Found, Verdict},
};

/// Finds a Vulkan driver or installs the software one; says what it found and what it runs.
pub fn setup(shell: &Shell, software_only: bool) -> Result<(), Stop> {
    if !cfg!(target_os = "linux") {
        println!("Vulkan: not needed on {}, the system's own graphics interface is used", std::env::consts::OS);
        return Ok(());
    }
    let reason = match Found::on_this_machine(shell).verdict(software_only) {
        Verdict::Usable(reason) => {
            println!("Vulkan: {reason}");
            return Ok(());
        }
        Verdict::Missing(reason) => reason,
    };
    let manager = Manager::choose(|program| shell.has(&[program])).ok_or_else(|| {
        Stop::no_driver(format!(
            "Vulkan: {reason}.\nNo known package manager is here; install the Vulkan loader and a driver (Mesa's lavapipe draws on the CPU), then try again."
        ))
    })?;
    let right = right(shell);
    if right == Right::None {
        return Err(Stop::no_driver(format!(
            "Vulkan: {reason}.\nThis user may not install packages. Run this, then try again:\n\n    {}\n",
            manager.line(right)
        )));
    }
    println!("Vulkan: {reason}; installing software Vulkan ({})", manager.packages().join(", "));
    for command in manager.commands_with(right) {
        if shell.show(&command) != Some(0) {
            return Err(Stop::no_driver(format!(
                "`{}` failed. Once it works, this installs the driver:\n\n    {}\n",
                command.join(" "),
                manager.line(right)
            )));
        }
    }
    match Found::on_this_machine(shell).verdict(software_only) {
        Verdict::Usable(reason) => {
            println!("Vulkan: {reason}");
            Ok(())
        }
        Verdict::Missing(reason) => {
            Err(Stop::no_driver(format!("Vulkan: the packages are installed, but {reason}. Is VK_DRIVER_FILES or VK_ICD_FILENAMES set?")))
        }
    }
}

fn right(shell: &Shell) -> Right {
    if shell.quiet(&["id", "-u"]).is_some_and(|f| f.stdout.trim() == "0") {
        Right::Root
    } else if shell.quiet(&["sudo", "-n", "true"]).is_some_and(|f| f.success) {
        Right::Sudo
    } else {
        Right::None
    }
}

/// Which program runs the tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Runner {
    /// cargo-nextest.
    Nextest,
    /// `cargo test`.
    Cargo,
}

/// nextest, installed if need be; `cargo test` when it cannot be installed.
pub fn test_runner(shell: &Shell) -> Runner {
    if shell.has(&["cargo", "nextest"]) {
        return Runner::Nextest;
    }
    println!("cargo-nextest is not installed; installing it, which takes some minutes once");
    if shell.show(&["cargo", "install", "cargo-nextest", "--locked"]) == Some(0) && shell.has(&["cargo", "nextest"]) {
        return Runner::Nextest;
    }
    println!("cargo-nextest could not be installed; the tests run with `cargo test` instead");
    Runner::Cargo
}

/// rustfmt and clippy, which a minimal toolchain lacks, through rustup where it is there.
pub fn components(shell: &Shell) {
    let missing: Vec<&str> =
        [("fmt", "rustfmt"), ("clippy", "clippy")].iter().filter(|(c, _)| !shell.has(&["cargo", c])).map(|(_, n)| *n).collect();
    if !missing.is_empty() && shell.has(&["rustup"]) {
        shell.show(&[&["rustup", "component", "add"], missing.as_slice()].concat());
    }
}
