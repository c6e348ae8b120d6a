// Where in the atlas the surface is that the camera sees. [PCA] 3.1.
// What bounds it: a draw of the whole scene, as in scene/surface.

#import common::scene::View
#import common::surface::corner_in_world

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> baked_corners: array<vec2f>;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) @interpolate(flat) flat_normal: vec3f,
    @location(2) front: vec2f,
    @location(3) back: vec2f,
}

@vertex
fn project(@builtin(vertex_index) index: u32) -> Corner {
    let corner = corner_in_world(index);
    let first = index / 3u * 6u + index % 3u;
    var out: Corner;
    out.clip = view.clip_from_world * vec4f(corner.world, 1.0);
    out.world = corner.world;
    out.flat_normal = corner.flat_normal;
    out.front = baked_corners[first];
    out.back = baked_corners[first + 3u];
    return out;
}

@fragment
fn locate(in: Corner) -> @location(0) vec2f {
    return select(in.back, in.front, dot(in.flat_normal, view.origin - in.world) >= 0.0);
}
