//! Parts of a sweep's document that stand for themselves: the path of the light; what goes to the report, tables of papers and curves of other renderers.

use glam::Vec3;
use manylight_graph::{
    Spanned,
    ron::{Kind, Reader, Shape, Tree, suggest},
};

use super::document;
use crate::sheet::{Axis, Claim, Curve, Paper};

const PAPER: Shape = Shape { what: "a paper's table", required: &["source", "unit", "rows"], optional: &[] };
const CLAIM: Shape = Shape { what: "a claim", required: &["variant", "than"], optional: &["time", "error"] };
const CURVE: Shape = Shape { what: "a curve", required: &["name", "scene", "size", "metric", "points"], optional: &[] };

const LIGHT_KEY: Shape = Shape { what: "a place of the light", required: &["time", "position", "target"], optional: &[] };

/// Times, positions and targets; times increase.
pub(super) fn light_path(reader: &mut Reader, tree: &Tree) -> Vec<(f64, Vec3, Vec3)> {
    let mut path: Vec<(f64, Vec3, Vec3)> = Vec::new();
    for tree in reader.list(tree, "places") {
        let Some(fields) = reader.record(tree, &LIGHT_KEY) else { continue };
        let vector = |reader: &mut Reader, name: &str| fields.get(name).and_then(|tree| vector(reader, tree));
        let (position, target) = (vector(reader, "position"), vector(reader, "target"));
        let time = fields.get("time").and_then(|tree| {
            let time = reader.float(tree, "seconds")?;
            if path.last().is_some_and(|last| last.0 >= time) {
                reader.error(&tree.range, "times must increase", "bring the places into the order of their times");
            }
            Some(time)
        });
        if let (Some(time), Some(position), Some(target)) = (time, position, target) {
            path.push((time, position, target));
        }
    }
    path
}

fn vector(reader: &mut Reader, tree: &Tree) -> Option<Vec3> {
    match &tree.kind {
        Kind::Tuple(None, items) if items.len() == 3 => {
            let [x, y, z] = [0, 1, 2].map(|i| reader.float(&items[i], "a coordinate"));
            Some(Vec3::new(x? as f32, y? as f32, z? as f32))
        }
        _ => {
            reader.expected(tree, "a vector", "write (x, y, z)");
            None
        }
    }
}

pub(super) fn claims(reader: &mut Reader, tree: &Tree) -> Vec<(Claim, [Spanned; 2])> {
    reader.list(tree, "claims").iter().filter_map(|tree| claim(reader, tree)).collect()
}

fn claim(reader: &mut Reader, tree: &Tree) -> Option<(Claim, [Spanned; 2])> {
    let fields = reader.record(tree, &CLAIM)?;
    let text = |reader: &mut Reader, name: &str| fields.get(name).and_then(|t| reader.text(t, "the name of a variant in quotes"));
    let (variant, than) = (text(reader, "variant"), text(reader, "than"));
    let most = |reader: &mut Reader, name: &str| fields.get(name).map_or(Some(1.0), |t| reader.float(t, "a ratio"));
    let (time, error) = (most(reader, "time"), most(reader, "error"));
    let (variant, than) = (variant?, than?);
    Some((Claim { variant: variant.text.clone(), than: than.text.clone(), time: time?, error: error? }, [variant, than]))
}

pub(super) fn papers(reader: &mut Reader, tree: &Tree) -> Vec<Paper> {
    reader.list(tree, "tables").iter().filter_map(|tree| paper(reader, tree)).collect()
}

fn paper(reader: &mut Reader, tree: &Tree) -> Option<Paper> {
    let fields = reader.record(tree, &PAPER)?;
    let text = |reader: &mut Reader, name: &str| fields.get(name).and_then(|t| reader.text(t, "a text in quotes")).map(|t| t.text);
    let (source, unit) = (text(reader, "source"), text(reader, "unit"));
    let mut values = Vec::new();
    if let Some(tree) = fields.get("rows") {
        for (row, tree) in reader.map(tree, "rows") {
            for (column, tree) in reader.map(tree, "columns") {
                if let Some(value) = reader.float(tree, "a number") {
                    values.push((row.text.clone(), column.text, value));
                }
            }
        }
    }
    Some(Paper { source: source?, unit: unit?, values })
}

pub(super) fn axis(reader: &mut Reader, tree: &Tree) -> Option<Axis> {
    let text = reader.text(tree, "the name of a time in quotes")?.text;
    let found = Axis::ALL.into_iter().find(|axis| axis.name() == text);
    if found.is_none() {
        reader.error(&tree.range, format!("there is no time `{text}`"), suggest(&text, Axis::ALL.iter().map(|axis| axis.name())));
    }
    found
}

pub(super) fn curves(reader: &mut Reader, tree: &Tree) -> Vec<Curve> {
    reader.list(tree, "curves").iter().filter_map(|tree| curve(reader, tree)).collect()
}

fn curve(reader: &mut Reader, tree: &Tree) -> Option<Curve> {
    let fields = reader.record(tree, &CURVE)?;
    let text = |reader: &mut Reader, name: &str| fields.get(name).and_then(|t| reader.text(t, "a text in quotes")).map(|t| t.text);
    let (name, scene, metric) = (text(reader, "name"), text(reader, "scene"), text(reader, "metric"));
    let points = fields.get("points").map(|tree| reader.list(tree, "points").iter().filter_map(|tree| point(reader, tree)).collect());
    let size = fields.get("size").and_then(|tree| document::read_size(reader, tree));
    let (width, height) = size?;
    Some(Curve { name: name?, scene: scene?, size: [width, height], metric: metric?, points: points? })
}

fn point(reader: &mut Reader, tree: &Tree) -> Option<(f64, f64)> {
    match &tree.kind {
        Kind::Tuple(None, items) if items.len() == 2 => {
            let (time, error) = (reader.float(&items[0], "milliseconds"), reader.float(&items[1], "an error"));
            Some((time?, error?))
        }
        _ => {
            reader.expected(tree, "a point", "write (milliseconds, error)");
            None
        }
    }
}
