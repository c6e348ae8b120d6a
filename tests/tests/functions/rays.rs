//! Rays against the hierarchy of a real scene, and what paths of light need between its surfaces.

use std::{
    f64::consts::PI,
    sync::{Arc, OnceLock},
};

use glam::{DMat3, DVec2, DVec3, Vec3};
use manylight_graph::value::Format;
use manylight_scene::{
    Scene,
    bvh::{Bvh, BvhNode, BvhTriangle},
    gpu_data::{self, NO_TEXTURE, SceneInfo, Sky},
};
use proptest::strategy::Strategy;

use super::{
    directions::{basis, v3},
    harness::{Case, EXACT, Resource, Want, absolute, check, relative, ulps, values, values_of},
    inputs::{
        ALMOST_ONE, Numbers, colour, index, join, magnitude, magnitude_or_zero, one_of, real, unit_interval, unit_vector, vector, word,
    },
    light::{LIGHT, Light, MAKE_LIGHT, lambert_blinn, light},
    random::{hash, scramble, sobol, unit},
};
use crate::support::root;

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [boxes(), hierarchy(), surfaces(), sampling(), paths()].into_iter().flatten().collect()
}

/// A distance that no ray reaches.
const MISSED: f64 = 3.0e38_f32 as f64;

fn boxes() -> Vec<Case> {
    vec![
        Case::new("bvh::make_ray", "origin: vec3f, direction: vec3f")
            .before("let ray = make_ray(origin, direction);")
            .also("vec3f", "ray.origin")
            .also("vec3f", "ray.direction")
            .also("vec3f", "ray.inverse")
            .edges([
                vec![0.0, 0.0, 0.0, 0.0, -0.0, 1e-20],
                vec![0.0, 0.0, 0.0, 1e-30, -1e-30, 1e20],
                vec![0.0, 0.0, 0.0, -1e-19, 1e-21, 0.0],
            ])
            .random(join([vector(1e-3, 1e4), vector(1e-6, 1e6)]))
            .twin(ulps(2.5, "a quotient, for which WGSL allows this"), |i| {
                let tiny = f64::from(1e-20_f32);
                let inverse = |d: f64| {
                    1.0 / if d.abs() >= tiny {
                        d
                    } else if d >= 0.0 {
                        tiny
                    } else {
                        -tiny
                    }
                };
                values([i[0], i[1], i[2], i[3], i[4], i[5], inverse(i[3]), inverse(i[4]), inverse(i[5])])
            }),
        Case::new("bvh::enter_box", "origin: vec3f, direction: vec3f, low: vec3f, extent: vec3f, limit: f32")
            .imports("bvh::make_ray")
            .also("f32", "enter_box(make_ray(origin, direction), low, low + extent, limit)")
            .edges([
                // Along a face, from inside, away from it, a flat box, a limit before it.
                vec![0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 1.0, 2.0, 1.0, 3e38],
                vec![0.5, 0.5, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 3e38],
                vec![0.5, 2.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 3e38],
                vec![0.5, -1.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 3e38],
                vec![0.5, -1.0, 0.5, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 0.5],
            ])
            .random(
                // At a point of the box or beside it.
                (
                    vector(0.1, 10.0),
                    vector(1e-2, 1e1),
                    [0.0..4.0_f64, 0.0..4.0, 0.0..4.0],
                    [-0.3..1.3_f64, -0.3..1.3, -0.3..1.3],
                    one_of(&[3e38, 1.0, 100.0, 0.0]),
                )
                    .prop_map(|(origin, low, extent, inside, limit)| {
                        let target = (0..3).map(|k| low[k] + inside[k] * extent[k] - origin[k]);
                        [origin.clone(), target.collect(), low.clone(), extent.to_vec(), limit].concat()
                    })
                    .boxed(),
            )
            .random(join([
                vector(0.1, 10.0),
                unit_vector(),
                vector(1e-2, 1e1),
                magnitude(0.1, 4.0),
                magnitude(0.1, 4.0),
                magnitude(0.1, 4.0),
                one_of(&[3e38]),
            ]))
            .twin(relative(1e-6, "a difference and a product, and the slack of a few roundings"), |i| {
                let (origin, direction, low) = (v3(i), v3(&i[3..]), v3(&i[6..]));
                let high = (low.as_vec3() + v3(&i[9..]).as_vec3()).as_dvec3();
                let [mut enter, mut leave] = [0.0_f64, i[12]];
                let mut largest = 0.0_f64;
                for k in 0..3 {
                    let tiny = f64::from(1e-20_f32);
                    let d =
                        if direction[k].abs() >= tiny { direction[k] } else { tiny.copysign(if direction[k] >= 0.0 { 1.0 } else { -1.0 }) };
                    let (a, b) = ((low[k] - origin[k]) / d, (high[k] - origin[k]) / d);
                    enter = enter.max(a.min(b));
                    leave = leave.min(a.max(b));
                    largest = largest.max(a.abs().min(b.abs()).min(1e15));
                }
                let margin = (leave - enter) / enter.abs().max(leave.abs()).max(1e-20);
                match () {
                    () if margin > 2e-6 => vec![Want::new(enter)],
                    () if margin < -2e-6 => vec![Want::new(MISSED)],
                    () => vec![Want::OneOf(vec![Want::new(enter), Want::new(MISSED)])],
                }
            }),
        Case::new("bvh::hit_triangle", "origin: vec3f, direction: vec3f, a: vec3f, ab: vec3f, ac: vec3f, nearest: f32, limit: f32")
            .imports("bvh::{make_ray, BvhTriangle, MISSED}")
            .before("let h = hit_triangle(make_ray(origin, direction), BvhTriangle(a, 0u, ab, 0u, ac, 0u), nearest, limit);")
            .also("f32", "h.t")
            .also("vec2f", "select(vec2f(0.0), vec2f(h.u, h.v), h.t < MISSED)")
            .edges([
                // A corner, an edge, edge-on, no area, behind.
                vec![0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
                vec![0.5, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 3e38],
                vec![0.2, 0.2, -1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 3e38],
            ])
            .random(
                (
                    vector(0.1, 10.0),
                    vector(0.1, 10.0),
                    vector(0.1, 10.0),
                    vector(0.1, 10.0),
                    [-0.3..1.3_f64, -0.3..1.3],
                    one_of(&[3e38, 1.0, 0.5]),
                )
                    .prop_map(|(origin, a, ab, ac, at, limit)| {
                        let target = (0..3).map(|k| a[k] + at[0] * ab[k] + at[1] * ac[k] - origin[k]);
                        [origin.clone(), target.collect(), a.clone(), ab.clone(), ac.clone(), vec![0.0], limit].concat()
                    })
                    .boxed(),
            )
            .twin(relative(4e-6, "of what a determinant's rounding makes of distance and weights"), |i| {
                let (origin, direction, a, ab, ac) = (v3(i), v3(&i[3..]), v3(&i[6..]), v3(&i[9..]), v3(&i[12..]));
                let miss = || vec![Want::new(MISSED), Want::new(0.0), Want::new(0.0)];
                let hit = meet(origin, direction, a, ab, ac);
                if hit.condition > 3e4 {
                    // Edge-on: rounding decides everything.
                    return vec![Want::Between(i[15], MISSED), Want::Between(-1.0, 2.0), Want::Between(-1.0, 2.0)];
                }
                let slack = 1e-6 * (2.0 + hit.condition);
                let found = vec![
                    Want::of(hit.t, hit.condition * (1.0 + hit.t.abs())),
                    Want::of(hit.u, hit.condition),
                    Want::of(hit.v, hit.condition),
                ];
                let inside = hit.u.min(hit.v).min(1.0 - hit.u - hit.v);
                let ahead = (hit.t - i[15]).min(i[16] - hit.t);
                match () {
                    () if inside < -slack || ahead < -slack => miss(),
                    () if inside > slack && ahead > slack => found,
                    () => found.into_iter().zip(miss()).map(|(a, b)| Want::OneOf(vec![a, b])).collect(),
                }
            }),
    ]
}

/// Where a ray meets a triangle's plane.
struct Meeting {
    t: f64,
    u: f64,
    v: f64,
    /// How much larger the errors of these are than those of what they are computed from.
    condition: f64,
}

/// By solving o + t d = a + u ab + v ac.
fn meet(origin: DVec3, direction: DVec3, a: DVec3, ab: DVec3, ac: DVec3) -> Meeting {
    let matrix = DMat3::from_cols(-direction, ab, ac);
    let determinant = matrix.determinant();
    let extent = direction.length() * ab.length() * ac.length();
    if determinant.abs() <= 1e-300 {
        return Meeting { t: f64::NAN, u: f64::NAN, v: f64::NAN, condition: f64::INFINITY };
    }
    let found = matrix.inverse() * (origin - a);
    let reach = (origin - a).length() / ab.length().min(ac.length()).min(direction.length());
    Meeting { t: found.x, u: found.y, v: found.z, condition: extent / determinant.abs() * (1.0 + reach) }
}

/// A scene in 64 bits.
struct World {
    nodes: Vec<BvhNode>,
    triangles: Vec<BvhTriangle>,
    vertices: Vec<gpu_data::Vertex>,
    corners: Vec<gpu_data::Triangle>,
    objects: Vec<gpu_data::Object>,
    materials: Vec<gpu_data::Material>,
    lights: Vec<gpu_data::Light>,
    sky: Sky,
    info: SceneInfo,
    textures: (u32, u32, Vec<Vec<u8>>),
}

/// Found by a ray: the distance, the triangle, the weights. `Err` if rounding decides.
type Found = Result<Option<(f64, usize, f64, f64)>, ()>;

/// A point of a surface.
#[derive(Debug, Clone, Copy)]
struct Surface {
    position: DVec3,
    normal: DVec3,
    geometric: DVec3,
    to_viewer: DVec3,
    albedo: DVec3,
    specular: DVec3,
    shininess: f64,
}

const SURFACE: &str = "position: vec3f, normal: vec3f, geometric: vec3f, viewer: vec3f, albedo: vec3f, specular: vec3f, shininess: f32";
const MAKE_SURFACE: &str = "let s = Surface(position, normal, geometric, viewer, albedo, specular, shininess);";
const OTHER: &str =
    "position_y: vec3f, normal_y: vec3f, geometric_y: vec3f, viewer_y: vec3f, albedo_y: vec3f, specular_y: vec3f, shininess_y: f32";
const MAKE_OTHER: &str = "let y = Surface(position_y, normal_y, geometric_y, viewer_y, albedo_y, specular_y, shininess_y);";
/// Numbers that a surface takes.
const SURFACE_NUMBERS: usize = 19;

impl Surface {
    fn of(i: &[f64]) -> Self {
        let at = |k: usize| v3(&i[3 * k..]);
        Self { position: at(0), normal: at(1), geometric: at(2), to_viewer: at(3), albedo: at(4), specular: at(5), shininess: i[18] }
    }

    fn numbers(&self) -> Vec<f64> {
        let vectors = [self.position, self.normal, self.geometric, self.to_viewer, self.albedo, self.specular];
        vectors.iter().flat_map(DVec3::to_array).chain([self.shininess]).collect()
    }

    /// 1/sr, and the magnitude of its error.
    fn brdf(&self, towards: DVec3) -> Option<(DVec3, DVec3)> {
        lambert_blinn(self.albedo, self.specular, self.shininess, self.normal, towards, self.to_viewer)
    }
}

/// A value and the magnitude of its error; `Err` if rounding decides.
type Estimate = Result<(DVec3, DVec3), ()>;

const BLACK: Estimate = Ok((DVec3::ZERO, DVec3::ZERO));

fn world() -> Arc<World> {
    static WORLD: OnceLock<Arc<World>> = OnceLock::new();
    Arc::clone(WORLD.get_or_init(|| Arc::new(World::load())))
}

impl World {
    fn load() -> Self {
        let scene = Scene::load(root().join("assets/glossy.ron")).unwrap_or_else(|e| panic!("{e}"));
        let state = scene.sample(0.0);
        let Bvh { nodes, triangles, .. } = Bvh::build(&scene, &state);
        let base = gpu_data::Light {
            position: Vec3::new(2.78, 5.2, 0.6),
            kind: 0,
            direction: Vec3::new(-0.05, -0.85, 0.5).normalize(),
            falloff: 2,
            strength: Vec3::new(200.0, 150.0, 100.0),
            beam_rad: 0.4,
            cutoff_rad: 0.7,
            radius: 1.0,
            share: 0.5,
            ray_density: 0.5 / (2.0 * std::f32::consts::PI * (1.0 - 0.7_f32.cos())),
        };
        let pi = std::f32::consts::PI;
        let dark = gpu_data::Light { share: 0.0, strength: Vec3::ZERO, ray_density: 0.0, ..base };
        let point = gpu_data::Light {
            position: Vec3::new(1.0, 4.0, 1.0),
            kind: 1,
            strength: Vec3::splat(20.0),
            beam_rad: pi,
            cutoff_rad: pi,
            share: 0.25,
            ray_density: 0.25 / (4.0 * pi),
            ..base
        };
        let sun = gpu_data::Light {
            position: Vec3::new(2.78, 2.73, -8.0),
            kind: 2,
            direction: Vec3::new(0.2, -0.3, 1.0).normalize(),
            strength: Vec3::new(3.0, 3.0, 2.5),
            radius: 5.0,
            share: 0.25,
            ray_density: 0.25 / (25.0 * pi),
            ..base
        };
        let lights = vec![base, dark, point, sun];
        let sky = Sky {
            zenith: Vec3::new(0.5, 0.75, 1.0),
            daylight: 1.0,
            horizon: Vec3::new(1.0, 0.9, 0.8),
            exponent: 1.0,
            ground: Vec3::splat(0.125),
            is_lit: 1,
        };
        // Neighbours differ little: devices interpolate between them in steps of 1/256.
        let (width, height) = (scene.textures.width, scene.textures.height);
        let texel = |at: u32| [160 + (hash(at) % 32) as u8, 170 + (hash(at + 1) % 32) as u8, 180 + (hash(at + 2) % 32) as u8, 255];
        let textures =
            (0..scene.textures.layers()).map(|layer| (0..width * height).flat_map(|at| texel(4 * at + layer)).collect()).collect();
        Self {
            nodes,
            triangles,
            vertices: scene.gpu_vertices(),
            corners: scene.gpu_triangles(),
            objects: state.objects.clone(),
            materials: scene.gpu_materials(),
            info: SceneInfo { light_count: lights.len() as u32, ..state.info },
            lights,
            sky,
            textures: (width, height, textures),
        }
    }

    fn hierarchy(&self) -> [Resource; 2] {
        [Resource::buffer("bvh_nodes", "BvhNode", &self.nodes), Resource::buffer("bvh_triangles", "BvhTriangle", &self.triangles)]
    }

    fn scene_info(&self) -> Resource {
        Resource::uniform("scene_info", "SceneInfo", &self.info)
    }

    fn scene_lights(&self) -> Resource {
        Resource::buffer("scene_lights", "Light", &self.lights)
    }

    fn geometry(&self) -> [Resource; 5] {
        let (width, height, layers) = &self.textures;
        [
            Resource::buffer("scene_vertices", "Vertex", &self.vertices),
            Resource::buffer("scene_triangles", "Triangle", &self.corners),
            Resource::buffer("scene_objects", "Object", &self.objects),
            Resource::buffer("scene_materials", "Material", &self.materials),
            Resource::texture_array("scene_textures", Format::Rgba8UnormSrgb, (*width, *height), layers),
        ]
    }

    fn light(&self, index: usize) -> Light {
        let l = &self.lights[index];
        Light {
            position: l.position.as_dvec3(),
            kind: l.kind,
            direction: l.direction.as_dvec3(),
            curve: l.falloff,
            strength: l.strength.as_dvec3(),
            beam: l.beam_rad.into(),
            cutoff: l.cutoff_rad.into(),
            density: l.ray_density.into(),
        }
    }

    /// All triangles, one after another.
    fn nearest(&self, origin: DVec3, direction: DVec3, limit: f64) -> Found {
        let mut best: Option<(f64, usize, f64, f64)> = None;
        let mut doubtful = f64::INFINITY;
        let reach = f64::from(self.info.diagonal) / direction.length();
        for (index, triangle) in self.triangles.iter().enumerate() {
            let [a, ab, ac] = [triangle.a, triangle.ab, triangle.ac].map(Vec3::as_dvec3);
            let p = direction.cross(ac);
            let determinant = ab.dot(p);
            let s = origin - a;
            let q = s.cross(ab);
            let (u, v, t) = (s.dot(p) / determinant, direction.dot(q) / determinant, ac.dot(q) / determinant);
            let inside = u.min(v).min(1.0 - u - v);
            // Errors grow where the ray is nearly in the plane.
            let slack = 2e-6
                + 2e-6 * direction.length() * ab.length() * ac.length() / determinant.abs()
                    * (1.0 + s.length() / ab.length().min(ac.length()));
            let near = slack.min(1.0) * 1e-1 * reach;
            if !(inside > -slack && t > -near && t < limit + near) {
                continue;
            }
            if inside > slack && t > near && t < limit - near.min(limit) {
                if best.is_none_or(|(known, ..)| t < known) {
                    best = Some((t, index, u, v));
                }
            } else {
                doubtful = doubtful.min(t - near);
            }
        }
        match best {
            Some((t, ..)) if doubtful <= t + 1e-5 * reach => Err(()),
            None if doubtful < f64::INFINITY => Err(()),
            found => Ok(found),
        }
    }

    fn visible(&self, p: DVec3, q: DVec3) -> Result<bool, ()> {
        match self.nearest(p, q - p, 1.0) {
            Ok(found) => Ok(found.is_none()),
            Err(()) => Err(()),
        }
    }

    fn lift(&self, s: &Surface) -> DVec3 {
        s.position + s.geometric * (2e-5 * f64::from(self.info.diagonal))
    }

    fn sees_light(&self, s: &Surface, light: &Light) -> Result<bool, ()> {
        let from = self.lift(s);
        if light.kind == 2 {
            self.nearest(from, -light.direction, MISSED).map(|found| found.is_none())
        } else {
            self.visible(from, light.position)
        }
    }

    /// A point of a triangle, seen along a direction.
    fn surface(&self, triangle: usize, u: f64, v: f64, direction: DVec3) -> Surface {
        let t = &self.triangles[triangle];
        let [a, ab, ac] = [t.a, t.ab, t.ac].map(Vec3::as_dvec3);
        let corners = &self.corners[t.index as usize];
        let [p, q, r] = [corners.a, corners.b, corners.c].map(|vertex| self.vertices[vertex as usize]);
        let weights = [1.0 - u - v, u, v];
        let to_viewer = -direction.normalize();
        let facing = |n: DVec3, to: DVec3| if n.dot(to) >= 0.0 { n } else { -n };
        let geometric = facing(ab.cross(ac).normalize(), to_viewer);
        let m = self.objects[t.object as usize].normal_from_object.as_dmat4();
        let smooth: DVec3 = [p, q, r].iter().zip(weights).map(|(vertex, w)| vertex.normal.as_dvec3() * w).sum();
        let smooth = m.transform_vector3(smooth);
        let normal = if smooth.length_squared() > 0.0 { facing(smooth.normalize(), geometric) } else { geometric };
        let material = &self.materials[t.material as usize];
        let mut albedo = material.diffuse.as_dvec3();
        if material.diffuse_texture != NO_TEXTURE {
            let uv: DVec2 = [p, q, r].iter().zip(weights).map(|(vertex, w)| DVec2::new(vertex.u.into(), vertex.v.into()) * w).sum();
            albedo *= self.texture(material.diffuse_texture as usize, uv);
        }
        Surface {
            position: a + u * ab + v * ac,
            normal,
            geometric,
            to_viewer,
            albedo,
            specular: material.specular.as_dvec3(),
            shininess: material.shininess.into(),
        }
    }

    /// Interpolated between texels, repeated beyond the borders.
    fn texture(&self, layer: usize, uv: DVec2) -> DVec3 {
        let (width, height, layers) = &self.textures;
        let size = DVec2::new((*width).into(), (*height).into());
        let p = uv * size - 0.5;
        let (low, share) = (p.floor(), p - p.floor());
        let decode = |byte: u8| {
            let c = f64::from(byte) / 255.0;
            if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
        };
        let at = |dx: f64, dy: f64| {
            let (x, y) = ((low.x + dx).rem_euclid(size.x) as usize, (low.y + dy).rem_euclid(size.y) as usize);
            let first = 4 * (y * *width as usize + x);
            DVec3::from_array([0, 1, 2].map(|c| decode(layers[layer][first + c])))
        };
        at(0.0, 0.0).lerp(at(1.0, 0.0), share.x).lerp(at(0.0, 1.0).lerp(at(1.0, 1.0), share.x), share.y)
    }

    /// Radiance to the viewer of what arrives from a light, without shadows.
    fn reflected(s: &Surface, light: &Light) -> Estimate {
        let (to_light, arriving, _) = light.at(s.position);
        let [(irradiance, error)] = arriving[..] else { return Err(()) };
        let cosine = s.normal.dot(to_light).max(0.0);
        let (brdf, brdf_error) = s.brdf(to_light).ok_or(())?;
        Ok((irradiance * brdf * cosine, error * brdf_error))
    }

    fn direct_of(&self, s: &Surface, light: &Light) -> Estimate {
        let (radiance, error) = Self::reflected(s, light)?;
        let cosine = s.geometric.dot(light.at(s.position).0);
        if radiance.max_element() <= 0.0 || cosine < -1e-5 {
            return Ok((DVec3::ZERO, error));
        }
        if cosine < 1e-5 {
            return Err(());
        }
        Ok((if self.sees_light(s, light)? { radiance } else { DVec3::ZERO }, error))
    }

    /// Of all lights, each with a weight.
    fn direct(&self, s: &Surface, weight: impl Fn(&Light) -> f64) -> Estimate {
        (0..self.lights.len()).map(|index| self.light(index)).try_fold((DVec3::ZERO, DVec3::ZERO), |(sum, errors), light| {
            let (radiance, error) = self.direct_of(s, &light)?;
            Ok((sum + radiance * weight(&light), errors + error))
        })
    }

    fn pdf_light(y: &Surface, light: &Light) -> f64 {
        let (to_light, _, density) = light.at(y.position);
        density * y.geometric.dot(to_light).max(0.0)
    }

    /// Balance heuristic against rays from each light.
    fn weighted_direct(&self, x: &Surface, y: &Surface) -> Estimate {
        let own = coupling(x, y) / PI;
        self.direct(y, |light| own / (own + Self::pdf_light(y, light)).max(1e-30))
    }

    /// Which light, for a number of [0, 1).
    fn choose(&self, mut rest: f64) -> Result<usize, ()> {
        let mut chosen = 0;
        for (index, light) in self.lights.iter().enumerate().filter(|(_, light)| light.share > 0.0) {
            chosen = index;
            if (rest - f64::from(light.share)).abs() < 1e-6 {
                return Err(());
            }
            if rest < light.share.into() {
                break;
            }
            rest -= f64::from(light.share);
        }
        Ok(chosen)
    }

    fn bounce_from_light(&self, x: &Surface, chosen: usize, u: DVec2) -> Estimate {
        let light = self.light(chosen);
        let (origin, direction) = light_ray(&light, self.lights[chosen].radius.into(), u);
        let Some((_, triangle, b, c)) = self.nearest(origin, direction, MISSED)? else { return BLACK };
        let mut y = self.surface(triangle, b, c, direction);
        let to_x = (x.position - y.position).normalize();
        y.to_viewer = to_x;
        let between = coupling(x, &y);
        let (radiance, error) = Self::reflected(&y, &light)?;
        let cosine = -x.geometric.dot(to_x);
        if cosine.abs() < 1e-4 || (between > 0.0 && between * x.position.distance_squared(y.position) < 1e-4) {
            return Err(());
        }
        if between <= 0.0 || cosine <= 0.0 || radiance.max_element() <= 0.0 || !self.visible(self.lift(x), self.lift(&y))? {
            return BLACK;
        }
        let (brdf, brdf_error) = x.brdf(-to_x).ok_or(())?;
        let weight = between / (Self::pdf_light(&y, &light) + coupling(x, &y) / PI);
        Ok((brdf * radiance * weight, brdf_error * error * weight))
    }
}

fn coupling(x: &Surface, y: &Surface) -> f64 {
    let offset = x.position - y.position;
    let direction = offset / offset.length_squared().max(1e-30).sqrt();
    (-x.normal.dot(direction)).max(0.0) * y.geometric.dot(direction).max(0.0) / offset.length_squared().max(1e-30)
}

/// Uniform in the cone, over the sphere, or over the disk.
fn light_ray(light: &Light, radius: f64, u: DVec2) -> (DVec3, DVec3) {
    let (sin, cos) = (2.0 * PI * u.x).sin_cos();
    let axes = basis(light.direction);
    if light.kind == 2 {
        let r = radius * u.y.sqrt();
        return (light.position + axes * DVec3::new(r * cos, r * sin, 0.0), light.direction);
    }
    let z = 1.0 - u.y * (1.0 - light.cutoff.cos());
    let r = (1.0 - z * z).max(0.0).sqrt();
    (light.position, axes * DVec3::new(r * cos, r * sin, z))
}

fn cosine_direction(normal: DVec3, u: DVec2) -> DVec3 {
    let (sin, cos) = (2.0 * PI * u.x).sin_cos();
    basis(normal) * DVec3::new(u.y.sqrt() * cos, u.y.sqrt() * sin, (1.0 - u.y).max(0.0).sqrt())
}

/// Rays from inside the box: anywhere, and at the edges of its objects.
fn rays() -> Numbers {
    (real(0.1, 5.4), real(0.1, 5.4), real(0.1, 5.4), unit_vector(), magnitude(1e-2, 1e2))
        .prop_map(|(x, y, z, d, l)| vec![x[0], y[0], z[0], d[0] * l[0], d[1] * l[0], d[2] * l[0]])
        .boxed()
}

fn hierarchy() -> Vec<Case> {
    let world = world();
    let (scene, seeing) = (Arc::clone(&world), Arc::clone(&world));
    let empty = [
        Resource::buffer("bvh_nodes", "BvhNode", &[BvhNode { low: Vec3::ZERO, first: 0, high: Vec3::ZERO, count: 0 }]),
        world.hierarchy()[1].clone(),
    ];
    let flag = |v: bool| Want::new(f64::from(u8::from(v)));
    let intersect = || {
        Case::new("bvh::intersect", "origin: vec3f, direction: vec3f, limit: f32")
            .imports("bvh::{make_ray, bvh_triangles, MISSED}")
            .before("let ray = make_ray(origin, direction); let h = intersect(ray, limit, false); let t = bvh_triangles[h.triangle];")
            .also("f32", "h.t")
            .also("bool", "intersect(ray, limit, true).t < MISSED")
            // That the triangle and the weights are those of the place.
            .also("f32", "select(0.0, distance(t.a + h.u * t.ab + h.v * t.ac, origin + h.t * direction), h.t < MISSED)")
            .random(join([rays(), one_of(&[3e38, 1.0, 3.0])]))
    };
    vec![
        intersect().reads(&world.hierarchy()).count(2048).twin(
            absolute(4e-5, "in the box's units of 0.1 m: a ray's distance over a few of them"),
            move |i| {
                let (origin, direction) = (v3(i), v3(&i[3..]));
                match scene.nearest(origin, direction, i[6].min(MISSED)) {
                    Ok(Some((t, ..))) => vec![
                        Want::Between(
                            t - 1e-5 * (1.0 + t) / direction.length().min(1.0),
                            t + 1e-5 * (1.0 + t) / direction.length().min(1.0),
                        ),
                        flag(true),
                        Want::of(0.0, 1.0),
                    ],
                    Ok(None) => vec![Want::new(MISSED), flag(false), Want::new(0.0)],
                    Err(()) => vec![Want::Between(0.0, MISSED), Want::Between(0.0, 1.0), Want::finite()],
                }
            },
        ),
        intersect().reads(&empty).count(16).twin(EXACT, move |_| vec![Want::new(MISSED), flag(false), Want::new(0.0)]),
        Case::new("bvh::visible", "p: vec3f, q: vec3f")
            .gives("bool")
            .reads(&world.hierarchy())
            .edges([vec![1.0; 6]])
            .random(join((0..6).map(|_| real(0.05, 5.5))))
            .count(2048)
            .twin(EXACT, move |i| match seeing.visible(v3(i), v3(&i[3..])) {
                Ok(seen) => vec![flag(seen)],
                Err(()) => vec![Want::Between(0.0, 1.0)],
            }),
    ]
}

/// A point of the scene's surfaces, seen from the side of its normal.
fn surface() -> Numbers {
    let world = world();
    (0..world.triangles.len(), 0.01..0.99_f64, 0.01..0.99_f64, super::inputs::direction())
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

/// What [`World::bounce_from_light`] and others draw, in the order in which shaders do.
struct Random {
    seed: u32,
    index: u32,
    state: u32,
}

impl Random {
    fn new(seed: u32, first: u32, index: u32) -> Self {
        Self { seed, index, state: hash(seed ^ hash(first ^ hash(0))) }
    }

    fn next(&mut self) -> f64 {
        self.state = hash(self.state);
        unit(self.state)
    }

    fn pair(&mut self, purpose: u32, bounce: u32) -> DVec2 {
        if bounce > 0 {
            return DVec2::new(self.next(), self.next());
        }
        let seed = hash(self.seed ^ purpose);
        let [x, y] = sobol(scramble(self.index, seed) & 255);
        DVec2::new(unit(scramble(x, hash(seed ^ 1))), unit(scramble(y, hash(seed ^ 2))))
    }
}

const FROM_LIGHT: u32 = 0x2000;
const NEXT: u32 = 0x3000;

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
        two_surfaces("path::coupling", "s, y", |x, y| coupling(x, y)),
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
    let [a, b, c] = std::array::from_fn(|_| Arc::clone(&scene));
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
        .random(join([surface(), seeds(), index(4), one_of(&[0.0, 1.0]), one_of(&[0.0, 1.0])]))
        .count(1024)
        .twin(bound, move |i| near(c.gather(i))),
    ]
}

impl World {
    /// A path of up to three bounces, which roulette does not end.
    fn gather(&self, i: &[f64]) -> Estimate {
        let mut random = Random::new(i[19] as u32, i[20] as u32, i[21] as u32);
        let (bounces, lights, sky) = (i[22] as u32, i[23] > 0.0, i[24] > 0.0);
        let mut x = Surface::of(i);
        let (mut sum, mut scale, mut throughput) = (DVec3::splat(0.25), DVec3::splat(0.25), DVec3::ONE);
        for bounce in 0..bounces {
            if lights {
                let chosen = self.choose(random.next())?;
                let (radiance, error) = self.bounce_from_light(&x, chosen, random.pair(FROM_LIGHT, bounce))?;
                sum += throughput * radiance;
                scale += throughput * error;
            }
            let direction = cosine_direction(x.normal, random.pair(NEXT, bounce));
            let cosine = direction.dot(x.geometric);
            if cosine.abs() < 1e-4 {
                return Err(());
            }
            if cosine < 0.0 {
                break;
            }
            let (brdf, _) = x.brdf(direction).ok_or(())?;
            let Some((_, triangle, u, v)) = self.nearest(self.lift(&x), direction, MISSED)? else {
                if sky {
                    let [zenith, horizon, ground] = [self.sky.zenith, self.sky.horizon, self.sky.ground].map(Vec3::as_dvec3);
                    let height = direction.y;
                    sum += throughput * brdf * PI * if height >= 0.0 { horizon.lerp(zenith, height) } else { ground };
                }
                break;
            };
            throughput *= brdf * PI;
            let y = self.surface(triangle, u, v, direction);
            if lights {
                let (radiance, error) = self.weighted_direct(&x, &y)?;
                sum += throughput * radiance;
                scale += throughput * error;
            }
            x = y;
        }
        Ok((sum, scale))
    }
}

#[test]
fn rays_and_paths_are_as_their_twins() {
    check(cases());
}
