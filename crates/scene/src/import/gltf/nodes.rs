//! The tree of nodes: which there are, and where they are at a time.

use glam::{DMat4, DQuat, DVec3, Vec3};
use manylight_graph::diagnostics::Diagnostic;

use super::{
    animation::Curves,
    document::{EXPORT_AGAIN, Model, fault},
    losses::Losses,
    primitives::LARGEST,
    transform::{Transform, Trs},
};

/// The nodes of a scene.
pub(super) struct Nodes {
    /// Those of the scene, parents before their children.
    pub(super) order: Vec<usize>,
    /// By index: what is above a node in the scene.
    parents: Vec<Option<usize>>,
    /// By index: where it is in its parent's space, without animation.
    locals: Vec<Transform>,
    /// By index: whether it or something above it is animated.
    moving: Vec<bool>,
    /// By index: where it is in the world without animation.
    at_rest: Vec<Transform>,
    curves: Curves,
}

impl Nodes {
    /// The nodes of the file's scene.
    ///
    /// # Errors
    /// Nodes do not form a tree, or have no finite place.
    pub(super) fn new(model: &Model<'_>, curves: Curves, losses: &mut Losses) -> Result<Self, Diagnostic> {
        let root = &model.root;
        let count = root.nodes.len();
        let (mut order, mut parents, mut seen) = (Vec::new(), vec![None; count], vec![false; count]);
        // Later ones first, as the last is taken first.
        let mut open: Vec<(usize, Option<usize>)> = roots(model, losses).into_iter().rev().map(|node| (node, None)).collect();
        while let Some((node, parent)) = open.pop() {
            if std::mem::replace(&mut seen[node], true) {
                let message = format!("nodes[{node}] has several parents, or is below itself");
                return Err(fault(model.path, message, "every node has one parent at most: export the file again"));
            }
            parents[node] = parent;
            order.push(node);
            let children = root.nodes[node].children.iter().flatten();
            open.extend(children.rev().map(|child| (child.value(), Some(node))));
        }
        let locals: Vec<Transform> = (0..count).map(|node| local(model, node, losses)).collect();
        let mut nodes = Self { order, parents, moving: vec![false; count], at_rest: locals.clone(), locals, curves };
        for node in nodes.order.clone() {
            let parent = nodes.parents[node];
            nodes.moving[node] = nodes.curves.has(node) || parent.is_some_and(|parent| nodes.moving[parent]);
            if let Some(parent) = parent {
                nodes.at_rest[node] = nodes.at_rest[parent].after(&nodes.locals[node]);
            }
            if !usable(&nodes.at_rest[node].matrix()) {
                return Err(fault(model.path, format!("nodes[{node}] is too far away or too large, or has no finite place"), EXPORT_AGAIN));
            }
        }
        Ok(nodes)
    }

    /// Whether a node ever moves.
    pub(super) fn moves(&self, node: usize) -> bool {
        self.moving[node]
    }

    /// Where a node is without animation.
    pub(super) fn at_rest(&self, node: usize) -> Transform {
        self.at_rest[node]
    }

    /// The node and all above it.
    pub(super) fn chain(&self, node: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(Some(node), |node| self.parents[*node])
    }

    /// Times at which a node changes the way it moves.
    pub(super) fn breaks(&self, node: usize) -> Vec<f64> {
        self.chain(node).flat_map(|node| self.curves.breaks(node)).collect()
    }

    /// First and last time of all animations.
    pub(super) fn span(&self) -> (f64, f64) {
        self.curves.span()
    }

    /// Where a node is at a time. What is not finite counts as at rest.
    pub(super) fn at(&self, node: usize, time: f64) -> Transform {
        let world = |node: usize| self.curves.local(node, &self.locals[node], time);
        let mut chain = self.chain(node);
        let mut transform = chain.next().map_or(Transform::Trs(Trs::IDENTITY), world);
        for above in chain {
            transform = world(above).after(&transform);
        }
        if usable(&transform.matrix()) { transform } else { self.at_rest[node] }
    }
}

fn usable(matrix: &DMat4) -> bool {
    matrix.to_cols_array().iter().all(|number| number.abs() <= f64::from(LARGEST))
}

/// The topmost nodes of the file's scene; without any scene, all that have no parent.
fn roots(model: &Model<'_>, losses: &mut Losses) -> Vec<usize> {
    let root = &model.root;
    if root.scenes.len() > 1 {
        losses.add("scenes", "scenes other than the default one are left out", "save each in a file of its own");
    }
    match root.scene.and_then(|scene| root.get(scene)).or(root.scenes.first()) {
        Some(scene) => scene.nodes.iter().map(|node| node.value()).collect(),
        None => {
            let mut child = vec![false; root.nodes.len()];
            root.nodes.iter().flat_map(|node| node.children.iter().flatten()).for_each(|node| child[node.value()] = true);
            // In a ring nobody is topmost: the ring is told of when it is walked.
            let topmost: Vec<usize> = (0..child.len()).filter(|node| !child[*node]).collect();
            if topmost.is_empty() { (0..child.len().min(1)).collect() } else { topmost }
        }
    }
}

/// Where a node is in its parent's space.
fn local(model: &Model<'_>, index: usize, losses: &mut Losses) -> Transform {
    let node = &model.root.nodes[index];
    if let Some(matrix) = node.matrix {
        let mut matrix = DMat4::from_cols_array(&matrix.map(f64::from));
        if matrix.row(3) != glam::DVec4::W {
            losses.add(format!("nodes[{index}].matrix"), "the last rows of matrices that are not 0, 0, 0, 1 count as such", EXPORT_AGAIN);
            [matrix.x_axis.w, matrix.y_axis.w, matrix.z_axis.w, matrix.w_axis.w] = [0.0, 0.0, 0.0, 1.0];
        }
        return Transform::from_matrix(matrix);
    }
    let vector = |value: Option<[f32; 3]>, default: Vec3| value.map_or(default, Vec3::from_array).as_dvec3();
    let rotate = node.rotation.map_or(DQuat::IDENTITY, |rotation| DQuat::from_array(rotation.0.map(f64::from)));
    if rotate.length_squared() == 0.0 || !rotate.is_finite() {
        losses.add(format!("nodes[{index}].rotation"), "rotations that are no unit quaternions are left out", EXPORT_AGAIN);
    }
    Transform::Trs(Trs {
        translate: vector(node.translation, Vec3::ZERO),
        rotate: unit(rotate).unwrap_or(DQuat::IDENTITY),
        scale: vector(node.scale, Vec3::ONE),
    })
}

/// The rotation of a quaternion of any length.
pub(super) fn unit(rotation: DQuat) -> Option<DQuat> {
    // Dividing by the largest keeps squares in range.
    let largest = rotation.to_array().into_iter().fold(0.0_f64, |largest, x| largest.max(x.abs()));
    let scaled = DQuat::from_array(rotation.to_array().map(|x| x / largest));
    (largest > 0.0 && scaled.is_finite()).then(|| scaled.normalize())
}

/// A direction in a node's space as a unit vector in the world; down if it has none.
pub(super) fn direction(matrix: &DMat4, way: DVec3) -> DVec3 {
    matrix.transform_vector3(way).try_normalize().unwrap_or(DVec3::NEG_Y)
}
