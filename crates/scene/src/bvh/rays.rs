//! Rays against the hierarchy on the host: the twin of `shaders/common/bvh.wgsl`, in the same arithmetic.

use glam::{Vec3, Vec3A, Vec4};

use super::{Bvh, BvhNode, BvhTriangle};

/// Distance of what a ray does not meet, and the limit of a ray without end.
pub const MISSED: f32 = 3.0e38;

/// Where a ray meets a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance in lengths of the ray's direction.
    pub t: f32,
    /// Index in [`Bvh::triangles`].
    pub triangle: u32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

/// A ray from a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// Where it starts.
    pub origin: Vec3,
    /// Need not have unit length: distances are in its lengths.
    pub direction: Vec3,
    /// One over the direction; large instead of infinite.
    inverse: Vec3,
}

/// Components of a direction below this count as this.
const TINY: f32 = 1e-20;
/// A few rounding errors of slack, so that no ray slips through between two boxes.
const BOX_SLACK: f32 = 1.000_000_4;
/// Rounding may put a ray beside both triangles of an edge that they share: each is larger by this share of itself.
const EDGE_SLACK: f32 = 1e-6;
/// Nodes that wait on the way down are kept without allocation in hierarchies up to this depth.
const USUAL_DEPTH: usize = 64;

impl Ray {
    /// From a point along a direction.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        let inverse = |d: f32| 1.0 / if d.abs() < TINY { TINY.copysign(d) } else { d };
        Self { origin, direction, inverse: Vec3::new(inverse(direction.x), inverse(direction.y), inverse(direction.z)) }
    }

    /// From one point to another, which is at distance 1.
    pub fn between(from: Vec3, to: Vec3) -> Self {
        Self::new(from, to - from)
    }

    /// The triangle from both sides (Möller and Trumbore 1997), beyond 0 and before `limit`.
    fn meets(&self, index: u32, triangle: &BvhTriangle, limit: f32) -> Option<Hit> {
        let p = self.direction.cross(triangle.ac);
        let determinant = triangle.ab.dot(p);
        let inverse = 1.0 / determinant;
        let s = self.origin - triangle.a;
        let u = s.dot(p) * inverse;
        let q = s.cross(triangle.ab);
        let v = self.direction.dot(q) * inverse;
        let t = triangle.ac.dot(q) * inverse;
        let inside = u.min(v).min(1.0 - u - v) >= -EDGE_SLACK;
        (determinant != 0.0 && inside && t > 0.0 && t < limit).then_some(Hit { t, triangle: index, u, v })
    }
}

/// A ray as boxes are tested with it.
struct BoxRay {
    origin: Vec3A,
    inverse: Vec3A,
}

impl BoxRay {
    /// Distance at which it enters the box, or [`MISSED`] if that is not before `limit`.
    fn enter(&self, node: &BvhNode, limit: f32) -> f32 {
        let [low, high]: [Vec4; 2] = bytemuck::cast(*node);
        let a = (Vec3A::from_vec4(low) - self.origin) * self.inverse;
        let b = (Vec3A::from_vec4(high) - self.origin) * self.inverse;
        let enter = a.min(b).max_element().max(0.0);
        let leave = a.max(b).min_element().min(limit);
        if enter <= leave * BOX_SLACK { enter } else { MISSED }
    }
}

impl Bvh {
    /// The nearest hit before `limit`.
    pub fn nearest(&self, ray: &Ray, limit: f32) -> Option<Hit> {
        let mut best = None;
        self.walk(ray, limit, |hit| {
            best = Some(hit);
            hit.t
        });
        best
    }

    /// Whether anything is hit before `limit`.
    pub fn is_blocked(&self, ray: &Ray, limit: f32) -> bool {
        let mut found = false;
        self.walk(ray, limit, |_| {
            found = true;
            -1.0
        });
        found
    }

    /// Whether nothing lies between two points that are off their surfaces already.
    pub fn sees(&self, from: Vec3, to: Vec3) -> bool {
        !self.is_blocked(&Ray::between(from, to), 1.0)
    }

    /// Everything that the ray goes through before `limit`, in no certain order; `hits` is cleared first.
    pub fn all_hits(&self, ray: &Ray, limit: f32, hits: &mut Vec<Hit>) {
        hits.clear();
        self.walk(ray, limit, |hit| {
            hits.push(hit);
            limit
        });
    }

    /// Calls `found` with hits; what it returns is the limit from then on, and ends the walk if it is negative.
    fn walk(&self, ray: &Ray, limit: f32, found: impl FnMut(Hit) -> f32) {
        if self.depth <= USUAL_DEPTH {
            self.walk_with(&mut [0; USUAL_DEPTH], ray, limit, found);
        } else {
            self.walk_with(&mut vec![0; self.depth], ray, limit, found);
        }
    }

    fn walk_with(&self, stack: &mut [u32], ray: &Ray, mut limit: f32, mut found: impl FnMut(Hit) -> f32) {
        let Some(mut node) = self.nodes.first() else { return };
        let boxes = BoxRay { origin: ray.origin.into(), inverse: ray.inverse.into() };
        let mut height = 0;
        loop {
            if node.count > 0 {
                for index in node.first..node.first + node.count {
                    if let Some(hit) = ray.meets(index, &self.triangles[index as usize], limit) {
                        limit = found(hit);
                        if limit < 0.0 {
                            return;
                        }
                    }
                }
            } else {
                let children = &self.nodes[node.first as usize..node.first as usize + 2];
                let (left, right) = (boxes.enter(&children[0], limit), boxes.enter(&children[1], limit));
                let near = usize::from(left > right);
                if left.max(right) < MISSED {
                    // The nearer child first; the other waits.
                    stack[height] = node.first + 1 - near as u32;
                    height += 1;
                    node = &children[near];
                    continue;
                }
                if left.min(right) < MISSED {
                    node = &children[near];
                    continue;
                }
            }
            if height == 0 {
                return;
            }
            height -= 1;
            node = &self.nodes[stack[height] as usize];
        }
    }
}
