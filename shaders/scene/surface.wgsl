// Surface attributes as the camera sees them. [ACRSM] 5.1.1, table 5.1a; `common::surface` says what differs from the paper.

#import common::scene::View
#import common::surface::{Corner, Surface, corner_in_world, describe_surface}

@group(0) @binding(0) var<uniform> view: View;

override textures: bool;

@vertex
fn project(@builtin(vertex_index) index: u32) -> Corner {
    var corner = corner_in_world(index);
    corner.clip = view.clip_from_world * vec4f(corner.world, 1.0);
    return corner;
}

@fragment
fn describe(in: Corner) -> Surface {
    let to_viewer = view.origin - in.world;
    return describe_surface(in, to_viewer, length(to_viewer), textures);
}
