// Light at full resolution from half of it. [SOI] 3.5. Pixels with even coordinates are copied, those between them are the mean of their two or four
// neighbours: linear interpolation. The paper does not say which it uses.

#import common::radiometry::reflected_light
#import common::refinement::{INTERPOLATED, NO_SURFACE}

@group(0) @binding(0) var half_light: texture_2d<f32>;
@group(0) @binding(1) var refined_light: texture_2d<f32>;
@group(0) @binding(2) var refined_column: texture_2d<u32>;
@group(0) @binding(3) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(4) var indirect: texture_storage_2d<rgba32float, write>;

fn interpolated(pixel: vec2u) -> vec4f {
    let first = pixel / 2u;
    let last = first + (pixel & vec2u(1u));
    var sum = vec4f(0.0);
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            sum += textureLoad(half_light, vec2u(x, y), 0);
        }
    }
    let count = last - first + 1u;
    return sum / f32(count.x * count.y);
}

@compute @workgroup_size(8, 8)
fn upsample(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(indirect)) {
        return;
    }
    let column = textureLoad(refined_column, id.xy, 0).x;
    var light = vec4f(0.0);
    if column == INTERPOLATED {
        light = interpolated(id.xy);
    } else if column != NO_SURFACE {
        light = textureLoad(refined_light, vec2u(column, id.y), 0);
    } else {
        textureStore(indirect, id.xy, vec4f(0.0));
        return;
    }
    textureStore(indirect, id.xy, reflected_light(textureLoad(gbuffer_albedo, id.xy, 0).rgb, light));
}
