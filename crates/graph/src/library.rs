//! Where documents and shaders come from: a folder on disk, the copies embedded in the program, or both.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
};

use crate::{
    diagnostics::{Diagnostic, Source},
    render::suggest,
};

/// No document or shader is larger; a larger file is another kind of file.
const LARGEST_FILE: u64 = 4 << 20;
/// Folders nested deeper than this are a loop of links.
const DEEPEST_FOLDER: usize = 16;

/// The folders `shaders/` and `pipelines/`, from disk or embedded.
#[derive(Debug, Clone, Default)]
pub struct Library {
    root: Option<PathBuf>,
    embedded: BTreeMap<String, Arc<Source>>,
}

/// Why a text could not be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It is not there.
    #[error("there is no file `{0}`")]
    Missing(String),
    /// It is there but is not a text of sensible size, or may not be read.
    #[error("cannot read `{name}`: {reason}")]
    Unreadable {
        /// File.
        name: String,
        /// What went wrong.
        reason: String,
    },
}

impl ReadError {
    /// As a diagnostic without a place.
    pub fn diagnostic(&self) -> Diagnostic {
        Diagnostic::error_nowhere(self.to_string())
    }
}

impl Library {
    /// A library over the folder `root` (a checkout), over embedded texts by path (`shaders/common/scene.wgsl`), or over both, where the disk wins.
    pub fn new(root: Option<PathBuf>, embedded: Vec<(String, &'static str)>) -> Self {
        let embedded = embedded
            .into_iter()
            .map(|(name, text)| (name.clone(), Arc::new(Source { name, path: None, text: Arc::from(strip_mark(text)) })))
            .collect();
        Self { root, embedded }
    }

    /// The folder on disk, if there is one.
    pub fn root(&self) -> Option<&Path> {
        self.root.as_deref()
    }

    /// The text at a path of the library; `None` when it is missing or unreadable ([`fetch`](Self::fetch) tells which).
    pub fn read(&self, path: &str) -> Option<Arc<Source>> {
        self.fetch(path).ok()
    }

    /// The text at a path of the library (`shaders/x/y.wgsl`, with `/` on every system).
    ///
    /// # Errors
    /// When it is neither on disk nor embedded, or the file on disk is no text.
    pub fn fetch(&self, path: &str) -> Result<Arc<Source>, ReadError> {
        if let Some(root) = &self.root {
            let on_disk = root.join(path);
            if on_disk.is_file() {
                return read_text(&on_disk);
            }
        }
        self.embedded.get(path).cloned().ok_or_else(|| ReadError::Missing(path.to_owned()))
    }

    /// A document anywhere on disk.
    ///
    /// # Errors
    /// When it is missing or no text.
    pub fn read_file(path: &Path) -> Result<Arc<Source>, ReadError> {
        if path.is_file() {
            return read_text(path);
        }
        Err(no_file(path).unwrap_or_else(|| ReadError::Missing(path.display().to_string())))
    }

    /// Paths of the library that start with the folder `prefix` and end with `.extension`, sorted.
    /// When the folder on disk has `shaders/`, only what is on disk counts: a file deleted there is gone.
    pub fn list(&self, prefix: &str, extension: &str) -> Vec<String> {
        let mut found = BTreeSet::new();
        let folder = prefix.trim_end_matches('/');
        let mut disk_wins = false;
        if let Some(root) = &self.root {
            disk_wins = root.join("shaders").is_dir();
            walk(&root.join(folder), folder, extension, 0, &mut found);
        }
        if !disk_wins {
            let inside = |name: &str| name.strip_prefix(folder).is_some_and(|rest| folder.is_empty() || rest.starts_with('/'));
            let ends = |name: &str| Path::new(name).extension().is_some_and(|e| e == extension);
            found.extend(self.embedded.keys().filter(|name| inside(name) && ends(name)).cloned());
        }
        found.into_iter().collect()
    }

    /// Finds a document that the user named: a file on disk, a path of the library, or a name in `pipelines/` (`acrsm`, `acrsm.ron`).
    /// The second value is its path in the library, where it has one.
    pub(crate) fn find(&self, name: &Path) -> Result<(Arc<Source>, Option<String>), ReadError> {
        if name.is_file() {
            return read_text(name).map(|source| (source, self.inside(name)));
        }
        let text = name.to_string_lossy().replace('\\', "/");
        let mut tries = vec![normal(&text), join("pipelines", &text)];
        if name.extension().is_none() {
            tries.push(format!("{}.ron", join("pipelines", &text)));
        }
        // A folder may have the name of a pipeline: it is only told of when there is none.
        self.first_of(tries, &text).map_err(|error| match error {
            ReadError::Missing(_) => no_file(name).unwrap_or(error),
            ReadError::Unreadable { .. } => error,
        })
    }

    /// Finds a document that another one names: relative to it, then in `pipelines/`.
    pub(crate) fn find_beside(
        &self,
        from: &Source,
        from_path: Option<&str>,
        name: &str,
    ) -> Result<(Arc<Source>, Option<String>), ReadError> {
        if let Some(folder) = from.path.as_ref().and_then(|p| p.parent()) {
            let file = PathBuf::from(normal(&folder.join(name).to_string_lossy().replace('\\', "/")));
            if file.is_file() {
                return read_text(&file).map(|source| (source, self.inside(&file)));
            }
        }
        let beside = from_path.map(|path| join(parent(path), name));
        self.first_of(beside.into_iter().chain([join("pipelines", name)]).collect(), name)
    }

    fn first_of(&self, tries: Vec<String>, name: &str) -> Result<(Arc<Source>, Option<String>), ReadError> {
        for path in tries {
            match self.fetch(&path) {
                Err(ReadError::Missing(_)) => {}
                found => return found.map(|source| (source, Some(path))),
            }
        }
        Err(ReadError::Missing(name.to_owned()))
    }

    /// The help for a document that is not there.
    pub(crate) fn suggest_document(&self, name: &str) -> String {
        let known = self.list("pipelines", "ron");
        let known = known.iter().filter_map(|k| k.strip_prefix("pipelines/"));
        let file = format!("{name}.ron");
        if known.clone().any(|k| k == file) {
            return format!("did you mean `{file}`?");
        }
        if name.ends_with(".ron") { suggest(name, known) } else { suggest(name, known.map(|k| k.trim_end_matches(".ron"))) }
    }

    /// The library's path of a file on disk, if it lies under the root.
    fn inside(&self, file: &Path) -> Option<String> {
        let root = self.root.as_ref()?.canonicalize().ok()?;
        let file = file.canonicalize().ok()?;
        Some(file.strip_prefix(root).ok()?.to_string_lossy().replace('\\', "/"))
    }
}

/// Why something that is there is no file; `None` when nothing is there.
fn no_file(path: &Path) -> Option<ReadError> {
    let meta = fs::metadata(path).ok()?;
    let reason = if meta.is_dir() { "it is a folder" } else { "it is no ordinary file" };
    Some(ReadError::Unreadable { name: shown_name(path), reason: reason.to_owned() })
}

/// The folder of a path with `/`.
pub(crate) fn parent(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// A path relative to a folder, with `.` and `..` resolved.
pub(crate) fn join(folder: &str, path: &str) -> String {
    if folder.is_empty() || path.starts_with('/') { normal(path) } else { normal(&format!("{folder}/{path}")) }
}

fn normal(path: &str) -> String {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        match part {
            "." => {}
            ".." if parts.last().is_some_and(|last| *last != ".." && !last.is_empty()) => {
                parts.pop();
            }
            part => parts.push(part),
        }
    }
    parts.join("/")
}

/// The stem of a path: `gbuffer` for `pipelines/stages/gbuffer.ron`.
pub(crate) fn stem(path: &str) -> String {
    Path::new(path).file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

fn strip_mark(text: &str) -> &str {
    text.strip_prefix('\u{feff}').unwrap_or(text)
}

fn read_text(path: &Path) -> Result<Arc<Source>, ReadError> {
    let shown = shown_name(path);
    let unreadable = |reason: String| ReadError::Unreadable { name: shown.clone(), reason };
    let size = fs::metadata(path).map_err(|e| unreadable(e.to_string()))?.len();
    if size > LARGEST_FILE {
        return Err(unreadable(format!("it has {size} bytes, more than the {LARGEST_FILE} allowed for a document or shader")));
    }
    let bytes = fs::read(path).map_err(|e| match e.kind() {
        io::ErrorKind::NotFound => ReadError::Missing(shown.clone()),
        _ => unreadable(e.to_string()),
    })?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        let line = e.as_bytes()[..at].iter().filter(|b| **b == b'\n').count() + 1;
        unreadable(format!("it is no UTF-8 text (byte {at}, line {line})"))
    })?;
    let text = match text.strip_prefix('\u{feff}') {
        Some(rest) => Arc::from(rest),
        None => Arc::from(text),
    };
    Ok(Arc::new(Source { name: shown, path: Some(path.to_path_buf()), text }))
}

/// A path as the user would type it: relative to the current folder where it lies below.
fn shown_name(path: &Path) -> String {
    let shorter = std::env::current_dir().ok().and_then(|here| path.strip_prefix(here).ok().map(Path::to_path_buf));
    let path = shorter.unwrap_or_else(|| path.to_path_buf());
    let path = path.strip_prefix(".").unwrap_or(&path);
    path.display().to_string()
}

fn walk(folder: &Path, name: &str, extension: &str, depth: usize, found: &mut BTreeSet<String>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let file_name = entry.file_name().to_string_lossy().into_owned();
        if file_name.starts_with('.') {
            continue;
        }
        let path = entry.path();
        let inner = if name.is_empty() { file_name } else { format!("{name}/{file_name}") };
        if path.is_dir() {
            if depth < DEEPEST_FOLDER {
                walk(&path, &inner, extension, depth + 1, found);
            }
        } else if path.extension().is_some_and(|e| e == extension) {
            found.insert(inner);
        }
    }
}
