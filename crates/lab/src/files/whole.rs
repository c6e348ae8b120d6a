//! Files that appear whole or not at all, with faults that say what to do.

use std::{
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

use manylight_scene::files::{self, NotWritten};

pub use manylight_scene::files::Output;

use super::FileError;

/// Checks, before any work is done, that a file of this name can be written: its folder exists and it is no folder itself.
pub fn check_writable(path: &Path) -> Result<(), FileError> {
    if path.as_os_str().is_empty() || path.file_name().is_none() {
        return Err(FileError::NoName { path: path.to_owned() });
    }
    if path.is_dir() {
        return Err(FileError::IsFolder { path: path.to_owned() });
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(FileError::NoFolder { path: path.to_owned(), folder });
    }
    Ok(())
}

/// Writes a file through `fill` under a temporary name in the same folder and gives it its name when it is complete.
///
/// When `fill` or the disk fails, nothing is left behind and an older file of that name stays as it was.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut BufWriter<Output>) -> Result<(), FileError>) -> Result<(), FileError> {
    check_writable(path)?;
    files::write_whole(path, fill).map_err(|failed| match failed {
        NotWritten::System(error) => FileError::write(path, &error),
        NotWritten::Fill(error) => error,
    })
}

/// Writes text as a whole file.
pub fn write_text(path: &Path, text: &str) -> Result<(), FileError> {
    write_whole(path, |w| w.write_all(text.as_bytes()).map_err(|e| FileError::write(path, &e)))
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, io};

    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(folder).expect("readable").map(|e| e.expect("entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("x.txt");
        write_text(&path, "old").expect("writable");
        let failed = write_whole(&path, |w| {
            w.write_all(b"half").map_err(|e| FileError::write(&path, &e))?;
            Err(FileError::write(&path, &io::Error::other("disk full")))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read_to_string(&path).expect("readable"), "old");
        assert_eq!(names(folder.path()), ["x.txt"]);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("nowhere/x.txt");
        let error = check_writable(&path).expect_err("no such folder").to_string();
        assert!(error.contains("nowhere"), "{error}");
        assert!(write_text(&path, "x").is_err());
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_folder_is_no_file() {
        let folder = tempfile::tempdir().expect("temporary folder");
        assert!(matches!(check_writable(folder.path()), Err(FileError::IsFolder { .. })));
        assert!(matches!(check_writable(Path::new("")), Err(FileError::NoName { .. })));
        assert!(check_writable(Path::new("picture.png")).is_ok());
    }
}
