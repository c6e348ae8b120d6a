//! Unit vectors as codes and on the disk, views, and distances between texels and clusters.

use std::f64::consts::PI;

use glam::{DMat3, DVec2, DVec3};
use proptest::strategy::Strategy;

use super::{
    harness::{Case, EXACT, Want, absolute, check, ulps, values, values_of},
    inputs::{Numbers, frame, index, join, magnitude, one_of, real, switch, unit_interval, unit_vector, vector, word},
};

/// All cases of this theme.
pub fn cases() -> Vec<Case> {
    [octahedral(), paraboloid(), rectangles(), views(), others()].into_iter().flatten().collect()
}

fn sign(v: f64) -> f64 {
    if v >= 0.0 { 1.0 } else { -1.0 }
}

pub fn v3(i: &[f64]) -> DVec3 {
    DVec3::from_slice(&i[..3])
}

/// [OCT], section 2: the vector on the octahedron, its lower half folded out.
fn encode(unit: DVec3) -> DVec2 {
    let on_octahedron = unit / (unit.x.abs() + unit.y.abs() + unit.z.abs()).max(f64::MIN_POSITIVE);
    let p = on_octahedron.truncate();
    if unit.z >= 0.0 { p } else { DVec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y)) }
}

fn decode(e: DVec2) -> DVec3 {
    let z = 1.0 - e.x.abs() - e.y.abs();
    let v = if z >= 0.0 { e } else { DVec2::new((1.0 - e.y.abs()) * sign(e.x), (1.0 - e.x.abs()) * sign(e.y)) };
    v.extend(z).normalize()
}

fn octahedral() -> Vec<Case> {
    let step = 32_767.0;
    vec![
        Case::new("octahedral::sign_not_zero", "v: vec2f")
            .gives("vec2f")
            .random(join([real(-1.0, 1.0), real(-1e-30, 1e-30)]))
            .twin(EXACT, |i| values([sign(i[0]), sign(i[1])])),
        Case::new("octahedral::octahedral_encode", "unit: vec3f")
            .gives("vec2f")
            .edges([vec![0.0, 0.0, 0.0], vec![0.0, 0.0, -0.0]])
            .random(unit_vector())
            .twin(ulps(3.0, "a sum, a quotient and a difference of numbers up to 1"), |i| values_of(encode(v3(i)).to_array(), 1.0)),
        Case::new("octahedral::octahedral_decode", "e: vec2f")
            .gives("vec3f")
            .edges(
                [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [1.0, 0.0], [0.0, -1.0], [0.5, 0.5], [-0.5, 0.5]].map(|e| e.to_vec()),
            )
            .random(join([real(-1.0, 1.0), real(-1.0, 1.0)]))
            .twin(ulps(4.0, "a difference of numbers up to 1, then a unit vector"), |i| {
                values_of(decode(DVec2::new(i[0], i[1])).to_array(), 1.0)
            }),
        Case::new("octahedral::pack_unit", "unit: vec3f")
            .also("vec2f", "unpack2x16snorm(pack_unit(unit)) * 32767.0")
            .edges([vec![0.0, 0.0, 0.0]])
            .random(unit_vector())
            .twin(absolute(0.51, "steps of the code, 1/32767: half of one, and the rounding of what is rounded to it"), move |i| {
                let code = step * encode(v3(i));
                let spare = vec![Want::new(-step), Want::new(0.0)];
                let plain: Vec<Want> = values(code.to_array());
                // +z has the spare code; what is next to it may be rounded to it.
                if code.abs().max_element() < 0.49 {
                    spare
                } else if code.abs().max_element() < 0.51 {
                    spare.into_iter().zip(plain).map(|(a, b)| Want::OneOf(vec![a, b])).collect()
                } else {
                    plain
                }
            }),
        Case::new("octahedral::unpack_unit", "code: u32")
            .imports("octahedral::pack_unit")
            .gives("vec3f")
            .also("vec3f", "unpack_unit(pack_unit(unpack_unit(code)))")
            .edges([0_u32, 0x8000, 1, 0x7fff_7fff, 0x8001_8001, 0x8000_8000, 0x8000_0000].map(|code| vec![f64::from(code)]))
            .random(word())
            .twin(absolute(7e-5, "the second time by way of a code of 16 bits; the first time exact to 4 ulp"), move |i| {
                let code = i[0] as u32;
                let part = |bits: u32| (f64::from(bits as u16 as i16) / step).max(-1.0);
                let v = match code {
                    0 => DVec3::ZERO,
                    0x8000 => DVec3::Z,
                    _ => decode(DVec2::new(part(code), part(code >> 16))),
                };
                let again = if code == 0 { DVec3::Z } else { v };
                let exact = v.to_array().map(|v| Want::Between(v - 3e-7, v + 3e-7));
                exact.into_iter().chain(values(again.to_array())).collect()
            }),
    ]
}

/// Duff et al. 2017, listing 3.
pub fn basis(n: DVec3) -> DMat3 {
    let s = sign(n.z);
    let a = -1.0 / (s + n.z);
    let b = n.x * n.y * a;
    DMat3::from_cols(DVec3::new(1.0 + s * n.x * n.x * a, s * b, -s * n.x), DVec3::new(b, s + n.y * n.y * a, -n.y), n)
}

fn unproject(p: DVec2) -> DVec3 {
    let r2 = p.length_squared();
    (2.0 * p).extend(1.0 - r2) / (1.0 + r2)
}

fn paraboloid() -> Vec<Case> {
    vec![
        Case::new("paraboloid::basis", "normal: vec3f")
            .gives("mat3x3f")
            // Orthonormal and right-handed, whatever the formula.
            .also("mat3x3f", "transpose(basis(normal)) * basis(normal)")
            .also("f32", "determinant(basis(normal))")
            .random(unit_vector())
            .twin(ulps(12.0, "products of components of unit vectors; a quotient by a number between 1 and 2"), |i| {
                let n = v3(i);
                let identity = DMat3::IDENTITY.to_cols_array();
                values_of(basis(n).to_cols_array().into_iter().chain(identity).chain([1.0]), 1.0)
            }),
        Case::new("paraboloid::paraboloid_project", "local: vec3f")
            .gives("vec2f")
            .edges([vec![0.0, 0.0, -1.0], vec![0.0, 0.0, 1.0], vec![1e-4, 0.0, -1.0], vec![1.0, 0.0, 0.0], vec![0.0, 0.0, 0.0]])
            .random(unit_vector())
            .twin(ulps(4.0, "a sum and a quotient; at the antipode bounded"), |i| values([i[0], i[1]].map(|v| v / (1.0 + i[2]).max(1e-6)))),
        Case::new("paraboloid::paraboloid_unproject", "p: vec2f")
            .gives("vec3f")
            .edges([vec![0.0, 0.0], vec![1.0, 0.0], vec![0.0, -1.0], vec![1e4, 1e4], vec![1e-30, 0.0]])
            .random(join([real(-1.5, 1.5), real(-1.5, 1.5)]))
            .twin(ulps(4.0, "a unit vector"), |i| values_of(unproject(DVec2::new(i[0], i[1])).to_array(), 1.0)),
        Case::new("paraboloid::paraboloid_scale", "p: vec2f").gives("f32").random(join([real(-1.5, 1.5), real(-1.5, 1.5)])).twin(
            ulps(3.0, "a sum of squares"),
            |i| {
                // The length of the image of a small arc: the map is stereographic, dr/dθ = 1 / (1 + cos θ).
                let cosine = unproject(DVec2::new(i[0], i[1])).z;
                values([1.0 / (1.0 + cosine)])
            },
        ),
        Case::new("paraboloid::atlas_origin", "map: u32, map_size: u32, maps_per_row: u32")
            .gives("vec2u")
            .random(join([index(4096), one_of(&[16.0, 128.0, 512.0, 100.0]), one_of(&[1.0, 2.0, 8.0, 32.0, 7.0])]))
            .twin(EXACT, |i| values([(i[0] % i[2]) * i[1], (i[0] / i[2]).floor() * i[1]])),
    ]
}

#[derive(Clone, Copy)]
struct Box2 {
    low: DVec2,
    high: DVec2,
}

impl Box2 {
    const EMPTY: Self = Self { low: DVec2::ONE, high: DVec2::NEG_ONE };

    fn with(self, p: DVec2) -> Self {
        Self { low: self.low.min(p), high: self.high.max(p) }
    }

    fn numbers(self) -> [f64; 4] {
        [self.low.x, self.low.y, self.high.x, self.high.y]
    }

    /// With the image of the shorter arc between two directions, by small steps.
    fn with_arc(mut self, a: DVec3, b: DVec3) -> Self {
        const STEPS: u32 = 400;
        let (a, b) = (a.normalize(), b.normalize());
        let across = a.cross(b);
        let angle = across.length().atan2(a.dot(b));
        let ahead = if across.length() > 0.0 { across.cross(a).normalize() } else { DVec3::ZERO };
        for step in 0..=STEPS {
            let (sin, cos) = (angle * f64::from(step) / f64::from(STEPS)).sin_cos();
            let s = cos * a + sin * ahead;
            self = self.with(s.truncate() / (1.0 + s.z));
        }
        self
    }
}

fn upper() -> Numbers {
    (unit_vector(), magnitude(1e-3, 1e4)).prop_map(|(d, l)| vec![d[0] * l[0], d[1] * l[0], d[2].abs() * l[0]]).boxed()
}

fn rectangles() -> Vec<Case> {
    vec![
        Case::new("paraboloid::include", "low: vec2f, high: vec2f, p: vec2f")
            .imports("paraboloid::Rectangle")
            .before("let r = include(Rectangle(low, high), p);")
            .also("vec2f", "r.low")
            .also("vec2f", "r.high")
            .edges([vec![1.0, 1.0, -1.0, -1.0, 0.25, -0.5]])
            .random(join((0..6).map(|_| real(-2.0, 2.0))))
            .twin(EXACT, |i| {
                let r = Box2 { low: DVec2::new(i[0], i[1]), high: DVec2::new(i[2], i[3]) };
                values(r.with(DVec2::new(i[4], i[5])).numbers())
            }),
        Case::new("paraboloid::include_if_between", "p: vec2f, a: vec3f, b: vec3f")
            .imports("paraboloid::Rectangle")
            .before("let r = include_if_between(Rectangle(vec2f(1.0), vec2f(-1.0)), p, a, b, cross(a, b));")
            .also("vec2f", "r.low")
            .also("vec2f", "r.high")
            .random(join([real(-1.0, 1.0), real(-1.0, 1.0), unit_vector(), unit_vector()]))
            .twin(EXACT, |i| {
                let (p, a, b) = (DVec2::new(i[0], i[1]), v3(&i[2..]), v3(&i[5..]));
                let (s, across) = (unproject(p), a.cross(b));
                let margin = a.cross(s).dot(across).min(s.cross(b).dot(across));
                let outside = values(Box2::EMPTY.numbers());
                let inside = values(Box2::EMPTY.with(p).numbers());
                if margin.abs() < 1e-6 {
                    inside.into_iter().zip(outside).map(|(a, b)| Want::OneOf(vec![a, b])).collect()
                } else if margin > 0.0 {
                    inside
                } else {
                    outside
                }
            }),
        Case::new("paraboloid::include_edge", "a: vec3f, b: vec3f")
            .imports("paraboloid::Rectangle")
            .before("let r = include_edge(Rectangle(vec2f(1.0), vec2f(-1.0)), a, b);")
            .also("vec2f", "r.low")
            .also("vec2f", "r.high")
            .edges([
                vec![1.0, 0.0, 0.0, 0.0, 1.0, 0.0],
                vec![1.0, 0.0, 0.0, 1.0, 0.0, 0.0],
                vec![0.0, 0.0, 1.0, 0.0, 0.0, 1.0],
                vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
            ])
            .random(join([upper(), upper()]))
            .twin(
                absolute(6e-4, "an edge that is nearly straight in the disk counts as straight: one part in 2000, as its comment says"),
                |i| {
                    let (a, b) = (v3(i), v3(&i[3..]));
                    // No direction, or no certain plane: finite.
                    if a.length().min(b.length()) == 0.0 || a.angle_between(b) > PI - 0.02 {
                        return vec![Want::finite(); 4];
                    }
                    values(Box2::EMPTY.with_arc(a, b).numbers())
                },
            ),
        Case::new("paraboloid::above_horizon", "a: vec3f, b: vec3f, c: vec3f")
            .before("let r = above_horizon(a, b, c);")
            .also("vec2f", "r.low")
            .also("vec2f", "r.high")
            .edges([
                vec![1.0, 0.0, 1.0, -1.0, 1.0, 1.0, -1.0, -1.0, 1.0],
                vec![1.0, 0.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0],
                vec![1.0, 0.0, 0.0, -1.0, 1.0, 0.0, -1.0, -1.0, 0.0],
                vec![1.0, 0.0, 0.0, -1.0, 1.0, 0.0, -1.0, -1.0, -2.0],
                // A wall that stands on the horizon, and one that has a corner there and goes down.
                vec![1.0, -1.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 2.0],
                vec![1.0, -2.0, 0.0, 1.0, 2.0, 1.0, 1.0, 2.0, -2.0],
                vec![1.0, -2.0, 0.0, 1.0, 2.0, -1.0, 1.0, 2.0, 2.0],
                vec![1.0, -2.0, -1.0, 1.0, 2.0, 0.0, 1.0, -2.0, 2.0],
                vec![1.0, 0.5, 1.0, 1.0, 0.5, 1.0, 1.0, 0.5, 1.0],
                vec![0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 1.0, 1.0],
            ])
            .random(join((0..3).map(|_| vector(1e-1, 1e2))))
            .twin(absolute(7e-4, "two edges of one part in 2000 each, and the horizon's own points"), above_horizon),
    ]
}

/// The rectangle around the clipped triangle's outline.
fn above_horizon(i: &[f64]) -> Vec<Want> {
    let corners = [v3(i), v3(&i[3..]), v3(&i[6..])];
    if corners.iter().all(|p| p.z <= 0.0) {
        return values(Box2::EMPTY.numbers());
    }
    let mut outline = Vec::new();
    let mut is_certain = true;
    for (p, q) in [(0, 1), (1, 2), (2, 0)].map(|(p, q)| (corners[p], corners[q])) {
        // Close to the eye directions are lost.
        let along = (q - p).normalize_or_zero();
        let nearest = p - along * p.dot(along).clamp(-(q - p).length(), 0.0);
        is_certain &= nearest.length() > 1e-3 * p.length().max(q.length());
        if p.z >= 0.0 {
            outline.push(p);
        }
        if (p.z > 0.0 && q.z < 0.0) || (p.z < 0.0 && q.z > 0.0) {
            let meet = p + (q - p) * (p.z / (p.z - q.z));
            outline.push(meet.truncate().extend(0.0));
        }
    }
    let on_horizon: Vec<DVec3> = outline.iter().copied().filter(|p| p.z == 0.0).collect();
    let is_half = on_horizon.iter().any(|a| on_horizon.iter().any(|b| a.dot(*b) < -0.98 * a.length() * b.length()));
    if !is_certain || outline.iter().any(|p| p.length() == 0.0) {
        return vec![Want::Between(-1.01, 1.01); 4];
    }
    let mut r = Box2::EMPTY;
    let mut has_short = false;
    for (n, p) in outline.iter().enumerate() {
        let next = outline[(n + 1) % outline.len()];
        has_short |= p != &next && p.angle_between(next) < 1e-4;
        r = r.with_arc(*p, next);
    }
    if is_half || has_short {
        // Rounding decides on which side of the eye the horizon lies, or whether a short edge has a point that is outermost: the whole circle is allowed.
        let [x, y, z, w] = r.numbers();
        let slack = 7e-4;
        return vec![
            Want::Between(-1.0 - slack, x + slack),
            Want::Between(-1.0 - slack, y + slack),
            Want::Between(z - slack, 1.0 + slack),
            Want::Between(w - slack, 1.0 + slack),
        ];
    }
    values(r.numbers())
}

/// Makes a view of the arguments that `view_arguments` draws.
pub const VIEW: &str = "origin: vec3f, right: vec3f, up: vec3f, forward: vec3f, tan_x: f32, tan_y: f32";

pub struct View {
    pub origin: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    pub forward: DVec3,
    pub tan_x: f64,
    pub tan_y: f64,
}

impl View {
    pub fn of(i: &[f64]) -> Self {
        Self { origin: v3(i), right: v3(&i[3..]), up: v3(&i[6..]), forward: v3(&i[9..]), tan_x: i[12], tan_y: i[13] }
    }

    pub fn ray(&self, u: f64, v: f64) -> DVec3 {
        (self.forward + self.right * ((2.0 * u - 1.0) * self.tan_x) + self.up * ((1.0 - 2.0 * v) * self.tan_y)).normalize()
    }

    /// Where a position is seen, with the error that the rounding of its offset's three coordinates makes.
    pub fn uv(&self, position: DVec3) -> Vec<Want> {
        let v = position - self.origin;
        let (x, y, z) = (v.dot(self.right), v.dot(self.up), v.dot(self.forward));
        // No direction: rounding decides how far it is.
        if z.abs() <= 1e-5 * v.length() {
            return vec![Want::finite(), Want::finite(), Want::of(z, v.length())];
        }
        let seen = |side: f64, tan: f64, sign: f64| {
            let spread = 0.5 * v.length() / (tan * z.abs()) * (1.0 + side.abs() / z.abs());
            Want::of(0.5 + sign * 0.5 * side / (tan * z), spread)
        };
        vec![seen(x, self.tan_x, 1.0), seen(y, self.tan_y, -1.0), Want::of(z, v.length())]
    }
}

/// Cameras between 1° and 170°, anywhere in scenes of any scale.
fn view_arguments() -> Numbers {
    join([vector(1e-3, 1e4), frame(), magnitude(0.0087, 11.43), magnitude(0.0087, 11.43)])
}

const MAKE_VIEW: &str = "let view = View(mat4x4f(), origin, 0.01, right, tan_x, up, tan_y, forward, 100.0);";

fn views() -> Vec<Case> {
    let case = |function, takes: &str| {
        let takes: &'static str = String::leak(format!("{VIEW}{takes}"));
        Case::new(function, takes).imports("scene::View").before(MAKE_VIEW)
    };
    vec![
        case("view::ray_direction", ", uv: vec2f")
            .also("vec3f", "ray_direction(view, uv)")
            .random(join([view_arguments(), real(0.0, 1.0), real(0.0, 1.0)]))
            .twin(ulps(5.0, "a unit vector from three"), |i| values_of(View::of(i).ray(i[14], i[15]).to_array(), 1.0)),
        case("view::pixel_direction", ", pixel: vec2u, size: vec2u")
            .also("vec3f", "pixel_direction(view, pixel, size)")
            .random(pixels())
            .twin(ulps(5.0, "a unit vector from three"), |i| {
                values_of(View::of(i).ray((i[14] + 0.5) / i[16], (i[15] + 0.5) / i[17]).to_array(), 1.0)
            }),
        case("view::view_uv", ", position: vec3f")
            .also("vec3f", "view_uv(view, position)")
            .random(join([view_arguments(), vector(1e-3, 1e4)]))
            .random(positions_ahead())
            .twin(
                ulps(
                    6.0,
                    "of what the offset from the eye makes in the picture: far from the axis and near the eye's plane it is stretched",
                ),
                |i| View::of(i).uv(v3(&i[14..])),
            ),
        case("view::pixel_solid_angle", ", pixel: vec2u, size: vec2u")
            .also("f32", "pixel_solid_angle(view, pixel, size)")
            .random(pixels())
            .twin(ulps(60.0, "the cube of a cosine down to 0.06 at the corners of a field of 170°"), |i| {
                let view = View::of(i);
                let (dx, dy) = (2.0 * view.tan_x / i[16], 2.0 * view.tan_y / i[17]);
                let (x, y) = ((2.0 * (i[14] + 0.5) / i[16] - 1.0) * view.tan_x, (1.0 - 2.0 * (i[15] + 0.5) / i[17]) * view.tan_y);
                // Area over distance² times the cosine: 1 / (1 + x² + y²)^(3/2).
                values([dx * dy * (1.0 + x * x + y * y).powf(-1.5)])
            }),
    ]
}

/// A view, a pixel and the size of the picture.
fn pixels() -> Numbers {
    let pixel = (1_u32..=4096, 1_u32..=4096)
        .prop_flat_map(|(w, h)| (0..w, 0..h).prop_map(move |(x, y)| [x, y, w, h].map(f64::from).to_vec()))
        .boxed();
    join([view_arguments(), pixel])
}

/// A view and a position at a given depth, around the axis.
fn positions_ahead() -> Numbers {
    (view_arguments(), -1.5..1.5_f64, -1.5..1.5_f64, magnitude(1e-3, 1e4))
        .prop_map(|(mut i, x, y, z)| {
            let view = View::of(&i);
            let position = view.origin + z[0] * (view.forward + x * view.tan_x * view.right + y * view.tan_y * view.up);
            i.extend(position.to_array());
            i
        })
        .boxed()
}

fn others() -> Vec<Case> {
    vec![
        Case::new("disk::next_direction", "turns: u32")
            .imports("disk::FIRST_DIRECTION")
            .before("var d = FIRST_DIRECTION; for (var i = 0u; i < turns; i++) { d = next_direction(d); }")
            .also("vec2f", "d")
            .edges((0..16).map(|i| vec![f64::from(i)]))
            .twin(ulps(16.0, "one rotation's rounding for each of up to fifteen"), |i| {
                let angle = i[0] * PI * (3.0 - 5.0_f64.sqrt());
                values_of([angle.cos(), angle.sin()], 1.0)
            }),
        Case::new("disk::tap_radius", "tap: u32")
            .gives("f32")
            .edges((0..16).map(|i| vec![f64::from(i)]))
            .twin(ulps(2.0, "a square root"), |i| values([((i[0] + 0.5) / 16.0).sqrt()])),
        Case::new(
            "metric::cluster_distance",
            "position: f32, normal: f32, quality: f32, diagonal: f32, signed_normals: bool, p: vec3f, n: vec3f, q: vec3f, k: vec3f, difference: f32",
        )
        .imports("metric::Metric")
        .before("let m = Metric(position, normal, quality, diagonal, signed_normals);")
        .also("f32", "cluster_distance(m, p, n, q, k, difference)")
        .random(join([
            real(0.0, 1.0),
            real(0.0, 1.0),
            real(0.0, 1.0),
            magnitude(1e-3, 1e4),
            switch(),
            vector(1e-3, 1e4),
            unit_vector(),
            vector(1e-3, 1e4),
            unit_vector(),
            unit_interval(),
        ]))
        .twin(ulps(4.0, "a sum of three terms, each of 0 or more"), |i| {
            // [ACRSM] eq. 4.4
            let (p, n, q, k) = (v3(&i[5..]), v3(&i[8..]), v3(&i[11..]), v3(&i[14..]));
            let cosine = if i[4] > 0.0 { n.dot(k) } else { n.dot(k).abs() };
            let terms = [i[0] * p.distance(q) / i[3], i[1] * (1.0 - cosine), i[2] * i[17]];
            vec![Want::of(terms.iter().sum(), terms[0] + i[1] + terms[2])]
        }),
    ]
}

#[test]
fn directions_are_as_their_twins() {
    check(cases());
}
