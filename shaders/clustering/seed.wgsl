// Seeding from the Halton sequence. [ACRSM] 4.4, [HALTON].
// Cluster c of generation g takes point c + MAX_CLUSTERS g: no point is used twice, and the seeds of a first frame are the sequence's beginning.

#import common::scene::Frame
#import common::cluster::{Cluster, CLUSTER_IDLE, CLUSTER_RESEED, MAX_CLUSTERS}
#import common::random::halton_23

struct Params {
    max_reseeds: u32,
}

@group(0) @binding(0) var<storage, read> clusters_evaluated: array<Cluster>;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var<storage, read_write> clusters_seeded: array<Cluster>;

// Whether cluster `c` of the re-seed list is among the first that a frame may place: no storm of re-seeds when there is less to light than there
// are clusters.
fn has_turn(c: u32) -> bool {
    if frame.index == 0u {
        return true;
    }
    var before = 0u;
    for (var i = 0u; i < c && before < params.max_reseeds; i++) {
        before += select(0u, 1u, clusters_evaluated[i].state == CLUSTER_RESEED);
    }
    return before < params.max_reseeds;
}

@compute @workgroup_size(64)
fn seed(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= arrayLength(&clusters_seeded) {
        return;
    }
    var cluster = clusters_evaluated[c];
    if cluster.state == CLUSTER_RESEED {
        if has_turn(c) {
            // Point 0 is the corner (0, 0): start at 1.
            cluster.texel = halton_23(1u + c + MAX_CLUSTERS * cluster.generation);
            cluster.generation += 1u;
        } else {
            cluster.state = CLUSTER_IDLE;
            cluster.flux = vec3f(0.0);
            cluster.count = 0u;
        }
    }
    clusters_seeded[c] = cluster;
}
