//! Textures: decoding, one size for all, mip levels.

use std::{
    collections::HashMap,
    io::Cursor,
    path::{Path, PathBuf},
};

use glam::{DVec3, Vec3};
use image::{ImageFormat, ImageReader, Limits, Rgba32FImage, RgbaImage, imageops};

use crate::files::{Files, cannot_read};

/// Width and height that textures are scaled down to.
pub const MAX_TEXTURE_SIZE: u32 = 2048;

/// All textures of a scene, as layers of one array of sRGB-encoded RGBA texels with mip levels. Row 0 is the top of the picture.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Textures {
    /// Width of level 0, a power of two.
    pub width: u32,
    /// Height of level 0, a power of two.
    pub height: u32,
    /// Number of textures. Without any, there is one layer of one white texel all the same, so that a shader has something to be bound to.
    pub count: u32,
    /// Mip levels, down to one texel; each holds the texels of all layers, layer after layer.
    pub levels: Vec<Vec<u8>>,
}

impl Textures {
    /// Layers in [`Textures::levels`]: at least 1.
    pub fn layers(&self) -> u32 {
        self.count.max(1)
    }

    /// Width and height of a level.
    pub fn level_size(&self, level: u32) -> (u32, u32) {
        ((self.width >> level).max(1), (self.height >> level).max(1))
    }
}

/// Collects textures; the same file is one layer.
#[derive(Default)]
pub(crate) struct TextureSet {
    layers: HashMap<PathBuf, Result<u32, String>>,
    images: Vec<RgbaImage>,
}

/// Wider or higher pictures than this are refused.
const LARGEST_PICTURE: u32 = 16384;
/// Bytes that decoding one picture may take.
const DECODER_MEMORY: u64 = 1 << 30;

impl TextureSet {
    /// The layer of a file.
    ///
    /// # Errors
    /// What is wrong with it, as a sentence that names it.
    pub(crate) fn load(&mut self, path: &Path, files: &mut Files<'_>) -> Result<u32, String> {
        self.load_from(path, || files.read(path).map_err(|error| cannot_read(path, &error)))
    }

    /// The layer of a picture that lies inside another file; `path` names it.
    ///
    /// # Errors
    /// What is wrong with it, as a sentence that names it.
    pub(crate) fn load_from(&mut self, path: &Path, bytes: impl FnOnce() -> Result<Vec<u8>, String>) -> Result<u32, String> {
        if let Some(known) = self.layers.get(path) {
            return known.clone();
        }
        let layer = bytes().and_then(|bytes| decode(path, &bytes)).map(|image| {
            self.images.push(image);
            self.images.len() as u32 - 1
        });
        self.layers.insert(path.to_owned(), layer.clone());
        layer
    }

    /// Mean linear colour of a layer.
    pub(crate) fn mean(&self, layer: u32) -> Vec3 {
        self.images.get(layer as usize).map_or(Vec3::ONE, |image| mean(image, linear_from_srgb))
    }

    /// Brings all to one size and makes the mip levels.
    pub(crate) fn build(self) -> Textures {
        let count = self.images.len() as u32;
        let side = |largest: Option<u32>| largest.unwrap_or(1).min(MAX_TEXTURE_SIZE).next_power_of_two();
        let width = side(self.images.iter().map(RgbaImage::width).max());
        let height = side(self.images.iter().map(RgbaImage::height).max());
        let level_count = 1 + width.max(height).ilog2() as usize;
        if count == 0 {
            return Textures { width, height, count, levels: vec![vec![255; 4]] };
        }
        let mut levels = vec![Vec::new(); level_count];
        for image in self.images {
            let mut linear = to_linear(&image);
            drop(image);
            if linear.dimensions() != (width, height) {
                linear = imageops::resize(&linear, width, height, imageops::FilterType::Triangle);
            }
            for texels in &mut levels {
                encode(&linear, texels);
                linear = halved(&linear);
            }
        }
        Textures { width, height, count, levels }
    }
}

/// Mean of a picture's first three channels, each value of which (0…1) goes through `convert`.
pub(super) fn mean(image: &RgbaImage, convert: impl Fn(f32) -> f32) -> Vec3 {
    let table: [f64; 256] = std::array::from_fn(|i| f64::from(convert(i as f32 / 255.0)));
    let mut sum = DVec3::ZERO;
    for texel in image.pixels() {
        let [r, g, b, _] = texel.0;
        sum += DVec3::new(table[r as usize], table[g as usize], table[b as usize]);
    }
    (sum / f64::from(image.width()) / f64::from(image.height())).as_vec3()
}

/// Decodes a picture; its format is told by its contents, else by the end of its name.
pub(super) fn decode(path: &Path, bytes: &[u8]) -> Result<RgbaImage, String> {
    let fail = |reason: &dyn std::fmt::Display| format!("cannot read `{}`: {reason}", path.display());
    let format = image::guess_format(bytes).ok().or_else(|| ImageFormat::from_path(path).ok());
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format.ok_or_else(|| fail(&"not a picture"))?);
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_PICTURE);
    limits.max_image_height = Some(LARGEST_PICTURE);
    limits.max_alloc = Some(DECODER_MEMORY);
    reader.limits(limits);
    let image = reader.decode().map_err(|error| fail(&error))?.into_rgba8();
    if image.width() == 0 || image.height() == 0 {
        return Err(fail(&"the picture is empty"));
    }
    Ok(image)
}

/// Radiance-linear value of an sRGB-encoded one.
pub(crate) fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// sRGB encoding of a linear value.
fn srgb_from_linear(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { linear * 12.92 } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

fn to_linear(image: &RgbaImage) -> Rgba32FImage {
    let table: [f32; 256] = std::array::from_fn(|i| linear_from_srgb(i as f32 / 255.0));
    let texel = |x, y| {
        let [r, g, b, a] = image.get_pixel(x, y).0;
        image::Rgba([table[r as usize], table[g as usize], table[b as usize], f32::from(a) / 255.0])
    };
    Rgba32FImage::from_fn(image.width(), image.height(), texel)
}

/// Appends the texels of a level.
fn encode(linear: &Rgba32FImage, texels: &mut Vec<u8>) {
    let byte = |value: f32| (value * 255.0).round().clamp(0.0, 255.0) as u8;
    for texel in linear.pixels() {
        let [r, g, b, a] = texel.0;
        texels.extend([byte(srgb_from_linear(r)), byte(srgb_from_linear(g)), byte(srgb_from_linear(b)), byte(a)]);
    }
}

/// The next mip level: the mean of 2×2 texels (of 2×1 where a side is 1 already).
fn halved(image: &Rgba32FImage) -> Rgba32FImage {
    let (width, height) = image.dimensions();
    let texel = |x: u32, y: u32| {
        let mut sum = [0.0; 4];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let texel = image.get_pixel((2 * x + dx).min(width - 1), (2 * y + dy).min(height - 1));
            sum = std::array::from_fn(|c| sum[c] + 0.25 * texel.0[c]);
        }
        image::Rgba(sum)
    };
    Rgba32FImage::from_fn((width / 2).max(1), (height / 2).max(1), texel)
}
