//! Mends the text of an OBJ file, so that the parser neither gives up nor misreads it.
//!
//! What comes out has only `v`, `vt`, `vn`, `f` and `usemtl` lines with valid numbers; every corner of every face has all three indices,
//! absolute and in range (index 1 of `vt` and `vn` is a zero put in front for corners without one); materials are numbered, and the only library is `all`.

use std::{borrow::Cow, collections::HashMap, fmt::Write, ops::Range};

use super::faults::Faults;

/// What mending gives.
#[derive(Default)]
pub(super) struct CleanObj {
    /// The text for the parser.
    pub(super) text: String,
    /// Names after `mtllib`, and where they stand.
    pub(super) libraries: Vec<(String, Range<usize>)>,
    /// Names after `usemtl`; the parser sees their index as their name.
    pub(super) materials: Vec<(String, Range<usize>)>,
    /// Where each name is in `materials`.
    material_index: HashMap<String, usize>,
    /// What was wrong.
    pub(super) faults: Faults,
}

/// Coordinates beyond this are taken for damage: areas of such triangles leave the range of 32-bit numbers.
const LARGEST_COORDINATE: f32 = 1e15;

/// Number of `v`, `vt` and `vn` lines.
type Counts = [usize; 3];

/// Mends a text.
pub(super) fn clean(text: &str) -> CleanObj {
    let totals = count(text);
    let mut out = CleanObj { text: String::with_capacity(text.len() + text.len() / 2), ..CleanObj::default() };
    out.text.push_str("mtllib all\nvt 0 0\nvn 0 0 0\n");
    let mut counts = [0; 3];
    for (line, place) in logical_lines(text) {
        let mut words = line.split_whitespace();
        let Some(keyword) = words.next() else { continue };
        match keyword {
            "v" => out.vector(&mut counts[0], "v", words, 3, place),
            "vt" => out.vector(&mut counts[1], "vt", words, 2, place),
            "vn" => out.vector(&mut counts[2], "vn", words, 3, place),
            "f" => out.face(words, counts, totals, place),
            "p" | "l" => out.faults.add("{} points and lines are left out", "only faces make surfaces", place),
            "curv" | "curv2" | "surf" => out.faults.add("{} curves and free-form surfaces are left out", "export triangles", place),
            "usemtl" => out.use_material(rest(&line, keyword), place),
            "mtllib" => out.libraries.push((rest(&line, keyword).to_owned(), place)),
            _ => {}
        }
    }
    out
}

/// What follows the first word.
fn rest<'a>(line: &'a str, keyword: &str) -> &'a str {
    line.trim_start().get(keyword.len()..).unwrap_or("").trim()
}

/// Counts the vertices, so that a face may stand before the vertices that it names.
fn count(text: &str) -> Counts {
    let mut counts = [0; 3];
    for (line, _) in logical_lines(text) {
        match line.split_whitespace().next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            _ => {}
        }
    }
    counts
}

/// Lines without comments, with those that end in `\` joined to the next one, and where they stand.
fn logical_lines(text: &str) -> impl Iterator<Item = (Cow<'_, str>, Range<usize>)> {
    let mut offset = 0;
    std::iter::from_fn(move || {
        let start = offset;
        let mut joined = Cow::Borrowed("");
        loop {
            let rest = text.get(offset..).filter(|rest| !rest.is_empty());
            let Some(rest) = rest else {
                return (offset > start).then_some((joined, start..offset));
            };
            let line = rest.split_inclusive('\n').next().unwrap_or(rest);
            offset += line.len();
            let line = line.trim_end();
            let line = without_comment(line);
            let continued = line.strip_suffix('\\');
            let part = continued.unwrap_or(line);
            if joined.is_empty() {
                joined = part.into();
            } else {
                joined.to_mut().push_str(part);
            }
            if continued.is_none() {
                let end = start + text[start..offset].trim_end().len();
                return Some((joined, start..end.max(start)));
            }
            joined.to_mut().push(' ');
        }
    })
}

/// The line up to a `#` that starts a word.
fn without_comment(line: &str) -> &str {
    let comment = line.match_indices('#').find(|(at, _)| line[..*at].chars().next_back().is_none_or(char::is_whitespace));
    comment.map_or(line, |(at, _)| &line[..at])
}

impl CleanObj {
    /// A `v`, `vt` or `vn` line: kept in its place even if it is at fault, so that later indices stay right.
    fn vector<'a>(&mut self, count: &mut usize, keyword: &str, words: impl Iterator<Item = &'a str>, want: usize, place: Range<usize>) {
        *count += 1;
        let mut numbers = [0.0_f32; 3];
        let mut found = 0;
        let mut valid = true;
        for (number, word) in numbers.iter_mut().zip(words.take(want)) {
            match word.parse::<f32>() {
                Ok(value) if value.abs() <= LARGEST_COORDINATE => *number = value,
                _ => valid = false,
            }
            found += 1;
        }
        // A texture coordinate may have one number.
        valid &= found == want || keyword == "vt" && found == 1;
        if !valid {
            match keyword {
                "v" => {
                    let help = "faces that use them are left out";
                    self.faults.add("{} vertices are not three finite numbers of usable size", help, place);
                    numbers = [f32::NAN; 3];
                }
                "vt" => self.faults.add("{} texture coordinates are not finite numbers", "0 is used instead", place),
                _ => self.faults.add("{} normals are not finite numbers", "flat normals are used instead", place),
            }
            if keyword != "v" {
                numbers = [0.0; 3];
            }
        }
        let [x, y, z] = numbers;
        // Writing to a string cannot fail.
        let _ = if want == 2 { writeln!(self.text, "{keyword} {x} {y}") } else { writeln!(self.text, "{keyword} {x} {y} {z}") };
    }

    /// A face, if it has at least three corners and their positions exist.
    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>, counts: Counts, totals: Counts, place: Range<usize>) {
        let before = self.text.len();
        self.text.push('f');
        let mut corners = 0;
        for word in words {
            let mut indices = [None; 3];
            let mut parts = word.split('/');
            for (kind, (index, part)) in indices.iter_mut().zip(&mut parts).enumerate() {
                match resolve(part, counts[kind], totals[kind]) {
                    Ok(found) => *index = found,
                    Err(Broken::Malformed) => {
                        self.faults.add("{} faces are malformed and left out", "a corner is `v`, `v/vt`, `v//vn` or `v/vt/vn`", place);
                        return self.text.truncate(before);
                    }
                    Err(Broken::OutOfRange) if kind == 0 => {
                        self.faults.add("{} faces name vertices that do not exist and are left out", "indices count from 1", place);
                        return self.text.truncate(before);
                    }
                    Err(Broken::OutOfRange) => {
                        let help = "zero texture coordinates and flat normals are used instead";
                        self.faults.add("{} corners name a texture coordinate or normal that does not exist", help, place.clone());
                    }
                }
            }
            let Some(position) = indices[0] else {
                self.faults.add("{} faces are malformed and left out", "a corner is `v`, `v/vt`, `v//vn` or `v/vt/vn`", place);
                return self.text.truncate(before);
            };
            // The parser counts from 1; `vt` and `vn` have the zero in front.
            let (vt, vn) = (indices[1].map_or(1, |i| i + 2), indices[2].map_or(1, |i| i + 2));
            let _ = write!(self.text, " {}/{vt}/{vn}", position + 1);
            corners += 1;
        }
        if corners < 3 {
            self.text.truncate(before);
            self.faults.add("{} faces have fewer than three corners and are left out", "a face needs three vertices", place);
        } else {
            self.text.push('\n');
        }
    }

    /// A change of material.
    fn use_material(&mut self, name: &str, place: Range<usize>) {
        let index = self.material_index.get(name).copied().unwrap_or_else(|| {
            self.materials.push((name.to_owned(), place));
            self.material_index.insert(name.to_owned(), self.materials.len() - 1);
            self.materials.len() - 1
        });
        let _ = writeln!(self.text, "usemtl {index}");
    }
}

/// Why an index is no index.
enum Broken {
    Malformed,
    OutOfRange,
}

/// An index of a corner, counted from 0; none if the word is empty. Negative indices count back from the latest vertex.
fn resolve(word: &str, count: usize, total: usize) -> Result<Option<usize>, Broken> {
    if word.is_empty() {
        return Ok(None);
    }
    let index: i64 = word.parse().map_err(|_| Broken::Malformed)?;
    let index = match index {
        1.. => usize::try_from(index - 1).ok(),
        0 => None,
        _ => usize::try_from(index.unsigned_abs()).ok().and_then(|back| count.checked_sub(back)),
    };
    index.filter(|index| *index < total).map(Some).ok_or(Broken::OutOfRange)
}
