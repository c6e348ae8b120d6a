// Sixteen taps over the unit disk as a golden-angle spiral (Vogel 1979): equal areas, no two taps near each other.
// Stands in for the papers' static table of 16 Poisson-disk samples ([ACRSM] 5.3.3, which prints none): computed from tap to tap, because
// a table indexed by a variable costs a copy of it per access on some drivers (on llvmpipe two fifths of the time of soft shadows).

const TAPS: u32 = 16u;

// Cosine and sine of the golden angle, π (3 − √5).
const GOLDEN_COS: f32 = -0.73736887807832;
const GOLDEN_SIN: f32 = 0.67549029426152;

// Direction of the first tap.
const FIRST_DIRECTION = vec2f(1.0, 0.0);

fn next_direction(d: vec2f) -> vec2f {
    return vec2f(d.x * GOLDEN_COS - d.y * GOLDEN_SIN, d.x * GOLDEN_SIN + d.y * GOLDEN_COS);
}

// Distance of a tap from the centre.
fn tap_radius(tap: u32) -> f32 {
    return sqrt((f32(tap) + 0.5) / f32(TAPS));
}
