// Importance warping of one point on one level of the pyramid. [ACRSM] 4.5 and alg. 5.3, after [CLARBERG].

struct Warped {
    quadrant: vec2u, // 0 or 1 in x and y
    position: vec2f, // in [0, 1)² of that quadrant
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
    out.position.x = select((p.x - share_x) / (1.0 - share_x), p.x / share_x, left);
    out.position = clamp(out.position, vec2f(0.0), vec2f(ALMOST_ONE));
    return out;
}
