// Sixteen points of the unit disk, Poisson-like: least distance between two of them 0.40, mean at the centre. [ACRSM] 5.3.3
// (the paper asks for a static kernel of 16 Poisson-disk samples and gives no table).

const POISSON_16 = array<vec2f, 16>(
    vec2f(0.87488, -0.01891),
    vec2f(-0.92018, 0.08436),
    vec2f(-0.21435, -0.62233),
    vec2f(0.42301, 0.89176),
    vec2f(-0.03889, 0.29742),
    vec2f(0.49461, -0.74895),
    vec2f(-0.81480, 0.57974),
    vec2f(-0.20062, 0.88861),
    vec2f(0.74859, 0.53214),
    vec2f(0.11532, -0.27415),
    vec2f(-0.85975, -0.45747),
    vec2f(0.43952, 0.08604),
    vec2f(0.03684, -0.98527),
    vec2f(-0.32521, -0.14761),
    vec2f(-0.50782, 0.29760),
    vec2f(0.74885, -0.40298),
);
