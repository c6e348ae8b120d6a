//! The host node `scene/bvh`: a hierarchy over the scene's triangles, built again when an object moves or deforms.

use manylight_gpu::{HostContext, HostError, HostKind, HostNode};
use manylight_scene::bvh::Bvh;

use crate::host::HostScene;

/// Name, declaration and maker.
pub const KIND: HostKind = HostKind { name: "scene/bvh", declaration: DECLARATION, make: || Box::new(BuildBvh) };

/// What shaders' traversals have a stack for (`shaders/common/bvh.wgsl`).
const DEEPEST: usize = 48;

const DECLARATION: &str = r#"Node(
    doc: "Bounding volume hierarchy over all triangles in world space, built on the host when the scene changes or an object moves or deforms.",
    inputs: {
        "scene_objects": Buffer(of: "Object", doc: "transforms: when they change, the hierarchy is built again"),
        "scene_vertices": Buffer(of: "Vertex", doc: "of objects that deform: as with transforms"),
        "scene_triangles": Buffer(of: "Triangle", doc: "of objects that deform: as with transforms"),
    },
    outputs: {
        "bvh_nodes": Buffer(of: "BvhNode", doc: "node 0 is the root; room for twice as many nodes as triangles"),
        "bvh_triangles": Buffer(of: "BvhTriangle", doc: "world space, in the order of the leaves"),
    },
)
"#;

/// Has no state of its own.
#[derive(Debug)]
struct BuildBvh;

impl HostNode for BuildBvh {
    fn run(&mut self, ctx: &mut HostContext<'_>) -> Result<(), HostError> {
        let scene = ctx.scene::<HostScene>()?;
        let bvh = Bvh::build(&scene.scene, &scene.state);
        if bvh.depth > DEEPEST {
            return Err(HostError::new(format!("the hierarchy is {} nodes deep, and traversals can follow {DEEPEST}", bvh.depth)));
        }
        ctx.write("bvh_nodes", &bvh.nodes)?;
        ctx.write("bvh_triangles", &bvh.triangles)
    }
}
