//! A light that sweeps over the edge between two walls, where clusters that do not adapt stay behind. [ACRSM] 4.1, 6.3, fig. 6.7.

use crate::renders::{Job, read_clusters};

const FRAMES: u32 = 120;
/// One way of the light's sweep in `assets/moving.ron`, seconds.
const SWEEP: f64 = 5.0;
/// Frames in which the first clusters settle.
const SETTLE: u32 = 8;
const ACTIVE: u64 = 1;

/// Standard deviation over mean of the clusters' δ ([ACRSM] eq. 4.6), in each frame: 0 for clusters in balance.
fn spreads(adaptive: &str) -> Vec<f64> {
    let job = Job { size: (32, 32), ..Job::asset("moving") }
        .set("rsm_size", 256)
        .set("visibility", "none")
        .set("adaptive", adaptive)
        .keep(&["clusters"]);
    let mut renderer = job.renderer();
    let mut spreads = Vec::new();
    for frame in 0..FRAMES {
        renderer.render_frame(SWEEP * f64::from(frame) / f64::from(FRAMES)).unwrap_or_else(|e| panic!("{e}"));
        let clusters = read_clusters(&renderer, "clusters");
        let deltas: Vec<f64> = clusters.iter().filter(|c| c.state == ACTIVE && c.count > 0).map(|c| c.area * c.importance).collect();
        let count = deltas.len() as f64;
        let mean = deltas.iter().sum::<f64>() / count;
        let variance = deltas.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / count;
        spreads.push(variance.sqrt() / mean);
    }
    spreads
}

/// Measured: adaptive at most 0.5, non-adaptive up to 3.4. The bounds leave room for another adapter's rounding.
#[test]
fn adaptive_clusters_stay_in_balance_where_others_do_not() {
    let largest = |adaptive| spreads(adaptive).into_iter().skip(SETTLE as usize).fold(0.0, f64::max);
    let (adaptive, fixed) = (largest("on"), largest("off"));
    println!("largest spread of δ over {FRAMES} frames: adaptive {adaptive:.2}, non-adaptive {fixed:.2}");
    assert!(adaptive < 0.8, "adaptive clusters spread by {adaptive}");
    assert!(fixed > 1.5, "non-adaptive clusters spread by {fixed} only: the test shows nothing");
}
