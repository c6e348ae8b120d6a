// Image pyramid of the importance map. [ACRSM] 4.5. The map's size is a power of two, so every level halves exactly.

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
    let p = 2u * id.xy;
    let sum = textureLoad(importance_finer, p, 0).x + textureLoad(importance_finer, p + vec2u(1u, 0u), 0).x
        + textureLoad(importance_finer, p + vec2u(0u, 1u), 0).x + textureLoad(importance_finer, p + vec2u(1u, 1u), 0).x;
    textureStore(importance, id.xy, vec4f(0.25 * sum, 0.0, 0.0, 0.0));
}
