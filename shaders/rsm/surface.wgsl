// Surface attributes as the lights see them, an instance a view: the reflective shadow map. [RSM], [ACRSM] 5.1.1, table 5.1b; `common::surface` says
// what differs from the paper. Clip space is mapped into the view's cell, which is affine; what lies beside the cell is not drawn.
// What bounds it: the triangles times the views.

#import common::rsm::{scene_light_views, columns, rows, cell_of_view, is_parallel}
#import common::surface::{Corner, Surface, corner_in_world, describe_surface}

struct Params {
    rsm_size: u32,
}

@group(0) @binding(0) var<uniform> params: Params;

override textures: bool;

@vertex
fn project(@builtin(vertex_index) index: u32, @builtin(instance_index) viewer: u32) -> Corner {
    var corner = corner_in_world(index);
    let clip = scene_light_views[viewer].view.clip_from_world * vec4f(corner.world, 1.0);
    let cells = vec2f(vec2u(columns(), rows()));
    // Middle of the cell; y of clip space goes up, rows go down.
    let middle = (2.0 * vec2f(cell_of_view(viewer)) + 1.0) / cells - 1.0;
    corner.clip = vec4f(clip.xy / cells + clip.w * vec2f(middle.x, -middle.y), clip.zw);
    corner.viewer = viewer;
    return corner;
}

@fragment
fn describe(in: Corner) -> Surface {
    let view = scene_light_views[in.viewer].view;
    var to_viewer = view.origin - in.world;
    var distance = length(to_viewer);
    if is_parallel(in.viewer) {
        distance = -dot(to_viewer, view.forward);
        to_viewer = -view.forward;
    }
    let surface = describe_surface(in, to_viewer, distance, textures);
    if any(vec2u(in.clip.xy) / params.rsm_size != cell_of_view(in.viewer)) {
        discard;
    }
    return surface;
}
