//! Tables, before they become HTML or Markdown.

use maud::{Markup, html};

/// A table of text.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Table {
    pub columns: Vec<Column>,
    pub rows: Vec<Vec<String>>,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Column {
    pub title: String,
    /// It holds numbers, which are set flush right.
    pub number: bool,
}

impl Column {
    pub fn text(title: impl Into<String>) -> Self {
        Self { title: title.into(), number: false }
    }

    pub fn number(title: impl Into<String>) -> Self {
        Self { title: title.into(), number: true }
    }
}

impl Table {
    pub fn html(&self) -> Markup {
        let class = |i: usize| self.columns[i].number.then_some("number");
        html! {
            div.wide { table {
                thead { tr { @for (i, column) in self.columns.iter().enumerate() { th class=[class(i)] { (column.title) } } } }
                tbody {
                    @for row in &self.rows { tr { @for (i, cell) in row.iter().enumerate() { td class=[class(i)] { (cell) } } } }
                }
            } }
        }
    }

    pub fn markdown(&self) -> String {
        let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
        let mut text = line(self.columns.iter().map(|c| escape(&c.title)).collect());
        text += &line(self.columns.iter().map(|c| if c.number { "---:" } else { "---" }.to_owned()).collect());
        text.extend(self.rows.iter().map(|row| line(row.iter().map(|cell| escape(cell)).collect())));
        text
    }
}

/// Text in which Markdown finds nothing but text.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '\\' | '`' | '*' | '_' | '[' | ']' | '<' | '>' | '|' | '#' | '$' | '&' | '~' => escaped.extend(['\\', c]),
            c if c.is_control() => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_stays_text_in_both_forms() {
        let table = Table { columns: vec![Column::text("a|b"), Column::number("<i>")], rows: vec![vec!["<script>".into(), "1\n2".into()]] };
        assert_eq!(table.markdown(), "| a\\|b | \\<i\\> |\n| --- | ---: |\n| \\<script\\> | 1 2 |\n");
        let html = table.html().into_string();
        assert!(html.contains("<td>&lt;script&gt;</td>") && html.contains("<th class=\"number\">&lt;i&gt;</th>"), "{html}");
    }
}
