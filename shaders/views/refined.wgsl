// Debug view: pixels by the resolution at which they are lit. [SOI] 3.5.

#import common::refinement::{INTERPOLATED, NO_SURFACE}

@group(0) @binding(0) var refined_column: texture_2d<u32>;
@group(0) @binding(1) var view: texture_storage_2d<rgba8unorm, write>;

@compute @workgroup_size(8, 8)
fn show(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(view)) {
        return;
    }
    let column = textureLoad(refined_column, id.xy, 0).x;
    var colour = vec3f(1.0, 0.0, 0.0);
    if column == NO_SURFACE {
        colour = vec3f(0.0);
    } else if column == INTERPOLATED {
        // Those with even coordinates are lit, the others lie between them.
        colour = select(vec3f(0.15, 0.15, 0.25), vec3f(0.45), all((id.xy & vec2u(1u)) == vec2u(0u)));
    }
    textureStore(view, id.xy, vec4f(colour, 1.0));
}
