//! A scene in host memory, and how it is loaded.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bytemuck::Zeroable;
use glam::Vec3;
use manylight_graph::diagnostics::Diagnostics;

use crate::{
    bounds::Bounds,
    deform::{Deformation, Deformed, Room},
    file,
    files::{Disk, FileReader},
    gpu_data::{self, Falloff},
    import::{Material, Mesh, Textures},
    lights,
    measure::Memo,
    motion::{CameraPose, LightPose, Pose, Repeat, Track},
    sky::{Sky, SunLight},
    state::SceneState,
};

/// A mesh somewhere in the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneObject {
    /// As named in the scene file, else the stem of its mesh's file; of glTF, the name of its node.
    pub name: String,
    /// Index of its mesh.
    pub mesh: usize,
    /// Where it is.
    pub pose: Track<Pose>,
    /// Bounds and area in world space where it starts.
    pub(crate) at_rest: Extent,
}

/// Extent of an object in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extent {
    pub(crate) bounds: Bounds,
    pub(crate) area: f64,
}

/// A light.
#[derive(Debug, Clone, PartialEq)]
pub struct Light {
    /// Where it is, where it points and how strong it is.
    pub pose: Track<LightPose>,
    /// Where its rays go.
    pub shape: LightShape,
}

/// Where a light's rays go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightShape {
    /// From a point into a cone.
    Spot {
        /// Half-angle of full intensity in degrees.
        beam_deg: f32,
        /// Half-angle beyond which it is dark, in degrees; below 90.
        cutoff_deg: f32,
        /// Between the two.
        falloff: Falloff,
    },
    /// From a point in all directions alike.
    Point,
    /// All the same way, from far away.
    Directional,
}

/// Everything there is to render, over all time. [`Scene::sample`] gives it at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Stem of the file's name.
    pub name: String,
    /// Meshes; each file once, or each mesh of a glTF file.
    pub meshes: Vec<Mesh>,
    /// Instances of meshes; at least one.
    pub objects: Vec<SceneObject>,
    /// Materials of all meshes.
    pub materials: Vec<Material>,
    /// Textures of all materials.
    pub textures: Textures,
    /// Lights; empty only if the file says so.
    pub lights: Vec<Light>,
    /// The light that goes over the sky in a day, if there is one.
    pub sun: Option<SunLight>,
    /// What rays meet that leave the scene, by day.
    pub sky: Sky,
    /// The camera.
    pub camera: Track<CameraPose>,
    /// What buffers need for its geometry at all times, as far as is known.
    pub room: Room,
    /// What was mended or made up while loading.
    pub warnings: Diagnostics,
    /// Every file read or looked for: when one changes, the scene may.
    pub sources: Vec<PathBuf>,
    /// Hash of the contents of all files: equal hash, equal scene.
    pub hash: u64,
    /// What is known of it.
    pub(crate) memo: Memo,
}

/// Room that has become too small grows to what is needed and one part in so many more, so that it does not grow in every frame.
const ROOM_TO_GROW: usize = 4;

impl Scene {
    /// Loads a scene file (`.ron`), a mesh (`.obj`) or a glTF file (`.gltf`, `.glb`) from disk.
    ///
    /// # Errors
    /// All faults of the scene file, and meshes that cannot be used.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Diagnostics> {
        Self::load_with(path, &Disk)
    }

    /// Loads a scene file, a mesh or a glTF file from anywhere, for example from an [`Embedded`](crate::files::Embedded) set of files.
    ///
    /// # Errors
    /// All faults of the scene file, and meshes that cannot be used.
    pub fn load_with(path: impl AsRef<Path>, reader: &dyn FileReader) -> Result<Self, Diagnostics> {
        file::load(path.as_ref(), reader)
    }

    /// What the scene has, for conditions in pipelines.
    pub fn features(&self) -> BTreeMap<String, bool> {
        let smooth = |mesh: &Mesh| {
            matches!(mesh.deformation, Some(Deformation::Metaballs(_))) || mesh.vertices.iter().any(|vertex| vertex.normal != Vec3::ZERO)
        };
        let features = [
            ("textures", self.textures.count > 0),
            ("glossy", self.materials.iter().any(|material| material.specular != Vec3::ZERO)),
            ("moving_objects", self.objects.iter().any(|object| object.pose.moves())),
            ("deforming_objects", self.deforms()),
            ("moving_lights", self.sun.is_some() || self.lights.iter().any(|light| light.pose.moves())),
            ("moving_camera", self.camera.moves()),
            ("several_lights", self.lights.len() > 1),
            ("normals", self.meshes.iter().any(smooth)),
        ];
        features.into_iter().map(|(name, on)| (name.to_owned(), on)).collect()
    }

    /// Moves the first spot light (or the first light, if there is none) along a path instead of as its file says: times in seconds, positions and targets in world space. Its strength
    /// is the one it has at the first time. The hash becomes another.
    ///
    /// # Errors
    /// Why there is no such path, in words.
    pub fn move_light(&mut self, path: &[(f64, Vec3, Vec3)]) -> Result<(), &'static str> {
        let is_spot = |light: &Light| matches!(light.shape, LightShape::Spot { .. });
        let index = self.lights.iter().position(is_spot).unwrap_or(0);
        let light = self.lights.get_mut(index).ok_or("the scene has no light")?;
        if self.sun.is_some_and(|sun| sun.light == index) {
            return Err("the scene's light is a sun, which has a way of its own");
        }
        let first = path.first().ok_or("the path has no point")?;
        let strength = light.pose.at(first.0).strength;
        let keys = path.iter().map(|&(time, position, target)| (time, LightPose { position, target, strength })).collect();
        light.pose = Track::keyed(keys, Repeat::Clamp).ok_or("times of the path must be finite and increasing")?;
        for (time, position, target) in path {
            let numbers =
                [time.to_bits()].into_iter().chain([position, target].into_iter().flat_map(|v| v.to_array()).map(|v| v.to_bits().into()));
            for number in numbers {
                self.hash = (self.hash ^ number).wrapping_mul(0x0100_0000_01b3);
            }
        }
        Ok(())
    }

    /// Whether an object is the same at all times, as what is precomputed on it must be.
    pub fn stands_still(&self, object: &SceneObject) -> bool {
        !object.pose.moves() && self.meshes[object.mesh].deformation.is_none()
    }

    /// Whether the shape of a mesh changes.
    pub fn deforms(&self) -> bool {
        self.meshes.iter().any(|mesh| mesh.deformation.is_some())
    }

    /// A mesh among those that `deformed` has in other shapes.
    pub fn shape<'a>(&'a self, mesh: usize, deformed: &'a [Deformed]) -> &'a Mesh {
        deformed.iter().find(|deformed| deformed.mesh == mesh).map_or(&self.meshes[mesh], |deformed| &deformed.shape)
    }

    /// Number of triangles of all objects at time 0.
    pub fn triangle_count(&self) -> usize {
        self.used(&[]).triangles
    }

    /// Number of views of all lights, at least one: [`SceneState::light_views`](crate::SceneState::light_views).
    pub fn light_view_count(&self) -> usize {
        self.lights.iter().map(|light| lights::view_count(&light.shape)).sum::<usize>().max(1)
    }

    /// Vertices and triangles that there are in these shapes.
    pub(crate) fn used(&self, deformed: &[Deformed]) -> Room {
        Room {
            vertices: (0..self.meshes.len()).map(|mesh| self.shape(mesh, deformed).vertices.len()).sum(),
            triangles: self.objects.iter().map(|object| self.shape(object.mesh, deformed).triangles.len()).sum(),
        }
    }

    /// Whether the geometry of `state` fits into [`Scene::room`].
    pub fn has_room(&self, state: &SceneState) -> bool {
        state.deformed.is_empty() || self.used(&state.deformed).max(self.room) == self.room
    }

    /// Enlarges [`Scene::room`] if the geometry of `state` does not fit. Returns whether it did not: sizes of buffers, and plans that
    /// follow them, are others then.
    pub fn make_room(&mut self, state: &SceneState) -> bool {
        if self.has_room(state) {
            return false;
        }
        let used = self.used(&state.deformed);
        let spare = |count: usize| count + count / ROOM_TO_GROW;
        self.room = self.room.max(Room { vertices: spare(used.vertices), triangles: spare(used.triangles) });
        true
    }

    /// The vertices of all meshes at time 0, one mesh after the other.
    pub fn gpu_vertices(&self) -> Vec<gpu_data::Vertex> {
        self.vertices_of(&[])
    }

    /// The triangles of all objects at time 0, one object after the other, with indices into [`Scene::gpu_vertices`].
    pub fn gpu_triangles(&self) -> Vec<gpu_data::Triangle> {
        self.triangles_of(&[])
    }

    /// The vertices of all meshes, one mesh after the other, with zeros up to the room there is.
    pub fn gpu_vertices_at(&self, state: &SceneState) -> Vec<gpu_data::Vertex> {
        let mut vertices = self.vertices_of(&state.deformed);
        vertices.resize(vertices.len().max(self.room.vertices), gpu_data::Vertex::zeroed());
        vertices
    }

    /// The triangles of all objects, one object after the other, with indices into [`Scene::gpu_vertices_at`]. Then, up to the room there
    /// is, triangles without area at one vertex, that nothing sees: `SceneInfo::triangle_count` does not count them.
    pub fn gpu_triangles_at(&self, state: &SceneState) -> Vec<gpu_data::Triangle> {
        let mut triangles = self.triangles_of(&state.deformed);
        triangles.resize(triangles.len().max(self.room.triangles), gpu_data::Triangle::zeroed());
        triangles
    }

    pub(crate) fn vertices_of(&self, deformed: &[Deformed]) -> Vec<gpu_data::Vertex> {
        (0..self.meshes.len()).flat_map(|mesh| &self.shape(mesh, deformed).vertices).copied().collect()
    }

    pub(crate) fn triangles_of(&self, deformed: &[Deformed]) -> Vec<gpu_data::Triangle> {
        let mut first_vertex = Vec::with_capacity(self.meshes.len());
        let mut next = 0;
        for mesh in 0..self.meshes.len() {
            first_vertex.push(next);
            next += self.shape(mesh, deformed).vertices.len() as u32;
        }
        let mut triangles = Vec::with_capacity(self.used(deformed).triangles);
        for (index, object) in self.objects.iter().enumerate() {
            let first = first_vertex[object.mesh];
            triangles.extend(self.shape(object.mesh, deformed).triangles.iter().map(|triangle| {
                let [a, b, c] = triangle.vertices.map(|i| first + i);
                gpu_data::Triangle { a, b, c, object: index as u32, material: triangle.material }
            }));
        }
        triangles
    }

    /// The materials.
    pub fn gpu_materials(&self) -> Vec<gpu_data::Material> {
        let convert = |material: &Material| gpu_data::Material {
            diffuse: material.diffuse,
            diffuse_texture: material.texture.unwrap_or(gpu_data::NO_TEXTURE),
            specular: material.specular,
            shininess: material.shininess,
        };
        self.materials.iter().map(convert).collect()
    }
}
