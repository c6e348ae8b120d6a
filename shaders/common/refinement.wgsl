// What is lit at half resolution, and what is not. [SOI] 3.5.

// Values of a map of columns that are none.
const INTERPOLATED: u32 = 0xffffffffu;
const NO_SURFACE: u32 = 0xfffffffeu;

// The statistic of a picture.
struct Refinement {
    pixels: u32, // that show a surface
    refined: u32, // of these, lit on their own because they differ from their neighbours
    low_resolution: f32, // share of the others, 0 to 1; 1 where there is no surface at all
}
