//! Measures on disk, by what they were measured from. A file that cannot be read, was cut short or was changed by anybody is as good as none.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    io::{self, Write as _},
    path::PathBuf,
};

use manylight_graph::features::{self, Measured};

use super::{AtTimes, MeasureOptions, VERSION, memo::Fingerprint};
use crate::{files, scene::Scene};

/// First line of a file, with the version of the estimators.
const FORMAT: &str = "manylight measures";

/// Everything that the measures depend on, in one line.
fn key(scene: &Scene, options: &MeasureOptions) -> String {
    let MeasureOptions { aspect, samples, times, seed, .. } = options;
    // Who loads scenes otherwise, another release of this crate, may measure otherwise.
    let release = env!("CARGO_PKG_VERSION");
    let Fingerprint(scene) = Fingerprint::of(scene);
    format!("{FORMAT} {VERSION} {release} scene {scene:016x} aspect {aspect:?} samples {samples} times {times} seed {seed}")
}

fn hash(text: &str) -> u64 {
    files::fnv(files::FNV_START, text.as_bytes())
}

fn file(scene: &Scene, options: &MeasureOptions) -> Option<PathBuf> {
    Some(options.cache.as_ref()?.join(format!("{:016x}.txt", hash(&key(scene, options)))))
}

/// What is kept, if there is anything.
pub(super) fn read(scene: &Scene, options: &MeasureOptions) -> Option<AtTimes> {
    let text = fs::read_to_string(file(scene, options)?).ok()?;
    parse(&text, &key(scene, options))
}

/// Keeps measures where they can be kept. The folder is made if need be.
pub(super) fn write(scene: &Scene, options: &MeasureOptions, at_times: &AtTimes) {
    let Some(path) = file(scene, options) else { return };
    let text = print(&key(scene, options), at_times);
    // Who may not write there measures again the next time: nothing else is lost.
    if let Some(folder) = path.parent()
        && fs::create_dir_all(folder).is_ok()
    {
        let _ = files::write_whole::<io::Error>(&path, |file| file.write_all(text.as_bytes()));
    }
}

fn print(key: &str, at_times: &AtTimes) -> String {
    let mut text = format!("{key}\n");
    for (time, features) in at_times {
        // Numbers as Rust prints them for debugging come back as the same bits.
        let _ = writeln!(text, "time {time:?}");
        for (name, measured) in features {
            let _ = writeln!(text, "{name} {:?} {:?}", measured.value, measured.standard_error);
        }
    }
    let _ = writeln!(text, "end {:016x}", hash(&text));
    text
}

fn parse(text: &str, key: &str) -> Option<AtTimes> {
    let (body, end) = text.split_at(text.strip_suffix('\n')?.rfind('\n')? + 1);
    if end != format!("end {:016x}\n", hash(body)) {
        return None;
    }
    let mut lines = body.lines();
    if lines.next()? != key {
        return None;
    }
    let mut at_times: AtTimes = Vec::new();
    for line in lines {
        let words: Vec<&str> = line.split(' ').collect();
        match words[..] {
            ["time", time] => at_times.push((time.parse().ok()?, BTreeMap::new())),
            [name, value, standard_error] => {
                let measured = Measured { value: value.parse().ok()?, standard_error: standard_error.parse().ok()? };
                at_times.last_mut()?.1.insert(name.to_owned(), measured);
            }
            _ => return None,
        }
    }
    let is_whole = |known: &BTreeMap<String, Measured>| features::measured().all(|name| known.contains_key(name));
    (!at_times.is_empty() && at_times.iter().all(|(_, known)| is_whole(known))).then_some(at_times)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn some() -> AtTimes {
        let measured = |i: usize| Measured { value: 0.1 + 0.2 * i as f64, standard_error: 1e-3 / (i as f64 + 3.0) };
        let some: BTreeMap<_, _> = features::measured().enumerate().map(|(i, name)| (name.to_owned(), measured(i))).collect();
        vec![(0.0, some.clone()), (1.0 / 3.0, some)]
    }

    #[test]
    fn what_is_written_is_read() {
        assert_eq!(parse(&print("a key", &some()), "a key"), Some(some()));
        assert_eq!(parse(&print("a key", &some()), "another key"), None);
    }

    /// Whatever happens to a file: it is read as it was written, or not at all.
    #[test]
    fn a_damaged_file_is_none() {
        let text = print("a key", &some());
        for length in 0..text.len() {
            assert_eq!(parse(&text[..length], "a key"), None, "the first {length} bytes");
        }
        for at in 0..text.len() {
            let mut bytes = text.clone().into_bytes();
            bytes[at] ^= 1;
            let Ok(damaged) = String::from_utf8(bytes) else { continue };
            assert_eq!(parse(&damaged, "a key"), None, "byte {at}");
        }
        let without =
            text.lines().filter(|line| !line.starts_with("lit_share") && !line.starts_with("end")).fold(String::new(), |mut text, line| {
                text.push_str(line);
                text.push('\n');
                text
            });
        assert_eq!(parse(&format!("{without}end {:016x}\n", hash(&without)), "a key"), None, "a feature is not there");
    }
}
