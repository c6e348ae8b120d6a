// Culling of virtual lights by a bound on what they can give. Of each block of pixels the least and the greatest form factor of every light of its tile
// are bounded; lights are left out as long as the sum of the greatest is within a share of the sum of the least, which each pixel gets for certain.
// So what a pixel loses is below that share of its unshadowed light, whatever stands between. Negative lights count by their size.
// Light is luminance: a light of another colour than the rest may cost more of one channel.
// What bounds it: two bounds a light of a block, as against 64 form factors with their shadows.

#import common::bounds::{SurfaceBounds, form_factor_bounds}
#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::culling::{BlockLoss, Culled, lights_of_tile, words_of_tile}
#import common::dispatch::linear_index
#import common::radiometry::luminance
#import common::scene::SceneInfo

struct Params {
    tiles: u32,
    vpl_clamp: f32,
    cull: f32,
}

@group(0) @binding(0) var<storage, read> surface_blocks: array<SurfaceBounds>;
@group(0) @binding(1) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(2) var<uniform> scene_info: SceneInfo;
@group(0) @binding(3) var<uniform> params: Params;
@group(0) @binding(4) var<storage, read_write> block_lights: array<u32>;
@group(0) @binding(5) var<storage, read_write> block_losses: array<BlockLoss>;
@group(0) @binding(6) var<storage, read_write> culled: array<Culled>;

override lights_is_val: bool;

const LANES: u32 = 256u;
// A light is left out only if it takes no more than so many equal parts of what may be lost: one that takes all would leave none for the others.
const PARTS: f32 = 4.0;
// Sums in 32 bits over 4096 lights are off by less than this share.
const ROUNDING: f32 = 1e-3;

// Least and greatest irradiance of any pixel of the block by a light, W/m².
fn irradiance_bounds(block: SurfaceBounds, light: u32) -> vec2f {
    let cluster = clusters[light];
    if cluster.state != CLUSTER_ACTIVE || cluster.count == 0u {
        return vec2f(0.0);
    }
    let least = params.vpl_clamp * scene_info.diagonal;
    let area = select(0.0, cluster.area, lights_is_val);
    let least_d2 = select(least * least, 0.0, lights_is_val);
    return luminance(abs(cluster.flux)) * form_factor_bounds(block, cluster.position, cluster.normal, area, least_d2);
}

@compute @workgroup_size(64)
fn choose(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&surface_blocks) {
        return;
    }
    let block = surface_blocks[index];
    let period = params.tiles * params.tiles;
    let tile = index / (arrayLength(&surface_blocks) / period);
    let count = lights_of_tile(tile, arrayLength(&clusters), period);
    let words = words_of_tile(arrayLength(&clusters), period);

    var loss: BlockLoss;
    if block.points > 0u {
        for (var j = 0u; j < count; j++) {
            let bounds = irradiance_bounds(block, tile + j * period);
            loss.least += bounds.x;
            loss.unreachable += select(0u, 1u, bounds.y <= 0.0);
        }
        loss.lights = count;
    }
    let all = params.cull * loss.least * (1.0 - ROUNDING);
    let most = min(all, PARTS * all / f32(max(loss.lights - loss.unreachable, 1u)));
    for (var word = 0u; word < words; word++) {
        var bits = 0u;
        for (var j = 32u * word; j < min(32u * word + 32u, loss.lights); j++) {
            let greatest = irradiance_bounds(block, tile + j * period).y;
            if greatest <= 0.0 {
                continue;
            }
            if greatest <= most && loss.lost + greatest <= all {
                loss.lost += greatest;
                loss.culled += 1u;
            } else {
                bits |= 1u << (j % 32u);
            }
        }
        block_lights[index * words + word] = bits;
    }
    block_losses[index] = loss;
}

var<workgroup> sums: array<Culled, LANES>;

// Losses are weighted by the block's pixels, and divided by their number at the end.
fn added(a: Culled, b: Culled) -> Culled {
    return Culled(
        a.lights + b.lights, a.unreachable + b.unreachable, a.culled + b.culled, a.pixels + b.pixels,
        max(a.largest_loss, b.largest_loss), a.mean_loss + b.mean_loss,
    );
}

@compute @workgroup_size(LANES)
fn sum(@builtin(local_invocation_index) lane: u32) {
    var own: Culled;
    for (var i = lane; i < arrayLength(&block_losses); i += LANES) {
        let loss = block_losses[i];
        let pixels = surface_blocks[i].points;
        let share = loss.lost / max(loss.least, 1e-30);
        own = added(own, Culled(loss.lights, loss.unreachable, loss.culled, pixels, share, share * f32(pixels)));
    }
    sums[lane] = own;
    workgroupBarrier();
    if lane == 0u {
        for (var i = 1u; i < LANES; i++) {
            own = added(own, sums[i]);
        }
        own.mean_loss /= f32(max(own.pixels, 1u));
        culled[0] = own;
    }
}
