// Looks for numbers that are none, are infinite, or lie beyond what a port promises. The bits are looked at, because a comparison with
// NaN may be compiled to anything.

const NAN: u32 = 0u;
const INFINITE: u32 = 1u;
const LOW: u32 = 2u;
const HIGH: u32 = 3u;

struct Scan {
    level: u32, // of the texture
    layer: u32,
    numbers: u32, // a texel or an element
    count: u32, // words of the buffer
    least: f32,
    greatest: f32,
    bounds: u32, // 1: `least` holds, 2: `greatest` holds
    record: u32, // where in `findings`
}

struct Finding {
    count: array<atomic<u32>, 4>,
    first: array<atomic<u32>, 4>,
}

@group(0) @binding(0) var<uniform> scan: Scan;
@group(0) @binding(1) var<storage, read_write> findings: array<Finding>;
@group(0) @binding(2) var image: texture_2d_array<f32>;
@group(0) @binding(3) var<storage, read> words: array<u32>;
@group(0) @binding(4) var<storage, read> is_float: array<u32>; // of each word of an element

fn note(what: u32, place: u32) {
    atomicAdd(&findings[scan.record].count[what], 1u);
    atomicMin(&findings[scan.record].first[what], place);
}

fn look_at(bits: u32, place: u32) {
    let magnitude = bits & 0x7fffffffu;
    if magnitude > 0x7f800000u {
        note(NAN, place);
    } else if magnitude == 0x7f800000u {
        note(INFINITE, place);
    } else if (scan.bounds & 1u) != 0u && bitcast<f32>(bits) < scan.least {
        note(LOW, place);
    } else if (scan.bounds & 2u) != 0u && bitcast<f32>(bits) > scan.greatest {
        note(HIGH, place);
    }
}

@compute @workgroup_size(8, 8)
fn look_at_texels(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(image, scan.level);
    if any(id.xy >= size) {
        return;
    }
    let texel = bitcast<vec4u>(textureLoad(image, id.xy, scan.layer, scan.level));
    for (var i = 0u; i < scan.numbers; i++) {
        look_at(texel[i], (id.y * size.x + id.x) * scan.numbers + i);
    }
}

@compute @workgroup_size(64)
fn look_at_words(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.x; i < scan.count; i += groups.x * 64u) {
        if is_float[i % scan.numbers] != 0u {
            look_at(words[i], i);
        }
    }
}
