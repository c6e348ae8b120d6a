// Debug view: indirect shadow term.

@group(0) @binding(0) var indirect: texture_2d<f32>;
@group(0) @binding(1) var view: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8)
fn show(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(view)) {
        textureStore(view, id.xy, vec4f(vec3f(textureLoad(indirect, id.xy, 0).a), 1.0));
    }
}
