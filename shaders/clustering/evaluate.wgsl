// Evaluation of last frame's clusters. [ACRSM] 4.8 and 5.3.1; runs first in the frame, as the paper does.
// Differs from the paper: eq. 4.6 with A_max = 0 and eq. 4.7 with Σδ = 0 or without a neighbour mean "do nothing"; the neighbours are found by
// comparing centres (k² comparisons of at most 512) instead of searching the map for centre texels, which gives the same set; the largest clusters are
// split first and the smallest merged first, on one invocation, so that the same frame always gives the same lists; thresholds are relative, and no
// more is merged than split (both as choices). Cost: k²/3 steps at most, far below that when nothing is out of balance.

#import common::scene::Frame
#import common::cluster::{Cluster, CLUSTER_IDLE, CLUSTER_ACTIVE, CLUSTER_RESEED, CLUSTER_PLACED, MAX_CLUSTERS}
#import common::radiometry::{PI, max_component}
#import common::random::{hash3, unit_float}

struct Params {
    clusters: u32,
    adaptive: u32,
    window: u32,
    merge_threshold: f32,
    split_threshold: f32,
    max_reseeds: u32,
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
// Random places tried for the second half of a split cluster before the Halton sequence takes over.
const SPLIT_ATTEMPTS: u32 = 8u;

@compute @workgroup_size(64)
fn carry(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= MAX_CLUSTERS {
        return;
    }
    var cluster = clusters_previous[c];
    if c >= params.clusters {
        cluster = Cluster();
    } else if cluster.state != CLUSTER_ACTIVE || cluster.count == 0u {
        // New, vanished (4.6) or parked: to the re-seed list.
        cluster.state = CLUSTER_RESEED;
    }
    cluster.delta = 0.0;
    cluster.delta_mean = 0.0;
    clusters_evaluated[c] = cluster;
}

fn comparison_metric(c: u32, largest_area: f32) -> f32 {
    return clusters_evaluated[c].area / largest_area * clusters_evaluated[c].importance; // [ACRSM] eq. 4.6
}

@compute @workgroup_size(64)
fn measure(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= params.clusters || clusters_evaluated[c].state != CLUSTER_ACTIVE {
        return;
    }
    var largest_area = 0.0;
    for (var i = 0u; i < params.clusters; i++) {
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
    for (var i = 0u; i < params.clusters; i++) {
        if clusters_evaluated[i].state != CLUSTER_ACTIVE {
            continue;
        }
        let offset = abs(clusters_evaluated[i].texel - clusters_evaluated[c].texel);
        if max(offset.x, offset.y) <= f32(params.window) {
            let d = comparison_metric(i, largest_area);
            sum += d;
            sum_of_squares += d * d;
            neighbours += 1u;
        }
    }
    clusters_evaluated[c].delta = delta;
    // [ACRSM] eq. 4.7
    clusters_evaluated[c].delta_mean = select(delta, sum_of_squares / max(sum, 1e-30), sum > 0.0 && neighbours > 1u);
}

fn in_subset(c: u32) -> bool {
    return clusters_evaluated[c].state == CLUSTER_ACTIVE && hash3(c, frame.index, frame.seed) % SUBSET == 0u;
}

// Left side of eq. 4.8: negative where a cluster is small for its neighbourhood.
fn deviation(c: u32) -> f32 {
    let mean = clusters_evaluated[c].delta_mean;
    let difference = clusters_evaluated[c].delta - mean;
    return select(difference, difference / max(mean, 1e-30), comparison_is_relative);
}

// The cluster of the subset that deviates most downwards (`sign` −1) or upwards (+1) beyond the threshold, or MAX_CLUSTERS.
fn most_deviating(sign: f32, threshold: f32) -> u32 {
    var found = MAX_CLUSTERS;
    var most = threshold;
    for (var c = 0u; c < params.clusters; c++) {
        if in_subset(c) && sign * deviation(c) > most {
            found = c;
            most = sign * deviation(c);
        }
    }
    return found;
}

// A lit texel near the centre of cluster `c`, or a negative one if none was met.
fn place_near(c: u32) -> vec2f {
    let size = vec2f(textureDimensions(rsm_flux));
    let radius = sqrt(f32(clusters_evaluated[c].count) / PI); // of a disk with as many texels
    for (var i = 0u; i < SPLIT_ATTEMPTS; i++) {
        let u = vec2f(unit_float(hash3(c, frame.index, 2u * i + 1u)), unit_float(hash3(c, frame.index, 2u * i + 2u)));
        let offset = radius * sqrt(u.x) * vec2f(cos(2.0 * PI * u.y), sin(2.0 * PI * u.y));
        let texel = clusters_evaluated[c].texel + offset;
        if all(texel >= vec2f(0.0)) && all(texel < size) && max_component(textureLoad(rsm_flux, vec2u(texel), 0).rgb) > 0.0 {
            return texel;
        }
    }
    return vec2f(-1.0);
}

@compute @workgroup_size(1)
fn rebalance() {
    var free = 0u;
    if params.adaptive != 0u {
        // [ACRSM] eq. 4.8: each split needs a merged cluster. Both lose their state, so no cluster is chosen twice.
        for (var i = 0u; i < params.clusters; i++) {
            let large = most_deviating(1.0, params.split_threshold);
            let small = most_deviating(-1.0, params.merge_threshold);
            if large == MAX_CLUSTERS || small == MAX_CLUSTERS {
                break;
            }
            let texel = place_near(large);
            clusters_evaluated[large].delta = clusters_evaluated[large].delta_mean;
            if texel.x >= 0.0 {
                clusters_evaluated[small].state = CLUSTER_PLACED;
                clusters_evaluated[small].texel = texel;
                clusters_evaluated[small].count = 0u;
            }
        }
        if surplus_is_reseed {
            // Clean-up: what is still too small goes to the re-seed list.
            for (var c = 0u; c < params.clusters; c++) {
                if in_subset(c) && deviation(c) < -params.merge_threshold {
                    clusters_evaluated[c].state = CLUSTER_RESEED;
                    clusters_evaluated[c].count = 0u;
                }
            }
        }
    }
    // No storm of re-seeds when there is less to light than there are clusters.
    if frame.index > 0u {
        var reseeds = 0u;
        for (var c = 0u; c < params.clusters; c++) {
            if clusters_evaluated[c].state == CLUSTER_RESEED {
                reseeds += 1u;
                if reseeds > params.max_reseeds {
                    clusters_evaluated[c].state = CLUSTER_IDLE;
                    clusters_evaluated[c].flux = vec3f(0.0);
                    clusters_evaluated[c].count = 0u;
                }
            }
        }
    }
}
