// Importance warping: on one level of the pyramid, and down to a texel. [ACRSM] 4.5 and alg. 5.3, after [CLARBERG].

struct Warped {
    quadrant: vec2u, // 0 or 1 in x and y
    position: vec2f, // in [0, 1)² of that quadrant
    share: f32, // probability of the quadrant
}

// Largest float below 1.
const ALMOST_ONE: f32 = 0x1.fffffep-1;

// `weights`: (0, 0), (1, 0), (0, 1), (1, 1). Uniform points become points with a density in proportion to the weights. All zero: unwarped.
fn warp_quad(p: vec2f, weights: vec4f) -> Warped {
    let total = weights.x + weights.y + weights.z + weights.w;
    var out: Warped;
    let share_0 = select(0.5, (weights.x + weights.y) / total, total > 0.0);
    let lower = p.y < share_0;
    out.quadrant.y = select(1u, 0u, lower);
    out.position.y = select((p.y - share_0) / (1.0 - share_0), p.y / share_0, lower);
    let row = select(weights.zw, weights.xy, lower);
    let row_total = row.x + row.y;
    let share_x = select(0.5, row.x / row_total, row_total > 0.0);
    let left = p.x < share_x;
    out.quadrant.x = select(1u, 0u, left);
    out.share = select(1.0 - share_0, share_0, lower) * select(1.0 - share_x, share_x, left);
    out.position.x = select((p.x - share_x) / (1.0 - share_x), p.x / share_x, left);
    out.position = clamp(out.position, vec2f(0.0), vec2f(ALMOST_ONE));
    return out;
}

// The 2×2 texels of a level under a texel of the level above: (0, 0), (1, 0), (0, 1), (1, 1). Zero beyond the border, where a side is one texel.
fn quad_weights(pyramid: texture_2d<f32>, above: vec2u, level: u32) -> vec4f {
    let size = textureDimensions(pyramid, level);
    var weights: vec4f;
    for (var i = 0u; i < 4u; i++) {
        let texel = 2u * above + vec2u(i & 1u, i >> 1u);
        if all(texel < size) {
            weights[i] = textureLoad(pyramid, texel, level).x;
        }
    }
    return weights;
}

struct WarpedTexel {
    position: vec2f, // in texels of level 0
    texel: vec2u, // that which holds it
    probability: f32, // that a uniform point comes to this texel
}

// Moves a uniform point in [0, 1)² down `levels` levels of a pyramid of importance, from the coarsest. Within the cell of the level where that ends
// points are uniform again.
fn warp_to_texel(pyramid: texture_2d<f32>, seed: vec2f, levels: u32) -> WarpedTexel {
    let last = textureNumLevels(pyramid) - 1u;
    let stop = last - min(levels, last);
    var quadrant = vec2u(0u);
    var p = seed;
    var probability = 1.0;
    for (var level = last; level > stop; level--) {
        let warped = warp_quad(p, quad_weights(pyramid, quadrant, level - 1u));
        quadrant = 2u * quadrant + warped.quadrant;
        p = warped.position;
        probability *= warped.share;
    }
    // A pyramid may be wider than high, or the other way round.
    let cell = min(vec2u(1u << stop), textureDimensions(pyramid, 0));
    let side = vec2f(cell);
    // The sum may round up to the next texel, the parts cannot.
    let texel = quadrant * cell + min(vec2u(p * side), cell - 1u);
    return WarpedTexel((vec2f(quadrant) + p) * side, texel, probability / (side.x * side.y));
}
