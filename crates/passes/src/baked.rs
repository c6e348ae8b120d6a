//! Precomputed indirect light: the file that `manylight bake` writes, and what a frame needs of it.
//!
//! Indirect light over a day is a mean texture and a few components, each with a weight by key frame ([PCA] 3.2); the light of the sky is one more
//! texture. Light at a time between two key frames is mixed from the weights of both ([PCA] eqs. 1–3).
//!
//! The file, all numbers little-endian: the eight bytes `MLBAKED` and 0; version, u32; length of the header, u32; the header, JSON in UTF-8 ([`Header`]);
//! weights, f32, a row a key frame; texels, f16, RGBA, layer by layer, rows from the top; corners of triangles in an
//! atlas, f32, u and v; SHA-256 of all bytes before it.

use half::f16;
use manylight_scene::{Scene, SceneState};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use thiserror::Error;

const MAGIC: &[u8; 8] = b"MLBAKED\0";
/// Of the file's layout; other versions are refused.
pub const VERSION: u32 = 1;
/// Stands for the logarithm of a distance where there is no surface.
pub const NOWHERE: f32 = 65504.0;

/// Bytes of the checksum.
const CHECKSUM: usize = 32;
/// Bytes before the header.
const FIXED: usize = 16;
/// More layers than WebGPU promises for a texture array.
const MOST_LAYERS: usize = 256;
/// Sides of textures beyond this are refused before memory is asked for.
const MOST_SIDE: usize = 16384;
/// Texels of a cube's face beyond a right angle on each side: look-ups and their neighbours stay on it.
pub const FACE_BORDER: f64 = 1.5;
/// The smallest side of a cube's face: what is left without its border.
pub const SMALLEST_FACE: usize = 8;
/// Corners of a triangle's two sides.
pub const CORNERS: usize = 6;

/// How light is found for a pixel. The file names it, so that a program which knows other ways can tell them apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Lookup {
    /// At the same place of the picture: the camera stands still. The texels are reflected radiance.
    Image,
    /// On the six faces of a cube round the camera, which stays where it is and turns: +x, −x and +y in the first row, −y, +z and −z in the second. Texels
    /// as with `image`; each face reaches [`FACE_BORDER`] texels beyond a right angle on each side.
    Cube,
    /// In an atlas over the surfaces that stand still: the camera moves. The texels are what white matt surfaces would reflect.
    Atlas,
}

/// What a baked file says of itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Name of the scene.
    pub scene: String,
    /// Hash of the contents of all of its files, hexadecimal.
    pub scene_hash: String,
    /// How light is found for a pixel.
    pub lookup: Lookup,
    /// Texels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// With the look-up `atlas`: triangles of all objects that stand still. Else 0.
    pub triangles: usize,
    /// Components besides the mean.
    pub components: usize,
    /// Times of the key frames in seconds, increasing, within a period.
    pub keys: Vec<f64>,
    /// After this time everything repeats.
    pub period_s: f64,
    /// Share of the variance of the key frames that the first 1, 2, … components hold; one number a component.
    pub kept_variance: Vec<f64>,
    /// Whether the mean of the key frames was taken off before the components were found. If not, its layer is black.
    pub mean_subtracted: bool,
    /// Key frames without any light. They took no part in finding the components, and their weights are zero.
    pub dark_keys: usize,
    /// What the layer of the sky is multiplied with for its radiance by day.
    pub sky_scale: f32,
    /// Paths a texel of each key frame.
    pub paths: u32,
    /// Version of the program that wrote it.
    pub manylight: String,
}

/// Baked light in memory.
#[derive(Debug, Clone, PartialEq)]
pub struct Baked {
    /// What it is.
    pub header: Header,
    /// For each key frame the weights of the mean and of each component.
    pub weights: Vec<f32>,
    /// Mean, components, sky: RGBA, layer by layer, rows from the top. With the look-ups `image` and `cube`, alpha of the mean is the logarithm to base 2 of
    /// the distance from the camera, or [`NOWHERE`].
    pub texels: Vec<f16>,
    /// With the look-up `atlas`, where the triangles of all objects that stand still are, object by object, in texels: six corners a triangle, those of the
    /// front (from where its corners go round against the clock, but for mirrored objects), then those of the back; zero for a triangle without area.
    pub corners: Vec<[f32; 2]>,
}

/// Why there is no baked light.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[allow(missing_docs)]
pub enum BakedError {
    /// Something else.
    #[error("it is no file of baked light: write one with `manylight bake`")]
    Kind,
    /// Another version.
    #[error("it has the layout of version {found}, and this program reads version {VERSION}: bake it again")]
    Version { found: u32 },
    /// Its bytes are not those that were written.
    #[error("it is damaged or not whole ({reason}): bake it again; finished key frames in the work folder are not traced anew")]
    Damaged { reason: String },
    /// It is of another scene, or of another state of it.
    #[error("it was baked from the scene `{baked}` with the hash {baked_hash}, but `{scene}` has the hash {scene_hash}: bake it again")]
    Scene { baked: String, baked_hash: String, scene: String, scene_hash: String },
}

fn damaged(reason: impl Into<String>) -> BakedError {
    BakedError::Damaged { reason: reason.into() }
}

/// The hash of a scene as headers have it.
pub fn hash_of(scene: &Scene) -> String {
    format!("{:016x}", scene.hash)
}

impl Header {
    /// Layers of the texture: mean, components, sky.
    pub fn layers(&self) -> usize {
        self.components.saturating_add(2)
    }

    /// Numbers in a row of weights: of the mean and the components.
    pub fn columns(&self) -> usize {
        self.components.saturating_add(1)
    }

    /// Corners of all triangles.
    pub fn corners(&self) -> usize {
        self.triangles.saturating_mul(CORNERS)
    }

    fn check(&self) -> Result<(), String> {
        if (self.lookup == Lookup::Atlas) != (self.triangles > 0) {
            return Err("it has the coordinates of an atlas without one, or an atlas without coordinates".to_owned());
        }
        let side = |n: usize| (1..=MOST_SIDE).contains(&n);
        if !side(self.width) || !side(self.height) || self.layers() > MOST_LAYERS {
            return Err(format!("{}×{} texels in {} layers cannot be used", self.width, self.height, self.layers()));
        }
        let face = self.height / 2;
        if self.lookup == Lookup::Cube && (face < SMALLEST_FACE || [self.width, self.height] != [3 * face, 2 * face]) {
            return Err("its texels are not the six faces of a cube".to_owned());
        }
        let increasing = self.keys.windows(2).all(|pair| pair[0] < pair[1]);
        let within = self.keys.iter().all(|key| (0.0..self.period_s).contains(key));
        if self.keys.is_empty() || !increasing || !within || !self.period_s.is_finite() {
            return Err("the times of the key frames do not increase within a period".to_owned());
        }
        if self.kept_variance.len() != self.components || !self.sky_scale.is_finite() {
            return Err("its header contradicts itself".to_owned());
        }
        Ok(())
    }
}

impl Baked {
    /// The bytes of the file.
    pub fn to_bytes(&self) -> Result<Vec<u8>, serde_json::Error> {
        let header = serde_json::to_vec(&self.header)?;
        let mut bytes = MAGIC.to_vec();
        bytes.extend(VERSION.to_le_bytes());
        bytes.extend((header.len() as u32).to_le_bytes());
        bytes.extend(header);
        bytes.extend(self.weights.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(self.texels.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend(self.corners.iter().flatten().flat_map(|v| v.to_le_bytes()));
        let checksum = Sha256::digest(&bytes);
        bytes.extend(checksum);
        Ok(bytes)
    }

    /// Reads the bytes of a file; every byte counts.
    ///
    /// # Errors
    /// It is none, of another version, or damaged.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, BakedError> {
        if !bytes.starts_with(MAGIC) {
            return Err(BakedError::Kind);
        }
        let word = |at: usize| bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
        let (Some(found), Some(length)) = (word(8), word(12)) else { return Err(damaged("it ends within its first bytes")) };
        let body = bytes.len().checked_sub(CHECKSUM).filter(|n| *n >= FIXED).ok_or_else(|| damaged("it ends before its checksum"))?;
        let (body, checksum) = bytes.split_at(body);
        let whole = Sha256::digest(body).as_slice() == checksum;
        // Told first, as other versions may end in another way.
        if found != VERSION {
            return Err(BakedError::Version { found });
        }
        if !whole {
            return Err(damaged("its checksum is another"));
        }
        let header = body.get(FIXED..FIXED + length as usize).ok_or_else(|| damaged("its header is longer than the file"))?;
        let mut rest = &body[FIXED + length as usize..];
        let header: Header = serde_json::from_slice(header).map_err(|e| damaged(format!("its header cannot be read: {e}")))?;
        header.check().map_err(damaged)?;
        let mut take = |count: usize, size: usize| {
            let length =
                count.checked_mul(size).filter(|n| *n <= rest.len()).ok_or_else(|| damaged("it is shorter than its header says"))?;
            let (part, after) = rest.split_at(length);
            rest = after;
            Ok::<_, BakedError>(part)
        };
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let weights: Vec<f32> = take(header.keys.len() * header.columns(), 4)?.chunks_exact(4).map(float).collect();
        let texels = take(header.layers() * header.width * header.height * 4, 2)?;
        let texels: Vec<f16> = texels.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]])).collect();
        let corners: Vec<[f32; 2]> = take(header.corners(), 8)?.chunks_exact(8).map(|b| [float(&b[..4]), float(&b[4..])]).collect();
        if !rest.is_empty() {
            return Err(damaged("it is longer than its header says"));
        }
        if !weights.iter().all(|v| v.is_finite()) || !texels.iter().all(|v| v.is_finite()) {
            return Err(damaged("it holds numbers that are not finite"));
        }
        let size = [header.width as f32, header.height as f32];
        if !corners.iter().all(|corner| corner.iter().zip(size).all(|(v, side)| (0.0..=side).contains(v))) {
            return Err(damaged("corners of triangles lie beside its texels"));
        }
        Ok(Self { header, weights, texels, corners })
    }

    /// Fails unless it was baked from this scene.
    ///
    /// # Errors
    /// It was baked from another one, or from another state of it.
    pub fn check_scene(&self, scene: &Scene) -> Result<(), BakedError> {
        let scene_hash = hash_of(scene);
        if scene_hash == self.header.scene_hash {
            return Ok(());
        }
        let (baked, baked_hash) = (self.header.scene.clone(), self.header.scene_hash.clone());
        Err(BakedError::Scene { baked, baked_hash, scene: scene.name.clone(), scene_hash })
    }

    /// The weight of each layer at a time: of mean and components between the two key frames around it, and of the sky, which has `daylight` of its light.
    pub fn weights_at(&self, time: f64, daylight: f64) -> Vec<f32> {
        let columns = self.header.columns();
        let (before, after, alpha) = bracket(&self.header.keys, self.header.period_s, time);
        let row = |key: usize| &self.weights[key * columns..(key + 1) * columns];
        // [PCA] eq. 2: (1 − α) L_N + α L_{N+1}; L is linear in its weights, so that these can be mixed instead.
        let mix = |(a, b): (&f32, &f32)| ((1.0 - alpha) * f64::from(*a) + alpha * f64::from(*b)) as f32;
        let mut weights: Vec<f32> = row(before).iter().zip(row(after)).map(mix).collect();
        weights.push(self.header.sky_scale * daylight as f32);
        weights
    }

    /// Where the corners of all triangles of a scene are, in the order of [`Scene::gpu_triangles_at`], with zeros for what was not baked.
    pub fn corners_at(&self, scene: &Scene, state: &SceneState) -> Vec<[f32; 2]> {
        let mut rest = self.corners.as_slice();
        let mut corners = Vec::with_capacity(CORNERS * scene.room.triangles);
        for object in &scene.objects {
            let count = CORNERS * scene.shape(object.mesh, &state.deformed).triangles.len();
            if scene.stands_still(object) && count <= rest.len() {
                let (own, others) = rest.split_at(count);
                corners.extend_from_slice(own);
                rest = others;
            } else {
                corners.resize(corners.len() + count, [0.0; 2]);
            }
        }
        corners.resize(corners.len().max(CORNERS * scene.room.triangles), [0.0; 2]);
        corners
    }

    /// The texels of each layer as bytes.
    pub(crate) fn layers(&self) -> impl Iterator<Item = &[u8]> {
        let texels = 4 * self.header.width * self.header.height;
        self.texels.chunks_exact(texels).map(bytemuck::cast_slice)
    }
}

/// The key frames around a time, and how far it is from the first to the second ([PCA] eqs. 1 and 3, with the length of the interval itself in place of ΔT).
/// Before the first and after the last key the interval goes over the end of the period. Keys increase within it.
pub fn bracket(keys: &[f64], period_s: f64, time: f64) -> (usize, usize, f64) {
    let time = if time.is_finite() { time.rem_euclid(period_s) } else { 0.0 };
    let next = keys.partition_point(|key| *key <= time);
    let (before, after) = ((next + keys.len() - 1) % keys.len(), next % keys.len());
    let length = (keys[after] - keys[before]).rem_euclid(period_s);
    let alpha = if length > 0.0 { (time - keys[before]).rem_euclid(period_s) / length } else { 0.0 };
    (before, after, alpha)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn baked() -> Baked {
        let header = Header {
            scene: "day".into(),
            scene_hash: "0123456789abcdef".into(),
            lookup: Lookup::Image,
            width: 3,
            height: 2,
            triangles: 0,
            components: 2,
            keys: vec![0.0, 21_600.0, 30_000.0, 64_800.0],
            period_s: 86_400.0,
            kept_variance: vec![0.9, 0.99],
            mean_subtracted: true,
            dark_keys: 1,
            sky_scale: 2.5,
            paths: 16,
            manylight: "0.1.0".into(),
        };
        let weights = vec![0.0, 0.0, 0.0, 1.0, 0.5, -0.25, 1.0, 2.0, 4.0, 1.0, -1.0, 8.0];
        let texels = (0..4 * 3 * 2 * 4).map(|i| f16::from_f32(i as f32 / 16.0 - 2.0)).collect();
        Baked { header, weights, texels, corners: Vec::new() }
    }

    /// The same light over an atlas of two triangles.
    fn atlas() -> Baked {
        let mut atlas = baked();
        (atlas.header.lookup, atlas.header.triangles) = (Lookup::Atlas, 2);
        atlas.corners = (0..2 * CORNERS).map(|i| [i as f32 * 0.25, 2.0 - i as f32 * 0.125]).collect();
        atlas
    }

    /// Numbers that look random and are the same on each run.
    fn random(state: &mut u64) -> u64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *state >> 33
    }

    /// The same bytes with a true checksum.
    fn sealed(mut body: Vec<u8>) -> Vec<u8> {
        body.truncate(body.len() - CHECKSUM);
        let checksum = Sha256::digest(&body);
        body.extend(checksum);
        body
    }

    #[test]
    fn a_file_comes_back_as_it_was() {
        let bytes = baked().to_bytes().expect("writable");
        assert_eq!(Baked::from_bytes(&bytes), Ok(baked()));
        let bytes = atlas().to_bytes().expect("writable");
        assert_eq!(Baked::from_bytes(&bytes), Ok(atlas()));
    }

    #[test]
    fn every_changed_byte_is_found() {
        let bytes = atlas().to_bytes().expect("writable");
        let mut state = 7;
        // All places once, and random changes at random places.
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 1 << (random(&mut state) % 8);
            let fault = Baked::from_bytes(&changed).expect_err("damaged");
            let expected = match at {
                0..8 => matches!(fault, BakedError::Kind),
                8..12 => matches!(fault, BakedError::Version { .. }),
                _ => matches!(fault, BakedError::Damaged { .. }),
            };
            assert!(expected, "byte {at}: {fault}");
        }
        for _ in 0..2000 {
            let mut changed = bytes.clone();
            for _ in 0..=random(&mut state) % 4 {
                let at = random(&mut state) as usize % bytes.len();
                changed[at] = changed[at].wrapping_add(1 + (random(&mut state) % 255) as u8);
            }
            assert!(changed == bytes || Baked::from_bytes(&changed).is_err());
        }
    }

    #[test]
    fn a_truncated_or_longer_file_is_refused() {
        let bytes = atlas().to_bytes().expect("writable");
        for length in 0..bytes.len() {
            let fault = Baked::from_bytes(&bytes[..length]).expect_err("truncated");
            assert_eq!(matches!(fault, BakedError::Kind), length < MAGIC.len(), "{length}: {fault}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(matches!(Baked::from_bytes(&longer), Err(BakedError::Damaged { .. })));
    }

    #[test]
    fn another_version_says_which() {
        let mut bytes = baked().to_bytes().expect("writable");
        bytes[8..12].copy_from_slice(&7_u32.to_le_bytes());
        let fault = Baked::from_bytes(&sealed(bytes)).expect_err("another version");
        assert_eq!(fault, BakedError::Version { found: 7 });
        assert!(fault.to_string().contains("version 7") && fault.to_string().contains("bake it again"));
    }

    /// Headers that were written so, with a true checksum: no size in them is believed.
    #[test]
    fn a_header_that_contradicts_the_file_is_refused() {
        let edits: [fn(&mut Header); 9] = [
            |h| h.width = 4,
            |h| h.height = 1,
            |h| h.width = usize::MAX,
            |h| h.components = 3,
            |h| h.components = 100_000,
            |h| h.components = usize::MAX,
            |h| h.keys.clear(),
            |h| h.keys.swap(0, 1),
            |h| h.keys[3] = 86_400.0,
        ];
        for (i, edit) in edits.into_iter().enumerate() {
            let mut wrong = baked();
            edit(&mut wrong.header);
            let fault = Baked::from_bytes(&wrong.to_bytes().expect("writable")).expect_err("contradicts");
            assert!(matches!(fault, BakedError::Damaged { .. }), "edit {i}: {fault}");
        }
        let edits: [fn(&mut Baked); 5] = [
            |b| b.header.triangles = 3,
            |b| b.header.triangles = usize::MAX,
            |b| b.header.lookup = Lookup::Image,
            |b| b.corners[7][0] = f32::NAN,
            |b| b.corners[0][1] = 2.5,
        ];
        for (i, edit) in edits.into_iter().enumerate() {
            let mut wrong = atlas();
            edit(&mut wrong);
            let fault = Baked::from_bytes(&wrong.to_bytes().expect("writable")).expect_err("contradicts");
            assert!(matches!(fault, BakedError::Damaged { .. }), "atlas, edit {i}: {fault}");
        }
        let mut wrong = baked();
        wrong.header.lookup = Lookup::Cube;
        let fault = Baked::from_bytes(&wrong.to_bytes().expect("writable")).expect_err("3×2 texels are no six faces");
        assert!(fault.to_string().contains("cube"), "{fault}");
        let mut wrong = baked();
        wrong.weights[4] = f32::NAN;
        assert!(matches!(Baked::from_bytes(&wrong.to_bytes().expect("writable")), Err(BakedError::Damaged { .. })));
    }

    #[test]
    fn weights_at_key_frames_are_theirs() {
        let baked = baked();
        for (key, time) in baked.header.keys.iter().enumerate() {
            let mut expected = baked.weights[3 * key..3 * key + 3].to_vec();
            expected.push(2.5 * 0.5);
            assert_eq!(baked.weights_at(*time, 0.5), expected);
            assert_eq!(baked.weights_at(*time + 3.0 * 86_400.0, 0.5), expected, "every day is the same");
        }
    }

    /// [PCA] eqs. 1 and 3 for keys every five minutes, hours and minutes as the paper has them.
    #[test]
    fn uniform_keys_have_the_papers_brackets() {
        let keys: Vec<f64> = (0..288).map(|i| 300.0 * f64::from(i)).collect();
        for (hours, minutes) in [(0.0, 0.0), (7.0, 3.0), (12.0, 59.0), (23.0, 54.0)] {
            let n = f64::floor((hours * 60.0 + minutes) / 5.0);
            let alpha = (minutes % 5.0) / 5.0;
            let (before, after, found) = bracket(&keys, 86_400.0, 3600.0 * hours + 60.0 * minutes);
            assert_eq!((before, after), (n as usize, n as usize + 1));
            assert!((found - alpha).abs() < 1e-12);
        }
    }

    #[test]
    fn brackets_go_over_midnight() {
        let keys = [7200.0, 36_000.0, 79_200.0];
        // From 22:00 to 02:00 are four hours.
        assert_eq!(bracket(&keys, 86_400.0, 82_800.0), (2, 0, 0.25));
        assert_eq!(bracket(&keys, 86_400.0, 0.0), (2, 0, 0.5));
        assert_eq!(bracket(&keys, 86_400.0, -3600.0), (2, 0, 0.25));
        assert_eq!(bracket(&keys, 86_400.0, 7200.0), (0, 1, 0.0));
        assert_eq!(bracket(&[5.0], 10.0, 7.0), (0, 0, 0.0), "one key holds for ever");
        assert_eq!(bracket(&keys, 86_400.0, f64::NAN).0, 2);
    }

    #[test]
    fn light_between_keys_is_mixed_by_the_length_of_their_interval() {
        // A quarter of the way from 06:00 to 08:20.
        let weights = baked().weights_at(21_600.0 + 2100.0, 1.0);
        assert_eq!(weights, [1.0, 0.875, 0.8125, 2.5]);
    }
}
