// Debug view: cluster map. The RSM is stretched to the picture.

#import common::cluster::{Cluster, CLUSTER_ACTIVE, NO_CLUSTER}
#import common::random::{hash, unit_float}

@group(0) @binding(0) var cluster_map: texture_2d<u32>;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var view: texture_storage_2d<rgba8unorm, write>;

// Radius of a centre's dot, in texels of the RSM.
const DOT: f32 = 2.5;

@compute @workgroup_size(8, 8)
fn show(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(view);
    if any(id.xy >= size) {
        return;
    }
    let map_size = textureDimensions(cluster_map);
    let at = (vec2f(id.xy) + 0.5) / vec2f(size) * vec2f(map_size);
    let c = textureLoad(cluster_map, min(vec2u(at), map_size - 1u), 0).x;
    var colour = vec3f(0.0);
    if c != NO_CLUSTER {
        colour = 0.25 + 0.75 * vec3f(unit_float(hash(3u * c)), unit_float(hash(3u * c + 1u)), unit_float(hash(3u * c + 2u)));
    }
    for (var i = 0u; i < arrayLength(&clusters); i++) {
        if clusters[i].state == CLUSTER_ACTIVE && clusters[i].count > 0u && distance(clusters[i].texel, at) < DOT {
            colour = vec3f(0.0);
        }
    }
    textureStore(view, id.xy, vec4f(colour, 1.0));
}
