//! A look at WGSL text without parsing it: declarations, attributes, imports, and where they stand.

use std::ops::Range;

/// A declaration at module scope.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Item {
    /// `fn`, `struct`, `var`, `const`, `override` or `alias`.
    pub keyword: &'static str,
    pub name: String,
    pub range: Range<usize>,
}

/// A path that a text imports or mentions: `common::cluster::form_factor`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Path {
    pub text: String,
    pub range: Range<usize>,
    /// From an `#import` line; otherwise a path used in code.
    pub import: bool,
}

/// What a scan finds.
#[derive(Debug, Default)]
pub(crate) struct Scan {
    pub items: Vec<Item>,
    /// Attributes such as `@compute` with their places.
    pub attributes: Vec<(String, Range<usize>)>,
    pub paths: Vec<Path>,
    /// The `{` of an import that is never closed.
    pub unclosed: Option<Range<usize>>,
    /// `#` directives other than `#import`, by word.
    pub directives: Vec<(String, Range<usize>)>,
}

impl Scan {
    pub fn item(&self, keyword: &str, name: &str) -> Option<&Item> {
        self.items.iter().find(|item| item.keyword == keyword && item.name == name)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Token<'a> {
    Word(&'a str),
    Mark(u8),
}

/// Words (with `::` inside) and single marks with their places; comments are skipped.
fn tokens(text: &str) -> Vec<(Token<'_>, Range<usize>)> {
    let plain = without_comments(text);
    let bytes = plain.as_bytes();
    let mut found = Vec::new();
    let mut at = 0;
    let word = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b >= 0x80;
    while at < bytes.len() {
        let byte = bytes[at];
        if word(byte) {
            let start = at;
            loop {
                while at < bytes.len() && word(bytes[at]) {
                    at += 1;
                }
                if bytes.get(at) == Some(&b':') && bytes.get(at + 1) == Some(&b':') && bytes.get(at + 2).is_some_and(|b| word(*b)) {
                    at += 2;
                } else {
                    break;
                }
            }
            found.push((Token::Word(&text[start..at]), start..at));
        } else {
            if !byte.is_ascii_whitespace() || byte == b'\n' {
                found.push((Token::Mark(byte), at..at + 1));
            }
            at += 1;
        }
    }
    found
}

/// The text with comments as spaces, so that places stay.
fn without_comments(text: &str) -> String {
    let mut bytes = text.as_bytes().to_vec();
    let mut at = 0;
    let mut depth = 0usize;
    let mut line = false;
    while at < bytes.len() {
        let pair = (bytes[at], bytes.get(at + 1).copied().unwrap_or(0));
        let mut width = 1;
        let mut blank = depth > 0 || line;
        match pair {
            (b'\n', _) => line = false,
            (b'/', b'/') if depth == 0 && !line => {
                line = true;
                blank = true;
            }
            (b'/', b'*') if !line => {
                depth += 1;
                (width, blank) = (2, true);
            }
            (b'*', b'/') if depth > 0 => {
                depth -= 1;
                (width, blank) = (2, true);
            }
            _ => {}
        }
        if blank {
            for byte in bytes.iter_mut().skip(at).take(width) {
                if *byte != b'\n' {
                    *byte = b' ';
                }
            }
        }
        at += width;
    }
    // Only whole comments were blanked, but a broken text may leave half a character: fall back to the text itself.
    String::from_utf8(bytes).unwrap_or_else(|_| text.to_owned())
}

const KEYWORDS: [&str; 6] = ["fn", "struct", "var", "const", "override", "alias"];

/// Scans a shader.
pub(crate) fn scan(text: &str) -> Scan {
    let tokens = tokens(text);
    let mut scan = Scan::default();
    let mut depth = 0usize;
    let mut at = 0;
    while at < tokens.len() {
        let (token, range) = &tokens[at];
        match token {
            Token::Mark(b'{') => depth += 1,
            Token::Mark(b'}') => depth = depth.saturating_sub(1),
            Token::Mark(b'@') => {
                if let Some((Token::Word(name), place)) = tokens.get(at + 1) {
                    scan.attributes.push(((*name).to_owned(), range.start..place.end));
                    at += 1;
                }
            }
            Token::Mark(b'#') => match tokens.get(at + 1) {
                Some((Token::Word("import"), _)) => {
                    at = read_import(&tokens, at + 2, &mut scan);
                    continue;
                }
                Some((Token::Word(name), place)) => scan.directives.push(((*name).to_owned(), range.start..place.end)),
                _ => {}
            },
            Token::Word(path) if path.contains("::") => {
                scan.paths.push(Path { text: (*path).to_owned(), range: range.clone(), import: false });
            }
            Token::Word(keyword) if depth == 0 => {
                if let Some(keyword) = KEYWORDS.into_iter().find(|k| k == keyword) {
                    let name_at = after_template(&tokens, at + 1);
                    if let Some((Token::Word(name), place)) = tokens.get(name_at) {
                        scan.items.push(Item { keyword, name: (*name).to_owned(), range: place.clone() });
                        at = name_at;
                    }
                }
            }
            _ => {}
        }
        at += 1;
    }
    scan
}

/// Skips `<…>` and line ends.
fn after_template(tokens: &[(Token<'_>, Range<usize>)], mut at: usize) -> usize {
    let mut depth = 0usize;
    while let Some((token, _)) = tokens.get(at) {
        match token {
            Token::Mark(b'<') => depth += 1,
            Token::Mark(b'>') if depth > 0 => depth -= 1,
            Token::Mark(b'\n') => {}
            _ if depth > 0 => {}
            _ => break,
        }
        at += 1;
    }
    at
}

/// Reads what follows `#import`: a path, or `prefix::{a, b::{c}}`, up to the end of the line outside of braces.
fn read_import(tokens: &[(Token<'_>, Range<usize>)], mut at: usize, scan: &mut Scan) -> usize {
    let Scan { paths, unclosed, .. } = scan;
    let mut prefixes: Vec<String> = Vec::new();
    let mut open = 0..0;
    let mut current: Option<(String, Range<usize>)> = None;
    let mut renamed = false;
    let mut flush = |current: &mut Option<(String, Range<usize>)>, prefixes: &[String]| {
        if let Some((text, range)) = current.take() {
            paths.push(Path { text: format!("{}{text}", prefixes.concat()), range, import: true });
        }
    };
    while let Some((token, range)) = tokens.get(at) {
        match token {
            // Nothing of the kind stands in an import.
            Token::Mark(b'@' | b'#' | b';' | b'(' | b'=') if !prefixes.is_empty() => {
                *unclosed = Some(open);
                return at;
            }
            Token::Word(word) if !prefixes.is_empty() && KEYWORDS.contains(word) => {
                *unclosed = Some(open);
                return at;
            }
            Token::Word("as") => renamed = true,
            Token::Word(_) if renamed => renamed = false,
            Token::Word(word) => current = Some(((*word).to_owned(), range.clone())),
            // `::` before a brace is not part of a word.
            Token::Mark(b'{') => {
                let (prefix, _) = current.take().unwrap_or_default();
                open = range.clone();
                prefixes.push(format!("{}::", prefix.trim_end_matches(':')));
            }
            Token::Mark(b'}') => {
                flush(&mut current, &prefixes);
                prefixes.pop();
            }
            Token::Mark(b',') => flush(&mut current, &prefixes),
            Token::Mark(b'\n' | b';') if prefixes.is_empty() => break,
            _ => {}
        }
        at += 1;
    }
    if prefixes.is_empty() {
        flush(&mut current, &prefixes);
    } else {
        *unclosed = Some(open);
    }
    at
}

/// Brackets, signs, templates and `else if` may be nested this deep; parsers of WGSL recurse over them.
const DEEPEST_NESTING: usize = 120;
/// A statement may have this many operators.
const LONGEST_STATEMENT: usize = 4000;

/// The place where a text is nested too deeply to be parsed, and what is.
pub(crate) fn too_deep(text: &str) -> Option<(Range<usize>, &'static str)> {
    let tokens: Vec<_> = tokens(text).into_iter().filter(|(t, _)| *t != Token::Mark(b'\n')).collect();
    let (mut brackets, mut signs, mut templates, mut elses, mut operators) = (0usize, 0usize, 0usize, 0usize, 0usize);
    for (index, (token, range)) in tokens.iter().enumerate() {
        let before = index.checked_sub(1).map(|i| tokens[i].0);
        match token {
            Token::Mark(b'(' | b'[' | b'{') => brackets += 1,
            Token::Mark(b')' | b']' | b'}') => brackets = brackets.saturating_sub(1),
            _ => {}
        }
        signs = if matches!(token, Token::Mark(b'-' | b'!' | b'~' | b'&' | b'*')) { signs + 1 } else { 0 };
        match token {
            Token::Mark(b'<') => templates += 1,
            Token::Mark(b'>' | b';' | b'{' | b'=') => templates = 0,
            _ => {}
        }
        match token {
            Token::Word("else") => elses += 1,
            // An `if` that does not follow `else` starts a new chain.
            Token::Word("if") if before != Some(Token::Word("else")) => elses = 0,
            _ => {}
        }
        operators = match token {
            Token::Mark(b';' | b'{' | b'}') => 0,
            Token::Mark(b'+' | b'-' | b'*' | b'/' | b'%' | b'&' | b'|' | b'^' | b'<' | b'>' | b'.') => operators + 1,
            _ => operators,
        };
        let deepest = [(brackets, "brackets"), (signs, "operators"), (templates, "types"), (elses, "`else` branches")];
        if let Some((_, what)) = deepest.into_iter().find(|(depth, _)| *depth > DEEPEST_NESTING) {
            return Some((range.clone(), what));
        }
        if operators > LONGEST_STATEMENT {
            return Some((range.clone(), "operators"));
        }
    }
    None
}

/// The place of a structure's member.
pub(crate) fn member(text: &str, structure: &str, member: &str) -> Option<Range<usize>> {
    let tokens = tokens(text);
    let start = tokens.windows(3).position(|w| matches!(w[0].0, Token::Word("struct")) && w[1].0 == Token::Word(structure))?;
    let open = start + tokens[start..].iter().position(|(t, _)| *t == Token::Mark(b'{'))?;
    let mut depth = 0;
    for (index, (token, range)) in tokens.iter().enumerate().skip(open) {
        match token {
            Token::Mark(b'{' | b'(' | b'<') => depth += 1,
            Token::Mark(b'}' | b')' | b'>') => {
                depth -= 1;
                if depth == 0 {
                    return None;
                }
            }
            Token::Word(word) if depth == 1 && *word == member => {
                if matches!(tokens.get(index + 1), Some((Token::Mark(b':'), _))) {
                    return Some(range.clone());
                }
            }
            _ => {}
        }
    }
    None
}

/// Maps a byte offset in a text whose imported names were replaced by naga_oil back to the original text. Lines are the same in both.
pub(crate) fn original_offset(original: &str, replaced: &str, offset: usize) -> usize {
    let mut offset = offset.min(replaced.len());
    while !replaced.is_char_boundary(offset) {
        offset -= 1;
    }
    let line_start = replaced[..offset].rfind('\n').map_or(0, |n| n + 1);
    let line = replaced[..line_start].matches('\n').count();
    let column = offset - line_start;
    let new_line = replaced[line_start..].lines().next().unwrap_or("");
    let mut start = 0;
    for _ in 0..line {
        match original[start..].find('\n') {
            Some(n) => start += n + 1,
            None => return original.len(),
        }
    }
    let old_line = original[start..].lines().next().unwrap_or("");
    start + original_column(old_line, new_line, column)
}

/// Words correspond one to one: a path in the original is one decorated word in the replaced line.
fn original_column(old: &str, new: &str, column: usize) -> usize {
    let (old_words, new_words) = (words(old), words(new));
    let mut after = (0, 0);
    for (o, n) in old_words.iter().zip(&new_words) {
        if column < n.start {
            break;
        }
        if column < n.end {
            return (o.start + (column - n.start)).min(o.end.saturating_sub(1).max(o.start));
        }
        after = (o.end, n.end);
    }
    (after.0 + (column - after.1)).min(old.len())
}

fn words(line: &str) -> Vec<Range<usize>> {
    let bytes = line.as_bytes();
    let word = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || b >= 0x80;
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        if !word(bytes[at]) {
            at += 1;
            continue;
        }
        let start = at;
        while at < bytes.len()
            && (word(bytes[at])
                || (bytes[at] == b':' && bytes.get(at + 1) == Some(&b':') || (bytes[at] == b':' && at > start && bytes[at - 1] == b':')))
        {
            at += 1;
        }
        found.push(start..at);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn declarations_are_found_outside_of_comments_and_bodies() {
        let text = "// fn no() {}\n/* struct No {} */ struct Yes { a: u32 }\n@group(0) @binding(1) var<storage, read> data: array<Yes>;\nfn f() { var x = 1; }\noverride o: u32 = 1;";
        let scan = scan(text);
        let names: Vec<_> = scan.items.iter().map(|i| (i.keyword, i.name.as_str())).collect();
        assert_eq!(names, [("struct", "Yes"), ("var", "data"), ("fn", "f"), ("override", "o")]);
        assert_eq!(&text[scan.items[1].range.clone()], "data");
        assert_eq!(&text[member(text, "Yes", "a").expect("the member is there")], "a");
    }

    #[test]
    fn imports_are_expanded() {
        let text =
            "#import common::cluster::{Cluster, form_factor as ff}\n#import common::{math, noise::{hash}}\nlet a = common::other::f();";
        let paths: Vec<_> = scan(text).paths.into_iter().map(|p| p.text).collect();
        assert_eq!(
            paths,
            ["common::cluster::Cluster", "common::cluster::form_factor", "common::math", "common::noise::hash", "common::other::f"]
        );
    }

    #[test]
    fn places_survive_replaced_names() {
        let old = "a\nlet x = cluster::area(foo) + bar;";
        let new = "a\nlet x = areaX_naga_oil_mod_XABCX(foo) + bar;";
        for word in ["foo", "bar", "let"] {
            let place = new.find(word).expect("in new");
            assert_eq!(original_offset(old, new, place), old.find(word).expect("in old"), "{word}");
        }
    }
}
