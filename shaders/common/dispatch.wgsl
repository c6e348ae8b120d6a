// Index of an invocation of a step over `Elements`, whose groups may be folded into rows.

fn linear_index(id: vec3u, groups: vec3u, workgroup_width: u32) -> u32 {
    return id.x + id.y * groups.x * workgroup_width;
}
