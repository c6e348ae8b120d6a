//! Meshes, materials and textures from OBJ, MTL, glTF and image files. No input makes it panic: what can be mended is mended, counted and
//! reported as a warning.

mod faults;
mod gltf;
mod mesh;
mod mtl;
mod obj;
mod obj_text;
mod texture;

pub(crate) use self::gltf::{GltfScene, import_gltf, import_gltf_mesh, is_gltf};
pub(crate) use faults::nowhere;
pub use mesh::{Mesh, MeshStatistics, MeshTriangle};
pub(crate) use mesh::{area, edges};
pub(crate) use obj::import_obj;
pub use texture::{MAX_TEXTURE_SIZE, Textures};
pub(crate) use texture::{TextureSet, linear_from_srgb};

use glam::Vec3;

/// A surface: Lambert and Blinn.
#[derive(Debug, Clone, PartialEq)]
pub struct Material {
    /// Name in the MTL or glTF file.
    pub name: String,
    /// Linear albedo, Kd; of glTF the base colour of what is not metal.
    pub diffuse: Vec3,
    /// Layer of [`Textures`] that `diffuse` is multiplied with.
    pub texture: Option<u32>,
    /// Linear, Ks.
    pub specular: Vec3,
    /// Blinn exponent, Ns.
    pub shininess: f32,
}

impl Material {
    /// What surfaces without a material of their own get: grey, matt.
    pub fn grey(name: impl Into<String>) -> Self {
        Self { name: name.into(), diffuse: Vec3::splat(0.5), texture: None, specular: Vec3::ZERO, shininess: DEFAULT_SHININESS }
    }
}

/// Exponent of a glossy material that does not say how glossy (`Ks` without `Ns`).
pub const DEFAULT_SHININESS: f32 = 10.0;
