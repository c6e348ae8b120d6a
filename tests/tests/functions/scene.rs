//! A scene in 64 bits: rays try every triangle, and paths are followed with the random numbers that shaders draw.

use std::{
    f64::consts::PI,
    sync::{Arc, OnceLock},
};

use glam::{DVec2, DVec3, Vec3};
use manylight_graph::value::Format;
use manylight_scene::{
    Scene,
    bvh::{Bvh, BvhNode, BvhTriangle},
    gpu_data::{self, NO_TEXTURE, SceneInfo, Sky},
};

use super::{
    directions::{basis, v3},
    harness::Resource,
    light::{Light, lambert_blinn},
    random::{hash, scramble, sobol, unit},
};
use crate::support::root;

/// A distance that no ray reaches.
pub const MISSED: f64 = 3.0e38_f32 as f64;

/// A scene in 64 bits.
pub struct World {
    pub nodes: Vec<BvhNode>,
    pub triangles: Vec<BvhTriangle>,
    pub vertices: Vec<gpu_data::Vertex>,
    pub corners: Vec<gpu_data::Triangle>,
    pub objects: Vec<gpu_data::Object>,
    pub materials: Vec<gpu_data::Material>,
    pub lights: Vec<gpu_data::Light>,
    pub sky: Sky,
    pub info: SceneInfo,
    pub textures: (u32, u32, Vec<Vec<u8>>),
}

/// Found by a ray: the distance, the triangle, the weights. `Err` if rounding decides.
pub type Found = Result<Option<(f64, usize, f64, f64)>, ()>;

/// A point of a surface.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    pub position: DVec3,
    pub normal: DVec3,
    pub geometric: DVec3,
    pub to_viewer: DVec3,
    pub albedo: DVec3,
    pub specular: DVec3,
    pub shininess: f64,
}

pub const SURFACE: &str = "position: vec3f, normal: vec3f, geometric: vec3f, viewer: vec3f, albedo: vec3f, specular: vec3f, shininess: f32";
pub const MAKE_SURFACE: &str = "let s = Surface(position, normal, geometric, viewer, albedo, specular, shininess);";
pub const OTHER: &str =
    "position_y: vec3f, normal_y: vec3f, geometric_y: vec3f, viewer_y: vec3f, albedo_y: vec3f, specular_y: vec3f, shininess_y: f32";
pub const MAKE_OTHER: &str = "let y = Surface(position_y, normal_y, geometric_y, viewer_y, albedo_y, specular_y, shininess_y);";
/// Numbers that a surface takes.
pub const SURFACE_NUMBERS: usize = 19;

impl Surface {
    pub fn of(i: &[f64]) -> Self {
        let at = |k: usize| v3(&i[3 * k..]);
        Self { position: at(0), normal: at(1), geometric: at(2), to_viewer: at(3), albedo: at(4), specular: at(5), shininess: i[18] }
    }

    pub fn numbers(&self) -> Vec<f64> {
        let vectors = [self.position, self.normal, self.geometric, self.to_viewer, self.albedo, self.specular];
        vectors.iter().flat_map(DVec3::to_array).chain([self.shininess]).collect()
    }

    /// 1/sr, and the magnitude of its error.
    pub fn brdf(&self, towards: DVec3) -> Option<(DVec3, DVec3)> {
        lambert_blinn(self.albedo, self.specular, self.shininess, self.normal, towards, self.to_viewer)
    }
}

/// A value and the magnitude of its error; `Err` if rounding decides.
pub type Estimate = Result<(DVec3, DVec3), ()>;

pub const BLACK: Estimate = Ok((DVec3::ZERO, DVec3::ZERO));

pub fn world() -> Arc<World> {
    static WORLD: OnceLock<Arc<World>> = OnceLock::new();
    Arc::clone(WORLD.get_or_init(|| Arc::new(World::load())))
}

impl World {
    pub fn load() -> Self {
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

    pub fn hierarchy(&self) -> [Resource; 2] {
        [Resource::buffer("bvh_nodes", "BvhNode", &self.nodes), Resource::buffer("bvh_triangles", "BvhTriangle", &self.triangles)]
    }

    pub fn scene_info(&self) -> Resource {
        Resource::uniform("scene_info", "SceneInfo", &self.info)
    }

    pub fn scene_lights(&self) -> Resource {
        Resource::buffer("scene_lights", "Light", &self.lights)
    }

    pub fn geometry(&self) -> [Resource; 5] {
        let (width, height, layers) = &self.textures;
        [
            Resource::buffer("scene_vertices", "Vertex", &self.vertices),
            Resource::buffer("scene_triangles", "Triangle", &self.corners),
            Resource::buffer("scene_objects", "Object", &self.objects),
            Resource::buffer("scene_materials", "Material", &self.materials),
            Resource::texture_array("scene_textures", Format::Rgba8UnormSrgb, (*width, *height), layers),
        ]
    }

    pub fn light(&self, index: usize) -> Light {
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
    pub fn nearest(&self, origin: DVec3, direction: DVec3, limit: f64) -> Found {
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

    pub fn visible(&self, p: DVec3, q: DVec3) -> Result<bool, ()> {
        match self.nearest(p, q - p, 1.0) {
            Ok(found) => Ok(found.is_none()),
            Err(()) => Err(()),
        }
    }

    pub fn lift(&self, s: &Surface) -> DVec3 {
        s.position + s.geometric * ray_offset(self.info.bounds_min.as_dvec3(), self.info.bounds_max.as_dvec3(), self.info.diagonal.into())
    }

    pub fn sees_light(&self, s: &Surface, light: &Light) -> Result<bool, ()> {
        let from = self.lift(s);
        if light.kind == 2 {
            self.nearest(from, -light.direction, MISSED).map(|found| found.is_none())
        } else {
            self.visible(from, light.position)
        }
    }

    /// A point of a triangle, seen along a direction.
    pub fn surface(&self, triangle: usize, u: f64, v: f64, direction: DVec3) -> Surface {
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
    pub fn texture(&self, layer: usize, uv: DVec2) -> DVec3 {
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
    pub fn reflected(s: &Surface, light: &Light) -> Estimate {
        let (to_light, arriving, _) = light.at(s.position);
        let [(irradiance, error)] = arriving[..] else { return Err(()) };
        let cosine = s.normal.dot(to_light).max(0.0);
        let (brdf, brdf_error) = s.brdf(to_light).ok_or(())?;
        Ok((irradiance * brdf * cosine, error * brdf_error))
    }

    pub fn direct_of(&self, s: &Surface, light: &Light) -> Estimate {
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
    pub fn direct(&self, s: &Surface, weight: impl Fn(&Light) -> f64) -> Estimate {
        (0..self.lights.len()).map(|index| self.light(index)).try_fold((DVec3::ZERO, DVec3::ZERO), |(sum, errors), light| {
            let (radiance, error) = self.direct_of(s, &light)?;
            Ok((sum + radiance * weight(&light), errors + error))
        })
    }

    pub fn pdf_light(y: &Surface, light: &Light) -> f64 {
        let (to_light, _, density) = light.at(y.position);
        density * y.geometric.dot(to_light).max(0.0)
    }

    /// Balance heuristic against rays from each light.
    pub fn weighted_direct(&self, x: &Surface, y: &Surface) -> Estimate {
        let own = coupling(x, y) / PI;
        self.direct(y, |light| own / (own + Self::pdf_light(y, light)).max(1e-30))
    }

    /// Which light, for a number of [0, 1).
    pub fn choose(&self, mut rest: f64) -> Result<usize, ()> {
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

    pub fn bounce_from_light(&self, x: &Surface, chosen: usize, u: DVec2) -> Estimate {
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

/// How far from surfaces rays start: a share of the scene, or eight units in the last place of its largest coordinate.
pub fn ray_offset(low: DVec3, high: DVec3, diagonal: f64) -> f64 {
    (2e-5 * diagonal).max(low.abs().max(high.abs()).max_element() / f64::from(1 << 20))
}

pub fn coupling(x: &Surface, y: &Surface) -> f64 {
    let offset = x.position - y.position;
    let direction = offset / offset.length_squared().max(1e-30).sqrt();
    (-x.normal.dot(direction)).max(0.0) * y.geometric.dot(direction).max(0.0) / offset.length_squared().max(1e-30)
}

/// Uniform in the cone, over the sphere, or over the disk.
pub fn light_ray(light: &Light, radius: f64, u: DVec2) -> (DVec3, DVec3) {
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

pub fn cosine_direction(normal: DVec3, u: DVec2) -> DVec3 {
    let (sin, cos) = (2.0 * PI * u.x).sin_cos();
    basis(normal) * DVec3::new(u.y.sqrt() * cos, u.y.sqrt() * sin, (1.0 - u.y).max(0.0).sqrt())
}

/// What [`World::bounce_from_light`] and others draw, in the order in which shaders do.
pub struct Random {
    pub seed: u32,
    pub index: u32,
    pub state: u32,
}

impl Random {
    pub fn new(seed: u32, first: u32, index: u32) -> Self {
        Self { seed, index, state: hash(seed ^ hash(first ^ hash(0))) }
    }

    pub fn next(&mut self) -> f64 {
        self.state = hash(self.state);
        unit(self.state)
    }

    pub fn pair(&mut self, purpose: u32, bounce: u32) -> DVec2 {
        if bounce > 0 {
            return DVec2::new(self.next(), self.next());
        }
        let seed = hash(self.seed ^ purpose);
        let [x, y] = sobol(scramble(self.index, seed) & 255);
        DVec2::new(unit(scramble(x, hash(seed ^ 1))), unit(scramble(y, hash(seed ^ 2))))
    }
}

pub const FROM_LIGHT: u32 = 0x2000;
pub const NEXT: u32 = 0x3000;

impl World {
    /// A path of up to three bounces, which roulette does not end; added to what is known.
    pub fn gather(&self, i: &[f64], known: Estimate) -> Estimate {
        let mut random = Random::new(i[19] as u32, i[20] as u32, i[21] as u32);
        let (bounces, lights, sky) = (i[22] as u32, i[23] > 0.0, i[24] > 0.0);
        let mut x = Surface::of(i);
        let (mut sum, mut scale) = known?;
        let mut throughput = DVec3::ONE;
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
