//! The report as one HTML page that needs nothing else.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::{
    claims,
    figures::{self, Figure},
    heading::Heading,
    names::{Metric, metric},
    papers,
    pictures::{self, Load},
    study::{EMPTY, Group, REFUSED, Study},
    tables,
    text::printable,
};
use crate::{record::Record, sheet::Sheet};

const STYLE: &str = include_str!("page.css");
/// What the times of stages are, beneath their plots.
const SUMMED: &str = "Numbers are the sums. The time of a stage is the sum of the medians of its nodes; it is that of the frame only if all nodes vary alike.";

/// The report as one HTML page: plots within it as SVG, pictures as data, no script, nothing from elsewhere.
///
/// `pictures` gives the bytes of a PNG file by the name that [`Record::pictures`] has for it; pictures that it does not give are counted
/// in the page.
pub fn html(sheet: &Sheet, records: &[Record], pictures: &dyn Fn(&str) -> Option<Vec<u8>>) -> String {
    let study = Study::new(sheet, records);
    let sections = sections(&study, pictures);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                title { (sheet.name) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (sheet.name) }
                @for paragraph in study.doc() { p { (paragraph) } }
                @if records.is_empty() {
                    p.warning { (EMPTY) }
                } @else {
                    (heading(&Heading::of(&study)))
                    nav { @for section in &sections { a href={ "#" (section.id) } { (section.title) } } }
                }
                @for section in &sections { section id=(section.id) { h2 { (section.title) } (section.body) } }
            }
        }
    };
    printable(&page.into_string())
}

struct Section {
    id: &'static str,
    title: &'static str,
    body: Markup,
}

/// The parts of the page that have something to say.
fn sections(study: &Study<'_>, load: Load<'_>) -> Vec<Section> {
    let mut sections = Vec::new();
    let mut add = |id, title, parts: Vec<Markup>| {
        if !parts.is_empty() {
            sections.push(Section { id, title, body: html! { @for part in parts { (part) } } });
        }
    };
    let groups = || study.groups.iter();
    let all = |figures: Vec<Figure>| -> Vec<Markup> { figures.iter().map(figure).collect() };
    add("claims", "Claims", groups().filter_map(|g| titled(g, claims_of(study, g))).collect());
    add("cost", "Error against time", groups().map(|g| figure(&figures::scatter(study, g))).collect());
    add("stages", "Time by stage", groups().map(|g| stages(study, g)).collect());
    add("knobs", "Over each knob", groups().flat_map(|g| all(figures::knobs(study, g))).collect());
    add("time", "Over scene time", groups().filter_map(|g| sequence(study, g)).collect());
    add("pictures", "Pictures", groups().filter_map(|g| titled(g, pictures::grid(study, g, load))).collect());
    add("papers", "Beside the papers", papers_of(study));
    add("refused", "Left out", refused(study).into_iter().collect());
    let metrics = study.metrics();
    let runs = |g| titled(g, Some(tables::runs(study, g, &metrics).html()));
    add("runs", "All runs", groups().filter_map(runs).chain((!study.records.is_empty()).then(|| explained(study, &metrics))).collect());
    sections
}

fn heading(heading: &Heading) -> Markup {
    html! {
        dl { @for (what, value) in &heading.facts { dt { (what) } dd { (value) } } }
        @for warning in &heading.warnings { p.warning { (warning) } }
    }
}

fn figure(figure: &Figure) -> Markup {
    html! {
        figure {
            @if let Some(svg) = &figure.svg { (PreEscaped(svg)) } @else { figcaption { (figure.caption) ":" } }
            @for note in &figure.notes { figcaption { (note) } }
        }
    }
}

fn stages(study: &Study<'_>, group: &Group<'_>) -> Markup {
    html! {
        @for stages in figures::stages(study, group) { (figure(&stages)) }
        p.note { (SUMMED) }
        (tables::stages(study, group).html())
    }
}

fn sequence(study: &Study<'_>, group: &Group<'_>) -> Option<Markup> {
    let table = tables::sequences(study, group)?;
    Some(html! { @for lines in figures::sequence(study, group) { (figure(&lines)) } (table.html()) })
}

fn titled(group: &Group<'_>, body: Option<Markup>) -> Option<Markup> {
    body.map(|body| html! { h3 { (group.title()) } (body) })
}

/// What the columns of the tables of runs are.
fn explained(study: &Study<'_>, metrics: &[&str]) -> Markup {
    let metrics: Vec<Metric<'_>> = metrics.iter().map(|name| metric(name)).collect();
    html! {
        p.note { (tables::front_note(study)) }
        dl.note { @for metric in &metrics { @if let Some(doc) = metric.doc { dt { (metric.axis) } dd { (doc) } } } }
    }
}

fn claims_of(study: &Study<'_>, group: &Group<'_>) -> Option<Markup> {
    let verdicts = claims::verdicts(study, group);
    (!verdicts.is_empty()).then(|| html! { ul { @for verdict in &verdicts { li { (verdict) } } } })
}

fn refused(study: &Study<'_>) -> Option<Markup> {
    let refused = &study.sheet.refused;
    (!refused.is_empty()).then(|| html! { p { (REFUSED) } ul { @for (run, reason) in refused { li { (run) ": " (reason) } } } })
}

fn papers_of(study: &Study<'_>) -> Vec<Markup> {
    let mut parts = Vec::new();
    for paper in &study.sheet.papers {
        for (title, table) in papers::tables(study, paper) {
            parts.push(html! { h3 { (title) } (table.html()) });
        }
    }
    if !parts.is_empty() {
        parts.push(html! { p.note { (papers::NOTE) } });
    }
    parts
}
