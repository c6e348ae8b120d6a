//! glTF 2.0: meshes, materials, the first camera, lights and the motion of nodes. No input makes it panic; what is lost is told once a kind.

mod accessor;
mod animation;
mod document;
mod extensions;
mod losses;
mod material;
mod nodes;
mod primitives;
mod sampling;
mod transform;
mod uri;
mod views;

use std::{collections::HashMap, path::Path};

use glam::{DMat3, DMat4, Vec3};
use manylight_graph::diagnostics::{Diagnostic, Diagnostics};

use super::{Material, Mesh, MeshTriangle, TextureSet};
use crate::{
    bounds::Bounds,
    files::Files,
    gpu_data::Vertex,
    motion::{CameraPose, Pose, Track},
    scene::Light,
};
use animation::Curves;
use document::{Model, fault};
use losses::Losses;
use material::Materials;
use nodes::Nodes;
use primitives::{Geometry, geometry};
use transform::Transform;

/// Whether a file is read as glTF: by the end of its name.
pub(crate) fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gltf") || extension.eq_ignore_ascii_case("glb"))
}

/// What a file says of a scene.
pub(crate) struct GltfScene {
    pub(crate) meshes: Vec<Mesh>,
    /// Names, indices among `meshes`, and places.
    pub(crate) objects: Vec<(String, usize, Track<Pose>)>,
    /// The first one.
    pub(crate) camera: Option<Track<CameraPose>>,
    pub(crate) lights: Vec<Light>,
}

/// Triangles of all objects together that are not too many: their indices have 32 bits, and they have to fit into memory.
const MOST_TRIANGLES: usize = 1 << 28;
/// How far an object may be from its motion, as a share of its size.
const TOLERANCE: f64 = 1e-3;

/// Reads a file as a scene, and adds its materials and textures to those of the scene.
///
/// # Errors
/// The file or a buffer cannot be read, breaks the rules of glTF, or holds no triangle.
pub(crate) fn import_gltf(
    path: &Path,
    files: &mut Files<'_>,
    materials: &mut Vec<Material>,
    textures: &mut TextureSet,
    warnings: &mut Diagnostics,
) -> Result<GltfScene, Diagnostic> {
    reading(path, files, warnings, |model, files, losses, warnings| {
        let curves = Curves::read(model, losses);
        let nodes = Nodes::new(model, curves, losses)?;
        let mut parts = Parts::new(model, files, materials, textures);
        let mut objects = Objects {
            scene: GltfScene { meshes: Vec::new(), objects: Vec::new(), camera: None, lights: Vec::new() },
            shared: HashMap::new(),
        };
        for node in nodes.order.iter().copied() {
            objects.add(node, &nodes, &mut parts, losses, warnings)?;
        }
        let mut scene = objects.scene;
        if scene.objects.is_empty() {
            return Err(no_triangle(path));
        }
        let reach = |(_, mesh, pose): &(String, usize, Track<Pose>)| {
            scene.meshes[*mesh].statistics.bounds.transformed(&pose.at(0.0).world_from_object())
        };
        let bounds = scene.objects.iter().map(reach).fold(Bounds::EMPTY, Bounds::union);
        let diagonal = bounds.diagonal().max(f64::from(f32::MIN_POSITIVE));
        scene.camera = views::camera(model, &nodes, diagonal, losses);
        scene.lights = views::lights(model, &nodes, diagonal, losses);
        Ok(scene)
    })
}

/// Reads a file as one mesh: all of its meshes where their nodes are without animation.
///
/// # Errors
/// The file or a buffer cannot be read, breaks the rules of glTF, or holds no triangle.
pub(crate) fn import_gltf_mesh(
    path: &Path,
    files: &mut Files<'_>,
    materials: &mut Vec<Material>,
    textures: &mut TextureSet,
    warnings: &mut Diagnostics,
) -> Result<Mesh, Diagnostic> {
    reading(path, files, warnings, |model, files, losses, warnings| {
        let root = &model.root;
        let nodes = Nodes::new(model, Curves::default(), losses)?;
        if !root.animations.is_empty() {
            losses.add("animations", "animations are left out of a mesh in a scene file", "write `motion`, or render the file itself");
        }
        if nodes.order.iter().any(|node| root.nodes[*node].camera.is_some()) {
            losses.add("cameras", "cameras are left out of a mesh in a scene file", "write `camera`, or render the file itself");
        }
        let mut parts = Parts::new(model, files, materials, textures);
        let mut all = Geometry::default();
        for node in nodes.order.iter().copied() {
            if root.nodes[node].extensions.as_ref().is_some_and(|extensions| extensions.khr_lights_punctual.is_some()) {
                losses.add(
                    format!("nodes[{node}]"),
                    "lights are left out of a mesh in a scene file",
                    "write `lights`, or render the file itself",
                );
            }
            let Some(mesh) = parts.mesh_of(node, losses)? else { continue };
            let Geometry { vertices, triangles } = moved(&mesh, &nodes.at_rest(node).matrix());
            let first = all.vertices.len() as u32;
            all.vertices.extend(vertices);
            all.triangles.extend(triangles.into_iter().map(|t| MeshTriangle { vertices: t.vertices.map(|i| first + i), ..t }));
        }
        let (mesh, left_out) = Mesh::new(path.display().to_string(), all.vertices, all.triangles);
        left_out.report(&path.display().to_string(), warnings);
        mesh.ok_or_else(|| no_triangle(path))
    })
}

/// Opens a file, reads something of it, and tells what is lost in any case.
fn reading<T>(
    path: &Path,
    files: &mut Files<'_>,
    warnings: &mut Diagnostics,
    read: impl FnOnce(&Model<'_>, &mut Files<'_>, &mut Losses, &mut Diagnostics) -> Result<T, Diagnostic>,
) -> Result<T, Diagnostic> {
    let mut losses = Losses::default();
    let result = Model::open(path, files, &mut losses).and_then(|model| read(&model, files, &mut losses, warnings));
    losses.report(path, warnings);
    result
}

fn no_triangle(path: &Path) -> Diagnostic {
    fault(path, "it holds no triangle", "a scene needs a node with a mesh of at least one triangle that has an area")
}

/// Reads the meshes of nodes, and counts their triangles.
struct Parts<'m, 'a, 'f> {
    model: &'m Model<'m>,
    materials: Materials<'a, 'f>,
    known: HashMap<usize, Geometry>,
    triangles: usize,
}

impl<'m, 'a, 'f> Parts<'m, 'a, 'f> {
    fn new(model: &'m Model<'m>, files: &'a mut Files<'f>, materials: &'a mut Vec<Material>, textures: &'a mut TextureSet) -> Self {
        Self { model, materials: Materials::new(files, materials, textures), known: HashMap::new(), triangles: 0 }
    }

    /// The mesh of a node in its own space, if it has one.
    fn mesh_of(&mut self, node: usize, losses: &mut Losses) -> Result<Option<Geometry>, Diagnostic> {
        let found = &self.model.root.nodes[node];
        let Some(mesh) = found.mesh.map(|mesh| mesh.value()) else { return Ok(None) };
        if found.skin.is_some() {
            losses.add(
                format!("nodes[{node}].skin"),
                "skins are left out: the mesh is shown at rest",
                "export key frames as one OBJ file each",
            );
        }
        let geometry = match self.known.get(&mesh) {
            Some(known) => known.clone(),
            None => {
                let read = geometry(self.model, mesh, &mut self.materials, losses)?;
                self.known.insert(mesh, read.clone());
                read
            }
        };
        self.triangles = self.triangles.saturating_add(geometry.triangles.len().max(geometry.vertices.len() / 3));
        if self.triangles > MOST_TRIANGLES {
            let help = "leave out instances of large meshes";
            return Err(fault(self.model.path, format!("its nodes have more than {MOST_TRIANGLES} triangles together"), help));
        }
        Ok(Some(geometry))
    }
}

/// Objects as they are found.
struct Objects {
    scene: GltfScene,
    /// Meshes that nodes can share, by their index in the file; those without triangles as well.
    shared: HashMap<usize, Option<usize>>,
}

impl Objects {
    /// The object of a node, if it has a mesh.
    fn add(
        &mut self,
        node: usize,
        nodes: &Nodes,
        parts: &mut Parts<'_, '_, '_>,
        losses: &mut Losses,
        warnings: &mut Diagnostics,
    ) -> Result<(), Diagnostic> {
        let model = parts.model;
        let Some(index) = model.root.nodes[node].mesh.map(|mesh| mesh.value()) else { return Ok(()) };
        let Some(geometry) = parts.mesh_of(node, losses)? else { return Ok(()) };
        let at_rest = nodes.at_rest(node);
        let at = format!("nodes[{node}]");
        if !nodes.moves(node) && at_rest.matrix().determinant() == 0.0 && at_rest.without_shear().0.scale.abs().min_element() == 0.0 {
            losses.add(at, "objects whose scale is 0 are left out", "");
            return Ok(());
        }
        // A pose cannot shear: the vertices of what stands still are sheared instead.
        let sheared = !nodes.moves(node) && matches!(at_rest, Transform::Matrix(_));
        let mesh = if sheared {
            self.mesh(format!("{}#nodes[{node}]", model.path.display()), moved(&geometry, &at_rest.matrix()), warnings)
        } else if let Some(known) = self.shared.get(&index) {
            *known
        } else {
            let mesh = self.mesh(format!("{}#meshes[{index}]", model.path.display()), geometry, warnings);
            self.shared.insert(index, mesh);
            mesh
        };
        let Some(mesh) = mesh else { return Ok(()) };
        let track = if sheared { Track::fixed(Pose::default()) } else { motion(node, nodes, &self.scene.meshes[mesh], losses) };
        let name = model.root.nodes[node].name.clone().or_else(|| model.root.meshes[index].name.clone());
        self.scene.objects.push((name.unwrap_or(at), mesh, track));
        Ok(())
    }

    /// The index of a new mesh, if it has triangles.
    fn mesh(&mut self, name: String, geometry: Geometry, warnings: &mut Diagnostics) -> Option<usize> {
        let (mesh, left_out) = Mesh::new(name.clone(), geometry.vertices, geometry.triangles);
        left_out.report(&name, warnings);
        self.scene.meshes.push(mesh?);
        Some(self.scene.meshes.len() - 1)
    }
}

/// Where an object is over time.
fn motion(node: usize, nodes: &Nodes, mesh: &Mesh, losses: &mut Losses) -> Track<Pose> {
    if !nodes.moves(node) {
        return Track::fixed(nodes.at_rest(node).without_shear().0.pose());
    }
    let Bounds { min, max } = mesh.statistics.bounds;
    let corners: [_; 8] = std::array::from_fn(|i| {
        glam::DVec3::from_array(std::array::from_fn(|axis| if i >> axis & 1 == 0 { min[axis] } else { max[axis] }))
    });
    let reached = |matrix: DMat4| corners.map(|corner| matrix.transform_point3(corner));
    let farthest = |a: DMat4, b: DMat4| reached(a).into_iter().zip(reached(b)).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
    // Its size where it is largest among its key frames.
    let times = nodes.breaks(node).into_iter().chain([0.0]);
    let scale = times.map(|time| nodes.at(node, time).without_shear().0.scale.abs().max_element()).fold(0.0, f64::max);
    let size = (scale * mesh.statistics.bounds.diagonal()).max(f64::from(f32::MIN_POSITIVE));
    let sheared = std::cell::Cell::new(false);
    let pose = |time: f64| {
        let (trs, shears) = nodes.at(node, time).without_shear();
        sheared.set(sheared.get() | shears);
        trs.pose()
    };
    let distance = |a: &Pose, b: &Pose| farthest(a.world_from_object(), b.world_from_object()) / (TOLERANCE * size);
    let (track, worst) = sampling::track(nodes.span(), nodes.breaks(node), pose, distance);
    if sheared.get() {
        losses.add(
            format!("nodes[{node}]"),
            "moving objects that are sheared are shown without shear",
            "scale them evenly, or turn them above what is scaled unevenly",
        );
    }
    if worst > 1.0 {
        let message = format!("it moves too fast for key frames: it is off by up to {:.2e} of its size", worst * TOLERANCE);
        losses.add(format!("nodes[{node}]"), message, "slow it down, or put in more key frames");
    }
    track
}

/// Geometry in the space that a matrix leads to. The order of corners is kept as seen from the front, also in a mirror.
fn moved(geometry: &Geometry, matrix: &DMat4) -> Geometry {
    let linear = DMat3::from_mat4(*matrix);
    let cofactors =
        DMat3::from_cols(linear.y_axis.cross(linear.z_axis), linear.z_axis.cross(linear.x_axis), linear.x_axis.cross(linear.y_axis));
    let mirrored = linear.determinant() < 0.0;
    let sign = if mirrored { -1.0 } else { 1.0 };
    let vertex = |vertex: &Vertex| {
        let normal = (cofactors * vertex.normal.as_dvec3() * sign).normalize_or_zero().as_vec3();
        let position = matrix.transform_point3(vertex.position.as_dvec3()).as_vec3();
        let usable = position.abs().max_element() <= primitives::LARGEST;
        Vertex { position: if usable { position } else { Vec3::NAN }, normal, ..*vertex }
    };
    let turned = |triangle: &MeshTriangle| {
        let [a, b, c] = triangle.vertices;
        MeshTriangle { vertices: if mirrored { [a, c, b] } else { [a, b, c] }, ..*triangle }
    };
    Geometry { vertices: geometry.vertices.iter().map(vertex).collect(), triangles: geometry.triangles.iter().map(turned).collect() }
}
