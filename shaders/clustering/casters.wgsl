// Virtual area lights that cast the shadows of many virtual point lights. [CV] 5 and 6.
// One workgroup does a whole step of k-means, so that it needs no barrier across groups; the order of its sums is fixed. The paper scatters by blending.
// Differs from the paper: positions are divided by the scene's diagonal and angles by π, so that the weights mean the same in any scene; a caster stands on
// the light nearest to its mean. Cost: lights × casters × iterations / 256 rounds of one workgroup; above 8 million lights × casters Mesa's software
// adapters would end its loops early.

#import common::cluster::{Cluster, CLUSTER_IDLE, CLUSTER_ACTIVE}
#import common::dispatch::linear_index
#import common::paraboloid::basis
#import common::radiometry::PI
#import common::scene::SceneInfo

struct Params {
    caster_position_weight: f32,
}

@group(0) @binding(0) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(1) var<uniform> scene_info: SceneInfo;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var<storage, read_write> casters: array<Cluster>;
@group(0) @binding(4) var<storage, read_write> caster_of: array<u32>;

override caster_centre_is_nearest: bool;

const LANES: u32 = 256u;
// A mean of normals shorter than this says nothing: the old one is kept.
const LEAST_NORMAL: f32 = 1e-3;

fn each_its_own() -> bool {
    return arrayLength(&casters) == arrayLength(&clusters);
}

fn shines(light: u32) -> bool {
    return clusters[light].state == CLUSTER_ACTIVE && clusters[light].count > 0u;
}

// Caster k starts as light ⌊k N / M⌋: the same lights in every frame lead to the same groups. [CV] 5.2, 6
@compute @workgroup_size(64)
fn start(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = linear_index(id, groups, 64u);
    if k >= arrayLength(&casters) {
        return;
    }
    // Without overflow: there are at most 4096 casters, and twice as many lights.
    casters[k] = clusters[k * arrayLength(&clusters) / arrayLength(&casters)];
}

// [CV] 5.1
fn nearest_caster(light: u32) -> u32 {
    let position = clusters[light].position;
    let normal = clusters[light].normal;
    var nearest = 0u;
    var least = 3e38;
    for (var k = 0u; k < arrayLength(&casters); k++) {
        if casters[k].state != CLUSTER_ACTIVE {
            continue;
        }
        let cosine = dot(normal, casters[k].normal);
        // atan2 has its precision at small angles, where acos has none.
        let angle = atan2(length(cross(normal, casters[k].normal)), cosine);
        let d = params.caster_position_weight * distance(position, casters[k].position) / max(scene_info.diagonal, 1e-30)
            + (1.0 - params.caster_position_weight) * angle / PI;
        if d < least {
            least = d;
            nearest = k;
        }
    }
    return nearest;
}

fn average(k: u32) {
    var position = vec3f(0.0);
    var normal = vec3f(0.0);
    var members = 0.0;
    for (var i = 0u; i < arrayLength(&clusters); i++) {
        if caster_of[i] == k && shines(i) {
            position += clusters[i].position;
            normal += clusters[i].normal;
            members += 1.0;
        }
    }
    if members == 0.0 {
        casters[k].state = CLUSTER_IDLE;
        return;
    }
    casters[k].position = position / members;
    if length(normal) > LEAST_NORMAL * members {
        casters[k].normal = normalize(normal);
    }
}

@compute @workgroup_size(256)
fn iterate(@builtin(local_invocation_index) lane: u32) {
    if each_its_own() {
        return;
    }
    for (var i = lane; i < arrayLength(&clusters); i += LANES) {
        caster_of[i] = nearest_caster(i);
    }
    storageBarrier();
    for (var k = lane; k < arrayLength(&casters); k += LANES) {
        average(k);
    }
}

@compute @workgroup_size(64)
fn assign(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear_index(id, groups, 64u);
    if i >= arrayLength(&caster_of) {
        return;
    }
    if each_its_own() {
        caster_of[i] = i;
    } else {
        caster_of[i] = nearest_caster(i);
    }
}

// What a caster adds up to, and the rectangle around its lights on the plane across its normal. [CV] 6
@compute @workgroup_size(64)
fn bound(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let k = linear_index(id, groups, 64u);
    if k >= arrayLength(&casters) || each_its_own() || casters[k].state != CLUSTER_ACTIVE {
        return;
    }
    let mean = casters[k].position;
    let frame = basis(casters[k].normal);
    var low = vec2f(0.0);
    var high = vec2f(0.0);
    var own_area = 0.0;
    var flux = vec3f(0.0);
    var count = 0u;
    var nearest = 0u;
    var least = 3e38;
    for (var i = 0u; i < arrayLength(&clusters); i++) {
        if caster_of[i] != k || !shines(i) {
            continue;
        }
        let offset = clusters[i].position - mean;
        let projected = (offset * frame).xy; // transpose × vector
        low = min(low, projected);
        high = max(high, projected);
        own_area = max(own_area, clusters[i].area);
        flux += clusters[i].flux;
        count += clusters[i].count;
        if dot(offset, offset) < least {
            least = dot(offset, offset);
            nearest = i;
        }
    }
    casters[k].flux = flux;
    casters[k].count = count;
    // A group of one, or along a line, is as large as its largest light.
    casters[k].area = max((high.x - low.x) * (high.y - low.y), own_area);
    if count == 0u {
        casters[k].state = CLUSTER_IDLE;
    } else if caster_centre_is_nearest {
        casters[k].position = clusters[nearest].position;
        casters[k].texel = clusters[nearest].texel;
    }
}
