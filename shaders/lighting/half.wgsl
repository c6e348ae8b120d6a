// Half resolution with a discontinuity test. [SOI] 3.5: S_locam are the pixels with even coordinates. All others lie between two or four of them; where
// position or normal differs from any of these by the threshold or more, or one of them does not exist, the pixel is lit on its own.
// Such pixels are gathered at the left of their rows, so that lighting them works on full workgroups, and needs to look at no others.
// Differs from the paper: S_locam holds pixels of the picture instead of means of four, which may lie on no surface. So they are exact, and no pixel is
// lit twice. There are two thresholds, as a position and a normal have no common unit.
// What bounds it: reads of up to five positions and normals a pixel; a row of 16,384 pixels takes 256 rounds.

#import common::octahedral::unpack_unit
#import common::refinement::{Refinement, INTERPOLATED, NO_SURFACE}
#import common::scene::SceneInfo
#import common::tiles::split_of_pixel

struct Params {
    tiles: u32,
    discontinuity_position: f32,
    discontinuity_normal: f32,
}

@group(0) @binding(0) var<uniform> scene_info: SceneInfo;
@group(0) @binding(1) var split_position: texture_2d<f32>;
@group(0) @binding(2) var split_normal: texture_2d<u32>;
@group(0) @binding(3) var<uniform> params: Params;
@group(0) @binding(4) var half_position: texture_storage_2d<rgba32float, write>;
@group(0) @binding(5) var half_normal: texture_storage_2d<r32uint, write>;
@group(0) @binding(6) var refined_position: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var refined_normal: texture_storage_2d<r32uint, write>;
@group(0) @binding(8) var refined_column: texture_storage_2d<r32uint, write>;
@group(0) @binding(9) var<storage, read_write> refinement_rows: array<vec2u>;
@group(0) @binding(10) var<storage, read_write> refinement: array<Refinement>;

const LANES: u32 = 64u;

// Where a pixel is in the split textures.
fn split_of(pixel: vec2u) -> vec2u {
    return split_of_pixel(pixel, textureDimensions(split_position) / params.tiles, params.tiles);
}

@compute @workgroup_size(8, 8)
fn halve(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(half_position)) {
        return;
    }
    let split = split_of(2u * id.xy);
    textureStore(half_position, id.xy, textureLoad(split_position, split, 0));
    textureStore(half_normal, id.xy, textureLoad(split_normal, split, 0));
}

// Whether a pixel with a surface is unlike one of those that it would be interpolated from.
fn differs(pixel: vec2u, position: vec3f, normal: vec3f) -> bool {
    let odd = pixel & vec2u(1u);
    if all(odd == vec2u(0u)) {
        return false;
    }
    for (var corner = 0u; corner < 4u; corner++) {
        let offset = vec2u(corner & 1u, corner >> 1u);
        // An even coordinate has no neighbour ahead.
        if any(offset > odd) {
            continue;
        }
        let neighbour = pixel - odd + 2u * offset;
        if any(neighbour >= textureDimensions(refined_column)) {
            return true;
        }
        let split = split_of(neighbour);
        let surface = textureLoad(split_position, split, 0);
        if surface.a <= 0.0
            || distance(surface.xyz, position) >= params.discontinuity_position * scene_info.diagonal
            || distance(unpack_unit(textureLoad(split_normal, split, 0).x), normal) >= params.discontinuity_normal {
            return true;
        }
    }
    return false;
}

// A bit a lane, for what is lit on its own and what shows a surface.
var<workgroup> marked: array<atomic<u32>, 2>;
var<workgroup> surfaces: array<atomic<u32>, 2>;

@compute @workgroup_size(64)
fn mark(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let size = textureDimensions(refined_column);
    let y = group.x;
    let bit = 1u << (lane % 32u);
    // In this row so far.
    var refined = 0u;
    var seen = 0u;
    for (var first = 0u; first < size.x; first += LANES) {
        if lane < 2u {
            atomicStore(&marked[lane], 0u);
            atomicStore(&surfaces[lane], 0u);
        }
        workgroupBarrier();
        let pixel = vec2u(first + lane, y);
        var position = vec4f(0.0);
        var code = 0u;
        var refine = false;
        if pixel.x < size.x {
            let split = split_of(pixel);
            position = textureLoad(split_position, split, 0);
            code = textureLoad(split_normal, split, 0).x;
            if position.a > 0.0 {
                refine = differs(pixel, position.xyz, unpack_unit(code));
                atomicOr(&surfaces[lane / 32u], bit);
            }
        }
        if refine {
            atomicOr(&marked[lane / 32u], bit);
        }
        workgroupBarrier();
        let low = atomicLoad(&marked[0]);
        let high = atomicLoad(&marked[1]);
        let before = select(countOneBits(low & (bit - 1u)), countOneBits(low) + countOneBits(high & (bit - 1u)), lane >= 32u);
        let column = refined + before;
        refined += countOneBits(low) + countOneBits(high);
        seen += countOneBits(atomicLoad(&surfaces[0])) + countOneBits(atomicLoad(&surfaces[1]));
        workgroupBarrier();
        if refine {
            textureStore(refined_position, vec2u(column, y), position);
            textureStore(refined_normal, vec2u(column, y), vec4u(code));
        }
        if pixel.x < size.x {
            let kept = select(NO_SURFACE, INTERPOLATED, position.a > 0.0);
            textureStore(refined_column, pixel, vec4u(select(kept, column, refine)));
        }
    }
    for (var x = refined + lane; x < size.x; x += LANES) {
        textureStore(refined_position, vec2u(x, y), vec4f(0.0));
        textureStore(refined_normal, vec2u(x, y), vec4u(0u));
    }
    if lane == 0u {
        refinement_rows[y] = vec2u(seen, refined);
    }
}

var<workgroup> sums: array<vec2u, LANES>;

@compute @workgroup_size(64)
fn count(@builtin(local_invocation_index) lane: u32) {
    var own = vec2u(0u);
    for (var y = lane; y < arrayLength(&refinement_rows); y += LANES) {
        own += refinement_rows[y];
    }
    sums[lane] = own;
    workgroupBarrier();
    if lane == 0u {
        var sum = vec2u(0u);
        for (var i = 0u; i < LANES; i++) {
            sum += sums[i];
        }
        refinement[0] = Refinement(sum.x, sum.y, 1.0 - f32(sum.y) / f32(max(sum.x, 1u)));
    }
}
