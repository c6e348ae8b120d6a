//! Meshes: primitives of any kind become triangles.

use glam::{Vec2, Vec3};
use gltf::json::{
    Index,
    accessor::Accessor,
    mesh::{Mode, Primitive, Semantic},
    validation::Checked,
};
use manylight_graph::diagnostics::Diagnostic;

use super::{
    document::{EXPORT_AGAIN, Model, fault},
    losses::Losses,
    material::{Lookup, Materials},
};
use crate::{gpu_data::Vertex, import::MeshTriangle};

/// Positions beyond this are left out: their squares leave the range of 32-bit floats.
pub(super) const LARGEST: f32 = 1e15;

/// Vertices and triangles.
#[derive(Debug, Clone, Default)]
pub(super) struct Geometry {
    pub(super) vertices: Vec<Vertex>,
    pub(super) triangles: Vec<MeshTriangle>,
}

/// All primitives of a mesh, in its own space.
pub(super) fn geometry(
    model: &Model<'_>,
    mesh: usize,
    materials: &mut Materials<'_, '_>,
    losses: &mut Losses,
) -> Result<Geometry, Diagnostic> {
    let mut geometry = Geometry::default();
    for (index, primitive) in model.root.meshes[mesh].primitives.iter().enumerate() {
        let at = format!("meshes[{mesh}].primitives[{index}]");
        add(model, primitive, &at, materials, losses, &mut geometry)
            .map_err(|reason| fault(model.path, format!("{at}: {reason}"), EXPORT_AGAIN))?;
    }
    Ok(geometry)
}

fn add(
    model: &Model<'_>,
    primitive: &Primitive,
    at: &str,
    materials: &mut Materials<'_, '_>,
    losses: &mut Losses,
    geometry: &mut Geometry,
) -> Result<(), String> {
    let mode = match primitive.mode {
        Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => mode,
        _ => {
            losses.add(format!("{at}.mode"), "points and lines are left out", "make them of triangles");
            return Ok(());
        }
    };
    if primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
        losses.add(
            format!("{at}.targets"),
            "morph targets are left out: the mesh is shown at rest",
            "export key frames as one OBJ file each",
        );
    }
    let attribute = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    if attribute(Semantic::Colors(0)).is_some() {
        losses.add(format!("{at}.attributes.COLOR_0"), "colours of vertices are left out", "bake them into a base colour texture");
    }
    let (material, lookup) = materials.get(model, primitive.material.map(|material| material.value()), at, losses);
    let position = attribute(Semantic::Positions).ok_or("it has no positions")?;
    let positions = model.floats::<3>(position)?;
    let normals = same_length(attribute(Semantic::Normals), positions.len(), |index| model.floats::<3>(index))?;
    let uvs = texture_coordinates(model, lookup, attribute, positions.len(), at, losses)?;

    let count = positions.len();
    let corners = match primitive.indices {
        Some(index) => model.indices(index)?,
        None => (0..u32::try_from(count).map_err(|_| "it has more vertices than can be counted in 32 bits")?).collect(),
    };
    let first = u32::try_from(geometry.vertices.len()).ok().filter(|first| first.checked_add(count as u32).is_some());
    let first = first.ok_or("the mesh has more vertices than can be counted in 32 bits")?;
    let mut not_finite = false;
    geometry.vertices.extend((0..count).map(|i| {
        let position = Vec3::from_array(positions[i]);
        let normal = normals.as_ref().map_or(Vec3::ZERO, |normals| normals[i].into());
        let uv = uvs.as_ref().map_or(Vec2::ZERO, |uvs| uvs[i]);
        not_finite |= !uv.is_finite() || !normal.is_finite();
        let usable = position.abs().max_element() <= LARGEST && !position.is_nan();
        Vertex {
            position: if usable { position } else { Vec3::NAN },
            u: if uv.is_finite() { uv.x } else { 0.0 },
            normal: if normal.is_finite() { normal.normalize_or_zero() } else { Vec3::ZERO },
            v: if uv.is_finite() { uv.y } else { 0.0 },
        }
    }));
    if not_finite {
        losses.add(format!("{at}.attributes"), "texture coordinates and normals that are not finite count as 0", "");
    }
    let mut outside = 0_usize;
    let mut over = 0;
    let mut push = |corners: [u32; 3]| {
        if corners.iter().all(|corner| (*corner as usize) < count) {
            geometry.triangles.push(MeshTriangle { vertices: corners.map(|corner| first + corner), material });
        } else {
            outside += 1;
        }
    };
    match mode {
        Mode::TriangleStrip => {
            // Every other triangle goes round the other way.
            corners.windows(3).enumerate().for_each(|(i, c)| push(if i % 2 == 0 { [c[0], c[1], c[2]] } else { [c[0], c[2], c[1]] }));
        }
        Mode::TriangleFan => corners.get(1..).unwrap_or_default().windows(2).for_each(|c| push([c[0], c[1], corners[0]])),
        _ => {
            over = corners.len() % 3;
            corners.chunks_exact(3).for_each(|c| push([c[0], c[1], c[2]]));
        }
    }
    if outside > 0 {
        losses.add(format!("{at}.indices"), "triangles of vertices that do not exist are left out", EXPORT_AGAIN);
    }
    if over > 0 {
        losses.add(at, "vertices that are over when all others make triangles are left out", EXPORT_AGAIN);
    }
    Ok(())
}

/// An attribute that has to be there for every vertex.
fn same_length<T>(
    index: Option<Index<Accessor>>,
    count: usize,
    read: impl Fn(Index<Accessor>) -> Result<Vec<T>, String>,
) -> Result<Option<Vec<T>>, String> {
    let Some(index) = index else { return Ok(None) };
    let values = read(index)?;
    if values.len() != count {
        return Err(format!("accessors[{index}] has {} elements for {count} vertices", values.len()));
    }
    Ok(Some(values))
}

/// The set of texture coordinates that the picture is looked up with. Without a picture the first, as a scene file may give the material one.
fn texture_coordinates(
    model: &Model<'_>,
    lookup: Option<Lookup>,
    attribute: impl Fn(Semantic) -> Option<Index<Accessor>>,
    count: usize,
    at: &str,
    losses: &mut Losses,
) -> Result<Option<Vec<Vec2>>, String> {
    let set = lookup.map_or(0, |lookup| lookup.set);
    let index = attribute(Semantic::TexCoords(set));
    if index.is_none() && lookup.is_some() {
        let message = "surfaces with a picture but without its texture coordinates have the colour of its corner";
        losses.add(format!("{at}.attributes.TEXCOORD_{set}"), message, "unwrap the mesh, or remove the picture from its material");
    }
    let uvs = same_length(index, count, |index| model.floats::<2>(index))?;
    let place = |uv: [f32; 2]| lookup.map_or(uv.into(), |lookup| lookup.at(uv));
    Ok(uvs.map(|uvs| uvs.into_iter().map(place).collect()))
}
