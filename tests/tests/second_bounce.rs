//! Virtual lights of the second bounce: their energy, what they add to the picture, and their shadows.

use std::{f64::consts::PI, fs, path::Path};

use manylight_passes::{Renderer, Settings};

use crate::{
    reference::rgb,
    renders::{Cluster, Job, read, read_clusters},
    support::root,
};

/// With so many lights of the second bounce.
fn second_lights(job: Job, count: usize) -> Job {
    if count == 0 { job } else { job.set("second_bounce", "on").set("second_lights", count) }
}

/// Sum over the lights that shine, W.
fn flux(lights: &[Cluster]) -> [f64; 3] {
    [0, 1, 2].map(|i| lights.iter().filter(|light| light.state == 1).map(|light| light.flux[i]).sum())
}

/// Mean of a picture over all pixels and channels.
fn mean(image: &manylight_gpu::Image) -> f64 {
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let (sum, count) = pixels.fold((0.0, 0.0), |(sum, count), (x, y)| (sum + rgb(image, x, y).iter().sum::<f64>(), count + 3.0));
    sum / count
}

/// Mean absolute difference over the mean of the second.
fn error(image: &manylight_gpu::Image, reference: &manylight_gpu::Image) -> f64 {
    let pixels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let apart = |(x, y)| (0..3).map(|i| (rgb(image, x, y)[i] - rgb(reference, x, y)[i]).abs()).sum::<f64>();
    pixels.map(apart).sum::<f64>() / (3 * image.width * image.height) as f64 / mean(reference)
}

/// A hollow sphere with a light in its middle, of an albedo: what it reflects once, it reflects twice times the albedo, and all of it.
fn sphere(folder: &Path, albedo: f64) -> Job {
    let mesh = fs::read_to_string(root().join("assets/sphere.obj")).expect("readable");
    fs::write(folder.join("wall.obj"), mesh.replace("objects.mtl", "wall.mtl")).expect("writable");
    fs::write(folder.join("wall.mtl"), format!("newmtl ball\nKd {albedo} {albedo} {albedo}\n")).expect("writable");
    let text = "Scene(
        meshes: [Mesh(file: \"wall.obj\", transform: (scale: 2.0))],
        camera: (origin: (1.1, 0.3, -0.2), target: (-2.0, 0.0, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 90.0),
        lights: [Point(position: (0.0, 0.0, 0.0), intensity: (3.0, 3.0, 3.0))],
    )";
    fs::write(folder.join("sphere.ron"), text).expect("writable");
    Job { size: (48, 48), ..Job::scene(&folder.join("sphere.ron")) }.frames(8).set("rsm_size", 64)
}

/// Directions below a facet's plane, which smooth normals allow, still meet the sphere, as they do in the path tracer.
#[test]
fn in_a_hollow_sphere_no_light_of_the_second_bounce_is_lost() {
    const ALBEDO: f64 = 0.5;
    let folder = tempfile::tempdir().expect("temporary folder");
    let job = second_lights(sphere(folder.path(), ALBEDO), 512).set("clusters", 256);
    let renderer = job.keep(&["clusters", "second_bounce", "indirect"]).render();
    let (first, lights) = (read_clusters(&renderer, "clusters"), read_clusters(&renderer, "second_bounce"));
    assert!(lights.iter().all(|light| light.state == 1 && light.count == 1), "a ray left a closed room");
    let share = flux(&lights)[1] / flux(&first)[1];
    // Each wall that is as large as the sphere: 4 π R², less what facets cut off.
    let area = lights.iter().map(|light| light.area).sum::<f64>() / (16.0 * PI);
    let twice = mean(&read(&renderer, "indirect")) / (ALBEDO * ALBEDO * 3.0 / (4.0 * PI) * (1.0 + ALBEDO));
    println!("flux {share:.4} of the first bounce, area {area:.3} of the sphere, light {twice:.4} of the analytic value");
    assert!((share / ALBEDO - 1.0).abs() < 0.02, "flux: {share}");
    assert!((area - 1.0).abs() < 0.15, "area: {area}");
    assert!((twice - 1.0).abs() < 0.06, "light: {twice}");
}

/// Frames in which clusters come near their places.
const FRAMES: u32 = 4;

/// The Cornell boxes, small.
fn cornell(name: &str) -> Job {
    Job { size: (48, 48), ..Job::asset(name) }
        .frames(FRAMES)
        .set("rsm_size", 128)
        .set("ism_size", 64)
        .set("clusters", 256)
        .keep(&["indirect"])
}

fn traced(name: &str, component: &str) -> manylight_gpu::Image {
    let pipeline = root().join("pipelines/reference.ron").to_string_lossy().into_owned();
    let job = Job { size: (48, 48), pipeline, ..Job::asset(name) }.set("component", component).set("paths", 32);
    read(&job.frames(6).render(), "composed")
}

/// What the second bounce adds is what it adds to the path-traced picture, less what the area of lights takes from near surfaces (as of the first
/// bounce, whose energy is 0.93 and 0.96 there); and against all bounces error falls and energy rises.
#[test]
fn the_second_bounce_adds_what_it_adds_in_the_path_tracer() {
    for name in ["cornell", "cornell_empty"] {
        let (one, two, all) = (traced(name, "one_bounce"), traced(name, "two_bounces"), traced(name, "indirect"));
        let exact = || cornell(name).set("visibility", "exact");
        let without = read(&exact().render(), "indirect");
        let with = read(&second_lights(exact(), 256).render(), "indirect");
        let added = (mean(&with) - mean(&without)) / (mean(&two) - mean(&one));
        let (before, after) = (error(&without, &all), error(&with, &all));
        let (dark, bright) = (mean(&without) / mean(&all), mean(&with) / mean(&all));
        println!(
            "{name}: adds {added:.3} of the second bounce; of all bounces error {before:.3} → {after:.3}, energy {dark:.3} → {bright:.3}"
        );
        assert!((0.85..1.05).contains(&added), "{name}: {added}");
        assert!(after < 0.7 * before, "{name}: error {before} → {after}");
        assert!(bright > 1.3 * dark && bright < 1.0, "{name}: energy {dark} → {bright}");
        assert!(error(&with, &two) < 1.4 * error(&without, &one) + 0.05, "{name}");
    }
}

/// What lights of the second bounce add to the mean, with values set besides those of `job`. One renderer goes through all of them: what stays as it
/// was need not be compiled again.
struct Added {
    renderer: Renderer,
    set: Vec<(String, String)>,
}

impl Added {
    fn new(job: &Job) -> Self {
        let renderer = job.renderer();
        Self { set: renderer.settings().set.clone(), renderer }
    }

    fn by(&mut self, set: &[(&str, &str)]) -> f64 {
        let mut mean = |switch: &str| {
            let more = set.iter().copied().chain([("second_bounce", switch), ("second_lights", "256")]);
            let set = self.set.iter().cloned().chain(more.map(|(name, value)| (name.to_owned(), value.to_owned())));
            let settings = Settings { set: set.collect(), ..self.renderer.settings().clone() };
            self.renderer.set(settings).unwrap_or_else(|e| panic!("{}", e.render()));
            for _ in 0..FRAMES {
                self.renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
            }
            mean(&read(&self.renderer, "indirect"))
        };
        mean("on") - mean("off")
    }
}

/// The path tracer has an answer to each, so has every way to make shadows: light of the second bounce stays behind what is in its way.
#[test]
fn lights_of_the_second_bounce_cast_shadows_of_every_kind() {
    let mut added = Added::new(&cornell("cornell").set("point_count", 256_000));
    let (exact, none) = (added.by(&[("visibility", "exact")]), added.by(&[("visibility", "none")]));
    assert!(none > 1.08 * exact, "there is nothing in the way: {none}, {exact}");
    let kinds: [&[(&str, &str)]; 6] = [
        &[("visibility", "simple"), ("maps", "traced")],
        &[("visibility", "simple"), ("maps", "rasterized")],
        &[("visibility", "pcss"), ("maps", "traced")],
        &[("visibility", "pcss"), ("maps", "imperfect")],
        &[("visibility", "cssm"), ("maps", "rasterized")],
        &[("visibility", "pcss"), ("maps", "traced"), ("casters", "64")],
    ];
    for kind in kinds {
        let blocked = (none - added.by(kind)) / (none - exact);
        println!("{kind:?}: {blocked:.2} of what rays find blocked");
        assert!((0.5..1.6).contains(&blocked), "{kind:?}: {blocked}");
    }
}

/// In all ways to choose the lights of the first bounce and to light pixels. A seed may move lights, and with it the mean by its noise.
#[test]
fn the_second_bounce_goes_with_all_samplings_and_schedules() {
    let mut added = Added::new(&Job { seed: 7, ..cornell("cornell") }.set("visibility", "exact"));
    let usual = added.by(&[]);
    for set in [
        &[("sampling", "samples")][..],
        &[("sampling", "sphere")],
        &[("sampling", "incremental")],
        &[("lights", "vpl")],
        &[("scheduling", "half")],
        &[("tiles", "1")],
        &[("tiles", "8")],
        &[("second_bounce.tiles", "5")],
    ] {
        let ratio = added.by(set) / usual;
        println!("{set:?}: {ratio:.3}");
        assert!((ratio - 1.0).abs() < 0.15, "{set:?}: {ratio}");
    }
}

/// One wall in the open: what it reflects is lost, and every light of the second bounce is idle.
#[test]
fn light_that_leaves_the_scene_is_lost() {
    let folder = tempfile::tempdir().expect("temporary folder");
    fs::write(folder.path().join("wall.obj"), "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n").expect("writable");
    let text = "Scene(
        meshes: [\"wall.obj\"],
        camera: (origin: (0.0, 0.0, 4.0), target: (0.0, 0.0, 0.0), fov_x_deg: 40.0),
        lights: [Spot(position: (0.0, 0.5, 2.0), target: (0.0, 0.0, 0.0), intensity: 10.0, beam_deg: 15.0, cutoff_deg: 20.0)],
    )";
    let scene = folder.path().join("scene.ron");
    fs::write(&scene, text).expect("writable");
    let job = |n| second_lights(Job::scene(&scene).small(), n).set("visibility", "exact").keep(&["virtual_lights"]);
    let with = job(64).keep(&["second_bounce"]).render();
    assert!(read_clusters(&with, "second_bounce").iter().all(|light| light.state == 0));
    let without = job(0).render();
    assert!(read(&with, "composed").data == read(&without, "composed").data);
    assert_eq!(read_clusters(&with, "virtual_lights").len(), read_clusters(&without, "virtual_lights").len() + 64);
}

/// First, second, negative, in this order; negative lights take back what both send through surfaces.
#[test]
fn negative_lights_take_back_light_of_both_bounces() {
    let job = || {
        let pipeline = root().join("pipelines/second_order.ron").to_string_lossy().into_owned();
        Job { pipeline, ..cornell("cornell") }.frames(1).set("negative_lights", 100)
    };
    let taken = |n: usize| {
        let job = second_lights(job(), n).keep(&["virtual_lights", "clusters"]);
        let renderer = if n > 0 { job.keep(&["second_bounce"]) } else { job }.render();
        let (all, first) = (read_clusters(&renderer, "virtual_lights"), read_clusters(&renderer, "clusters"));
        assert_eq!(all.len(), first.len() + n + 100);
        let same = |a: &[Cluster], b: &[Cluster]| a.iter().zip(b).all(|(a, b)| a.position == b.position && a.flux == b.flux);
        assert!(same(&all, &first));
        if n > 0 {
            assert!(same(&all[first.len()..], &read_clusters(&renderer, "second_bounce")));
        }
        assert!(all[..first.len() + n].iter().all(|light| light.flux[1] >= 0.0));
        assert!(all[first.len() + n..].iter().all(|light| light.flux[1] <= 0.0));
        -flux(&all[first.len() + n..])[1]
    };
    let (once, twice) = (taken(0), taken(128));
    println!("taken back: {once:.3} W of one bounce, {twice:.3} W of two");
    assert!(once > 0.0 && twice > 1.05 * once);
}
