// Unit vectors as two 16-bit signed normalised numbers in a u32. [OCT]
// Zero stands for "no vector": the code of +z is (0, 0), so a set bit marks it instead (see `pack_unit`).

fn sign_not_zero(v: vec2f) -> vec2f {
    return select(vec2f(-1.0), vec2f(1.0), v >= vec2f(0.0));
}

// Unit vector to the square [-1, 1]². Zero, which has no direction, becomes that of +z.
fn octahedral_encode(unit: vec3f) -> vec2f {
    let p = unit.xy / max(abs(unit.x) + abs(unit.y) + abs(unit.z), 1e-37);
    return select((1.0 - abs(p.yx)) * sign_not_zero(p), p, unit.z >= 0.0);
}

fn octahedral_decode(e: vec2f) -> vec3f {
    var v = vec3f(e, 1.0 - abs(e.x) - abs(e.y));
    let fold = max(-v.z, 0.0);
    v = vec3f(v.xy - sign_not_zero(v.xy) * fold, v.z);
    return normalize(v);
}

// snorm16 has two codes for -1; the spare one (-32768) stands in for 0 in the first component, so that +z is not "none".
const SPARE_CODE: u32 = 0x8000u;

fn pack_unit(unit: vec3f) -> u32 {
    let code = pack2x16snorm(octahedral_encode(unit));
    return select(code, SPARE_CODE, code == 0u);
}

// The vector of a code, or zero for "none".
fn unpack_unit(code: u32) -> vec3f {
    if code == 0u {
        return vec3f(0.0);
    }
    return octahedral_decode(unpack2x16snorm(select(code, 0u, code == SPARE_CODE)));
}
