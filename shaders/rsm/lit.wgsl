// Lit texels of the reflective shadow map in a list. Blocks of 16×16 texels mark theirs as bits, a scan over the blocks says where each starts, and each
// lane finds its own place from the bits before it: the order is that of the map, whichever comes first.
// Neighbours in the list are neighbours in the map, so that workgroups on 256 of them read what lies together.
// What bounds it: one read of the flux.

#import common::radiometry::max_component

@group(0) @binding(0) var rsm_flux: texture_2d<f32>;
@group(0) @binding(1) var<storage, read_write> lit_masks: array<u32>;
@group(0) @binding(2) var<storage, read_write> lit_starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> lit_texels: array<u32>;
@group(0) @binding(4) var<storage, read_write> lit_texel_groups: array<vec4u>;

const WORDS: u32 = 8u;
const LANES: u32 = 256u;
// Workgroups that a dispatch may have in a dimension.
const MOST_GROUPS: u32 = 65535u;

var<workgroup> marks: array<atomic<u32>, WORDS>;

@compute @workgroup_size(16, 16)
fn mark(
    @builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    if lane < WORDS {
        atomicStore(&marks[lane], 0u);
    }
    workgroupBarrier();
    if all(id.xy < textureDimensions(rsm_flux)) && max_component(textureLoad(rsm_flux, id.xy, 0).rgb) > 0.0 {
        atomicOr(&marks[lane / 32u], 1u << (lane % 32u));
    }
    workgroupBarrier();
    if lane < WORDS {
        lit_masks[(group.y * groups.x + group.x) * WORDS + lane] = atomicLoad(&marks[lane]);
    }
}

var<workgroup> counts: array<u32, LANES>;

@compute @workgroup_size(LANES)
fn scan(@builtin(local_invocation_index) lane: u32) {
    let blocks = arrayLength(&lit_starts);
    let share = (blocks + LANES - 1u) / LANES;
    let last = min((lane + 1u) * share, blocks);
    var own = 0u;
    for (var block = lane * share; block < last; block++) {
        for (var word = 0u; word < WORDS; word++) {
            own += countOneBits(lit_masks[WORDS * block + word]);
        }
    }
    counts[lane] = own;
    workgroupBarrier();
    var at = 0u;
    for (var i = 0u; i < lane; i++) {
        at += counts[i];
    }
    for (var block = lane * share; block < last; block++) {
        lit_starts[block] = at;
        for (var word = 0u; word < WORDS; word++) {
            at += countOneBits(lit_masks[WORDS * block + word]);
        }
    }
    if lane == LANES - 1u {
        let groups = (at + LANES - 1u) / LANES;
        lit_texel_groups[0] = vec4u(min(groups, MOST_GROUPS), (groups + MOST_GROUPS - 1u) / MOST_GROUPS, 1u, at);
    }
}

@compute @workgroup_size(16, 16)
fn list(
    @builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group.y * groups.x + group.x;
    let bits = lit_masks[WORDS * block + lane / 32u];
    let bit = 1u << (lane % 32u);
    if (bits & bit) == 0u {
        return;
    }
    var place = lit_starts[block] + countOneBits(bits & (bit - 1u));
    for (var word = 0u; word < lane / 32u; word++) {
        place += countOneBits(lit_masks[WORDS * block + word]);
    }
    lit_texels[place] = id.x | id.y << 16u;
}
