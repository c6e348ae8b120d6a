//! Scene files.

mod document;
mod light;
mod motion;
mod object;
mod sky;
mod values;

use std::{collections::HashMap, path::Path, sync::Arc};

use manylight_graph::{
    diagnostics::{Diagnostic, Diagnostics, Label, Source},
    ron::{Reader, Spanned, suggest},
};

use crate::{
    bounds::Bounds,
    deform::{Deformation, Metaballs, Room},
    files::{FileReader, Files, beside, cannot_read, without_dots},
    fit,
    import::{GltfScene, Material, Mesh, MeshTriangle, TextureSet, import_gltf, import_gltf_mesh, import_obj, is_gltf, nowhere},
    measure::Memo,
    motion::{Pose, Track},
    scene::{Light, Scene, SceneObject},
    sky::Sky,
    state::{extent, reach},
};
use document::{Document, MaterialEntry};
use object::{MetaballsEntry, ObjectEntry, ShapeEntry};

/// Loads a scene file, or a mesh as a scene of its own.
pub(crate) fn load(path: &Path, reader: &dyn FileReader) -> Result<Scene, Diagnostics> {
    let path = &without_dots(path);
    let mut loader = Loader {
        files: Files::new(reader),
        meshes: Vec::new(),
        materials: Vec::new(),
        textures: TextureSet::default(),
        out: Diagnostics::default(),
    };
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("obj") => {
            let mesh = match loader.mesh(path) {
                Ok(mesh) => mesh,
                // What was left out tells why nothing remained.
                Err(fault) => {
                    loader.out.0.push(fault);
                    return Err(loader.out.sorted());
                }
            };
            loader.finish(stem.clone(), Document::default(), vec![(stem, mesh, Track::fixed(Pose::default()))])
        }
        Some("gltf" | "glb") => loader.gltf(path, stem),
        Some("ron") | None => loader.scene(path, stem),
        Some(other) => {
            let message = format!("cannot load `{}`: a scene is a `.ron`, `.obj`, `.gltf` or `.glb` file, not `.{other}`", path.display());
            Err(Diagnostics(vec![Diagnostic::error_nowhere(message).help("export the mesh as glTF or as Wavefront OBJ")]))
        }
    }
}

/// What to write in an empty file.
const EXAMPLE: &str = "the least scene is `Scene(meshes: [\"mesh.obj\"])`";

/// A fault of a file at the place where it is named.
fn at(fault: Diagnostic, file: &Spanned) -> Diagnostic {
    Diagnostic { labels: vec![Label { span: file.span.clone(), message: String::new() }], ..fault }
}

/// Why two meshes cannot be key frames of one, if they cannot.
fn difference(a: &Mesh, b: &Mesh) -> Option<String> {
    let count = |what: &str, a: usize, b: usize| (a != b).then(|| format!("it has {b} {what}, not {a}"));
    let corners = |mesh: &Mesh, triangle: usize| mesh.triangles[triangle].vertices;
    count("vertices", a.vertices.len(), b.vertices.len()).or_else(|| count("triangles", a.triangles.len(), b.triangles.len())).or_else(
        || {
            let other = (0..a.triangles.len()).find(|triangle| corners(a, *triangle) != corners(b, *triangle))?;
            Some(format!("triangle {} of it joins other vertices", other + 1))
        },
    )
}

/// Reads a mesh from a file of any kind.
fn import(
    path: &Path,
    files: &mut Files<'_>,
    materials: &mut Vec<Material>,
    textures: &mut TextureSet,
    warnings: &mut Diagnostics,
) -> Result<Mesh, Diagnostic> {
    let import = if is_gltf(path) { import_gltf_mesh } else { import_obj };
    import(path, files, materials, textures, warnings)
}

/// What is loaded so far.
struct Loader<'a> {
    files: Files<'a>,
    meshes: Vec<Mesh>,
    materials: Vec<Material>,
    textures: TextureSet,
    /// Faults and warnings.
    out: Diagnostics,
}

impl Loader<'_> {
    /// A scene file. All faults are collected before it gives up, those of missing meshes as well.
    fn scene(mut self, path: &Path, stem: String) -> Result<Scene, Diagnostics> {
        let fail = |message: String| Diagnostics(vec![Diagnostic::error_nowhere(message)]);
        let bytes = self.files.read(path).map_err(|error| fail(cannot_read(path, &error)))?;
        let Ok(text) = String::from_utf8(bytes) else {
            return Err(Diagnostics(vec![
                Diagnostic::error_nowhere(format!("`{}` is not a text in UTF-8", path.display()))
                    .help("a scene is a RON, OBJ or glTF file"),
            ]));
        };
        let source = Arc::new(Source { name: path.display().to_string(), path: Some(path.to_owned()), text: text.into() });
        let (mut reader, tree) = Reader::open(&source);
        let document = match tree {
            Some(tree) => document::read(&mut reader, &tree),
            None => {
                // A fault of no length is that of an empty file, for which the reader knows no example.
                let empty = |fault: &&mut Diagnostic| fault.labels.iter().any(|label| label.span.range.is_empty());
                reader.out.iter_mut().filter(empty).for_each(|fault| fault.help = Some(EXAMPLE.into()));
                Document::default()
            }
        };
        self.out.0.append(&mut reader.out);

        let mut objects = Vec::new();
        // Metaballs may have a material of a mesh: meshes first.
        let is_metaballs = |entry: &ObjectEntry| matches!(entry.shape, ShapeEntry::Metaballs(_));
        let mut order: Vec<usize> = (0..document.objects.len()).collect();
        order.sort_by_key(|index| is_metaballs(&document.objects[*index]));
        for index in order {
            let ObjectEntry { name, pose, shape } = &document.objects[index];
            let (mesh, file) = match shape {
                ShapeEntry::Mesh { file, keys: None } => {
                    (self.mesh(&beside(path, &file.text)).map_err(|fault| at(fault, file)), &file.text)
                }
                ShapeEntry::Mesh { file, keys: Some(keys) } => (self.keyed_mesh(path, file, keys), &file.text),
                ShapeEntry::Metaballs(entry) => (self.metaballs(entry), &entry.place.text),
            };
            match mesh {
                Ok(mesh) => {
                    let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
                    objects.push((index, (name.clone().unwrap_or_else(|| stem.into_owned()), mesh, pose.clone())));
                }
                Err(fault) => self.out.0.push(fault),
            }
        }
        objects.sort_by_key(|(index, _)| *index);
        let objects: Vec<_> = objects.into_iter().map(|(_, object)| object).collect();
        if objects.len() == document.objects.len() && !objects.is_empty() {
            for entry in &document.materials {
                self.override_material(path, entry);
            }
        }
        self.finish(stem, document, objects)
    }

    /// A glTF file as a scene of its own.
    fn gltf(mut self, path: &Path, stem: String) -> Result<Scene, Diagnostics> {
        match import_gltf(path, &mut self.files, &mut self.materials, &mut self.textures, &mut self.out) {
            Ok(GltfScene { meshes, objects, camera, lights }) => {
                self.meshes = meshes;
                let lights = Some(lights).filter(|lights| !lights.is_empty());
                self.finish(stem, Document { camera, lights, ..Document::default() }, objects)
            }
            // What was left out tells why nothing remained.
            Err(fault) => {
                self.out.0.push(fault);
                Err(self.out.sorted())
            }
        }
    }

    /// The index of the mesh of a file.
    fn mesh(&mut self, path: &Path) -> Result<usize, Diagnostic> {
        let name = path.display().to_string();
        if let Some(known) = self.meshes.iter().position(|mesh| mesh.name == name && mesh.deformation.is_none()) {
            return Ok(known);
        }
        let mesh = import(path, &mut self.files, &mut self.materials, &mut self.textures, &mut self.out)?;
        Ok(self.add(mesh))
    }

    fn add(&mut self, mesh: Mesh) -> usize {
        self.meshes.push(mesh);
        self.meshes.len() - 1
    }

    /// The index of a mesh with the vertices of other files at some times. Materials, triangles and texture coordinates are those of `file`.
    fn keyed_mesh(&mut self, path: &Path, file: &Spanned, keys: &Track<Spanned>) -> Result<usize, Diagnostic> {
        let first = beside(path, &file.text);
        let mesh = import(&first, &mut self.files, &mut self.materials, &mut self.textures, &mut self.out);
        let mesh = mesh.map_err(|fault| at(fault, file))?;
        let mut shapes = HashMap::from([(first.clone(), mesh.vertices.clone())]);
        for (_, key) in keys.keys() {
            let other = beside(path, &key.text);
            if shapes.contains_key(&other) {
                continue;
            }
            // Only its vertices matter.
            let shape = import(&other, &mut self.files, &mut Vec::new(), &mut TextureSet::default(), &mut self.out);
            let shape = shape.map_err(|fault| at(fault, key))?;
            if let Some(difference) = difference(&mesh, &shape) {
                let message = format!("`{}` cannot be a key frame of `{}`: {difference}", other.display(), first.display());
                let help =
                    "key frames have the same vertices and faces in the same order, and each face an area: export them from one mesh";
                return Err(Diagnostic::error(message, key.span.clone()).and(file.span.clone(), "the mesh").help(help));
            }
            shapes.insert(other, shape.vertices);
        }
        let shapes = keys.clone().map(|key| shapes.get(&beside(path, &key.text)).cloned().unwrap_or_default());
        Ok(self.deforming(mesh.name, mesh.triangles, Deformation::Keys(shapes)))
    }

    /// The index of the mesh of metaballs.
    fn metaballs(&mut self, entry: &MetaballsEntry) -> Result<usize, Diagnostic> {
        let MetaballsEntry { balls, level, cells, material, place } = entry;
        let known = self.materials.iter().position(|known| known.name == *material);
        let material = known.unwrap_or_else(|| {
            self.materials.push(Material::grey(material));
            self.materials.len() - 1
        });
        let metaballs = Metaballs::new(balls.clone(), *level, *cells, material as u32);
        if metaballs.room() == Room::default() {
            let message = "the metaballs have no surface";
            let help = "lower `level`, or raise `radius`, `strength` or `cells`";
            if !metaballs.moves() {
                return Err(Diagnostic::error(message, place.span.clone()).help(help));
            }
            let message = format!("{message} at any of the times looked at");
            self.out.0.push(Diagnostic::warning(message, place.span.clone()).help(help));
        }
        if !metaballs.moves() {
            let (vertices, triangles) = metaballs.surface(0.0);
            return Ok(self.add(Mesh::whole(place.text.clone(), vertices, triangles)));
        }
        Ok(self.deforming(place.text.clone(), Vec::new(), Deformation::Metaballs(metaballs)))
    }

    /// The index of a mesh that deforms, in its shape at time 0.
    fn deforming(&mut self, name: String, triangles: Vec<MeshTriangle>, deformation: Deformation) -> usize {
        let mut mesh = Mesh::whole(name, Vec::new(), Vec::new());
        mesh.triangles = triangles;
        mesh.deformation = Some(deformation);
        let at_rest = mesh.at(0.0).unwrap_or_else(|| mesh.clone());
        self.add(Mesh { deformation: mesh.deformation, ..at_rest })
    }

    /// Changes all materials of a name.
    fn override_material(&mut self, path: &Path, entry: &MaterialEntry) {
        let Spanned { text: name, span } = &entry.name;
        if !self.materials.iter().any(|material| material.name == *name) {
            let help = suggest(name, self.materials.iter().map(|material| material.name.as_str()));
            self.out.0.push(Diagnostic::error(format!("no mesh has a material `{name}`"), span.clone()).help(help));
            return;
        }
        let layer = entry.texture.as_ref().and_then(|file| match self.textures.load(&beside(path, &file.text), &mut self.files) {
            Ok(layer) => Some(layer),
            Err(reason) => {
                let help = "PNG, JPEG, TGA and BMP files are read";
                self.out.0.push(Diagnostic::error(reason, file.span.clone()).help(help));
                None
            }
        });
        for material in self.materials.iter_mut().filter(|material| material.name == *name) {
            material.diffuse = entry.diffuse.unwrap_or(material.diffuse);
            material.specular = entry.specular.unwrap_or(material.specular);
            material.shininess = entry.shininess.unwrap_or(material.shininess);
            material.texture = layer.or(material.texture);
        }
    }

    /// The scene, if there were no faults; with a fitted camera and light if the document has none.
    fn finish(mut self, name: String, document: Document, objects: Vec<(String, usize, Track<Pose>)>) -> Result<Scene, Diagnostics> {
        if self.out.has_errors() {
            return Err(self.out.sorted());
        }
        let room = Room {
            vertices: self.meshes.iter().map(|mesh| mesh.room().vertices).sum(),
            triangles: objects.iter().map(|(_, mesh, _)| self.meshes[*mesh].room().triangles).sum(),
        };
        let objects: Vec<SceneObject> = objects
            .into_iter()
            .map(|(name, mesh, pose)| {
                let at_rest = extent(&self.meshes[mesh], &pose.at(0.0));
                SceneObject { name, mesh, pose, at_rest }
            })
            .collect();
        let mut bounds = objects.iter().fold(Bounds::EMPTY, |bounds, object| bounds.union(object.at_rest.bounds));
        if bounds.is_empty() {
            bounds = reach(&self.meshes, &objects, 0.0);
        }
        let camera = document.camera.unwrap_or_else(|| {
            let camera = fit::camera(&bounds);
            let message = format!("the scene has no camera: it is seen from {} towards {}", camera.origin, camera.target);
            self.out
                .0
                .push(nowhere(message).help("write `camera: (origin: (x, y, z), target: (x, y, z), fov_x_deg: 50.0)` in a scene file"));
            Track::fixed(camera)
        });
        let lights: Vec<Light> = document.lights.unwrap_or_else(|| {
            let light = fit::light(&bounds);
            let pose = light.pose.at(0.0);
            let message =
                format!("the scene has no light: a spot of {:.4} W/sr shines from {} to {}", pose.strength.x, pose.position, pose.target);
            self.out
                .0
                .push(nowhere(message).help("write `lights: [Spot(position: …, target: …, intensity: …, beam_deg: …, cutoff_deg: …)]`"));
            vec![light]
        });
        if lights.is_empty() && document.sky.is_none_or(|sky| sky.is_black()) {
            self.out
                .0
                .push(nowhere("the scene has an empty list of lights: its picture is black").help("leave `lights` out to have one fitted"));
        }
        let (sun, sky) = (document.sun, document.sky.unwrap_or(Sky::BLACK));
        let Self { files, meshes, materials, textures, out } = self;
        let Files { seen: sources, hash, .. } = files;
        Ok(Scene {
            name,
            meshes,
            objects,
            materials,
            textures: textures.build(),
            lights,
            sun,
            sky,
            camera,
            room,
            warnings: out.sorted(),
            sources,
            hash,
            memo: Memo::default(),
        })
    }
}
