// Importance warping and first attributes of new clusters. [ACRSM] 4.5, 5.3.1.
// Differs from the paper: a seed that still lands on an unlit texel after warping (possible when fewer levels are used) leaves the cluster idle
// for this frame instead of giving it attributes of nothing.

#import common::cluster::{Cluster, CLUSTER_IDLE, CLUSTER_ACTIVE, CLUSTER_RESEED, CLUSTER_PLACED}
#import common::rsm::texel_position
#import common::octahedral::unpack_unit
#import common::radiometry::max_component
#import common::warp::warp_to_texel

struct Params {
    warp_levels: u32,
}

@group(0) @binding(0) var<storage, read> clusters_seeded: array<Cluster>;
@group(0) @binding(1) var importance: texture_2d<f32>;
@group(0) @binding(2) var rsm_flux: texture_2d<f32>;
@group(0) @binding(3) var rsm_normal: texture_2d<u32>;
@group(0) @binding(4) var rsm_distance: texture_2d<f32>;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var<storage, read_write> clusters_warped: array<Cluster>;

@compute @workgroup_size(64)
fn warp(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= arrayLength(&clusters_warped) {
        return;
    }
    var cluster = clusters_seeded[c];
    if cluster.state == CLUSTER_RESEED || cluster.state == CLUSTER_PLACED {
        if cluster.state == CLUSTER_RESEED {
            cluster.texel = warp_to_texel(importance, cluster.texel, params.warp_levels).position;
        }
        let size = textureDimensions(rsm_flux);
        let texel = min(vec2u(cluster.texel), size - 1u);
        let flux = textureLoad(rsm_flux, texel, 0).rgb;
        if max_component(flux) > 0.0 && all(cluster.texel < vec2f(size)) {
            cluster.state = CLUSTER_ACTIVE;
            cluster.position = texel_position(texel, size, textureLoad(rsm_distance, texel, 0).x);
            cluster.normal = unpack_unit(textureLoad(rsm_normal, texel, 0).x);
            cluster.flux = flux;
            cluster.importance = textureLoad(importance, texel, 0).x;
            cluster.area = 0.0;
            cluster.cancelled = 0u;
        } else {
            cluster.state = CLUSTER_IDLE;
            cluster.flux = vec3f(0.0);
        }
        cluster.count = 0u;
    }
    clusters_warped[c] = cluster;
}
