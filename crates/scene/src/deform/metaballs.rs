//! Balls that melt into one another: the surface where the sum of their fields has a given value, as triangles.

use fast_surface_nets::{
    SurfaceNetsBuffer,
    ndshape::{RuntimeShape, Shape},
    surface_nets,
};
use glam::{DVec3, Vec3};

use super::Room;
use crate::{
    bounds::Bounds,
    gpu_data::Vertex,
    import::MeshTriangle,
    motion::{Interpolate, Track},
};

/// A ball at one time. Its field is `strength` · (1 − d²/radius²)³ at a distance d below `radius`, and 0 beyond (after Wyvill, McPheeters
/// and Wyvill 1986, "Data structure for soft objects").
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Its middle, object space.
    pub position: Vec3,
    /// Where its field ends; 0: it has none. The surface of a lone ball lies within: at radius · √(1 − ∛(level / strength)).
    pub radius: f32,
    /// The field in the middle. A negative one dents the others.
    pub strength: f32,
}

impl Interpolate for Ball {
    fn interpolate(&self, other: &Self, fraction: f32) -> Self {
        Self {
            position: self.position.lerp(other.position, fraction),
            radius: self.radius + (other.radius - self.radius) * fraction,
            strength: self.strength + (other.strength - self.strength) * fraction,
        }
    }
}

impl Ball {
    fn bounds(&self) -> Bounds {
        let (middle, radius) = (self.position.as_dvec3(), DVec3::splat(self.radius.into()));
        Bounds { min: middle - radius, max: middle + radius }
    }
}

/// Most cells along the longest side.
pub const MAX_CELLS: u32 = 256;

/// Times at which triangles are counted when a scene is loaded, besides those of the keys.
const COUNTED_TIMES: u32 = 32;
/// Cells with which they are counted; their number goes with the square of the cells.
const COUNTED_CELLS: u32 = 24;
/// Room over what was counted: for times between, and for features smaller than the counted cells.
const SPARE_ROOM: f64 = 1.2;
/// Keys whose times are looked at, too; of more, the rest is left to the even steps.
const COUNTED_KEYS: usize = 128;

/// Balls that move, and the surface around them.
///
/// Host time of a frame of the five balls of `assets/metaballs.ron` (`cargo bench -p manylight-scene --bench metaballs`, one core of a busy
/// machine): 0.2 ms with 16 cells and up to 860 triangles, 0.6 ms with 32 and 3500, 3 ms with 64 and 14,000, 80 ms with 128 and 56,000.
#[derive(Debug, Clone, PartialEq)]
pub struct Metaballs {
    balls: Vec<Track<Ball>>,
    /// Value of the field on the surface; positive.
    level: f64,
    /// Along the longest side of `reach`.
    cells: u32,
    /// Of all triangles.
    material: u32,
    /// Around all balls over all time.
    reach: Bounds,
    /// For the surface at all times, as far as is known.
    room: Room,
}

impl Metaballs {
    /// Balls whose surface is where their field is `level`, which must be positive, in cubes of which `cells` (at least 1, at most
    /// [`MAX_CELLS`]) fit into the longest side of the box around all balls over all time.
    pub fn new(balls: Vec<Track<Ball>>, level: f32, cells: u32, material: u32) -> Self {
        // Between keys, positions and radii are mixed linearly: no ball leaves the boxes of its keys' hull.
        let keys = balls.iter().flat_map(Track::keys);
        let reach = keys.fold(Bounds::EMPTY, |bounds, (_, ball)| bounds.union(ball.bounds()));
        let mut metaballs = Self { balls, level: level.into(), cells: cells.clamp(1, MAX_CELLS), material, reach, room: Room::default() };
        metaballs.room = metaballs.count();
        metaballs
    }

    /// Whether anything ever changes.
    pub fn moves(&self) -> bool {
        self.balls.iter().any(|ball| ball.keys().windows(2).any(|keys| keys[0].1 != keys[1].1))
    }

    /// The times between which each ball changes, and whether it starts again then.
    pub(super) fn spans(&self) -> Vec<(f64, f64, bool)> {
        self.balls.iter().filter_map(Track::span).collect()
    }

    /// A box around all balls over all time, object space.
    pub fn reach(&self) -> Bounds {
        self.reach
    }

    /// Side of a cell, object space.
    pub fn cell(&self) -> f64 {
        self.reach.size().max_element() / f64::from(self.cells)
    }

    /// The balls at a time in seconds.
    pub fn balls(&self, time: f64) -> Vec<Ball> {
        self.balls.iter().map(|ball| ball.at(time)).collect()
    }

    /// What buffers need for the surface at all times: the most of some times, and some more. It may need more between them, and there is
    /// no surface at any of them if it is 0.
    pub fn room(&self) -> Room {
        self.room
    }

    fn count(&self) -> Room {
        if !self.moves() {
            return self.counted(0.0);
        }
        let coarse = Self { cells: self.cells.min(COUNTED_CELLS), ..self.clone() };
        let mut keys: Vec<f64> = self.balls.iter().flat_map(Track::keys).map(|key| key.0).collect();
        keys.sort_by(f64::total_cmp);
        keys.dedup();
        let (first, last) = (keys.first().copied().unwrap_or(0.0), keys.last().copied().unwrap_or(0.0));
        let even = (1..COUNTED_TIMES).map(|i| first + (last - first) * f64::from(i) / f64::from(COUNTED_TIMES));
        let most = keys.iter().take(COUNTED_KEYS).copied().chain(even).fold(Room::default(), |most, time| most.max(coarse.counted(time)));
        let finer = SPARE_ROOM * (f64::from(self.cells) / f64::from(coarse.cells)).powi(2);
        let scaled = |count: usize| (count as f64 * finer).ceil() as usize;
        // That at time 0 is exact, so that a scene fits when it is loaded.
        Room { vertices: scaled(most.vertices), triangles: scaled(most.triangles) }.max(self.counted(0.0))
    }

    fn counted(&self, time: f64) -> Room {
        let (vertices, triangles) = self.surface(time);
        Room { vertices: vertices.len(), triangles: triangles.len() }
    }

    /// Field of some balls at a place, and its gradient.
    pub fn field(balls: &[Ball], place: DVec3) -> (f64, DVec3) {
        let (mut value, mut gradient) = (0.0, DVec3::ZERO);
        for ball in balls {
            let offset = place - ball.position.as_dvec3();
            let square = f64::from(ball.radius).powi(2);
            let rest = 1.0 - offset.length_squared() / square;
            // Not so for a ball of radius 0: the quotient is infinite or not a number.
            if rest > 0.0 {
                let strength = f64::from(ball.strength);
                value += strength * rest.powi(3);
                gradient += offset * (-6.0 * strength * rest * rest / square);
            }
        }
        (value, gradient)
    }

    /// The surface at a time: closed, corners counter-clockwise seen from outside, normals from the field's gradient. Empty where the field
    /// is below the level at all corners of cells.
    pub fn surface(&self, time: f64) -> (Vec<Vertex>, Vec<MeshTriangle>) {
        let balls = self.balls(time);
        let Some(grid) = Grid::around(&balls, &self.reach, self.cell()) else { return Default::default() };
        let shape = RuntimeShape::<u32, 3>::new(grid.points);
        let mut net = SurfaceNetsBuffer::default();
        surface_nets(&grid.values(&balls, self.level, &shape), &shape, [0; 3], grid.points.map(|n| n - 1), &mut net);
        let vertices = net.positions.iter().map(|corner| self.vertex(&balls, grid.place(corner.map(f64::from)))).collect();
        let triangle = |i: &[u32]| MeshTriangle { vertices: [i[0], i[1], i[2]], material: self.material };
        (vertices, net.indices.chunks_exact(3).map(triangle).collect())
    }

    /// A vertex on the surface, near a place that the net gives, which is off by up to some tenths of a cell.
    fn vertex(&self, balls: &[Ball], mut place: DVec3) -> Vertex {
        let longest = LONGEST_STEP * self.cell();
        for _ in 0..STEPS {
            let (value, gradient) = Self::field(balls, place);
            let step = gradient * ((self.level - value) / gradient.length_squared());
            if step.is_finite() {
                place += step.clamp_length_max(longest);
            }
        }
        let (_, gradient) = Self::field(balls, place);
        Vertex { position: place.as_vec3(), u: 0.0, normal: (-gradient).normalize_or_zero().as_vec3(), v: 0.0 }
    }
}

/// Steps of Newton's method along the gradient …
const STEPS: u32 = 2;
/// … none longer than this share of a cell, so that no vertex runs over its neighbours where the field is flat.
const LONGEST_STEP: f64 = 0.25;

/// Lattice points around the balls at one time. They are those of one lattice at all times, so that the triangles do not creep.
struct Grid {
    origin: DVec3,
    cell: f64,
    /// Along each axis.
    points: [u32; 3],
}

/// Lattice points outside of the balls before the first and after the last one along each axis. The net leaves out what lies on the
/// outermost cells.
const MARGIN: i64 = 2;

impl Grid {
    /// `None` if nothing has a size.
    fn around(balls: &[Ball], reach: &Bounds, cell: f64) -> Option<Self> {
        let solid = balls.iter().filter(|ball| ball.radius > 0.0 && ball.strength > 0.0);
        let bounds = solid.fold(Bounds::EMPTY, |bounds, ball| bounds.union(ball.bounds()));
        if bounds.is_empty() || !cell.is_finite() || cell <= 0.0 {
            return None;
        }
        // Rounding may put a ball outside of the reach by any number of cells, where these are tiny beside its coordinates.
        let most = i64::from(MAX_CELLS) + 1;
        let low = ((bounds.min - reach.min) / cell).floor().to_array().map(|i| (i as i64).clamp(0, most) - MARGIN);
        let high = ((bounds.max - reach.min) / cell).ceil().to_array().map(|i| (i as i64).clamp(0, most) + MARGIN);
        let points = std::array::from_fn(|axis| (high[axis] - low[axis] + 1).max(2 * MARGIN + 1) as u32);
        Some(Self { origin: reach.min + cell * DVec3::from_array(low.map(|i| i as f64)), cell, points })
    }

    fn place(&self, point: [f64; 3]) -> DVec3 {
        self.origin + self.cell * DVec3::from_array(point)
    }

    /// 1 − field / level at the points: negative inside.
    fn values(&self, balls: &[Ball], level: f64, shape: &RuntimeShape<u32, 3>) -> Vec<f32> {
        let mut fields = vec![0.0_f64; shape.usize()];
        for ball in balls.iter().filter(|ball| ball.radius > 0.0) {
            let Bounds { min, max } = ball.bounds();
            // The margin stays outside, whatever rounding does: a surface is closed.
            let range = |axis: usize| {
                let last = i64::from(self.points[axis]) - 1 - MARGIN;
                let first = ((min[axis] - self.origin[axis]) / self.cell).ceil() as i64;
                let end = ((max[axis] - self.origin[axis]) / self.cell).floor() as i64;
                first.max(MARGIN)..=end.min(last)
            };
            for z in range(2) {
                for y in range(1) {
                    for x in range(0) {
                        let point = [x, y, z];
                        let index = shape.linearize(point.map(|i| i as u32)) as usize;
                        fields[index] += Metaballs::field(std::slice::from_ref(ball), self.place(point.map(|i| i as f64))).0;
                    }
                }
            }
        }
        // Far beyond the surface only the sign counts; numbers must stay in the range of 32 bits.
        fields.into_iter().map(|field| (1.0 - field / level).clamp(-FARTHEST, FARTHEST) as f32).collect()
    }
}

/// See [`Grid::values`].
const FARTHEST: f64 = 1e12;
