//! What paths of light need between the surfaces of a real scene, and the paths themselves.

use std::{f64::consts::PI, sync::Arc};

use glam::{DVec2, DVec3};
use manylight_scene::gpu_data::NO_TEXTURE;
use proptest::strategy::Strategy;

use super::{
    directions::v3,
    harness::{Case, EXACT, Resource, Want, check, relative, ulps, values, values_of},
    inputs::{
        ALMOST_ONE, Numbers, colour, direction, index, join, magnitude_or_zero, real, switch, unit_interval, unit_vector, vector, word,
    },
    light::{LIGHT, Light, MAKE_LIGHT, light},
    scene::{
        Estimate, FROM_LIGHT, MAKE_OTHER, MAKE_SURFACE, OTHER, Random, SURFACE, SURFACE_NUMBERS, Surface, cosine_direction, coupling,
        light_ray, world,
    },
};

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [surfaces(), sampling(), paths()].into_iter().flatten().collect()
}

/// A point of the scene's surfaces, seen from the side of its normal.
fn surface() -> Numbers {
    let world = world();
    (0..world.triangles.len(), 0.01..0.99_f64, 0.01..0.99_f64, direction())
        .prop_map(move |(triangle, u, v, direction)| {
            let (u, v) = if u + v > 0.99 { (0.99 - 0.99 * u, 0.99 - 0.99 * v) } else { (u, v) };
            // Large triangles oftener.
            let triangle = if triangle % 3 > 0 { triangle % 40 } else { triangle };
            world.surface(triangle, u.min(0.98), v.min(0.98 - u.min(0.98)), direction).numbers()
        })
        .boxed()
}

/// Any surface at all: nothing in it belongs together.
fn any_surface() -> Numbers {
    join([vector(1e-3, 1e3), unit_vector(), unit_vector(), unit_vector(), colour(1.0), colour(1.0), magnitude_or_zero(1.0, 1e3)])
}

fn of_surface(function: &'static str, more: &str) -> Case {
    Case::new(function, String::leak(format!("{SURFACE}{more}"))).imports("path::Surface").before(MAKE_SURFACE)
}

fn estimate(found: Estimate) -> Vec<Want> {
    match found {
        Ok((value, scale)) => (0..3).map(|k| Want::of(value[k], scale[k])).collect(),
        Err(()) => vec![Want::Between(0.0, 1e30); 3],
    }
}

fn surfaces() -> Vec<Case> {
    let scene = world();
    let flag = |v: Result<bool, ()>| vec![v.map_or(Want::Between(0.0, 1.0), |v| Want::new(f64::from(u8::from(v))))];
    let [a, b, c, d, e, f] = std::array::from_fn(|_| Arc::clone(&scene));
    let [nodes, triangles] = scene.hierarchy();
    let seeing = [scene.scene_info(), nodes, triangles];
    let lit = [seeing.to_vec(), vec![scene.scene_lights()]].concat();
    let mut seen = scene.geometry().to_vec();
    seen.push(seeing[2].clone());
    let triangle_count = scene.triangles.len() as u32;
    vec![
        Case::new("path::surface_at", "origin: vec3f, direction: vec3f, triangle: u32, u: f32, v: f32")
            .imports("bvh::{make_ray, Hit}")
            .before("let s = surface_at(make_ray(origin, direction), Hit(1.0, triangle, u, v));")
            .also("vec3f", "s.position")
            .also("vec3f", "s.normal")
            .also("vec3f", "s.geometric")
            .also("vec3f", "s.to_viewer")
            .also("vec3f", "s.albedo")
            .also("vec3f", "s.specular")
            .also("f32", "s.shininess")
            .reads(&seen)
            .random(
                (join([vector(0.1, 10.0), vector(0.1, 10.0)]), index(triangle_count), 0.0..1.0_f64, 0.0..1.0_f64)
                    .prop_map(|(ray, triangle, u, v)| {
                        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                        [ray, triangle, vec![u, v]].concat()
                    })
                    .boxed(),
            )
            .twin(ulps(24.0, "of the box's size; unit vectors; textures apart, which devices interpolate in steps of 1/256"), move |i| {
                let s = a.surface(i[6] as usize, i[7], i[8], v3(&i[3..]));
                // Seen edge-on, rounding decides which side it is.
                if s.geometric.dot(s.to_viewer).abs() < 1e-5 || s.normal.dot(s.geometric).abs() < 1e-5 {
                    return vec![Want::finite(); SURFACE_NUMBERS];
                }
                let material = &a.materials[a.triangles[i[6] as usize].material as usize];
                let mut all = values_of(s.position.to_array(), 8.0);
                all.extend([s.normal, s.geometric, s.to_viewer].iter().flat_map(|v| values_of(v.to_array(), 1.0)));
                let textured = material.diffuse_texture != NO_TEXTURE;
                all.extend(s.albedo.to_array().map(|v| if textured { Want::Between(v - 4e-3, v + 4e-3) } else { Want::new(v) }));
                all.extend(values(s.specular.to_array()));
                all.push(Want::new(s.shininess));
                all
            }),
        of_surface("path::brdf", ", towards: vec3f")
            .also("vec3f", "brdf(s, towards)")
            .random(join([any_surface(), unit_vector()]))
            .twin(ulps(8.0, "as lambert_blinn"), |i| estimate(Surface::of(i).brdf(v3(&i[SURFACE_NUMBERS..])).ok_or(()))),
        of_surface("path::lift", "").also("vec3f", "lift(s)").reads(&[scene.scene_info()]).random(any_surface()).twin(
            ulps(2.0, "a product and a sum"),
            move |i| {
                let s = Surface::of(i);
                values_of(b.lift(&s).to_array(), s.position.abs().max_element())
            },
        ),
        of_surface("path::sees", ", point: vec3f")
            .also("bool", "sees(s, point)")
            .reads(&seeing)
            .random(join([surface(), real(0.05, 5.5), real(0.05, 5.5), real(0.05, 5.5)]))
            .count(1024)
            .twin(EXACT, move |i| flag(c.visible(c.lift(&Surface::of(i)), v3(&i[SURFACE_NUMBERS..])))),
        of_surface("path::sees_light", ", which: u32")
            .imports("path::scene_lights")
            .also("bool", "sees_light(s, scene_lights[which])")
            .reads(&lit)
            .random(join([surface(), index(4)]))
            .count(1024)
            .twin(EXACT, move |i| flag(d.sees_light(&Surface::of(i), &d.light(i[SURFACE_NUMBERS] as usize)))),
        of_surface("path::reflected", ", to_light: vec3f, irradiance: vec3f")
            .imports("radiometry::Arrival")
            .also("vec3f", "reflected(s, Arrival(to_light, irradiance, 1.0))")
            .random(join([any_surface(), unit_vector(), colour(1e4)]))
            .twin(ulps(8.0, "as lambert_blinn, times a cosine"), |i| {
                let (s, to_light, irradiance) = (Surface::of(i), v3(&i[SURFACE_NUMBERS..]), v3(&i[SURFACE_NUMBERS + 3..]));
                estimate(
                    s.brdf(to_light)
                        .ok_or(())
                        .map(|(brdf, error)| (irradiance * brdf * s.normal.dot(to_light).max(0.0), irradiance * error)),
                )
            }),
        of_surface("path::direct_of", ", which: u32")
            .imports("path::scene_lights")
            .imports("radiometry::light_at")
            .also("vec3f", "direct_of(s, scene_lights[which], light_at(scene_lights[which], s.position))")
            .reads(&lit)
            .random(join([surface(), index(4)]))
            .count(1024)
            .twin(ulps(40.0, "as the fall-off and lambert_blinn"), move |i| {
                estimate(e.direct_of(&Surface::of(i), &e.light(i[SURFACE_NUMBERS] as usize)))
            }),
        of_surface("path::direct", "")
            .also("vec3f", "direct(s)")
            .reads(&lit)
            .random(surface())
            .count(1024)
            .twin(ulps(40.0, "as the fall-off and lambert_blinn"), move |i| estimate(f.direct(&Surface::of(i), |_| 1.0))),
    ]
}

/// Seed, first path of the invocation, path.
fn seeds() -> Numbers {
    join([word(), index(64), index(256)])
}

const START: &str = "start_paths(seed, first); path_index = path;";

fn sampling() -> Vec<Case> {
    let scene = world();
    let chosen = Arc::clone(&scene);
    let direction = ulps(24.0, "sine and cosine of up to 2π; a rotation");
    let start = |function: &'static str, more: &str| {
        Case::new(function, String::leak(format!("seed: u32, first: u32, path: u32{more}")))
            .imports("path::{start_paths, path_index}")
            .before(START)
    };
    vec![
        Case::new("path::start_paths", "seed: u32, first: u32")
            .imports("path::random")
            .before("start_paths(seed, first);")
            .also("f32", "random()")
            .random(join([word(), word()]))
            .twin(EXACT, |i| values([Random::new(i[0] as u32, i[1] as u32, 0).next()])),
        start("path::random", "").also("vec3f", "vec3f(random(), random(), random())").random(seeds()).twin(EXACT, |i| {
            let mut random = Random::new(i[0] as u32, i[1] as u32, i[2] as u32);
            values([random.next(), random.next(), random.next()])
        }),
        start("path::random_pair", ", purpose: u32, bounce: u32")
            .also("vec2f", "random_pair(purpose, bounce)")
            .also("vec2f", "random_pair(purpose, bounce)")
            .random(join([seeds(), word(), index(3)]))
            .twin(EXACT, |i| {
                let mut random = Random::new(i[0] as u32, i[1] as u32, i[2] as u32);
                let [a, b] = [0; 2].map(|_| random.pair(i[3] as u32, i[4] as u32));
                values([a.x, a.y, b.x, b.y])
            }),
        start("path::choose_light", "")
            .also("u32", "choose_light()")
            .reads(&[scene.scene_info(), scene.scene_lights()])
            .random(seeds())
            .twin(EXACT, move |i| {
                let number = Random::new(i[0] as u32, i[1] as u32, i[2] as u32).next();
                vec![chosen.choose(number).map_or(Want::Between(0.0, 3.0), |index| Want::new(index as f64))]
            }),
        Case::new("path::light_ray", String::leak(format!("{LIGHT}, u: vec2f")))
            .imports("scene::Light")
            .before(String::leak(format!("{MAKE_LIGHT} let ray = light_ray(light, u);")))
            .also("vec3f", "ray.origin")
            .also("vec3f", "ray.direction")
            .random(join([light(), unit_interval(), unit_interval()]))
            .twin(direction, |i| {
                let light = Light::of(i);
                let (origin, direction) = light_ray(&light, 1.0, DVec2::new(i[14], i[15]));
                [values_of(origin.to_array(), light.position.length() + 1.0), values_of(direction.to_array(), 1.0)].concat()
            }),
        Case::new("path::cosine_direction", "normal: vec3f, u: vec2f")
            .gives("vec3f")
            .random(join([unit_vector(), unit_interval(), unit_interval()]))
            .edges([vec![0.0, 0.0, 1.0, 0.0, ALMOST_ONE], vec![0.0, 0.0, -1.0, 0.5, 0.0]])
            .twin(direction, |i| values_of(cosine_direction(v3(i), DVec2::new(i[3], i[4])).to_array(), 1.0)),
        Case::new("path::towards", "origin: vec3f, point: vec3f")
            .gives("vec3f")
            .edges([vec![1.0; 6], vec![0.0; 6], vec![0.0, 0.0, 0.0, 1e-18, 0.0, 0.0]])
            .random(join([vector(1e-3, 1e4), vector(1e-3, 1e4)]))
            .twin(ulps(4.0, "a unit vector"), |i| {
                let offset = v3(&i[3..]) - v3(i);
                values_of((offset / offset.length_squared().max(1e-30).sqrt()).to_array(), 1.0)
            }),
        two_surfaces("path::coupling", "s, y", coupling),
        two_surfaces("path::pdf_cosine", "s, y", |x, y| coupling(x, y) / PI),
        of_surface("path::pdf_light", ", to_light: vec3f, density: f32")
            .imports("radiometry::Arrival")
            .also("f32", "pdf_light(s, Arrival(to_light, vec3f(1.0), density))")
            .random(join([any_surface(), unit_vector(), magnitude_or_zero(1e-6, 1e6)]))
            .twin(ulps(4.0, "a product of a cosine"), |i| {
                let cosine = Surface::of(i).geometric.dot(v3(&i[SURFACE_NUMBERS..])).max(0.0);
                vec![Want::of(i[SURFACE_NUMBERS + 3] * cosine, i[SURFACE_NUMBERS + 3])]
            }),
    ]
}

fn two_surfaces(function: &'static str, arguments: &str, of: fn(&Surface, &Surface) -> f64) -> Case {
    let name = function.trim_start_matches("path::");
    Case::new(function, String::leak(format!("{SURFACE}, {OTHER}")))
        .imports("path::Surface")
        .before(String::leak(format!("{MAKE_SURFACE} {MAKE_OTHER}")))
        .also("f32", format!("{name}({arguments})"))
        .random(join([any_surface(), any_surface()]))
        .random(join([surface(), surface()]))
        // In the same place, and next to it.
        .random(
            (any_surface(), any_surface(), magnitude_or_zero(1e-12, 1.0))
                .prop_map(|(x, mut y, near)| {
                    for k in 0..3 {
                        y[k] = x[k] + near[0] * (y[k] - x[k]).clamp(-1.0, 1.0);
                    }
                    [x, y].concat()
                })
                .boxed(),
        )
        .twin(ulps(8.0, "two cosines, each of the rounding of a unit vector, over the squared distance"), move |i| {
            let (x, y) = (Surface::of(i), Surface::of(&i[SURFACE_NUMBERS..]));
            let d2 = x.position.distance_squared(y.position);
            vec![Want::of(of(&x, &y), 1.0 / d2.max(1e-30))]
        })
}

fn paths() -> Vec<Case> {
    let scene = world();
    let [a, b, c, d] = std::array::from_fn(|_| Arc::clone(&scene));
    let [nodes, triangles] = scene.hierarchy();
    let lit = [scene.scene_info(), nodes, triangles, scene.scene_lights()];
    let all = [lit.to_vec(), scene.geometry().to_vec()].concat();
    let sky = [all.clone(), vec![Resource::uniform("scene_sky", "Sky", &scene.sky)]].concat();
    let bound = relative(
        5e-3,
        "positions are off by some 1e-6 of the box, which surfaces that touch and narrow highlights make more of; textures are interpolated in steps of 1/256",
    );
    // Black where the twin is black; where the twin is not, off by a share of it.
    let near = |found: Estimate| match found {
        Ok((value, scale)) => (0..3).map(|k| Want::of(value[k], 1e-3 * scale[k])).collect(),
        Err(()) => vec![Want::Between(0.0, 1e30); 3],
    };
    vec![
        Case::new("path::weighted_direct", String::leak(format!("{SURFACE}, {OTHER}")))
            .imports("path::Surface")
            .before(String::leak(format!("{MAKE_SURFACE} {MAKE_OTHER}")))
            .also("vec3f", "weighted_direct(s, y)")
            .reads(&lit)
            .random(join([surface(), surface()]))
            .count(1024)
            .twin(bound, move |i| near(a.weighted_direct(&Surface::of(i), &Surface::of(&i[SURFACE_NUMBERS..])))),
        Case::new("path::bounce_from_light", String::leak(format!("{SURFACE}, seed: u32, first: u32, path: u32")))
            .imports("path::{Surface, start_paths, path_index}")
            .before(String::leak(format!("{MAKE_SURFACE} {START}")))
            .also("vec3f", "bounce_from_light(s, 0u)")
            .reads(&all)
            .random(join([surface(), seeds()]))
            .count(1024)
            .twin(bound, move |i| {
                let mut random = Random::new(i[19] as u32, i[20] as u32, i[21] as u32);
                let found =
                    b.choose(random.next()).and_then(|chosen| b.bounce_from_light(&Surface::of(i), chosen, random.pair(FROM_LIGHT, 0)));
                near(found)
            }),
        Case::new(
            "path::gather",
            String::leak(format!("{SURFACE}, seed: u32, first: u32, path: u32, bounces: u32, lights: bool, sky: bool")),
        )
        .imports("path::{Surface, Gathered, start_paths, path_index}")
        .before(String::leak(format!("{MAKE_SURFACE} {START}")))
        .also("vec3f", "gather(s, Gathered(lights, sky, bounces), vec3f(0.25))")
        .reads(&sky)
        .random(join([surface(), seeds(), index(4), switch(), switch()]))
        .count(1024)
        .twin(bound, move |i| near(c.gather(i, Ok((DVec3::splat(0.25), DVec3::splat(0.25)))))),
        Case::new(
            "path::light_of",
            String::leak(format!("{SURFACE}, seed: u32, first: u32, path: u32, bounces: u32, lights: bool, sky: bool, with_direct: bool")),
        )
        .imports("path::{Surface, Gathered, start_paths, path_index}")
        .before(String::leak(format!("{MAKE_SURFACE} {START}")))
        .also("vec3f", "light_of(s, with_direct, Gathered(lights, sky, bounces))")
        .reads(&sky)
        .random(join([surface(), seeds(), index(4), switch(), switch(), switch()]))
        .count(1024)
        .twin(bound, move |i| {
            let direct = if i[25] > 0.0 { d.direct(&Surface::of(i), |_| 1.0) } else { Ok((DVec3::ZERO, DVec3::ZERO)) };
            near(d.gather(i, direct))
        }),
    ]
}

#[test]
fn paths_are_as_their_twins() {
    check(cases());
}
