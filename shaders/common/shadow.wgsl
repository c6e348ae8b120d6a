// Comparison of a receiver with a distance that a light sees along a ray.

// A ray that meets the receiver's tangent plane at a smaller cosine than this meets it too far away to say anything: the receiver's own distance is used.
const MIN_PLANE_COSINE: f32 = 0.05;
// The plane's distance is trusted within this factor of the receiver's.
const PLANE_RANGE: f32 = 2.0;

// One over the distance along a ray from the light at which it meets the tangent plane of a receiver. On a flat receiver that is the distance which the
// map itself holds, so that a surface does not shadow itself however coarse the map.
// `cosine`: between the ray and the receiver's normal; `height`: receiver's offset from the light, along its normal; `own`: the receiver's distance.
// The reciprocal, because it needs no division per ray.
fn plane_reciprocal(cosine: f32, height: f32, own: f32) -> f32 {
    let trusted = clamp(cosine / height, 1.0 / (PLANE_RANGE * own), PLANE_RANGE / own);
    return select(1.0 / own, trusted, abs(cosine) >= MIN_PLANE_COSINE && height != 0.0);
}
