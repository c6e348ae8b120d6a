//! Files that appear whole or not at all.

use std::{
    fs::{self, File, TryLockError},
    io::{self, BufWriter, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
    sync::atomic::{AtomicU64, Ordering},
};

/// End of the names of files that are not complete.
const PART: &str = ".part";

/// Why there is no new file: the older one of that name, if there was one, stays as it was.
#[derive(Debug)]
pub enum NotWritten<E> {
    /// The system refused.
    System(io::Error),
    /// What was to fill it failed.
    Fill(E),
}

impl<E> From<io::Error> for NotWritten<E> {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

/// Writes a file through `fill` under a temporary name in the same folder, which must exist, and gives it its name when it is complete.
///
/// When `fill` or the disk fails, nothing is left behind and an older file of that name stays as it was.
///
/// # Errors
/// What the system or `fill` says; where a failure of `fill` follows from one of the system, the latter.
pub fn write_whole<E>(path: &Path, fill: impl FnOnce(&mut BufWriter<Output>) -> Result<(), E>) -> Result<(), NotWritten<E>> {
    let (temporary, file) = create_beside(path)?;
    let guard = RemoveOnDrop(Some(&temporary));
    let mut writer = BufWriter::new(Output { file, fault: None });
    // On the disk before it has its name: a power cut must not leave an empty file where an older one was.
    let written =
        fill(&mut writer).map_err(NotWritten::Fill).and_then(|()| Ok(writer.flush().and_then(|()| writer.get_ref().file.sync_data())?));
    // What is left in memory need not be tried again.
    let (output, _) = writer.into_parts();
    if let Some(fault) = output.fault {
        return Err(fault.into());
    }
    written?;
    drop(output.file);
    fs::rename(&temporary, path)?;
    guard.keep();
    Ok(())
}

/// The file that [`write_whole`] fills. It remembers what the system said, which encoders of pictures put into words of their own.
#[derive(Debug)]
pub struct Output {
    file: File,
    fault: Option<io::Error>,
}

impl Output {
    fn noted<T>(&mut self, result: io::Result<T>) -> io::Result<T> {
        result.map_err(|error| {
            let kind = error.kind();
            // An interruption is tried again.
            if kind != io::ErrorKind::Interrupted {
                self.fault.get_or_insert(error);
            }
            kind.into()
        })
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.file.write(bytes);
        self.noted(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.file.flush();
        self.noted(flushed)
    }
}

impl Seek for Output {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let place = self.file.seek(to);
        self.noted(place)
    }
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// A new file beside `path`, locked while it is written. What processes that were killed left of earlier ones is removed.
fn create_beside(path: &Path) -> io::Result<(PathBuf, File)> {
    static COUNTER: AtomicU64 = AtomicU64::new(0);
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let folder = folder_of(path);
    remove_left(&folder, &name);
    loop {
        let n = COUNTER.fetch_add(1, Ordering::Relaxed);
        let temporary = folder.join(format!(".{name}.{}-{n}{PART}", std::process::id()));
        match File::options().write(true).read(true).create_new(true).open(&temporary) {
            Ok(file) => {
                let locked = !matches!(file.try_lock(), Err(TryLockError::WouldBlock));
                // Another process may have taken it for one that was left, in the moment before it was locked.
                if locked && temporary.exists() {
                    return Ok((temporary, file));
                }
            }
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => {}
            Err(e) => return Err(e),
        }
    }
}

/// Removes unfinished files of that name which nobody writes any more: the system frees the lock of a process that ends, however it does.
fn remove_left(folder: &Path, name: &str) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let (start, own) = (format!(".{name}."), format!(".{name}.{}-", std::process::id()));
    for entry in entries.flatten() {
        let file_name = entry.file_name();
        let file_name = file_name.to_string_lossy();
        if !file_name.starts_with(&start) || !file_name.ends_with(PART) || file_name.starts_with(&own) {
            continue;
        }
        if File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok()) {
            // When it cannot be removed it only takes room.
            let _ = fs::remove_file(entry.path());
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

    fn write_text(path: &Path, text: &str) -> Result<(), NotWritten<io::Error>> {
        write_whole(path, |w| w.write_all(text.as_bytes()))
    }

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
            w.write_all(b"half")?;
            Err(io::Error::other("disk full"))
        });
        assert!(matches!(failed, Err(NotWritten::Fill(_))), "{failed:?}");
        assert_eq!(fs::read_to_string(&path).expect("readable"), "old");
        assert_eq!(names(folder.path()), ["x.txt"]);
    }

    #[test]
    fn what_a_killed_process_left_goes_and_what_another_one_writes_stays() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let at = |name: &str| folder.path().join(name);
        for name in [".x.txt.999999999-0.part", ".x.txt.999999998-0.part", ".other.txt.999999999-0.part"] {
            fs::write(at(name), "half").expect("writable");
        }
        let written = File::open(at(".x.txt.999999998-0.part")).expect("readable");
        written.try_lock().expect("free");
        write_text(&at("x.txt"), "whole").expect("writable");
        assert_eq!(names(folder.path()), [".other.txt.999999999-0.part", ".x.txt.999999998-0.part", "x.txt"]);
    }
}
