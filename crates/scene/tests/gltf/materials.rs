//! Materials and pictures.

use std::io::Cursor;

use base64::{Engine as _, engine::general_purpose::STANDARD};
use glam::Vec3;
use image::{Rgb, RgbImage};
use manylight_scene::{Material, Scene};

use super::build::{Doc, gltf, triangle};
use crate::memory::{assert_says, load, summary};

/// A PNG of one row.
fn png(texels: &[[u8; 3]]) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    RgbImage::from_fn(texels.len() as u32, 1, |x, _| Rgb(texels[x as usize])).write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}

fn uri(bytes: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(bytes))
}

/// A triangle with texture coordinates 1, and a material; `more` has pictures.
fn doc() -> Doc {
    let mut doc = triangle();
    doc.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 0.25]]);
    doc.floats(&[[0.5, 0.5]; 3]);
    doc
}

fn rest(material: &str, more: &str) -> String {
    format!(
        "\"meshes\":[{{\"primitives\":[{{\"attributes\":{{\"POSITION\":0,\"TEXCOORD_0\":1,\"TEXCOORD_1\":2}},\"material\":0}}]}}],\
         \"materials\":[{{{material}}}],\"nodes\":[{{\"mesh\":0}}]{more}"
    )
}

fn with(material: &str, more: &str) -> Scene {
    gltf(&doc().gltf(&rest(material, more))).unwrap_or_else(|faults| panic!("{faults}"))
}

fn pbr(fields: &str) -> Material {
    let scene = with(&format!("\"pbrMetallicRoughness\":{{{fields}}}"), "");
    assert_eq!(scene.warnings.0.len(), 2, "{:?}", summary(&scene.warnings));
    scene.materials[0].clone()
}

#[test]
fn metallic_roughness_becomes_lambert_and_blinn() {
    let base = Vec3::new(0.8, 0.4, 0.2);
    let plastic = pbr("\"baseColorFactor\":[0.8,0.4,0.2,1],\"metallicFactor\":0,\"roughnessFactor\":0.5");
    assert_eq!((plastic.diffuse, plastic.specular), (base, Vec3::splat(0.04)));
    // α = 0.25: 2/0.0625 − 2.
    assert!((plastic.shininess - 30.0).abs() < 1e-4);
    let metal = pbr("\"baseColorFactor\":[0.8,0.4,0.2,1],\"roughnessFactor\":0");
    assert_eq!((metal.diffuse, metal.specular, metal.shininess), (Vec3::ZERO, base, 10_000.0));
    let half = pbr("\"baseColorFactor\":[0.8,0.4,0.2,1],\"metallicFactor\":0.5");
    assert!(half.diffuse.abs_diff_eq(0.5 * base, 1e-6) && half.specular.abs_diff_eq(0.5 * (base + 0.04), 1e-6));
    assert_eq!((half.shininess, half.name.as_str()), (0.0, "material_0"));
    let out_of_range = pbr("\"baseColorFactor\":[8,-1,0.2,1],\"metallicFactor\":-3,\"roughnessFactor\":7");
    assert_eq!((out_of_range.diffuse, out_of_range.shininess), (Vec3::new(1.0, 0.0, 0.2), 0.0));
    let glass = with("\"pbrMetallicRoughness\":{\"metallicFactor\":0},\"extensions\":{\"KHR_materials_ior\":{\"ior\":3}}", "");
    assert_eq!(glass.materials[0].specular, Vec3::splat(0.25));
}

/// Blinn's lobe is as high as that of GGX in the middle where both are narrow.
#[test]
fn the_exponent_gives_the_height_of_the_lobe() {
    for roughness in [0.2_f64, 0.3, 0.4] {
        let alpha = roughness * roughness;
        let material = pbr(&format!("\"metallicFactor\":0,\"roughnessFactor\":{roughness}"));
        let blinn = (f64::from(material.shininess) + 8.0) / (8.0 * std::f64::consts::PI);
        let ggx = 1.0 / (4.0 * std::f64::consts::PI * alpha * alpha);
        assert!((blinn / ggx - 1.0).abs() < 0.08, "{roughness}: {blinn} {ggx}");
    }
}

#[test]
fn pictures_are_read_from_data_files_and_buffers() {
    let picture = png(&[[255, 0, 0], [0, 0, 255]]);
    let base = "\"name\":\"m\",\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0},\"metallicFactor\":0}";
    let textures = ",\"textures\":[{\"source\":0}],\"images\":";
    let data = with(base, &format!("{textures}[{{\"uri\":\"{}\"}}]", uri(&picture)));
    let beside = rest(base, &format!("{textures}[{{\"uri\":\"a%20b.png\"}}]"));
    let beside = load("d/a.gltf", &[("d/a.gltf", doc().gltf(&beside).into_bytes()), ("d/a b.png", picture.clone())]).unwrap();
    let mut inside = doc();
    let view = inside.view(&picture, "");
    let inside = inside.gltf(&rest(base, &format!("{textures}[{{\"bufferView\":{view},\"mimeType\":\"image/png\"}}]")));
    let inside = gltf(&inside).unwrap();
    for scene in [&data, &beside, &inside] {
        assert_eq!((scene.textures.width, scene.textures.count, scene.materials[0].texture), (2, 1, Some(0)));
        assert_eq!(scene.textures.levels[0], [255, 0, 0, 255, 0, 0, 255, 255]);
        assert_eq!(scene.materials[0].diffuse, Vec3::ONE);
        let vertices = &scene.meshes[0].vertices;
        assert_eq!((vertices[1].u, vertices[2].v), (1.0, 0.25), "v goes down, as in glTF");
        assert_eq!(scene.warnings.0.len(), 2, "{:?}", summary(&scene.warnings));
    }
    assert!(beside.sources.iter().any(|path| path.ends_with("a b.png")));
}

#[test]
fn what_has_no_picture_in_the_scene_has_the_mean() {
    // Red: not used; green: roughness 0 and 1; blue: metallic 1 and 0.
    let (rough, colour) = (png(&[[9, 0, 255], [9, 255, 0]]), png(&[[255, 255, 255], [0, 0, 255]]));
    let material = "\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,0.5,1,1],\"baseColorTexture\":{\"index\":1},\"metallicRoughnessTexture\":{\"index\":0}}";
    let more = format!(
        ",\"textures\":[{{\"source\":0}},{{\"source\":1}}],\"images\":[{{\"uri\":\"{}\"}},{{\"uri\":\"{}\"}}]",
        uri(&rough),
        uri(&colour)
    );
    let scene = with(material, &more);
    let found = &scene.materials[0];
    assert!(found.diffuse.abs_diff_eq(Vec3::new(0.5, 0.25, 0.5), 1e-6), "{found:?}");
    assert!(found.specular.abs_diff_eq(0.5 * (Vec3::splat(0.04) + Vec3::new(0.5, 0.25, 1.0)), 1e-6), "{found:?}");
    assert!((found.shininess - 30.0).abs() < 1e-4);
    assert_eq!(scene.textures.count, 1, "only colours are textures");
    assert_says(&scene.warnings, "", &["materials[0].pbrMetallicRoughness.metallicRoughnessTexture", "the means"]);
    assert_says(&scene.warnings, "", &["materials[0]", "reflections of metal have one colour"]);
}

#[test]
fn texture_coordinates_are_moved_as_the_material_says() {
    let picture = uri(&png(&[[255, 0, 0], [0, 0, 255]]));
    let more = |sampler: &str| {
        format!(",\"textures\":[{{\"source\":0{sampler}}}],\"samplers\":[{{\"wrapS\":33071}}],\"images\":[{{\"uri\":\"{picture}\"}}]")
    };
    let material = |info: &str| format!("\"pbrMetallicRoughness\":{{\"baseColorTexture\":{{\"index\":0,{info}}},\"metallicFactor\":0}}");
    let transform = |fields: &str| material(&format!("\"extensions\":{{\"KHR_texture_transform\":{{{fields}}}}}"));
    let uv = |scene: &Scene, i: usize| glam::Vec2::new(scene.meshes[0].vertices[i].u, scene.meshes[0].vertices[i].v);
    // A quarter against the clock as the picture is seen: right becomes up.
    let scene = with(&transform("\"rotation\":1.5707963,\"scale\":[2,4],\"offset\":[0.5,3]"), &more(""));
    assert!(uv(&scene, 0).abs_diff_eq(glam::vec2(0.5, 3.0), 1e-5));
    assert!(uv(&scene, 1).abs_diff_eq(glam::vec2(0.5, 1.0), 1e-5), "{}", uv(&scene, 1));
    assert!(uv(&scene, 2).abs_diff_eq(glam::vec2(1.5, 3.0), 1e-5), "{}", uv(&scene, 2));
    for scene in [with(&material("\"texCoord\":1"), &more("")), with(&transform("\"texCoord\":1"), &more(""))] {
        assert_eq!(uv(&scene, 1), glam::vec2(0.5, 0.5));
    }
    assert_says(
        &with(&material("\"texCoord\":1"), &more(",\"sampler\":0")).warnings,
        "",
        &["baseColorTexture", "repeats beyond its edges"],
    );
    let scene = with(&material("\"texCoord\":3"), &more(""));
    assert_says(&scene.warnings, "", &["meshes[0].primitives[0].attributes.TEXCOORD_3", "colour of its corner"]);
}

#[test]
fn what_is_lost_of_a_material_is_told() {
    let more = format!(
        ",\"extensionsUsed\":[\"X_unheard\",\"KHR_materials_sheen\"],\"textures\":[{{\"source\":0}},{{}}],\"images\":[{{\"uri\":\"{}\"}}]",
        uri(&png(&[[1, 2, 3]]))
    );
    let cases = [
        ("\"normalTexture\":{\"index\":0}", "materials[0].normalTexture: normal maps are left out"),
        ("\"occlusionTexture\":{\"index\":0}", "materials[0].occlusionTexture: occlusion maps are left out"),
        ("\"emissiveFactor\":[1,0,0]", "materials[0].emissiveFactor: light that surfaces emit is left out"),
        ("\"alphaMode\":\"BLEND\"", "materials[0].alphaMode: transparent surfaces are opaque"),
        ("\"extensions\":{\"X_new\":{}}", "materials[0].extensions: the extension `X_new` is left out"),
        ("", "extensionsUsed[0]: the extension `X_unheard` is left out"),
        ("", "extensionsUsed[1]: the extension `KHR_materials_sheen` is left out"),
        (
            "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":1}}",
            "baseColorTexture: textures[1] has no PNG or JPEG picture: the colour is used alone",
        ),
        (
            "\"pbrMetallicRoughness\":{\"metallicRoughnessTexture\":{\"index\":1}}",
            "metallicRoughnessTexture: textures[1] has no PNG or JPEG picture: the factors are used alone",
        ),
    ];
    for (material, words) in cases {
        assert_says(&with(material, &more).warnings, "", &["`a.gltf`", words]);
    }
    let gone = ",\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"gone.png\"}]";
    let base = "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0},\"metallicFactor\":0}";
    assert_says(&with(base, gone).warnings, "", &["baseColorTexture", "cannot read `gone.png`: no such file", "PNG"]);
    let noise = ",\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"data:image/png;base64,AAAA\"}]";
    assert_says(&with(base, noise).warnings, "", &["cannot read `a.gltf#images[0]`: not a picture"]);
    // The same loss twice is told once, with the first place.
    let rest = "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":0},{\"attributes\":{\"POSITION\":1},\"material\":1}]}],\
        \"materials\":[{\"alphaMode\":\"MASK\"},{\"alphaMode\":\"MASK\"}],\"nodes\":[{\"mesh\":0}]";
    let mut doc = triangle();
    doc.floats(&[[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]);
    let scene = gltf(&doc.gltf(rest)).unwrap();
    assert_says(&scene.warnings, "", &["materials[0].alphaMode", "(2 times, the first is told)"]);
    assert_eq!((scene.materials.len(), scene.triangle_count()), (2, 2));
}
