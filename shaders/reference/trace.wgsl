// Path tracer: the truth that the other pipelines are compared with.
// At each vertex of a camera path the light that comes in one bounce is estimated in two ways: by a point that a ray in the light's cone
// hits (good where the cone is small), and by the path's next vertex, a cosine-distributed direction (good where surfaces are near each other).
// The balance heuristic (Veach 1997) joins them. Russian roulette from the fourth bounce on. Surfaces: Lambert and normalised Blinn, two-sided.
// What bounds it: five rays per path and bounce, each some tens of nodes.

#import common::scene::{Frame, View, SpotLight, SceneInfo, Vertex, Triangle, Object, Material, NO_TEXTURE}
#import common::bvh::{bvh_triangles, Ray, Hit, MISSED, RAY_OFFSET, make_ray, intersect, visible}
#import common::view::ray_direction
#import common::radiometry::{PI, spot_falloff, max_component, lambert_blinn}
#import common::random::{hash, hash3, unit_float}
#import common::paraboloid::basis

struct Params {
    paths: u32,
    max_bounces: u32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> scene_camera: View;
@group(0) @binding(2) var<uniform> scene_light: SpotLight;
@group(0) @binding(3) var<uniform> scene_info: SceneInfo;
@group(0) @binding(4) var<storage, read> scene_vertices: array<Vertex>;
@group(0) @binding(5) var<storage, read> scene_triangles: array<Triangle>;
@group(0) @binding(6) var<storage, read> scene_objects: array<Object>;
@group(0) @binding(7) var<storage, read> scene_materials: array<Material>;
@group(0) @binding(8) var scene_textures: texture_2d_array<f32>;
@group(0) @binding(9) var linear_repeat_sampler: sampler;
@group(0) @binding(12) var<uniform> params: Params;
@group(0) @binding(13) var traced: texture_storage_2d<rgba32float, write>;

override component_is_direct: bool;
override component_is_full: bool;

// Bounce from which on paths may end at random.
const ROULETTE_FROM: u32 = 4u;
// Survival is never likelier than this, so that a white scene's paths end.
const MOST_SURVIVAL: f32 = 0.95;

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
    return s.position + s.geometric * (RAY_OFFSET * scene_info.diagonal);
}

// Irradiance of a surface by the light itself, W/m².
fn light_irradiance(s: Surface) -> vec3f {
    let to_light = scene_light.position - s.position;
    let d2 = dot(to_light, to_light);
    let l = to_light * inverseSqrt(max(d2, 1e-30));
    let cosine = dot(s.normal, l);
    let falloff = spot_falloff(scene_light, -l);
    if cosine <= 0.0 || dot(s.geometric, l) <= 0.0 || falloff <= 0.0 || !visible(lift(s), scene_light.position) {
        return vec3f(0.0);
    }
    return scene_light.intensity * (falloff * cosine / max(d2, 1e-30));
}

// Radiance that a surface sends to its viewer of the light itself.
fn direct(s: Surface) -> vec3f {
    let e = light_irradiance(s);
    if max_component(e) <= 0.0 {
        return vec3f(0.0);
    }
    return e * brdf(s, normalize(scene_light.position - s.position));
}

var<private> random_state: u32;

fn random() -> f32 {
    random_state = hash(random_state);
    return unit_float(random_state);
}

fn cone_solid_angle() -> f32 {
    let s = sin(0.5 * scene_light.cutoff_rad);
    return 4.0 * PI * s * s;
}

// Density per area at `y`, at distance² `d2` and with cosine `cos_y` towards the light, of points that rays in the cone hit.
fn pdf_cone(cos_y: f32, d2: f32) -> f32 {
    return cos_y / (cone_solid_angle() * max(d2, 1e-30));
}

// Density per area of points that cosine-distributed directions from `x` hit.
fn pdf_cosine(cos_x: f32, cos_y: f32, d2: f32) -> f32 {
    return cos_x / PI * cos_y / max(d2, 1e-30);
}

fn uniform_in_cone() -> vec3f {
    let s = sin(0.5 * scene_light.cutoff_rad);
    let one_minus_cos = random() * 2.0 * s * s;
    let angle = 2.0 * PI * random();
    let r = sqrt(max(one_minus_cos * (2.0 - one_minus_cos), 0.0));
    return basis(scene_light.direction) * vec3f(r * cos(angle), r * sin(angle), 1.0 - one_minus_cos);
}

fn cosine_direction(normal: vec3f) -> vec3f {
    let r2 = random();
    let angle = 2.0 * PI * random();
    let r = sqrt(r2);
    return basis(normal) * vec3f(r * cos(angle), r * sin(angle), sqrt(max(1.0 - r2, 0.0)));
}

// One bounce by way of a point that a ray in the light's cone hits.
fn bounce_from_cone(x: Surface) -> vec3f {
    let ray = make_ray(scene_light.position, uniform_in_cone());
    let hit = intersect(ray, MISSED, false);
    if hit.t >= MISSED {
        return vec3f(0.0);
    }
    var y = surface_at(ray, hit);
    let cos_light = dot(y.normal, y.to_viewer);
    let to_x = x.position - y.position;
    let d2 = dot(to_x, to_x);
    let direction = to_x * inverseSqrt(max(d2, 1e-30));
    let cos_x = -dot(x.normal, direction);
    let cos_y = dot(y.normal, direction);
    if cos_x <= 0.0 || cos_y <= 0.0 || dot(x.geometric, direction) >= 0.0 || dot(y.geometric, direction) <= 0.0 || cos_light <= 0.0 || !visible(lift(x), lift(y)) {
        return vec3f(0.0);
    }
    let l2 = hit.t * hit.t; // the cone's directions have unit length
    let irradiance = scene_light.intensity * (spot_falloff(scene_light, ray.direction) * cos_light / max(l2, 1e-30));
    let to_light = y.to_viewer;
    y.to_viewer = direction;
    let pdf = pdf_cone(cos_light, l2);
    let other = pdf_cosine(cos_x, cos_y, d2);
    // Integrand over the pdf, times the balance heuristic's weight pdf / (pdf + other).
    return brdf(x, -direction) * brdf(y, to_light) * irradiance * (cos_x * cos_y / max(d2, 1e-30) / (pdf + other));
}

// Weight of a bounce that was found by a cosine-distributed direction: what the cone could have found counts less.
fn weight_of_cosine(x: Surface, y: Surface) -> f32 {
    let to_x = x.position - y.position;
    let d2 = dot(to_x, to_x);
    let direction = to_x * inverseSqrt(max(d2, 1e-30));
    let own = pdf_cosine(max(-dot(x.normal, direction), 0.0), max(dot(y.normal, direction), 0.0), d2);
    let to_light = scene_light.position - y.position;
    let l2 = dot(to_light, to_light);
    let other = pdf_cone(max(dot(y.normal, to_light * inverseSqrt(max(l2, 1e-30))), 0.0), l2);
    return own / max(own + other, 1e-30);
}

fn path(pixel: vec2u, size: vec2u) -> vec3f {
    let uv = (vec2f(pixel) + vec2f(random(), random())) / vec2f(size);
    var ray = make_ray(scene_camera.origin, ray_direction(scene_camera, uv));
    var hit = intersect(ray, MISSED, false);
    if hit.t >= MISSED {
        return vec3f(0.0);
    }
    var x = surface_at(ray, hit);
    var radiance = vec3f(0.0);
    if component_is_direct || component_is_full {
        radiance += direct(x);
    }
    if component_is_direct {
        return radiance;
    }
    var throughput = vec3f(1.0);
    let bounces = select(1u, params.max_bounces, component_is_full);
    for (var bounce = 0u; bounce < bounces; bounce++) {
        radiance += throughput * bounce_from_cone(x);
        let direction = cosine_direction(x.normal);
        if dot(direction, x.geometric) <= 0.0 {
            break;
        }
        ray = make_ray(lift(x), direction);
        hit = intersect(ray, MISSED, false);
        if hit.t >= MISSED {
            break;
        }
        // brdf × cos / (cos / π)
        throughput *= brdf(x, direction) * PI;
        let y = surface_at(ray, hit);
        radiance += throughput * direct(y) * weight_of_cosine(x, y);
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

@compute @workgroup_size(8, 8)
fn trace(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(traced);
    if any(id.xy >= size) {
        return;
    }
    random_state = hash3(id.x + id.y * size.x, frame.index, frame.seed);
    var sum = vec3f(0.0);
    for (var i = 0u; i < params.paths; i++) {
        sum += path(id.xy, size);
    }
    textureStore(traced, id.xy, vec4f(sum / f32(params.paths), 1.0));
}
