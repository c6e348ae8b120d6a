//! Second-order diffuse light ([SOI]): lights spread evenly over the cone, negative lights, light at half resolution.

use std::{collections::BTreeSet, f64::consts::PI, fs, path::Path};

use crate::{
    clustering::{sums, texels},
    light_kinds::{cases, cornell},
    reference::rgb,
    renders::{Cluster, Job, read, read_clusters},
    support::{manylight, root},
};

fn second_order(job: Job) -> Job {
    Job { pipeline: root().join("pipelines/second_order.ron").to_string_lossy().into_owned(), ..job }.frames(1)
}

/// Largest difference between the distribution of `values` and the uniform one on [0, 1] (Kolmogorov and Smirnov).
fn unevenness(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let count = values.len() as f64;
    values.iter().enumerate().map(|(i, v)| (v - i as f64 / count).abs().max((v - (i + 1) as f64 / count).abs())).fold(0.0, f64::max)
}

fn radical_inverse(base: u32, mut index: u32) -> f64 {
    let (mut sum, mut place) = (0.0, 1.0);
    while index > 0 {
        place /= f64::from(base);
        sum += f64::from(index % base) * place;
        index /= base;
    }
    sum
}

/// Point `index` of the paper's sequence on the unit sphere.
fn on_sphere(index: u32) -> [f64; 3] {
    let (phi, height) = (2.0 * PI * radical_inverse(2, index), 2.0 * radical_inverse(3, index) - 1.0);
    let radius = (1.0 - height * height).sqrt();
    [phi.sin() * radius, phi.cos() * radius, height]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn normalized(v: [f64; 3]) -> [f64; 3] {
    v.map(|x| x / dot(v, v).sqrt())
}

/// Random points would have an unevenness of about 0.03. Of the first N points of the sequence in a cone all are known; a cone of 1° would need 13
/// million points, and has the sequence mapped into it.
#[test]
fn lights_are_spread_evenly_over_the_cone() {
    const COUNT: u32 = 1024;
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["cornell_empty.obj", "cornell_empty.mtl"] {
        fs::copy(root().join("assets").join(name), folder.path().join(name)).expect("copied");
    }
    let file = folder.path().join("scene.ron");
    for cutoff_deg in [1.0_f64, 20.0, 60.0] {
        let text = format!(
            "Scene(
                meshes: [\"cornell_empty.obj\"],
                camera: (origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), fov_x_deg: 39.0),
                lights: [Spot(position: (2.0, 3.0, 0.5), target: (3.0, 2.5, 5.0), intensity: 100.0, beam_deg: 0.5, cutoff_deg: {cutoff_deg})],
            )"
        );
        fs::write(&file, text).expect("written");
        let job = second_order(Job::scene(&file).small()).set("clusters", COUNT).set("negative_lights", 0).keep(&["clusters"]);
        let lights = read_clusters(&job.render(), "clusters");
        let cutoff = cutoff_deg.to_radians();
        // The RSM is a square camera whose field of view is twice the cut-off.
        let plane = |light: &Cluster| light.texel.map(|t| (t / 64.0 - 1.0) * cutoff.tan());
        let height = |light: &Cluster| {
            let [x, y] = plane(light);
            let r2 = x * x + y * y;
            // 1 − cos without cancellation.
            r2 / (1.0 + r2 + (1.0 + r2).sqrt()) / (2.0 * (0.5 * cutoff).sin().powi(2))
        };
        let angle = |light: &Cluster| plane(light)[1].atan2(plane(light)[0]) / (2.0 * PI) + 0.5;
        assert!(lights.iter().all(|light| height(light) <= 1.0 + 1e-3), "{cutoff_deg}°: outside of the cone");
        let uneven = [unevenness(lights.iter().map(height).collect()), unevenness(lights.iter().map(angle).collect())];
        println!("{cutoff_deg}°: {uneven:.4?}");
        assert!(uneven.iter().all(|u| *u < 0.018), "{cutoff_deg}°: {uneven:?}");

        let points: BTreeSet<u32> = lights.iter().map(|light| light.generation).collect();
        assert_eq!(points.len(), COUNT as usize, "{cutoff_deg}°: a point is used twice");
        if cutoff_deg > 1.0 {
            let axis = normalized([1.0, -0.5, 4.5]);
            let first: BTreeSet<u32> = (1..).filter(|i| dot(on_sphere(*i), axis) >= cutoff.cos()).take(COUNT as usize).collect();
            // Rounding may decide a point at the very rim otherwise.
            assert!(points.difference(&first).count() <= 2, "{cutoff_deg}°: not the first points");
        }
    }
}

/// Each tile of an interleaved picture has its share of all lights from everywhere in the cone, so that its sum is nearly that of all.
#[test]
fn the_flux_of_even_lights_is_the_flux_of_the_map() {
    for (count, most) in [(64, 0.1), (256, 0.05), (1024, 0.02)] {
        let job = second_order(Job::asset("cornell").small()).set("rsm_size", 256).set("clusters", count);
        let renderer = job.set("tiles", 2).keep(&["clusters", "rsm_flux"]).render();
        let (rsm, sum) = sums(&renderer);
        let ratios: [f64; 3] = std::array::from_fn(|i| sum[i] / rsm[i]);
        let lights = read_clusters(&renderer, "clusters");
        let tile = |t: usize| lights.iter().skip(t).step_by(4).map(|light| light.flux[1]).sum::<f64>() * 4.0 / rsm[1];
        let tiles = [0, 1, 2, 3].map(tile);
        println!("{count} lights: {ratios:.4?}, tiles {tiles:.4?}");
        assert!(ratios.iter().all(|r| (r - 1.0).abs() < most), "{count} lights: {ratios:?}");
        assert!(tiles.iter().all(|r| (r - 1.0).abs() < 4.0 * most), "{count} lights: {tiles:?}");
    }
}

/// Also where lights share the number: each has its own part of the map.
#[test]
fn lights_of_every_kind_carry_the_flux_of_their_views() {
    const COUNT: usize = 1024;
    let folder = tempfile::tempdir().expect("a temporary folder");
    for (name, sources) in cases() {
        let job = second_order(Job::scene(&cornell(&folder, &sources)).small()).set("clusters", COUNT);
        let renderer = job.keep(&["clusters", "rsm_flux"]).render();
        let map = read(&renderer, "rsm_flux");
        // Cells are square and in one row, six of them for a point light.
        let views: Vec<usize> = sources.iter().map(|source| if source.starts_with("Point") { 6 } else { 1 }).collect();
        let columns = views.iter().sum::<usize>().min(6) as u32;
        let side = map.width / columns;
        let view_of = |x: u32, y: u32| ((y / side) * 6 + x / side) as usize;
        let source_of = |view: usize| {
            views
                .iter()
                .scan(0, |last, n| {
                    *last += n;
                    Some(*last)
                })
                .position(|last| view < last)
        };
        let mut flux = vec![[0.0; 2]; sources.len()];
        for (x, y, texel) in texels(&map) {
            if let Some(source) = source_of(view_of(x, y)) {
                flux[source][0] += texel[1];
            }
        }
        let lights = read_clusters(&renderer, "clusters");
        for light in lights.iter().filter(|light| light.state == 1) {
            let at = light.texel.map(|t| (t as u32).min(map.width - 1));
            flux[source_of(view_of(at[0], at[1])).expect("a light in a view")][1] += light.flux[1];
        }
        for (source, [expected, sum]) in sources.iter().zip(&flux) {
            println!("{name}, {source}: {:.4}", sum / expected);
            assert!(*expected > 0.0 && (sum / expected - 1.0).abs() < 0.05, "{name}, {source}: {sum} W of {expected} W");
        }
    }
}

/// A wall that the light hits, and a larger one that the camera sees from behind, square on: all of the picture is that wall.
const WALLS: &str = "\
v -2 -1 -1\nv -2 1 -1\nv -2 1 1\nv -2 -1 1\nf 1 2 3 4
v 0 -3 -3\nv 0 3 -3\nv 0 3 3\nv 0 -3 3\nf 5 6 7 8
";

const WALL_SCENE: &str = "Scene(
    meshes: [\"walls.obj\"],
    camera: (origin: (4.0, 0.0, 0.0), target: (0.0, 0.0, 0.0), fov_x_deg: 53.13010235415598),
    lights: [Spot(position: (-1.0, 0.0, 0.0), target: (-2.0, 0.0, 0.0), intensity: 10.0, beam_deg: 15.0, cutoff_deg: 20.0)],
)";

/// Half of the field of view has the tangent ½: at a distance of 4 the camera sees 4×4 of the wall. What arrives on that from behind is integrated in 64
/// bits over the same lights.
#[test]
fn negative_flux_is_what_the_visible_surface_blocks() {
    const STEPS: u32 = 200;
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("walls.obj"), WALLS).expect("written");
    let file = folder.path().join("walls.ron");
    fs::write(&file, WALL_SCENE).expect("written");
    for lights in ["vpl", "val"] {
        let job = second_order(Job::scene(&file).small()).set("clusters", 64).set("negative_lights", 256).set("lights", lights);
        let all = read_clusters(&job.set("vpl_clamp", 0.0).keep(&["virtual_lights"]).render(), "virtual_lights");
        let (positive, negative) = all.split_at(64);
        let side = 4.0 / f64::from(STEPS);
        let place = |i: u32| (f64::from(i) + 0.5) * side - 2.0;
        let mut blocked = 0.0;
        for y in 0..STEPS {
            for z in 0..STEPS {
                for light in positive.iter().filter(|light| light.state == 1) {
                    let v = [-light.position[0], place(y) - light.position[1], place(z) - light.position[2]];
                    let d2 = dot(v, v);
                    let cosines = v[0] / d2.sqrt() * (dot(light.normal, v) / d2.sqrt()).max(0.0);
                    let area = if lights == "val" { light.area } else { 0.0 };
                    blocked += light.flux[1] * cosines / (PI * d2 + area) * side * side;
                }
            }
        }
        let sum: f64 = negative.iter().map(|light| light.flux[1]).sum();
        let area: f64 = negative.iter().map(|light| light.area).sum();
        println!("{lights}: {sum} W taken away of {blocked} W, area {area}");
        assert!((sum / blocked + 1.0).abs() < 0.02, "{lights}: {sum} W taken away of {blocked} W");
        assert!((area / 16.0 - 1.0).abs() < 0.02, "{lights}: the negative lights stand for {area} m² of 16");
        assert!(negative.iter().all(|light| light.normal[0] > 0.0), "{lights}: a negative light shines back to where its light comes from");
    }
}

/// Mean absolute difference of two pictures over the mean of the second.
fn difference(a: &manylight_gpu::Image, b: &manylight_gpu::Image) -> f64 {
    let (mut sum, mut mean) = (0.0, 0.0);
    for y in 0..b.height {
        for x in 0..b.width {
            let (a, b) = (rgb(a, x, y), rgb(b, x, y));
            sum += (0..3).map(|i| (a[i] - b[i]).abs()).sum::<f64>();
            mean += b.iter().sum::<f64>();
        }
    }
    sum / mean
}

/// Measured: 18.0 % without, 12.0 % with them; where pixels meet a ninth of the lights each, 25.0 and 18.4 %.
#[test]
fn negative_lights_lower_the_error_by_a_quarter() {
    let job = |name: &str| Job { size: (64, 64), ..Job::asset(name) };
    let reference = Job { pipeline: root().join("pipelines/reference.ron").to_string_lossy().into_owned(), ..job("floating") };
    let reference = read(&reference.set("component", "one_bounce").set("paths", 64).frames(6).render(), "composed");
    let light = |name: &str, count: u32, more: &[(&str, &str)]| {
        let job = more.iter().fold(second_order(job(name)), |job, (name, value)| job.set(name, value));
        read(&job.set("negative_lights", count).keep(&["indirect"]).render(), "indirect")
    };
    for more in [&[][..], &[("lights", "vpl")], &[("scheduling", "tiles"), ("tiles", "3")]] {
        let none = difference(&light("floating", 0, more), &reference);
        let picture = light("floating", 150, more);
        let some = difference(&picture, &reference);
        println!("without {:.2} %, with negative lights {:.2} % ({more:?})", 100.0 * none, 100.0 * some);
        assert!(some < 0.75 * none, "{more:?}: without {none}, with negative lights {some}");
        let least = picture.data.iter().copied().fold(f32::INFINITY, f32::min);
        assert!(least >= 0.0, "{more:?}: negative radiance {least}");
    }
    // All that is seen of an empty box is lit from the front, but for rounding on the lit walls themselves.
    let empty = difference(&light("cornell_empty", 150, &[]), &light("cornell_empty", 0, &[]));
    assert!(empty < 1e-5, "the empty box changes by {empty}");
}

#[test]
fn negative_lights_are_no_addition_to_shadows() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("x.png").to_string_lossy().into_owned();
    let run = |set: &str| {
        manylight(&["render", "second_order", "--scene", "cornell", "--size", "8x8", "--frames", "1", "--set", set, "--out", &out])
    };
    run("visibility=pcss").expect(1).says(&["these values are refused", "negative lights", "set `visibility` to `none`"]);
    run("negative_lights=0").expect(0);
}

/// The same node, with the same positions, lights both: with a threshold of 0 every pixel has the bits of full resolution, at any size.
#[test]
fn half_resolution_with_a_threshold_of_zero_is_full_resolution() {
    for size in [(1, 1), (2, 1), (33, 17), (64, 64)] {
        let job = || second_order(Job { size, ..Job::asset("floating").small() }).set("clusters", 64).keep(&["indirect"]);
        let full = read(&job().set("scheduling", "tiles").render(), "indirect");
        for threshold in ["discontinuity_position", "discontinuity_normal"] {
            assert!(read(&job().set(threshold, 0).render(), "indirect").data == full.data, "{size:?}, {threshold}: the pictures differ");
        }
        let half = read(&job().render(), "indirect");
        assert!(half.data.iter().all(|v| v.is_finite()), "{size:?}");
        // Tiles change where positions are read from and the order of the lights, not the picture.
        let tiled = difference(&read(&job().set("tiles", 3).render(), "indirect"), &half);
        assert!(tiled < 1e-5, "{size:?}: positions in tiles change the picture by {tiled}");
        if size == (64, 64) {
            assert!(half.data != full.data, "nothing is interpolated");
            let error = difference(&half, &full);
            println!("half against full resolution: {:.3} %", 100.0 * error);
            assert!(error < 0.02, "half against full resolution: {error}");
        }
    }
}

#[test]
fn the_share_of_low_resolution_is_what_the_marks_say() {
    for (size, threshold) in [((64, 64), 0.04), ((33, 17), 0.05), ((33, 17), 0.0), ((1, 1), 0.0)] {
        let job = second_order(Job { size, ..Job::asset("floating").small() }).set("discontinuity_position", threshold);
        let renderer = job.keep(&["refinement", "refined_column", "gbuffer_depth"]).render();
        let (columns, depth) = (read(&renderer, "refined_column"), read(&renderer, "gbuffer_depth"));
        let (mut pixels, mut refined) = (0, 0);
        for y in 0..size.1 {
            // Columns count from the left of each row; both values for "none" are near 2³².
            let row: Vec<u32> = (0..size.0).map(|x| columns.pixel(x, y)[0]).filter(|c| *c < 1e9).map(|c| c as u32).collect();
            assert_eq!(row, (0..row.len() as u32).collect::<Vec<_>>(), "{size:?}, row {y}");
            refined += row.len() as u64;
            pixels += (0..size.0).filter(|x| depth.pixel(*x, y)[0] > 0.0).count() as u64;
        }
        let json = renderer.read_json("refinement").unwrap_or_else(|e| panic!("{e}"));
        let count = |name: &str| json[0][name].as_u64().expect("a number");
        assert_eq!((count("pixels"), count("refined")), (pixels, refined), "{size:?}, threshold {threshold}");
        let share = json[0]["low_resolution"].as_f64().expect("a number");
        println!("{size:?}, threshold {threshold}: {share}");
        assert!((share - (1.0 - refined as f64 / pixels.max(1) as f64)).abs() < 1e-6, "{size:?}, threshold {threshold}: {share}");
        if size == (64, 64) {
            assert!((0.5..0.99).contains(&share), "{share}");
        }
    }
}

#[test]
fn the_view_shows_the_marks() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("x.png");
    let out = file.to_string_lossy().into_owned();
    manylight(&["render", "second_order", "--scene", "cornell", "--size", "32x32", "--set", "view=refined", "--out", &out]).expect(0);
    let picture = read_png(&file);
    let red = picture.chunks(3).filter(|p| *p == [255, 0, 0]).count();
    let renderer = second_order(Job { size: (32, 32), ..Job::asset("cornell") }).keep(&["refinement"]).render();
    let json = renderer.read_json("refinement").unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(Some(red as u64), json[0]["refined"].as_u64());
    assert!(red > 0 && red < 32 * 32, "{red}");
}

fn read_png(file: &Path) -> Vec<u8> {
    let picture = manylight::files::read_picture(file).unwrap_or_else(|e| panic!("{e}"));
    picture.data.iter().map(|v| (v * 255.0).round() as u8).collect()
}
