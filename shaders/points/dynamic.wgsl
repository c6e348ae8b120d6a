// Points on triangles as they are now. [ACRSM] 5.2, eqs. 5.3 and 5.4; the hardware tessellator of the paper is replaced by
// weights per triangle, their prefix sum, and one invocation per point that looks its triangle up.
// Weights: area, or the number of points of the paper's factors, (t_A + mean t_e)² / 2: the vertices of a triangle with that many
// steps along each edge. Sums run in a fixed order. What bounds it: the binary search, 17 reads per point for 10⁵ triangles.
// Points lie as those of `points/static` do: along a line through all triangles that fills each of them, one at a random place of each of as many
// equal pieces, and pieces are shuffled in blocks. Every N-th point then samples all of the surface evenly, whatever N: point i belongs to map i mod N.

#import common::scene::{Vertex, Triangle, Object, SceneInfo, Seed}
#import common::points::{ScenePoint, WORLD_SPACE}
#import common::dispatch::linear_index
#import common::random::{hash3, unit_float}

struct Params {
    f_min: u32,
    f_max: u32,
}

@group(0) @binding(0) var<storage, read> scene_vertices: array<Vertex>;
@group(0) @binding(1) var<storage, read> scene_triangles: array<Triangle>;
@group(0) @binding(2) var<storage, read> scene_objects: array<Object>;
@group(0) @binding(3) var<uniform> scene_info: SceneInfo;
@group(0) @binding(4) var<uniform> seed: Seed;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var<storage, read_write> points: array<ScenePoint>;
@group(0) @binding(7) var<storage, read_write> point_offsets: array<f32>;
@group(0) @binding(8) var<storage, read_write> point_block_sums: array<f32>;

override method_is_area: bool;
override smoothstep_is_5th: bool;

const BLOCK: u32 = 256u;

struct Corners {
    a: vec3f,
    b: vec3f,
    c: vec3f,
}

fn corners(index: u32) -> Corners {
    let t = scene_triangles[index];
    let m = scene_objects[t.object].world_from_object;
    return Corners(
        (m * vec4f(scene_vertices[t.a].position, 1.0)).xyz,
        (m * vec4f(scene_vertices[t.b].position, 1.0)).xyz,
        (m * vec4f(scene_vertices[t.c].position, 1.0)).xyz,
    );
}

fn area_of(t: Corners) -> f32 {
    return 0.5 * length(cross(t.b - t.a, t.c - t.a));
}

// [ACRSM] 5.2; equal limits give the upper factor to all.
fn smooth_step(low: f32, high: f32, value: f32) -> f32 {
    let x = select(1.0, saturate((value - low) / (high - low)), high > low);
    return select(x * x * (3.0 - 2.0 * x), x * x * x * (x * (6.0 * x - 15.0) + 10.0), smoothstep_is_5th);
}

fn factor(low: f32, high: f32, value: f32) -> f32 {
    return max(ceil(smooth_step(low, high, value) * f32(params.f_max)), f32(params.f_min)); // [ACRSM] eqs. 5.3, 5.4
}

@compute @workgroup_size(64)
fn weigh(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear_index(id, groups, 64u);
    if i >= scene_info.triangle_count || i >= arrayLength(&point_offsets) {
        return;
    }
    let t = corners(i);
    let area = area_of(t);
    var weight = area;
    if !method_is_area && area > 0.0 {
        let t_a = factor(scene_info.area_min, scene_info.area_max, area);
        let t_e = (factor(scene_info.edge_min, scene_info.edge_max, distance(t.b, t.c))
            + factor(scene_info.edge_min, scene_info.edge_max, distance(t.c, t.a))
            + factor(scene_info.edge_min, scene_info.edge_max, distance(t.a, t.b))) / 3.0;
        let steps = t_a + t_e;
        weight = ceil(0.5 * steps * steps);
    }
    point_offsets[i] = weight;
}

var<workgroup> sums: array<f32, BLOCK>;

fn scan(lane: u32) {
    for (var reach = 1u; reach < BLOCK; reach *= 2u) {
        workgroupBarrier();
        var add = 0.0;
        if lane >= reach {
            add = sums[lane - reach];
        }
        workgroupBarrier();
        sums[lane] += add;
    }
    workgroupBarrier();
}

@compute @workgroup_size(256)
fn scan_blocks(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let block = group.x + group.y * groups.x;
    let i = block * BLOCK + lane;
    let inside = i < scene_info.triangle_count && i < arrayLength(&point_offsets);
    var weight = 0.0;
    if inside {
        weight = point_offsets[i];
    }
    sums[lane] = weight;
    scan(lane);
    if inside {
        point_offsets[i] = sums[lane];
    }
    if lane == BLOCK - 1u && block < arrayLength(&point_block_sums) {
        point_block_sums[block] = sums[lane];
    }
}

@compute @workgroup_size(256)
fn scan_sums(@builtin(local_invocation_index) lane: u32) {
    let blocks = min((scene_info.triangle_count + BLOCK - 1u) / BLOCK, arrayLength(&point_block_sums));
    var before = 0.0;
    for (var start = 0u; start < blocks; start += BLOCK) {
        let i = start + lane;
        var weight = 0.0;
        if i < blocks {
            weight = point_block_sums[i];
        }
        sums[lane] = weight;
        scan(lane);
        if i < blocks {
            point_block_sums[i] = before + sums[lane];
        }
        before += sums[BLOCK - 1u];
        workgroupBarrier();
    }
}

// Weight of all triangles before block `b`.
fn before_block(b: u32) -> f32 {
    if b == 0u {
        return 0.0;
    }
    return point_block_sums[b - 1u];
}

fn offset_up_to(i: u32) -> f32 {
    return before_block(i / BLOCK) + point_offsets[i];
}

// A piece of the line for point i: another one of the same block, whose size is a power of two. The multiplier is odd, so each piece comes once.
fn shuffled(i: u32, count: u32) -> u32 {
    let block = 1u << (clamp(firstLeadingBit(count), 10u, 16u) - 6u);
    let first = i & ~(block - 1u);
    if first + block > count {
        return i;
    }
    let random = hash3(first, seed.value, 2u);
    return first + ((i * (random | 1u) + (random >> 16u)) & (block - 1u));
}

// The place `t` (0…1) on a line that fills a triangle and gives equal lengths equal areas: each base-4 digit picks one of the four triangles
// between the corners and the middles of the edges (after Basu and Owen 2015); the centre of the last one. An f32 has 12 digits.
fn on_triangle(triangle: Corners, t: f32) -> vec3f {
    var corners = triangle;
    var rest = t;
    for (var level = 0u; level < 12u; level++) {
        rest *= 4.0;
        let digit = min(floor(rest), 3.0);
        rest -= digit;
        let ab = 0.5 * (corners.a + corners.b);
        let bc = 0.5 * (corners.b + corners.c);
        let ca = 0.5 * (corners.c + corners.a);
        switch u32(digit) {
            case 0u: { corners = Corners(corners.a, ab, ca); }
            case 1u: { corners = Corners(ab, corners.b, bc); }
            case 2u: { corners = Corners(bc, ca, ab); }
            default: { corners = Corners(ca, bc, corners.c); }
        }
    }
    return (corners.a + corners.b + corners.c) / 3.0;
}

@compute @workgroup_size(64)
fn emit(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = linear_index(id, groups, 64u);
    let capacity = arrayLength(&points);
    if i >= capacity {
        return;
    }
    points[i] = ScenePoint();
    let triangles = scene_info.triangle_count;
    if triangles == 0u {
        return;
    }
    let total = offset_up_to(triangles - 1u);
    var count = capacity;
    if !method_is_area {
        count = min(u32(min(total, 4.0e9)), capacity);
    }
    if i >= count || total <= 0.0 {
        return;
    }
    let place = f32(shuffled(i, count)) + unit_float(hash3(i, seed.value, 1u));
    let at = min(place / f32(count), 0x1.fffffep-1) * total;
    var low = 0u;
    var high = triangles - 1u;
    while low < high {
        let middle = (low + high) / 2u;
        if offset_up_to(middle) > at {
            high = middle;
        } else {
            low = middle + 1u;
        }
    }
    let t = corners(low);
    var previous = 0.0;
    if low > 0u {
        previous = offset_up_to(low - 1u);
    }
    let weight = offset_up_to(low) - previous;
    let normal = cross(t.b - t.a, t.c - t.a);
    let twice_area = length(normal);
    if twice_area <= 0.0 || weight <= 0.0 {
        return;
    }
    var point: ScenePoint;
    // What is left of the choice of the triangle is uniform as well.
    point.position = on_triangle(t, saturate((at - previous) / weight));
    point.normal = normal / twice_area;
    // The triangle's area over its expected number of points.
    point.area = 0.5 * twice_area / (weight / total * f32(count));
    point.object = WORLD_SPACE;
    points[i] = point;
}
