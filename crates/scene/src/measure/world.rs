//! The scene at one time, as rays meet it: the twin of what `shaders/common/path.wgsl` reads.

use std::sync::Arc;

use glam::{Mat3, Vec2, Vec3};

use super::light::{Surface, unit};
use crate::{
    bvh::{Bvh, Hit, Ray},
    gpu_data::{Light, LightView, Material, NO_TEXTURE, Object, SceneInfo, Triangle, Vertex, View},
    import::{Textures, linear_from_srgb},
    scene::Scene,
    state::SceneState,
};

/// What stays while nothing but lights and camera moves.
#[derive(Debug)]
pub(super) struct Geometry {
    bvh: Bvh,
    vertices: Vec<Vertex>,
    triangles: Vec<Triangle>,
    normal_from_object: Vec<Mat3>,
    objects: Vec<Object>,
}

impl Geometry {
    pub(super) fn new(scene: &Scene, state: &SceneState) -> Self {
        Self {
            bvh: Bvh::build(scene, state),
            vertices: scene.vertices_of(&state.deformed),
            triangles: scene.triangles_of(&state.deformed),
            normal_from_object: state.objects.iter().map(|object| Mat3::from_mat4(object.normal_from_object)).collect(),
            objects: state.objects.clone(),
        }
    }

    /// Whether it is that of another time as well.
    pub(super) fn holds_at(&self, state: &SceneState) -> bool {
        state.deformed.is_empty() && self.objects == state.objects
    }
}

/// The scene at one time.
#[derive(Debug)]
pub(super) struct World<'a> {
    pub(super) geometry: Arc<Geometry>,
    materials: Vec<Material>,
    textures: &'a Textures,
    /// Linear values of the bytes of textures.
    linear: [f32; 256],
    /// Strengths are over that of the strongest: the features are ratios, and products stay finite.
    pub(super) lights: Vec<Light>,
    pub(super) views: Vec<LightView>,
    pub(super) camera: View,
    /// How far from surfaces rays start and end.
    offset: f32,
}

impl<'a> World<'a> {
    pub(super) fn new(scene: &'a Scene, state: &SceneState, geometry: Arc<Geometry>, aspect: f32) -> Self {
        let mut lights = state.lights.clone();
        let strongest = lights.iter().map(|light| light.strength.max_element()).fold(0.0, f32::max);
        if strongest > 0.0 {
            lights.iter_mut().for_each(|light| light.strength /= strongest);
        }
        // Without lights there is a view all the same, of a dark one.
        let views = if lights.is_empty() { Vec::new() } else { state.light_views.clone() };
        Self {
            geometry,
            materials: scene.gpu_materials(),
            textures: &scene.textures,
            linear: std::array::from_fn(|byte| linear_from_srgb(byte as f32 / 255.0)),
            lights,
            views,
            camera: state.camera_view(aspect),
            offset: ray_offset(&state.info),
        }
    }

    /// Whether a surface has a lobe.
    pub(super) fn is_glossy(&self) -> bool {
        self.materials.iter().any(|material| material.specular.max_element() > 0.0)
    }

    /// The nearest hit of a ray before `limit`.
    pub(super) fn nearest(&self, ray: &Ray, limit: f32) -> Option<Hit> {
        self.geometry.bvh.nearest(ray, limit)
    }

    /// Everything that a ray goes through before `limit`.
    pub(super) fn all_hits(&self, ray: &Ray, limit: f32, hits: &mut Vec<Hit>) {
        self.geometry.bvh.all_hits(ray, limit, hits);
    }

    /// Whether anything is on a ray before `limit`.
    pub(super) fn is_blocked(&self, ray: &Ray, limit: f32) -> bool {
        self.geometry.bvh.is_blocked(ray, limit)
    }

    /// Whether nothing lies between two points that are off their surfaces already.
    pub(super) fn sees(&self, from: Vec3, to: Vec3) -> bool {
        self.geometry.bvh.sees(from, to)
    }

    /// A point just off a surface, on the side that it was seen from.
    pub(super) fn lift(&self, surface: &Surface) -> Vec3 {
        surface.position + surface.geometric * self.offset
    }

    /// A point just off a surface, on its other side.
    pub(super) fn behind(&self, surface: &Surface) -> Vec3 {
        surface.position - surface.geometric * self.offset
    }

    /// The surface where a ray meets a triangle.
    pub(super) fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let t = &self.geometry.bvh.triangles[hit.triangle as usize];
        let corners = &self.geometry.triangles[t.index as usize];
        let [a, b, c] = [corners.a, corners.b, corners.c].map(|corner| &self.geometry.vertices[corner as usize]);
        let w = 1.0 - hit.u - hit.v;
        let to_viewer = -unit(ray.direction);
        let towards = |normal: Vec3, side: Vec3| if normal.dot(side) >= 0.0 { normal } else { -normal };
        let geometric = towards(unit(t.ab.normalize_or_zero().cross(t.ac.normalize_or_zero())), to_viewer);
        let smooth = w * a.normal + hit.u * b.normal + hit.v * c.normal;
        let mut normal = geometric;
        if smooth != Vec3::ZERO {
            let smooth = self.geometry.normal_from_object[t.object as usize] * smooth;
            if smooth.length_squared() > 0.0 {
                normal = towards(unit(smooth), geometric);
            }
        }
        let material = &self.materials[t.material as usize];
        let mut albedo = material.diffuse;
        if material.diffuse_texture != NO_TEXTURE {
            let uv = w * Vec2::new(a.u, a.v) + hit.u * Vec2::new(b.u, b.v) + hit.v * Vec2::new(c.u, c.v);
            albedo *= self.texel(material.diffuse_texture, uv);
        }
        let position = t.a + hit.u * t.ab + hit.v * t.ac;
        Surface { position, normal, geometric, to_viewer, albedo, specular: material.specular, shininess: material.shininess }
    }

    /// Linear colour of a texture's finest level at a place, mixed from four texels; it repeats.
    fn texel(&self, layer: u32, uv: Vec2) -> Vec3 {
        let textures = self.textures;
        let size = Vec2::new(textures.width as f32, textures.height as f32);
        // Coordinates without a fraction, or none at all, are the first texel.
        let place = (uv - uv.floor()) * size - 0.5;
        let low = place.floor();
        let [fx, fy] = (place - low).to_array();
        let wrap = |i: f32, n: u32| (i as i64).rem_euclid(i64::from(n)) as usize;
        let (xs, ys) = ([0.0, 1.0].map(|d| wrap(low.x + d, textures.width)), [0.0, 1.0].map(|d| wrap(low.y + d, textures.height)));
        let first = layer as usize * textures.width as usize * textures.height as usize;
        let at = |x: usize, y: usize| {
            let byte = 4 * (first + ys[y] * textures.width as usize + xs[x]);
            let [r, g, b] = [0, 1, 2].map(|c| self.linear[usize::from(textures.levels[0][byte + c])]);
            Vec3::new(r, g, b)
        };
        at(0, 0).lerp(at(1, 0), fx).lerp(at(0, 1).lerp(at(1, 1), fx), fy)
    }
}

/// Rays start and end so far from surfaces: as `ray_offset` of `shaders/common/bvh.wgsl`.
fn ray_offset(info: &SceneInfo) -> f32 {
    let farthest = info.bounds_min.abs().max(info.bounds_max.abs()).max_element();
    (2e-5 * info.diagonal).max(farthest * 2.0_f32.powi(-20))
}
