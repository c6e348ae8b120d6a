// Interleaved sampling: tile (i, j) of the split picture holds the pixels (x n + i, y n + j). [ACRSM] 5.1.4, 5.3.3, [IIR]

// Pixel of the picture for a texel of the split picture whose tiles are `tile` texels large; may lie outside when the size is no multiple of n.
fn pixel_of_split(split: vec2u, tile: vec2u, n: u32) -> vec2u {
    return (split % tile) * n + split / tile;
}

// The other way round.
fn split_of_pixel(pixel: vec2u, tile: vec2u, n: u32) -> vec2u {
    return (pixel % n) * tile + pixel / n;
}
