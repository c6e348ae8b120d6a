// Seeding from the Halton sequence. [ACRSM] 4.4, [HALTON].
// Cluster c of generation g takes point c + 512 g: no point is used twice, and the seeds of a first frame are the sequence's beginning.

#import common::cluster::{Cluster, CLUSTER_RESEED, MAX_CLUSTERS}
#import common::random::halton_23

@group(0) @binding(0) var<storage, read> clusters_evaluated: array<Cluster>;
@group(0) @binding(1) var<storage, read_write> clusters_seeded: array<Cluster>;

@compute @workgroup_size(64)
fn seed(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= MAX_CLUSTERS {
        return;
    }
    var cluster = clusters_evaluated[c];
    if cluster.state == CLUSTER_RESEED {
        // Point 0 is the corner (0, 0): start at 1.
        cluster.texel = halton_23(1u + c + MAX_CLUSTERS * cluster.generation);
        cluster.generation += 1u;
    }
    clusters_seeded[c] = cluster;
}
