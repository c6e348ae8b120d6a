// Gathering from the reflective shadow map. [RSM] 3.2 (texels as lights, eq. 1) and 4 (sampling: r = r_max ξ₁, angle = 2π ξ₂, weight ξ₁²).
// A sample i stands for 1 / (N p_i) texels. Polar samples have p = 1 / (2π r_max r) per texel², so this is 2π r_max² ξ₁ / N: then the sum is an unbiased
// estimate of the light of all texels within r_max. The paper's weight ξ₁² is not that; it is normalised here to 3π r_max² ξ₁² / N, with which a map
// of equal texels gives the same flux.
// Differs from the paper: ξ₁ is stratified and the angle grows by the golden angle; a texel is a disk of the surface that its sample stands for
// (methods: radiometry), where the paper has points; no interpolation from a smaller picture. Every view of every light is gathered from, with its
// share of the samples, around where it would see the pixel: the nearest place of its cell if it does not.
// What bounds it: three reads of the map per sample. Mesa's software adapters end all loops of an invocation after 65,535 rounds: samples and views stay
// far below.

#import common::scene::View
#import common::view::pixel_direction
#import common::rsm::{scene_light_views, view_count, cell_of_view, cell_side, place_towards, Place, ray_at, area_at}
#import common::octahedral::unpack_unit
#import common::random::{hash, unit_float, r2_point}
#import common::radiometry::{PI, disk_form_factor, max_component}

struct Params {
    radius: f32,
    samples: u32,
    turn: u32,
}

@group(0) @binding(0) var<uniform> scene_camera: View;
@group(0) @binding(1) var gbuffer_albedo: texture_2d<f32>;
@group(0) @binding(2) var gbuffer_normal: texture_2d<u32>;
@group(0) @binding(3) var gbuffer_distance: texture_2d<f32>;
@group(0) @binding(4) var rsm_flux: texture_2d<f32>;
@group(0) @binding(5) var rsm_normal: texture_2d<u32>;
@group(0) @binding(6) var rsm_distance: texture_2d<f32>;
@group(0) @binding(7) var<uniform> params: Params;
@group(0) @binding(8) var indirect: texture_storage_2d<rgba32float, write>;

override pattern_is_uniform: bool;
override weights_is_paper: bool;

// π (3 − √5)
const GOLDEN_ANGLE: f32 = 2.39996322972865;

// A place in a cell, in sides of it, and how many texels it stands for, over those of the cell.
struct Sample {
    offset: vec2f,
    share: f32,
}

// Sample `i` of `count`, relative to the pixel's place; `turn`: two numbers in [0, 1) of the pixel.
fn polar_sample(i: u32, count: u32, turn: vec2f) -> Sample {
    let xi = (f32(i) + turn.x) / f32(count);
    let angle = f32(i) * GOLDEN_ANGLE + 2.0 * PI * turn.y;
    let disk = PI * params.radius * params.radius / f32(count);
    return Sample(params.radius * xi * vec2f(cos(angle), sin(angle)), disk * select(2.0 * xi, 3.0 * xi * xi, weights_is_paper));
}

// Irradiance by the surface that a texel of a view saw, as a disk of the area of `texels` like it.
fn irradiance_by(place: Place, texels: f32, position: vec3f, normal: vec3f) -> vec3f {
    let texel = cell_of_view(place.view) * place.side + place.pixel;
    let flux = textureLoad(rsm_flux, texel, 0).rgb;
    if max_component(flux) <= 0.0 {
        return vec3f(0.0);
    }
    let ray = ray_at(place);
    let d = textureLoad(rsm_distance, texel, 0).x;
    let lit_normal = unpack_unit(textureLoad(rsm_normal, texel, 0).x);
    let v = position - (ray.origin + ray.direction * d);
    let d2 = dot(v, v);
    let direction = v * inverseSqrt(max(d2, 1e-30));
    let area = area_at(place, d, -dot(lit_normal, ray.direction)) * texels;
    return flux * texels * disk_form_factor(-dot(normal, direction), dot(lit_normal, direction), d2, area);
}

@compute @workgroup_size(8, 8)
fn gather(@builtin(global_invocation_id) id: vec3u) {
    let picture = textureDimensions(indirect);
    if any(id.xy >= picture) {
        return;
    }
    let distance = textureLoad(gbuffer_distance, id.xy, 0).x;
    if distance <= 0.0 {
        textureStore(indirect, id.xy, vec4f(0.0));
        return;
    }
    let position = scene_camera.origin + distance * pixel_direction(scene_camera, id.xy, picture);
    let normal = unpack_unit(textureLoad(gbuffer_normal, id.xy, 0).x);
    var turn = vec2f(0.5, 0.0);
    if params.turn != 0u {
        let bits = hash(id.x + picture.x * id.y);
        turn = vec2f(unit_float(bits), unit_float(hash(bits)));
    }
    var total_weight = 0.0;
    for (var view = 0u; view < view_count(); view++) {
        total_weight += scene_light_views[view].weight;
    }
    let side = cell_side(textureDimensions(rsm_flux));
    let texels = f32(side * side);
    var irradiance = vec3f(0.0);
    for (var view = 0u; view < view_count(); view++) {
        let share = scene_light_views[view].weight / max(total_weight, 1e-30);
        if share <= 0.0 {
            continue;
        }
        let count = max(u32(f32(params.samples) * share + 0.5), 1u);
        let centre = place_towards(view, position);
        for (var i = 0u; i < count; i++) {
            var chosen: Sample;
            var place: vec2f;
            if pattern_is_uniform {
                chosen.share = 1.0 / f32(count);
                place = fract(r2_point(i) + turn);
            } else {
                chosen = polar_sample(i, count, turn);
                place = centre + chosen.offset;
            }
            if all(place >= vec2f(0.0)) && all(place < vec2f(1.0)) {
                // The product may round up to the next texel.
                let pixel = min(vec2u(place * f32(side)), vec2u(side - 1u));
                irradiance += irradiance_by(Place(view, side, pixel), chosen.share * texels, position, normal);
            }
        }
    }
    let albedo = textureLoad(gbuffer_albedo, id.xy, 0).rgb;
    textureStore(indirect, id.xy, vec4f(albedo / PI * irradiance, 1.0));
}
