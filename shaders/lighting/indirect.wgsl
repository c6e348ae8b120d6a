// Indirect light with soft shadows from shadow maps, or with hard ones by rays. [ACRSM] 5.3.3, [VAL] 6, [PCSS], [CV] 4.
// Tile t is lit by the clusters c with c mod n² = t, times n². Only 8×8 blocks with a surface are lit, with `culling` by the lights left in each.
// Eq. 5.5's intensity omits the light's flux: here it is included (methods: radiometry).
// Differs from the papers: taps are compared with the receiver's tangent plane, the bias is a share of the distance.
// What bounds it: k / n² lights per pixel, with each 32 reads of the atlas (pcss) or a ray through some tens of nodes (exact: on a software
// adapter twice the time of pcss in a box of some tens of triangles, seven times in an atrium of 66,000). Mesa's software adapters end all loops of
// an invocation after 65,535 rounds together, in silence: with exact visibility k / n² must stay below some 500 there (in an
// atrium of 66,000 triangles 512 keep all light, 1024 lose a sixth of it).

#import common::bvh::{ray_offset, visible}
#import common::bounds::SurfaceBounds
#import common::cluster::{Cluster, CLUSTER_ACTIVE}
#import common::cssm::{depth_range, fetch, region, series, series_value, slabs_of}
#import common::culling::{full_word, lights_of_tile, words_of_tile}
#import common::lit_tiles::corner_of_tile
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
    exact_bias: f32,
    terms: u32,
    cssm_margin: f32,
    cssm_slope: f32,
}

@group(0) @binding(0) var split_position: texture_2d<f32>;
@group(0) @binding(1) var split_normal: texture_2d<u32>;
@group(0) @binding(2) var<storage, read> clusters: array<Cluster>;
@group(0) @binding(3) var ism: texture_2d<f32>;
@group(0) @binding(4) var<uniform> scene_info: SceneInfo;
@group(0) @binding(5) var<uniform> params: Params;
@group(0) @binding(6) var split_light: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var<storage, read> casters: array<Cluster>;
@group(0) @binding(8) var<storage, read> caster_of: array<u32>;
@group(0) @binding(9) var cssm: texture_2d<f32>;
@group(0) @binding(10) var linear_sampler: sampler;
@group(0) @binding(11) var<storage, read> surface_blocks: array<SurfaceBounds>;
@group(0) @binding(12) var<storage, read> lit_blocks: array<u32>;
@group(0) @binding(13) var<storage, read> lit_block_groups: array<vec4u>;
@group(0) @binding(14) var<storage, read> block_lights: array<u32>;

override lights_is_val: bool;
override visibility_is_simple: bool;
override visibility_is_pcss: bool;
override visibility_is_cssm: bool;
override visibility_is_exact: bool;
override maps_is_imperfect: bool;
override shadow_plane: bool;
override culling: bool;

// A receiver as a caster sees it.
struct Receiver {
    map: u32, // index of the caster
    origin: vec2u, // of its map in the atlas
    texel: vec2f, // in the map
    normal: vec3f, // in the caster's frame
    own: f32, // distance from the caster
    height: f32, // offset from the caster along the normal
    light_angle: f32, // radius of the caster's disk over the distance
    texels_per_angle: f32, // in the map, there
}

fn receiver(caster: u32, position: vec3f, normal: vec3f) -> Receiver {
    let light = casters[caster];
    let frame = basis(light.normal);
    let v = position - light.position;
    let local = v * frame; // transpose × vector
    let size = f32(params.ism_size);
    var r: Receiver;
    r.map = caster;
    r.origin = atlas_origin(caster, params.ism_size, params.atlas_width / params.ism_size);
    r.normal = normal * frame;
    r.own = max(length(v), 1e-15);
    r.height = dot(r.normal, local);
    // Below a caster's horizon, where its lights with other normals may shine, its map ends: what is at the horizon counts, so that shadows have no
    // edge there. ([CV] 5.1 calls all that lies below visible.)
    let above = vec3f(local.xy, max(local.z, 0.0));
    let disk = paraboloid_project(above * inverseSqrt(max(dot(above, above), 1e-30)));
    r.texel = (0.5 + 0.5 * disk) * size;
    r.light_angle = sqrt(light.area / PI) / r.own;
    // The unit disk is half of the map.
    r.texels_per_angle = paraboloid_scale(disk) * 0.5 * size;
    return r;
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
fn map_visibility(r: Receiver) -> f32 {
    let threshold = 1.0 - select(params.exact_bias, params.shadow_bias, maps_is_imperfect);
    if visibility_is_simple {
        return select(0.0, 1.0, tap_ratio(r, vec2f(0.0)) >= threshold);
    }
    let search = clamp(params.pcss_search * r.light_angle * r.texels_per_angle, 1.0, params.pcss_limit);
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
    let penumbra = r.light_angle * (1.0 - ratio) / ratio * r.texels_per_angle;
    let radius = clamp(penumbra, 1.0, params.pcss_limit);
    var lit = 0.0;
    direction = FIRST_DIRECTION;
    for (var i = 0u; i < TAPS; i++) {
        lit += select(0.0, 1.0, tap_ratio(r, direction * (tap_radius(i) * radius)) >= threshold);
        direction = next_direction(direction);
    }
    return lit / f32(TAPS);
}

// The slope of a surface is bounded where the caster sees it at a grazing angle: 5.
const MIN_SLOPE_COSINE: f32 = 0.2;

// The same by Fourier series whose terms are averaged over the penumbra. [CV] 4
fn cssm_visibility(r: Receiver) -> f32 {
    let size = params.ism_size;
    let maps_per_row = params.atlas_width / size;
    let atlas_height = textureDimensions(ism).y;
    let slabs = slabs_of(params.terms);
    // The receiver's own surface stands this much behind the depth compared, and counts as lit.
    let margin = params.cssm_margin / f32(2u * params.terms);
    let lit = series_value(margin, params.terms);
    let own = r.own / depth_range(casters[r.map].position, scene_info);
    // Seen at an angle, the surface comes nearer to the caster within the region that is averaged, by this per radian.
    let cosine = max(abs(r.height) / r.own, MIN_SLOPE_COSINE);
    let slope = params.cssm_slope * own * sqrt(1.0 - cosine * cosine) / cosine;

    let search_angle = params.pcss_search * r.light_angle;
    let search = region(r.map, r.texel, 2.0 * search_angle * r.texels_per_angle, size, maps_per_row);
    var d = own - margin - slope * search_angle;
    if d <= 0.0 {
        return 1.0; // nearer than the series resolves
    }
    let free = 0.5 + series(cssm, linear_sampler, search, 0u, atlas_height, params.terms, d);
    let depth = fetch(cssm, linear_sampler, search, 2u * slabs, atlas_height).x;
    let free_depth = 0.5 * depth + series(cssm, linear_sampler, search, slabs, atlas_height, params.terms, d);
    let blocked = 1.0 - free / lit;
    if blocked <= 0.0 {
        return 1.0; // nothing is in front
    }
    // Mean depth of what is in front; [CV] 4.2: penumbra p = A (d − z) / z / cosβ, seen under atan(p cosβ / d): the slope β cancels.
    let blocker = clamp((depth - free_depth / lit) / blocked, 1e-3 * d, d);
    let angle = atan(2.0 * r.light_angle * (d - blocker) / blocker);
    d = own - margin - slope * 0.5 * angle;
    let filtered = region(r.map, r.texel, angle * r.texels_per_angle, size, maps_per_row);
    return saturate((0.5 + series(cssm, linear_sampler, filtered, 0u, atlas_height, params.terms, d)) / lit);
}

// What is lit by no workgroup of `light`; a group a block.
@compute @workgroup_size(8, 8)
fn clear(@builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u) {
    if surface_blocks[(group.z * groups.y + group.y) * groups.x + group.x].points > 0u {
        return;
    }
    let tile = textureDimensions(split_light) / params.tiles;
    if all(id.xy < tile) {
        textureStore(split_light, corner_of_tile(group.z, tile, params.tiles) + id.xy, vec4f(0.0));
    }
}

// Irradiance by light `c`, and in alpha its luminance without shadows.
fn light_by(c: u32, position: vec3f, normal: vec3f) -> vec4f {
    let cluster = clusters[c];
    if cluster.state != CLUSTER_ACTIVE || cluster.count == 0u {
        return vec4f(0.0);
    }
    let v = position - cluster.position;
    let d2 = dot(v, v);
    let direction = v * inverseSqrt(max(d2, 1e-30));
    let cos_receiver = -dot(normal, direction);
    let cos_light = dot(cluster.normal, direction);
    if cos_receiver <= 0.0 || cos_light <= 0.0 {
        return vec4f(0.0);
    }
    let least_distance = params.vpl_clamp * scene_info.diagonal;
    let d2_kept = select(max(d2, least_distance * least_distance), d2, lights_is_val);
    let e = cluster.flux * disk_form_factor(cos_receiver, cos_light, d2_kept, select(0.0, cluster.area, lights_is_val));
    var visibility = 1.0;
    if visibility_is_simple || visibility_is_pcss {
        visibility = map_visibility(receiver(caster_of[c], position, normal));
    } else if visibility_is_cssm {
        visibility = cssm_visibility(receiver(caster_of[c], position, normal));
    } else if visibility_is_exact {
        let lift = ray_offset(scene_info);
        visibility = select(0.0, 1.0, visible(position + normal * lift, cluster.position + cluster.normal * lift));
    }
    return vec4f(e * visibility, luminance(e));
}

@compute @workgroup_size(8, 8)
fn light(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_id) lane: vec3u) {
    let place = group.x + group.y * groups.x;
    if place >= lit_block_groups[0].w {
        return;
    }
    let block = lit_blocks[place];
    let n = params.tiles;
    let tile = textureDimensions(split_light) / n;
    let corner = vec2u(surface_blocks[block].first & 0xffffu, surface_blocks[block].first >> 16u);
    let texel = corner + lane.xy;
    // A block at the rim of its tile is cut there.
    if any(corner % tile + lane.xy >= tile) {
        return;
    }
    let surface = textureLoad(split_position, texel, 0);
    var sum = vec4f(0.0);
    if surface.a > 0.0 {
        let normal = unpack_unit(textureLoad(split_normal, texel, 0).x);
        let first = corner / tile;
        let period = n * n;
        let own_tile = first.y * n + first.x;
        let lights = lights_of_tile(own_tile, arrayLength(&clusters), period);
        let words = words_of_tile(arrayLength(&clusters), period);
        for (var word = 0u; word < words; word++) {
            var bits = full_word(word, lights);
            if culling {
                bits = block_lights[block * words + word];
            }
            while bits != 0u {
                let j = 32u * word + countTrailingZeros(bits);
                bits &= bits - 1u;
                sum += light_by(own_tile + j * period, surface.xyz, normal);
            }
        }
    }
    textureStore(split_light, texel, sum * f32(n * n));
}
