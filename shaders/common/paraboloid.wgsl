// The hemisphere around a normal as the unit disk ([VAL] 5, [ACRSM] 5.3.2; paraboloid mapping), and imperfect shadow maps in an atlas.

// Two unit vectors that complete `normal` to a right-handed basis (Duff et al. 2017); columns: tangent, bitangent, normal.
fn basis(normal: vec3f) -> mat3x3f {
    let s = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (s + normal.z);
    let b = normal.x * normal.y * a;
    return mat3x3f(
        vec3f(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x),
        vec3f(b, s + normal.y * normal.y * a, -normal.y),
        normal,
    );
}

// Unit direction in the basis' space to the disk; |result| ≤ 1 for z ≥ 0. The antipode (z = -1) has no image: bounded instead.
fn paraboloid_project(local: vec3f) -> vec2f {
    return local.xy / max(1.0 + local.z, 1e-6);
}

// Disk to unit direction.
fn paraboloid_unproject(p: vec2f) -> vec3f {
    let r2 = dot(p, p);
    return vec3f(2.0 * p, 1.0 - r2) / (1.0 + r2);
}

// Distance on the disk per angle (rad) at `p`: the map is conformal with this scale.
fn paraboloid_scale(p: vec2f) -> f32 {
    return 0.5 * (1.0 + dot(p, p));
}

// Top left texel of a map in the atlas: maps fill rows of `maps_per_row`.
fn atlas_origin(map: u32, map_size: u32, maps_per_row: u32) -> vec2u {
    return vec2u(map % maps_per_row, map / maps_per_row) * map_size;
}
