//! Light and its transport: fall-off, form factors, reflection, the sky.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use manylight_scene::gpu_data::Sky;
use proptest::strategy::Strategy;

use super::{
    directions::v3,
    harness::{Bound, Case, EXACT, Resource, Want, check, ulps, values, values_of},
    inputs::{LARGEST, Numbers, colour, index, join, magnitude, magnitude_or_zero, one_of, real, switch, unit_vector, vector},
};

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [lights(), reflection(), surroundings()].into_iter().flatten().collect()
}

/// Rec. 709.
pub fn luminance(rgb: DVec3) -> f64 {
    rgb.dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// Arguments that make a light, and the statement that does.
pub const LIGHT: &str =
    "light_position: vec3f, kind: u32, light_direction: vec3f, curve: u32, strength: vec3f, beam: f32, cutoff: f32, density: f32";
pub const MAKE_LIGHT: &str = "let light = Light(light_position, kind, light_direction, curve, strength, beam, cutoff, 1.0, 1.0, density);";

#[derive(Clone, Copy, Debug)]
pub struct Light {
    pub position: DVec3,
    pub kind: u32,
    pub direction: DVec3,
    pub curve: u32,
    pub strength: DVec3,
    pub beam: f64,
    pub cutoff: f64,
    pub density: f64,
}

impl Light {
    pub fn of(i: &[f64]) -> Self {
        Self {
            position: v3(i),
            kind: i[3] as u32,
            direction: v3(&i[4..]),
            curve: i[7] as u32,
            strength: v3(&i[8..]),
            beam: i[11],
            cutoff: i[12],
            density: i[13],
        }
    }

    /// Share of the intensity along a direction, and its error in units in the last place of 1; two of them where rounding decides whether it is inside.
    pub fn falloff(&self, direction: DVec3) -> Vec<(f64, f64)> {
        if self.kind != 0 {
            return vec![(1.0, 1.0)];
        }
        let cosine = self.direction.dot(direction);
        let angle = self.direction.cross(direction).length().atan2(cosine);
        let width = (self.cutoff - self.beam).max(1e-6);
        let t = ((self.cutoff - angle) / width).clamp(0.0, 1.0);
        let inside = match self.curve {
            1 => (cosine / self.cutoff.cos(), 1.0 / self.cutoff.cos().powi(2)),
            2 => (t * t * (3.0 - 2.0 * t), 1.0 + 4.0 / width),
            _ => (t, 1.0 + 4.0 / width),
        };
        match () {
            // Any share up to that of the beam where the penumbra is as narrow as rounding.
            () if (angle - self.cutoff).abs() < 4e-6 => vec![inside, (0.0, inside.1), (1.0, inside.1)],
            () if angle >= self.cutoff => vec![(0.0, 1.0)],
            () => vec![inside],
        }
    }

    /// Direction to the light, irradiance of a surface that faces it with the magnitude of its error (as [`Light::falloff`] has it), density of rays.
    pub fn at(&self, position: DVec3) -> (DVec3, Vec<(DVec3, DVec3)>, f64) {
        if self.kind == 2 {
            return (-self.direction, vec![(self.strength, self.strength)], self.density);
        }
        let offset = self.position - position;
        let d2 = offset.length_squared();
        let to_light = offset / d2.max(1e-30).sqrt();
        let spread = 1.0 / d2.max(1e-20);
        let arriving =
            self.falloff(-to_light).into_iter().map(|(share, error)| (self.strength * share * spread, self.strength * spread * error));
        (to_light, arriving.collect(), self.density * spread)
    }
}

/// Lights of all kinds; cut-offs between 0.6° and 85°.
pub fn light() -> Numbers {
    let cone = (real(0.01, 1.48), real(0.0, 1.0)).prop_map(|(cutoff, share)| vec![cutoff[0] * share[0], cutoff[0]]).boxed();
    join([vector(1e-3, 1e3), one_of(&[0.0, 0.0, 1.0, 2.0]), unit_vector(), index(3), colour(1e4), cone, magnitude_or_zero(1e-6, 1e3)])
}

fn case(function: &'static str, before: &str, after: &str) -> Case {
    let takes: &'static str = String::leak(format!("{before}{LIGHT}{after}"));
    Case::new(function, takes).imports("scene::Light").before(MAKE_LIGHT)
}

/// A direction in or about the light's cone, or any.
fn light_and_direction() -> Numbers {
    (light(), unit_vector(), real(0.0, 1.0), 0..4_u32)
        .prop_map(|(mut i, direction, spread, choice)| {
            let light = Light::of(&i);
            let side = v3(&direction).cross(light.direction).normalize_or(light.direction.any_orthonormal_vector());
            // At the axis, the beam, the cut-off, and between.
            let angle = match choice {
                0 => light.cutoff * spread[0],
                1 => light.beam,
                2 => light.cutoff * (1.0 + 1e-5 * (spread[0] - 0.5)),
                _ => PI * spread[0],
            };
            i.extend((angle.cos() * light.direction + angle.sin() * side).to_array());
            i
        })
        .boxed()
}

fn share(light: Light, direction: DVec3) -> Vec<Want> {
    let all = light.falloff(direction).into_iter().map(|(share, error)| Want::of(share, error));
    vec![Want::OneOf(all.collect())]
}

const ANGLE: Bound = ulps(24.0, "of the angle, by an arc tangent that is good to some 1e-6, over the width of the penumbra");

fn lights() -> Vec<Case> {
    vec![
        case("radiometry::spot_falloff", "", ", direction: vec3f")
            .also("f32", "spot_falloff(light, direction)")
            .random(light_and_direction())
            .twin(ANGLE, |i| share(Light { kind: 0, ..Light::of(i) }, v3(&i[14..]))),
        case("radiometry::falloff", "", ", direction: vec3f")
            .also("f32", "falloff(light, direction)")
            .random(light_and_direction())
            .twin(ANGLE, |i| share(Light::of(i), v3(&i[14..]))),
        case("radiometry::light_at", "", ", position: vec3f")
            .before("let light = Light(light_position, kind, light_direction, curve, strength, beam, cutoff, 1.0, 1.0, density); let arrival = light_at(light, position);")
            .also("vec3f", "arrival.to_light")
            .also("vec3f", "arrival.irradiance")
            .also("f32", "arrival.ray_density")
            .random(join([light(), vector(1e-3, 1e4)]))
            // At the light itself, and next to it.
            .random((light(), vector(1e-20, 1e-3), switch()).prop_map(|(mut i, offset, near)| {
                let position: Vec<f64> = (0..3).map(|k| f64::from((i[k] + near[0] * offset[k]) as f32)).collect();
                i.extend(position);
                i
            }).boxed())
            .random((light_and_direction(), magnitude(1e-3, 1e3)).prop_map(|(mut i, d)| {
                for k in 0..3 {
                    i[14 + k] = f64::from(i[k] as f32) + d[0] * i[14 + k];
                }
                i
            }).boxed())
            .twin(ulps(40.0, "as the fall-off; the squared distance has the rounding of three products"), |i| {
                let light = Light::of(i);
                let position = v3(&i[14..]);
                let (to_light, arriving, density) = light.at(position);
                // At the light itself no direction is in the cone or out of it for certain: not brighter than at the least distance.
                if position.distance_squared(light.position) < 1e-28 {
                    let brightest = light.strength * (1.000_01e20 * (1.0 / light.cutoff.cos()).max(1.0));
                    let all = [vec![Want::Between(-1.01, 1.01); 3], brightest.to_array().map(|b| Want::Between(0.0, b)).to_vec(), vec![Want::new(density)]];
                    return all.concat();
                }
                // The fall-off sees the direction with its own rounding.
                let mut all = values_of(to_light.to_array(), 1.0);
                for axis in 0..3 {
                    let options = arriving.iter().map(|(e, scale)| Want::of(e[axis], scale[axis]));
                    all.push(Want::OneOf(options.collect()));
                }
                all.push(Want::new(density));
                all
            }),
    ]
}

/// Lambert and Blinn, 1/sr, and the magnitude of its error; `None` where the half vector has no certain direction.
pub fn lambert_blinn(
    albedo: DVec3,
    specular: DVec3,
    shininess: f64,
    normal: DVec3,
    to_light: DVec3,
    to_viewer: DVec3,
) -> Option<(DVec3, DVec3)> {
    let (sum, exponent) = (to_light + to_viewer, shininess.max(1.0));
    if sum.length() < 1e-3 {
        return None;
    }
    let cosine = normal.dot(sum) / sum.length();
    let peak = (shininess + 8.0) / (8.0 * PI);
    let power = cosine.max(0.0).powf(exponent);
    // d(x^s) = s x^(s − 1) dx; and the power by logarithm and exponential.
    let stretch = exponent * cosine.max(1e-3).powf(exponent - 1.0) / sum.length().min(1.0) + 100.0 * power;
    Some((albedo / PI + specular * peak * power, albedo / PI + specular * (peak * stretch + 1e-25)))
}

fn reflection() -> Vec<Case> {
    let shading = join([colour(1.0), colour(1.0), magnitude_or_zero(1.0, 1e4), unit_vector(), unit_vector(), unit_vector()]);
    vec![
        Case::new("radiometry::luminance", "rgb: vec3f")
            .gives("f32")
            .edges([vec![0.0; 3], vec![1e30; 3], vec![1.0; 3]])
            .random(join([real(-1.0, 1.0), magnitude_or_zero(1e-30, 1e30), magnitude_or_zero(1e-6, 1e6)]))
            .twin(ulps(3.0, "three products and their sum"), |i| vec![Want::of(luminance(v3(i)), i[0].abs() + i[1].abs() + i[2].abs())]),
        Case::new("radiometry::max_component", "rgb: vec3f")
            .gives("f32")
            .random(join([real(-1.0, 1.0), real(-LARGEST, LARGEST), real(-1.0, 1.0)]))
            .twin(EXACT, |i| values([v3(i).max_element()])),
        Case::new("radiometry::disk_form_factor", "cos_receiver: f32, cos_emitter: f32, d2: f32, area: f32")
            .gives("f32")
            .edges([
                vec![1.0, 1.0, 0.0, 0.0],
                vec![1.0, 1.0, 0.0, 1.0],
                vec![1.0, 1.0, 1e-45, 0.0],
                vec![-1.0, -1.0, 1.0, 1.0],
                vec![1.0, 1.0, 1e30, 1e30],
            ])
            .random(join([real(-1.0, 1.0), real(-1.0, 1.0), magnitude_or_zero(1e-12, 1e9), magnitude_or_zero(1e-12, 1e9)]))
            .twin(ulps(4.0, "two products, a sum and a quotient"), |i| {
                // [ACRSM] eq. 5.5; with neither distance nor area at the stated clamp instead of infinite.
                let [receiver, emitter] = [i[0], i[1]].map(|cosine| cosine.max(0.0));
                let value = receiver * emitter / (PI * i[2] + i[3]).max(1e-30);
                assert!(value <= 1.0 / i[3].max(1e-30) * 1.000_001, "bounded by the area");
                values([value])
            }),
        Case::new("radiometry::reflected_light", "albedo: vec3f, light: vec4f")
            .gives("vec4f")
            .edges([
                vec![0.0; 7],
                vec![1.0, 1.0, 1.0, 1e30, 1e30, 1e30, 1e30],
                vec![1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0],
                vec![1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1e-45],
            ])
            .random(join([colour(1.0), real(-10.0, 1e4), real(-10.0, 1e4), real(-10.0, 1e4), magnitude_or_zero(1e-6, 1e6)]))
            .twin(ulps(4.0, "products and quotients; the share of the terms of the luminance"), |i| {
                let (albedo, light) = (v3(i), v3(&i[3..]));
                let mut all = values((albedo / PI * light.max(DVec3::ZERO)).to_array());
                // Too small to be told from zero by every device.
                if i[6] > 0.0 && i[6] < 1e-37 {
                    all.push(Want::Between(0.0, 1.0));
                } else if i[6] > 0.0 {
                    all.push(Want::of((luminance(light) / i[6]).clamp(0.0, 1.0), (light.abs().element_sum() / i[6]).min(1e6)));
                } else {
                    all.push(Want::new(1.0));
                }
                all
            }),
        Case::new(
            "radiometry::lambert_blinn",
            "albedo: vec3f, specular: vec3f, shininess: f32, normal: vec3f, to_light: vec3f, to_viewer: vec3f",
        )
        .gives("vec3f")
        // Light from straight behind the viewer's direction has no half vector.
        .edges(
            [[0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [1.0, 0.0, 0.0]]
                .map(|d| [vec![0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 10.0, 0.0, 0.0, 1.0], d.to_vec(), d.map(|v| -v).to_vec()].concat()),
        )
        .random(shading)
        .twin(ulps(8.0, "of the lobe, its exponent times larger than of the cosine in it"), |i| {
            let (albedo, specular, shininess) = (v3(i), v3(&i[3..]), i[6]);
            let normal = v3(&i[7..]);
            let (to_light, to_viewer) = (v3(&i[10..]), v3(&i[13..]));
            match lambert_blinn(albedo, specular, shininess, normal, to_light, to_viewer) {
                Some((value, scale)) => (0..3).map(|k| Want::of(value[k], scale[k])).collect(),
                // Opposite: no half vector, no lobe.
                None if to_light == -to_viewer => values((albedo / PI).to_array()),
                // Nearly opposite: no certain half vector; bounded by the lobe's peak.
                None => {
                    let (lambert, peak) = (albedo / PI, albedo / PI + specular * (shininess + 8.0) / (8.0 * PI));
                    (0..3).map(|k| Want::Between(lambert[k] * 0.999_999, peak[k] * 1.000_001)).collect()
                }
            }
        }),
        Case::new("shadow::plane_reciprocal", "cosine: f32, height: f32, own: f32")
            .gives("f32")
            .edges([
                vec![1.0, 0.0, 1.0],
                vec![0.0, 0.0, 1.0],
                vec![0.05, 1.0, 1.0],
                vec![-0.05, -1.0, 1.0],
                vec![1.0, 1e-45, 1.0],
                vec![-1.0, 1.0, 1.0],
            ])
            .random(join([real(-1.0, 1.0), real(-10.0, 10.0), magnitude(1e-15, 1e5)]))
            .random(
                // A receiver whose plane the ray really meets.
                (real(-1.0, 1.0), real(-1.0, 1.0), magnitude(1e-3, 1e4)).prop_map(|(a, b, own)| vec![a[0], b[0] * own[0], own[0]]).boxed(),
            )
            .twin(ulps(3.0, "two quotients"), |i| {
                let [cosine, height, own] = [i[0], i[1], i[2]];
                let is_met = cosine.abs() >= f64::from(0.05_f32) && height != 0.0;
                // A height below the smallest normal number may be zero to a device.
                if height != 0.0 && height.abs() < 1e-37 {
                    return vec![Want::Between(0.499 / own, 2.001 / own)];
                }
                values([if is_met { (cosine / height).clamp(0.5 / own, 2.0 / own) } else { 1.0 / own }])
            }),
        Case::new("srgb::srgb_encode", "linear: vec3f")
            .gives("vec3f")
            .edges([
                vec![0.0, 1.0, 0.003_130_8],
                vec![0.003_130_9, -1.0, 1e30],
                vec![1e-45, 1e-10, 0.999_999_9],
                vec![LARGEST, -LARGEST, 0.5],
            ])
            .random(join([real(-0.5, 1.5), magnitude(1e-6, 10.0), real(0.0, 0.01)]))
            .twin(ulps(8.0, "a power by logarithm and exponential, of a number up to 1"), |i| {
                let curve = |v: f64| {
                    let c = v.clamp(0.0, 1.0);
                    if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
                };
                values_of([curve(i[0]), curve(i[1]), curve(i[2])], 1.0)
            }),
    ]
}

fn sky(is_lit: u32, exponent: f32) -> Sky {
    let [zenith, horizon, ground] = [Vec3::new(0.1, 0.5, 2.0), Vec3::new(1.0, 0.75, 0.5), Vec3::new(0.05, 0.04, 0.0)];
    Sky { zenith, daylight: 1.0, horizon, exponent, ground, is_lit }
}

fn surroundings() -> Vec<Case> {
    let of_sky = |sky: Sky| {
        Case::new("sky::sky_radiance", "direction: vec3f")
            .gives("vec3f")
            .reads(&[Resource::uniform("scene_sky", "Sky", &sky)])
            .edges(
                [
                    [0.0, 1.0, 0.0],
                    [0.0, -1.0, 0.0],
                    [1.0, 0.0, 0.0],
                    [1.0, -0.0, 0.0],
                    [1.0, 1e-20, 0.0],
                    [0.0, 1e-10, 0.0],
                    [1e10, 1e10, 0.0],
                ]
                .map(|d| d.to_vec()),
            )
            .random(vector(1e-6, 1e6))
            .twin(
                ulps(16.0, "a power by logarithm and exponential; near the horizon of a height that is small against the vector"),
                move |i| {
                    let height = v3(i).normalize().y;
                    let [zenith, horizon, ground] = [sky.zenith, sky.horizon, sky.ground].map(Vec3::as_dvec3);
                    let share = height.max(0.0).powf(f64::from(sky.exponent));
                    let lit = if height >= 0.0 { horizon + (zenith - horizon) * share } else { ground };
                    let lit = if sky.is_lit == 0 { DVec3::ZERO } else { lit };
                    values_of(lit.to_array(), 2.0)
                },
            )
    };
    vec![of_sky(sky(1, 0.5)), of_sky(sky(1, 3.0)), of_sky(sky(0, 1.0))]
}

#[test]
fn light_is_as_its_twins() {
    check(cases());
}
