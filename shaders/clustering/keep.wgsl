// Which virtual lights stay. [IIR] 4: a virtual light is valid as long as it lies in its light's cone and the light sees it.
// The reflective shadow map says both: the texel where the light would see it is lit, and as far away as the tangent plane of the virtual light is along
// the texel's ray. Valid ones keep position and normal, bit for bit; what they reflect is made anew from the map.
// Differs from the paper: no ray is traced, so a light on the rim of the cone counts by the centre of its texel; valid lights are not removed where they
// crowd (each has what its own texels reflect, however few they are).

#import common::cluster::{Cluster, CLUSTER_ACTIVE, CLUSTER_RESEED}
#import common::radiometry::max_component
#import common::rsm::{
    scene_light_views, view_count, view_of_texel, view_towards, position_in_map, distance_in_view, texel_ray, cell_of_view, cell_side, cell_of_texel, in_cell,
}
#import common::shadow::plane_reciprocal

struct Params {
    keep_tolerance: f32,
}

@group(0) @binding(0) var<storage, read> clusters_previous: array<Cluster>;
@group(0) @binding(1) var rsm_flux: texture_2d<f32>;
@group(0) @binding(2) var rsm_distance: texture_2d<f32>;
@group(0) @binding(3) var<uniform> params: Params;
@group(0) @binding(4) var<storage, read_write> clusters_evaluated: array<Cluster>;

// Where in the map its light sees a cluster; negative where it does not.
fn place_of(cluster: Cluster) -> vec2f {
    let size = textureDimensions(rsm_flux);
    // A map of another size has the places of other lights there, or of none.
    let index = view_towards(min(view_of_texel(vec2u(cluster.texel), size), view_count() - 1u), cluster.position);
    let seen = position_in_map(index, cluster.position, size);
    let cell = cell_of_texel(cell_of_view(index) * cell_side(size), size);
    if seen.z <= 0.0 || !in_cell(cell, seen.xy) {
        return vec2f(-1.0);
    }
    let texel = vec2u(seen.xy);
    if max_component(textureLoad(rsm_flux, texel, 0).rgb) <= 0.0 {
        return vec2f(-1.0);
    }
    let ray = texel_ray(texel, size);
    let own = max(distance_in_view(index, cluster.position), 1e-30);
    let reciprocal = plane_reciprocal(dot(cluster.normal, ray.direction), dot(cluster.normal, cluster.position - ray.origin), own);
    let ratio = textureLoad(rsm_distance, texel, 0).x * reciprocal;
    return select(vec2f(-1.0), seen.xy, abs(ratio - 1.0) <= params.keep_tolerance);
}

@compute @workgroup_size(64)
fn keep(@builtin(global_invocation_id) id: vec3u) {
    let c = id.x;
    if c >= arrayLength(&clusters_evaluated) {
        return;
    }
    var cluster = clusters_previous[c];
    var place = vec2f(-1.0);
    if cluster.state == CLUSTER_ACTIVE {
        place = place_of(cluster);
    }
    if place.x >= 0.0 {
        cluster.texel = place;
    } else {
        cluster.state = CLUSTER_RESEED;
        cluster.count = 0u;
    }
    clusters_evaluated[c] = cluster;
}
