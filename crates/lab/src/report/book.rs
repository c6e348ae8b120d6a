//! The report as a short page of the book.

use std::collections::HashSet;

use super::{
    claims,
    figures::{self, Figure},
    heading::Heading,
    papers,
    study::{EMPTY, REFUSED, Study},
    table::escape,
    tables,
};
use crate::{record::Record, sheet::Sheet};

/// A page of the book and the files that it shows.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct BookPage {
    /// Markdown; it shows the figures by their file names.
    pub text: String,
    /// File names, each once, and SVG documents, to be written beside the page.
    pub figures: Vec<(String, String)>,
}

/// The report as a page of the book: what was asked, on what, error against time, stages, runs, papers.
pub fn markdown(sheet: &Sheet, records: &[Record]) -> BookPage {
    let study = Study::new(sheet, records);
    let mut page = BookPage { text: format!("# {}\n", escape(&sheet.name)), figures: Vec::new() };
    for paragraph in study.doc() {
        page.paragraph(&escape(paragraph));
    }
    if records.is_empty() {
        page.paragraph(EMPTY);
        return page;
    }
    let heading = Heading::of(&study);
    page.paragraph(&heading.facts.iter().map(|(what, value)| format!("- {what}: {}", escape(value))).collect::<Vec<_>>().join("\n"));
    for warning in &heading.warnings {
        page.paragraph(&format!("**{}**", escape(warning)));
    }
    let mut metrics = study.metrics();
    if sheet.metrics.is_empty() {
        metrics.retain(|name| *name == sheet.metric);
    }
    for group in &study.groups {
        page.paragraph(&format!("## {}", escape(&group.title())));
        for verdict in claims::verdicts(&study, group) {
            page.paragraph(&escape(&verdict));
        }
        page.figure(sheet, &figures::scatter(&study, group));
        page.paragraph(tables::runs(&study, group, &metrics).markdown().trim_end());
        page.paragraph(&escape(&tables::front_note(&study)));
        for figure in figures::stages(&study, group) {
            page.figure(sheet, &figure);
        }
    }
    if !sheet.refused.is_empty() {
        page.paragraph("## Left out");
        let lines = sheet.refused.iter().map(|(run, reason)| format!("- {}: {}", escape(run), escape(reason)));
        page.paragraph(&format!("{REFUSED}\n\n{}", lines.collect::<Vec<_>>().join("\n")));
    }
    let papers: Vec<_> = sheet.papers.iter().flat_map(|paper| papers::tables(&study, paper)).collect();
    for (title, table) in &papers {
        page.paragraph(&format!("## {}", escape(title)));
        page.paragraph(table.markdown().trim_end());
    }
    if !papers.is_empty() {
        page.paragraph(papers::NOTE);
    }
    page
}

impl BookPage {
    fn paragraph(&mut self, text: &str) {
        self.text += &format!("\n{text}\n");
    }

    /// Shows a figure with its notes under a file name that is new.
    fn figure(&mut self, sheet: &Sheet, figure: &Figure) {
        if let Some(svg) = &figure.svg {
            let stem = file_stem(&format!("{} {}", sheet.name, figure.name));
            let taken: HashSet<&str> = self.figures.iter().map(|f| f.0.as_str()).collect();
            let names = (1..).map(|n| if n == 1 { format!("{stem}.svg") } else { format!("{stem}-{n}.svg") });
            let name = names.into_iter().find(|name| !taken.contains(name.as_str())).unwrap_or_default();
            self.paragraph(&format!("![{}]({name})", escape(&figure.caption)));
            self.figures.push((name, svg.clone()));
        }
        for note in &figure.notes {
            self.paragraph(&escape(note));
        }
    }
}

/// Small letters, digits and single hyphens.
fn file_stem(text: &str) -> String {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
}
