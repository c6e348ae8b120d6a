//! Textures.

use std::io::Cursor;

use image::{ImageFormat, Rgb, RgbImage};
use manylight_scene::{MAX_TEXTURE_SIZE, Scene, gpu_data::NO_TEXTURE};

use crate::memory::{assert_says, load};

fn encoded(image: &RgbImage, format: ImageFormat) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// A scene of one triangle for each texture.
fn scene(textures: &[(&str, Vec<u8>)]) -> Scene {
    let mut obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n".to_owned();
    let mut mtl = String::new();
    for (index, (name, _)) in textures.iter().enumerate() {
        obj.push_str(&format!("v 0 0 {}\nusemtl m{index}\nf 1 2 {}\n", index + 1, index + 4));
        mtl.push_str(&format!("newmtl m{index}\nmap_Kd {name}\n"));
    }
    let mut files = vec![("a.obj", obj.into_bytes()), ("m.mtl", mtl.into_bytes())];
    files.extend(textures.iter().map(|(name, bytes)| (*name, bytes.clone())));
    load("a.obj", &files).unwrap()
}

#[test]
fn without_textures_there_is_one_white_texel() {
    let scene = crate::memory::obj(crate::memory::TRIANGLE).unwrap();
    let textures = &scene.textures;
    assert_eq!((textures.width, textures.height, textures.count, textures.layers()), (1, 1, 0, 1));
    assert_eq!(textures.levels, [[255; 4]]);
    assert_eq!(scene.gpu_materials()[0].diffuse_texture, NO_TEXTURE);
}

#[test]
fn formats_sizes_and_layers() {
    let red = RgbImage::from_pixel(5, 3, Rgb([255, 0, 0]));
    let grey = RgbImage::from_pixel(17, 2, Rgb([100, 100, 100]));
    let scene = scene(&[
        ("a.png", encoded(&red, ImageFormat::Png)),
        ("b.tga", encoded(&grey, ImageFormat::Tga)),
        ("c.bmp", encoded(&grey, ImageFormat::Bmp)),
        ("d.jpg", encoded(&grey, ImageFormat::Jpeg)),
        ("a.png", encoded(&red, ImageFormat::Png)),
        // A wrong ending does not matter: the contents tell.
        ("e.jpg", encoded(&red, ImageFormat::Png)),
    ]);
    let textures = &scene.textures;
    assert_eq!((textures.width, textures.height, textures.count), (32, 4, 5));
    assert_eq!(scene.gpu_materials().iter().map(|m| m.diffuse_texture).collect::<Vec<_>>(), [0, 1, 2, 3, 0, 4]);
    assert_eq!(scene.gpu_materials()[0].diffuse, glam::Vec3::ONE, "a texture alone is not darkened");
    assert_eq!(textures.levels.len(), 6);
    for (level, texels) in textures.levels.iter().enumerate() {
        let (width, height) = textures.level_size(level as u32);
        assert_eq!(texels.len() as u32, 4 * width * height * 5);
        let layer = (4 * width * height) as usize;
        assert!(texels[..layer].chunks(4).all(|t| t == [255, 0, 0, 255]), "a single colour stays at level {level}");
        assert!(texels[layer..2 * layer].chunks(4).all(|t| t == [100, 100, 100, 255]));
    }
    assert!(scene.features()["textures"]);
}

#[test]
fn mip_levels_are_means_of_linear_light() {
    let checker = RgbImage::from_fn(2, 2, |x, y| Rgb([if (x + y) % 2 == 0 { 255 } else { 0 }; 3]));
    let scene = scene(&[("a.png", encoded(&checker, ImageFormat::Png))]);
    assert_eq!(scene.textures.levels.len(), 2);
    // Half of the light is 188 in sRGB, not 128.
    assert_eq!(scene.textures.levels[1], [188, 188, 188, 255]);
    assert_eq!(&scene.textures.levels[0][..8], [255, 255, 255, 255, 0, 0, 0, 255], "row 0 is the top");
}

#[test]
fn large_textures_are_scaled_down() {
    let wide = RgbImage::from_pixel(MAX_TEXTURE_SIZE + 1, 1, Rgb([9, 9, 9]));
    let textures = scene(&[("a.png", encoded(&wide, ImageFormat::Png))]).textures;
    assert_eq!((textures.width, textures.height), (MAX_TEXTURE_SIZE, 1));
}

#[test]
fn pictures_that_are_none_are_warnings() {
    let red = encoded(&RgbImage::from_pixel(4, 4, Rgb([255, 0, 0])), ImageFormat::Png);
    for (name, bytes) in
        [("a.png", b"junk".to_vec()), ("a.xyz", b"junk".to_vec()), ("a.png", red[..red.len() / 2].to_vec()), ("a.tga", Vec::new())]
    {
        let scene = scene(&[(name, bytes)]);
        assert_says(&scene.warnings, &format!("map_Kd {name}"), &[&format!("cannot read `{name}`")]);
        assert_eq!(scene.textures.count, 0);
        assert_eq!(scene.materials[0].texture, None);
    }
}
