//! Texels of an atlas over the surfaces of a scene: which point of which triangle each of them stands for.

use glam::{DMat4, DVec2, DVec3};
use manylight_gpu::{HostContext, HostError, HostKind, HostNode};
use manylight_scene::{
    Scene, SceneState,
    gpu_data::{NO_TRIANGLE, SurfaceTexel, Triangle, Vertex},
};

use crate::{
    baked::{Baked, CORNERS},
    host::HostScene,
};

/// Name, declaration and maker of the host node `precomputed/texels`.
pub const KIND: HostKind = HostKind { name: "precomputed/texels", declaration: DECLARATION, make: || Box::new(Texels) };

const DECLARATION: &str = r#"Node(
    doc: "The surface that each texel of an atlas of precomputed light stands for ([PCA] 3.1): the nearest point of those triangles whose look-ups touch the texel. Made on the host when the scene changes.",
    outputs: {
        "baked_texels": Buffer(of: "SurfaceTexel", doc: "row by row; those beside all charts have no triangle"),
    },
)
"#;

/// A texel is read by look-ups that are nearer than one texel along both axes, so no farther than this squared.
const FARTHEST_SQUARED: f64 = 2.0;

/// Points that would lie on an edge lie so far within it, in texels: a ray that starts on the very edge of a floor meets no wall that ends there.
const INSET: f64 = 0.05;

/// Has no state of its own.
#[derive(Debug)]
struct Texels;

impl HostNode for Texels {
    fn run(&mut self, ctx: &mut HostContext<'_>) -> Result<(), HostError> {
        let scene = ctx.scene::<HostScene>()?;
        let baked =
            scene.baked.as_ref().ok_or_else(|| HostError::new("there is no atlas: only `manylight bake --lookup atlas` makes one"))?;
        let texels = texels(&scene.scene, &scene.state, baked);
        ctx.write("baked_texels", &texels)
    }
}

/// The point of a triangle in the plane that a texel with its middle at `p` stands for, as the weights of its corners, and how far its middle is from the
/// triangle, squared.
fn stand_in(p: DVec2, place: [DVec2; 3]) -> (DVec3, f64) {
    let weights = nearest(p, place);
    let point = weights.x * place[0] + weights.y * place[1] + weights.z * place[2];
    let to_centroid = ((place[0] + place[1] + place[2]) / 3.0).distance(point);
    let share = (INSET / to_centroid.max(f64::MIN_POSITIVE)).min(1.0);
    let inside = weights.min_element() > 0.0;
    (if inside { weights } else { weights.lerp(DVec3::splat(1.0 / 3.0), share) }, p.distance_squared(point))
}

/// The nearest point to `p` of a triangle in the plane, as the weights of its corners.
fn nearest(p: DVec2, [a, b, c]: [DVec2; 3]) -> DVec3 {
    let area = (b - a).perp_dot(c - a);
    let inside = DVec3::new((b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)) / area;
    if area != 0.0 && inside.min_element() >= 0.0 {
        return inside;
    }
    let on_edge = |from: DVec2, to: DVec2| {
        let edge = to - from;
        let t = ((p - from).dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        (p.distance_squared(from + t * edge), t)
    };
    let (ab, bc, ca) = (on_edge(a, b), on_edge(b, c), on_edge(c, a));
    if ab.0 <= bc.0 && ab.0 <= ca.0 {
        DVec3::new(1.0 - ab.1, ab.1, 0.0)
    } else if bc.0 <= ca.0 {
        DVec3::new(0.0, 1.0 - bc.1, bc.1)
    } else {
        DVec3::new(ca.1, 0.0, 1.0 - ca.1)
    }
}

/// A point of a triangle, with its normals on one side.
fn surface(index: usize, weights: DVec3, is_front: bool, corners: [&Vertex; 3], to_world: (DMat4, DMat4)) -> SurfaceTexel {
    let mixed = |of: fn(&Vertex) -> glam::Vec3| (0..3).map(|i| weights[i] * of(corners[i]).as_dvec3()).sum::<DVec3>();
    let [a, b, c] = corners.map(|corner| corner.position.as_dvec3());
    let (world_from_object, normal_from_object) = to_world;
    let geometric = normal_from_object.transform_vector3((b - a).cross(c - a)).normalize_or_zero();
    let geometric = if is_front { geometric } else { -geometric };
    let smooth = normal_from_object.transform_vector3(mixed(|vertex| vertex.normal)).normalize_or(geometric);
    let smooth = if smooth.dot(geometric) >= 0.0 { smooth } else { -smooth };
    SurfaceTexel {
        position: world_from_object.transform_point3(mixed(|vertex| vertex.position)).as_vec3(),
        triangle: index as u32,
        normal: smooth.as_vec3(),
        u: weights.y as f32,
        geometric: geometric.as_vec3(),
        v: weights.z as f32,
    }
}

/// The texels of an atlas, row by row: for each that a look-up may touch the nearest point of a triangle in the atlas, which for most texels is at their
/// middle; of several the first triangle's.
pub fn texels(scene: &Scene, state: &SceneState, baked: &Baked) -> Vec<SurfaceTexel> {
    let (width, height) = (baked.header.width, baked.header.height);
    let zero = glam::Vec3::ZERO;
    let nothing = SurfaceTexel { position: zero, triangle: NO_TRIANGLE, normal: zero, u: 0.0, geometric: zero, v: 0.0 };
    let mut texels = vec![nothing; width * height];
    let mut distances = vec![FARTHEST_SQUARED; width * height];
    let (vertices, triangles) = (scene.gpu_vertices_at(state), scene.gpu_triangles_at(state));
    let vertex = |index: u32| &vertices[index as usize];
    let places = baked.corners_at(scene, state);
    for (index, (triangle, sides)) in triangles.iter().zip(places.chunks_exact(CORNERS)).enumerate() {
        let &Triangle { a, b, c, object, .. } = triangle;
        for (side, corners) in sides.chunks_exact(CORNERS / 2).enumerate() {
            if corners.contains(&[0.0; 2]) {
                continue;
            }
            let place = [0, 1, 2].map(|i| DVec2::new(corners[i][0].into(), corners[i][1].into()));
            let low = place[0].min(place[1]).min(place[2]) - FARTHEST_SQUARED.sqrt();
            let high = place[0].max(place[1]).max(place[2]) + FARTHEST_SQUARED.sqrt();
            let of = &state.objects[object as usize];
            let to_world = (of.world_from_object.as_dmat4(), of.normal_from_object.as_dmat4());
            for y in low.y.max(0.0) as usize..height.min(high.y.max(0.0) as usize + 1) {
                for x in low.x.max(0.0) as usize..width.min(high.x.max(0.0) as usize + 1) {
                    let middle = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let (weights, distance) = stand_in(middle, place);
                    if distance < distances[y * width + x] {
                        distances[y * width + x] = distance;
                        texels[y * width + x] = surface(index, weights, side == 0, [vertex(a), vertex(b), vertex(c)], to_world);
                    }
                }
            }
        }
    }
    texels
}
