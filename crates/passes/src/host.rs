//! The host nodes of this crate, and what they are given.

use std::sync::Arc;

use manylight_gpu::HostNodes;
use manylight_scene::{Scene, SceneState};

use crate::{atlas, baked::Baked, bvh, points_static};

/// What host nodes get from [`manylight_gpu::HostContext::scene`].
#[derive(Debug, Clone)]
pub struct HostScene {
    /// The scene.
    pub scene: Arc<Scene>,
    /// Seed of everything random.
    pub seed: u32,
    /// Precomputed light, or where it will be.
    pub baked: Option<Arc<Baked>>,
    /// The scene in this frame. A node that depends on it names what changes (`scene_objects`, `scene_vertices`) as an input, and runs when
    /// that does.
    pub state: SceneState,
}

/// Every node of this crate that is written in Rust.
pub fn nodes() -> HostNodes {
    HostNodes::new().with(atlas::KIND).with(bvh::KIND).with(points_static::KIND)
}
