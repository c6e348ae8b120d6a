//! Writes the SVG.

use std::{collections::BTreeMap, fmt::Write as _};

use super::{
    Edge, edges,
    layout::{BOX_HEIGHT, BOX_WIDTH, ROW, layout},
    reason,
};
use crate::plan::Plan;

const MARGIN: f64 = 24.0;
const LINE: f64 = 18.0;
/// Letters that fit in a box.
const LONGEST_LABEL: usize = 26;

pub(super) fn draw(plan: &Plan) -> String {
    let (edges, names) = lines(plan);
    let layout = layout(plan.nodes.len(), &edges);
    let legend = plan.stages().len().max(plan.idle.len() + usize::from(!plan.idle.is_empty())) as f64 * LINE;
    let width = layout.width.max(640.0) + 2.0 * MARGIN;
    let height = layout.height + legend + 3.0 * MARGIN;
    let mut out = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        out,
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0} {height:.0}" width="{width:.0}" height="{height:.0}" font-family="sans-serif">"#
    );
    out.push_str(concat!(
        r##"<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto"><path d="M0 0 8 4 0 8z" fill="#555"/></marker></defs>"##,
        "\n",
        r##"<rect width="100%" height="100%" fill="#fff"/>"##,
        "\n",
    ));
    let mut from_here = BTreeMap::new();
    for ((edge, bends), names) in edges.iter().zip(&layout.bends).zip(&names) {
        let from = (layout.nodes[edge.from].0 + MARGIN, layout.nodes[edge.from].1 + BOX_HEIGHT / 2.0 + MARGIN);
        let to = (layout.nodes[edge.to].0 + MARGIN, layout.nodes[edge.to].1 - BOX_HEIGHT / 2.0 + MARGIN);
        let path = if edge.previous { loop_back(from, to) } else { curve(from, bends, to) };
        let dash = if edge.previous { r#" stroke-dasharray="5 4""# } else { "" };
        let what = format!("{}: {} → {}", names.join(", "), plan.nodes[edge.from].id, plan.nodes[edge.to].id);
        let _ = writeln!(
            out,
            r##"<path d="{path}" fill="none" stroke="#777" stroke-width="1.2"{dash} marker-end="url(#tip)"><title>{}</title></path>"##,
            escape(&what)
        );
        if edge.previous {
            continue;
        }
        // Labels of one node's lines at different heights, so that they lie over each other less.
        let number = from_here.entry(edge.from).or_insert(0u32);
        *number += 1;
        let next = bends.first().map_or(to, |b| (b.0 + MARGIN, b.1 + MARGIN - BOX_HEIGHT / 2.0));
        let part = [0.5, 0.3, 0.7][(*number % 3) as usize];
        let (x, y) = (from.0 + (next.0 - from.0) * ease(part), from.1 + (next.1 - from.1) * part);
        let _ = writeln!(
            out,
            r##"<text x="{x:.1}" y="{y:.1}" font-size="9" fill="#444" text-anchor="middle" stroke="#fff" stroke-width="3" paint-order="stroke">{}</text>"##,
            escape(&label(names))
        );
    }
    let stages = plan.stages();
    for (number, (_, nodes)) in stages.iter().enumerate() {
        for index in nodes {
            let node = &plan.nodes[*index];
            let (x, y) = (layout.nodes[*index].0 + MARGIN, layout.nodes[*index].1 + MARGIN);
            let _ = writeln!(
                out,
                concat!(
                    r##"<g><title>{}</title><rect x="{:.1}" y="{:.1}" width="{}" height="{}" rx="5" fill="{}" stroke="#555"/>"##,
                    r##"<text x="{:.1}" y="{:.1}" font-size="12" font-weight="bold" text-anchor="middle">{}</text>"##,
                    r##"<text x="{:.1}" y="{:.1}" font-size="10" fill="#444" text-anchor="middle">{}</text></g>"##
                ),
                escape(&node.decl.doc),
                x - BOX_WIDTH / 2.0,
                y - BOX_HEIGHT / 2.0,
                BOX_WIDTH,
                BOX_HEIGHT,
                colour(number, stages.len()),
                x,
                y - 3.0,
                escape(&short(&node.id)),
                x,
                y + 12.0,
                escape(&short(&node.decl.name))
            );
        }
    }
    let top = layout.height + 2.0 * MARGIN;
    for (number, (stage, _)) in stages.iter().enumerate() {
        let y = top + number as f64 * LINE;
        let _ = writeln!(
            out,
            r##"<rect x="{MARGIN}" y="{y:.1}" width="12" height="12" fill="{}" stroke="#555"/><text x="{:.1}" y="{:.1}" font-size="11">{}</text>"##,
            colour(number, stages.len()),
            MARGIN + 18.0,
            y + 10.0,
            escape(stage)
        );
    }
    if !plan.idle.is_empty() {
        let x = MARGIN + 200.0;
        let _ = writeln!(
            out,
            r##"<text x="{x:.1}" y="{:.1}" font-size="11" fill="#777" font-weight="bold">not in this frame</text>"##,
            top + 10.0
        );
        for (number, idle) in plan.idle.iter().enumerate() {
            let y = top + (number + 1) as f64 * LINE + 10.0;
            let text = format!("{}: {}", idle.id, reason(&idle.reason).replace('`', ""));
            let _ = writeln!(out, r##"<text x="{x:.1}" y="{y:.1}" font-size="11" fill="#777">{}</text>"##, escape(&text));
        }
    }
    out.push_str("</svg>\n");
    out
}

/// One line for all that goes from one node to another, with the names of the resources.
fn lines(plan: &Plan) -> (Vec<Edge>, Vec<Vec<&str>>) {
    let mut lines: BTreeMap<(usize, usize, bool), Vec<usize>> = BTreeMap::new();
    for edge in edges(plan) {
        lines.entry((edge.from, edge.to, edge.previous)).or_default().push(edge.resource);
    }
    let name = |ix: &usize| plan.resources[*ix].name.as_str();
    lines
        .into_iter()
        .map(|((from, to, previous), resources)| {
            (Edge { from, to, resource: resources[0], previous }, resources.iter().map(name).collect())
        })
        .unzip()
}

/// The first name, and how many more there are.
fn label(names: &[&str]) -> String {
    match names {
        [] => String::new(),
        [one] => short(one),
        [first, rest @ ..] => format!("{} +{}", short(first), rest.len()),
    }
}

/// Where the curve of [`curve`] is across when it is at `part` of its height, nearly.
fn ease(part: f64) -> f64 {
    part * part * (3.0 - 2.0 * part)
}

/// Down from box to box; each bend lies in the gap of a row.
fn curve(from: (f64, f64), bends: &[(f64, f64)], to: (f64, f64)) -> String {
    let mut path = format!("M{:.1} {:.1}", from.0, from.1);
    let mut at = from;
    let mut go = |path: &mut String, next: (f64, f64)| {
        let middle = (at.1 + next.1) / 2.0;
        let _ = write!(path, " C{:.1} {middle:.1} {:.1} {middle:.1} {:.1} {:.1}", at.0, next.0, next.0, next.1);
        at = next;
    };
    for bend in bends {
        go(&mut path, (bend.0 + MARGIN, bend.1 + MARGIN - BOX_HEIGHT / 2.0));
        go(&mut path, (bend.0 + MARGIN, bend.1 + MARGIN + BOX_HEIGHT / 2.0));
    }
    go(&mut path, to);
    path
}

/// Up and back around the boxes.
fn loop_back(from: (f64, f64), to: (f64, f64)) -> String {
    let side = from.0.max(to.0) + BOX_WIDTH / 2.0 + 14.0;
    let reach = (ROW - BOX_HEIGHT) * 0.4;
    format!("M{:.1} {:.1} C{side:.1} {:.1} {side:.1} {:.1} {:.1} {:.1}", from.0, from.1, from.1 + reach, to.1 - reach, to.0, to.1)
}

fn colour(number: usize, of: usize) -> String {
    format!("hsl({}, 60%, 88%)", number * 360 / of.max(1))
}

fn short(text: &str) -> String {
    if text.chars().count() <= LONGEST_LABEL {
        return text.to_owned();
    }
    let mut kept: String = text.chars().take(LONGEST_LABEL - 1).collect();
    kept.push('…');
    kept
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
