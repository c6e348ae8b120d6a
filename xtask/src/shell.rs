//! Running other programs in the root of the workspace, and the one error type.

use std::{
    ffi::OsStr,
    io::{BufRead, BufReader, IsTerminal, Read, Write},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use crate::json::Value;

/// Why the program ends early, and with which exit code.
#[derive(Debug)]
pub struct Stop {
    /// Exit code.
    pub code: u8,
    /// What the user reads.
    pub message: String,
}

impl Stop {
    /// A check failed (exit code 1).
    pub fn failed(message: impl Into<String>) -> Self {
        Self { code: 1, message: message.into() }
    }

    /// The command line is wrong (exit code 2).
    pub fn usage(message: impl Into<String>) -> Self {
        Self { code: 2, message: format!("{}\n\n{}", message.into(), crate::USAGE) }
    }

    /// There is no usable Vulkan driver (exit code 3).
    pub fn no_driver(message: impl Into<String>) -> Self {
        Self { code: 3, message: message.into() }
    }
}

/// What a program wrote and how it ended.
pub struct Finished {
    /// Whether it ended with exit code 0.
    pub success: bool,
    /// Exit code; `None` when a signal ended it.
    pub code: Option<i32>,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

/// Runs programs in the root of the workspace.
pub struct Shell {
    /// The folder of the workspace's `Cargo.toml`.
    pub root: PathBuf,
}

impl Shell {
    /// A shell in the workspace that this program belongs to.
    pub fn new() -> Self {
        let manifest = std::env::var_os("CARGO_MANIFEST_DIR").map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
        Self { root: manifest.parent().map_or_else(|| manifest.clone(), Path::to_path_buf) }
    }

    fn command<S: AsRef<OsStr>>(&self, words: &[S]) -> Command {
        let (program, arguments) = words.split_first().expect("callers name a program");
        let program = if program.as_ref() == "cargo" { cargo() } else { program.as_ref().to_owned() };
        let mut command = Command::new(program);
        command.args(arguments).current_dir(&self.root);
        command
    }

    /// Prints the command and runs it with this terminal; the exit code, or `None` when it could not start or was killed.
    pub fn show<S: AsRef<OsStr>>(&self, words: &[S]) -> Option<i32> {
        self.show_with(&[], words)
    }

    /// The same with variables of the environment.
    pub fn show_with<S: AsRef<OsStr>>(&self, variables: &[(&str, &str)], words: &[S]) -> Option<i32> {
        let assignments = variables.iter().map(|(name, value)| format!("{name}={value}"));
        print_command(&assignments.chain(words.iter().map(|w| w.as_ref().to_string_lossy().into_owned())).collect::<Vec<_>>());
        match self.command(words).envs(variables.iter().copied()).status() {
            Ok(status) => status.code(),
            Err(error) => {
                eprintln!("{}: {error}", words[0].as_ref().to_string_lossy());
                None
            }
        }
    }

    /// Runs the command in silence; `None` when it could not start.
    pub fn quiet<S: AsRef<OsStr>>(&self, words: &[S]) -> Option<Finished> {
        let output = self.command(words).stdin(Stdio::null()).output().ok()?;
        Some(Finished {
            success: output.status.success(),
            code: output.status.code(),
            stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
            stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        })
    }

    /// Prints the command, runs it, passes its output on line by line and keeps it; `None` when it could not start.
    pub fn tee<S: AsRef<OsStr>>(&self, words: &[S]) -> Option<Finished> {
        print_command(words);
        let mut command = self.command(words);
        if std::io::stderr().is_terminal() && std::env::var_os("CARGO_TERM_COLOR").is_none() {
            command.env("CARGO_TERM_COLOR", "always");
        }
        let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().ok()?;
        let (out, err) = (child.stdout.take()?, child.stderr.take()?);
        let reader = std::thread::spawn(move || pass_on(err, std::io::stderr()));
        let stdout = pass_on(out, std::io::stdout());
        let stderr = reader.join().unwrap_or_default();
        let status = child.wait().ok()?;
        Some(Finished { success: status.success(), code: status.code(), stdout, stderr })
    }

    /// Whether a program of that name answers to `--version`.
    pub fn has(&self, words: &[&str]) -> bool {
        let words: Vec<&str> = words.iter().copied().chain(["--version"]).collect();
        self.quiet(&words).is_some_and(|f| f.success)
    }

    /// The program `manylight` of a profile (`debug` or `release`), as cargo places it.
    pub fn manylight(&self, profile: &str) -> Result<String, Stop> {
        let metadata = self
            .quiet(&["cargo", "metadata", "--no-deps", "--format-version", "1"])
            .filter(|f| f.success)
            .ok_or_else(|| Stop::failed("`cargo metadata` failed"))?;
        let metadata = Value::parse(&metadata.stdout);
        let target = metadata
            .as_ref()
            .and_then(|v| v.find_text("target_directory"))
            .ok_or_else(|| Stop::failed("`cargo metadata` names no target directory"))?;
        let name = format!("manylight{}", std::env::consts::EXE_SUFFIX);
        Ok(Path::new(target).join(profile).join(name).to_string_lossy().into_owned())
    }
}

/// The cargo that started this program, so that `cargo +toolchain xtask` stays on its toolchain.
fn cargo() -> std::ffi::OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

fn print_command<S: AsRef<OsStr>>(words: &[S]) {
    let words: Vec<_> = words.iter().map(|w| w.as_ref().to_string_lossy()).collect();
    println!("$ {}", words.join(" "));
}

/// Copies lines to `to` as they come and returns all of them.
fn pass_on(from: impl Read, mut to: impl Write) -> String {
    let mut all = String::new();
    let mut reader = BufReader::new(from);
    let mut line = Vec::new();
    while reader.read_until(b'\n', &mut line).is_ok_and(|n| n > 0) {
        // The user's terminal may be gone; the checks go on all the same.
        let _ = to.write_all(&line).and_then(|()| to.flush());
        all.push_str(&String::from_utf8_lossy(&line));
        line.clear();
    }
    all
}

/// Text without terminal colours.
pub fn plain(text: &str) -> String {
    let mut result = String::with_capacity(text.len());
    let mut letters = text.chars();
    while let Some(letter) = letters.next() {
        if letter == '\u{1b}' {
            letters.by_ref().find(|l| l.is_ascii_alphabetic());
        } else {
            result.push(letter);
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_removed() {
        assert_eq!(plain("\u{1b}[32;1m     Summary\u{1b}[0m [ 1.0s]"), "     Summary [ 1.0s]");
    }

    #[test]
    fn output_is_passed_on_and_kept() {
        let mut copy = Vec::new();
        let all = pass_on(&b"one\ntwo\nthree"[..], &mut copy);
        assert_eq!(all, "one\ntwo\nthree");
        assert_eq!(copy, all.as_bytes());
    }
}
