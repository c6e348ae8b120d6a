//! Spot, point and directional lights in the pipelines of virtual lights, one and several at once: what the reflective shadow map reflects, how
//! lights share the virtual lights, and their light against our path tracer.

use std::{
    f64::consts::PI,
    fs,
    path::{Path, PathBuf},
};

use glam::DVec3;
use manylight_gpu::Image;

use crate::{
    blocks::blocks,
    clustering::{sums, texels},
    reference::rgb,
    renders::{Cluster, Job, read, read_clusters},
    support::root,
    twin::{Camera, Light, Triangle, Twin, quad},
};

const CELL: u32 = 128;
const NO_CLUSTER: f32 = u32::MAX as f32;

/// Camera of a scene whose picture nobody looks at.
const CAMERA: Camera = Camera { origin: DVec3::new(0.5, 0.5, 0.9), target: DVec3::new(0.5, 0.4, 0.0), up: DVec3::Y, fov_deg: 60.0 };

/// The unit cube from inside, of one albedo.
fn cube(albedo: DVec3) -> Vec<Triangle> {
    let corner = |i: usize| DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2 & 1) as f64);
    [[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]]
        .into_iter()
        .flat_map(|face| {
            let corners: [DVec3; 4] = face.map(corner);
            let inward = DVec3::splat(0.5) - 0.5 * (corners[0] + corners[2]);
            quad(corners, [inward; 4], albedo)
        })
        .collect()
}

/// Σ flux of the reflective shadow map, W.
fn flux_of(folder: &tempfile::TempDir, twin: &Twin, edit: impl Fn(String) -> String) -> DVec3 {
    let scene = twin.write(folder);
    fs::write(&scene, edit(fs::read_to_string(&scene).expect("a scene"))).expect("written");
    let renderer = Job::scene(&scene).small().frames(1).set("rsm_size", CELL).set("visibility", "none").keep(&["rsm_flux"]).render();
    texels(&read(&renderer, "rsm_flux")).map(|(_, _, flux)| DVec3::from(flux)).sum()
}

/// 4π I ρ from a point light in a closed box, 2π I ρ ∫ f sin θ dθ from a spot light. The sum over texels is a midpoint rule, whose error falls with the
/// square of their size.
#[test]
fn the_flux_of_the_map_is_the_power_that_a_closed_box_reflects_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let (albedo, intensity) = (DVec3::new(0.8, 0.5, 0.2), DVec3::new(1.0, 2.0, 3.0));
    let boxed = |light| Twin { triangles: cube(albedo), lights: vec![light], camera: CAMERA };
    let agrees = |name: &str, flux: DVec3, solid_angle: f64| {
        let ratio = flux / (albedo * intensity * solid_angle);
        println!("{name}: {ratio:.5}");
        assert!((ratio - 1.0).abs().max_element() < 2e-3, "{name}: flux over closed form {ratio}");
    };

    let point = boxed(Light::Point { position: DVec3::new(0.3, 0.6, 0.4), intensity });
    agrees("point", flux_of(&folder, &point, |scene| scene), 4.0 * PI);

    let (beam_deg, cutoff_deg) = (20.0_f64, 40.0_f64);
    let spot =
        boxed(Light::Spot { position: DVec3::new(0.3, 0.6, 0.4), target: DVec3::new(0.9, 0.1, 0.3), intensity, beam_deg, cutoff_deg });
    let linear = |angle: f64| ((cutoff_deg - angle.to_degrees()) / (cutoff_deg - beam_deg)).clamp(0.0, 1.0);
    let smooth = |angle: f64| linear(angle).powi(2) * (3.0 - 2.0 * linear(angle));
    let cosine = |angle: f64| angle.cos() / cutoff_deg.to_radians().cos();
    let falloffs: [(&str, &dyn Fn(f64) -> f64); 3] = [("linear", &linear), ("smooth", &smooth), ("cosine", &cosine)];
    for (name, falloff) in falloffs {
        const STEPS: u32 = 10_000;
        let step = cutoff_deg.to_radians() / f64::from(STEPS);
        let integral: f64 = (0..STEPS).map(|i| (f64::from(i) + 0.5) * step).map(|angle| falloff(angle) * angle.sin() * step).sum();
        let flux = flux_of(&folder, &spot, |scene| scene.replace("cutoff_deg: 40", &format!("falloff: {name}, cutoff_deg: 40")));
        agrees(name, flux, 2.0 * PI * integral);
    }
}

/// ρ E A cos θ from parallel light on a square. Texels are in or out: at its rim the sum is off by a share of a texel's width.
#[test]
fn the_flux_of_the_map_is_what_a_floor_reflects_of_parallel_light() {
    let folder = tempfile::tempdir().expect("a folder");
    let corners = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)].map(|(x, z)| DVec3::new(x, 0.0, z));
    let (albedo, irradiance) = (DVec3::new(0.8, 0.5, 0.2), DVec3::new(1.0, 2.0, 3.0));
    for direction in [DVec3::new(0.0, -1.0, 0.0), DVec3::new(3.0, -4.0, 0.0), DVec3::new(-2.0, -1.0, 2.0)] {
        let twin = Twin {
            triangles: quad(corners, [DVec3::Y; 4], albedo).into(),
            lights: vec![Light::Directional { direction, irradiance }],
            camera: CAMERA,
        };
        let ratio = flux_of(&folder, &twin, |scene| scene) / (albedo * irradiance * 4.0 * -direction.normalize().y);
        println!("{direction}: {ratio:.4}");
        assert!((ratio - 1.0).abs().max_element() < 0.02, "{direction}: flux over closed form {ratio}");
    }
}

const SPOT: &str = "Spot(position: (2.0, 3.9, 1.2), target: (5.4, 4.9, 5.3), intensity: 200.0, beam_deg: 15.0, cutoff_deg: 20.0)";
const POINT: &str = "Point(position: (2.78, 4.0, 2.2), intensity: (8.0, 6.0, 4.0))";
const SUN: &str = "Directional(direction: (0.3, -0.5, 1.0), irradiance: (3.0, 2.0, 1.0))";

/// The Cornell box of the assets under other lights.
pub fn cornell(folder: &tempfile::TempDir, lights: &[&str]) -> PathBuf {
    let mesh = root().join("assets/cornell.obj");
    let camera = "(origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), fov_x_deg: 39.3077)";
    let path = folder.path().join(format!("{}.ron", lights.len()));
    let text = format!("Scene(meshes: [{:?}], camera: {camera}, lights: [{}])", mesh.to_string_lossy(), lights.join(", "));
    fs::write(&path, text).expect("written");
    path
}

pub fn cases() -> [(&'static str, Vec<&'static str>); 4] {
    [("spot", vec![SPOT]), ("point", vec![POINT]), ("directional", vec![SUN]), ("several", vec![SUN, SPOT, POINT])]
}

/// Side of the pictures that are compared with the path tracer's.
const SIZE: u32 = 48;

/// One component of the path tracer's light; its noise is well below the bounds.
fn reference(scene: &Path, component: &str) -> Image {
    let pipeline = root().join("pipelines/reference.ron").to_string_lossy().into_owned();
    let job = Job { pipeline, size: (SIZE, SIZE), ..Job::scene(scene) };
    read(&job.set("component", component).set("paths", 16).frames(8).render(), "composed")
}

/// Energy within 3 %, and blocks of pixels within `most` of the mean on average: single pixels differ at edges, where the path tracer takes means over
/// a pixel.
#[track_caller]
fn assert_near(name: &str, image: &Image, truth: &Image, most: f64) {
    let of =
        |image: &Image| blocks(SIZE, |x, y| rgb(image, x, y), |_, _| [0.0; 3]).into_iter().flat_map(|block| block.0).collect::<Vec<f64>>();
    let (mine, theirs) = (of(image), of(truth));
    let total: f64 = theirs.iter().sum();
    let energy = mine.iter().sum::<f64>() / total;
    let mae = mine.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).sum::<f64>() / total;
    println!("{name}: mean absolute error of blocks {:.2} %, energy {energy:.4}", 100.0 * mae);
    assert!((energy - 1.0).abs() < 0.03, "{name}: energy {energy}");
    assert!(mae < most, "{name}: mean absolute error of blocks {:.2} %", 100.0 * mae);
}

/// Direct light. Texels beyond an edge let light through, one or two wide: parallel light comes along the edges of this box.
#[test]
fn direct_light_of_every_kind_is_that_of_the_path_tracer() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, lights) in cases() {
        let scene = cornell(&folder, &lights);
        let job = Job { size: (SIZE, SIZE), ..Job::scene(&scene) }.frames(1).set("visibility", "none").keep(&["direct"]);
        assert_near(name, &read(&job.render(), "direct"), &reference(&scene, "direct"), 0.1);
    }
}

/// One bounce by samples with exact shadows converges to the path tracer's.
#[test]
fn one_bounce_of_every_kind_is_that_of_the_path_tracer() {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, lights) in cases() {
        let scene = cornell(&folder, &lights);
        let job = Job { size: (SIZE, SIZE), ..Job::scene(&scene) }
            .frames(1)
            .set("sampling", "samples")
            .set("visibility", "exact")
            .set("rsm_size", 256)
            .set("clusters", 1024)
            .set("tiles", 1)
            .set("lights", "vpl")
            .set("indirect.vpl_clamp", 0.0)
            .keep(&["indirect"]);
        assert_near(name, &read(&job.render(), "indirect"), &reference(&scene, "one_bounce"), 0.08);
    }
}

/// View of a texel of a map of cells.
fn view_of(texel: [f64; 2]) -> u32 {
    texel[1] as u32 / CELL * 6 + texel[0] as u32 / CELL
}

fn several(folder: &tempfile::TempDir) -> Job {
    Job::scene(&cornell(folder, &[SUN, SPOT, POINT])).small().set("rsm_size", CELL).set("visibility", "none").set("clusters", 256)
}

/// Lights get virtual lights in proportion to the flux that their views reflect.
#[test]
fn lights_share_the_virtual_lights_by_their_flux() {
    let folder = tempfile::tempdir().expect("a folder");
    let job = several(&folder).set("sampling", "samples").set("importance.view_weight", 0.0).set("clusters", 1024).frames(1);
    let renderer = job.keep(&["clusters", "rsm_flux"]).render();
    let (rsm, sum) = sums(&renderer);
    assert!((0..3).all(|i| (sum[i] / rsm[i] - 1.0).abs() < 0.03), "{sum:?} W of {rsm:?} W");
    let mut flux = [0.0; 12];
    for (x, y, value) in texels(&read(&renderer, "rsm_flux")) {
        // Importance has the brightest colour.
        flux[view_of([f64::from(x), f64::from(y)]) as usize] += value.into_iter().fold(0.0, f64::max);
    }
    let mut count = [0.0; 12];
    for cluster in read_clusters(&renderer, "clusters").iter().filter(|c| c.count > 0) {
        count[view_of(cluster.texel) as usize] += 1.0;
    }
    let (all_flux, all): (f64, f64) = (flux.iter().sum(), count.iter().sum());
    println!("flux {flux:.2?}, lights {count:?}");
    assert!(all > 1000.0, "{all} lights");
    for view in 0..12 {
        let (share, expected) = (count[view] / all, flux[view] / all_flux);
        // Importance leaves out how the solid angle of texels falls to the corners of a view.
        assert!((share - expected).abs() < 0.02 + 0.25 * expected, "view {view}: {share} of the lights, {expected} of the flux");
    }
}

/// Each cluster is of one view, in which it may move, and all of the map's flux is in some cluster.
#[test]
fn clusters_stay_within_a_view_and_keep_the_energy() {
    let folder = tempfile::tempdir().expect("a folder");
    for mapping in ["window", "exact"] {
        let keep = ["clusters", "clusters_warped", "cluster_map", "rsm_flux"];
        let renderer = several(&folder).set("mapping", mapping).frames(12).keep(&keep).render();
        let (rsm, sum) = sums(&renderer);
        assert!((0..3).all(|i| (sum[i] / rsm[i] - 1.0).abs() < 1e-3), "{mapping}: {sum:?} W of {rsm:?} W");
        let map = read(&renderer, "cluster_map");
        assert_eq!((map.width, map.height), (6 * CELL, 2 * CELL));
        let (before, after): (Vec<Cluster>, Vec<Cluster>) =
            (read_clusters(&renderer, "clusters_warped"), read_clusters(&renderer, "clusters"));
        let mut lit = 0;
        for (x, y, flux) in texels(&read(&renderer, "rsm_flux")) {
            if flux.iter().any(|v| *v > 0.0) {
                let cluster = map.pixel(x, y)[0];
                assert_ne!(cluster, NO_CLUSTER, "{mapping}: texel {x}, {y}");
                let view = view_of([f64::from(x), f64::from(y)]);
                assert_eq!(view_of(before[cluster as usize].texel), view, "{mapping}: texel {x}, {y}");
                assert_eq!(view_of(after[cluster as usize].texel), view, "{mapping}: texel {x}, {y}");
                lit += 1;
            }
        }
        assert!(lit > 10_000, "{lit} lit texels");
    }
}

/// A light so weak that no cluster is seeded in its view: its flux is not lost.
#[test]
fn the_flux_of_a_view_without_clusters_goes_to_others() {
    let folder = tempfile::tempdir().expect("a folder");
    let weak = "Spot(position: (4.0, 4.9, 1.2), target: (2.0, 0.0, 3.0), intensity: 0.002, beam_deg: 15.0, cutoff_deg: 20.0)";
    let job = Job::scene(&cornell(&folder, &[SPOT, weak])).small().set("rsm_size", CELL).set("visibility", "none").set("clusters", 16);
    let renderer = job.keep(&["clusters", "cluster_map", "rsm_flux"]).render();
    let clusters = read_clusters(&renderer, "clusters");
    assert!(clusters.iter().filter(|c| c.count > 0).all(|c| view_of(c.texel) == 0), "the weak light has a cluster: the test shows nothing");
    let (rsm, sum) = sums(&renderer);
    assert!((0..3).all(|i| (sum[i] / rsm[i] - 1.0).abs() < 1e-6), "{sum:?} W of {rsm:?} W");
    let weak_flux: f64 = texels(&read(&renderer, "rsm_flux")).filter(|(x, ..)| *x >= CELL).map(|(.., flux)| flux[0]).sum();
    assert!(weak_flux > 1e-6 * rsm[0], "the weak light reflects {weak_flux} W");
}

/// What does not fit into a texture is said, with the parameter that makes it fit.
#[test]
fn more_views_than_a_texture_holds_are_a_message() {
    let folder = tempfile::tempdir().expect("a folder");
    let lights = [POINT; 40];
    let scene = cornell(&folder, &lights).to_string_lossy().into_owned();
    let out = folder.path().join("x.png").to_string_lossy().into_owned();
    let render = |size: &str| {
        let set = format!("rsm_size={size}");
        crate::support::manylight(&[
            "render",
            "pipelines/acrsm.ron",
            "--scene",
            &scene,
            "--size",
            "16x16",
            "--frames",
            "1",
            "--set",
            &set,
            "--out",
            &out,
        ])
    };
    render("512").expect(1).says(&["rsm_albedo", "16384", "20480"]);
    render("32").expect(0);
}
