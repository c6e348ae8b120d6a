// Indirect light with soft shadows from imperfect shadow maps, or with hard ones by rays. [ACRSM] 5.3.3, [VAL] 6, [PCSS].
// Tile t is lit by the clusters c with c mod n² = t, times n². Eq. 5.5's intensity omits the light's flux: here it is included (methods: radiometry).
// Differs from the papers: taps are compared with the receiver's tangent plane, the bias is a share of the distance.
// What bounds it: k / n² lights per pixel, with each 32 reads of the atlas (pcss) or a ray through some tens of nodes (exact: on a software
// adapter twice the time of pcss in a box of some tens of triangles, seven times in an atrium of 66,000). Mesa's software adapters end all loops of
// an invocation after 65,535 rounds together, in silence: with exact visibility k / n² must stay below some 2000 there.

#import common::bvh::{RAY_OFFSET, visible}
#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::scene::SceneInfo
#import common::octahedral::unpack_unit
#import common::paraboloid::{basis, paraboloid_project, paraboloid_unproject, paraboloid_scale, atlas_origin}
#import common::disk::{TAPS, FIRST_DIRECTION, next_direction, tap_radius}
#import common::radiometry::{PI, disk_form_factor, luminance}
#import common::shadow::plane_reciprocal

struct Params {
    tiles: u32,
    vpl_clamp: f32,
    shadow_bias: f32,
    ism_size: u32,
    atlas_width: u32,
    pcss_search: f32,
    pcss_limit: f32,
}

@group(0) @binding(0) var split_position: texture_2d<f32>;
@group(0) @binding(1) var split_normal: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(3) var ism: texture_2d<f32>;
@group(0) @binding(4) var<uniform> scene_info: SceneInfo;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var split_light: texture_storage_2d<rgba32float, write>;

override lights_is_val: bool;
override visibility_is_simple: bool;
override visibility_is_pcss: bool;
override visibility_is_exact: bool;
override shadow_plane: bool;

struct Receiver {
    origin: vec2u, // of the light's map in the atlas
    texel: vec2f, // in the map
    normal: vec3f, // in the light's frame
    own: f32, // distance from the light
    height: f32, // offset from the light along the normal
}

// Ratio of the distance stored in a tap to the receiver's distance along the tap's ray; ≥ 1 − bias: not a blocker.
fn tap_ratio(r: Receiver, offset: vec2f) -> f32 {
    let size = f32(params.ism_size);
    let texel = floor(clamp(r.texel + offset, vec2f(0.0), vec2f(size - 1.0)));
    let stored = textureLoad(ism, r.origin + vec2u(texel), 0).x * scene_info.diagonal;
    if !shadow_plane {
        return stored / r.own;
    }
    let ray = paraboloid_unproject((texel + 0.5) * (2.0 / size) - 1.0);
    return stored * plane_reciprocal(dot(r.normal, ray), r.height, r.own);
}

// Visibility between the receiver and a disk light by its map, 0 to 1. [ACRSM] 5.3.3, [PCSS]
fn map_visibility(r: Receiver, light_radius: f32) -> f32 {
    let threshold = 1.0 - params.shadow_bias;
    if visibility_is_simple {
        return select(0.0, 1.0, tap_ratio(r, vec2f(0.0)) >= threshold);
    }
    // Texels per angle at the receiver's place in the map: the unit disk is half of it.
    let disk = r.texel * (2.0 / f32(params.ism_size)) - 1.0;
    let texels_per_angle = paraboloid_scale(disk) * 0.5 * f32(params.ism_size);
    let light_angle = light_radius / r.own;
    let search = clamp(params.pcss_search * light_angle * texels_per_angle, 1.0, params.pcss_limit);
    var blockers = 0.0;
    var sum = 0.0;
    var direction = FIRST_DIRECTION;
    for (var i = 0u; i < TAPS; i++) {
        let ratio = tap_ratio(r, direction * (tap_radius(i) * search));
        direction = next_direction(direction);
        if ratio < threshold {
            blockers += 1.0;
            sum += ratio;
        }
    }
    if blockers == 0.0 {
        return 1.0;
    }
    // Mean blocker over receiver; [VAL] eq. 3: penumbra over light = (z_receiver − z_blocker) / z_blocker.
    let ratio = max(sum / blockers, 1e-3);
    let penumbra = light_angle * (1.0 - ratio) / ratio * texels_per_angle;
    let radius = clamp(penumbra, 1.0, params.pcss_limit);
    var lit = 0.0;
    direction = FIRST_DIRECTION;
    for (var i = 0u; i < TAPS; i++) {
        lit += select(0.0, 1.0, tap_ratio(r, direction * (tap_radius(i) * radius)) >= threshold);
        direction = next_direction(direction);
    }
    return lit / f32(TAPS);
}

@compute @workgroup_size(8, 8)
fn light(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(split_light);
    if any(id.xy >= size) {
        return;
    }
    let surface = textureLoad(split_position, id.xy, 0);
    var irradiance = vec3f(0.0);
    var unshadowed = 0.0;
    if surface.a > 0.0 {
        let normal = unpack_unit(textureLoad(split_normal, id.xy, 0).x);
        let tile = id.xy / (size / params.tiles);
        let least_distance = params.vpl_clamp * scene_info.diagonal;
        let lift = RAY_OFFSET * scene_info.diagonal;
        for (var c = tile.y * params.tiles + tile.x; c < arrayLength(&clusters); c += params.tiles * params.tiles) {
            let cluster = clusters[c];
            if cluster.state != CLUSTER_ACTIVE || cluster.count == 0u {
                continue;
            }
            let v = surface.xyz - cluster.position;
            let d2 = dot(v, v);
            let direction = v * inverseSqrt(max(d2, 1e-30));
            let cos_receiver = -dot(normal, direction);
            let cos_light = dot(cluster.normal, direction);
            if cos_receiver <= 0.0 || cos_light <= 0.0 {
                continue;
            }
            let d2_kept = select(max(d2, least_distance * least_distance), d2, lights_is_val);
            let e = cluster.flux * disk_form_factor(cos_receiver, cos_light, d2_kept, select(0.0, cluster.area, lights_is_val));
            unshadowed += luminance(e);
            if visibility_is_simple || visibility_is_pcss {
                let frame = basis(cluster.normal);
                let local = v * frame; // transpose × vector
                var r: Receiver;
                r.normal = normal * frame;
                r.own = sqrt(d2);
                r.height = dot(r.normal, local);
                r.texel = (0.5 + 0.5 * paraboloid_project(local * inverseSqrt(max(d2, 1e-30)))) * f32(params.ism_size);
                r.origin = atlas_origin(c, params.ism_size, params.atlas_width / params.ism_size);
                irradiance += e * map_visibility(r, sqrt(cluster.area / PI));
            } else if !visibility_is_exact || visible(surface.xyz + normal * lift, cluster.position + cluster.normal * lift) {
                irradiance += e;
            }
        }
    }
    let scale = f32(params.tiles * params.tiles);
    textureStore(split_light, id.xy, vec4f(irradiance, unshadowed) * scale);
}
