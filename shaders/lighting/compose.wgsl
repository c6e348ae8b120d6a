// Composition of direct and indirect light. [ACRSM] 5.3.4.

@group(0) @binding(0) var direct: texture_2d<f32>;
@group(0) @binding(1) var indirect: texture_2d<f32>;
@group(0) @binding(2) var composed: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn compose(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(composed)) {
        return;
    }
    textureStore(composed, id.xy, vec4f(textureLoad(direct, id.xy, 0).rgb + textureLoad(indirect, id.xy, 0).rgb, 1.0));
}
