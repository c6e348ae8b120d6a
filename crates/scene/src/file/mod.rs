//! Scene files.

mod document;
mod light;
mod motion;
mod values;

use std::{path::Path, sync::Arc};

use manylight_graph::{
    diagnostics::{Diagnostic, Diagnostics, Label, Source},
    ron::{Reader, Spanned, suggest},
};

use crate::{
    bounds::Bounds,
    files::{FileReader, Files, beside, cannot_read, without_dots},
    fit,
    import::{Material, Mesh, TextureSet, import_obj, nowhere},
    motion::{Pose, Track},
    scene::{Light, Scene, SceneObject},
    state::extent,
};
use document::{Document, MaterialEntry, MeshEntry};

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
        Some("ron") | None => loader.scene(path, stem),
        Some(other) => {
            let message = format!("cannot load `{}`: a scene is a `.ron` or an `.obj` file, not `.{other}`", path.display());
            Err(Diagnostics(vec![Diagnostic::error_nowhere(message).help("export the mesh as Wavefront OBJ")]))
        }
    }
}

/// What to write in an empty file.
const EXAMPLE: &str = "the least scene is `Scene(meshes: [\"mesh.obj\"])`";

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
                Diagnostic::error_nowhere(format!("`{}` is not a text in UTF-8", path.display())).help("a scene is a RON or an OBJ file"),
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
        for entry in &document.meshes {
            let MeshEntry { file, name, pose } = entry;
            match self.mesh(&beside(path, &file.text)) {
                Ok(mesh) => {
                    let stem = Path::new(&file.text).file_stem().unwrap_or_default().to_string_lossy();
                    objects.push((name.clone().unwrap_or_else(|| stem.into_owned()), mesh, pose.clone()));
                }
                Err(fault) => {
                    self.out.0.push(Diagnostic { labels: vec![Label { span: file.span.clone(), message: String::new() }], ..fault })
                }
            }
        }
        if objects.len() == document.meshes.len() && !objects.is_empty() {
            for entry in &document.materials {
                self.override_material(path, entry);
            }
        }
        self.finish(stem, document, objects)
    }

    /// The index of the mesh of a file.
    fn mesh(&mut self, path: &Path) -> Result<usize, Diagnostic> {
        let name = path.display().to_string();
        if let Some(known) = self.meshes.iter().position(|mesh| mesh.name == name) {
            return Ok(known);
        }
        let mesh = import_obj(path, &mut self.files, &mut self.materials, &mut self.textures, &mut self.out)?;
        self.meshes.push(mesh);
        Ok(self.meshes.len() - 1)
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
        let objects: Vec<SceneObject> = objects
            .into_iter()
            .map(|(name, mesh, pose)| {
                let at_rest = extent(&self.meshes[mesh], &pose.at(0.0));
                SceneObject { name, mesh, pose, at_rest }
            })
            .collect();
        let bounds = objects.iter().fold(Bounds::EMPTY, |bounds, object| bounds.union(object.at_rest.bounds));
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
        if lights.is_empty() {
            self.out
                .0
                .push(nowhere("the scene has an empty list of lights: its picture is black").help("leave `lights` out to have one fitted"));
        }
        let Self { files, meshes, materials, textures, out } = self;
        let Files { seen: sources, hash, .. } = files;
        Ok(Scene { name, meshes, objects, materials, textures: textures.build(), lights, camera, warnings: out.sorted(), sources, hash })
    }
}
