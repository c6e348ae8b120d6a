//! From components to the file's numbers.

use half::f16;
use manylight_passes::baked::{Baked, CORNERS, Header, Lookup, NOWHERE};

use super::{Pca, pca};
use crate::files::Picture;

/// How many components are kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Keep {
    /// So many.
    Components(usize),
    /// So many that they hold this share of the variance.
    Variance(f64),
}

impl Keep {
    /// Their number.
    pub fn of(self, pca: &Pca) -> usize {
        match self {
            Self::Components(count) => count.min(pca.components.len()),
            Self::Variance(share) => pca.components_for(share),
        }
    }
}

/// Everything that is put into a file besides the components.
#[derive(Debug, Clone)]
pub struct Parts<'a> {
    /// Times of all key frames, increasing.
    pub keys: &'a [f64],
    /// For each key frame its index among the lit ones, from which the components are; `None` for a dark one.
    pub lit: &'a [Option<usize>],
    /// Light of the sky by day.
    pub sky: &'a Picture,
    /// With the look-ups `image` and `cube`: distances from the camera; 0 where there is no surface.
    pub distance: Option<&'a Picture>,
    /// With the look-up `atlas`: where the corners of triangles are, as in [`Baked`].
    pub corners: &'a [[f32; 2]],
    /// All of the header that the rest does not say.
    pub header: Header,
}

/// A layer between −1 and 1, so that half floats have their precision, and what it is multiplied with.
fn normalised(values: &[f32]) -> (Vec<f16>, f32) {
    let largest = values.iter().fold(0.0_f32, |largest, v| largest.max(v.abs()));
    let scale = if largest > 0.0 { largest } else { 1.0 };
    let rgb = values.chunks_exact(3);
    (rgb.flat_map(|v| [v[0] / scale, v[1] / scale, v[2] / scale, 0.0]).map(f16::from_f32).collect(), scale)
}

/// The file's contents.
pub fn encode(pca: &pca::Pca, keep: Keep, parts: Parts<'_>) -> Baked {
    let count = keep.of(pca);
    let (mut texels, mean_scale) = normalised(&pca.mean);
    for (texel, distance) in texels.chunks_exact_mut(4).zip(parts.distance.iter().flat_map(|distance| &distance.data)) {
        texel[3] = f16::from_f32(if *distance > 0.0 { distance.log2() } else { NOWHERE });
    }
    let mut scales = Vec::with_capacity(count);
    for component in pca.components.iter().take(count) {
        let (layer, scale) = normalised(component);
        texels.extend(layer);
        scales.push(scale);
    }
    let (layer, sky_scale) = normalised(&parts.sky.data);
    texels.extend(layer);
    let row = |lit: &Option<usize>| -> Vec<f32> {
        let Some(index) = lit else { return vec![0.0; count + 1] };
        let weights = pca.weights[*index].iter().zip(&scales).map(|(weight, scale)| (weight * f64::from(*scale)) as f32);
        [mean_scale].into_iter().chain(weights).collect()
    };
    let header = Header {
        width: parts.sky.width,
        height: parts.sky.height,
        triangles: parts.corners.len() / CORNERS,
        components: count,
        keys: parts.keys.to_vec(),
        kept_variance: pca.kept[..count].to_vec(),
        dark_keys: parts.lit.iter().filter(|lit| lit.is_none()).count(),
        sky_scale,
        ..parts.header
    };
    Baked { header, weights: parts.lit.iter().flat_map(row).collect(), texels, corners: parts.corners.to_vec() }
}

/// Light as a shader puts it together, on the host: RGB, without the sky.
pub fn decode(baked: &Baked, time: f64) -> Picture {
    let header = &baked.header;
    let weights = baked.weights_at(time, 0.0);
    let texels = header.width * header.height;
    let mut data = vec![0.0_f32; 3 * texels];
    for (weight, layer) in weights.iter().zip(baked.texels.chunks_exact(4 * texels)) {
        let rgb = layer.chunks_exact(4).flat_map(|texel| &texel[..3]);
        data.iter_mut().zip(rgb).for_each(|(out, v)| *out += weight * v.to_f32());
    }
    data.iter_mut().for_each(|v| *v = v.max(0.0));
    Picture::linear(header.width, header.height, 3, data)
}

/// A header for a file whose other fields [`encode`] fills.
pub fn header(scene: &manylight_scene::Scene, lookup: Lookup, period_s: f64, mean_subtracted: bool, paths: u32) -> Header {
    Header {
        scene: scene.name.clone(),
        scene_hash: manylight_passes::baked::hash_of(scene),
        lookup,
        width: 0,
        height: 0,
        triangles: 0,
        components: 0,
        keys: Vec::new(),
        period_s,
        kept_variance: Vec::new(),
        mean_subtracted,
        dark_keys: 0,
        sky_scale: 1.0,
        paths,
        manylight: env!("CARGO_PKG_VERSION").to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four texels at four times, the first of them dark.
    fn day() -> (Vec<f64>, Vec<Option<usize>>, Vec<Picture>) {
        let frame = |i: usize| Picture::linear(2, 2, 3, (0..12).map(|p| ((i * 5 + p * 7) % 11) as f32 * 300.0).collect());
        (vec![0.0, 20_000.0, 40_000.0, 60_000.0], vec![None, Some(0), Some(1), Some(2)], (0..3).map(frame).collect())
    }

    fn baked(keep: Keep, subtract_mean: bool) -> Baked {
        let (keys, lit, frames) = day();
        let slices: Vec<&[f32]> = frames.iter().map(|frame| frame.data.as_slice()).collect();
        let pca = Pca::of(&slices, subtract_mean);
        let sky = Picture::linear(2, 2, 3, vec![8.0; 12]);
        let distance = Picture::linear(2, 2, 1, vec![0.0, 1.0, 8.0, 3.0]);
        let header = Header {
            scene: "s".into(),
            scene_hash: String::new(),
            lookup: Lookup::Image,
            width: 0,
            height: 0,
            triangles: 0,
            components: 0,
            keys: Vec::new(),
            period_s: 86_400.0,
            kept_variance: Vec::new(),
            mean_subtracted: subtract_mean,
            dark_keys: 0,
            sky_scale: 0.0,
            paths: 1,
            manylight: String::new(),
        };
        encode(&pca, keep, Parts { keys: &keys, lit: &lit, sky: &sky, distance: Some(&distance), corners: &[], header })
    }

    #[test]
    fn all_components_give_key_frames_back_in_half_precision() {
        let (keys, lit, frames) = day();
        for subtract_mean in [true, false] {
            let baked = baked(Keep::Components(99), subtract_mean);
            for (key, time) in keys.iter().enumerate() {
                let light = decode(&baked, *time);
                let expected = lit[key].map_or(vec![0.0; 12], |index| frames[index].data.clone());
                let worst = light.data.iter().zip(&expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
                // Every layer is off by less than 2⁻¹¹ of its largest value times its weight; those add up to less than three times the largest of 3000.
                assert!(worst <= 3.0 * 3000.0 / 2048.0, "key {key}: {worst}");
            }
            assert_eq!((baked.header.dark_keys, baked.header.components), (1, if subtract_mean { 2 } else { 3 }));
        }
    }

    #[test]
    fn light_goes_to_zero_towards_a_dark_key() {
        let baked = baked(Keep::Variance(1.0), true);
        let (lit, half) = (decode(&baked, 20_000.0), decode(&baked, 10_000.0));
        for (a, b) in lit.data.iter().zip(&half.data) {
            assert!((0.5 * a - b).abs() <= 1e-3 * a.max(1.0), "{a} {b}");
        }
    }

    #[test]
    fn sky_and_distances_are_stored() {
        let baked = baked(Keep::Components(1), true);
        let layer = 4 * 4;
        let (mean, sky) = (&baked.texels[..layer], &baked.texels[2 * layer..]);
        let alphas: Vec<f32> = mean.chunks_exact(4).map(|texel| texel[3].to_f32()).collect();
        assert_eq!(alphas[..3], [NOWHERE, 0.0, 3.0]);
        assert_eq!((baked.header.sky_scale * sky[0].to_f32(), baked.header.layers()), (8.0, 3));
    }
}
