// Texels of an atlas over the surfaces of the scene, as Rust fills them (crate manylight-scene, module `gpu_data`); the layout is compared when a
// shader loads.

// A texel without a surface.
const NO_TRIANGLE: u32 = 0xffffffffu;

// World space; normals are those of the side whose light the texel holds.
struct SurfaceTexel {
    position: vec3f,
    triangle: u32, // in `scene_triangles`, or NO_TRIANGLE
    normal: vec3f, // unit, smooth where the surface is
    u: f32, // barycentric weights of the second and third corner
    geometric: vec3f, // unit, the triangle's own
    v: f32,
}
