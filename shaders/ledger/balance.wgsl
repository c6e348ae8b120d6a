// Account of energy between stages. The flux that lights get is all that the RSM reflects ([ACRSM] 5.3.1, with `flux: sum`); merging only moves light.
// What bounds it: reads of all texels, once.

#import common::cluster::{Cluster, CLUSTER_ACTIVE}

// What is handed over, and what arrives.
struct Account {
    before: vec3f,
    after: vec3f,
}

@group(0) @binding(0) var rsm_flux: texture_2d<f32>;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var split_light: texture_2d<f32>;
@group(0) @binding(3) var indirect_merged: texture_2d<f32>;
@group(0) @binding(4) var<storage, read_write> parts: array<Account>;
@group(0) @binding(5) var<storage, read_write> ledger: array<Account>;
@group(0) @binding(6) var<storage, read_write> imbalance: array<f32>;

override sampled: bool;

const ACCOUNTS: u32 = 2u;
const GROUPS: u32 = 64u;
const LANES: u32 = 256u;

var<workgroup> sums: array<vec3f, LANES>;

// Sum over the lanes of a workgroup, in a tree.
fn sum_of_lanes(lane: u32, value: vec3f) -> vec3f {
    sums[lane] = value;
    for (var half = LANES / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if lane < half {
            sums[lane] += sums[lane + half];
        }
    }
    return workgroupUniformLoad(&sums[0]);
}

fn sum_of_texels(image: texture_2d<f32>, first: u32) -> vec3f {
    let size = textureDimensions(image);
    var sum = vec3f(0.0);
    for (var i = first; i < size.x * size.y; i += GROUPS * LANES) {
        sum += textureLoad(image, vec2u(i % size.x, i / size.x), 0).rgb;
    }
    return sum;
}

fn sum_of_lights(first: u32) -> vec3f {
    var sum = vec3f(0.0);
    for (var i = first; i < arrayLength(&clusters); i += GROUPS * LANES) {
        if clusters[i].state == CLUSTER_ACTIVE {
            sum += clusters[i].flux;
        }
    }
    return sum;
}

@compute @workgroup_size(LANES)
fn tally(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * LANES + lane;
    let flux = Account(sum_of_lanes(lane, sum_of_texels(rsm_flux, first)), sum_of_lanes(lane, sum_of_lights(first)));
    let light = Account(sum_of_lanes(lane, sum_of_texels(split_light, first)), sum_of_lanes(lane, sum_of_texels(indirect_merged, first)));
    if lane == 0u {
        parts[group.x] = flux;
        parts[GROUPS + group.x] = light;
    }
}

@compute @workgroup_size(ACCOUNTS)
fn settle(@builtin(local_invocation_index) account: u32) {
    var all = Account(vec3f(0.0), vec3f(0.0));
    for (var i = account * GROUPS; i < (account + 1u) * GROUPS; i++) {
        all.before += parts[i].before;
        all.after += parts[i].after;
    }
    ledger[account] = all;
    let apart = abs(all.after - all.before) / max(max(abs(all.before), abs(all.after)), vec3f(1e-30));
    imbalance[account] = select(max(apart.x, max(apart.y, apart.z)), 0.0, sampled && account == 0u);
}
