//! OBJ files.

use std::{collections::HashMap, path::Path};

use glam::Vec3;
use manylight_graph::diagnostics::{Diagnostic, Diagnostics};

use super::{
    Material, Mesh, MeshTriangle, TextureSet,
    faults::{Faults, nowhere},
    mtl::{self, MtlMaterials},
    obj_text::{self, CleanObj},
};
use crate::{
    files::{Files, beside, cannot_read},
    gpu_data::Vertex,
};

/// Reads a mesh, and adds its materials and textures to those of the scene.
///
/// # Errors
/// The file cannot be read, or no triangle is left; the message names it.
pub(crate) fn import_obj(
    path: &Path,
    files: &mut Files<'_>,
    materials: &mut Vec<Material>,
    textures: &mut TextureSet,
    warnings: &mut Diagnostics,
) -> Result<Mesh, Diagnostic> {
    let bytes = files.read(path).map_err(|error| Diagnostic::error_nowhere(cannot_read(path, &error)))?;
    let text = String::from_utf8_lossy(&bytes);
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let mut clean = obj_text::clean(text);
    let first_material = materials.len() as u32;
    let library_named = !clean.libraries.is_empty();
    let libraries = read_libraries(path, &mut clean, files, warnings);
    add_materials(&mut clean, library_named, &libraries, files, materials, textures, warnings);
    std::mem::take(&mut clean.faults).report(path, text, warnings);

    let (vertices, mut triangles) = parse(&clean)
        .map_err(|error| Diagnostic::error_nowhere(format!("cannot read `{}`: {error}", path.display())).help("export it again as OBJ"))?;
    let mut without_material = 0_usize;
    for triangle in &mut triangles {
        without_material += usize::from(triangle.material == NO_MATERIAL);
        triangle.material = triangle.material.min(clean.materials.len() as u32) + first_material;
    }
    if without_material > 0 {
        materials.push(Material::grey("default"));
        if without_material < triangles.len() {
            warnings.0.push(nowhere(format!("`{}`: {without_material} triangles have no material: grey is used", path.display())));
        }
    }
    let (mesh, left_out) = Mesh::new(path.display().to_string(), vertices, triangles);
    left_out.report(&path.display().to_string(), warnings);
    mesh.ok_or_else(|| {
        Diagnostic::error_nowhere(format!("`{}` holds no triangle", path.display()))
            .help("a mesh is a Wavefront OBJ file with at least one face that has an area")
    })
}

/// Material of triangles that stand before every `usemtl`.
const NO_MATERIAL: u32 = u32::MAX;

/// Vertices and triangles of a clean text.
fn parse(clean: &CleanObj) -> Result<(Vec<Vertex>, Vec<MeshTriangle>), tobj::LoadError> {
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let count = clean.materials.len();
    // The parser takes its materials from the library `all`: it has them by number.
    let library = |_: &Path| -> tobj::MTLLoadResult {
        let names = (0..count).map(|i| (i.to_string(), i)).collect();
        Ok((vec![tobj::Material::default(); count], names))
    };
    let (models, _) = tobj::load_obj_buf(&mut clean.text.as_bytes(), &options, library)?;
    let mut vertices = Vec::new();
    let mut triangles = Vec::new();
    for tobj::Model { mesh, .. } in models {
        let first = vertices.len() as u32;
        let material = mesh.material_id.map_or(NO_MATERIAL, |id| id as u32);
        let corners = mesh.positions.chunks_exact(3).zip(mesh.texcoords.chunks_exact(2)).zip(mesh.normals.chunks_exact(3));
        vertices.extend(corners.map(|((position, uv), normal)| Vertex {
            position: Vec3::from_slice(position),
            u: uv[0],
            normal: Vec3::from_slice(normal).normalize_or_zero(),
            v: 1.0 - uv[1],
        }));
        let indices = mesh.indices.chunks_exact(3);
        triangles.extend(indices.map(|i| MeshTriangle { vertices: [first + i[0], first + i[1], first + i[2]], material }));
    }
    Ok((vertices, triangles))
}

/// A library and where it lies: textures are relative to it.
struct Library {
    path: std::path::PathBuf,
    text: String,
    materials: MtlMaterials,
}

/// The MTL files that the OBJ names.
fn read_libraries(path: &Path, clean: &mut CleanObj, files: &mut Files<'_>, warnings: &mut Diagnostics) -> Vec<Library> {
    let mut libraries = Vec::new();
    for (name, place) in std::mem::take(&mut clean.libraries) {
        // A name may have spaces; several names may stand in one line.
        let mut names = vec![name.as_str()];
        let mut found = files.read(&beside(path, &name)).map(|bytes| vec![(beside(path, &name), bytes)]);
        if found.is_err() && name.contains(char::is_whitespace) {
            names = name.split_whitespace().collect();
            found = names.iter().map(|name| files.read(&beside(path, name)).map(|bytes| (beside(path, name), bytes))).collect();
        }
        let Ok(found) = found else {
            clean.faults.add("{} material libraries cannot be read", "surfaces without a material are grey", place);
            continue;
        };
        for (path, bytes) in found {
            let text = String::from_utf8_lossy(&bytes).into_owned();
            let mut faults = Faults::default();
            let materials = mtl::read(&text, &mut faults);
            faults.report(&path, &text, warnings);
            libraries.push(Library { path, text, materials });
        }
    }
    libraries
}

/// Adds a material for each name that the OBJ uses.
fn add_materials(
    clean: &mut CleanObj,
    library_named: bool,
    libraries: &[Library],
    files: &mut Files<'_>,
    materials: &mut Vec<Material>,
    textures: &mut TextureSet,
    warnings: &mut Diagnostics,
) {
    let mut faults: HashMap<&Path, Faults> = HashMap::new();
    for (name, place) in &clean.materials {
        let mut material = Material::grey(name);
        match libraries.iter().find_map(|library| library.materials.get(name).map(|found| (library, found))) {
            Some((library, found)) => {
                let default = if found.texture.is_some() { Vec3::ONE } else { material.diffuse };
                material.diffuse = found.diffuse.unwrap_or(default);
                material.specular = found.specular;
                material.shininess = found.shininess;
                if let Some(file) = &found.texture {
                    match textures.load(&beside(&library.path, file), files) {
                        Ok(layer) => material.texture = Some(layer),
                        Err(reason) => {
                            let help = "the material has its colour `Kd` only; PNG, JPEG, TGA and BMP files are read";
                            faults.entry(&library.path).or_default().add(reason, help, found.place.clone());
                        }
                    }
                }
            }
            // That the library is missing is said already.
            None if libraries.is_empty() && library_named => {}
            None => clean.faults.add("{} materials are not in the material library", "they are grey", place.clone()),
        }
        materials.push(material);
    }
    for library in libraries {
        if let Some(faults) = faults.remove(library.path.as_path()) {
            faults.report(&library.path, &library.text, warnings);
        }
    }
}
