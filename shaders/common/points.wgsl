// Points that stand for the surfaces of the scene in imperfect shadow maps, as Rust fills them (crate manylight-scene, modules `points`
// and `gpu_data`); the layout is compared when a shader loads. Point i belongs to shadow map i mod N.

// Object space.
struct ScenePoint {
    position: vec3f,
    area: f32, // the surface it stands for, in square world units at time 0
    normal: vec3f, // unit length, geometric
    object: u32,
}

// `object` of a point that is in world space already (points made each frame from the current triangles).
const WORLD_SPACE: u32 = 0xffffffffu;
