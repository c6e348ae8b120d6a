//! Parameters: reading their declarations, checking values, fitting one into another.

use indexmap::IndexMap;

use crate::{
    reader::{Reader, Shape, Spanned},
    registry::Param,
    render::suggest,
    tree::{Kind, Tree},
    value::{ParamKind, Value},
};

/// A value as written in a document, before it is known what it is for.
#[derive(Debug, Clone, PartialEq)]
pub enum Literal {
    /// A whole number.
    Int(i64),
    /// A number with a fraction.
    Float(f64),
    /// `true` or `false`.
    Bool(bool),
    /// A name in quotes.
    Text(String),
}

impl ParamKind {
    /// What values it takes, for messages: `a whole number from 16 to 512`.
    pub fn describe(&self) -> String {
        match self {
            Self::Int { min, max, .. } => format!("a whole number from {min} to {max}"),
            Self::Float { min, max, .. } => format!("a number from {min:?} to {max:?}"),
            Self::Bool { .. } => "true or false".into(),
            Self::Choice { options, .. } => format!("one of {}", quoted(options)),
        }
    }

    /// The word for its type.
    pub fn type_name(&self) -> &'static str {
        match self {
            Self::Int { .. } => "Int",
            Self::Float { .. } => "Float",
            Self::Bool { .. } => "Bool",
            Self::Choice { .. } => "Choice",
        }
    }

    /// Whether it is a choice of `auto`, `on` and `off`, as `Switch("…", …)` conditions test it.
    pub fn is_switch(&self) -> bool {
        matches!(self, Self::Choice { options, .. } if options.len() == SWITCH.len() && SWITCH.iter().all(|s| options.iter().any(|o| o == s)))
    }

    /// Reads a value given as text (`--set clusters=128`).
    ///
    /// # Errors
    /// The remedy, when the text is of the wrong type, out of range or no option.
    pub fn parse(&self, text: &str) -> Result<Value, String> {
        let literal = match self {
            Self::Int { .. } => text.trim().parse().map(Literal::Int).ok(),
            Self::Float { .. } => text.trim().parse().map(Literal::Float).ok(),
            Self::Bool { .. } => match text.trim() {
                "true" | "on" | "1" => Some(Literal::Bool(true)),
                "false" | "off" | "0" => Some(Literal::Bool(false)),
                _ => None,
            },
            Self::Choice { .. } => Some(Literal::Text(text.to_owned())),
        };
        literal.ok_or_else(|| format!("it takes {}", self.describe())).and_then(|literal| self.accept(&literal))
    }

    /// The value that a literal stands for.
    ///
    /// # Errors
    /// The remedy, when the literal is of the wrong type, out of range or no option.
    pub fn accept(&self, literal: &Literal) -> Result<Value, String> {
        let value = match (self, literal) {
            (Self::Int { min, max, .. }, Literal::Int(v)) if (min..=max).contains(&v) => Value::Int(*v),
            (Self::Float { min, max, .. }, Literal::Float(v)) if (min..=max).contains(&v) => Value::Float(*v),
            (Self::Float { min, max, .. }, Literal::Int(v)) if (*min..=*max).contains(&(*v as f64)) => Value::Float(*v as f64),
            (Self::Bool { .. }, Literal::Bool(v)) => Value::Bool(*v),
            (Self::Choice { options, .. }, Literal::Text(v)) if options.contains(v) => Value::Choice(v.clone()),
            (Self::Choice { options, .. }, Literal::Text(v)) => {
                let near = crate::render::nearest(v, options.iter().map(String::as_str));
                let hint = near.map(|n| format!("; did you mean `{n}`?")).unwrap_or_default();
                return Err(format!("it takes {}{hint}", self.describe()));
            }
            _ => return Err(format!("it takes {}", self.describe())),
        };
        Ok(value)
    }

    /// Whether every value of `self` is a value of `wider`; if not, why.
    pub(crate) fn fits_into(&self, wider: &Self) -> Result<(), String> {
        match (self, wider) {
            (Self::Int { min, max, .. }, Self::Int { min: low, max: high, .. }) if min < low || max > high => {
                Err(format!("its range {min} to {max} is wider than {low} to {high}"))
            }
            (Self::Float { min, max, .. }, Self::Float { min: low, max: high, .. }) if min < low || max > high => {
                Err(format!("its range {min:?} to {max:?} is wider than {low:?} to {high:?}"))
            }
            (Self::Int { min, max, .. }, Self::Float { min: low, max: high, .. }) => {
                if (*min as f64) < *low || (*max as f64) > *high {
                    Err(format!("its range {min} to {max} is wider than {low:?} to {high:?}"))
                } else {
                    Ok(())
                }
            }
            (Self::Choice { options, .. }, Self::Choice { options: known, .. }) => match options.iter().find(|o| !known.contains(o)) {
                Some(odd) => Err(format!("its option `{odd}` is none of {}", quoted(known))),
                None => Ok(()),
            },
            (a, b) if a.type_name() == b.type_name() => Ok(()),
            (a, b) => Err(format!("it is {}, not {}", a.type_name(), b.type_name())),
        }
    }

    /// Whether a parameter of this type can feed one of type `other`, ranges aside.
    pub(crate) fn same_type(&self, other: &Self) -> bool {
        self.type_name() == other.type_name() || matches!((self, other), (Self::Int { .. }, Self::Float { .. }))
    }
}

impl std::fmt::Display for Literal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Int(v) => write!(f, "{v}"),
            Self::Float(v) => write!(f, "{v:?}"),
            Self::Bool(v) => write!(f, "{v}"),
            Self::Text(v) => write!(f, "\"{v}\""),
        }
    }
}

fn quoted(names: &[String]) -> String {
    names.iter().map(|n| format!("`{n}`")).collect::<Vec<_>>().join(", ")
}

/// Reads a value of a parameter, of whatever type; names without quotes are told.
pub fn read_literal(reader: &mut Reader, tree: &Tree) -> Option<Literal> {
    match &tree.kind {
        Kind::Bool(v) => Some(Literal::Bool(*v)),
        Kind::Text(v) => Some(Literal::Text(v.clone())),
        Kind::Number { real: false, .. } => reader.int(tree, "a number").map(Literal::Int),
        Kind::Number { .. } => reader.float(tree, "a number").map(Literal::Float),
        Kind::Name(name) => {
            reader.error(&tree.range, format!("expected a value, found the name `{name}`"), format!("write options in quotes: \"{name}\""));
            None
        }
        _ => {
            reader.expected(tree, "a value: a number, `true`, `false`, or an option in quotes", "");
            None
        }
    }
}

const KINDS: &[&str] = &["Int", "Float", "Bool", "Choice", "Switch"];

/// Options of a switch.
const SWITCH: [&str; 3] = ["auto", "on", "off"];

/// No document has more parameters.
const MOST_PARAMS: usize = 1000;

/// Reads `params: {…}`.
pub(crate) fn read_params(reader: &mut Reader, tree: &Tree) -> IndexMap<String, Param> {
    let mut params = IndexMap::new();
    let given = reader.map(tree, "parameters");
    if given.len() > MOST_PARAMS {
        // Checks try every value of every parameter.
        reader.error(&tree.range, format!("there are {} parameters, more than the {MOST_PARAMS} allowed", given.len()), "");
        return params;
    }
    for (name, tree) in given {
        if let Some(param) = read_param(reader, &name, tree) {
            params.insert(name.text, param);
        }
    }
    params
}

fn read_param(reader: &mut Reader, name: &Spanned, tree: &Tree) -> Option<Param> {
    check_identifier(reader, name, "parameter");
    let kind_name = match &tree.kind {
        Kind::Record(Some(n), _) | Kind::Tuple(Some(n), _) => n.text.clone(),
        Kind::Name(n) => n.clone(),
        _ => {
            reader.expected(tree, "a parameter: Int(…), Float(…), Bool(…), Choice(…) or Switch(…)", "");
            return None;
        }
    };
    let range = crate::reader::head(tree);
    let kind = match kind_name.as_str() {
        "Int" => {
            let f = reader.record(tree, &Shape { what: "Int", required: &["min", "max", "default", "doc"], optional: &[] })?;
            let min = f.get("min").map(|t| reader.int(t, "a whole number"));
            let max = f.get("max").map(|t| reader.int(t, "a whole number"));
            let default = f.get("default").map(|t| reader.int(t, "a whole number"));
            let (min, max, default) = (min??, max??, default??);
            check_order(reader, &f, min as f64, max as f64)?;
            ParamKind::Int { min, max, default }
        }
        "Float" => {
            let f = reader.record(tree, &Shape { what: "Float", required: &["min", "max", "default", "doc"], optional: &[] })?;
            let min = f.get("min").map(|t| reader.float(t, "a number"));
            let max = f.get("max").map(|t| reader.float(t, "a number"));
            let default = f.get("default").map(|t| reader.float(t, "a number"));
            let (min, max, default) = (min??, max??, default??);
            check_order(reader, &f, min, max)?;
            ParamKind::Float { min, max, default }
        }
        "Bool" => {
            let f = reader.record(tree, &Shape { what: "Bool", required: &["default", "doc"], optional: &[] })?;
            ParamKind::Bool { default: reader.boolean(f.get("default")?)? }
        }
        "Choice" => {
            let f = reader.record(tree, &Shape { what: "Choice", required: &["options", "default", "doc"], optional: &[] })?;
            let options = read_options(reader, f.get("options")?)?;
            let default = reader.text(f.get("default")?, "an option in quotes")?.text;
            ParamKind::Choice { options, default }
        }
        "Switch" => {
            let f = reader.record(tree, &Shape { what: "Switch", required: &["default", "doc"], optional: &[] })?;
            let default = reader.text(f.get("default")?, "`auto`, `on` or `off` in quotes")?.text;
            ParamKind::Choice { options: SWITCH.map(str::to_owned).to_vec(), default }
        }
        other => {
            reader.error(&range, format!("unknown parameter type `{other}`"), suggest(other, KINDS.iter().copied()));
            return None;
        }
    };
    let fields = match &tree.kind {
        Kind::Record(_, fields) => fields.as_slice(),
        _ => &[],
    };
    let field = |name: &str| fields.iter().find(|(n, _)| n.text == name).map(|(_, t)| t);
    let default = match kind.default_value() {
        Value::Int(v) => Literal::Int(v),
        Value::Float(v) => Literal::Float(v),
        Value::Bool(v) => Literal::Bool(v),
        Value::Choice(v) => Literal::Text(v),
    };
    if let (Err(remedy), Some(place)) = (kind.accept(&default), field("default")) {
        reader.error(&place.range, format!("the default {default} of `{}` is not allowed", name.text), remedy);
        return None;
    }
    let doc = field("doc").and_then(|t| reader.text(t, "a sentence in quotes")).map(|d| d.text).unwrap_or_default();
    Some(Param { kind, doc, span: name.span.clone() })
}

fn check_order(reader: &mut Reader, fields: &crate::reader::Fields<'_>, min: f64, max: f64) -> Option<()> {
    if min <= max {
        return Some(());
    }
    let place = fields.get("max")?.range.clone();
    reader.error(&place, format!("the range is empty: max {max} is below min {min}"), "exchange them");
    None
}

fn read_options(reader: &mut Reader, tree: &Tree) -> Option<Vec<String>> {
    let items = reader.list(tree, "options");
    let mut options: Vec<String> = Vec::with_capacity(items.len());
    for item in items {
        let option = reader.text(item, "an option in quotes")?;
        if options.contains(&option.text) {
            reader.error(&item.range, format!("the option `{}` is listed twice", option.text), "remove one of them");
        } else {
            options.push(option.text);
        }
    }
    if options.is_empty() {
        if matches!(tree.kind, Kind::List(_)) {
            reader.error(&tree.range, "a choice without options", "list at least one option");
        }
        return None;
    }
    Some(options)
}

/// Names are WGSL identifiers: letters, digits and `_`.
pub(crate) fn check_identifier(reader: &mut Reader, name: &Spanned, what: &str) -> bool {
    let mut chars = name.text.chars();
    let first = chars.next().is_some_and(|c| c.is_ascii_alphabetic() || c == '_');
    if !(first && chars.all(|c| c.is_ascii_alphanumeric() || c == '_')) {
        let fault = crate::diagnostics::Diagnostic::error(format!("`{}` is no name for a {what}", name.text), name.span.clone());
        reader.out.push(fault.help("use letters, digits and `_`, not starting with a digit"));
        return false;
    }
    true
}
