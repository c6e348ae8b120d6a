//! Materials: metallic-roughness becomes Lambert and Blinn.
//!
//! With base colour *b*, metallic *m*, roughness *r* and reflectance F₀ (0.04, or what the index of refraction says): diffuse is b (1 − m),
//! specular is F₀ (1 − m) + b m. The exponent is 2/α² − 2 with α = r², for which Blinn's lobe is as high as that of GGX.

use std::{collections::HashMap, path::PathBuf};

use glam::{Vec2, Vec3};
use gltf::json::{
    Index,
    extensions::texture::TextureTransform,
    image::Image,
    material::AlphaMode,
    texture::{Info, WrappingMode},
    validation::Checked,
};

use super::{document::Model, extensions, losses::Losses};
use crate::{
    files::Files,
    import::{
        Material, TextureSet,
        texture::{decode, mean},
    },
};

/// Reflectance of what is not metal, where it does not say.
const REFLECTANCE: f32 = 0.04;
/// Largest exponent: what is smoother (roughness below 0.12) is shown so. Highlights beyond it are smaller than the sun.
const LARGEST_EXPONENT: f32 = 10_000.0;

/// Which texture coordinates a material's picture is looked up with, and how they are moved.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lookup {
    /// Number of the set.
    pub(super) set: u32,
    x: Vec2,
    y: Vec2,
    offset: Vec2,
}

impl Lookup {
    fn new(set: u32, transform: Option<&TextureTransform>) -> Self {
        let Some(transform) = transform else { return Self { set, x: Vec2::X, y: Vec2::Y, offset: Vec2::ZERO } };
        // Scaled, turned against the clock as the picture is seen (v goes down), moved.
        let (sin, cos) = transform.rotation.0.sin_cos();
        let [scale_u, scale_v] = transform.scale.0;
        Self {
            set: transform.tex_coord.unwrap_or(set),
            x: scale_u * Vec2::new(cos, -sin),
            y: scale_v * Vec2::new(sin, cos),
            offset: transform.offset.0.into(),
        }
    }

    /// The place in the picture.
    pub(super) fn at(&self, uv: [f32; 2]) -> Vec2 {
        self.x * uv[0] + self.y * uv[1] + self.offset
    }
}

/// The materials of a file, added to those of the scene when they are met first.
pub(super) struct Materials<'a, 'f> {
    pub(super) files: &'a mut Files<'f>,
    pub(super) materials: &'a mut Vec<Material>,
    pub(super) textures: &'a mut TextureSet,
    known: HashMap<Option<usize>, (u32, Option<Lookup>)>,
    /// Means of pictures that are no colours.
    means: HashMap<usize, Option<Vec3>>,
}

impl<'a, 'f> Materials<'a, 'f> {
    pub(super) fn new(files: &'a mut Files<'f>, materials: &'a mut Vec<Material>, textures: &'a mut TextureSet) -> Self {
        Self { files, materials, textures, known: HashMap::new(), means: HashMap::new() }
    }

    /// The index of a material in the scene, and how its picture is looked up if it has one.
    pub(super) fn get(&mut self, model: &Model<'_>, index: Option<usize>, at: &str, losses: &mut Losses) -> (u32, Option<Lookup>) {
        if let Some(known) = self.known.get(&index) {
            return *known;
        }
        let (material, lookup) = match index.filter(|index| *index < model.root.materials.len()) {
            Some(index) => self.convert(model, index, losses),
            None => {
                losses.add(at, "surfaces without a material are grey and matt", "give them one, or change `default` in a scene file");
                (Material::grey("default"), None)
            }
        };
        self.materials.push(material);
        let found = (self.materials.len() as u32 - 1, lookup);
        self.known.insert(index, found);
        found
    }

    fn convert(&mut self, model: &Model<'_>, index: usize, losses: &mut Losses) -> (Material, Option<Lookup>) {
        let material = &model.root.materials[index];
        let at = format!("materials[{index}]");
        tell_losses(model, index, losses);
        let pbr = &material.pbr_metallic_roughness;
        let [r, g, b, _] = pbr.base_color_factor.0.map(share);
        let base = Vec3::new(r, g, b);
        let (mut metallic, mut roughness) = (share(pbr.metallic_factor.0), share(pbr.roughness_factor.0));

        let mut texture = None;
        if let Some(info) = &pbr.base_color_texture {
            let at = format!("{at}.pbrMetallicRoughness.baseColorTexture");
            match self.layer(model, info.index.value()) {
                Ok(layer) => texture = Some((layer, lookup(model, info, &at, losses))),
                Err(reason) => losses.add(at, format!("{reason}: the colour is used alone"), "PNG, JPEG, TGA and BMP pictures are read"),
            }
        }
        if let Some(info) = &pbr.metallic_roughness_texture {
            let at = format!("{at}.pbrMetallicRoughness.metallicRoughnessTexture");
            match self.mean(model, info.index.value()) {
                Ok(mean) => {
                    (metallic, roughness) = (metallic * mean.z, roughness * mean.y);
                    losses.add(
                        at,
                        "metallic and roughness are the same all over: the means of the picture",
                        "give parts of other materials their own",
                    );
                }
                Err(reason) => losses.add(at, format!("{reason}: the factors are used alone"), "PNG, JPEG, TGA and BMP pictures are read"),
            }
        }
        let mut colour_of_metal = base;
        if let Some((layer, _)) = texture.filter(|_| metallic > 0.0) {
            colour_of_metal *= self.textures.mean(layer);
            losses.add(at, "reflections of metal have one colour: the mean of its picture", "");
        }
        let reflectance =
            material.extensions.as_ref().and_then(|extensions| extensions.ior.as_ref()).map_or(REFLECTANCE, |ior| reflectance(ior.ior.0));
        let name = material.name.clone().unwrap_or_else(|| format!("material_{index}"));
        let converted = Material {
            name,
            diffuse: base * (1.0 - metallic),
            texture: texture.map(|(layer, _)| layer),
            specular: Vec3::splat(reflectance).lerp(colour_of_metal, metallic),
            shininess: exponent(roughness),
        };
        (converted, texture.map(|(_, lookup)| lookup))
    }

    /// The layer of a texture.
    fn layer(&mut self, model: &Model<'_>, texture: usize) -> Result<u32, String> {
        let (index, image) = picture(model, texture)?;
        match &image.uri {
            Some(uri) if !uri.starts_with("data:") => self.textures.load(&model.beside(uri)?, self.files),
            _ => self.textures.load_from(&inside(model, index), || bytes(model, image, self.files)),
        }
    }

    /// The mean of a texture that is no colour.
    fn mean(&mut self, model: &Model<'_>, texture: usize) -> Result<Vec3, String> {
        let (index, image) = picture(model, texture)?;
        if let Some(known) = self.means.get(&index) {
            return known.ok_or_else(|| format!("images[{index}] cannot be read"));
        }
        let name = inside(model, index);
        let result = bytes(model, image, self.files).and_then(|bytes| decode(&name, &bytes)).map(|image| mean(&image, |value| value));
        self.means.insert(index, result.as_ref().ok().copied());
        result
    }
}

/// The picture of a texture.
fn picture<'m>(model: &'m Model<'_>, texture: usize) -> Result<(usize, &'m Image), String> {
    let index: Option<Index<Image>> = model.root.textures.get(texture).map(|texture| texture.source);
    let found = index.and_then(|index| Some((index.value(), model.root.get(index)?)));
    found.ok_or_else(|| format!("textures[{texture}] has no PNG or JPEG picture"))
}

/// The name of a picture inside the file.
fn inside(model: &Model<'_>, image: usize) -> PathBuf {
    format!("{}#images[{image}]", model.path.display()).into()
}

fn bytes(model: &Model<'_>, image: &Image, files: &mut Files<'_>) -> Result<Vec<u8>, String> {
    match (&image.uri, image.buffer_view) {
        (Some(uri), _) => model.fetch(uri, files),
        (None, Some(view)) => model.view(view).map(|(bytes, _)| bytes.to_vec()),
        (None, None) => Err("the picture has no data".to_owned()),
    }
}

fn lookup(model: &Model<'_>, info: &Info, at: &str, losses: &mut Losses) -> Lookup {
    let sampler = model.root.get(info.index).and_then(|texture| texture.sampler).and_then(|sampler| model.root.get(sampler));
    if let Some(sampler) = sampler
        && [sampler.wrap_s, sampler.wrap_t].iter().any(|wrap| !matches!(wrap, Checked::Valid(WrappingMode::Repeat)))
    {
        losses.add(at, "the picture repeats beyond its edges, unlike its sampler says", "no loss where coordinates are from 0 to 1");
    }
    Lookup::new(info.tex_coord, info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref()))
}

/// Tells what of a material is not shown.
fn tell_losses(model: &Model<'_>, index: usize, losses: &mut Losses) {
    let material = &model.root.materials[index];
    let at = format!("materials[{index}]");
    if material.normal_texture.is_some() {
        losses.add(format!("{at}.normalTexture"), "normal maps are left out", "surfaces are as smooth as their meshes");
    }
    if material.occlusion_texture.is_some() {
        losses.add(format!("{at}.occlusionTexture"), "occlusion maps are left out", "occlusion is computed");
    }
    if material.emissive_factor.0.iter().any(|factor| *factor > 0.0) {
        losses.add(
            format!("{at}.emissiveFactor"),
            "light that surfaces emit is left out",
            "put lights into the scene: KHR_lights_punctual",
        );
    }
    if !matches!(material.alpha_mode, Checked::Valid(AlphaMode::Opaque)) {
        losses.add(format!("{at}.alphaMode"), "transparent surfaces are opaque", "remove what is fully transparent from the mesh");
    }
    if let Some(extensions) = &material.extensions {
        extensions.others.keys().for_each(|name| extensions::lost(&format!("{at}.extensions"), name, losses));
    }
}

/// A number from 0 to 1.
fn share(value: f32) -> f32 {
    if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) }
}

/// Reflectance at right angles of a surface between air and an index of refraction; 0 stands for all.
fn reflectance(ior: f32) -> f32 {
    match ior {
        0.0 => 1.0,
        ior if ior >= 1.0 => ((ior - 1.0) / (ior + 1.0)).powi(2).min(1.0),
        _ => REFLECTANCE,
    }
}

fn exponent(roughness: f32) -> f32 {
    let alpha = roughness * roughness;
    (2.0 / (alpha * alpha) - 2.0).clamp(0.0, LARGEST_EXPONENT)
}
