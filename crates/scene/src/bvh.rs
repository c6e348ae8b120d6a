//! A hierarchy of boxes over all triangles of the scene at one time, for those who trace rays: shaders, and the host ([`Ray`]).

mod rays;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use obvhs::{BvhBuildParams, bvh2::builder::build_bvh2_from_tris};

use crate::{gpu_data, scene::Scene, state::SceneState};

pub use rays::{Hit, MISSED, Ray};

/// A box and what is in it: two nodes, or some triangles.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BvhNode {
    /// Least corner, world space.
    pub low: Vec3,
    /// First triangle, or the first of the two children.
    pub first: u32,
    /// Greatest corner, world space.
    pub high: Vec3,
    /// Number of triangles; 0 for a node with children.
    pub count: u32,
}

/// A triangle in world space, in the order of the leaves.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BvhTriangle {
    /// First corner.
    pub a: Vec3,
    /// Index of the triangle in the scene.
    pub index: u32,
    /// From the first corner to the second.
    pub ab: Vec3,
    /// Its material.
    pub material: u32,
    /// From the first corner to the third.
    pub ac: Vec3,
    /// Its object.
    pub object: u32,
}

/// The hierarchy; node 0 is the root. Empty for a scene without triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Bvh {
    /// Fewer than twice as many as there are triangles.
    pub nodes: Vec<BvhNode>,
    /// As many as the scene has, without those that have no area.
    pub triangles: Vec<BvhTriangle>,
    /// Nodes on the longest way down: what a traversal needs a stack for.
    pub depth: usize,
}

impl Bvh {
    /// Builds the hierarchy over the scene's triangles as `state` has them. About 0.1 s for 10⁵ triangles.
    pub fn build(scene: &Scene, state: &SceneState) -> Self {
        let vertices = scene.vertices_of(&state.deformed);
        let place = |vertex: u32, object: u32| {
            state.objects[object as usize].world_from_object.transform_point3(vertices[vertex as usize].position)
        };
        let mut corners = Vec::new();
        let mut sources = Vec::new();
        for (index, t) in scene.triangles_of(&state.deformed).into_iter().enumerate() {
            let [a, b, c] = [t.a, t.b, t.c].map(|vertex| place(vertex, t.object));
            if (b - a).cross(c - a).length_squared() > 0.0 {
                corners.push(obvhs::triangle::Triangle { v0: a.into(), v1: b.into(), v2: c.into() });
                sources.push((index as u32, t));
            }
        }
        if corners.is_empty() {
            return Self::default();
        }
        let mut build_time = std::time::Duration::ZERO;
        let bvh = build_bvh2_from_tris(&corners, BvhBuildParams::medium_build(), &mut build_time);
        let triangle = |&primitive: &u32| {
            let (index, t): &(u32, gpu_data::Triangle) = &sources[primitive as usize];
            let corner = &corners[primitive as usize];
            let a = Vec3::from(corner.v0);
            BvhTriangle {
                a,
                index: *index,
                ab: Vec3::from(corner.v1) - a,
                material: t.material,
                ac: Vec3::from(corner.v2) - a,
                object: t.object,
            }
        };
        let node = |n: &obvhs::bvh2::node::Bvh2Node| BvhNode {
            low: n.aabb.min.into(),
            first: n.first_index,
            high: n.aabb.max.into(),
            count: n.prim_count,
        };
        let mut bvh =
            Self { nodes: bvh.nodes.iter().map(node).collect(), triangles: bvh.primitive_indices.iter().map(triangle).collect(), depth: 0 };
        bvh.depth = bvh.measure();
        bvh
    }

    fn measure(&self) -> usize {
        let mut deepest = 0;
        let mut open = vec![(0_usize, 1)];
        while let Some((index, depth)) = open.pop() {
            deepest = deepest.max(depth);
            let node = &self.nodes[index];
            if node.count == 0 {
                open.extend([(node.first as usize, depth + 1), (node.first as usize + 1, depth + 1)]);
            }
        }
        deepest
    }
}
