// Pull-push on blocks of 16×16 texels in workgroup memory: maps are multiples of 16 texels, so no level crosses the border of a map, and the
// whole operation is one pass over the atlas whatever the number of levels. [ACRSM] 5.3.2.
// Pull: median of the four texels below ([ACRSM]); of an even number of valid ones, the lower of the middle two. Push: a hole takes the value of the level above.
// Differs from the paper: a value is pulled only from at least two texels that agree in depth, so that silhouettes do not grow into thin air.
// What bounds it: one read and one write per texel of the atlas.

struct Params {
    pull_push: u32,
    agreement: f32,
}

@group(0) @binding(0) var<storage, read> ism_splats: array<u32>;
@group(0) @binding(1) var ism: texture_storage_2d<r32float, write>;
@group(0) @binding(2) var<uniform> params: Params;

// Each invocation has a square of 2×2 texels, a group 16×16.
const SIDE: u32 = 8u;
const NOTHING: f32 = 1.0;

// Levels 1 to 4, one after the other: 8², 4², 2², 1 texels.
var<workgroup> levels: array<f32, 85>;

// Where a level starts: sum of 64 / 4^(i - 1) for 1 ≤ i < level.
fn level_start(level: u32) -> u32 {
    return (256u - (1024u >> (2u * level))) / 3u;
}

fn median_of_four(v: vec4f) -> f32 {
    // A sorting network; NOTHING is the largest value, so valid ones come first.
    let a = vec4f(min(v.xz, v.yw), max(v.xz, v.yw)); // min01, min23, max01, max23
    let least = min(a.x, a.y);
    let greatest = max(a.z, a.w);
    let m1 = max(a.x, a.y);
    let m2 = min(a.z, a.w);
    let second = min(m1, m2);
    let third = max(m1, m2);
    // Fewer than two valid texels say nothing about a surface.
    if second >= NOTHING {
        return NOTHING;
    }
    var count = 2u;
    var farthest = second;
    if third < NOTHING {
        count = 3u;
        farthest = third;
        if greatest < NOTHING {
            count = 4u;
            farthest = greatest;
        }
    }
    if params.agreement < 1.0 && farthest - least > params.agreement * farthest {
        return NOTHING;
    }
    return select(second, least, count == 2u);
}

fn splat_at(texel: vec2u) -> f32 {
    let size = textureDimensions(ism);
    if any(texel >= size) {
        return NOTHING;
    }
    return bitcast<f32>(ism_splats[texel.y * size.x + texel.x]);
}

@compute @workgroup_size(8, 8)
fn pull_push(@builtin(global_invocation_id) id: vec3u, @builtin(local_invocation_id) local: vec3u, @builtin(local_invocation_index) lane: u32) {
    let corner = 2u * id.xy;
    var values = vec4f(splat_at(corner), splat_at(corner + vec2u(1u, 0u)), splat_at(corner + vec2u(0u, 1u)), splat_at(corner + vec2u(1u, 1u)));
    if params.pull_push > 0u {
        levels[lane] = median_of_four(values);
        for (var level = 2u; level <= params.pull_push; level++) {
            workgroupBarrier();
            let side = SIDE >> (level - 1u);
            if lane < side * side {
                let p = 2u * vec2u(lane % side, lane / side);
                let row = 2u * side;
                let at = level_start(level - 1u) + p.y * row + p.x;
                levels[level_start(level) + lane] = median_of_four(vec4f(levels[at], levels[at + 1u], levels[at + row], levels[at + row + 1u]));
            }
        }
        workgroupBarrier();
        // A hole takes the finest level that has a value: what pushing level by level leads to.
        var fill = NOTHING;
        for (var level = 1u; level <= params.pull_push && fill >= NOTHING; level++) {
            let p = local.xy >> vec2u(level - 1u);
            fill = levels[level_start(level) + p.y * (SIDE >> (level - 1u)) + p.x];
        }
        values = select(values, vec4f(fill), values >= vec4f(NOTHING));
    }
    // Stores outside, at odd sizes, have no effect.
    textureStore(ism, corner, vec4f(values.x, 0.0, 0.0, 0.0));
    textureStore(ism, corner + vec2u(1u, 0u), vec4f(values.y, 0.0, 0.0, 0.0));
    textureStore(ism, corner + vec2u(0u, 1u), vec4f(values.z, 0.0, 0.0, 0.0));
    textureStore(ism, corner + vec2u(1u, 1u), vec4f(values.w, 0.0, 0.0, 0.0));
}
