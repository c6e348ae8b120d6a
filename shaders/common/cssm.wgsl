// Convolution soft shadow maps: the comparison with a depth as a Fourier series whose terms can be averaged over a region before it is made.
// [CV] 4.1, 4.2; [CSM] (Annen et al. 2007); [CSSM] (Annen et al. 2008).
//   f(d, z) = 1 if d ≤ z, else 0 ≈ 1/2 + Σ 2/c_k (cos(c_k d) sin(c_k z) − sin(c_k d) cos(c_k z)), c_k = (2k − 1) π, k = 1 … M

#import common::paraboloid::atlas_origin
#import common::radiometry::PI
#import common::scene::SceneInfo

// Distance that counts as depth 1: to the farthest corner of the scene's bounds. The series resolves 1/(2M) of it.
fn depth_range(eye: vec3f, info: SceneInfo) -> f32 {
    return max(length(max(abs(info.bounds_min - eye), abs(info.bounds_max - eye))), 1e-30);
}

// Atlases of two terms each that hold M of them.
fn slabs_of(terms: u32) -> u32 {
    return (terms + 1u) / 2u;
}

// Multiplies two numbers of the complex plane.
fn turn(a: vec2f, b: vec2f) -> vec2f {
    return vec2f(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// Where a look-up reads: the middle of a square region of a map, in a texture of atlases below each other.
struct Region {
    texel: vec2f, // in the first atlas
    level: f32,
}

// A square of `width` texels (a real number) around `texel` of a map; kept within the map, and its level within those that hold no other map.
fn region(map: u32, texel: vec2f, width: f32, map_size: u32, maps_per_row: u32) -> Region {
    let last = f32(countTrailingZeros(map_size));
    let level = clamp(log2(max(width, 1.0)), 0.0, last);
    let margin = 0.5 * exp2(ceil(level));
    let kept = clamp(texel, vec2f(margin), vec2f(f32(map_size) - margin));
    return Region(vec2f(atlas_origin(map, map_size, maps_per_row)) + kept, level);
}

fn fetch(cssm: texture_2d<f32>, filtering: sampler, r: Region, slab: u32, atlas_height: u32) -> vec4f {
    let size = vec2f(textureDimensions(cssm));
    return textureSampleLevel(cssm, filtering, (r.texel + vec2f(0.0, f32(slab * atlas_height))) / size, r.level);
}

// The series at depth `d`, with the averages from slab `first` on in place of sin(c_k z), cos(c_k z); without its constant term.
fn series(cssm: texture_2d<f32>, filtering: sampler, r: Region, first: u32, atlas_height: u32, terms: u32, d: f32) -> f32 {
    var wave = vec2f(cos(PI * d), sin(PI * d)); // e^(i c_k d)
    let step = turn(wave, wave);
    var sum = 0.0;
    for (var slab = 0u; slab < slabs_of(terms); slab++) {
        let basis = fetch(cssm, filtering, r, first + slab, atlas_height);
        let c = f32(4u * slab + 1u) * PI;
        sum += 2.0 / c * (wave.x * basis.x - wave.y * basis.y);
        wave = turn(wave, step);
        sum += 2.0 / (c + 2.0 * PI) * (wave.x * basis.z - wave.y * basis.w);
        wave = turn(wave, step);
    }
    return sum;
}

// Value of the series for a surface that lies `margin` behind the depth compared.
fn series_value(margin: f32, terms: u32) -> f32 {
    var wave = vec2f(cos(PI * margin), sin(PI * margin));
    let step = turn(wave, wave);
    var sum = 0.5;
    for (var k = 1u; k <= terms; k++) {
        sum += 2.0 / (f32(2u * k - 1u) * PI) * wave.y;
        wave = turn(wave, step);
    }
    return sum;
}
