// Scene and frame data as Rust fills it (crate manylight-scene, module `gpu_data`); layouts are compared when a shader loads.

// A pinhole camera, or a light seen as a camera, whose rays may be parallel. World space, right-handed; all vectors have unit length.
struct View {
    clip_from_world: mat4x4f, // reverse z: 1 at `near`, 0 at infinity; parallel rays: 1 where they start, 0 at `far`
    origin: vec3f, // parallel rays: the middle of the square where they start
    near: f32,
    right: vec3f,
    tan_half_x: f32, // tangent of half the horizontal field of view; parallel rays: half the width of the picture, in the units of the world
    up: vec3f,
    tan_half_y: f32,
    forward: vec3f,
    far: f32, // a distance beyond everything in the scene
}

const FALLOFF_LINEAR: u32 = 0u;
const FALLOFF_COSINE: u32 = 1u;
const FALLOFF_SMOOTH: u32 = 2u;

const LIGHT_SPOT: u32 = 0u;
const LIGHT_POINT: u32 = 1u;
const LIGHT_DIRECTIONAL: u32 = 2u;

struct Light {
    position: vec3f, // directional: middle of a disk across its rays, before the scene and as wide as all of it
    kind: u32,
    direction: vec3f, // unit: axis of a spot light, way of a directional one's rays
    falloff: u32, // spot
    strength: vec3f, // intensity along the axis, W/sr; directional: irradiance of a surface that faces it, W/m²
    beam_rad: f32, // half-angle of full intensity; point: π
    cutoff_rad: f32, // half-angle beyond which it is dark; point: π
    radius: f32, // of a directional light's disk
    share: f32, // of the power of all lights: how probably a path tracer sends a ray from it
    ray_density: f32, // share over what its rays are spread over: solid angle, sr; directional: area of the disk, m²
}

// A light, or a sixth of one, as a camera with a square picture: a cell of the reflective shadow map.
struct LightView {
    view: View, // its rays are parallel for a directional light
    light: u32, // index in `scene_lights`
    kind: u32, // of the light
    face: u32, // of a point light, whose six views follow each other: towards +x, −x, +y, −y, +z, −z; 0 for other lights
    weight: f32, // what a texel of it can reflect, over the same of the view where that is most
}

// Light of the sky at one time: what a ray meets that leaves the scene, W/(m² sr).
struct Sky {
    zenith: vec3f,
    daylight: f32, // share of its light that the sky has at this time; the radiances have it in them
    horizon: vec3f,
    exponent: f32, // from horizon to zenith by the sine of the elevation to this power
    ground: vec3f, // below the horizon
    is_lit: u32, // 0: all black
}

// Counters and sizes of the frame.
struct Frame {
    index: u32, // frames since the last reset
    seed: u32,
    time: f32, // scene time in seconds
    delta_time: f32,
}

// Seed of what is random once, not in every frame: who reads it in place of `Frame` need not run again while all else stays.
struct Seed {
    value: u32,
}

// Extent and statistics of the scene in world space at this time.
struct SceneInfo {
    bounds_min: vec3f,
    diagonal: f32, // of the bounding box
    bounds_max: vec3f,
    total_area: f32,
    area_min: f32, // smallest and largest triangle, before object transforms
    area_max: f32,
    edge_min: f32, // shortest and longest edge, before object transforms
    edge_max: f32,
    triangle_count: u32,
    object_count: u32,
    light_count: u32,
    texture_count: u32,
}

// Object space.
struct Vertex {
    position: vec3f,
    u: f32,
    normal: vec3f, // zero: use the flat normal of the triangle
    v: f32, // downwards: 0 is the top row of the picture
}

struct Triangle {
    a: u32, // vertices
    b: u32,
    c: u32,
    object: u32,
    material: u32,
}

struct Object {
    world_from_object: mat4x4f,
    normal_from_object: mat4x4f, // inverse transpose; the upper left 3×3 counts
}

const NO_TEXTURE: u32 = 0xffffffffu;

struct Material {
    diffuse: vec3f, // linear albedo, Kd
    diffuse_texture: u32, // layer of `scene_textures`, or NO_TEXTURE
    specular: vec3f, // linear, Ks
    shininess: f32, // Blinn exponent, Ns
}
