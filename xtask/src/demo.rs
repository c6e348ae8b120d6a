//! The first picture: the Cornell box through the pipeline `acrsm`, and what each pass cost.

use crate::{
    setup,
    shell::{Shell, Stop},
};

const PIPELINE: &str = "pipelines/acrsm.ron";
const SCENE: &str = "assets/cornell.ron";
/// Enough for the clustering, which takes one k-means step a frame, to settle.
const FRAMES: &str = "24";
const PROFILED_FRAMES: &str = "16";

/// What to render.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// `WIDTHxHEIGHT`.
    pub size: String,
    /// Where the picture goes, relative to the root of the workspace.
    pub out: String,
}

impl Options {
    /// Reads `[--size WxH] [--out FILE]`; the size itself is judged by manylight.
    pub fn parse(arguments: &[String]) -> Result<Self, Stop> {
        let mut options = Self { size: "512x512".to_owned(), out: "out/demo.png".to_owned() };
        let mut rest = arguments.iter();
        while let Some(argument) = rest.next() {
            let (name, value) = match argument.split_once('=') {
                Some((name, value)) => (name, Some(value.to_owned())),
                None => (argument.as_str(), None),
            };
            let target = match name {
                "--size" => &mut options.size,
                "--out" => &mut options.out,
                _ => return Err(Stop::usage(format!("unexpected argument `{argument}`"))),
            };
            *target = value.or_else(|| rest.next().cloned()).ok_or_else(|| Stop::usage(format!("`{name}` needs a value")))?;
        }
        Ok(options)
    }
}

/// Sets up, builds, renders and profiles.
pub fn demo(shell: &Shell, options: &Options) -> Result<(), Stop> {
    setup::setup(shell, false)?;
    if shell.show(&["cargo", "build", "--release", "--package", "manylight"]) != Some(0) {
        return Err(Stop::failed("the build failed"));
    }
    render(shell, &shell.manylight("release")?, options)?;
    println!("\nThe picture is in {}. To see it follow your edits:\n", options.out);
    println!("    cargo run --release -p manylight -- watch {PIPELINE} --scene {SCENE} --out out/watch.png\n");
    Ok(())
}

/// Renders and profiles with a program that is built.
pub fn render(shell: &Shell, manylight: &str, options: &Options) -> Result<(), Stop> {
    let out = shell.root.join(&options.out);
    if let Some(folder) = out.parent() {
        std::fs::create_dir_all(folder).map_err(|e| Stop::failed(format!("cannot create {}: {e}", folder.display())))?;
    }
    let common = ["--scene", SCENE, "--size", options.size.as_str(), "--frames"];
    run(shell, &[&[manylight, "render", PIPELINE], common.as_slice(), &[FRAMES, "--out", options.out.as_str()]].concat())?;
    if std::fs::metadata(&out).map_or(0, |m| m.len()) == 0 {
        return Err(Stop::failed(format!("manylight said that all went well, but {} is not there", out.display())));
    }
    run(shell, &[&[manylight, "profile", PIPELINE], common.as_slice(), &[PROFILED_FRAMES]].concat())
}

fn run(shell: &Shell, words: &[&str]) -> Result<(), Stop> {
    match shell.show(words) {
        Some(0) => Ok(()),
        Some(3) => Err(Stop::no_driver(
            "The Vulkan driver that is installed found no adapter; `cargo xtask setup --software` installs the software driver.",
        )),
        Some(code @ 1..=255) => Err(Stop { code: u8::try_from(code).unwrap_or(1), message: format!("`manylight {}` failed", words[1]) }),
        _ => Err(Stop::failed(format!("`manylight {}` did not end by itself", words[1]))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(words: &[&str]) -> Result<Options, Stop> {
        Options::parse(&words.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn options_have_defaults_and_two_spellings() {
        assert_eq!(parse(&[]).unwrap(), Options { size: "512x512".into(), out: "out/demo.png".into() });
        assert_eq!(parse(&["--size", "64x32", "--out=a b.png"]).unwrap(), Options { size: "64x32".into(), out: "a b.png".into() });
    }

    #[test]
    fn wrong_options_are_usage_errors() {
        assert_eq!(parse(&["--size"]).unwrap_err().code, 2);
        assert_eq!(parse(&["--sise", "1x1"]).unwrap_err().code, 2);
    }
}
