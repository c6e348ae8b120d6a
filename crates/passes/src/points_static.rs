//! The host node `points/static`: scene points made once, when the scene or a parameter changes, and again when an object deforms.

use manylight_gpu::{HostContext, HostError, HostKind, HostNode};
use manylight_scene::points::{PointMethod, PointOptions, Smoothness, generate};

use crate::host::HostScene;

/// Name, declaration and maker.
pub const KIND: HostKind = HostKind { name: "points/static", declaration: DECLARATION, make: || Box::new(PointsStatic) };

const DECLARATION: &str = r#"Node(
    doc: "Points on the surfaces of the scene, made on the host when the scene or a parameter changes; they ride on their objects ([ACRSM] 5.2 Static Tessellation). Points cannot ride on objects that deform: where there are some, all points are made again whenever they do, and `points/dynamic` does that faster.",
    inputs: {
        "scene_vertices": Buffer(of: "Vertex", doc: "of objects that deform: when they change, all points are made again"),
        "scene_triangles": Buffer(of: "Triangle", doc: "as the vertices"),
    },
    outputs: {
        "points": Buffer(of: "ScenePoint", doc: "object space, with the area each stands for; area 0: unused"),
    },
    params: {
        "method": Choice(options: ["area", "tessellation"], default: "area", doc: "area: `point_count` points in proportion to area; tessellation: as many as the paper's factors give"),
        "point_count": Int(min: 1, max: 4000000, default: 64000, doc: "points with `area`; with `tessellation` the most there may be. Time of the splats is linear in it"),
        "f_min": Int(min: 1, max: 64, default: 5, doc: "least tessellation factor"),
        "f_max": Int(min: 1, max: 64, default: 32, doc: "greatest tessellation factor"),
        "smoothstep": Choice(options: ["3rd", "5th"], default: "3rd", doc: "order of the polynomial between the factors of the smallest and of the largest triangle"),
        "seed": Int(min: 0, max: 4294967295, default: 0, doc: "other points; added to the seed of the frame"),
    },
)
"#;

/// Has no state of its own.
#[derive(Debug)]
struct PointsStatic;

impl HostNode for PointsStatic {
    fn run(&mut self, ctx: &mut HostContext<'_>) -> Result<(), HostError> {
        let scene = ctx.scene::<HostScene>()?;
        let whole = |name: &str| Ok::<u32, HostError>(u32::try_from(ctx.int(name)?).unwrap_or(u32::MAX));
        let count = whole("point_count")?;
        let method = match ctx.choice("method")? {
            "tessellation" => PointMethod::Tessellation {
                min: whole("f_min")?,
                max: whole("f_max")?,
                smoothness: if ctx.choice("smoothstep")? == "5th" { Smoothness::Fifth } else { Smoothness::Third },
            },
            _ => PointMethod::Area { count },
        };
        let options = PointOptions { method, seed: whole("seed")?.wrapping_add(scene.seed) };
        let points = generate(&scene.scene, &scene.state.deformed, &options).map_err(|e| HostError::new(e.to_string()))?;
        let capacity = ctx.count("points")?.min(count as usize);
        if points.len() > capacity {
            return Err(HostError::new(format!(
                "the tessellation makes {} points, but there is room for {capacity}: raise `point_count`, or lower `f_max`",
                points.len()
            )));
        }
        ctx.write("points", &points)
    }
}
