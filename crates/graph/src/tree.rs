//! RON text as a tree with a byte range on every value, read with ron2's error-tolerant parser.

use std::{ops::Range, sync::Arc};

use ron2::ast::{self, Expr, NumberKind, StructBody};

use crate::diagnostics::{Diagnostic, Source, Span};

/// Brackets nested deeper than this are refused before parsing.
const DEEPEST_NESTING: usize = 96;

/// A value.
#[derive(Debug)]
pub struct Tree {
    /// What it is.
    pub kind: Kind,
    /// Its bytes in the source.
    pub range: Range<usize>,
}

/// A name with its place.
#[derive(Debug, Clone)]
pub struct Name {
    /// The name.
    pub text: String,
    /// Its bytes in the source.
    pub range: Range<usize>,
}

/// What a value is.
#[derive(Debug)]
pub enum Kind {
    /// `true` or `false`.
    Bool(bool),
    /// A number.
    Number {
        /// As written, without `_`.
        raw: String,
        /// Whether it has a fraction or exponent.
        real: bool,
    },
    /// A string in quotes.
    Text(String),
    /// A bare identifier: `Full`.
    Name(String),
    /// `[a, b]`.
    List(Vec<Tree>),
    /// `{key: value}`.
    Map(Vec<(Tree, Tree)>),
    /// `(a, b)` or `Name(a, b)`; also `()` and `Name()`.
    Tuple(Option<Name>, Vec<Tree>),
    /// `(a: 1)` or `Name(a: 1)`.
    Record(Option<Name>, Vec<(Name, Tree)>),
    /// Something that RON knows and we do not use: characters, bytes.
    Other(&'static str),
    /// A syntax error stood here; it is already reported.
    Broken,
}

impl Kind {
    /// For "found …".
    pub fn describe(&self) -> String {
        match self {
            Self::Bool(_) => "a boolean".into(),
            Self::Number { .. } => "a number".into(),
            Self::Text(_) => "a string".into(),
            Self::Name(name) => format!("the name `{name}`"),
            Self::List(_) => "a list `[…]`".into(),
            Self::Map(_) => "a map `{…}`".into(),
            Self::Tuple(None, _) | Self::Record(None, _) => "a group `(…)`".into(),
            Self::Tuple(Some(name), _) | Self::Record(Some(name), _) => format!("`{}(…)`", name.text),
            Self::Other(what) => (*what).into(),
            Self::Broken => "nothing".into(),
        }
    }
}

/// The keys of a map that are strings.
pub(crate) fn keys(tree: &Tree) -> Vec<String> {
    let Kind::Map(entries) = &tree.kind else { return Vec::new() };
    entries.iter().filter_map(|(key, _)| if let Kind::Text(text) = &key.kind { Some(text.clone()) } else { None }).collect()
}

/// Parses a document. When the syntax has faults, they go to `out` and there is no tree: what else is wrong may follow from them.
pub(crate) fn parse(source: &Arc<Source>, out: &mut Vec<Diagnostic>) -> Option<Tree> {
    let text: &str = &source.text;
    if let Err(fault) = check_brackets(source) {
        out.push(fault);
        return None;
    }
    let (document, errors) = ast::parse_document_lossy(text);
    let broken = !errors.is_empty();
    let mut last_line = 0;
    for error in errors {
        let span = error.span();
        // Recovery may stumble again over the same or the next line: that follows from the first fault.
        let (line, _) = source.place(span.start_offset);
        if last_line != 0 && line <= last_line + 1 {
            last_line = line.max(last_line);
            continue;
        }
        last_line = line;
        out.push(Diagnostic::error(message(&error), Span::new(source, span.start_offset..span.end_offset.max(span.start_offset))));
    }
    if broken {
        return None;
    }
    if document.value.is_none() {
        out.push(
            Diagnostic::error("the file is empty", Span::new(source, 0..0)).help("see the other files of its folder for what belongs here"),
        );
    }
    document.value.as_ref().map(tree)
}

fn message(error: &ron2::Error) -> String {
    let text = error.kind().to_string();
    let mut chars = text.chars();
    let lower: String = chars.next().map(|first| first.to_lowercase().chain(chars).collect()).unwrap_or_default();
    let text = lower.trim_end_matches('.').replace("closing `)` or `}`", "closing `)`").replace("after map key", "after the key");
    // Brackets are known to match, so what is missing before a closing one is a comma.
    text.replace("expected closing", "expected a comma or the closing")
}

fn range(span: &ron2::Span) -> Range<usize> {
    span.start_offset..span.end_offset.max(span.start_offset)
}

fn tree(expr: &Expr<'_>) -> Tree {
    let kind = match expr {
        Expr::Unit(_) => Kind::Tuple(None, Vec::new()),
        Expr::Bool(b) => Kind::Bool(b.value),
        Expr::Char(_) => Kind::Other("a character"),
        Expr::Byte(_) | Expr::Bytes(_) => Kind::Other("bytes"),
        Expr::Number(n) => {
            Kind::Number { raw: n.raw.replace('_', ""), real: matches!(n.kind, NumberKind::Float | NumberKind::SpecialFloat) }
        }
        Expr::String(s) => Kind::Text(s.value.clone()),
        Expr::Option(option) => match &option.value {
            Some(inner) => return tree(&inner.expr),
            None => Kind::Name("None".into()),
        },
        Expr::Seq(seq) => Kind::List(seq.items.iter().map(|item| tree(&item.expr)).collect()),
        Expr::Map(map) => Kind::Map(map.entries.iter().map(|entry| (tree(&entry.key), tree(&entry.value))).collect()),
        Expr::Tuple(tuple) => Kind::Tuple(None, tuple.elements.iter().map(|e| tree(&e.expr)).collect()),
        Expr::AnonStruct(anon) => Kind::Record(None, anon.fields.iter().map(field).collect()),
        Expr::Struct(named) => match &named.body {
            None => Kind::Name(plain(&named.name.name)),
            Some(StructBody::Tuple(t)) => Kind::Tuple(Some(name(&named.name)), t.elements.iter().map(|e| tree(&e.expr)).collect()),
            Some(StructBody::Fields(f)) => Kind::Record(Some(name(&named.name)), f.fields.iter().map(field).collect()),
        },
        Expr::Error(_) => Kind::Broken,
    };
    Tree { kind, range: range(expr.span()) }
}

fn name(ident: &ast::Ident<'_>) -> Name {
    Name { text: plain(&ident.name), range: range(&ident.span) }
}

fn plain(name: &str) -> String {
    name.strip_prefix("r#").unwrap_or(name).to_owned()
}

fn field(field: &ast::StructField<'_>) -> (Name, Tree) {
    (name(&field.name), tree(&field.value))
}

/// Refuses texts whose brackets do not match or nest too deeply: nothing that a parser says after that is of use.
fn check_brackets(source: &Arc<Source>) -> Result<(), Diagnostic> {
    let text = source.text.as_bytes();
    let mut open: Vec<(u8, usize)> = Vec::new();
    let mut at = 0;
    while at < text.len() {
        match text[at] {
            b'"' => at = after_string(text, at, source)?,
            b'r' if !follows_word(text, at) => at = after_raw_string(text, at),
            b'\'' => at = after_char(text, at),
            b'/' if text.get(at + 1) == Some(&b'/') => at = find(text, at, b"\n").unwrap_or(text.len()),
            b'/' if text.get(at + 1) == Some(&b'*') => at = after_comment(text, at),
            bracket @ (b'(' | b'[' | b'{') => {
                open.push((bracket, at));
                if open.len() > DEEPEST_NESTING {
                    return Err(Diagnostic::error(
                        format!("brackets are nested more than {DEEPEST_NESTING} deep"),
                        Span::new(source, at..at + 1),
                    ));
                }
                at += 1;
            }
            bracket @ (b')' | b']' | b'}') => {
                let wanted = match bracket {
                    b')' => b'(',
                    b']' => b'[',
                    _ => b'{',
                };
                match open.pop() {
                    Some((opened, _)) if opened == wanted => {}
                    Some((opened, start)) => {
                        return Err(Diagnostic::error(
                            format!("`{}` is closed by `{}`", char::from(opened), char::from(bracket)),
                            Span::new(source, at..at + 1),
                        )
                        .at(format!("expected `{}`", closing(opened)))
                        .and(Span::new(source, start..start + 1), "opened here"));
                    }
                    None => {
                        return Err(Diagnostic::error(format!("`{}` closes nothing", char::from(bracket)), Span::new(source, at..at + 1))
                            .help("remove it, or open the bracket that it belongs to"));
                    }
                }
                at += 1;
            }
            _ => at += 1,
        }
    }
    match open.pop() {
        None => Ok(()),
        Some((opened, start)) => {
            Err(Diagnostic::error(format!("`{}` is never closed", char::from(opened)), Span::new(source, start..start + 1))
                .at("opened here")
                .and(Span::new(source, text.len()..text.len()), "the file ends here")
                .help(format!("add the missing `{}`", closing(opened))))
        }
    }
}

fn closing(opened: u8) -> char {
    match opened {
        b'(' => ')',
        b'[' => ']',
        _ => '}',
    }
}

fn find(text: &[u8], from: usize, what: &[u8]) -> Option<usize> {
    text[from..].windows(what.len()).position(|w| w == what).map(|n| from + n)
}

fn follows_word(text: &[u8], at: usize) -> bool {
    at > 0 && (text[at - 1].is_ascii_alphanumeric() || text[at - 1] == b'_')
}

fn after_string(text: &[u8], start: usize, source: &Arc<Source>) -> Result<usize, Diagnostic> {
    let mut at = start + 1;
    while at < text.len() {
        match text[at] {
            b'\\' => at += 2,
            b'"' => return Ok(at + 1),
            _ => at += 1,
        }
    }
    Err(Diagnostic::error("the string is never closed", Span::new(source, start..start + 1)).at("opened here").help("add the missing `\"`"))
}

fn after_raw_string(text: &[u8], start: usize) -> usize {
    let hashes = text[start + 1..].iter().take_while(|b| **b == b'#').count();
    if text.get(start + 1 + hashes) != Some(&b'"') {
        return start + 1;
    }
    let mut end = vec![b'"'];
    end.extend(std::iter::repeat_n(b'#', hashes));
    find(text, start + 2 + hashes, &end).map_or(text.len(), |at| at + end.len())
}

fn after_char(text: &[u8], start: usize) -> usize {
    // 'x' or '\x': at most a few bytes; anything else is left to the parser.
    let skip = if text.get(start + 1) == Some(&b'\\') { 3 } else { 2 };
    match text.get(start + skip..(start + skip + 9).min(text.len())).and_then(|rest| rest.iter().position(|b| *b == b'\'')) {
        Some(n) if n <= 8 => start + skip + n + 1,
        _ => start + 1,
    }
}

fn after_comment(text: &[u8], start: usize) -> usize {
    let mut depth = 0;
    let mut at = start;
    while at + 1 < text.len() {
        match (text[at], text[at + 1]) {
            (b'/', b'*') => {
                depth += 1;
                at += 2;
            }
            (b'*', b'/') => {
                depth -= 1;
                at += 2;
                if depth == 0 {
                    return at;
                }
            }
            _ => at += 1,
        }
    }
    text.len()
}
