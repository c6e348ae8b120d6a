//! The host nodes of this crate, and what they are given.

use std::sync::Arc;

use manylight_gpu::HostNodes;
use manylight_scene::Scene;

use crate::{bvh, points_static};

/// What host nodes get from [`manylight_gpu::HostContext::scene`].
#[derive(Debug, Clone)]
pub struct HostScene {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Seed of everything random.
    pub seed: u32,
    /// The scene's time in this frame, seconds. A node that depends on it names what moves (`scene_objects`) as an input, and runs when that changes.
    pub time: f64,
}

/// Every node of this crate that is written in Rust.
pub fn nodes() -> HostNodes {
    HostNodes::new().with(bvh::KIND).with(points_static::KIND)
}
