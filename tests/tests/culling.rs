//! Work in proportion: lights that give little are left out and what that costs is bounded, only what shows a surface is lit, only lit texels are mapped.

use std::fs;

use manylight_gpu::Image;
use manylight_graph::plan::Debug;
use manylight_passes::Renderer;

use crate::{
    renders::{Job, read, read_clusters},
    support::{project_with, root},
};

const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];
/// Sums of 32 bits differ by this share when terms are left out of them.
const ROUNDING: f64 = 1e-5;

/// Many lights, each of which could be left out: point lights, so that their number is their weight.
fn many(scene: &str) -> Job {
    Job::asset(scene).small().frames(1).set("sampling", "samples").set("lights", "vpl").set("clusters", 512).set("tiles", 1)
}

fn luminance(pixel: &[f32]) -> f64 {
    pixel.iter().zip(LUMINANCE).map(|(v, share)| f64::from(*v) * f64::from(share)).sum()
}

fn number(renderer: &Renderer, resource: &str, field: &str) -> f64 {
    let json = renderer.read_json(resource).unwrap_or_else(|e| panic!("{e}"));
    json[0][field].as_f64().unwrap_or_else(|| panic!("{resource} has no {field}: {json}"))
}

/// The largest share of its unshadowed light that a pixel lost, of all its light and of what shadows leave.
fn largest_loss(whole: &Image, culled: &Image) -> f64 {
    let pixels = whole.data.chunks_exact(4).zip(culled.data.chunks_exact(4)).filter(|(whole, _)| whole[3] > 0.0);
    let loss = pixels.map(|(whole, culled)| {
        let unshadowed = f64::from(whole[3]);
        ((unshadowed - f64::from(culled[3])) / unshadowed).max((luminance(&whole[..3]) - luminance(&culled[..3])) / unshadowed)
    });
    loss.fold(0.0, f64::max)
}

fn bits(image: &Image) -> Vec<u32> {
    image.data.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn no_pixel_loses_more_light_than_it_may_and_the_bound_says_so() {
    for scene in ["cornell", "glossy", "floating", "moving"] {
        // Shadows are dear to test, and bounds know nothing of them.
        let visibilities: &[&str] = if scene == "cornell" { &["none", "pcss"] } else { &["none"] };
        for visibility in visibilities {
            let job = || many(scene).set("visibility", visibility).keep(&["split_light"]);
            let whole = read(&job().render(), "split_light");
            let mut before = 0.0;
            for cull in [0.002, 0.02, 0.2] {
                let renderer = job().set("culling", true).set("cull", cull).keep(&["culled"]).render();
                let culled = read(&renderer, "split_light");
                let lost = largest_loss(&whole, &culled);
                let [bound, left_out] = ["largest_loss", "culled"].map(|field| number(&renderer, "culled", field));
                let what = format!("{scene}, {visibility}, cull {cull}: lost {lost:e}, at most {bound:e}, {left_out} lights");
                assert!(bound <= cull && lost <= bound + ROUNDING, "{what}");
                assert!(left_out >= before, "{what}, fewer than {before}");
                before = left_out;
                assert!(culled.data.iter().all(|v| v.is_finite()), "{what}");
            }
            assert!(before > 500.0, "{scene}: no more than {before} lights are left out, so nothing was tested");
        }
    }
}

/// What the test above is there to find.
#[test]
fn a_bound_that_is_none_is_found() {
    let wrong = fs::read_to_string(root().join("shaders/common/bounds.wgsl")).expect("readable");
    let wrong = wrong.replace("return vec2f(lower, upper);", "return vec2f(lower, 0.02 * upper);");
    let project = project_with(&[("shaders/common/bounds.wgsl", &wrong)]);
    let job = || many("cornell").set("visibility", "none").keep(&["split_light"]);
    let whole = read(&job().render(), "split_light");
    let job = Job { root: project.path().to_owned(), ..job().set("culling", true).set("cull", 0.02) };
    let lost = largest_loss(&whole, &read(&job.render(), "split_light"));
    assert!(lost > 0.02 + ROUNDING, "{lost}");
}

#[test]
fn lights_that_give_nothing_can_be_left_out_without_a_bit_of_difference() {
    for scene in ["cornell", "floating"] {
        for tiles in [1, 3, 8] {
            let job = || many(scene).set("tiles", tiles).keep(&["split_light"]);
            let whole = bits(&read(&job().render(), "split_light"));
            let renderer = job().set("culling", true).set("cull", 0.0).keep(&["culled"]).render();
            assert!(whole == bits(&read(&renderer, "split_light")), "{scene}, {tiles} tiles");
            assert_eq!(number(&renderer, "culled", "culled"), 0.0);
            // With more tiles a block is a third or all of so small a picture.
            let unreachable = number(&renderer, "culled", "unreachable");
            assert!(tiles > 1 || unreachable > 0.0, "{scene}, {tiles} tiles: every light gives something");
            let pixels = whole.chunks_exact(4).filter(|pixel| pixel[3] != 0).count() as f64;
            assert!(number(&renderer, "culled", "pixels") >= pixels);
        }
    }
}

#[test]
fn light_at_half_resolution_is_culled_within_the_bound_as_well() {
    let pipeline = root().join("pipelines/second_order.ron").to_string_lossy().into_owned();
    let kept = ["half_light", "refined_light"];
    let job = || {
        Job { pipeline: pipeline.clone(), size: (128, 96), ..Job::asset("cornell").small().frames(1) }.keep(&kept).set("negative_lights", 0)
    };
    let whole = job().set("culling", false).render();
    let renderer = job().set("culling", true).set("cull", 0.05).keep(&["half_culled", "refined_culled"]).render();
    for (light, culled) in kept.iter().zip(["half_culled", "refined_culled"]) {
        let lost = largest_loss(&read(&whole, light), &read(&renderer, light));
        let bound = number(&renderer, culled, "largest_loss");
        assert!(bound <= 0.05 && lost <= bound + ROUNDING, "{light}: {lost} of {bound}");
        assert!(number(&renderer, culled, "culled") > 100.0, "{light}");
    }
}

/// Two tori in nothing, of which a spot light with a wide cone lights a part.
const LITTLE: &str = r#"Scene(
    meshes: ["torus.obj", Mesh(file: "torus.obj", name: "other", transform: (translate: (1.6, 1.2, -1.2), rotate_deg: (axis: (1.0, 0.0, 0.0), angle: 90.0)))],
    camera: (origin: (0.0, 0.0, -9.0), target: (1.0, 0.5, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 50.0),
    lights: [Spot(position: (0.0, 6.0, -6.0), target: (0.0, 0.0, 0.0), intensity: (200.0, 200.0, 200.0), beam_deg: 30.0, cutoff_deg: 45.0, falloff: linear)],
)"#;

fn little(folder: &tempfile::TempDir) -> Job {
    for name in ["torus.obj", "floating.mtl"] {
        fs::copy(root().join("assets").join(name), folder.path().join(name)).expect("copied");
    }
    let scene = folder.path().join("little.ron");
    fs::write(&scene, LITTLE).expect("writable");
    // No whole blocks, neither of the picture nor of the map.
    Job { size: (83, 61), ..Job::scene(&scene).small().frames(3).set("rsm_size", 100) }
}

#[test]
fn only_blocks_with_a_surface_and_only_lit_texels_are_worked_on() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let kept = ["lit_block_groups", "lit_blocks", "surface_blocks", "split_position", "lit_texel_groups", "lit_texels", "rsm_flux"];
    let renderer = little(&folder).keep(&kept).render();
    let json = |resource: &str| renderer.read_json(resource).unwrap_or_else(|e| panic!("{e}"));
    let words = |resource: &str| -> Vec<u64> {
        json(resource).as_array().expect("numbers").iter().map(|v| v.as_u64().expect("a number")).collect()
    };

    let groups = json("lit_block_groups");
    let (blocks, count) = (json("surface_blocks"), groups[0][3].as_u64().expect("a number") as usize);
    let blocks = blocks.as_array().expect("blocks");
    assert_eq!(groups[0][0].as_u64(), Some(count as u64));
    assert!(count > 0 && 2 * count < blocks.len(), "{count} of {} blocks", blocks.len());
    let expected: Vec<u64> = (0..).zip(blocks).filter(|(_, block)| block["points"] != 0).map(|(index, _)| index).collect();
    assert_eq!(words("lit_blocks")[..count], expected);
    let shown = read(&renderer, "split_position").data.chunks_exact(4).filter(|pixel| pixel[3] > 0.0).count() as u64;
    assert_eq!(blocks.iter().map(|block| block["points"].as_u64().expect("a number")).sum::<u64>(), shown);

    let (flux, groups) = (read(&renderer, "rsm_flux"), json("lit_texel_groups"));
    let count = groups[0][3].as_u64().expect("a number") as usize;
    let mut lit: Vec<u64> = words("lit_texels")[..count].to_vec();
    let mut expected: Vec<u64> = (0..flux.width * flux.height)
        .map(|i| (i % flux.width, i / flux.width))
        .filter(|(x, y)| flux.pixel(*x, *y)[..3].iter().any(|v| *v > 0.0))
        .map(|(x, y)| u64::from(x | y << 16))
        .collect();
    let place = |texel: &u64| (texel >> 20, (texel & 0xffff) >> 4, texel >> 16, texel & 0xffff);
    assert!(lit.is_sorted_by_key(place), "the list is in the order of the map");
    lit.sort_unstable();
    expected.sort_unstable();
    assert!(count > 0 && 8 * count < (flux.width * flux.height) as usize, "{count} texels");
    assert_eq!(lit, expected);
    assert_eq!(groups[0][0].as_u64(), Some(count.div_ceil(256) as u64));
}

#[test]
fn what_is_not_worked_on_is_defined() {
    let folder = tempfile::tempdir().expect("temporary folder");
    for (pipeline, kept) in [("acrsm", "split_light"), ("second_order", "half_light"), ("incremental_ir", "importance_map")] {
        let job = |debug| Job {
            pipeline: root().join("pipelines").join(pipeline).with_extension("ron").to_string_lossy().into_owned(),
            debug,
            ..little(&folder).set("visibility", "none").set("culling", true).keep(&[kept])
        };
        let plain = bits(&read(&job(Debug::default()).render(), kept));
        assert!(plain.contains(&0) && plain.iter().any(|v| *v != 0), "{pipeline}: part of it is empty");
        let poisoned = job(Debug { poison: true, shuffle: Some(4), ..Debug::default() });
        assert!(plain == bits(&read(&poisoned.render(), kept)), "{pipeline}: `{kept}` holds what nobody wrote");
    }
}

#[test]
fn a_scene_without_any_surface_has_no_work() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let job = little(&folder);
    fs::write(
        &job.scene,
        LITTLE
            .replace("target: (1.0, 0.5, 0.0)", "target: (0.0, 0.0, -20.0)")
            .replace("target: (0.0, 0.0, 0.0)", "target: (0.0, 20.0, -20.0)"),
    )
    .expect("writable");
    let renderer = job.set("culling", true).keep(&["lit_block_groups", "lit_texel_groups", "culled", "clusters"]).render();
    for resource in ["lit_block_groups", "lit_texel_groups"] {
        let json = renderer.read_json(resource).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(json[0], serde_json::json!([0, 0, 1, 0]), "{resource}");
    }
    assert_eq!(["lights", "culled", "pixels"].map(|field| number(&renderer, "culled", field)), [0.0; 3]);
    assert!(read_clusters(&renderer, "clusters").iter().all(|c| c.count == 0));
    assert!(read(&renderer, "composed").data.chunks_exact(4).all(|pixel| pixel[..3] == [0.0; 3]));
}
