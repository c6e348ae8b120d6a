//! Good documents made wrong: edits that know what a RON text consists of, so that they get past the reader and into what follows it.
//!
//! Cases are numbered, and a number always gives the same case. `MANYLIGHT_FUZZ=20` runs twenty times as many; `MANYLIGHT_FUZZ_CASE=1234` that one alone.

use std::{
    env,
    ops::Range,
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    sync::mpsc::{RecvTimeoutError, channel},
    thread,
    time::Duration,
};

use crate::support::Random;

fn number(variable: &str) -> Option<u64> {
    env::var(variable).ok()?.parse().ok()
}

/// How many times as many cases as usual are to be tried.
pub fn times() -> u64 {
    number("MANYLIGHT_FUZZ").unwrap_or(1)
}

/// Runs cases in a thread of their own. Each is a failure when it panics, and when it takes longer than `bound`.
pub fn fuzz(name: &'static str, count: u64, bound: Duration, mut case: impl FnMut(&mut Random) + Send + 'static) {
    let cases = match number("MANYLIGHT_FUZZ_CASE") {
        Some(only) => only..only + 1,
        None => 0..count * times(),
    };
    let (tell, told) = channel();
    let worker = thread::spawn(move || {
        for index in cases {
            // Nobody listens any more when an earlier case took too long.
            let _ = tell.send(index);
            let caught = catch_unwind(AssertUnwindSafe(|| case(&mut Random::spread(index))));
            if let Err(panic) = caught {
                eprintln!("{name}: the case MANYLIGHT_FUZZ_CASE={index} failed");
                resume_unwind(panic);
            }
        }
    });
    let mut current = 0;
    loop {
        match told.recv_timeout(bound) {
            Ok(index) => current = index,
            Err(RecvTimeoutError::Timeout) => panic!("{name}: the case MANYLIGHT_FUZZ_CASE={current} takes longer than {bound:?}"),
            Err(RecvTimeoutError::Disconnected) => break,
        }
    }
    if let Err(panic) = worker.join() {
        resume_unwind(panic);
    }
}

/// Numbers at the ends of types and ranges, and texts that only look like numbers.
const NUMBERS: &[&str] = &[
    "0",
    "-1",
    "1",
    "2",
    "3",
    "NaN",
    "inf",
    "-inf",
    "1e30",
    "-1e30",
    "1e-30",
    "-0.0",
    "0.5",
    "1e-320",
    "1e999",
    "255",
    "256",
    "1000",
    "16384",
    "16385",
    "65535",
    "65536",
    "1000000",
    "2147483647",
    "2147483648",
    "-2147483649",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "9223372036854775808",
    "-9223372036854775809",
    "18446744073709551616",
    "340282350000000000000000000000000000000",
    "0x10",
    "1_000",
    "1.5.2",
];

/// Values of other types than the one that is wanted.
const VALUES: &[&str] = &[
    "\"\"",
    "()",
    "[]",
    "{}",
    "true",
    "false",
    "None",
    "Some(1)",
    "'x'",
    "\"\\u{0}\"",
    "\"a/b\"",
    "\"../..\"",
    "\"\u{1f600}\"",
    "r#\"raw\"#",
    "Output",
    "Param(\"\")",
    "Not(All([]))",
    "Any([])",
    "(1, 2, 3)",
    "(x: 1)",
    "[[1], [2]]",
    "{1: 2}",
    "{\"a\": {\"a\": {}}}",
    "\"NaN\"",
    "-",
];

/// A word, number or text, or a bracket with what is in it.
#[derive(Debug, Clone, Default)]
struct Pieces {
    numbers: Vec<Range<usize>>,
    words: Vec<Range<usize>>,
    texts: Vec<Range<usize>>,
    /// Entries by bracket: each from its first to its last byte, without the comma.
    groups: Vec<Vec<Range<usize>>>,
    /// Values of entries, without their keys.
    values: Vec<Range<usize>>,
}

/// A bracket that is open while a text is taken apart.
#[derive(Default)]
struct Open {
    entries: Vec<Range<usize>>,
    /// Where the current entry began.
    entry: Option<usize>,
    /// Where the value of the current entry began.
    value: Option<usize>,
}

/// Takes a RON text apart; what cannot be read is left out.
fn pieces(text: &str) -> Pieces {
    let bytes = text.as_bytes();
    let mut found = Pieces::default();
    let mut open: Vec<Open> = Vec::new();
    let mut at = 0;
    let mut last = 0;
    while at < bytes.len() {
        let start = at;
        let byte = bytes[at];
        if byte == b'/' && bytes.get(at + 1) == Some(&b'/') {
            at = text[at..].find('\n').map_or(bytes.len(), |n| at + n);
            continue;
        }
        if byte.is_ascii_whitespace() {
            at += 1;
            continue;
        }
        if !matches!(byte, b',' | b')' | b']' | b'}')
            && let Some(Open { entry, value, .. }) = open.last_mut()
        {
            entry.get_or_insert(start);
            if byte == b':' {
                *value = Some(at + 1);
            }
        }
        match byte {
            b'"' => {
                at += 1;
                while at < bytes.len() && bytes[at] != b'"' {
                    at += if bytes[at] == b'\\' { 2 } else { 1 };
                }
                at = (at + 1).min(bytes.len());
                found.texts.push(start..at);
            }
            b'(' | b'[' | b'{' => {
                open.push(Open::default());
                at += 1;
            }
            b',' | b')' | b']' | b'}' => {
                if let Some(Open { entries, entry, value }) = open.last_mut() {
                    if let Some(entry) = entry.take() {
                        entries.push(entry..last);
                        let value = value.take().unwrap_or(entry);
                        let value = value + text[value..last].len() - text[value..last].trim_start().len();
                        found.values.push(value..last);
                    }
                    if byte != b','
                        && let Some(Open { entries, .. }) = open.pop()
                    {
                        found.groups.push(entries);
                    }
                }
                at += 1;
            }
            _ if byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'-' | b'.') => {
                while at < bytes.len() && (bytes[at].is_ascii_alphanumeric() || matches!(bytes[at], b'_' | b'-' | b'.')) {
                    at += 1;
                }
                let list = if byte.is_ascii_digit() || byte == b'-' { &mut found.numbers } else { &mut found.words };
                list.push(start..at);
            }
            _ => at += text[at..].chars().next().map_or(1, char::len_utf8),
        }
        last = at;
    }
    found.groups.retain(|entries| !entries.is_empty());
    found
}

/// A name like another one: a letter lost, doubled, swapped or of another case.
fn near(name: &str, random: &mut Random) -> String {
    let mut letters: Vec<char> = name.chars().collect();
    if letters.is_empty() {
        return "a".to_owned();
    }
    let at = random.below(letters.len());
    match random.below(5) {
        0 => drop(letters.remove(at)),
        1 => letters.insert(at, letters[at]),
        2 => letters.swap(at, (at + 1) % name.chars().count()),
        3 => letters[at] = if letters[at].is_uppercase() { letters[at].to_ascii_lowercase() } else { letters[at].to_ascii_uppercase() },
        _ => letters.push('_'),
    }
    letters.into_iter().collect()
}

fn replaced(text: &str, range: &Range<usize>, with: impl AsRef<str>) -> String {
    [&text[..range.start], with.as_ref(), &text[range.end..]].concat()
}

/// One edit of a RON text; `donor` is another good text, of which parts may come in.
fn edit(text: &str, donor: &str, random: &mut Random) -> String {
    let pieces = pieces(text);
    let choose = |ranges: &[Range<usize>], random: &mut Random| (!ranges.is_empty()).then(|| random.of(ranges).clone());
    let edited = match random.below(20) {
        0..=2 => choose(&pieces.numbers, random).map(|range| replaced(text, &range, random.of(NUMBERS))),
        3 => choose(&pieces.values, random).map(|range| replaced(text, &range, random.of(VALUES))),
        4 => choose(&pieces.values, random).map(|range| replaced(text, &range, random.of(NUMBERS))),
        5 | 6 => {
            // A value of another place: of another type more often than not.
            choose(&pieces.values, random).zip(choose(&pieces.values, random)).map(|(to, from)| replaced(text, &to, &text[from]))
        }
        7 => {
            let others = self::pieces(donor);
            choose(&pieces.values, random).zip(choose(&others.values, random)).map(|(to, from)| replaced(text, &to, &donor[from]))
        }
        8 => choose(&pieces.texts, random).map(|range| {
            let inner = text[range.clone()].trim_matches('"');
            replaced(text, &range, format!("\"{}\"", near(inner, random)))
        }),
        9 | 10 => choose(&pieces.texts, random).zip(choose(&pieces.texts, random)).map(|(to, from)| replaced(text, &to, &text[from])),
        11 => choose(&pieces.words, random).map(|range| replaced(text, &range, near(&text[range.clone()], random))),
        12 => choose(&pieces.words, random).zip(choose(&pieces.words, random)).map(|(to, from)| replaced(text, &to, &text[from])),
        13 | 14 => (!pieces.groups.is_empty()).then(|| {
            let entry = {
                let group = random.of(&pieces.groups);
                random.of(group).clone()
            };
            // With its comma, if it has one.
            let end = entry.end + usize::from(text[entry.end..].starts_with(','));
            replaced(text, &(entry.start..end), "")
        }),
        15 => (!pieces.groups.is_empty()).then(|| {
            let entry = {
                let group = random.of(&pieces.groups);
                random.of(group).clone()
            };
            let copy = text[entry.clone()].to_owned();
            replaced(text, &entry, format!("{copy}, {copy}"))
        }),
        16 => (!pieces.groups.is_empty()).then(|| {
            let group = random.of(&pieces.groups);
            let (a, b) = (random.of(group).clone(), random.of(group).clone());
            let (first, second) = if a.start < b.start { (a, b) } else { (b, a) };
            if first == second {
                return text.to_owned();
            }
            let (x, y) = (text[first.clone()].to_owned(), text[second.clone()].to_owned());
            replaced(&replaced(text, &second, x), &first, y)
        }),
        17 => (!pieces.groups.is_empty()).then(|| {
            let others = self::pieces(donor);
            let entry = {
                let group = random.of(&pieces.groups);
                random.of(group).clone()
            };
            let from = if others.groups.is_empty() {
                "x: 1"
            } else {
                let group = random.of(&others.groups);
                &donor[random.of(group).clone()]
            };
            replaced(text, &(entry.start..entry.start), format!("{from}, "))
        }),
        18 => choose(&pieces.values, random).map(|range| {
            let (open, close) = *random.of(&[("(", ")"), ("[", "]"), ("Not(", ")"), ("Some(", ")"), ("Previous(", ")"), ("{\"a\": ", "}")]);
            let depth = *random.of(&[1, 2, 20, 200, 5000]);
            replaced(text, &range, format!("{}{}{}", open.repeat(depth), &text[range.clone()], close.repeat(depth)))
        }),
        _ => {
            let mut bytes = text.as_bytes().to_vec();
            if bytes.is_empty() {
                return String::new();
            }
            let at = random.below(bytes.len());
            if random.below(3) == 0 {
                bytes.truncate(at);
            } else {
                bytes[at] ^= 1 << random.below(8);
            }
            Some(String::from_utf8_lossy(&bytes).into_owned())
        }
    };
    edited.unwrap_or_else(|| text.to_owned())
}

/// A RON text with one to four edits; most have one, which keeps the rest of it good.
pub fn ron(text: &str, donor: &str, random: &mut Random) -> String {
    let edits = *random.of(&[1, 1, 1, 2, 2, 3, 4]);
    (0..edits).fold(text.to_owned(), |text, _| edit(&text, donor, random))
}

/// Words, numbers and signs of a shader, without comments and white space.
fn tokens(text: &str) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let start = at;
        if text[at..].starts_with("//") {
            at = text[at..].find('\n').map_or(bytes.len(), |n| at + n);
            continue;
        }
        let is_word = |byte: u8| byte.is_ascii_alphanumeric() || matches!(byte, b'_' | b'.');
        if bytes[at].is_ascii_whitespace() {
            at += 1;
            continue;
        }
        while at < bytes.len() && is_word(bytes[at]) {
            at += 1;
        }
        if at == start {
            at += text[at..].chars().next().map_or(1, char::len_utf8);
        }
        found.push(start..at);
    }
    found
}

/// Types, accesses and words of a shader that can stand for one another, and mostly may not.
const WORDS: &[&[&str]] = &[
    &["f32", "u32", "i32", "bool", "vec2f", "vec3f", "vec4f", "vec2u", "vec3u", "vec4u", "mat3x3f", "mat4x4f", "array<f32, 4>", "f16"],
    &["read", "write", "read_write"],
    &["storage", "uniform", "private", "workgroup", "function"],
    &["r32float", "rgba16float", "rgba32float", "r32uint", "rgba8unorm"],
    &["+", "-", "*", "/", "%", "<", ">", "&", "|", "^"],
    &["if", "while", "for", "loop", "return", "break", "continue", "var", "let", "const", "else", "switch", "discard"],
];

/// Numbers at the ends of types.
const SHADER_NUMBERS: &[&str] = &[
    "0",
    "0u",
    "1",
    "-1",
    "4294967295u",
    "4294967296",
    "2147483647",
    "-2147483648",
    "1e38",
    "1e39",
    "0.0",
    "1e-45",
    "0x7fffffff",
    "65536u",
];

/// What a shader should not have.
const ADDED: &[&str] = &[
    "fn again(x: u32) -> u32 { return again(x); }",
    "fn ping(x: u32) -> u32 { return pong(x); } fn pong(x: u32) -> u32 { return ping(x); }",
    "var<private> huge_private: array<vec4f, 16777216>;",
    "var<workgroup> huge_workgroup: array<vec4f, 16777216>;",
    "@group(0) @binding(0) var<storage, read> stranger: array<f32>;",
    "@group(7) @binding(999) var<storage, read> stranger: array<f32>;",
    "#import common::nothing::{such}",
    "#import common::math",
    "struct Params { a: array<f32> }",
    "override stranger: u32;",
    "@compute @workgroup_size(1000000) fn stranger() {}",
    "const zero = 1 / 0;",
    "const_assert false;",
    "#define X",
    "#ifdef A",
    "fn",
    "}",
    "/*",
];

/// Statements that a function should not have.
const STATEMENTS: &[&str] = &[
    "loop {}",
    "loop { if false { break; } }",
    "while true {}",
    "for (var i = 0u; i < 4294967295u; i++) {}",
    "var huge: array<vec4f, 16777216>; huge[0] = vec4f(1.0);",
    "workgroupBarrier();",
    "discard;",
    "return;",
    "let zero = 0u; let bad = 1u / zero;",
    "var x = 1; x = x / (x - x);",
    "return 1;",
    "{{{{{{{{}}}}}}}}",
];

/// One edit of a shader.
fn edit_wgsl(text: &str, random: &mut Random) -> String {
    let all = tokens(text);
    if all.is_empty() {
        return text.to_owned();
    }
    let one = random.of(&all).clone();
    let of = |wanted: &dyn Fn(&str) -> bool| all.iter().filter(|range| wanted(&text[(*range).clone()])).cloned().collect::<Vec<_>>();
    let line = |random: &mut Random, wanted: &dyn Fn(&str) -> bool| {
        let mut start = 0;
        let lines = text.split_inclusive('\n').map(|line| {
            start += line.len();
            start - line.len()..start
        });
        let lines: Vec<_> = lines.filter(|range| wanted(&text[range.clone()])).collect();
        (!lines.is_empty()).then(|| random.of(&lines).clone())
    };
    match random.below(16) {
        0 | 1 => replaced(text, &one, ""),
        2 => replaced(text, &one, &text[random.of(&all).clone()]),
        3..=5 => {
            let words = *random.of(WORDS);
            let places = of(&|word| words.contains(&word));
            if places.is_empty() { replaced(text, &one, "f32") } else { replaced(text, random.of(&places), random.of(words)) }
        }
        6 | 7 => {
            let numbers = of(&|word| word.starts_with(|c: char| c.is_ascii_digit()));
            if numbers.is_empty() { replaced(text, &one, "0") } else { replaced(text, random.of(&numbers), random.of(SHADER_NUMBERS)) }
        }
        8 => {
            let words = of(&|word| word.starts_with(|c: char| c.is_ascii_alphabetic()));
            let range = if words.is_empty() { one } else { random.of(&words).clone() };
            let name = near(&text[range.clone()], random);
            replaced(text, &range, name)
        }
        9 => line(random, &|line| line.contains("@group")).map_or_else(|| text.to_owned(), |range| replaced(text, &range, "")),
        10 => line(random, &|line| line.starts_with("fn ") || line.contains(" fn "))
            .map_or_else(|| text.to_owned(), |range| replaced(text, &range, text[range.clone()].replacen("fn ", "fn x", 1))),
        11 => line(random, &|line| line.starts_with("#import")).map_or_else(|| text.to_owned(), |range| replaced(text, &range, "")),
        12 => line(random, &|line| !line.trim().is_empty()).map_or_else(
            || text.to_owned(),
            |range| replaced(text, &range, if random.below(2) == 0 { String::new() } else { text[range.clone()].repeat(2) }),
        ),
        13 => format!("{text}\n{}\n", random.of(ADDED)),
        14 => {
            let ends = of(&|word| word == ";");
            if ends.is_empty() {
                text.to_owned()
            } else {
                let at = random.of(&ends).end;
                replaced(text, &(at..at), random.of(STATEMENTS))
            }
        }
        _ => {
            let mut bytes = text.as_bytes().to_vec();
            let at = random.below(bytes.len());
            if random.below(3) == 0 {
                bytes.truncate(at);
            } else {
                bytes[at] ^= 1 << random.below(8);
            }
            String::from_utf8_lossy(&bytes).into_owned()
        }
    }
}

/// A shader with one to three edits; most have one.
pub fn wgsl(text: &str, random: &mut Random) -> String {
    let edits = *random.of(&[1, 1, 1, 2, 3]);
    (0..edits).fold(text.to_owned(), |text, _| edit_wgsl(&text, random))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_comes_apart_into_entries_and_values() {
        let text = "A(x: 1, // no, comment\n \"k\": [a, \"b,\\\"\", (2.5)], )";
        let found = pieces(text);
        let all = |ranges: &[Range<usize>]| ranges.iter().map(|r| text[r.clone()].to_owned()).collect::<Vec<_>>();
        assert_eq!(all(&found.numbers), ["1", "2.5"]);
        assert_eq!(all(&found.words), ["A", "x", "a"]);
        assert_eq!(all(&found.texts), ["\"k\"", "\"b,\\\"\""]);
        assert_eq!(all(&found.groups[1]), ["a", "\"b,\\\"\"", "(2.5)"]);
        assert_eq!(all(&found.groups[2]), ["x: 1", "\"k\": [a, \"b,\\\"\", (2.5)]"]);
        assert!(all(&found.values).contains(&"1".to_owned()));
    }

    #[test]
    fn equal_seeds_give_equal_texts_and_most_differ_from_the_good_one() {
        let text = "Pipeline(doc: \"a\", params: {\"n\": Int(min: 0, max: 9, default: 1, doc: \"b\")}, presents: \"p\")";
        let of = |seed| ron(text, text, &mut Random::spread(seed));
        let changed = (0..1000).filter(|seed| of(*seed) != text).count();
        assert!((0..50).all(|seed| of(seed) == of(seed)) && changed > 900, "{changed}");
    }
}
