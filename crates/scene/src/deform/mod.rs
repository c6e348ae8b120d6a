//! Meshes whose shape changes over time: key frames of all vertices, and [`Metaballs`].

mod metaballs;

use crate::{bounds::Bounds, gpu_data::Vertex, import::Mesh, motion::Track};

pub use metaballs::{Ball, MAX_CELLS, Metaballs};

/// How the shape of a mesh follows time.
#[derive(Debug, Clone, PartialEq)]
pub enum Deformation {
    /// The vertices at some times; triangles stay as they are. Positions and normals are mixed linearly, normals are normalized again.
    Keys(Track<Vec<Vertex>>),
    /// Any number of triangles.
    Metaballs(Metaballs),
}

/// A mesh that deforms, at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Deformed {
    /// Its index in the scene.
    pub mesh: usize,
    /// Its shape.
    pub shape: Mesh,
}

/// Vertices and triangles that the GPU's buffers hold: those of a scene whose triangles come and go have room for the most that it
/// is expected to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Room {
    /// Of all meshes.
    pub vertices: usize,
    /// Of all objects.
    pub triangles: usize,
}

impl Room {
    /// The greater of each.
    #[must_use]
    pub fn max(self, other: Self) -> Self {
        Self { vertices: self.vertices.max(other.vertices), triangles: self.triangles.max(other.triangles) }
    }
}

impl Deformation {
    /// The times between which each part of it changes, and whether it starts again then.
    pub(crate) fn spans(&self) -> Vec<(f64, f64, bool)> {
        match self {
            Self::Keys(shapes) => shapes.span().into_iter().collect(),
            Self::Metaballs(metaballs) => metaballs.spans(),
        }
    }

    /// A box around all shapes, object space.
    pub fn reach(&self) -> Bounds {
        match self {
            Self::Keys(shapes) => {
                let mut bounds = Bounds::EMPTY;
                shapes.keys().iter().flat_map(|(_, vertices)| vertices).for_each(|vertex| bounds.add(vertex.position.as_dvec3()));
                bounds
            }
            Self::Metaballs(metaballs) => metaballs.reach(),
        }
    }
}

/// The vertices at a time; texture coordinates stay.
pub(crate) fn mixed(shapes: &Track<Vec<Vertex>>, time: f64) -> Vec<Vertex> {
    let (before, after, fraction) = shapes.around(time);
    if fraction == 0.0 {
        return before.clone();
    }
    let mix = |(a, b): (&Vertex, &Vertex)| Vertex {
        position: a.position.lerp(b.position, fraction),
        normal: a.normal.lerp(b.normal, fraction).normalize_or_zero(),
        ..*a
    };
    before.iter().zip(after).map(mix).collect()
}
