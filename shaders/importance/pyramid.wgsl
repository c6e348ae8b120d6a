// Image pyramid of the importance map. [ACRSM] 4.5. The map's sides are powers of two, so every level halves exactly,
// until the shorter side is one texel: from there on the mean is over two.

#import common::warp::quad_weights

@group(0) @binding(0) var importance_map: texture_2d<f32>;
@group(0) @binding(1) var importance: texture_storage_2d<r32float, write>;
@group(0) @binding(2) var importance_finer: texture_2d<f32>;

@compute @workgroup_size(8, 8)
fn copy(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(importance)) {
        textureStore(importance, id.xy, textureLoad(importance_map, id.xy, 0));
    }
}

@compute @workgroup_size(8, 8)
fn reduce(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(importance)) {
        return;
    }
    let weights = quad_weights(importance_finer, id.xy, 0u);
    let size = textureDimensions(importance_finer);
    let share = select(0.25, 0.5, any(size == vec2u(1u)));
    textureStore(importance, id.xy, vec4f(share * (weights.x + weights.y + weights.z + weights.w), 0.0, 0.0, 0.0));
}
