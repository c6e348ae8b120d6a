//! Tables of text with aligned columns.

/// Rows of cells; the first column is aligned left, the others right or left as said.
pub struct Table {
    left: Vec<bool>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// With a heading; `left[i]` says whether column i is aligned left.
    pub fn new(heading: &[(&str, bool)]) -> Self {
        let cells = heading.iter().map(|(name, _)| (*name).to_owned()).collect();
        Self { left: heading.iter().map(|(_, left)| *left).collect(), rows: vec![cells] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<String>) {
        self.rows.push(cells);
    }

    /// The text, a line a row, without spaces at the ends of lines.
    pub fn render(&self) -> String {
        let width = |column: usize| self.rows.iter().filter_map(|r| r.get(column)).map(|c| c.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.left.len()).map(width).collect();
        let mut text = String::new();
        for row in &self.rows {
            let cells = row
                .iter()
                .zip(&widths)
                .zip(&self.left)
                .map(|((cell, width), left)| if *left { format!("{cell:<width$}") } else { format!("{cell:>width$}") });
            text.push_str(cells.collect::<Vec<_>>().join("  ").trim_end());
            text.push('\n');
        }
        text
    }
}

/// Bytes for people.
pub fn bytes(bytes: u64) -> String {
    let value = bytes as f64;
    match bytes {
        0..1024 => format!("{bytes} B"),
        1024..0x10_0000 => format!("{:.1} KiB", value / 1024.0),
        0x10_0000..0x4000_0000 => format!("{:.1} MiB", value / f64::from(0x10_0000)),
        _ => format!("{:.2} GiB", value / f64::from(0x4000_0000)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_aligned() {
        let mut table = Table::new(&[("node", true), ("ms", false)]);
        table.row(vec!["pull_push".into(), "1.5".into()]);
        table.row(vec!["ism".into(), "10.25".into()]);
        assert_eq!(table.render(), "node          ms\npull_push    1.5\nism        10.25\n");
    }

    #[test]
    fn sizes_are_rounded() {
        assert_eq!([0, 1023, 1024, 64 << 20].map(bytes), ["0 B", "1023 B", "1.0 KiB", "64.0 MiB"]);
    }
}
