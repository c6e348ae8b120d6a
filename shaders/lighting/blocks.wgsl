// Blocks of a split picture that show a surface, and bounds of the surface in each.
// An invocation does a whole block, so that nothing depends on the order of others; the list keeps the blocks' order.
// What bounds it: two reads of all positions and normals.

#import common::bounds::SurfaceBounds
#import common::dispatch::linear_index
#import common::lit_tiles::{BLOCK, place_of_block, corner_of_tile}
#import common::octahedral::unpack_unit

struct Params {
    tiles: u32,
}

@group(0) @binding(0) var split_position: texture_2d<f32>;
@group(0) @binding(1) var split_normal: texture_2d<u32>;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var<storage, read_write> surface_blocks: array<SurfaceBounds>;
@group(0) @binding(4) var<storage, read_write> lit_blocks: array<u32>;
@group(0) @binding(5) var<storage, read_write> lit_block_groups: array<vec4u>;

const LANES: u32 = 256u;
// Below this length the sum of unit normals, over their number, has no direction worth the name.
const CANCELLED: f32 = 1e-3;
// Workgroups that a dispatch may have in a dimension.
const MOST_GROUPS: u32 = 65535u;

@compute @workgroup_size(64)
fn bound(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let index = linear_index(id, groups, 64u);
    if index >= arrayLength(&surface_blocks) {
        return;
    }
    let tile = textureDimensions(split_position) / params.tiles;
    let place = place_of_block(index, tile);
    let first = corner_of_tile(place.tile, tile, params.tiles) + place.within;
    let extent = min(vec2u(BLOCK), tile - place.within);

    var low = vec3f(3e38);
    var high = vec3f(-3e38);
    var normals = vec3f(0.0);
    var points = 0u;
    for (var y = 0u; y < extent.y; y++) {
        for (var x = 0u; x < extent.x; x++) {
            let texel = first + vec2u(x, y);
            let surface = textureLoad(split_position, texel, 0);
            if surface.a > 0.0 {
                low = min(low, surface.xyz);
                high = max(high, surface.xyz);
                normals += unpack_unit(textureLoad(split_normal, texel, 0).x);
                points += 1u;
            }
        }
    }
    var block: SurfaceBounds;
    block.points = points;
    block.first = first.x | first.y << 16u;
    if points > 0u {
        block.middle = 0.5 * low + 0.5 * high;
        // The middle is rounded: what lies at the rim must not be outside.
        block.half_size = max(high - block.middle, block.middle - low);
        // Normals that cancel have no axis: any will do, as the spread is measured from it.
        block.axis = vec3f(0.0, 0.0, 1.0);
        if length(normals) > CANCELLED * f32(points) {
            block.axis = normalize(normals);
        }
        block.low = 3e38;
        block.high = -3e38;
        for (var y = 0u; y < extent.y; y++) {
            for (var x = 0u; x < extent.x; x++) {
                let texel = first + vec2u(x, y);
                let surface = textureLoad(split_position, texel, 0);
                if surface.a > 0.0 {
                    let normal = unpack_unit(textureLoad(split_normal, texel, 0).x);
                    let height = dot(normal, surface.xyz - block.middle);
                    block.low = min(block.low, height);
                    block.high = max(block.high, height);
                    block.spread = max(block.spread, distance(normal, block.axis));
                }
            }
        }
    }
    surface_blocks[index] = block;
}

var<workgroup> counts: array<u32, LANES>;

@compute @workgroup_size(LANES)
fn list(@builtin(local_invocation_index) lane: u32) {
    let all = arrayLength(&surface_blocks);
    let share = (all + LANES - 1u) / LANES;
    let last = min((lane + 1u) * share, all);
    var own = 0u;
    for (var i = lane * share; i < last; i++) {
        own += select(0u, 1u, surface_blocks[i].points > 0u);
    }
    counts[lane] = own;
    workgroupBarrier();
    var at = 0u;
    for (var i = 0u; i < lane; i++) {
        at += counts[i];
    }
    for (var i = lane * share; i < last; i++) {
        if surface_blocks[i].points > 0u {
            lit_blocks[at] = i;
            at += 1u;
        }
    }
    // What lies behind the last is not looked at, but is defined.
    if lane == LANES - 1u {
        for (var i = at; i < all; i++) {
            lit_blocks[i] = 0xffffffffu;
        }
        lit_block_groups[0] = vec4u(min(at, MOST_GROUPS), (at + MOST_GROUPS - 1u) / MOST_GROUPS, 1u, at);
    }
}
