//! A layered layout: nodes in rows by rank, few crossings, long lines through the gaps of the rows they pass.

use super::Edge;

/// Width of a node's box, in pixels.
pub(super) const BOX_WIDTH: f64 = 190.0;
/// Height of a node's box, in pixels.
pub(super) const BOX_HEIGHT: f64 = 40.0;
/// From one row to the next, in pixels.
pub(super) const ROW: f64 = 92.0;
const GAP: f64 = 22.0;
/// Room for a line that passes a row.
const LANE: f64 = 16.0;
const SWEEPS: usize = 8;

/// Where everything goes. Positions are centres.
pub(super) struct Layout {
    /// Of nodes.
    pub nodes: Vec<(f64, f64)>,
    /// Of the bends of each edge, in order; empty for edges to the next frame.
    pub bends: Vec<Vec<(f64, f64)>>,
    pub width: f64,
    pub height: f64,
}

/// Something with a place in a row.
struct Item {
    rank: usize,
    x: f64,
    node: bool,
    above: Vec<usize>,
    below: Vec<usize>,
}

pub(super) fn layout(count: usize, edges: &[Edge]) -> Layout {
    // Nodes are in a legal order, so one pass finds the longest way to each.
    let mut rank = vec![0usize; count];
    for edge in sorted_by_target(edges) {
        rank[edge.to] = rank[edge.to].max(rank[edge.from] + 1);
    }
    let mut items: Vec<Item> = rank.iter().map(|r| Item { rank: *r, x: 0.0, node: true, above: Vec::new(), below: Vec::new() }).collect();
    let mut lanes: Vec<Vec<usize>> = vec![Vec::new(); edges.len()];
    for (number, edge) in edges.iter().enumerate().filter(|(_, e)| !e.previous) {
        let mut at = edge.from;
        for r in rank[edge.from] + 1..rank[edge.to] {
            let lane = items.len();
            items.push(Item { rank: r, x: 0.0, node: false, above: vec![at], below: Vec::new() });
            items[at].below.push(lane);
            lanes[number].push(lane);
            at = lane;
        }
        items[at].below.push(edge.to);
        items[edge.to].above.push(at);
    }
    let depth = items.iter().map(|i| i.rank + 1).max().unwrap_or(0);
    let mut rows: Vec<Vec<usize>> = vec![Vec::new(); depth];
    for (index, item) in items.iter().enumerate() {
        rows[item.rank].push(index);
    }
    for row in &rows {
        spread(&mut items, row, |_| 0.0);
    }
    for sweep in 0..SWEEPS {
        let down = sweep % 2 == 0;
        let order: Vec<usize> = if down { (0..depth).collect() } else { (0..depth).rev().collect() };
        for r in order {
            let wish: Vec<f64> = rows[r].iter().map(|i| wish(&items, *i, down)).collect();
            let mut keyed: Vec<(f64, usize)> = wish.into_iter().zip(rows[r].iter().copied()).collect();
            keyed.sort_by(|a, b| a.0.total_cmp(&b.0));
            rows[r] = keyed.iter().map(|(_, i)| *i).collect();
            let row = rows[r].clone();
            spread(&mut items, &row, |position| keyed[position].0);
        }
    }
    let left = items.iter().map(|i| i.x - half(i)).fold(f64::INFINITY, f64::min);
    let left = if left.is_finite() { left } else { 0.0 };
    let width = items.iter().map(|i| i.x + half(i) - left).fold(0.0, f64::max);
    let place = |i: usize| (items[i].x - left, items[i].rank as f64 * ROW + BOX_HEIGHT / 2.0);
    Layout {
        nodes: (0..count).map(place).collect(),
        bends: lanes.iter().map(|lanes| lanes.iter().map(|i| place(*i)).collect()).collect(),
        width,
        height: (depth as f64 * ROW - (ROW - BOX_HEIGHT)).max(0.0),
    }
}

fn sorted_by_target(edges: &[Edge]) -> Vec<&Edge> {
    let mut sorted: Vec<&Edge> = edges.iter().filter(|e| !e.previous).collect();
    sorted.sort_by_key(|e| e.to);
    sorted
}

fn half(item: &Item) -> f64 {
    if item.node { BOX_WIDTH / 2.0 } else { LANE / 2.0 }
}

/// The mean place of the neighbours on one side, or where it is.
fn wish(items: &[Item], index: usize, down: bool) -> f64 {
    let item = &items[index];
    let neighbours = if down { &item.above } else { &item.below };
    if neighbours.is_empty() {
        return item.x;
    }
    neighbours.iter().map(|n| items[*n].x).sum::<f64>() / neighbours.len() as f64
}

/// Places a row in its order, each item near its wish and none over another.
fn spread(items: &mut [Item], row: &[usize], wish: impl Fn(usize) -> f64) {
    let mut right = f64::NEG_INFINITY;
    let mut shift = 0.0;
    for (position, index) in row.iter().enumerate() {
        let half = half(&items[*index]);
        let x = wish(position).max(right + half);
        shift += wish(position) - x;
        items[*index].x = x;
        right = x + half + GAP;
    }
    // Pushing to the right alone would lean the whole row: move it back by the mean.
    let shift = if row.is_empty() { 0.0 } else { shift / row.len() as f64 };
    for index in row {
        items[*index].x += shift;
    }
}
