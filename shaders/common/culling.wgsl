// Which lights a block of pixels meets, as bits, and what leaving out the others can cost.

// Of a block.
struct BlockLoss {
    lights: u32, // of its tile
    unreachable: u32, // of these, those that can give it nothing
    culled: u32, // those that could give it something, and are left out
    lost: f32, // at most, of the irradiance of each pixel, W/m²
    least: f32, // irradiance without shadows that each pixel gets for certain, W/m²
}

// Of a picture.
struct Culled {
    lights: u32, // over all blocks with a surface, those of its tile
    unreachable: u32, // of these, those that can give it nothing
    culled: u32, // those that could give it something, and are left out
    pixels: u32, // with a surface
    largest_loss: f32, // largest share of its unshadowed light that a pixel can have lost
    mean_loss: f32, // mean of that over the pixels
}

// Light c belongs to tile c mod n²: lights of tile `tile` of `period` = n².
fn lights_of_tile(tile: u32, count: u32, period: u32) -> u32 {
    return (count + period - 1u - tile) / period;
}

// Words of 32 bits for the lights of a tile.
fn words_of_tile(count: u32, period: u32) -> u32 {
    return (lights_of_tile(0u, count, period) + 31u) / 32u;
}

// Those of word `word` that stand for a light: all that a block of `lights` lights has without culling.
fn full_word(word: u32, lights: u32) -> u32 {
    let rest = lights - min(lights, 32u * word);
    return select((1u << (rest % 32u)) - 1u, 0xffffffffu, rest >= 32u);
}
