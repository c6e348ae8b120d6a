//! Pictures on disk: EXR (linear, 32-bit float) and PNG (8 bits, display values), written whole or not at all.

mod exr_file;
mod picture;
mod png_file;
mod whole;

use std::{
    io,
    path::{Path, PathBuf},
};

use thiserror::Error;

pub use exr_file::{read_exr, write_exr};
pub use picture::{Picture, Tone};
pub use png_file::{read_png, write_png};
pub use whole::{Output, check_writable, write_text, write_whole};

/// Kinds of output files, by extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// `.exr`: linear 32-bit floats.
    Exr,
    /// `.png`: 8 bits a channel.
    Png,
    /// `.json`: buffers with field names.
    Json,
}

impl FileKind {
    /// The kind that the extension of a file name stands for.
    pub fn of(path: &Path) -> Result<Self, FileError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
        match extension.as_str() {
            "exr" => Ok(Self::Exr),
            "png" => Ok(Self::Png),
            "json" => Ok(Self::Json),
            _ => Err(FileError::Extension { path: path.to_owned(), extension }),
        }
    }
}

/// Why a file could not be read or written.
#[derive(Debug, Error)]
pub enum FileError {
    /// The extension names no format that manylight writes.
    #[error("`{}`: {} (write .exr for linear values, .png for a picture to look at, .json for buffers)", path.display(), if extension.is_empty() { "no extension that says what to write".to_owned() } else { format!("unknown kind of file `.{extension}`") })]
    Extension {
        /// The file.
        path: PathBuf,
        /// Its extension.
        extension: String,
    },
    /// The folder to write to does not exist.
    #[error("cannot write `{}`: the folder `{}` does not exist", path.display(), folder.display())]
    NoFolder {
        /// The file.
        path: PathBuf,
        /// The missing folder.
        folder: PathBuf,
    },
    /// The name is that of a folder.
    #[error("cannot write `{}`: it is a folder", path.display())]
    IsFolder {
        /// The folder.
        path: PathBuf,
    },
    /// The path ends in no file name.
    #[error("cannot write `{}`: it names no file", path.display())]
    NoName {
        /// The path.
        path: PathBuf,
    },
    /// The system refused to write.
    #[error("cannot write `{}`: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// The file cannot be read or is no picture.
    #[error("cannot read `{}`: {reason}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: String,
    },
}

impl FileError {
    /// A failed write, with what to do about it where that is known.
    pub fn write(path: &Path, reason: &io::Error) -> Self {
        let remedy = match reason.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "; make room on the disk, or write to another one",
            io::ErrorKind::FileTooLarge => "; the limit on the size of files (`ulimit -f`) or the file system does not allow more",
            io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => "; write to a folder in which you may",
            _ => "",
        };
        Self::Write { path: path.to_owned(), reason: format!("{reason}{remedy}") }
    }

    /// A failed read.
    pub fn read(path: &Path, reason: impl ToString) -> Self {
        Self::Read { path: path.to_owned(), reason: reason.to_string() }
    }
}

/// Reads an EXR or PNG file, by its extension.
pub fn read_picture(path: &Path) -> Result<Picture, FileError> {
    match FileKind::of(path) {
        Ok(FileKind::Exr) => read_exr(path),
        Ok(FileKind::Png) => read_png(path),
        _ => Err(FileError::read(path, "pictures are .exr or .png files")),
    }
}
