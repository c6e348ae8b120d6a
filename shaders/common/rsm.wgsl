// The reflective shadow map: a grid of square cells, one a view of a light, at most six in a row. From texels to rays and positions, and back, for
// lights whose rays spread from a point (spot, point) and for those whose rays are parallel (directional). [RSM]; methods: radiometry.
// A node whose entry points reach one of these functions has the port `scene_light_views`; `size` is always that of the whole map.

#import common::scene::{Light, LightView, LIGHT_POINT, LIGHT_DIRECTIONAL}
#import common::view::{pixel_direction, pixel_solid_angle, view_uv}
#import common::radiometry::falloff

@group(1) @binding(auto) var<storage, read> scene_light_views: array<LightView>;

// Cells in a row: a point light has as many.
const MOST_COLUMNS: u32 = 6u;

fn view_count() -> u32 {
    return arrayLength(&scene_light_views);
}

fn columns() -> u32 {
    return min(MOST_COLUMNS, view_count());
}

fn rows() -> u32 {
    return (view_count() + MOST_COLUMNS - 1u) / MOST_COLUMNS;
}

// Side of a cell in texels.
fn cell_side(size: vec2u) -> u32 {
    return size.x / columns();
}

// Column and row of a view's cell.
fn cell_of_view(index: u32) -> vec2u {
    return vec2u(index % MOST_COLUMNS, index / MOST_COLUMNS);
}

// View whose cell holds a texel. Cells at the end of the last row may be no view's: then it is not below `view_count()`.
fn view_of_texel(texel: vec2u, size: vec2u) -> u32 {
    let cell = texel / cell_side(size);
    return cell.y * MOST_COLUMNS + cell.x;
}

// A rectangle of the map, in texels.
struct Cell {
    low: vec2f,
    high: vec2f,
}

// The cell that holds a texel.
fn cell_of_texel(texel: vec2u, size: vec2u) -> Cell {
    let side = cell_side(size);
    let low = vec2f(texel / side * side);
    return Cell(low, low + f32(side));
}

fn in_cell(cell: Cell, place: vec2f) -> bool {
    return all(place >= cell.low) && all(place < cell.high);
}

fn is_parallel(index: u32) -> bool {
    return scene_light_views[index].kind == LIGHT_DIRECTIONAL;
}

struct TexelRay {
    origin: vec3f, // the light, or where on the square before the scene the ray starts
    direction: vec3f, // unit
}

// A texel as a pixel of a view. Whole numbers are divided to find it, which is dear: what reads many texels of a view finds it once.
struct Place {
    view: u32,
    side: u32, // of the view's picture
    pixel: vec2u,
}

fn place_of_texel(texel: vec2u, size: vec2u) -> Place {
    let side = cell_side(size);
    let cell = texel / side;
    return Place(cell.y * MOST_COLUMNS + cell.x, side, texel - cell * side);
}

// Ray through the centre of a texel.
fn ray_at(place: Place) -> TexelRay {
    let view = scene_light_views[place.view].view;
    if is_parallel(place.view) {
        let ndc = vec2f(2.0, -2.0) * ((vec2f(place.pixel) + 0.5) / f32(place.side) - 0.5);
        return TexelRay(view.origin + view.right * (ndc.x * view.tan_half_x) + view.up * (ndc.y * view.tan_half_y), view.forward);
    }
    return TexelRay(view.origin, pixel_direction(view, place.pixel, vec2u(place.side)));
}

fn texel_ray(texel: vec2u, size: vec2u) -> TexelRay {
    return ray_at(place_of_texel(texel, size));
}

// Where a texel's ray meets the surface that it saw, world space.
fn texel_position(texel: vec2u, size: vec2u, distance: f32) -> vec3f {
    let ray = texel_ray(texel, size);
    return ray.origin + ray.direction * distance;
}

// What a texel's rays are spread over: solid angle, sr; of parallel rays the area across them, m².
fn extent_at(place: Place) -> f32 {
    let view = scene_light_views[place.view].view;
    if is_parallel(place.view) {
        let width = 2.0 * view.tan_half_x / f32(place.side);
        return width * width;
    }
    return pixel_solid_angle(view, place.pixel, vec2u(place.side));
}

// Power that a light sends through a texel, over its strength: sr; of parallel rays m².
fn power_of_unit_strength_at(light: Light, place: Place) -> f32 {
    return falloff(light, ray_at(place).direction) * extent_at(place);
}

// A texel seen at a grazing angle stands for an area of its extent at that distance / cosθ: the cosine is kept from zero, which bounds the area at 50 times.
const MIN_COSINE: f32 = 0.02;

// Surface that a texel stands for, m²: `cosine` at the surface, towards the light.
fn area_at(place: Place, distance: f32, cosine: f32) -> f32 {
    let spread = select(distance, 1.0, is_parallel(place.view));
    return extent_at(place) * spread * spread / max(cosine, MIN_COSINE);
}

fn texel_area(texel: vec2u, size: vec2u, distance: f32, cosine: f32) -> f32 {
    return area_at(place_of_texel(texel, size), distance, cosine);
}

// Where a view sees a world position: (0, 0) is the top left corner of its cell, (1, 1) the bottom right; distance along its axis in z (≤ 0: behind it).
fn position_in_cell(index: u32, position: vec3f) -> vec3f {
    let view = scene_light_views[index].view;
    if is_parallel(index) {
        let v = position - view.origin;
        return vec3f(0.5 + 0.5 * dot(v, view.right) / view.tan_half_x, 0.5 - 0.5 * dot(v, view.up) / view.tan_half_y, dot(v, view.forward));
    }
    return view_uv(view, position);
}

// The same in texels of the whole map.
fn position_in_map(index: u32, position: vec3f, size: vec2u) -> vec3f {
    let seen = position_in_cell(index, position);
    let side = cell_side(size);
    return vec3f(seen.xy * f32(side) + vec2f(cell_of_view(index) * side), seen.z);
}

// The place of a view's cell that is nearest to where it sees a position, in [0, 1]². Positions behind a light are beyond the border that is nearest to them.
fn place_towards(index: u32, position: vec3f) -> vec2f {
    let seen = position_in_cell(index, position);
    let v = position - scene_light_views[index].view.origin;
    let least = 1e-3 * length(v);
    if is_parallel(index) || seen.z > least {
        return saturate(seen.xy);
    }
    let view = scene_light_views[index].view;
    let side = vec2f(dot(v, view.right), -dot(v, view.up)) / max(least, 1e-30);
    return saturate(0.5 + 0.5 * side / vec2f(view.tan_half_x, view.tan_half_y));
}

// Distance of a world position from its light as the map holds distances.
fn distance_in_view(index: u32, position: vec3f) -> f32 {
    let v = position - scene_light_views[index].view.origin;
    return select(length(v), dot(v, scene_light_views[index].view.forward), is_parallel(index));
}

// Views of a view's light.
fn views_of_light(index: u32) -> u32 {
    return select(1u, MOST_COLUMNS, scene_light_views[index].kind == LIGHT_POINT);
}

// The view that sees a world position, of the light that has view `index`.
fn view_towards(index: u32, position: vec3f) -> u32 {
    if scene_light_views[index].kind != LIGHT_POINT {
        return index;
    }
    let v = position - scene_light_views[index].view.origin;
    let size = abs(v);
    var axis = 2u;
    if size.x >= size.y && size.x >= size.z {
        axis = 0u;
    } else if size.y >= size.z {
        axis = 1u;
    }
    return index - scene_light_views[index].face + 2u * axis + select(0u, 1u, v[axis] < 0.0);
}
