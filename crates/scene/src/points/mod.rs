//! Points on the surfaces for imperfect shadow maps, made on the host when a scene is loaded or deforms.
//!
//! Both methods put points along one line: the triangles in the order of the scene, and inside each triangle a hierarchical order of
//! sub-triangles ([`on_triangle`]), so that a short piece of the line is a small patch of surface. Each point has its own piece of the line
//! and a random place in it.
//!
//! Point i belongs to shadow map i mod N. Every N-th point of such a line samples it evenly for any N, so the line's order is kept, except that
//! points are shuffled in consecutive blocks of up to 1024. That keeps the period of a mesh (rows of a grid of N triangles) from meeting the
//! period N, and costs little evenness: a map still has its share of the points of every block.

mod area;
mod tessellation;

use glam::DVec3;

use crate::{
    deform::Deformed,
    gpu_data::ScenePoint,
    import::{Mesh, MeshTriangle},
    random::{hash2, shuffle},
    scene::{Scene, SceneObject},
};

pub use tessellation::Smoothness;

/// How points are spread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointMethod {
    /// As many points on each triangle as its tessellation gives (ACRSM eq. 5.3, 5.4 and algorithm 5.2).
    ///
    /// Algorithm 5.2 walks over a triangle in steps of barycentric coordinates. Its walk leaves out one edge and repeats corners, so here it only
    /// gives the **number** of points; they are spread over the whole triangle, stratified. Each stands for an equal share of it.
    Tessellation {
        /// Least tessellation factor, at least 1 (in the paper 5).
        min: u32,
        /// Greatest tessellation factor, not below `min` (in the paper 64).
        max: u32,
        /// Order of the polynomial between smallest and largest.
        smoothness: Smoothness,
    },
    /// This many points in all, each for an equal share of the surface in world space at time 0.
    Area {
        /// Number of points.
        count: u32,
    },
}

/// What [`generate`] needs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PointOptions {
    /// How points are spread.
    pub method: PointMethod,
    /// Another seed, other places of the points in their strata and another order.
    pub seed: u32,
}

/// More points than this are refused (2 GiB of [`ScenePoint`]s).
pub const MAX_POINTS: u64 = 1 << 26;

/// Why there are no points.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PointError {
    /// The method would make too many.
    #[error("{wanted} scene points are more than the {MAX_POINTS} that are possible: lower {lower}")]
    TooMany {
        /// Points that the options ask for.
        wanted: u64,
        /// What to lower.
        lower: &'static str,
    },
    /// The factors of the tessellation are not 1 ≤ min ≤ max.
    #[error("tessellation factors [{min}, {max}] are not 1 ≤ min ≤ max")]
    Factors {
        /// Least factor.
        min: u32,
        /// Greatest factor.
        max: u32,
    },
}

/// Makes the points of a scene whose meshes have the shapes of `deformed`, the others their own: the same for the same scene, shapes and
/// options on every machine.
///
/// Triangles of objects that have no size at time 0 get no points from [`PointMethod::Area`].
///
/// # Errors
/// The options ask for more than [`MAX_POINTS`], or are out of range.
pub fn generate(scene: &Scene, deformed: &[Deformed], options: &PointOptions) -> Result<Vec<ScenePoint>, PointError> {
    let shapes = Shapes { scene, deformed };
    let mut points = match options.method {
        PointMethod::Tessellation { min, max, smoothness } => tessellation::generate(&shapes, min, max, smoothness, options.seed)?,
        PointMethod::Area { count } => area::generate(&shapes, count, options.seed)?,
    };
    let block = (points.len() / LEAST_BLOCKS).clamp(SMALLEST_BLOCK, LARGEST_BLOCK);
    for (index, block) in points.chunks_mut(block).enumerate() {
        shuffle(block, hash2(options.seed, index as u32));
    }
    Ok(points)
}

/// Points are shuffled in at least so many blocks …
const LEAST_BLOCKS: usize = 64;
/// … that have at least so many points, …
const SMALLEST_BLOCK: usize = 16;
/// … and at most so many: as many as there are shadow maps at most.
const LARGEST_BLOCK: usize = 1024;

/// A triangle that gets points.
struct Surface {
    /// Object space.
    corners: [DVec3; 3],
    normal: DVec3,
    object: u32,
}

impl Surface {
    /// A triangle of an object, and its area in world space at time 0.
    fn new(object: usize, mesh: &Mesh, triangle: &MeshTriangle, world_from_object: &glam::DMat4) -> (Self, f64) {
        let corners = mesh.corners(triangle);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        let area = crate::import::area(&corners.map(|corner| world_from_object.transform_point3(corner)));
        (Self { corners, normal, object: object as u32 }, area)
    }

    /// The point at a place of the triangle's piece of the line.
    fn point(&self, place: f64, area: f64) -> ScenePoint {
        let [a, b, c] = on_triangle(place);
        let [p, q, r] = self.corners;
        let position = (p * a + q * b + r * c).as_vec3();
        ScenePoint { position, area: area as f32, normal: self.normal.as_vec3(), object: self.object }
    }
}

/// What gets points.
struct Shapes<'a> {
    scene: &'a Scene,
    deformed: &'a [Deformed],
}

impl<'a> Shapes<'a> {
    /// The objects with their meshes.
    fn objects(&self) -> impl Iterator<Item = (&'a SceneObject, &'a Mesh)> {
        let Self { scene, deformed } = *self;
        scene.objects.iter().map(move |object| (object, scene.shape(object.mesh, deformed)))
    }

    /// Calls back for every triangle of every object with its index among all.
    fn for_each_surface(&self, mut visit: impl FnMut(u32, &Surface, f64)) {
        let mut index = 0;
        for (number, (object, mesh)) in self.objects().enumerate() {
            let matrix = world_from_object(object);
            for triangle in &mesh.triangles {
                let (surface, area) = Surface::new(number, mesh, triangle, &matrix);
                visit(index, &surface, area);
                index += 1;
            }
        }
    }
}

/// Where an object is at time 0.
fn world_from_object(object: &SceneObject) -> glam::DMat4 {
    object.pose.at(0.0).world_from_object()
}

/// Barycentric coordinates of the place `t` (0…1) on a line that fills a triangle and gives equal lengths equal areas: each base-4 digit of
/// `t` picks one of the four triangles between the corners and the middles of the edges (after Basu and Owen 2015, who take the digits in
/// reverse); the point is the centre of the last one.
pub fn on_triangle(t: f64) -> [f64; 3] {
    let mut corners = [DVec3::X, DVec3::Y, DVec3::Z];
    let mut rest = t.clamp(0.0, 1.0);
    for _ in 0..TRIANGLE_LEVELS {
        rest *= 4.0;
        let digit = rest.floor().min(3.0);
        rest -= digit;
        let [a, b, c] = corners;
        let (ab, bc, ca) = (0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a));
        corners = match digit as u32 {
            0 => [a, ab, ca],
            1 => [ab, b, bc],
            2 => [bc, ca, ab],
            _ => [ca, bc, c],
        };
    }
    ((corners[0] + corners[1] + corners[2]) / 3.0).to_array()
}

/// Halvings of an edge in [`on_triangle`]: the places of 4¹² points are distinct.
const TRIANGLE_LEVELS: u32 = 12;
