// Evaluation of last frame's clusters. [ACRSM] 4.8 and 5.3.1; runs first in the frame, as the paper does.
// Differs from the paper: eq. 4.6 with A_max = 0 and eq. 4.7 with Σδ = 0 or without a neighbour mean "do nothing"; the neighbours are found by
// comparing centres instead of searching the map for centre texels, which gives the same set; the cluster that is farthest above its mean is split
// into the place of the one farthest below, the next with the next, so that the same frame always gives the same lists; thresholds are relative, and
// no more is merged than split (both as choices). Cost: each of k invocations compares its cluster with the k others, three times.

#import common::scene::Frame
#import common::cluster::{Cluster, CLUSTER_ACTIVE, CLUSTER_RESEED, CLUSTER_PLACED}
#import common::rsm::{cell_of_texel, in_cell}
#import common::radiometry::{PI, max_component}
#import common::random::{hash3, unit_float}

struct Params {
    adaptive: u32,
    window: u32,
    merge_threshold: f32,
    split_threshold: f32,
}

@group(0) @binding(0) var<storage, read> clusters_previous: array<Cluster>;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var<storage, read_write> clusters_evaluated: array<Cluster>;
@group(0) @binding(4) var rsm_flux: texture_2d<f32>;

override comparison_is_relative: bool;
override surplus_is_reseed: bool;

// Share of the clusters tried in a frame: one in three, [ACRSM] 5.3.1.
const SUBSET: u32 = 3u;
// Random places tried for the second half of a split cluster; where none is lit it stays whole.
const SPLIT_ATTEMPTS: u32 = 8u;

@compute @workgroup_size(64)
fn carry(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= arrayLength(&clusters_evaluated) {
        return;
    }
    var cluster = clusters_previous[c];
    if cluster.state != CLUSTER_ACTIVE || cluster.count == 0u {
        // New, vanished (4.6) or parked: to the re-seed list.
        cluster.state = CLUSTER_RESEED;
    }
    cluster.delta = 0.0;
    cluster.delta_mean = 0.0;
    cluster.rank = 0u;
    clusters_evaluated[c] = cluster;
}

// Whether two places of the map show the same view of a light: texels of others are no neighbours, however near in the map.
fn of_one_view(a: vec2f, b: vec2f) -> bool {
    return in_cell(cell_of_texel(vec2u(a), textureDimensions(rsm_flux)), b);
}

fn comparison_metric(c: u32, largest_area: f32) -> f32 {
    return clusters_evaluated[c].area / largest_area * clusters_evaluated[c].importance; // [ACRSM] eq. 4.6
}

@compute @workgroup_size(64)
fn measure(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    let count = arrayLength(&clusters_evaluated);
    if c >= count || clusters_evaluated[c].state != CLUSTER_ACTIVE {
        return;
    }
    var largest_area = 0.0;
    for (var i = 0u; i < count; i++) {
        if clusters_evaluated[i].state == CLUSTER_ACTIVE {
            largest_area = max(largest_area, clusters_evaluated[i].area);
        }
    }
    if largest_area <= 0.0 {
        return;
    }
    let delta = comparison_metric(c, largest_area);
    var sum = 0.0;
    var sum_of_squares = 0.0;
    var neighbours = 0u;
    for (var i = 0u; i < count; i++) {
        if clusters_evaluated[i].state != CLUSTER_ACTIVE {
            continue;
        }
        let offset = abs(clusters_evaluated[i].texel - clusters_evaluated[c].texel);
        if max(offset.x, offset.y) <= f32(params.window) && of_one_view(clusters_evaluated[i].texel, clusters_evaluated[c].texel) {
            let d = comparison_metric(i, largest_area);
            sum += d;
            sum_of_squares += d * d;
            neighbours += 1u;
        }
    }
    clusters_evaluated[c].delta = delta;
    // [ACRSM] eq. 4.7
    let mean = select(delta, sum_of_squares / max(sum, 1e-30), sum > 0.0 && neighbours > 1u);
    clusters_evaluated[c].delta_mean = mean;
    if delta > mean && place_near(c).x < 0.0 {
        // There is no place for a second half: it counts as fitting.
        clusters_evaluated[c].delta = mean;
    }
}

// Left side of eq. 4.8: negative where a cluster is small for its neighbourhood.
fn deviation(c: u32) -> f32 {
    let mean = clusters_evaluated[c].delta_mean;
    let difference = clusters_evaluated[c].delta - mean;
    return select(difference, difference / max(mean, 1e-30), comparison_is_relative);
}

// A lit texel near the centre of cluster `c`, or a negative one if none was met.
fn place_near(c: u32) -> vec2f {
    let size = vec2f(textureDimensions(rsm_flux));
    let radius = sqrt(f32(clusters_evaluated[c].count) / PI); // of a disk with as many texels
    for (var i = 0u; i < SPLIT_ATTEMPTS; i++) {
        let u = vec2f(unit_float(hash3(c, frame.index, 2u * i + 1u)), unit_float(hash3(c, frame.index, 2u * i + 2u)));
        let offset = radius * sqrt(u.x) * vec2f(cos(2.0 * PI * u.y), sin(2.0 * PI * u.y));
        let texel = clusters_evaluated[c].texel + offset;
        if all(texel >= vec2f(0.0)) && all(texel < size) && of_one_view(texel, clusters_evaluated[c].texel) && max_component(textureLoad(rsm_flux, vec2u(texel), 0).rgb) > 0.0 {
            return texel;
        }
    }
    return vec2f(-1.0);
}

// How far cluster `c` is beyond its threshold of eq. 4.8: above zero where it is to be split, below where it is to be merged, zero where it fits, or
// is not tried in this frame.
fn excess(c: u32) -> f32 {
    let d = deviation(c);
    let beyond = max(d - params.split_threshold, 0.0) + min(d + params.merge_threshold, 0.0);
    if beyond == 0.0 || clusters_evaluated[c].state != CLUSTER_ACTIVE || hash3(c, frame.index, frame.seed) % SUBSET != 0u {
        return 0.0;
    }
    return beyond;
}

@compute @workgroup_size(64)
fn rank(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    let count = arrayLength(&clusters_evaluated);
    if params.adaptive == 0u || c >= count {
        return;
    }
    let own = excess(c);
    if own == 0.0 {
        return;
    }
    var before = 0u;
    for (var i = 0u; i < count; i++) {
        let other = excess(i) * sign(own);
        before += select(0u, 1u, other > abs(own) || (other == abs(own) && i < c));
    }
    clusters_evaluated[c].rank = 1u + before;
}

// A merged cluster takes the place beside the split one of its rank. [ACRSM] 4.8. Nothing is written that another invocation reads: those to be
// split stay as they are.
@compute @workgroup_size(64)
fn rebalance(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    let count = arrayLength(&clusters_evaluated);
    if c >= count || clusters_evaluated[c].rank == 0u || deviation(c) > 0.0 {
        return;
    }
    for (var i = 0u; i < count; i++) {
        if clusters_evaluated[i].rank == clusters_evaluated[c].rank && deviation(i) > 0.0 {
            clusters_evaluated[c].state = CLUSTER_PLACED;
            clusters_evaluated[c].texel = place_near(i);
            clusters_evaluated[c].count = 0u;
            return;
        }
    }
    if surplus_is_reseed {
        // Clean-up: what is too small and finds nothing to split goes to the re-seed list.
        clusters_evaluated[c].state = CLUSTER_RESEED;
        clusters_evaluated[c].count = 0u;
    }
}
