//! Tables of papers beside ours. Times of old processors do not carry over, so that ratios stand beside them: their shape does.

use indexmap::IndexSet;

use super::{
    study::{Group, Study, stage_times, time_of},
    table::{Column, Table},
    text::{maybe, number},
};
use crate::{record::Record, sheet::Paper};

/// The column of a paper's table that is the time of a frame.
const FRAME: &str = "frame";

/// What is said beneath the tables.
pub(super) const NOTE: &str = "Ours is the median over the runs of the row. Ratios are of times, to the first row or column for which there are both \
    numbers: times of other processors do not carry over, the shape of a table does.";

/// The tables of a paper with their titles: one for each scene and size that has numbers to set beside it, or the paper's alone.
pub(super) fn tables(study: &Study<'_>, paper: &Paper) -> Vec<(String, Table)> {
    if paper.values.is_empty() {
        return Vec::new();
    }
    let matches = |group: &&Group<'_>| paper.values.iter().any(|(row, column, _)| ours(study, group, row, column).is_some());
    let tables: Vec<(String, Table)> =
        study.groups.iter().filter(matches).map(|g| (format!("{}: {}", paper.source, g.title()), table(study, Some(g), paper))).collect();
    if tables.is_empty() {
        return vec![(format!("{}, without runs of ours", paper.source), table(study, None, paper))];
    }
    tables
}

/// One value of a paper and ours.
struct Pair<'a> {
    row: &'a str,
    column: &'a str,
    printed: f64,
    /// What ratios are of: the time where the unit is one of time or rate, else what is printed.
    paper: f64,
    /// Median over the runs that match, and how many these are.
    ours: Option<(f64, usize)>,
}

/// A paper's values one a line, ours beside them, both also as ratios to the first row and to the first column where both have numbers.
fn table(study: &Study<'_>, group: Option<&Group<'_>>, paper: &Paper) -> Table {
    let pairs: Vec<Pair<'_>> = paper.values.iter().map(|(row, column, value)| pair(study, group, paper, row, column, *value)).collect();
    let rows: IndexSet<&str> = pairs.iter().map(|p| p.row).collect();
    let several = (rows.len() > 1, pairs.iter().any(|p| p.column != pairs[0].column));
    let mut columns = vec![Column::text("row"), Column::text("column")];
    columns.extend([format!("paper ({})", paper.unit), "ours (ms)".into(), "runs".into()].map(Column::number));
    if several.0 {
        columns.extend(["paper, to first row", "ours, to first row"].map(Column::number));
    }
    if several.1 {
        columns.extend(["paper, to first column", "ours, to first column"].map(Column::number));
    }
    let line = |pair: &Pair<'_>| {
        let mut line = vec![pair.row.to_owned(), pair.column.to_owned(), number(pair.printed)];
        line.extend([maybe(pair.ours.map(|o| o.0)), pair.ours.map_or_else(String::new, |o| o.1.to_string())]);
        if several.0 {
            line.extend(ratios(pair, pairs.iter().filter(|p| p.column == pair.column)));
        }
        if several.1 {
            line.extend(ratios(pair, pairs.iter().filter(|p| p.row == pair.row)));
        }
        line
    };
    Table { rows: pairs.iter().map(line).collect(), columns }
}

fn pair<'a>(study: &Study<'_>, group: Option<&Group<'_>>, paper: &Paper, row: &'a str, column: &'a str, printed: f64) -> Pair<'a> {
    let is_rate = ["fps", "frames/s", "Hz"].contains(&paper.unit.as_str());
    Pair {
        row,
        column,
        printed,
        paper: if is_rate { 1e3 / printed } else { printed },
        ours: group.and_then(|g| ours(study, g, row, column)),
    }
}

/// The median of our times over the runs of a group that are the row: the run of this name, else all of the variant.
fn ours(study: &Study<'_>, group: &Group<'_>, row: &str, column: &str) -> Option<(f64, usize)> {
    let records = || group.runs.iter().map(|&run| &study.records[run]);
    let time = |record: &Record| time_of(column, &stage_times(record)).or((column == FRAME).then(|| record.times.frame()));
    let named = records().any(|r| r.run == row);
    let matching = records().filter(|r| if named { r.run == row } else { r.variant == row });
    let mut times: Vec<f64> = matching.filter_map(time).filter(|t| t.is_finite()).collect();
    times.sort_by(f64::total_cmp);
    let upper = times.get(times.len() / 2)?;
    let lower = times.get((times.len() - 1) / 2)?;
    Some((f64::midpoint(*lower, *upper), times.len()))
}

/// Ratios of a pair to the first of some for which there are both numbers.
fn ratios<'p>(pair: &Pair<'_>, mut among: impl Iterator<Item = &'p Pair<'p>>) -> [String; 2] {
    let base = among.find(|p| p.ours.is_some()).and_then(|p| Some((p.paper, p.ours?.0)));
    [maybe(base.map(|b| pair.paper / b.0)), maybe(base.and_then(|b| Some(pair.ours?.0 / b.1)))]
}
