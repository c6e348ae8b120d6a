//! Makes sure that there are a C++ compiler and a usable Vulkan driver, installing what is missing.

use crate::{
    packages::{Manager, Need, Right},
    shell::{Shell, Stop},
    vulkan::{Found, Verdict},
};

/// Finds a C++ compiler and a Vulkan driver or installs them; says what it found and what it runs.
pub fn setup(shell: &Shell, software_only: bool) -> Result<(), Stop> {
    if !cfg!(target_os = "linux") {
        println!("C++: that of the system's build tools, which Rust needs too");
        println!("Vulkan: not needed on {}, the system's own graphics interface is used", std::env::consts::OS);
        return Ok(());
    }
    compiler(shell)?;
    driver(shell, software_only)
}

/// Finds the C++ compiler that the build of FLIP will use or installs one.
fn compiler(shell: &Shell) -> Result<(), Stop> {
    // What the crate `cc` looks at, too.
    let program = std::env::var("CXX").ok().filter(|c| !c.trim().is_empty()).unwrap_or_else(|| "c++".to_owned());
    // The variable may hold arguments, and a launcher such as ccache before the compiler.
    let words: Vec<&str> = program.split_whitespace().collect();
    if shell.has(&words) {
        println!("C++: {program}");
        return Ok(());
    }
    if program != "c++" {
        return Err(Stop::failed(format!("C++: CXX is `{program}`, which does not run. Unset it, or set it to a C++ compiler.")));
    }
    let reason = "there is no C++ compiler (`c++`), which the metric FLIP needs";
    install(shell, Need::Compiler, &format!("C++: {reason}"), "a C++ compiler").map_err(Stop::failed)?;
    if shell.has(&words) {
        println!("C++: {program}");
        return Ok(());
    }
    Err(Stop::failed("C++: the packages are installed, but `c++` does not run. Set CXX to the compiler's name."))
}

fn driver(shell: &Shell, software_only: bool) -> Result<(), Stop> {
    let reason = match Found::on_this_machine(shell).verdict(software_only) {
        Verdict::Usable(reason) => {
            println!("Vulkan: {reason}");
            return Ok(());
        }
        Verdict::Missing(reason) => reason,
    };
    install(shell, Need::Vulkan, &format!("Vulkan: {reason}"), "the Vulkan loader and a driver (Mesa's lavapipe draws on the CPU)")
        .map_err(Stop::no_driver)?;
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

/// Installs what is missing; says why it could not, and what to do instead. `what` is it in words.
fn install(shell: &Shell, need: Need, reason: &str, what: &str) -> Result<(), String> {
    let manager = Manager::choose(|program| shell.has(&[program]))
        .ok_or_else(|| format!("{reason}.\nNo known package manager is here; install {what}, then try again."))?;
    let right = right(shell);
    if right == Right::None {
        let line = manager.line(need, right);
        return Err(format!("{reason}.\nThis user may not install packages. Run this, then try again:\n\n    {line}\n"));
    }
    println!("{reason}; installing {}", manager.packages(need).join(", "));
    for command in manager.commands_with(need, right) {
        if shell.show(&command) != Some(0) {
            let line = manager.line(need, right);
            return Err(format!("`{}` failed. Once it works, this installs what is missing:\n\n    {line}\n", command.join(" ")));
        }
    }
    Ok(())
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
