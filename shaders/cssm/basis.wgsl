// Basis images of convolution soft shadow maps, and their mip maps. [CV] 4.1 and 6.
// What bounds it: writing 2M + 1 values of 16 bits a texel.

#import common::cluster::Cluster
#import common::cssm::{depth_range, slabs_of, turn}
#import common::radiometry::PI
#import common::scene::SceneInfo

struct Params {
    terms: u32,
    ism_size: u32,
}

@group(0) @binding(0) var ism: texture_2d<f32>;
@group(0) @binding(1) var<storage, read> casters: array<Cluster>;
@group(0) @binding(2) var<uniform> scene_info: SceneInfo;
@group(0) @binding(3) var<uniform> params: Params;
@group(0) @binding(4) var cssm: texture_storage_2d<rgba16float, write>;
@group(0) @binding(5) var cssm_finer: texture_2d<f32>;

override basis_bits_is_8: bool;

// [−1, 1] in 256 steps, as a texture of 8 bits would hold it.
fn rounded(v: vec4f) -> vec4f {
    return select(v, round((0.5 + 0.5 * v) * 255.0) * (2.0 / 255.0) - 1.0, basis_bits_is_8);
}

@compute @workgroup_size(8, 8)
fn expand(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(ism);
    if any(id.xy >= size) {
        return;
    }
    let maps_per_row = size.x / params.ism_size;
    let map = min(id.y / params.ism_size * maps_per_row + id.x / params.ism_size, arrayLength(&casters) - 1u);
    let z = saturate(textureLoad(ism, id.xy, 0).x * scene_info.diagonal / depth_range(casters[map].position, scene_info));
    var wave = vec2f(cos(PI * z), sin(PI * z)); // e^(i c_k z)
    let step = turn(wave, wave);
    let slabs = slabs_of(params.terms);
    for (var slab = 0u; slab < slabs; slab++) {
        let next = turn(wave, step);
        // The last of an odd number of terms has no partner.
        let partner = select(vec2f(0.0), next.yx, 2u * slab + 2u <= params.terms);
        let basis = vec4f(wave.yx, partner);
        textureStore(cssm, id.xy + vec2u(0u, slab * size.y), rounded(basis));
        textureStore(cssm, id.xy + vec2u(0u, (slabs + slab) * size.y), basis * z);
        wave = turn(next, step);
    }
    textureStore(cssm, id.xy + vec2u(0u, 2u * slabs * size.y), vec4f(z, 0.0, 0.0, 0.0));
}

@compute @workgroup_size(8, 8)
fn halve(@builtin(global_invocation_id) id: vec3u) {
    if any(id.xy >= textureDimensions(cssm)) {
        return;
    }
    let p = 2u * id.xy;
    let sum = textureLoad(cssm_finer, p, 0) + textureLoad(cssm_finer, p + vec2u(1u, 0u), 0)
        + textureLoad(cssm_finer, p + vec2u(0u, 1u), 0) + textureLoad(cssm_finer, p + vec2u(1u, 1u), 0);
    let mean = 0.25 * sum;
    // Only the basis itself has 8 bits.
    let is_basis = p.y < textureDimensions(cssm_finer).y * slabs_of(params.terms) / (2u * slabs_of(params.terms) + 1u);
    textureStore(cssm, id.xy, select(mean, rounded(mean), is_basis));
}
