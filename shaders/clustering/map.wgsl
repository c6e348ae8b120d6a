// Mapping of RSM texels to clusters. [ACRSM] 4.6, 5.3.1.
// Differs from the paper: texels look for clusters instead of clusters drawing squares over texels; a group of 256 lit texels first lists the clusters
// whose window reaches it, so the cost per texel is the number of windows that overlap there, and the result needs no depth test.
// A cluster competes for texels of its own view of a light only; texels of a view without any cluster give their flux to the nearest of all.
// Ties go to the lower index. What bounds it: k distance computations per texel with `exact`, texture reads otherwise.

#import common::scene::SceneInfo
#import common::rsm::{texel_position, cell_of_texel, in_cell}
#import common::octahedral::unpack_unit
#import common::cluster::{Cluster, CLUSTER_ACTIVE, NO_CLUSTER, MAX_CLUSTERS}
#import common::metric::{Metric, cluster_distance}

struct Params {
    window: u32,
    weight_position: f32,
    weight_normal: f32,
    weight_attribute: f32,
}

@group(0) @binding(0) var<storage, read> clusters_warped: array<Cluster>;
@group(0) @binding(1) var rsm_flux: texture_2d<f32>;
@group(0) @binding(2) var rsm_normal: texture_2d<u32>;
@group(0) @binding(3) var rsm_distance: texture_2d<f32>;
@group(0) @binding(4) var importance: texture_2d<f32>;
@group(0) @binding(5) var<uniform> scene_info: SceneInfo;
@group(0) @binding(6) var<uniform> params: Params;
@group(0) @binding(7) var cluster_map: texture_storage_2d<r32uint, write>;
@group(0) @binding(8) var<storage, read_write> cluster_bounds: array<atomic<u32>>;
@group(0) @binding(9) var<storage, read> lit_texels: array<u32>;
@group(0) @binding(10) var<storage, read> lit_texel_groups: array<vec4u>;

override mapping_is_exact: bool;
override attribute_is_flux: bool;
override normal_distance_is_signed: bool;

const LANES: u32 = 256u;
// Room for a bit a cluster.
const LIST_WORDS: u32 = MAX_CLUSTERS / 32u;

// Bit c: cluster c competes in this group of texels.
var<workgroup> competitors: array<atomic<u32>, LIST_WORDS>;

@compute @workgroup_size(64)
fn clear(@builtin(global_invocation_id) id: vec3u) {
    let counter = arrayLength(&cluster_bounds) - 1u;
    if id.x <= counter {
        // Rectangles start inside out; the counter at the end starts at zero.
        let least = id.x < counter && id.x % 4u < 2u;
        atomicStore(&cluster_bounds[id.x], select(0u, 0xffffffffu, least));
    }
}

fn in_window(texel: vec2f, centre: vec2f) -> bool {
    let offset = abs(texel - centre);
    return max(offset.x, offset.y) <= 0.5 * f32(params.window);
}

// Between a cluster and a texel, 0 to 1. A cluster's flux is that of its centre, as the paper updates it ([VAL] 4).
fn difference(c: u32, flux: vec3f, rho: f32) -> f32 {
    if !attribute_is_flux {
        return abs(clusters_warped[c].importance - rho);
    }
    let size = textureDimensions(rsm_flux);
    let own = textureLoad(rsm_flux, min(vec2u(clusters_warped[c].texel), size - 1u), 0).rgb;
    // Over the sum of both: the weight means the same at any intensity.
    return distance(own, flux) / max(length(own) + length(flux), 1e-30);
}

@compute @workgroup_size(16, 16)
fn clear_map(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(cluster_map)) {
        textureStore(cluster_map, id.xy, vec4u(NO_CLUSTER));
    }
}

// Rectangle of the group's texels.
var<workgroup> low: array<atomic<u32>, 2>;
var<workgroup> high: array<atomic<u32>, 2>;

@compute @workgroup_size(LANES)
fn assign(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    if lane < LIST_WORDS {
        atomicStore(&competitors[lane], 0u);
    }
    if lane < 2u {
        atomicStore(&low[lane], 0xffffffffu);
        atomicStore(&high[lane], 0u);
    }
    workgroupBarrier();
    let place = LANES * (group.x + group.y * groups.x) + lane;
    let is_lit = place < lit_texel_groups[0].w;
    var id = vec2u(0u);
    if is_lit {
        id = vec2u(lit_texels[place] & 0xffffu, lit_texels[place] >> 16u);
        for (var axis = 0u; axis < 2u; axis++) {
            atomicMin(&low[axis], id[axis]);
            atomicMax(&high[axis], id[axis]);
        }
    }
    workgroupBarrier();
    let first = vec2f(vec2u(atomicLoad(&low[0]), atomicLoad(&low[1])));
    let last = vec2f(vec2u(atomicLoad(&high[0]), atomicLoad(&high[1]))) + 1.0;
    let count = min(arrayLength(&clusters_warped), MAX_CLUSTERS);
    for (var c = lane; c < count; c += LANES) {
        if clusters_warped[c].state == CLUSTER_ACTIVE {
            // The place of the group that is nearest to the centre.
            let nearest = clamp(clusters_warped[c].texel, first, last);
            if mapping_is_exact || in_window(nearest, clusters_warped[c].texel) {
                atomicOr(&competitors[c / 32u], 1u << (c % 32u));
            }
        }
    }
    workgroupBarrier();
    if !is_lit {
        return;
    }

    let size = textureDimensions(cluster_map);
    let flux = textureLoad(rsm_flux, id, 0).rgb;
    let position = texel_position(id, size, textureLoad(rsm_distance, id, 0).x);
    let normal = unpack_unit(textureLoad(rsm_normal, id, 0).x);
    let rho = textureLoad(importance, id, 0).x;
    let metric = Metric(params.weight_position, params.weight_normal, params.weight_attribute, max(scene_info.diagonal, 1e-30), normal_distance_is_signed);
    let texel = vec2f(id) + 0.5;
    let cell = cell_of_texel(id, size);
    var best = NO_CLUSTER;
    var best_distance = 3.0e38;
    for (var word = 0u; word < (count + 31u) / 32u; word++) {
        var bits = atomicLoad(&competitors[word]);
        while bits != 0u {
            let c = word * 32u + countTrailingZeros(bits);
            bits &= bits - 1u;
            if !in_cell(cell, clusters_warped[c].texel) || (!mapping_is_exact && !in_window(texel, clusters_warped[c].texel)) {
                continue;
            }
            let d = cluster_distance(metric, clusters_warped[c].position, clusters_warped[c].normal, position, normal, difference(c, flux, rho));
            if d < best_distance {
                best = c;
                best_distance = d;
            }
        }
    }
    if best == NO_CLUSTER {
        // No window holds it: the nearest of all takes its energy, one of its own view if there is any, and it is counted.
        var foreign = NO_CLUSTER;
        var foreign_distance = 3.0e38;
        for (var c = 0u; c < count; c++) {
            if clusters_warped[c].state == CLUSTER_ACTIVE {
                let d = cluster_distance(metric, clusters_warped[c].position, clusters_warped[c].normal, position, normal, difference(c, flux, rho));
                if in_cell(cell, clusters_warped[c].texel) {
                    if d < best_distance {
                        best = c;
                        best_distance = d;
                    }
                } else if d < foreign_distance {
                    foreign = c;
                    foreign_distance = d;
                }
            }
        }
        best = select(best, foreign, best == NO_CLUSTER);
        atomicAdd(&cluster_bounds[arrayLength(&cluster_bounds) - 1u], 1u);
    }
    textureStore(cluster_map, id, vec4u(best));
    if best != NO_CLUSTER {
        atomicMin(&cluster_bounds[4u * best], id.x);
        atomicMin(&cluster_bounds[4u * best + 1u], id.y);
        atomicMax(&cluster_bounds[4u * best + 2u], id.x);
        atomicMax(&cluster_bounds[4u * best + 3u], id.y);
    }
}
