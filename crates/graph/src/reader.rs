//! Reads values out of a [`Tree`] and says what is wrong with them: unknown, missing and repeated fields, wrong types.

use std::{ops::Range, sync::Arc};

use crate::{
    diagnostics::{Diagnostic, Source, Span},
    render::suggest,
    tree::{self, Kind, Name, Tree},
};

/// A text with its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spanned {
    /// The text.
    pub text: String,
    /// Where it stands.
    pub span: Span,
}

/// Collects the faults of one file.
pub struct Reader {
    /// The file.
    pub source: Arc<Source>,
    /// Its faults so far.
    pub out: Vec<Diagnostic>,
}

/// Fields of a record.
pub struct Fields<'t> {
    found: Vec<(&'t Name, &'t Tree)>,
    /// Fields that were meant, but are misspelt.
    meant: Vec<&'static str>,
}

impl<'t> Fields<'t> {
    /// The value of a field, if it is there.
    pub fn get(&self, name: &str) -> Option<&'t Tree> {
        self.found.iter().find(|(n, _)| n.text == name).map(|(_, tree)| *tree)
    }

    /// Whether the field is there, be it misspelt.
    pub fn tried(&self, name: &str) -> bool {
        self.get(name).is_some() || self.meant.contains(&name)
    }
}

/// What a record must and may have.
pub struct Shape {
    /// The word for it in messages.
    pub what: &'static str,
    /// Fields that must be there.
    pub required: &'static [&'static str],
    /// Fields that may be there.
    pub optional: &'static [&'static str],
}

impl Reader {
    /// Parses the source; the tree is `None` when the syntax has faults, which are in [`Reader::out`].
    pub fn open(source: &Arc<Source>) -> (Self, Option<Tree>) {
        let mut out = Vec::new();
        let tree = tree::parse(source, &mut out);
        (Self { source: Arc::clone(source), out }, tree)
    }

    /// A place in the file.
    pub fn span(&self, range: &Range<usize>) -> Span {
        Span::new(&self.source, range.clone())
    }

    /// Adds a fault; an empty help is left out.
    pub fn error(&mut self, range: &Range<usize>, message: impl Into<String>, help: impl Into<String>) {
        let help = help.into();
        let mut fault = Diagnostic::error(message, self.span(range));
        if !help.is_empty() {
            fault = fault.help(help);
        }
        self.out.push(fault);
    }

    /// "expected a, found b", unless a syntax error stands there.
    pub fn expected(&mut self, tree: &Tree, what: &str, help: &str) {
        if !matches!(tree.kind, Kind::Broken) {
            self.error(&head(tree), format!("expected {what}, found {}", tree.kind.describe()), help);
        }
    }

    /// A string in quotes.
    pub fn text(&mut self, tree: &Tree, what: &str) -> Option<Spanned> {
        match &tree.kind {
            Kind::Text(text) => Some(Spanned { text: text.clone(), span: self.span(&tree.range) }),
            Kind::Name(name) => {
                self.error(&tree.range, format!("expected {what}, found the name `{name}`"), format!("write it in quotes: \"{name}\""));
                None
            }
            _ => {
                self.expected(tree, what, "");
                None
            }
        }
    }

    /// `true` or `false`.
    pub fn boolean(&mut self, tree: &Tree) -> Option<bool> {
        match tree.kind {
            Kind::Bool(value) => Some(value),
            _ => {
                self.expected(tree, "`true` or `false`", "");
                None
            }
        }
    }

    /// A whole number of 64 bits.
    pub fn int(&mut self, tree: &Tree, what: &str) -> Option<i64> {
        match &tree.kind {
            Kind::Number { raw, real: false } => {
                let value = parse_int(raw);
                if value.is_none() {
                    self.error(&tree.range, format!("the number {raw} is too large"), "whole numbers have 64 bits");
                }
                value
            }
            Kind::Number { raw, .. } => {
                self.error(&tree.range, format!("expected {what}, found {raw}"), "write a number without fraction and exponent");
                None
            }
            _ => {
                self.expected(tree, what, "");
                None
            }
        }
    }

    /// A finite number, with or without a fraction.
    pub fn float(&mut self, tree: &Tree, what: &str) -> Option<f64> {
        match &tree.kind {
            Kind::Number { raw, .. } => {
                let value = parse_int(raw).map(|v| v as f64).or_else(|| raw.parse().ok()).filter(|v: &f64| v.is_finite());
                if value.is_none() {
                    self.error(&tree.range, format!("`{raw}` is no finite number"), "");
                }
                value
            }
            _ => {
                self.expected(tree, what, "");
                None
            }
        }
    }

    /// The items of a list; none when it is no list.
    pub fn list<'t>(&mut self, tree: &'t Tree, what: &str) -> &'t [Tree] {
        match &tree.kind {
            Kind::List(items) => items,
            _ => {
                self.expected(tree, &format!("a list of {what}"), "write it in brackets: [ … ]");
                &[]
            }
        }
    }

    /// A map whose keys are strings; repeated keys are reported and left out.
    pub fn map<'t>(&mut self, tree: &'t Tree, what: &str) -> Vec<(Spanned, &'t Tree)> {
        let Kind::Map(entries) = &tree.kind else {
            self.expected(tree, &format!("a map of {what}"), "write it in braces: { \"name\": … }");
            return Vec::new();
        };
        let mut found: Vec<(Spanned, &Tree)> = Vec::with_capacity(entries.len());
        for (key, value) in entries {
            let Some(key) = self.text(key, "a name in quotes") else { continue };
            if let Some((first, _)) = found.iter().find(|(k, _)| k.text == key.text) {
                let first = first.span.clone();
                self.out.push(
                    Diagnostic::error(format!("`{}` is given twice", key.text), key.span)
                        .and(first, "first given here")
                        .help("remove or rename one of them"),
                );
                continue;
            }
            found.push((key, value));
        }
        found
    }

    /// A record with known fields. `None` only when the value is no record at all.
    pub fn record<'t>(&mut self, tree: &'t Tree, shape: &Shape) -> Option<Fields<'t>> {
        let Shape { what, required, optional } = *shape;
        let fields = match &tree.kind {
            Kind::Record(_, fields) => fields.as_slice(),
            Kind::Tuple(_, items) if items.is_empty() => &[],
            Kind::Name(_) => &[],
            Kind::Tuple(_, items) => {
                let names: Vec<String> = optional.iter().chain(required).map(|name| format!("`{name}: …`")).collect();
                self.error(
                    &items[0].range,
                    format!("{what} takes named fields"),
                    format!("put the name before the value: {}", names.join(", ")),
                );
                return None;
            }
            _ => {
                self.expected(tree, what, "");
                return None;
            }
        };
        let mut found: Vec<(&Name, &Tree)> = Vec::with_capacity(fields.len());
        for (name, value) in fields {
            let all = required.iter().chain(optional).copied();
            if !all.clone().any(|known| known == name.text) {
                self.error(&name.range, format!("unknown field `{}` in {what}", name.text), suggest(&name.text, all));
            } else if let Some((first, _)) = found.iter().find(|(n, _)| n.text == name.text) {
                let first = self.span(&first.range);
                let span = self.span(&name.range);
                self.out.push(
                    Diagnostic::error(format!("`{}` is given twice", name.text), span)
                        .and(first, "first given here")
                        .help("remove one of them"),
                );
            } else {
                found.push((name, value));
            }
        }
        let all = || required.iter().chain(optional).copied();
        let strangers = fields.iter().map(|(name, _)| name.text.as_str()).filter(|name| !all().any(|k| k == *name));
        let meant: Vec<&str> = strangers.filter_map(|name| crate::render::nearest(name, all())).collect();
        for name in required {
            if !found.iter().any(|(n, _)| n.text == *name) && !meant.contains(name) {
                self.error(&head(tree), format!("missing field `{name}` in {what}"), format!("add `{name}: …`"));
            }
        }
        Some(Fields { found, meant })
    }
}

/// The place to point at for a whole value: the name of a record, or its opening bracket.
pub fn head(tree: &Tree) -> Range<usize> {
    match &tree.kind {
        Kind::Record(Some(name), _) | Kind::Tuple(Some(name), _) => name.range.clone(),
        Kind::Record(None, _) | Kind::Tuple(None, _) => tree.range.start..(tree.range.start + 1).min(tree.range.end),
        _ => tree.range.clone(),
    }
}

fn parse_int(raw: &str) -> Option<i64> {
    let (sign, digits) = match raw.strip_prefix('-') {
        Some(rest) => (-1, rest),
        None => (1, raw.strip_prefix('+').unwrap_or(raw)),
    };
    let lower = digits.to_ascii_lowercase();
    let value = match lower.as_bytes() {
        [b'0', b'x', ..] => i128::from_str_radix(&lower[2..], 16),
        [b'0', b'b', ..] => i128::from_str_radix(&lower[2..], 2),
        [b'0', b'o', ..] => i128::from_str_radix(&lower[2..], 8),
        _ => lower.parse(),
    };
    i64::try_from(sign * value.ok()?).ok()
}
