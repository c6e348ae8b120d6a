//! A reader of JSON, for the records of tests, for cargo's metadata and for the manifests of Vulkan drivers.

use std::{iter::Peekable, str::Chars};

/// A JSON value. Objects keep their order.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// `null`, `true` and `false`, by their word.
    Word(String),
    /// Any number.
    Number(f64),
    /// Without its escapes.
    Text(String),
    /// In square brackets.
    Array(Vec<Value>),
    /// In curly ones.
    Object(Vec<(String, Value)>),
}

impl Value {
    /// The value that a text is; `None` when it is not JSON.
    pub fn parse(text: &str) -> Option<Self> {
        let mut letters = text.chars().peekable();
        let value = value(&mut letters)?;
        space(&mut letters);
        letters.next().is_none().then_some(value)
    }

    /// The value of a key of this object.
    pub fn get(&self, key: &str) -> Option<&Self> {
        match self {
            Self::Object(entries) => entries.iter().find(|(name, _)| name == key).map(|(_, value)| value),
            _ => None,
        }
    }

    /// The first text of that key, here or further in.
    pub fn find_text(&self, key: &str) -> Option<&str> {
        let further: Vec<&Self> = match self {
            Self::Object(entries) => entries.iter().map(|(_, value)| value).collect(),
            Self::Array(values) => values.iter().collect(),
            _ => Vec::new(),
        };
        self.get(key).and_then(Self::text).or_else(|| further.into_iter().find_map(|value| value.find_text(key)))
    }

    /// The text, if that is what it is.
    pub fn text(&self) -> Option<&str> {
        if let Self::Text(text) = self { Some(text) } else { None }
    }

    /// The number, if that is what it is.
    pub fn number(&self) -> Option<f64> {
        if let Self::Number(number) = self { Some(*number) } else { None }
    }
}

fn value(letters: &mut Peekable<Chars<'_>>) -> Option<Value> {
    space(letters);
    match *letters.peek()? {
        '{' => {
            let entry = |letters: &mut Peekable<Chars<'_>>| {
                space(letters);
                let name = text(letters)?;
                space(letters);
                (letters.next()? == ':').then(|| value(letters)).flatten().map(|value| (name, value))
            };
            list(letters, '}', entry).map(Value::Object)
        }
        '[' => list(letters, ']', value).map(Value::Array),
        '"' => text(letters).map(Value::Text),
        _ => {
            let mut word = String::new();
            while let Some(letter) = letters.next_if(|c| c.is_ascii_alphanumeric() || "+-.".contains(*c)) {
                word.push(letter);
            }
            match word.as_str() {
                "null" | "true" | "false" => Some(Value::Word(word)),
                number => number.parse().ok().map(Value::Number),
            }
        }
    }
}

/// What is between brackets, with commas between.
fn list<T>(letters: &mut Peekable<Chars<'_>>, end: char, item: impl Fn(&mut Peekable<Chars<'_>>) -> Option<T>) -> Option<Vec<T>> {
    letters.next()?;
    space(letters);
    let mut items = Vec::new();
    if letters.next_if_eq(&end).is_some() {
        return Some(items);
    }
    loop {
        items.push(item(letters)?);
        space(letters);
        match letters.next()? {
            ',' => {}
            letter if letter == end => return Some(items),
            _ => return None,
        }
    }
}

fn text(letters: &mut Peekable<Chars<'_>>) -> Option<String> {
    if letters.next()? != '"' {
        return None;
    }
    let mut result = String::new();
    loop {
        match letters.next()? {
            '"' => return Some(result),
            '\\' => match letters.next()? {
                'n' => result.push('\n'),
                't' => result.push('\t'),
                'r' => result.push('\r'),
                'b' => result.push('\u{8}'),
                'f' => result.push('\u{c}'),
                'u' => {
                    let digits: String = letters.by_ref().take(4).collect();
                    // Halves of a pair beyond the first plane stand for nothing by themselves.
                    result.push(char::from_u32(u32::from_str_radix(&digits, 16).ok()?).unwrap_or(char::REPLACEMENT_CHARACTER));
                }
                escaped @ ('\\' | '"' | '/') => result.push(escaped),
                _ => return None,
            },
            letter => result.push(letter),
        }
    }
}

fn space(letters: &mut Peekable<Chars<'_>>) {
    while letters.next_if(char::is_ascii_whitespace).is_some() {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read() {
        let text = r#" [ {"a": -1.5e-3, "b": [], "c": {"d": "\"x\u0041\\"}}, null, true ] "#;
        let Some(Value::Array(values)) = Value::parse(text) else { panic!("{text} is an array") };
        assert_eq!(values[0].get("a").and_then(Value::number), Some(-1.5e-3));
        assert_eq!(values[0].get("b"), Some(&Value::Array(Vec::new())));
        assert_eq!(values[0].find_text("d"), Some("\"xA\\"));
        assert_eq!(values[0].find_text("e"), None);
        assert_eq!(values[1..], [Value::Word("null".to_owned()), Value::Word("true".to_owned())]);
    }

    #[test]
    fn a_path_of_windows_is_unescaped() {
        let text = r#"{"packages": [], "target_directory" : "C:\\work\/target", "x": 1}"#;
        assert_eq!(Value::parse(text).as_ref().and_then(|v| v.find_text("target_directory")), Some("C:\\work/target"));
    }

    #[test]
    fn what_is_no_json_is_none() {
        for text in ["", "{", r#"{"cut": "off"#, "[1 2]", "[1,]", "{1: 2}", "nul", r#""\x""#, "[] []"] {
            assert_eq!(Value::parse(text), None, "{text}");
        }
    }
}
