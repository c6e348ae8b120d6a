//! Triangle meshes, and what is known of their sizes.

use std::collections::{HashMap, HashSet};

use glam::DVec3;
use manylight_graph::diagnostics::Diagnostics;

use super::nowhere;
use crate::{
    bounds::Bounds,
    deform::{Deformation, Room, mixed},
    gpu_data::Vertex,
};

/// A triangle of a mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MeshTriangle {
    /// Indices of its vertices.
    pub vertices: [u32; 3],
    /// Index of its material in the scene.
    pub material: u32,
}

/// Triangles in a space of their own. In a mesh from a file every triangle has an area, and no two are equal.
#[derive(Debug, Clone, PartialEq)]
pub struct Mesh {
    /// Its file, as named in the scene; with its place in it (`a.glb#meshes[0]`) if there are several.
    pub name: String,
    /// Vertices; all finite where a triangle uses them. Of a mesh that deforms: at time 0.
    pub vertices: Vec<Vertex>,
    /// At least one, but for metaballs without a surface. Of a mesh that deforms: at time 0.
    pub triangles: Vec<MeshTriangle>,
    /// Sizes of all that.
    pub statistics: MeshStatistics,
    /// How it changes over time, if it does.
    pub deformation: Option<Deformation>,
}

/// Sizes in object space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshStatistics {
    /// Around all triangles.
    pub bounds: Bounds,
    /// Sum over all triangles.
    pub area: f64,
    /// Of the smallest triangle.
    pub area_min: f64,
    /// Of the largest triangle.
    pub area_max: f64,
    /// Shortest edge.
    pub edge_min: f64,
    /// Longest edge.
    pub edge_max: f64,
}

impl MeshStatistics {
    /// Of no triangles: least sizes are infinite.
    const NONE: Self =
        Self { bounds: Bounds::EMPTY, area: 0.0, area_min: f64::INFINITY, area_max: 0.0, edge_min: f64::INFINITY, edge_max: 0.0 };

    /// Counts a triangle.
    fn add(&mut self, corners: &[DVec3; 3]) {
        let (area, edges) = (area(corners), edges(corners));
        self.area += area;
        self.area_min = self.area_min.min(area);
        self.area_max = self.area_max.max(area);
        self.edge_min = edges.into_iter().fold(self.edge_min, f64::min);
        self.edge_max = edges.into_iter().fold(self.edge_max, f64::max);
        corners.iter().for_each(|corner| self.bounds.add(*corner));
    }
}

/// Triangles that were left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct LeftOut {
    /// Not finite vertices.
    pub(super) not_finite: usize,
    /// No area.
    pub(super) flat: usize,
    /// The same positions as an earlier one, in any order.
    pub(super) repeated: usize,
}

impl LeftOut {
    /// A warning for each kind.
    pub(super) fn report(self, name: &str, warnings: &mut Diagnostics) {
        let mut warn = |count: usize, what: &str| {
            if count > 0 {
                warnings.0.push(nowhere(format!("`{name}`: {count} triangles {what} and are left out")));
            }
        };
        warn(self.not_finite, "have vertices that are not finite");
        warn(self.flat, "have no area");
        warn(self.repeated, "repeat another one");
    }
}

/// Share of the square of the longest edge below which an area is rounding noise of 32-bit coordinates: such a triangle has no normal.
const SMALLEST_AREA: f64 = 1e-12;

impl Mesh {
    /// A mesh of those triangles that are any use; `None` if there is none.
    pub(super) fn new(name: String, vertices: Vec<Vertex>, mut triangles: Vec<MeshTriangle>) -> (Option<Self>, LeftOut) {
        let mut left_out = LeftOut::default();
        let place = places(&vertices);
        let mut known = HashSet::with_capacity(triangles.len());
        let mut statistics = MeshStatistics::NONE;
        triangles.retain(|triangle| {
            let corners = triangle.vertices.map(|i| vertices[i as usize].position.as_dvec3());
            if !corners.iter().all(|corner| corner.is_finite()) {
                left_out.not_finite += 1;
                return false;
            }
            let longest = edges(&corners).into_iter().fold(0.0, f64::max);
            let area = area(&corners);
            if area <= f64::from(f32::MIN_POSITIVE) || area <= SMALLEST_AREA * longest * longest {
                left_out.flat += 1;
                return false;
            }
            let mut key = triangle.vertices.map(|i| place[i as usize]);
            key.sort_unstable();
            if !known.insert(key) {
                left_out.repeated += 1;
                return false;
            }
            statistics.add(&corners);
            true
        });
        let mesh = (!triangles.is_empty()).then_some(Self { name, vertices, triangles, statistics, deformation: None });
        (mesh, left_out)
    }

    /// A mesh of all these triangles.
    pub(crate) fn whole(name: String, vertices: Vec<Vertex>, triangles: Vec<MeshTriangle>) -> Self {
        let mut mesh = Self { name, vertices, triangles, statistics: MeshStatistics::NONE, deformation: None };
        let mut statistics = MeshStatistics::NONE;
        mesh.triangles.iter().for_each(|triangle| statistics.add(&mesh.corners(triangle)));
        mesh.statistics = statistics;
        mesh
    }

    /// Its shape at a time in seconds, as a mesh that does not deform; `None` if it is one itself.
    pub fn at(&self, time: f64) -> Option<Self> {
        let (vertices, triangles) = match self.deformation.as_ref()? {
            Deformation::Keys(shapes) => (mixed(shapes, time), self.triangles.clone()),
            Deformation::Metaballs(metaballs) => metaballs.surface(time),
        };
        Some(Self::whole(self.name.clone(), vertices, triangles))
    }

    /// What buffers need for it at all times, as far as is known.
    pub(crate) fn room(&self) -> Room {
        match &self.deformation {
            Some(Deformation::Metaballs(metaballs)) => metaballs.room(),
            _ => Room { vertices: self.vertices.len(), triangles: self.triangles.len() },
        }
    }

    /// A box around its shapes at all times, object space.
    pub(crate) fn reach(&self) -> Bounds {
        self.deformation.as_ref().map_or(self.statistics.bounds, Deformation::reach)
    }

    /// The corners of a triangle in object space.
    pub fn corners(&self, triangle: &MeshTriangle) -> [DVec3; 3] {
        triangle.vertices.map(|i| self.vertices[i as usize].position.as_dvec3())
    }
}

/// A number for each vertex, equal for equal positions.
fn places(vertices: &[Vertex]) -> Vec<u32> {
    let mut ids = HashMap::with_capacity(vertices.len());
    let id = |vertex: &Vertex| {
        let next = ids.len() as u32;
        // Adding 0 makes −0 and 0 equal.
        *ids.entry(vertex.position.to_array().map(|x| (x + 0.0).to_bits())).or_insert(next)
    };
    vertices.iter().map(id).collect()
}

/// Area of a triangle.
pub(crate) fn area(corners: &[DVec3; 3]) -> f64 {
    0.5 * (corners[1] - corners[0]).cross(corners[2] - corners[0]).length()
}

/// Lengths of the edges opposite of the corners.
pub(crate) fn edges(corners: &[DVec3; 3]) -> [f64; 3] {
    [corners[1].distance(corners[2]), corners[2].distance(corners[0]), corners[0].distance(corners[1])]
}
