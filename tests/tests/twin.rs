//! A path tracer in 64 bits over a few triangles: nothing but cosine-distributed directions and a loop over all triangles. It shares no code
//! and no trick with the shader that it is compared with. And the same scene as files, for the shader.

use std::{f64::consts::PI, fmt::Write, fs, path::PathBuf};

use glam::DVec3;

use crate::{
    blocks::{Block, blocks},
    support::Random,
};

pub struct Triangle {
    corners: [DVec3; 3],
    /// Shading normals of unit length.
    normals: [DVec3; 3],
    albedo: DVec3,
}

/// Two triangles. The shading normals at the corners need not be those of the quad.
pub fn quad(corners: [DVec3; 4], normals: [DVec3; 4], albedo: DVec3) -> [Triangle; 2] {
    [[0, 1, 2], [0, 2, 3]].map(|i| Triangle { corners: i.map(|i| corners[i]), normals: i.map(|i| normals[i].normalize()), albedo })
}

/// A light, and how a scene file says it.
#[derive(Clone, Copy)]
pub enum Light {
    /// Linear fall-off.
    Spot {
        position: DVec3,
        target: DVec3,
        intensity: DVec3,
        beam_deg: f64,
        cutoff_deg: f64,
    },
    Point {
        position: DVec3,
        intensity: DVec3,
    },
    Directional {
        direction: DVec3,
        irradiance: DVec3,
    },
}

fn ron(v: DVec3) -> String {
    format!("({}, {}, {})", v.x, v.y, v.z)
}

impl Light {
    pub fn ron(&self) -> String {
        match *self {
            Self::Spot { position, target, intensity, beam_deg, cutoff_deg } => format!(
                "Spot(position: {}, target: {}, intensity: {}, beam_deg: {beam_deg}, cutoff_deg: {cutoff_deg})",
                ron(position),
                ron(target),
                ron(intensity)
            ),
            Self::Point { position, intensity } => format!("Point(position: {}, intensity: {})", ron(position), ron(intensity)),
            Self::Directional { direction, irradiance } => {
                format!("Directional(direction: {}, irradiance: {})", ron(direction), ron(irradiance))
            }
        }
    }

    /// Unit vector to the light, distance, and the irradiance of a surface that faces it.
    fn at(&self, point: DVec3) -> (DVec3, f64, DVec3) {
        let from = |position: DVec3, intensity: DVec3| {
            let offset = position - point;
            (offset.normalize(), offset.length(), intensity / offset.length_squared())
        };
        match *self {
            Self::Spot { position, target, intensity, beam_deg, cutoff_deg } => {
                let (to_light, distance, irradiance) = from(position, intensity);
                let angle_deg = (-to_light).angle_between(target - position).to_degrees();
                (to_light, distance, irradiance * ((cutoff_deg - angle_deg) / (cutoff_deg - beam_deg)).clamp(0.0, 1.0))
            }
            Self::Point { position, intensity } => from(position, intensity),
            Self::Directional { direction, irradiance } => (-direction.normalize(), f64::INFINITY, irradiance),
        }
    }
}

/// A square picture's camera.
pub struct Camera {
    pub origin: DVec3,
    pub target: DVec3,
    pub up: DVec3,
    pub fov_deg: f64,
}

impl Camera {
    /// Through a place of the picture, (0, 0) top left and (1, 1) bottom right.
    pub fn ray(&self, u: f64, v: f64) -> DVec3 {
        let forward = (self.target - self.origin).normalize();
        let right = forward.cross(self.up).normalize();
        let tan = (0.5 * self.fov_deg).to_radians().tan();
        forward + tan * ((2.0 * u - 1.0) * right + (1.0 - 2.0 * v) * right.cross(forward))
    }
}

pub struct Twin {
    pub triangles: Vec<Triangle>,
    pub lights: Vec<Light>,
    pub camera: Camera,
}

/// Where a ray meets a surface; normals towards the ray's origin.
struct Hit {
    position: DVec3,
    normal: DVec3,
    geometric: DVec3,
    albedo: DVec3,
}

/// Rays start this far off a surface, in the scene's units (about 1 across).
const OFFSET: f64 = 1e-6;

impl Twin {
    /// Writes the scene into a folder and returns its path.
    pub fn write(&self, folder: &tempfile::TempDir) -> PathBuf {
        let (mut obj, mut mtl) = ("mtllib scene.mtl\n".to_owned(), String::new());
        for (i, triangle) in self.triangles.iter().enumerate() {
            let Triangle { corners, normals, albedo } = triangle;
            for (corner, normal) in corners.iter().zip(normals) {
                writeln!(obj, "v {} {} {}\nvn {} {} {}", corner.x, corner.y, corner.z, normal.x, normal.y, normal.z).expect("a string");
            }
            writeln!(obj, "usemtl m{i}\nf -3//-3 -2//-2 -1//-1").expect("a string");
            writeln!(mtl, "newmtl m{i}\nKd {} {} {}", albedo.x, albedo.y, albedo.z).expect("a string");
        }
        let Camera { origin, target, up, fov_deg } = &self.camera;
        let camera = format!("(origin: {}, target: {}, up: {}, fov_x_deg: {fov_deg})", ron(*origin), ron(*target), ron(*up));
        let lights: Vec<String> = self.lights.iter().map(Light::ron).collect();
        let scene = format!("Scene(meshes: [\"scene.obj\"], camera: {camera}, lights: [{}])", lights.join(", "));
        for (name, text) in [("scene.obj", &obj), ("scene.mtl", &mtl), ("scene.ron", &scene)] {
            fs::write(folder.path().join(name), text).expect("written");
        }
        folder.path().join("scene.ron")
    }

    /// The nearest hit before `limit`.
    fn hit(&self, origin: DVec3, direction: DVec3, limit: f64) -> Option<Hit> {
        let mut nearest = None;
        let mut limit = limit;
        for triangle in &self.triangles {
            let [a, b, c] = triangle.corners;
            let (ab, ac) = (b - a, c - a);
            let across = ab.cross(ac);
            let t = (a - origin).dot(across) / direction.dot(across);
            if !(t > 0.0 && t < limit) {
                continue;
            }
            // Barycentric coordinates by areas.
            let position = origin + t * direction;
            let share = |p: DVec3, q: DVec3| (p - position).cross(q - position).dot(across) / across.length_squared();
            let weights = [share(b, c), share(c, a), share(a, b)];
            if weights.iter().any(|w| *w < 0.0) {
                continue;
            }
            limit = t;
            let facing = |normal: DVec3, to: DVec3| if normal.dot(to) < 0.0 { -normal } else { normal };
            let geometric = facing(across.normalize(), -direction);
            let smooth: DVec3 = triangle.normals.iter().zip(weights).map(|(n, w)| *n * w).sum();
            nearest = Some(Hit { position, normal: facing(smooth.normalize(), geometric), geometric, albedo: triangle.albedo });
        }
        nearest
    }

    /// Radiance by the lights themselves.
    fn direct(&self, hit: &Hit) -> DVec3 {
        let start = hit.position + OFFSET * hit.geometric;
        let of_light = |light: &Light| {
            let (to_light, distance, irradiance) = light.at(hit.position);
            let seen = hit.geometric.dot(to_light) > 0.0 && self.hit(start, to_light, distance).is_none();
            if seen { hit.albedo / PI * irradiance * hit.normal.dot(to_light).max(0.0) } else { DVec3::ZERO }
        };
        self.lights.iter().map(of_light).sum()
    }

    /// Radiance that comes over one more surface, by a single path.
    fn one_bounce(&self, hit: &Hit, state: &mut Random) -> DVec3 {
        let (r2, angle) = (state.unit(), 2.0 * PI * state.unit());
        let (side, across) = hit.normal.any_orthonormal_pair();
        let direction = r2.sqrt() * (angle.cos() * side + angle.sin() * across) + (1.0 - r2).sqrt() * hit.normal;
        if direction.dot(hit.geometric) <= 0.0 {
            return DVec3::ZERO;
        }
        let next = self.hit(hit.position + OFFSET * hit.geometric, direction, f64::INFINITY);
        next.map_or(DVec3::ZERO, |next| hit.albedo * self.direct(&next))
    }

    /// Direct light and one bounce of a square picture, from this many paths a pixel.
    pub fn render(&self, size: u32, paths: u32) -> [Vec<Block>; 2] {
        let mut state = Random(1);
        let mut pixels = Vec::new();
        for y in 0..size {
            for x in 0..size {
                let mut sums = [[DVec3::ZERO; 2]; 2];
                for _ in 0..paths {
                    let (u, v) = (f64::from(x) + state.unit(), f64::from(y) + state.unit());
                    let direction = self.camera.ray(u / f64::from(size), v / f64::from(size));
                    let Some(hit) = self.hit(self.camera.origin, direction, f64::INFINITY) else { continue };
                    for (sum, value) in sums.iter_mut().zip([self.direct(&hit), self.one_bounce(&hit, &mut state)]) {
                        sum[0] += value;
                        sum[1] += value * value;
                    }
                }
                let n = f64::from(paths);
                pixels.push(sums.map(|[sum, squares]| {
                    let mean = sum / n;
                    let error = ((squares / n - mean * mean).max(DVec3::ZERO) / (n - 1.0)).map(f64::sqrt);
                    (mean.to_array(), error.to_array())
                }));
            }
        }
        let at = |x: u32, y: u32| &pixels[(y * size + x) as usize];
        [0, 1].map(|component| blocks(size, |x, y| at(x, y)[component].0, |x, y| at(x, y)[component].1))
    }
}
