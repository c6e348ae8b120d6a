// Path tracer: the truth that the other pipelines are compared with. What a path gathers after its first surface is in common/path.
// The paths of a frame are spread evenly over pixel, light and directions; frames are independent.
// What bounds it: three rays per path and bounce and one for each light, each some tens of nodes.

#import common::scene::{Frame, View}
#import common::bvh::{MISSED, make_ray, intersect}
#import common::view::ray_direction
#import common::random::hash3
#import common::path::{BEFORE, PATHS_AT_ONCE, Gathered, light_of, path_index, random_pair, start_paths, surface_at}
#import common::sky::sky_radiance

struct Params {
    paths: u32,
    max_bounces: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> scene_camera: View;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var traced: texture_storage_2d<r32float, read_write>;

override component_is_direct: bool;
override component_is_one_bounce: bool;
override component_is_two_bounces: bool;
override component_is_indirect: bool;
override component_is_sky: bool;
override component_is_full: bool;

fn path(pixel: vec2u, size: vec2u) -> vec3f {
    let uv = (vec2f(pixel) + random_pair(BEFORE, 0u)) / vec2f(size);
    let ray = make_ray(scene_camera.origin, ray_direction(scene_camera, uv));
    let hit = intersect(ray, MISSED, false);
    let has_sky = component_is_sky || component_is_full;
    if hit.t >= MISSED {
        return select(vec3f(0.0), sky_radiance(ray.direction), has_sky);
    }
    let bounces = select(select(params.max_bounces, 2u, component_is_two_bounces), 1u, component_is_one_bounce);
    let has_lights = component_is_one_bounce || component_is_two_bounces || component_is_indirect || component_is_full;
    let what = Gathered(has_lights, has_sky, bounces);
    return light_of(surface_at(ray, hit), component_is_direct || component_is_full, what);
}

@compute @workgroup_size(8, 8)
fn clear(@builtin(global_invocation_id) id: vec3u) {
    if all(id.xy < textureDimensions(traced)) {
        textureStore(traced, id.xy, vec4f(0.0));
    }
}

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(traced) / vec2u(4u, 1u);
    if any(id.xy >= size) {
        return;
    }
    let pixel = id.x + id.y * size.x;
    var sum: vec4f;
    for (var i = 0u; i < 4u; i++) {
        sum[i] = textureLoad(traced, vec2u(4u * id.x + i, id.y)).x;
    }
    let first = u32(sum.a);
    start_paths(hash3(pixel, frame.index, frame.seed), first);
    for (path_index = first; path_index < min(first + PATHS_AT_ONCE, params.paths); path_index++) {
        sum += vec4f(path(id.xy, size), 1.0);
    }
    for (var i = 0u; i < 4u; i++) {
        textureStore(traced, vec2u(4u * id.x + i, id.y), vec4f(sum[i]));
    }
}
