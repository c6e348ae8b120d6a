//! Precomputed indirect light: sky light, `manylight bake`, its file and the pipeline `precomputed`.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::{Arc, OnceLock},
    thread::sleep,
    time::{Duration, Instant},
};

use manylight_gpu::Image;
use manylight_passes::Baked;

use crate::{
    renders::{Job, read},
    support::{command, manylight, root},
};

const SIZE: (u32, u32) = (24, 18);
const PATHS: u32 = 32;
const HOUR: f64 = 3600.0;

fn job(pipeline: &str, scene: &Path) -> Job {
    let pipeline = root().join("pipelines").join(pipeline).to_string_lossy().into_owned();
    Job { pipeline, size: SIZE, ..Job::scene(scene) }
}

fn rgb(image: &Image) -> Vec<f32> {
    image.data.chunks_exact(4).flat_map(|pixel| pixel[..3].to_vec()).collect()
}

fn mean(values: &[f32]) -> f64 {
    values.iter().map(|v| f64::from(*v)).sum::<f64>() / values.len() as f64
}

/// Root of the mean squared difference over the mean of the second.
fn error(image: &[f32], reference: &[f32]) -> f64 {
    let squares: f64 = image.iter().zip(reference).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    (squares / image.len() as f64).sqrt() / mean(reference)
}

/// Means over blocks of 3×3 pixels: noise of single pixels and texels is a third there, what is wrong over some area stays.
fn blocks(image: &[f32]) -> Vec<f32> {
    let (width, height) = (SIZE.0 as usize / 3, SIZE.1 as usize / 3);
    let pixel = |x: usize, y: usize, channel: usize| image[3 * (y * SIZE.0 as usize + x) + channel];
    let mean = |i: usize| {
        let (x, y, channel) = (i / 3 % width, i / 3 / width, i % 3);
        (0..9).map(|j| pixel(3 * x + j % 3, 3 * y + j / 3, channel)).sum::<f32>() / 9.0
    };
    (0..3 * width * height).map(mean).collect()
}

/// Light of the reference at a time.
fn traced(component: &str, time: f64, paths: u32, frames: u32) -> Vec<f32> {
    let mut renderer = job("reference.ron", &root().join("assets/day.ron")).set("component", component).set("paths", paths).renderer();
    for _ in 0..frames {
        renderer.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
    }
    rgb(&read(&renderer, "composed"))
}

/// What `manylight bake` needs for a small day with a key frame every hour.
fn bake(out: &Path, work: &Path, more: &[&str]) -> Vec<String> {
    let (size, paths) = (format!("{}x{}", SIZE.0, SIZE.1), PATHS.to_string());
    let (out, work) = (out.to_string_lossy(), work.to_string_lossy());
    let all = ["bake", "assets/day.ron", "--size", &size, "--paths", &paths, "--interval", "1h", "--out", &out, "--work", &work];
    all.iter().chain(more).map(|text| (*text).to_owned()).collect()
}

fn run(arguments: &[String]) -> crate::support::Run {
    manylight(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
}

/// A day with all of its components, baked once for all tests.
fn day() -> &'static (tempfile::TempDir, PathBuf) {
    static DAY: OnceLock<(tempfile::TempDir, PathBuf)> = OnceLock::new();
    DAY.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("day.baked");
        run(&bake(&file, &folder.path().join("work"), &["--variance", "1"])).expect(0).says(&["24 key frames", "dark", "components"]);
        (folder, file)
    })
}

fn baked(file: &Path) -> Arc<Baked> {
    Arc::new(Baked::from_bytes(&fs::read(file).expect("a file")).expect("baked light"))
}

/// A floor that fills the picture, seen from above.
fn floor(folder: &Path, rest: &str) -> PathBuf {
    let mesh = "mtllib f.mtl\nv -9 0 -9\nv -9 0 9\nv 9 0 9\nv 9 0 -9\nusemtl grey\nf 1 2 3 4\n";
    let camera = "camera: (origin: (0, 1, 0), target: (0, 0, 0), up: (0, 0, -1), fov_x_deg: 60)";
    for (name, text) in [
        ("f.obj", mesh.to_owned()),
        ("f.mtl", "newmtl grey\nKd 0.2 0.4 0.8\n".to_owned()),
        ("f.ron", format!("Scene(meshes: [\"f.obj\"], {camera}, {rest})")),
    ] {
        fs::write(folder.join(name), text).expect("written");
    }
    folder.join("f.ron")
}

/// Under a uniform sky L a floor of albedo ρ has the radiance ρ L; under one that grows from H at the horizon to Z with the sine of the elevation it has
/// ρ (H + (Z − H) 2/3), as the mean of the cosine over cosine-distributed directions is 2/3.
#[test]
fn sky_light_on_a_floor_has_its_closed_form() {
    let folder = tempfile::tempdir().expect("a folder");
    // Every path under a uniform sky has the same value. With 256 paths of a Sobol sequence in each of 432 pixels the mean is known to better than 0.1 %.
    let cases = [("sky: (1, 2, 4)", [1.0, 2.0, 4.0], 1e-5), ("sky: Sky(zenith: (4, 1, 1), horizon: (1, 4, 1))", [3.0, 2.0, 1.0], 2e-3)];
    for (sky, expected, tolerance) in cases {
        let scene = floor(folder.path(), &format!("lights: [], {sky}"));
        for component in ["sky", "full"] {
            let renderer = job("reference.ron", &scene).set("component", component).set("paths", 256).frames(1).render();
            let image = rgb(&read(&renderer, "composed"));
            for (channel, albedo) in [0.2, 0.4, 0.8].into_iter().enumerate() {
                let own: Vec<f32> = image.iter().skip(channel).step_by(3).copied().collect();
                let ratio = mean(&own) / (albedo * expected[channel]);
                assert!((ratio - 1.0).abs() < tolerance, "{sky}, {component}, channel {channel}: {ratio}");
            }
        }
        let renderer = job("reference.ron", &scene).set("component", "indirect").set("paths", 4).frames(1).render();
        assert!(rgb(&read(&renderer, "composed")).iter().all(|v| *v == 0.0), "the sky is no light of the lights");
    }
}

/// Full light is that of the lights themselves, over further surfaces, and of the sky. The components share their random numbers in part only: means over the
/// picture of 256 paths a pixel differ by noise, which is below 3 % here.
#[test]
fn components_add_up_to_full_light() {
    let noon = 12.0 * HOUR;
    let parts: f64 = ["direct", "indirect", "sky"].map(|component| mean(&traced(component, noon, 256, 1))).iter().sum();
    let full = mean(&traced("full", noon, 256, 1));
    println!("sum of the components over full light: {:.4}", parts / full);
    assert!((parts / full - 1.0).abs() < 0.03, "{parts} {full}");
}

/// A picture at the time of a key frame is that key frame, in the precision of half floats. All components are kept: what is left is that every layer
/// is off by 2⁻¹¹ of its largest value; 1 % of the picture's largest value is far above the sum of that for some twenty layers.
#[test]
fn a_picture_at_a_key_frame_is_the_key_frame() {
    let (_, file) = day();
    let light = baked(file);
    let mut renderer =
        job("precomputed.ron", &root().join("assets/day.ron")).set("sky", false).keep(&["indirect"]).baked(&light).renderer();
    for hour in [9.0, 12.0, 15.0] {
        renderer.render_frame(hour * HOUR).unwrap_or_else(|e| panic!("{e}"));
        let image = read(&renderer, "indirect");
        assert!(image.data.chunks_exact(4).all(|pixel| pixel[3] == 1.0), "every surface was there");
        // The same paths as the bake's: its seed, its first frame.
        let mut reference = job("reference.ron", &root().join("assets/day.ron")).set("component", "indirect").set("paths", PATHS);
        reference.seed = manylight::lab::bake::SEED;
        let mut reference = reference.renderer();
        reference.render_frame(hour * HOUR).unwrap_or_else(|e| panic!("{e}"));
        let reference = rgb(&read(&reference, "composed"));
        let largest = reference.iter().fold(0.0_f32, |a, b| a.max(*b));
        let worst = rgb(&image).iter().zip(&reference).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        println!("{hour} h: off by {:.2e} of the largest value", worst / largest);
        assert!(worst <= 0.01 * largest, "{hour} h: {worst} of {largest}");
    }
}

/// Between key frames an hour apart the interpolated light is nearer to the truth than the key frame before it, and has its energy.
#[test]
fn light_between_key_frames_is_interpolated() {
    let (_, file) = day();
    let light = baked(file);
    let mut renderer =
        job("precomputed.ron", &root().join("assets/day.ron")).set("sky", false).keep(&["indirect"]).baked(&light).renderer();
    let mut at = |time: f64| {
        renderer.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
        rgb(&read(&renderer, "indirect"))
    };
    for hour in [8.0, 16.0] {
        let truth = traced("indirect", (hour + 0.5) * HOUR, 256, 2);
        let (between, before) = (at((hour + 0.5) * HOUR), at(hour * HOUR));
        let (own, other) = (error(&between, &truth), error(&before, &truth));
        println!("{hour}:30: error {own:.3}, of the key frame before {other:.3}, energy {:.3}", mean(&between) / mean(&truth));
        assert!(own < other && (mean(&between) / mean(&truth) - 1.0).abs() < 0.15, "{own} {other}");
    }
}

/// Direct light and sky are there as well: the whole picture has the energy of the path tracer's, by day and by night.
#[test]
fn the_whole_picture_has_the_energy_of_full_light() {
    let (_, file) = day();
    let light = baked(file);
    let mut renderer = job("precomputed.ron", &root().join("assets/day.ron")).baked(&light).renderer();
    let mut at = |time: f64| {
        renderer.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
        mean(&rgb(&read(&renderer, "composed")))
    };
    let ratio = at(12.0 * HOUR) / mean(&traced("full", 12.0 * HOUR, 256, 1));
    println!("energy at noon over that of the path tracer: {ratio:.4}");
    // 32 paths a pixel in the key frame, and direct light at pixel centres instead of over pixels.
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
    assert_eq!(at(0.0), 0.0, "night");
}

/// A bake that is killed goes on where it was, and its file is that of one that was not.
#[test]
fn a_killed_bake_goes_on_and_has_the_same_bytes() {
    let (folder, file) = day();
    let (work, other) = (folder.path().join("killed"), folder.path().join("other.baked"));
    let arguments = bake(&other, &work, &["--variance", "1"]);
    let frames =
        || fs::read_dir(&work).map_or(0, |entries| entries.flatten().filter(|e| e.path().extension().is_some_and(|e| e == "exr")).count());
    let mut child = command(&arguments.iter().map(String::as_str).collect::<Vec<_>>()).spawn().expect("starts");
    let start = Instant::now();
    while frames() < 3 && start.elapsed() < Duration::from_secs(300) {
        sleep(Duration::from_millis(20));
    }
    child.kill().expect("still runs");
    child.wait().expect("ends");
    let before = frames();
    assert!(before >= 3 && !other.exists(), "killed too late");
    run(&arguments).expect(0).says(&[&format!("{before} found")]);
    assert_eq!(fs::read(&other).expect("a file"), fs::read(file).expect("a file"));
}

#[test]
fn bisection_keeps_fewer_key_frames() {
    let (folder, file) = day();
    let other = folder.path().join("bisected.baked");
    // The same work folder: frames at full hours are shared where the times agree.
    run(&bake(&other, &folder.path().join("work"), &["--threshold", "0.05", "--components", "3"])).expect(0);
    let (uniform, bisected) = (baked(file).header.clone(), baked(&other).header.clone());
    assert!(bisected.keys.len() < uniform.keys.len() && bisected.keys.len() >= 8, "{:?}", bisected.keys);
    assert_eq!(bisected.components, 3);
}

#[test]
fn light_that_does_not_fit_is_refused_with_a_reason() {
    let (folder, file) = day();
    let file = file.to_string_lossy();
    let picture = folder.path().join("x.png").to_string_lossy().into_owned();
    let render = |scene: &str, more: &[&str]| {
        let all = ["render", "precomputed", "--scene", scene, "--frames", "1", "--out", &picture];
        manylight(&all.iter().chain(more).copied().collect::<Vec<_>>())
    };
    render("day", &["--size", "24x18"]).expect(1).says(&["precomputed light, and there is none", "manylight bake", "--baked"]);
    render("cornell", &["--size", "24x18", "--baked", &file]).expect(1).says(&["baked from the scene `day`", "bake it again"]);
    render("day", &["--size", "18x24", "--baked", &file]).expect(1).says(&["24×18", "proportions"]);
    render("day", &["--size", "24x18", "--baked", "assets/day.obj"]).expect(1).says(&["day.obj", "no file of baked light"]);
    let damaged = folder.path().join("damaged.baked");
    let mut bytes = fs::read(&*file).expect("a file");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&damaged, bytes).expect("written");
    render("day", &["--size", "24x18", "--baked", &damaged.to_string_lossy()]).expect(1).says(&["damaged", "bake it again"]);
    // Pictures of another size are interpolated.
    render("day", &["--size", "48x36", "--baked", &file]).expect(0);
    manylight(&["bake", "day", "--out", "x.baked", "--interval", "soon"]).expect(2).says(&["5min"]);
    manylight(&["bake", "day"]).expect(2);
}

/// The room of `day` with another camera: what stands instead of its field of view.
fn moving(folder: &Path, camera: &str) -> PathBuf {
    let assets = root().join("assets");
    let text = fs::read_to_string(assets.join("day.ron")).expect("a text");
    let text = text.replace("\"day.obj\"", &format!("{:?}", assets.join("day.obj").to_string_lossy()));
    fs::write(folder.join("moving.ron"), text.replace("fov_x_deg: 72.0", camera)).expect("written");
    folder.join("moving.ron")
}

/// The room of `day` whose camera is that of `day` until noon and has gone to another corner by two o'clock.
fn walk(folder: &Path) -> PathBuf {
    moving(folder, "fov_x_deg: 72.0, motion: [(time: 43200.0), (time: 50400.0, origin: (3.4, 1.6, 1.2), target: (0.6, 1.0, 4.6))]")
}

/// Light over the surfaces of that room, with all of its components and a key frame every two hours, baked once for all tests.
fn walked() -> &'static (tempfile::TempDir, PathBuf, PathBuf) {
    static WALK: OnceLock<(tempfile::TempDir, PathBuf, PathBuf)> = OnceLock::new();
    WALK.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let (scene, file) = (walk(folder.path()), folder.path().join("walk.baked"));
        run(&bake_atlas(&scene, &file, &folder.path().join("work"))).expect(0).says(&["12 key frames", "8 frames traced"]);
        (folder, scene, file)
    })
}

fn bake_atlas(scene: &Path, out: &Path, work: &Path) -> Vec<String> {
    bake_moving(scene, out, work, &["--lookup", "atlas", "--texels", "4096", "--interval", "2h"])
}

fn bake_moving(scene: &Path, out: &Path, work: &Path, lookup: &[&str]) -> Vec<String> {
    let [scene, out, work] = [scene, out, work].map(|path| path.to_string_lossy().into_owned());
    let files = ["bake", &scene, "--out", &out, "--work", &work, "--paths", "64", "--variance", "1"];
    files.iter().chain(lookup).map(|text| (*text).to_owned()).collect()
}

/// From wherever the camera is, light of an atlas agrees with the path tracer's: its energy to 5 % and the means of 3×3 pixels to 20 % of the mean, which is
/// what texels of 0.2 m and 64 paths leave. The other camera's picture is farther off by a multiple.
#[test]
fn a_moving_camera_sees_the_light_that_is_there() {
    let (_, scene, file) = walked();
    let light = baked(file);
    let mut renderer = job("precomputed.ron", scene).keep(&["indirect"]).baked(&light).set("sky", false).renderer();
    let mut reference = job("reference.ron", scene).set("component", "indirect").set("paths", 256).renderer();
    let mut pictures = Vec::new();
    for hour in [12.0, 14.0] {
        renderer.render_frame(hour * HOUR).unwrap_or_else(|e| panic!("{e}"));
        reference.render_frame(hour * HOUR).unwrap_or_else(|e| panic!("{e}"));
        let (image, truth) = (read(&renderer, "indirect"), rgb(&read(&reference, "composed")));
        assert!(image.data.chunks_exact(4).all(|pixel| pixel[3] == 1.0), "every surface has a place in the atlas");
        let image = rgb(&image);
        let (energy, off) = (mean(&image) / mean(&truth), error(&blocks(&image), &blocks(&truth)));
        println!("{hour} h: energy {energy:.4}, error {off:.4}");
        assert!((energy - 1.0).abs() < 0.05 && off < 0.2, "{energy} {off}");
        pictures.push(truth);
    }
    let other = error(&blocks(&pictures[0]), &blocks(&pictures[1]));
    println!("from one camera to the other: {other:.4}");
    assert!(other > 0.5, "the cameras see other things: {other}");
}

/// The room of `day` with a camera that turns round in it, looks up, and looks down.
fn turn(folder: &Path) -> PathBuf {
    let keys = [(8, "(3.6, 1.05, 0.6)"), (10, "(0.1, 1.2, 3)"), (12, "(1, 5, 4.5)"), (14, "(0.7, 0, 4.5)")];
    let keys: String = keys.iter().map(|(hour, target)| format!("(time: {}, target: {target}), ", 3600 * hour)).collect();
    moving(folder, &format!("fov_x_deg: 100, motion: [{keys}]"))
}

/// A cube holds what is seen in all directions: wherever the camera looks, surfaces are found at their distance but for 5 % of the pixels (silhouettes, with
/// texels as large as pixels), and light of the others has the path tracer's energy to 5 % and its means of 3×3 pixels to 20 % of the mean.
#[test]
fn a_turning_camera_sees_the_light_that_is_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let (scene, file, work) = (turn(folder.path()), folder.path().join("turn.baked"), folder.path().join("work"));
    let bake = bake_moving(&scene, &file, &work, &["--lookup", "cube", "--side", "24", "--interval", "2h"]);
    run(&bake).expect(0).says(&["72×48 texels"]);
    let mut renderer = job("precomputed.ron", &scene).keep(&["indirect"]).baked(&baked(&file)).set("sky", false).renderer();
    let mut reference = job("reference.ron", &scene).set("component", "indirect").set("paths", 256).renderer();
    for hour in [8.0, 10.0, 12.0, 14.0] {
        renderer.render_frame(hour * HOUR).unwrap_or_else(|e| panic!("{e}"));
        reference.render_frame(hour * HOUR).unwrap_or_else(|e| panic!("{e}"));
        let (image, mut truth) = (read(&renderer, "indirect"), rgb(&read(&reference, "composed")));
        let is_found: Vec<f32> = image.data.chunks_exact(4).map(|pixel| pixel[3]).collect();
        truth.chunks_exact_mut(3).zip(&is_found).for_each(|(light, found)| light.iter_mut().for_each(|v| *v *= found));
        let (image, found) = (rgb(&image), mean(&is_found));
        let (energy, off) = (mean(&image) / mean(&truth), error(&blocks(&image), &blocks(&truth)));
        println!("{hour} h: found {found:.4}, energy {energy:.4}, error {off:.4}");
        assert!(found > 0.95 && (energy - 1.0).abs() < 0.05 && off < 0.2, "{found} {energy} {off}");
    }
}

/// A camera that stands still sees the same by both look-ups, sky and all, to the same tolerances.
#[test]
fn both_look_ups_agree_where_the_camera_stands_still() {
    let (_, scene, file) = walked();
    let whole = |scene: &Path, file: &Path| {
        let mut renderer = job("precomputed.ron", scene).keep(&["indirect"]).baked(&baked(file)).renderer();
        renderer.render_frame(12.0 * HOUR).unwrap_or_else(|e| panic!("{e}"));
        rgb(&read(&renderer, "indirect"))
    };
    let (atlas, image) = (whole(scene, file), whole(&root().join("assets/day.ron"), &day().1));
    let (energy, off) = (mean(&atlas) / mean(&image), error(&blocks(&atlas), &blocks(&image)));
    println!("energy {energy:.4}, error {off:.4}");
    assert!((energy - 1.0).abs() < 0.05 && off < 0.2, "{energy} {off}");
}

/// A room without a window is dark inside: no light comes in where its walls meet, although texels there stand for points of their edges.
#[test]
fn no_light_comes_through_the_edges_of_a_closed_room() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = floor(folder.path(), "lights: [Sun(latitude_deg: 30, declination_deg: 0, irradiance: 3)], sky: 1");
    let corners: String = (0..8).map(|i| format!("v {} {} {}\n", 2 * (i & 1) - 1, (i & 2) - 1, (i & 4) / 2 - 1)).collect();
    let walls = "f 1 2 4 3\nf 5 6 8 7\nf 1 2 6 5\nf 3 4 8 7\nf 1 3 7 5\nf 2 4 8 6\n";
    fs::write(folder.path().join("f.obj"), format!("mtllib f.mtl\n{corners}usemtl grey\n{walls}")).expect("written");
    let text = fs::read_to_string(&scene).expect("a text");
    fs::write(&scene, text.replace("origin: (0, 1, 0)", "origin: (0, 0.5, 0)")).expect("written");
    let (file, work) = (folder.path().join("f.baked"), folder.path().join("work"));
    let [path, out, work] = [&scene, &file, &work].map(|path| path.to_string_lossy().into_owned());
    let files = ["bake", &path, "--out", &out, "--work", &work, "--lookup", "atlas", "--texels", "1024"];
    manylight(&[&files[..], &["--paths", "16", "--interval", "12h"]].concat()).expect(0);
    let mut renderer = job("precomputed.ron", &scene).keep(&["indirect"]).baked(&baked(&file)).renderer();
    renderer.render_frame(12.0 * HOUR).unwrap_or_else(|e| panic!("{e}"));
    let indirect = read(&renderer, "indirect");
    assert!(indirect.data.chunks_exact(4).all(|pixel| pixel == [0.0, 0.0, 0.0, 1.0]), "{:?}", indirect.data);
}

/// Key frames of an atlas are found again as those of pictures are, and a file of it comes out the same.
#[test]
fn an_atlas_is_not_traced_twice() {
    let (folder, scene, file) = walked();
    let other = folder.path().join("other.baked");
    run(&bake_atlas(scene, &other, &folder.path().join("work"))).expect(0).says(&["0 frames traced", "8 found"]);
    assert_eq!(fs::read(&other).expect("a file"), fs::read(file).expect("a file"));
}

#[test]
fn options_of_the_other_look_up_are_refused() {
    let bake = |more: &[&str]| manylight(&[&["bake", "day", "--out", "x.baked"], more].concat());
    bake(&["--texels", "4096"]).expect(1).says(&["--lookup atlas"]);
    bake(&["--lookup", "cube", "--texels", "4096"]).expect(1).says(&["--lookup atlas", "--side"]);
    bake(&["--lookup", "atlas", "--size", "24x18"]).expect(1).says(&["--texels"]);
    bake(&["--lookup", "atlas", "--texels", "64"]).expect(1).says(&["texels", "day"]);
    let folder = tempfile::tempdir().expect("a folder");
    let scene = walk(folder.path()).to_string_lossy().into_owned();
    manylight(&["bake", &scene, "--out", "x.baked"]).expect(1).says(&["camera", "--lookup atlas"]);
    manylight(&["bake", &scene, "--lookup", "cube", "--out", "x.baked"]).expect(1).says(&["turns", "--lookup atlas"]);
}

/// An object that was not there when light was baked has direct light only, and what is beside it has its own.
#[test]
fn dynamic_objects_have_direct_light_only() {
    for lookup in [["--lookup", "image", "--size", "24x18"], ["--lookup", "atlas", "--texels", "1024"]] {
        dynamic_object(lookup);
    }
}

fn dynamic_object(lookup: [&str; 4]) {
    let folder = tempfile::tempdir().expect("a folder");
    let block = format!(
        "Mesh(file: {:?}, transform: (translate: (0, 0.2, 0), scale: 0.2), motion: [(time: 0.0), (time: 86400.0, translate: (0.1, 0.2, 0.0))])",
        root().join("assets/cube.obj").to_string_lossy()
    );
    let scene = floor(folder.path(), "lights: [Sun(latitude_deg: 30, declination_deg: 0, irradiance: 3)], sky: 1");
    let text = fs::read_to_string(&scene).expect("a text");
    fs::write(&scene, text.replace("[\"f.obj\"]", &format!("[\"f.obj\", {block}]"))).expect("written");
    let file = folder.path().join("f.baked");
    let (path, out, work) = (scene.to_string_lossy(), file.to_string_lossy(), folder.path().join("work"));
    let work = work.to_string_lossy();
    let arguments = ["bake", &path, "--out", &out, "--work", &work, "--paths", "4", "--interval", "6h"];
    manylight(&[&arguments[..], &lookup].concat()).expect(0);
    let mut renderer = job("precomputed.ron", &scene).keep(&["indirect"]).baked(&baked(&file)).renderer();
    renderer.render_frame(12.0 * HOUR).unwrap_or_else(|e| panic!("{e}"));
    let indirect = read(&renderer, "indirect");
    assert_eq!(indirect.pixel(12, 9), [0.0; 4], "the block, {lookup:?}");
    // A floor under a uniform sky of 1 has its albedo as radiance.
    let corner = indirect.pixel(0, 0);
    assert!((corner[0] - 0.2).abs() < 1e-3 && corner[3] == 1.0, "{lookup:?}: {corner:?}");
}
