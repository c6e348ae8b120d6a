// Interleaved sampling: tile (i, j) of the split picture holds the pixels (x n + i, y n + j). [ACRSM] 5.1.4, 5.3.3, [IIR]

// Pixel of the picture for a texel of the split picture whose tiles are `tile` texels large; may lie outside when the size is no multiple of n.
fn pixel_of_split(split: vec2u, tile: vec2u, n: u32) -> vec2u {
    return (split % tile) * n + split / tile;
}

// The other way round.
fn split_of_pixel(pixel: vec2u, tile: vec2u, n: u32) -> vec2u {
    return (pixel % n) * tile + pixel / n;
}

// Lights are dealt to the n² tiles in turn: light c belongs to tile c mod n². A tile's lights should be a run of a low-discrepancy sequence: taken in
// turn, they would be all in one stripe, because every 9th point of a sequence in base 3 has the same first two digits.

// Which point of the sequence light `c` of `count` is.
fn point_of_light(c: u32, count: u32, n: u32) -> u32 {
    let period = n * n;
    let tile = c % period;
    return tile * (count / period) + min(tile, count % period) + c / period;
}

// The other way round: the light for a point.
fn light_of_point(point: u32, count: u32, n: u32) -> u32 {
    let period = n * n;
    let least = count / period;
    let longer = count % period; // so many tiles have one light more, the first
    let split = longer * (least + 1u);
    if point < split {
        return point % (least + 1u) * period + point / (least + 1u);
    }
    // Not reached with `least` 0, as `split` is `count` then.
    let rest = point - split;
    return rest % max(least, 1u) * period + longer + rest / max(least, 1u);
}
