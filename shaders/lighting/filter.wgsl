// Geometry-aware box filter. [ACRSM] 5.3.3, [IIR].
// Any n×n neighbouring pixels hold each tile once, so where all neighbours are accepted the mean is the sum over all lights; the window is
// shifted, not cut, at the border of the picture. Where neighbours are refused the mean is over the rest: an error at edges.
// Differs from the paper: α is measured from the tangent plane (a depth difference refuses neighbours on a floor seen at a grazing angle).

#import common::scene::{View, SceneInfo}
#import common::view::pixel_direction
#import common::octahedral::unpack_unit
#import common::radiometry::{PI, luminance}

struct Params {
    tiles: u32,
    filter_alpha: f32,
    filter_beta: f32,
}

@group(0) @binding(0) var indirect_merged: texture_2d<f32>;
@group(0) @binding(1) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(2) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(3) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(4) var<uniform> scene_camera: View;
@group(0) @binding(5) var<uniform> scene_info: SceneInfo;
@group(0) @binding(6) var<uniform> params: Params;
@group(0) @binding(7) var indirect: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn filter_light(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(indirect);
    if any(id.xy >= size) {
        return;
    }
    let distance = textureLoad(gbuffer_distance, id.xy, 0).x;
    if distance <= 0.0 {
        textureStore(indirect, id.xy, vec4f(0.0));
        return;
    }
    let normal = unpack_unit(textureLoad(gbuffer_normal, id.xy, 0).x);
    let position = scene_camera.origin + distance * pixel_direction(scene_camera, id.xy, size);
    let n = min(vec2u(params.tiles), size);
    let first = vec2u(clamp(vec2i(id.xy) - vec2i((n - 1u) / 2u), vec2i(0), vec2i(size - n)));

    var sum = vec4f(0.0);
    var weight = 0.0;
    for (var y = 0u; y < n.y; y++) {
        for (var x = 0u; x < n.x; x++) {
            let pixel = first + vec2u(x, y);
            let d = textureLoad(gbuffer_distance, pixel, 0).x;
            if d <= 0.0 {
                continue;
            }
            let q = scene_camera.origin + d * pixel_direction(scene_camera, pixel, size);
            let near = abs(dot(normal, q - position)) <= params.filter_alpha * scene_info.diagonal;
            let alike = dot(normal, unpack_unit(textureLoad(gbuffer_normal, pixel, 0).x)) >= params.filter_beta;
            // The pixel itself always counts.
            if (near && alike) || all(pixel == id.xy) {
                sum += textureLoad(indirect_merged, pixel, 0);
                weight += 1.0;
            }
        }
    }
    let light = sum / max(weight, 1.0);
    let visible = select(1.0, saturate(luminance(light.rgb) / max(light.a, 1e-30)), light.a > 0.0);
    let albedo = textureLoad(gbuffer_albedo, id.xy, 0).rgb;
    textureStore(indirect, id.xy, vec4f(albedo / PI * light.rgb, visible));
}
