// 8×8 blocks of a split picture, each within one of its n×n tiles: their pixels are near each other, n pixels apart, and meet the same lights.

// Side of a block in texels, and of the workgroups that light it.
const BLOCK: u32 = 8u;

// Blocks across and down a tile of `tile` texels.
fn blocks_of_tile(tile: vec2u) -> vec2u {
    return (tile + BLOCK - 1u) / BLOCK;
}

// Place of block `index` in the split picture: its tile (one of n²), and the block in it.
struct BlockPlace {
    tile: u32,
    within: vec2u, // first texel in the tile
}

fn place_of_block(index: u32, tile: vec2u) -> BlockPlace {
    let blocks = blocks_of_tile(tile);
    let count = blocks.x * blocks.y;
    let rest = index % count;
    return BlockPlace(index / count, BLOCK * vec2u(rest % blocks.x, rest / blocks.x));
}

// First texel of tile `index` in the split picture.
fn corner_of_tile(index: u32, tile: vec2u, n: u32) -> vec2u {
    return vec2u(index % n, index / n) * tile;
}
