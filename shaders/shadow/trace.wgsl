// Paraboloid shadow maps by rays: the same maps as `shadow/rasterize`. Cost: a ray per texel above the horizon, some tens of nodes each.

#import common::bvh::{ray_offset, MISSED, intersect, make_ray}
#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::paraboloid::{basis, paraboloid_unproject}
#import common::radiometry::PI
#import common::scene::SceneInfo

struct Params {
    ism_size: u32,
    ignored_radius: f32,
}

@group(0) @binding(0) var<storage, read> casters: array<Cluster>;
@group(0) @binding(1) var<uniform> scene_info: SceneInfo;
@group(0) @binding(2) var<uniform> params: Params;
@group(0) @binding(3) var ism: texture_storage_2d<r32float, write>;

const NOTHING: f32 = 1.0;

fn distance_along(map: u32, ray: vec3f) -> f32 {
    if map >= arrayLength(&casters) || ray.z < 0.0 {
        return NOTHING;
    }
    let caster = casters[map];
    if caster.state != CLUSTER_ACTIVE || caster.count == 0u {
        return NOTHING;
    }
    // Off its own surface, which would shadow it.
    let ignored = params.ignored_radius * sqrt(caster.area / PI);
    let direction = basis(caster.normal) * ray;
    let origin = caster.position + caster.normal * ray_offset(scene_info) + direction * ignored;
    let hit = intersect(make_ray(origin, direction), MISSED, false);
    return min((hit.t + ignored) / scene_info.diagonal, NOTHING);
}

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(ism);
    if any(id.xy >= size) {
        return;
    }
    let cell = id.xy / params.ism_size;
    let ray = paraboloid_unproject((vec2f(id.xy % params.ism_size) + 0.5) * (2.0 / f32(params.ism_size)) - 1.0);
    textureStore(ism, id.xy, vec4f(distance_along(cell.y * (size.x / params.ism_size) + cell.x, ray), 0.0, 0.0, 0.0));
}
