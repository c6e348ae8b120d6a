// Paraboloid shadow maps without error at the edges of triangles. [CV] 4.2.
// Straight edges are curved in a paraboloid map, so moving vertices alone is wrong for large triangles. Here each triangle becomes the rectangle around its
// curved image, and every texel meets the triangle with its own ray: exact, with no tessellation. An instance is a map; the last rectangle of each is the
// empty map behind everything. Directions below a caster's horizon have no map. Cost: six vertices a triangle and map, and the texels of their rectangles.

#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::bvh::ray_offset
#import common::paraboloid::{basis, paraboloid_unproject, atlas_origin, Rectangle, above_horizon}
#import common::radiometry::PI
#import common::scene::{Vertex, Triangle, Object, SceneInfo}

struct Params {
    ism_size: u32,
    atlas_width: u32,
    ignored_radius: f32,
}

@group(0) @binding(0) var<storage, read> casters: array<Cluster>;
@group(0) @binding(1) var<storage, read> scene_vertices: array<Vertex>;
@group(0) @binding(2) var<storage, read> scene_triangles: array<Triangle>;
@group(0) @binding(3) var<storage, read> scene_objects: array<Object>;
@group(0) @binding(4) var<uniform> scene_info: SceneInfo;
@group(0) @binding(5) var<uniform> params: Params;

struct Corner {
    @builtin(position) clip: vec4f,
    @location(0) @interpolate(flat) a: vec3f, // corners of the triangle in the caster's frame
    @location(1) @interpolate(flat) b: vec3f,
    @location(2) @interpolate(flat) c: vec3f,
    @location(3) @interpolate(flat) origin: vec2u, // of the map in the atlas
    @location(4) @interpolate(flat) nearest: f32, // what is nearer casts no shadow; negative: the empty map
}

struct Texel {
    @location(0) distance: f32,
    @builtin(frag_depth) depth: f32,
}

// Reverse depth of an empty map: just above what it is cleared to.
const FARTHEST: f32 = 1e-7;

@vertex
fn enclose(@builtin(vertex_index) index: u32, @builtin(instance_index) map: u32) -> Corner {
    let caster = casters[map];
    let size = f32(params.ism_size);
    var out: Corner;
    out.origin = atlas_origin(map, params.ism_size, params.atlas_width / params.ism_size);
    out.nearest = -1.0;
    var box = Rectangle(vec2f(-1.0), vec2f(1.0));
    if index / 6u < arrayLength(&scene_triangles) {
        let triangle = scene_triangles[index / 6u];
        let world_from_object = scene_objects[triangle.object].world_from_object;
        let frame = basis(caster.normal);
        // Off its own surface, which would shadow it.
        let eye = caster.position + caster.normal * ray_offset(scene_info);
        out.a = ((world_from_object * vec4f(scene_vertices[triangle.a].position, 1.0)).xyz - eye) * frame; // transpose × vector
        out.b = ((world_from_object * vec4f(scene_vertices[triangle.b].position, 1.0)).xyz - eye) * frame;
        out.c = ((world_from_object * vec4f(scene_vertices[triangle.c].position, 1.0)).xyz - eye) * frame;
        out.nearest = params.ignored_radius * sqrt(caster.area / PI);
        box = Rectangle(vec2f(1.0), vec2f(-1.0));
        // Of objects that deform there may be fewer triangles than the buffer holds.
        if caster.state == CLUSTER_ACTIVE && caster.count > 0u && index / 6u < scene_info.triangle_count {
            box = above_horizon(out.a, out.b, out.c);
        }
        // Room for rounding: the texels decide.
        box.low = max(box.low - 1.0 / size, vec2f(-1.0));
        box.high = min(box.high + 1.0 / size, vec2f(1.0));
    }
    if any(box.low >= box.high) {
        out.clip = vec4f(0.0, 0.0, 0.0, 1.0); // all six in one place: nothing
        return out;
    }
    let corner = index % 6u; // two triangles: 0 1 2, 3 4 5
    let right = corner == 1u || corner == 2u || corner == 4u;
    let top = corner == 2u || corner == 4u || corner == 5u;
    let p = select(box.low, box.high, vec2<bool>(right, top));
    let columns = params.atlas_width / params.ism_size;
    let rows = (arrayLength(&casters) + columns - 1u) / columns;
    let atlas = vec2f(f32(params.atlas_width), f32(rows) * size);
    let uv = (vec2f(out.origin) + (0.5 + 0.5 * p) * size) / atlas;
    out.clip = vec4f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.5, 1.0);
    return out;
}

@fragment
fn measure(in: Corner) -> Texel {
    if in.nearest < 0.0 {
        return Texel(1.0, FARTHEST);
    }
    let texel = floor(in.clip.xy) - vec2f(in.origin);
    let ray = paraboloid_unproject((texel + 0.5) * (2.0 / f32(params.ism_size)) - 1.0);
    // On which side of the three edges the ray passes. Neighbours share edges and so their signs: no ray slips through between them.
    let sides = vec3f(dot(cross(in.a, in.b), ray), dot(cross(in.b, in.c), ray), dot(cross(in.c, in.a), ray));
    let plane = cross(in.b - in.a, in.c - in.a);
    let distance = dot(plane, in.a) / dot(plane, ray);
    let share = distance / scene_info.diagonal;
    // NaN, from a triangle seen edge-on, fails the comparisons.
    let hit = (all(sides >= vec3f(0.0)) || all(sides <= vec3f(0.0))) && distance > in.nearest && share > 0.0 && share < 1.0;
    if !hit {
        discard;
    }
    return Texel(share, 1.0 - share);
}
