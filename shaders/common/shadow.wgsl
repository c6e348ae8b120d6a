// Comparison of a receiver with a distance that a light sees along a ray.

// A ray that meets the receiver's tangent plane at a smaller cosine than this meets it too far away to say anything: the receiver's own distance is used.
const MIN_PLANE_COSINE: f32 = 0.05;
// The plane's distance is trusted within this factor of the receiver's.
const PLANE_RANGE: f32 = 2.0;

// Distance along `ray` (unit, from the light) at which it meets the tangent plane of the receiver at `to_receiver` (from the light).
// On a flat receiver this is what the map itself holds, so that a surface does not shadow itself however coarse the map.
fn receiver_distance(ray: vec3f, to_receiver: vec3f, normal: vec3f) -> f32 {
    let own = length(to_receiver);
    let cosine = dot(normal, ray);
    if abs(cosine) < MIN_PLANE_COSINE {
        return own;
    }
    return clamp(dot(normal, to_receiver) / cosine, own / PLANE_RANGE, own * PLANE_RANGE);
}
