// Geometry-aware filter. [ACRSM] 5.3.3, [IIR].
// box: any n×n neighbouring pixels hold each tile once, so where all are accepted their mean is the sum over all lights; the window is shifted,
// not cut, at the border of the picture. Where neighbours are refused the mean is over the rest: the lights of the refused tiles are lost there.
// tent: each tile is interpolated between its nearest pixels in x and y (at most four), and only a tile without any accepted one is lost.
// Differs from the paper: tent; α is measured from the tangent plane (a depth difference refuses neighbours on a floor seen at a grazing angle).
// What bounds it: (2n − 1)² or n² reads of light, position and normal per pixel.

#import common::scene::SceneInfo
#import common::octahedral::unpack_unit
#import common::radiometry::reflected_light
#import common::tiles::split_of_pixel

struct Params {
    tiles: u32,
    filter_alpha: f32,
    filter_beta: f32,
}

@group(0) @binding(0) var indirect_merged: texture_2d<f32>;
@group(0) @binding(1) var split_position: texture_2d<f32>;
@group(0) @binding(2) var split_normal: texture_2d<u32>;
@group(0) @binding(3) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(4) var<uniform> scene_info: SceneInfo;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var indirect: texture_storage_2d<rgba32float, write>;

override filter_is_tent: bool;

struct Receiver {
    pixel: vec2u,
    position: vec3f,
    normal: vec3f,
}

// Light of a pixel times its weight in rgba, and the weight that counts: zero where the pixel is another surface.
struct Tap {
    light: vec4f,
    weight: f32,
}

fn tap(r: Receiver, pixel: vec2u, weight: f32) -> Tap {
    let split = split_of_pixel(pixel, textureDimensions(split_position) / params.tiles, params.tiles);
    let surface = textureLoad(split_position, split, 0);
    let near = surface.a > 0.0 && abs(dot(r.normal, surface.xyz - r.position)) <= params.filter_alpha * scene_info.diagonal;
    if !near || dot(r.normal, unpack_unit(textureLoad(split_normal, split, 0).x)) < params.filter_beta {
        // The pixel itself always counts.
        if any(pixel != r.pixel) {
            return Tap(vec4f(0.0), 0.0);
        }
    }
    return Tap(textureLoad(indirect_merged, pixel, 0) * weight, weight);
}

fn box_filter(r: Receiver, size: vec2u) -> vec4f {
    let n = min(vec2u(params.tiles), size);
    let first = vec2u(clamp(vec2i(r.pixel) - vec2i((n - 1u) / 2u), vec2i(0), vec2i(size - n)));
    var light = vec4f(0.0);
    var weight = 0.0;
    for (var y = 0u; y < n.y; y++) {
        for (var x = 0u; x < n.x; x++) {
            let t = tap(r, first + vec2u(x, y), 1.0);
            light += t.light;
            weight += t.weight;
        }
    }
    return light / weight;
}

fn tent_filter(r: Receiver, size: vec2u) -> vec4f {
    let n = params.tiles;
    var light = vec4f(0.0);
    var present = 0.0;
    for (var j = 0u; j < n; j++) {
        for (var i = 0u; i < n; i++) {
            // How far the tile's last pixel lies behind this one, in x and y.
            let behind = (r.pixel + n - vec2u(i, j)) % n;
            var sum = vec4f(0.0);
            var weight = 0.0;
            for (var corner = 0u; corner < 4u; corner++) {
                let ahead = vec2u(corner & 1u, corner >> 1u);
                let w = vec2f(select(n - behind, behind, ahead == vec2u(1u)));
                let pixel = vec2i(r.pixel) - vec2i(behind) + vec2i(ahead * n);
                if w.x * w.y > 0.0 && all(pixel >= vec2i(0)) && all(pixel < vec2i(size)) {
                    let t = tap(r, vec2u(pixel), w.x * w.y);
                    sum += t.light;
                    weight += t.weight;
                }
            }
            if weight > 0.0 {
                light += sum / weight;
                present += 1.0;
            }
        }
    }
    return light / present;
}

@compute @workgroup_size(8, 8)
fn filter_light(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(indirect);
    if any(id.xy >= size) {
        return;
    }
    let split = split_of_pixel(id.xy, textureDimensions(split_position) / params.tiles, params.tiles);
    let surface = textureLoad(split_position, split, 0);
    if surface.a <= 0.0 {
        textureStore(indirect, id.xy, vec4f(0.0));
        return;
    }
    let r = Receiver(id.xy, surface.xyz, unpack_unit(textureLoad(split_normal, split, 0).x));
    var light: vec4f;
    if filter_is_tent {
        light = tent_filter(r, size);
    } else {
        light = box_filter(r, size);
    }
    textureStore(indirect, id.xy, reflected_light(textureLoad(gbuffer_albedo, id.xy, 0).rgb, light));
}
