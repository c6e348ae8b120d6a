//! Files that appear whole or not at all.

use std::{
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

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
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), FileError>) -> Result<(), FileError> {
    check_writable(path)?;
    let (temporary, file) = create_beside(path)?;
    let guard = RemoveOnDrop(Some(&temporary));
    let mut writer = BufWriter::new(file);
    fill(&mut writer)?;
    // On the disk before it has its name: a power cut must not leave an empty file where an older one was.
    writer.flush().and_then(|()| writer.get_ref().sync_data()).map_err(|e| FileError::write(path, &e))?;
    drop(writer);
    fs::rename(&temporary, path).map_err(|e| FileError::write(path, &e))?;
    guard.keep();
    Ok(())
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

fn create_beside(path: &Path) -> Result<(PathBuf, File), FileError> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    loop {
        let n = COUNTER.fetch_add(1, Ordering::Relaxed);
        let temporary = folder_of(path).join(format!(".{name}.{}-{n}.part", std::process::id()));
        match File::options().write(true).read(true).create_new(true).open(&temporary) {
            Ok(file) => return Ok((temporary, file)),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            Err(e) => return Err(FileError::write(path, &e)),
        }
    }
}

struct RemoveOnDrop<'a>(Option<&'a Path>);

impl RemoveOnDrop<'_> {
    fn keep(mut self) {
        self.0 = None;
    }
}

impl Drop for RemoveOnDrop<'_> {
    fn drop(&mut self) {
        if let Some(path) = self.0 {
            // Nothing sensible can be done when this fails too.
            let _ = fs::remove_file(path);
        }
    }
}

#[cfg(test)]
mod tests {
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
