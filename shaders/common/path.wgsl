// Paths through the scene: what a surface sends to its viewer of light that came over others (methods: reference).
// At each vertex the light that comes in one bounce is estimated in two ways: by a point that a ray from a light hits (good where its cone is
// small), the light chosen in proportion to its power, and by the path's next vertex, a cosine-distributed direction (good where surfaces are
// near each other). The balance heuristic (Veach 1997) joins them, light by light. Russian roulette from the fourth bounce on. The sky is met by
// directions that leave the scene. Surfaces: Lambert and normalised Blinn, two-sided.
// What bounds it: three rays per path and bounce and one for each light, each some tens of nodes.

#import common::scene::{Light, SceneInfo, Vertex, Triangle, Object, Material, NO_TEXTURE, LIGHT_DIRECTIONAL}
#import common::bvh::{bvh_triangles, Ray, Hit, MISSED, ray_offset, make_ray, intersect, visible}
#import common::radiometry::{PI, Arrival, light_at, max_component, lambert_blinn}
#import common::random::{hash, hash3, unit_float, scrambled_sobol}
#import common::paraboloid::basis
#import common::sky::sky_radiance

@group(1) @binding(auto) var<storage, read> scene_lights: array<Light>;
@group(1) @binding(auto) var<uniform> scene_info: SceneInfo;
@group(1) @binding(auto) var<storage, read> scene_vertices: array<Vertex>;
@group(1) @binding(auto) var<storage, read> scene_triangles: array<Triangle>;
@group(1) @binding(auto) var<storage, read> scene_objects: array<Object>;
@group(1) @binding(auto) var<storage, read> scene_materials: array<Material>;
@group(1) @binding(auto) var scene_textures: texture_2d_array<f32>;
@group(1) @binding(auto) var linear_repeat_sampler: sampler;

// Bounce from which on paths may end at random.
const ROULETTE_FROM: u32 = 4u;
// Survival is never likelier than this, so that a white scene's paths end.
const MOST_SURVIVAL: f32 = 0.95;

// Paths of one dispatch (declarations divide by it). Some adapters end all loops of an invocation after 65,535 rounds together, in silence
// (Mesa's software rasterizer): four paths of many bounces through a deep hierarchy stay below.
const PATHS_AT_ONCE: u32 = 4u;

// A point of a surface as a ray meets it.
struct Surface {
    position: vec3f,
    normal: vec3f, // towards the ray's origin
    geometric: vec3f, // the triangle's own, towards the ray's origin
    to_viewer: vec3f, // unit
    albedo: vec3f,
    specular: vec3f,
    shininess: f32,
}

fn surface_at(ray: Ray, hit: Hit) -> Surface {
    let t = bvh_triangles[hit.triangle];
    let corners = scene_triangles[t.index];
    let a = scene_vertices[corners.a];
    let b = scene_vertices[corners.b];
    let c = scene_vertices[corners.c];
    let w = 1.0 - hit.u - hit.v;
    var s: Surface;
    s.position = t.a + hit.u * t.ab + hit.v * t.ac;
    s.to_viewer = -normalize(ray.direction);
    s.geometric = normalize(cross(t.ab, t.ac));
    s.geometric = select(-s.geometric, s.geometric, dot(s.geometric, s.to_viewer) >= 0.0);
    let m = scene_objects[t.object].normal_from_object;
    let smooth_normal = mat3x3f(m[0].xyz, m[1].xyz, m[2].xyz) * (w * a.normal + hit.u * b.normal + hit.v * c.normal);
    s.normal = s.geometric;
    if dot(smooth_normal, smooth_normal) > 0.0 {
        let n = normalize(smooth_normal);
        s.normal = select(-n, n, dot(n, s.geometric) >= 0.0);
    }
    let material = scene_materials[t.material];
    s.albedo = material.diffuse;
    if material.diffuse_texture != NO_TEXTURE {
        let uv = w * vec2f(a.u, a.v) + hit.u * vec2f(b.u, b.v) + hit.v * vec2f(c.u, c.v);
        s.albedo *= textureSampleLevel(scene_textures, linear_repeat_sampler, uv, material.diffuse_texture, 0.0).rgb;
    }
    s.specular = material.specular;
    s.shininess = material.shininess;
    return s;
}

// 1/sr
fn brdf(s: Surface, towards: vec3f) -> vec3f {
    return lambert_blinn(s.albedo, s.specular, s.shininess, s.normal, towards, s.to_viewer);
}

fn lift(s: Surface) -> vec3f {
    return s.position + s.geometric * ray_offset(scene_info);
}

// Whether nothing lies between a surface and a point that is off its own surface already.
fn sees(s: Surface, point: vec3f) -> bool {
    return visible(lift(s), point);
}

// Whether nothing lies between a surface and a light.
fn sees_light(s: Surface, light: Light) -> bool {
    if light.kind == LIGHT_DIRECTIONAL {
        return intersect(make_ray(lift(s), -light.direction), MISSED, true).t >= MISSED;
    }
    return sees(s, light.position);
}

// Radiance that a surface sends to its viewer of what arrives from a light, W/(m² sr).
fn reflected(s: Surface, arrival: Arrival) -> vec3f {
    return arrival.irradiance * max(dot(s.normal, arrival.to_light), 0.0) * brdf(s, arrival.to_light);
}

// The same with shadows: black if the light is behind the surface or something lies between.
fn direct_of(s: Surface, light: Light, arrival: Arrival) -> vec3f {
    let radiance = reflected(s, arrival);
    if max_component(radiance) <= 0.0 || dot(s.geometric, arrival.to_light) <= 0.0 || !sees_light(s, light) {
        return vec3f(0.0);
    }
    return radiance;
}

// Radiance that a surface sends to its viewer of the lights themselves. All of them have a shadow ray: one that is chosen by its power
// would be noise where a weak light is near, and the cost is small against that of the rest for the few lights that scenes have.
fn direct(s: Surface) -> vec3f {
    var radiance = vec3f(0.0);
    for (var i = 0u; i < scene_info.light_count; i++) {
        radiance += direct_of(s, scene_lights[i], light_at(scene_lights[i], s.position));
    }
    return radiance;
}

var<private> random_state: u32;

fn random() -> f32 {
    random_state = hash(random_state);
    return unit_float(random_state);
}

// What the paths of a frame spread evenly: the ray from the light and the next direction of the first vertex; and, where the caller says so, what comes
// before it. Later decisions are independent.
const BEFORE: u32 = 0x1000u;
const FROM_LIGHT: u32 = 0x2000u;
const NEXT: u32 = 0x3000u;

var<private> path_seed: u32;
var<private> path_index: u32;

// Before the first path of an invocation. `seed` differs from pixel to pixel and from frame to frame; `first` is the index of that path in its frame.
fn start_paths(seed: u32, first: u32) {
    path_seed = seed;
    random_state = hash3(seed, first, 0u);
}

fn random_pair(purpose: u32, bounce: u32) -> vec2f {
    if bounce > 0u {
        return vec2f(random(), random());
    }
    return scrambled_sobol(path_index, hash(path_seed ^ purpose));
}

// Density per area at `y` of points that rays from a light hit. Here and below, densities have the cosines of the triangle itself: a
// smooth normal changes what a surface reflects, not how large it is.
fn pdf_light(y: Surface, arrival: Arrival) -> f32 {
    return arrival.ray_density * max(dot(y.geometric, arrival.to_light), 0.0);
}

// Unit vector from one point to another; zero where they are the same.
fn towards(origin: vec3f, point: vec3f) -> vec3f {
    let offset = point - origin;
    return offset * inverseSqrt(max(dot(offset, offset), 1e-30));
}

// Cosines at both ends over distance²: the projected solid angle that the surface at `y` has from `x`, over its area. 1/m²
fn coupling(x: Surface, y: Surface) -> f32 {
    let to_x = x.position - y.position;
    let direction = towards(y.position, x.position);
    return max(-dot(x.normal, direction), 0.0) * max(dot(y.geometric, direction), 0.0) / max(dot(to_x, to_x), 1e-30);
}

// Density per area at `y` of points that cosine-distributed directions from `x` hit.
fn pdf_cosine(x: Surface, y: Surface) -> f32 {
    return coupling(x, y) / PI;
}

const NO_LIGHT: u32 = 0xffffffffu;

// A light, in proportion to its power; none if all are dark.
fn choose_light() -> u32 {
    var rest = random();
    var chosen = NO_LIGHT;
    for (var i = 0u; i < scene_info.light_count; i++) {
        let share = scene_lights[i].share;
        if share > 0.0 {
            // The last one also has what rounding leaves.
            chosen = i;
            if rest < share {
                break;
            }
            rest -= share;
        }
    }
    return chosen;
}

// A ray from a light: in its cone or sphere, or from its disk. Of unit length.
fn light_ray(light: Light, u: vec2f) -> Ray {
    let angle = 2.0 * PI * u.x;
    let around = vec2f(cos(angle), sin(angle));
    let axes = basis(light.direction);
    if light.kind == LIGHT_DIRECTIONAL {
        let on_disk = light.radius * sqrt(u.y) * around;
        return make_ray(light.position + axes * vec3f(on_disk, 0.0), light.direction);
    }
    let s = sin(0.5 * light.cutoff_rad);
    let one_minus_cos = u.y * 2.0 * s * s;
    let r = sqrt(max(one_minus_cos * (2.0 - one_minus_cos), 0.0));
    return make_ray(light.position, axes * vec3f(r * around, 1.0 - one_minus_cos));
}

fn cosine_direction(normal: vec3f, u: vec2f) -> vec3f {
    let angle = 2.0 * PI * u.x;
    let r = sqrt(u.y);
    return basis(normal) * vec3f(r * cos(angle), r * sin(angle), sqrt(max(1.0 - u.y, 0.0)));
}

// One bounce by way of a point that a ray from a light hits.
fn bounce_from_light(x: Surface, bounce: u32) -> vec3f {
    let chosen = choose_light();
    if chosen == NO_LIGHT {
        return vec3f(0.0);
    }
    let light = scene_lights[chosen];
    let ray = light_ray(light, random_pair(FROM_LIGHT, bounce));
    let hit = intersect(ray, MISSED, false);
    if hit.t >= MISSED {
        return vec3f(0.0);
    }
    var y = surface_at(ray, hit);
    let to_x = towards(y.position, x.position);
    let arrival = light_at(light, y.position);
    y.to_viewer = to_x;
    let between = coupling(x, y);
    let radiance = reflected(y, arrival);
    if between <= 0.0 || dot(x.geometric, to_x) >= 0.0 || max_component(radiance) <= 0.0 || !sees(x, lift(y)) {
        return vec3f(0.0);
    }
    // Integrand over the pdf, times the balance heuristic's weight pdf / (pdf + other).
    return brdf(x, -to_x) * radiance * (between / (pdf_light(y, arrival) + pdf_cosine(x, y)));
}

// Radiance that `y`, which a cosine-distributed direction from `x` hit, sends to `x` of the lights themselves. What a ray from a light
// could have found counts less: each light has a weight of its own, as it has a density of its own.
fn weighted_direct(x: Surface, y: Surface) -> vec3f {
    let own = pdf_cosine(x, y);
    var radiance = vec3f(0.0);
    for (var i = 0u; i < scene_info.light_count; i++) {
        let light = scene_lights[i];
        let arrival = light_at(light, y.position);
        radiance += direct_of(y, light, arrival) * (own / max(own + pdf_light(y, arrival), 1e-30));
    }
    return radiance;
}

// Which light a path gathers at its first vertex: of the lights over `bounces` further surfaces, of the sky over as many but one, directly at least.
struct Gathered {
    lights: bool,
    sky: bool,
    bounces: u32,
}

// One path on from a surface: an estimate of the radiance that it sends to its viewer, without the direct light of the lights, added to `known`. W/(m² sr)
fn gather(start: Surface, what: Gathered, known: vec3f) -> vec3f {
    var x = start;
    var radiance = known;
    var throughput = vec3f(1.0);
    for (var bounce = 0u; bounce < what.bounces; bounce++) {
        if what.lights {
            radiance += throughput * bounce_from_light(x, bounce);
        }
        let direction = cosine_direction(x.normal, random_pair(NEXT, bounce));
        if dot(direction, x.geometric) <= 0.0 {
            break;
        }
        let ray = make_ray(lift(x), direction);
        let hit = intersect(ray, MISSED, false);
        if hit.t >= MISSED {
            if what.sky {
                radiance += throughput * (brdf(x, direction) * PI) * sky_radiance(direction);
            }
            break;
        }
        // brdf × cos / (cos / π)
        throughput *= brdf(x, direction) * PI;
        let y = surface_at(ray, hit);
        if what.lights {
            radiance += throughput * weighted_direct(x, y);
        }
        x = y;
        if bounce + 1u >= ROULETTE_FROM {
            let survival = min(max_component(throughput), MOST_SURVIVAL);
            if random() >= survival {
                break;
            }
            throughput /= survival;
        }
    }
    return radiance;
}

// One path from a surface as a component of the light asks for it: with the direct light of the lights or without. W/(m² sr)
fn light_of(x: Surface, with_direct: bool, what: Gathered) -> vec3f {
    var radiance = vec3f(0.0);
    if with_direct {
        radiance = direct(x);
    }
    if !what.lights && !what.sky {
        return radiance;
    }
    return gather(x, what, radiance);
}
