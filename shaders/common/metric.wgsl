// Distance between a cluster and an RSM texel. [ACRSM] eq. 4.4, [VAL] eq. 1.

// Convex weights of eq. 4.4 and the choice of the normal's distance.
struct Metric {
    position: f32,
    normal: f32,
    quality: f32, // importance, or flux
    diagonal: f32, // of the scene's bounding box: makes the weights mean the same at any scale
    signed_normals: bool, // 1 − n·m instead of the paper's 1 − |n·m|, which calls opposite faces equal
}

// Positions, normals, and the difference of the attribute, 0 to 1.
fn cluster_distance(m: Metric, p: vec3f, n: vec3f, q: vec3f, k: vec3f, difference: f32) -> f32 {
    let cosine = dot(n, k);
    let delta_normal = 1.0 - select(abs(cosine), cosine, m.signed_normals);
    return m.position * distance(p, q) / m.diagonal + m.normal * delta_normal + m.quality * difference;
}
