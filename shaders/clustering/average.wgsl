// One k-means update. [ACRSM] 4.7, 5.3.1, [VAL] 4.
// A group per cluster gathers its texels from their rectangle in a fixed order, so the sums have the same bits every time (additive
// blending, as in the paper, has not). Means of normals may cancel: then the old normal stays and the frames are counted.
// With `stay` only the sums are made, as [IIR] gives virtual lights their intensity.
// What bounds it: reads of the map, the area of all rectangles together.

#import common::rsm::{texel_ray, texel_position, texel_area, Cell, cell_of_texel, in_cell}
#import common::octahedral::unpack_unit
#import common::cluster::Cluster
#import common::radiometry::PI

@group(0) @binding(0) var<storage, read> clusters_warped: array<Cluster>;
@group(0) @binding(1) var cluster_map: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> cluster_bounds: array<u32>;
@group(0) @binding(3) var rsm_flux: texture_2d<f32>;
@group(0) @binding(4) var rsm_normal: texture_2d<u32>;
@group(0) @binding(5) var rsm_distance: texture_2d<f32>;
@group(0) @binding(6) var importance: texture_2d<f32>;
@group(0) @binding(7) var<storage, read_write> clusters: array<Cluster>;

override flux_is_sum: bool;
override area_is_circle: bool;
override snap: bool;
override stay: bool;

const LANES: u32 = 128u;
// Below this length the sum of a cluster's unit normals, over their number, has no direction worth the name.
const CANCELLED: f32 = 1e-3;

struct Sum {
    position: vec3f, // offsets from the old centre: no cancellation of large coordinates
    area: f32,
    normal: vec3f,
    importance: f32,
    flux: vec3f,
    count: u32,
    texel: vec2f, // offsets from the old centre
}

var<workgroup> partial: array<Sum, LANES>;
// For the snap: distance² to the mean and the texel, smallest wins.
var<workgroup> nearest_distance: array<f32, LANES>;
var<workgroup> nearest_texel: array<u32, LANES>;
var<workgroup> farthest: array<f32, LANES>;

fn position_of(texel: vec2u) -> vec3f {
    return texel_position(texel, textureDimensions(cluster_map), textureLoad(rsm_distance, texel, 0).x);
}

// Whether a texel is cluster `c`'s own: of a view that has no cluster it only gets the flux.
fn is_own(texel: vec2u, c: u32, cell: Cell) -> bool {
    return textureLoad(cluster_map, texel, 0).x == c && in_cell(cell, vec2f(texel));
}

@compute @workgroup_size(128)
fn average(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let c = group.x;
    var cluster = clusters_warped[c];
    let low = vec2u(cluster_bounds[4u * c], cluster_bounds[4u * c + 1u]);
    let high = vec2u(cluster_bounds[4u * c + 2u], cluster_bounds[4u * c + 3u]);
    let extent = select(vec2u(0u), high - low + 1u, all(low <= high));
    let total = extent.x * extent.y;

    let size = textureDimensions(cluster_map);
    let cell = cell_of_texel(vec2u(cluster.texel), size);
    var sum: Sum;
    for (var i = lane; i < total; i += LANES) {
        let texel = low + vec2u(i % extent.x, i / extent.x);
        if textureLoad(cluster_map, texel, 0).x != c {
            continue;
        }
        sum.flux += textureLoad(rsm_flux, texel, 0).rgb;
        if !is_own(texel, c, cell) {
            continue;
        }
        let normal = unpack_unit(textureLoad(rsm_normal, texel, 0).x);
        let ray = texel_ray(texel, size);
        let d = textureLoad(rsm_distance, texel, 0).x;
        sum.position += ray.origin + ray.direction * d - cluster.position;
        sum.area += texel_area(texel, size, d, -dot(normal, ray.direction));
        sum.normal += normal;
        sum.importance += textureLoad(importance, texel, 0).x;
        sum.count += 1u;
        sum.texel += vec2f(texel) + 0.5 - cluster.texel;
    }
    partial[lane] = sum;
    workgroupBarrier();
    for (var width = LANES / 2u; width > 0u; width /= 2u) {
        if lane < width {
            let other = partial[lane + width];
            partial[lane].position += other.position;
            partial[lane].area += other.area;
            partial[lane].normal += other.normal;
            partial[lane].importance += other.importance;
            partial[lane].flux += other.flux;
            partial[lane].count += other.count;
            partial[lane].texel += other.texel;
        }
        workgroupBarrier();
    }

    let whole = partial[0];
    let n = max(f32(whole.count), 1.0);
    let mean_position = cluster.position + whole.position / n;
    let mean_texel = cluster.texel + whole.texel / n;

    // The texel nearest to the mean, and the radius of the circle around the centre.
    var best = 3.0e38;
    var best_texel = 0u;
    for (var i = lane; i < total; i += LANES) {
        let texel = low + vec2u(i % extent.x, i / extent.x);
        if is_own(texel, c, cell) {
            let offset = position_of(texel) - mean_position;
            let d2 = dot(offset, offset);
            if d2 < best {
                best = d2;
                best_texel = i;
            }
        }
    }
    nearest_distance[lane] = best;
    nearest_texel[lane] = best_texel;
    workgroupBarrier();
    for (var width = LANES / 2u; width > 0u; width /= 2u) {
        if lane < width {
            let d = nearest_distance[lane + width];
            let t = nearest_texel[lane + width];
            if d < nearest_distance[lane] || (d == nearest_distance[lane] && t < nearest_texel[lane]) {
                nearest_distance[lane] = d;
                nearest_texel[lane] = t;
            }
        }
        workgroupBarrier();
    }
    let columns = max(extent.x, 1u);
    let centre = low + vec2u(nearest_texel[0] % columns, nearest_texel[0] / columns);

    var centre_position = select(mean_position, cluster.position, stay);
    if snap && !stay && whole.count > 0u {
        centre_position = position_of(centre);
    }
    var radius_2 = 0.0;
    if area_is_circle {
        for (var i = lane; i < total; i += LANES) {
            let texel = low + vec2u(i % extent.x, i / extent.x);
            if is_own(texel, c, cell) {
                let offset = position_of(texel) - centre_position;
                radius_2 = max(radius_2, dot(offset, offset));
            }
        }
    }
    farthest[lane] = radius_2;
    workgroupBarrier();

    if lane > 0u {
        return;
    }
    cluster.count = whole.count;
    if whole.count == 0u {
        // Vanished: no light this frame, re-seeded in the next (4.6).
        cluster.flux = vec3f(0.0);
        cluster.area = 0.0;
        clusters[c] = cluster;
        return;
    }
    for (var i = 1u; i < LANES; i++) {
        radius_2 = max(radius_2, farthest[i]);
    }
    if !stay {
        cluster.position = centre_position;
        cluster.texel = select(mean_texel, vec2f(centre) + 0.5, snap);
        let normal = whole.normal / n;
        if dot(normal, normal) > CANCELLED * CANCELLED {
            cluster.normal = normalize(normal);
            cluster.cancelled = 0u;
        } else {
            cluster.cancelled += 1u;
        }
    }
    cluster.importance = whole.importance / n;
    cluster.area = select(whole.area, PI * radius_2, area_is_circle);
    // The papers read the flux at the centre and let each texel count as much.
    cluster.flux = select(textureLoad(rsm_flux, min(vec2u(cluster.texel), size - 1u), 0).rgb * n, whole.flux, flux_is_sum);
    clusters[c] = cluster;
}
