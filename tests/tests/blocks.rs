//! Noisy pictures compared block by block: with few paths a single pixel is far from normally distributed, a block is not.

/// Blocks of this many pixels a side are compared: the mean over a block is near to normally distributed also where single paths are
/// rarely bright, which a z-test needs.
const BLOCK: u32 = 8;

/// Mean and standard error.
pub type Block = ([f64; 3], [f64; 3]);

/// Means and standard errors of blocks; pixels are independent.
pub fn blocks(size: u32, value: impl Fn(u32, u32) -> [f64; 3], error: impl Fn(u32, u32) -> [f64; 3]) -> Vec<Block> {
    let mut blocks = Vec::new();
    for by in 0..size / BLOCK {
        for bx in 0..size / BLOCK {
            let (mut sum, mut variance) = ([0.0; 3], [0.0; 3]);
            for y in by * BLOCK..(by + 1) * BLOCK {
                for x in bx * BLOCK..(bx + 1) * BLOCK {
                    let (v, e) = (value(x, y), error(x, y));
                    for i in 0..3 {
                        sum[i] += v[i];
                        variance[i] += e[i] * e[i];
                    }
                }
            }
            let n = f64::from(BLOCK * BLOCK);
            blocks.push((sum.map(|s| s / n), variance.map(|v| v.sqrt() / n)));
        }
    }
    blocks
}

/// Share of blocks and channels whose difference is beyond four standard errors (normal: 6 in 100,000), and the ratio of the means.
pub fn compare(mine: &[Block], theirs: &[Block]) -> (f64, f64) {
    let total = |blocks: &[Block]| blocks.iter().flat_map(|(mean, _)| *mean).sum::<f64>();
    let ratio = total(mine) / total(theirs);
    // Rounding of f32 sums and of the references' half-float errors.
    let floor = 1e-4 * total(theirs) / (3 * theirs.len()) as f64;
    let mut beyond = 0;
    for (a, b) in mine.iter().zip(theirs) {
        for i in 0..3 {
            let deviation = (a.1[i].powi(2) + b.1[i].powi(2) + floor * floor).sqrt();
            beyond += usize::from((a.0[i] - b.0[i]).abs() > 4.0 * deviation);
        }
    }
    (beyond as f64 / (3 * mine.len()) as f64, ratio)
}
