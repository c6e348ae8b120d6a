// Light and its transport between surfaces. Units: W, W/sr, W/m², W/(m² sr), each for linear red, green, blue.

#import common::scene::{Light, FALLOFF_COSINE, FALLOFF_SMOOTH, LIGHT_SPOT, LIGHT_DIRECTIONAL}

const PI: f32 = 3.14159265358979;

fn luminance(rgb: vec3f) -> f32 {
    return dot(rgb, vec3f(0.2126, 0.7152, 0.0722)); // Rec. 709
}

fn max_component(rgb: vec3f) -> f32 {
    return max(rgb.x, max(rgb.y, rgb.z));
}

// Share of the full intensity that a spot light sends along `direction` (unit, away from the light).
fn spot_falloff(light: Light, direction: vec3f) -> f32 {
    let cosine = dot(light.direction, direction);
    // atan2 keeps its precision at small angles, where acos of a number near 1 has none.
    let angle = atan2(length(cross(light.direction, direction)), cosine);
    if angle >= light.cutoff_rad {
        return 0.0;
    }
    if light.falloff == FALLOFF_COSINE {
        // [ACRSM] 5.1.1, fig. 5.1: exceeds 1 inside the cone.
        return cosine / cos(light.cutoff_rad);
    }
    let t = saturate((light.cutoff_rad - angle) / max(light.cutoff_rad - light.beam_rad, 1e-6));
    if light.falloff == FALLOFF_SMOOTH {
        return t * t * (3.0 - 2.0 * t);
    }
    return t;
}

// Share of the strength that a light of any kind sends along `direction` (unit, away from the light).
fn falloff(light: Light, direction: vec3f) -> f32 {
    if light.kind != LIGHT_SPOT {
        return 1.0;
    }
    return spot_falloff(light, direction);
}

// The light that arrives at a point if nothing is between.
struct Arrival {
    to_light: vec3f, // unit
    irradiance: vec3f, // of a surface that faces the light, W/m²
    ray_density: f32, // that a path tracer's rays from this light have across them, 1/m²
}

// Square of the distance to a light below which its irradiance grows no further, so that it stays finite. No surface is that near.
const LEAST_DISTANCE2: f32 = 1e-20;

// What arrives at `position` from a light of any kind; methods: radiometry.
fn light_at(light: Light, position: vec3f) -> Arrival {
    if light.kind == LIGHT_DIRECTIONAL {
        return Arrival(-light.direction, light.strength, light.ray_density);
    }
    let offset = light.position - position;
    let to_light = offset * inverseSqrt(max(dot(offset, offset), 1e-30));
    let spread = 1.0 / max(dot(offset, offset), LEAST_DISTANCE2);
    // Rays are uniform in a spot light's whole cone; where none go, outside, there is no light that the density could weigh.
    return Arrival(to_light, light.strength * (falloff(light, -to_light) * spread), light.ray_density * spread);
}

// Form factor from a disk of area `area` at distance² `d2` to a surface element, over the element's area: [ACRSM] eq. 5.5, after [WALLACE].
// E = flux × this. Bounded by 1 / area where the disk touches the element; `area` = 0 is a point light. 1/m²
fn disk_form_factor(cos_receiver: f32, cos_emitter: f32, d2: f32, area: f32) -> f32 {
    return max(cos_receiver, 0.0) * max(cos_emitter, 0.0) / max(PI * d2 + area, 1e-30);
}

// What a diffuse receiver reflects of indirect light, W/(m² sr), from its irradiance and, in alpha, the luminance of that without shadows; alpha of the
// result: share that shadows leave. Negative lights [SOI] may take away more than there is: the sum over all lights is clamped here, once, after
// merging and filtering, so that what they take too much in one tile is not lost for the others.
fn reflected_light(albedo: vec3f, light: vec4f) -> vec4f {
    let visible = select(1.0, saturate(luminance(light.rgb) / max(light.a, 1e-30)), light.a > 0.0);
    return vec4f(albedo / PI * max(light.rgb, vec3f(0.0)), visible);
}

// Lambert and Blinn between two unit directions away from the surface, 1/sr. The lobe is normalised so that the energy it reflects
// does not depend on the exponent.
fn lambert_blinn(albedo: vec3f, specular: vec3f, shininess: f32, normal: vec3f, to_light: vec3f, to_viewer: vec3f) -> vec3f {
    var f = albedo / PI;
    if max_component(specular) > 0.0 {
        // Opposite directions have no half vector: no lobe.
        let sum = to_light + to_viewer;
        let half = sum * inverseSqrt(max(dot(sum, sum), 1e-30));
        f += specular * ((shininess + 8.0) / (8.0 * PI) * pow(max(dot(normal, half), 0.0), max(shininess, 1.0)));
    }
    return f;
}
