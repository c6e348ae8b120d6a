//! Where scenes, meshes and textures are read from, and what was read; files that are written whole.

mod whole;

use std::{
    fs, io,
    path::{Component, Path, PathBuf},
};

pub use whole::{NotWritten, Output, write_whole};

/// A source of files by path. Any `Fn(&Path) -> io::Result<Vec<u8>>` is one.
pub trait FileReader {
    /// The whole file.
    ///
    /// # Errors
    /// What the operating system says, or `NotFound`.
    fn read(&self, path: &Path) -> io::Result<Vec<u8>>;
}

impl<F: Fn(&Path) -> io::Result<Vec<u8>>> FileReader for F {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        self(path)
    }
}

/// Files on disk.
#[derive(Debug, Clone, Copy, Default)]
pub struct Disk;

impl FileReader for Disk {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        fs::read(path)
    }
}

/// Files inside the program, by paths such as `assets/cornell.ron`. A file on disk at the same path wins.
#[derive(Debug, Clone, Default)]
pub struct Embedded(pub Vec<(String, &'static [u8])>);

impl FileReader for Embedded {
    fn read(&self, path: &Path) -> io::Result<Vec<u8>> {
        match fs::read(path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let wanted = plain(path);
                let inside = self.0.iter().find(|(name, _)| plain(Path::new(name)) == wanted);
                inside.map(|(_, bytes)| bytes.to_vec()).ok_or(error)
            }
            result => result,
        }
    }
}

/// The path without `.` and with `..` taken back, so that equal places in the program have equal names. On disk this would be wrong: `..`
/// after a link leads elsewhere.
fn plain(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for component in path.components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            other => out.push(other),
        }
    }
    out
}

/// The path of a file named in another one: relative to that file's folder. Accepts backslashes.
pub(crate) fn beside(file: &Path, name: &str) -> PathBuf {
    without_dots(&file.parent().unwrap_or(Path::new("")).join(name.replace('\\', "/")))
}

/// The path without `.`.
pub(crate) fn without_dots(path: &Path) -> PathBuf {
    path.components().filter(|component| *component != Component::CurDir).collect()
}

/// Where FNV-1a of 64 bits starts.
pub(crate) const FNV_START: u64 = 0xcbf2_9ce4_8422_2325;

/// FNV-1a of 64 bits, gone on with.
pub(crate) fn fnv(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
}

/// Reads files, and remembers which and a hash of their contents.
pub(crate) struct Files<'a> {
    reader: &'a dyn FileReader,
    /// Every file read or looked for, once, in the order of the first look.
    pub(crate) seen: Vec<PathBuf>,
    /// FNV-1a of the names (without folders) and contents.
    pub(crate) hash: u64,
}

impl<'a> Files<'a> {
    pub(crate) fn new(reader: &'a dyn FileReader) -> Self {
        Self { reader, seen: Vec::new(), hash: FNV_START }
    }

    /// Reads a file.
    pub(crate) fn read(&mut self, path: &Path) -> io::Result<Vec<u8>> {
        if !self.seen.iter().any(|seen| seen == path) {
            self.seen.push(path.to_owned());
        }
        let bytes = self.reader.read(path)?;
        self.add_to_hash(path.file_name().unwrap_or_default().to_string_lossy().as_bytes());
        self.add_to_hash(&bytes);
        Ok(bytes)
    }

    fn add_to_hash(&mut self, bytes: &[u8]) {
        self.hash = fnv(fnv(self.hash, bytes), &bytes.len().to_le_bytes());
    }
}

/// What to say about a file that could not be read.
pub(crate) fn cannot_read(path: &Path, error: &io::Error) -> String {
    let reason = match error.kind() {
        io::ErrorKind::NotFound => "no such file".to_owned(),
        io::ErrorKind::PermissionDenied => "permission denied".to_owned(),
        io::ErrorKind::IsADirectory => "it is a folder".to_owned(),
        _ => error.to_string(),
    };
    format!("cannot read `{}`: {reason}", path.display())
}
