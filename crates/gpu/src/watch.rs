//! Which files really changed: events of the file system settle, then contents are compared.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    hash::{DefaultHasher, Hasher},
    io,
    path::{Path, PathBuf},
    sync::mpsc::{self, Receiver, RecvTimeoutError},
    time::{Duration, Instant, SystemTime},
};

use notify_debouncer_mini::{
    DebounceEventResult, DebouncedEventKind, Debouncer, new_debouncer,
    notify::{RecommendedWatcher, RecursiveMode},
};

/// How long a file must be left alone before it is looked at.
const SETTLE: Duration = Duration::from_millis(50);

/// A time stamp younger than this does not prove that the contents are the same: two writes may share one tick of the clock.
const TRUST_AFTER: Duration = Duration::from_secs(2);

/// Why nothing can be watched.
#[derive(Debug, thiserror::Error)]
#[error("cannot watch {what} for changes: {source}")]
pub struct WatchError {
    what: String,
    source: notify::Error,
}

/// What to watch.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct WatchSet {
    /// Files, whether they exist or not.
    pub files: Vec<PathBuf>,
    /// Folders with all that is in them.
    pub folders: Vec<PathBuf>,
    /// Extensions without the dot that count in folders; all when empty. Hidden files and `name~` never count.
    pub extensions: Vec<String>,
}

/// Contents of a file as far as they matter here.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Seen {
    hash: u64,
    length: u64,
    modified: Option<SystemTime>,
    looked: SystemTime,
}

/// Watches files and folders. Directories are watched rather than files, so that editors may rename, delete and write anew.
#[derive(Debug)]
pub struct Watcher {
    set: WatchSet,
    debouncer: Debouncer<RecommendedWatcher>,
    events: Receiver<DebounceEventResult>,
    watched: BTreeMap<PathBuf, RecursiveMode>,
    seen: BTreeMap<PathBuf, Seen>,
}

impl Watcher {
    /// Watches from now on: the present contents are what later ones are compared with.
    pub fn new(set: WatchSet) -> Result<Self, WatchError> {
        let (tell, events) = mpsc::channel();
        let debouncer = new_debouncer(SETTLE, tell).map_err(|source| WatchError { what: "files".to_owned(), source })?;
        let mut watcher = Self { set, debouncer, events, watched: BTreeMap::new(), seen: BTreeMap::new() };
        watcher.watch(true)?;
        watcher.seen = watcher.look();
        Ok(watcher)
    }

    /// Watches something else. Files watched before and after keep their contents to compare with.
    pub fn set(&mut self, set: WatchSet) -> Result<(), WatchError> {
        if self.set == set {
            return Ok(());
        }
        self.set = set;
        self.watch(true)?;
        let now = self.look();
        let known = std::mem::take(&mut self.seen);
        self.seen = now
            .into_iter()
            .map(|(path, seen)| {
                let before = known.get(&path).cloned();
                (path, before.unwrap_or(seen))
            })
            .collect();
        Ok(())
    }

    /// What changed since the last call; does not wait. Files that were made or deleted count as changed.
    pub fn poll(&mut self) -> Vec<PathBuf> {
        let mut settled = false;
        while let Ok(event) = self.events.try_recv() {
            settled |= self.heed(event);
        }
        if settled { self.compare() } else { Vec::new() }
    }

    /// Waits until something changed, at most so long; empty when nothing did.
    pub fn recv_timeout(&mut self, timeout: Duration) -> Vec<PathBuf> {
        let end = Instant::now() + timeout;
        loop {
            let event = match self.events.recv_timeout(end.saturating_duration_since(Instant::now())) {
                Ok(event) => event,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => {
                    return Vec::new();
                }
            };
            let mut settled = self.heed(event);
            while let Ok(event) = self.events.try_recv() {
                settled |= self.heed(event);
            }
            if settled {
                let changed = self.compare();
                if !changed.is_empty() {
                    return changed;
                }
            }
        }
    }

    /// Whether an event says that something has settled. Directories that vanished must be watched again when they are back.
    fn heed(&mut self, event: DebounceEventResult) -> bool {
        let Ok(events) = event else {
            // A watch broke or events were lost: watch and compare everything again.
            self.watched.clear();
            return true;
        };
        for event in &events {
            let below_or_same = |dir: &PathBuf| dir.starts_with(&event.path);
            let gone: Vec<_> = self.watched.keys().filter(|d| below_or_same(d)).cloned().collect();
            for dir in gone {
                // The system may have dropped the watch already.
                let _ = self.debouncer.watcher().unwatch(&dir);
                self.watched.remove(&dir);
            }
        }
        events.iter().any(|e| e.kind == DebouncedEventKind::Any)
    }

    fn compare(&mut self) -> Vec<PathBuf> {
        // A directory that cannot be watched now is tried again with the next event of its parent.
        let _ = self.watch(false);
        let now = self.look();
        let differs = |path: &&PathBuf| now.get(*path).map(|s| s.hash) != self.seen.get(*path).map(|s| s.hash);
        let all: BTreeSet<&PathBuf> = now.keys().chain(self.seen.keys()).collect();
        let changed = all.into_iter().filter(differs).cloned().collect();
        self.seen = now;
        changed
    }

    /// Watches every directory that matters: folders with all below them, the parents of files, and the parent of each of
    /// these, from where its re-creation is seen.
    fn watch(&mut self, strict: bool) -> Result<(), WatchError> {
        let mut wanted: BTreeMap<PathBuf, RecursiveMode> = BTreeMap::new();
        let mut want = |dir: &Path, mode: RecursiveMode| {
            let dir = existing(dir);
            let entry = wanted.entry(dir.0).or_insert(RecursiveMode::NonRecursive);
            if mode == RecursiveMode::Recursive && dir.1 {
                *entry = mode;
            }
        };
        for folder in &self.set.folders {
            want(folder, RecursiveMode::Recursive);
            want(&parent(folder), RecursiveMode::NonRecursive);
        }
        for file in &self.set.files {
            let mut dirs = vec![parent(file)];
            // What a link points to changes elsewhere.
            if let Ok(real) = fs::canonicalize(file) {
                dirs.push(parent(&real));
            }
            for dir in dirs {
                want(&dir, RecursiveMode::NonRecursive);
                want(&parent(&dir), RecursiveMode::NonRecursive);
            }
        }
        let stale: Vec<_> = self.watched.iter().filter(|(dir, mode)| wanted.get(*dir) != Some(*mode)).map(|(dir, _)| dir.clone()).collect();
        for dir in stale {
            let _ = self.debouncer.watcher().unwatch(&dir);
            self.watched.remove(&dir);
        }
        for (dir, mode) in wanted {
            if self.watched.contains_key(&dir) {
                continue;
            }
            match self.debouncer.watcher().watch(&dir, mode) {
                Ok(()) => {
                    self.watched.insert(dir, mode);
                }
                Err(source) if strict => {
                    return Err(WatchError { what: format!("`{}`", dir.display()), source });
                }
                Err(_) => {}
            }
        }
        Ok(())
    }

    /// The present contents of everything in the set.
    fn look(&self) -> BTreeMap<PathBuf, Seen> {
        let mut paths: BTreeSet<PathBuf> = self.set.files.iter().cloned().collect();
        for folder in &self.set.folders {
            collect(folder, &self.set.extensions, &mut paths);
        }
        paths
            .into_iter()
            .filter_map(|path| {
                let seen = see(&path, self.seen.get(&path)).ok()?;
                Some((path, seen))
            })
            .collect()
    }
}

fn parent(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if parent.as_os_str().is_empty() => PathBuf::from("."),
        Some(parent) => parent.to_owned(),
        None => path.to_owned(),
    }
}

/// The directory itself, or its nearest ancestor that exists; and whether it was the directory itself.
fn existing(dir: &Path) -> (PathBuf, bool) {
    let mut at = dir.to_owned();
    loop {
        let up = parent(&at);
        if at.is_dir() || up == at {
            let itself = at == dir;
            return (at, itself);
        }
        at = up;
    }
}

fn collect(folder: &Path, extensions: &[String], to: &mut BTreeSet<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        let path = entry.path();
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') || name.ends_with('~') {
            continue;
        }
        if entry.file_type().is_ok_and(|t| t.is_dir()) {
            collect(&path, extensions, to);
            continue;
        }
        let extension = path.extension().map(|e| e.to_string_lossy());
        let counts = extension.is_some_and(|e| extensions.iter().any(|known| *known == e));
        if counts || extensions.is_empty() {
            to.insert(path);
        }
    }
}

fn see(path: &Path, before: Option<&Seen>) -> io::Result<Seen> {
    let meta = fs::metadata(path)?;
    if !meta.is_file() {
        return Err(io::ErrorKind::InvalidInput.into());
    }
    let (length, modified) = (meta.len(), meta.modified().ok());
    let looked = SystemTime::now();
    if let (Some(before), Some(modified)) = (before, modified) {
        let old = before.looked.duration_since(modified).is_ok_and(|age| age > TRUST_AFTER);
        if old && before.length == length && before.modified == Some(modified) {
            return Ok(Seen { looked, ..before.clone() });
        }
    }
    let mut hasher = DefaultHasher::new();
    hasher.write(&fs::read(path)?);
    Ok(Seen { hash: hasher.finish(), length, modified, looked })
}
