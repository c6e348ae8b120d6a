//! The host nodes of this crate, and what they are given.

use std::sync::Arc;

use manylight_gpu::HostNodes;
use manylight_scene::Scene;

use crate::points_static;

/// What host nodes get from [`manylight_gpu::HostContext::scene`].
#[derive(Debug, Clone)]
pub struct HostScene {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Seed of everything random.
    pub seed: u32,
}

/// Every node of this crate that is written in Rust.
pub fn nodes() -> HostNodes {
    HostNodes::new().with(points_static::KIND)
}
