// Surface attributes by rasterization, for what sees the scene: the camera and the views of lights. [ACRSM] 5.1.1; the vertex shader reads vertices by
// index, so that one draw covers all meshes.
// Differs from the paper: octahedral normals (the paper's packing is singular at ±z), distance to the viewer instead of a
// hardware depth (so that positions follow from one ray and one multiplication), half floats instead of 8 bits (an albedo of
// 0.05 would be off by 4 %).
// A node whose entry points reach these functions has the ports `scene_vertices`, `scene_triangles`, `scene_objects`, `scene_materials` and
// `scene_textures`.

#import common::scene::{Vertex, Triangle, Object, Material, NO_TEXTURE}
#import common::octahedral::pack_unit

@group(1) @binding(auto) var<storage, read> scene_vertices: array<Vertex>;
@group(1) @binding(auto) var<storage, read> scene_triangles: array<Triangle>;
@group(1) @binding(auto) var<storage, read> scene_objects: array<Object>;
@group(1) @binding(auto) var<storage, read> scene_materials: array<Material>;
@group(1) @binding(auto) var scene_textures: texture_2d_array<f32>;
@group(1) @binding(auto) var linear_repeat_sampler: sampler;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f, // zero: flat
    @location(2) uv: vec2f,
    @location(3) @interpolate(flat) flat_normal: vec3f,
    @location(4) @interpolate(flat) material: u32,
    @location(5) @interpolate(flat) viewer: u32, // which of several draws it
}

struct Surface {
    @location(0) albedo: vec4f,
    @location(1) specular: vec4f,
    @location(2) normal: u32,
    @location(3) distance: f32,
}

// Corner `index` of all triangles in the world; where it is in the picture is left to the viewer.
fn corner_in_world(index: u32) -> Corner {
    let triangle = scene_triangles[index / 3u];
    let object = scene_objects[triangle.object];
    let a = scene_vertices[triangle.a];
    let b = scene_vertices[triangle.b];
    let c = scene_vertices[triangle.c];
    let corner = index % 3u;
    var vertex = a;
    if corner == 1u {
        vertex = b;
    } else if corner == 2u {
        vertex = c;
    }

    let normal_from_object = mat3x3f(object.normal_from_object[0].xyz, object.normal_from_object[1].xyz, object.normal_from_object[2].xyz);
    var out: Corner;
    out.world = (object.world_from_object * vec4f(vertex.position, 1.0)).xyz;
    out.normal = normal_from_object * vertex.normal;
    out.uv = vec2f(vertex.u, vertex.v);
    out.flat_normal = normal_from_object * cross(b.position - a.position, c.position - a.position);
    out.material = triangle.material;
    return out;
}

// What a surface is to a viewer, `to_viewer` being of any length. Where textures are sampled, control flow must be uniform; whether they are, `textured`, is
// a constant.
fn describe_surface(in: Corner, to_viewer: vec3f, distance: f32, textured: bool) -> Surface {
    let material = scene_materials[in.material];
    var albedo = material.diffuse;
    if textured {
        // Derivatives need uniform control flow: sample first, then decide.
        let texel = textureSample(scene_textures, linear_repeat_sampler, in.uv, min(material.diffuse_texture, textureNumLayers(scene_textures) - 1u));
        albedo *= select(vec3f(1.0), texel.rgb, material.diffuse_texture != NO_TEXTURE);
    }

    // A shading normal may be absent or cancel between corners; the flat one is the truth then.
    var normal = select(in.flat_normal, in.normal, dot(in.normal, in.normal) > 0.0);
    normal *= inverseSqrt(max(dot(normal, normal), 1e-37));
    // Two-sided surfaces: the flat normal decides which side is seen, so that smooth normals do not flip at silhouettes.
    let facing = select(-in.flat_normal, in.flat_normal, dot(in.flat_normal, to_viewer) >= 0.0);
    normal = select(-normal, normal, dot(normal, facing) >= 0.0);

    var out: Surface;
    out.albedo = vec4f(albedo, 1.0);
    out.specular = vec4f(material.specular, material.shininess);
    out.normal = pack_unit(normal);
    out.distance = distance;
    return out;
}
