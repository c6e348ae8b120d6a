//! What the benches share.

use std::{
    fs,
    path::{Path, PathBuf},
    time::Duration,
};

pub type Outcome<T> = Result<T, Box<dyn std::error::Error>>;

/// The repository, and a copy of its shaders and pipelines to edit.
pub fn library_copy() -> Outcome<(PathBuf, tempfile::TempDir)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize()?;
    let copy = tempfile::tempdir()?;
    for part in ["shaders", "pipelines"] {
        copy_folder(&root.join(part), &copy.path().join(part))?;
    }
    Ok((root, copy))
}

/// Prints median, 95th percentile and the longest time.
pub fn report(what: &str, times: &mut [Duration]) {
    times.sort();
    if times.is_empty() {
        return println!("{what}: nothing to measure");
    }
    let at = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize].as_secs_f64() * 1e3;
    println!("{what}: median {:.2} ms, p95 {:.2} ms, longest {:.2} ms, of {}", at(0.5), at(0.95), at(1.0), times.len());
}

fn copy_folder(from: &Path, to: &Path) -> Outcome<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy_folder(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}
