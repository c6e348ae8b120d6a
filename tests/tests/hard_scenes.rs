//! Scenes where many-light methods break, under every pipeline: each number that a node writes is looked at, and where it is known what the
//! picture must be, that is compared. Nothing here names a pipeline or an option.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};

use manylight_gpu::Image;
use manylight_passes::{Baked, Renderer, SceneSource, Settings};
use manylight_scene::Scene;

use crate::{
    matrix::{Subject, documents_of_all_pipelines, words},
    records,
    renders::{gpu, lights_to_show, nothing_left_out, shows_baked_light},
    support::root,
};

const SIZE: (u32, u32) = (32, 24);
/// Frames and seconds between them: clusters are seeded, warped, split and merged, and what moves has moved.
const FRAMES: u32 = 4;
const STEP: f64 = 0.7;
/// Of the values that options can take besides the usual ones, each is tried on so many scenes, others in each pipeline.
const SCENES_AN_OPTION: usize = 1;

/// A scene, and what must come of it.
struct Case {
    name: &'static str,
    /// Its text; empty for the scene of that name in `assets/`.
    scene: String,
    expect: Expect,
}

#[derive(Clone, Copy, PartialEq)]
enum Expect {
    /// Nothing but good numbers.
    Good,
    /// No light at all.
    Black,
    /// The picture of another case, up to the mean absolute difference over its mean.
    Like(&'static str, f64),
}

/// The room that cases vary.
#[derive(Clone)]
struct Room {
    meshes: String,
    origin: [f64; 3],
    target: [f64; 3],
    lights: String,
}

const TALL_BLOCK: &str = "translate: (3.7, 1.65, 3.5), rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 20.0), scale: (0.8, 1.65, 0.8)";

fn asset(name: &str) -> String {
    root().join("assets").join(name).to_string_lossy().replace('\\', "/")
}

fn mesh(file: &str, name: &str, transform: &str) -> String {
    format!(r#"Mesh(file: "{}", name: "{name}", transform: ({transform})),"#, asset(file))
}

fn spot(position: [f64; 3], target: [f64; 3], intensity: f64, beam_deg: f64, cutoff_deg: f64) -> String {
    format!(
        "Spot(position: {position:?}, target: {target:?}, intensity: ({intensity:?}, {intensity:?}, {intensity:?}), beam_deg: {beam_deg:?}, cutoff_deg: {cutoff_deg:?}),"
    )
    .replace('[', "(")
    .replace(']', ")")
}

impl Room {
    /// The Cornell box with one block, and a spot light towards the corner at the back.
    fn usual() -> Self {
        Self {
            meshes: format!("\"{}\", {}", asset("cornell_empty.obj"), mesh("cube.obj", "block", TALL_BLOCK)),
            origin: [2.78, 2.73, -8.0],
            target: [2.78, 2.73, 0.0],
            lights: spot([2.0, 3.9, 1.2], [5.4, 4.9, 5.3], 200.0, 15.0, 20.0),
        }
    }

    fn lit_by(lights: String) -> Self {
        Self { lights, ..Self::usual() }
    }

    fn with(meshes: &str) -> Self {
        let usual = Self::usual();
        Self { meshes: usual.meshes + meshes, ..usual }
    }

    fn seen(origin: [f64; 3], target: [f64; 3]) -> Self {
        Self { origin, target, ..Self::usual() }
    }

    /// The usual room, larger by a factor and then moved. Intensities grow with the square, so that the picture stays.
    fn placed(scale: f64, offset: [f64; 3]) -> Self {
        let place = |p: [f64; 3]| [0, 1, 2].map(|i| p[i] * scale + offset[i]);
        let [x, y, z] = offset;
        let whole = format!("translate: ({x:?}, {y:?}, {z:?}), scale: {scale:?}");
        let [bx, by, bz] = place([3.7, 1.65, 3.5]);
        let block = format!(
            "translate: ({bx:?}, {by:?}, {bz:?}), rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 20.0), scale: ({:?}, {:?}, {:?})",
            0.8 * scale,
            1.65 * scale,
            0.8 * scale
        );
        Self {
            meshes: mesh("cornell_empty.obj", "room", &whole) + &mesh("cube.obj", "block", &block),
            origin: place([2.78, 2.73, -8.0]),
            target: place([2.78, 2.73, 0.0]),
            lights: spot(place([2.0, 3.9, 1.2]), place([5.4, 4.9, 5.3]), 200.0 * scale * scale, 15.0, 20.0),
        }
    }

    fn text(&self) -> String {
        let Self { meshes, origin, target, lights } = self;
        let camera =
            format!("(origin: {origin:?}, target: {target:?}, up: (0.0, 1.0, 0.0), fov_x_deg: 39.3)").replace('[', "(").replace(']', ")");
        format!("Scene(meshes: [{meshes}], camera: {camera}, lights: [{lights}])")
    }
}

/// Triangles that no surface should have: of no area, needles, one upon the other, two in one plane.
fn bad_triangles(folder: &Path) -> String {
    let mut obj = String::from("mtllib bad.mtl\nusemtl white\n");
    let corners = [
        [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
        [[1.0, 1.0, 1.0], [2.0, 1.0, 1.0], [3.0, 1.0, 1.0]],
        [[1.0, 1.0, 2.0], [4.0, 1.0, 2.0], [4.0, 1.000_001, 2.0]],
        [[1.0, 0.5, 4.0], [2.0, 0.5, 4.0], [1.5, 2.0, 4.0]],
        [[1.0, 0.5, 4.0], [2.0, 0.5, 4.0], [1.5, 2.0, 4.0]],
        [[2.0, 0.5, 4.0], [1.0, 0.5, 4.0], [1.5, 2.0, 4.0]],
        [[1.2, 0.6, 4.0], [2.2, 0.6, 4.0], [1.7, 2.1, 4.0]],
    ];
    for corner in corners.iter().flatten() {
        let _ = writeln!(obj, "v {} {} {}\nvn 0 0 0", corner[0], corner[1], corner[2]);
    }
    for i in 0..corners.len() {
        let _ = writeln!(obj, "f {0}//{0} {1}//{1} {2}//{2}", 3 * i + 1, 3 * i + 2, 3 * i + 3);
    }
    fs::write(folder.join("bad.obj"), obj).expect("writable");
    fs::write(folder.join("bad.mtl"), "newmtl white\nKd 0.8 0.8 0.8\n").expect("writable");
    format!("\"{}\"", folder.join("bad.obj").to_string_lossy().replace('\\', "/"))
}

/// The empty room with all surfaces of one albedo.
fn painted(folder: &Path, albedo: f64) -> String {
    let name = format!("painted_{}", (albedo * 100.0) as u32);
    let obj = fs::read_to_string(root().join("assets/cornell_empty.obj")).expect("readable");
    let mtl = fs::read_to_string(root().join("assets/cornell_empty.mtl")).expect("readable");
    let repaint = |line: &str| if line.trim_start().starts_with("Kd") { format!("Kd {albedo} {albedo} {albedo}") } else { line.to_owned() };
    fs::write(folder.join(&name).with_extension("mtl"), mtl.lines().map(repaint).collect::<Vec<_>>().join("\n")).expect("writable");
    fs::write(folder.join(&name).with_extension("obj"), obj.replace("cornell_empty.mtl", &format!("{name}.mtl"))).expect("writable");
    format!("\"{}\"", folder.join(name).with_extension("obj").to_string_lossy().replace('\\', "/"))
}

fn cases(folder: &Path) -> Vec<Case> {
    let case = |name: &'static str, room: Room, expect: Expect| Case { name, scene: room.text(), expect };
    let good = |name: &'static str, room: Room| case(name, room, Expect::Good);
    let lights = |positions: usize| -> String {
        let place = |i: usize| [0.5 + 0.4 * (i % 12) as f64, 5.0, 0.5 + 0.4 * (i / 2) as f64];
        (0..positions).map(|i| spot(place(i), [place(i)[0], 0.0, 2.5], 20.0, 10.0, 40.0)).collect()
    };
    let usual = Room::usual();
    vec![
        good("usual", usual.clone()),
        case("light points away", Room::lit_by(spot([2.78, 2.73, -20.0], [2.78, 2.73, -30.0], 200.0, 15.0, 20.0)), Expect::Black),
        case("light of no intensity", Room::lit_by(spot([2.0, 3.9, 1.2], [5.4, 4.9, 5.3], 0.0, 15.0, 20.0)), Expect::Black),
        good("very strong light", Room::lit_by(spot([2.0, 3.9, 1.2], [5.4, 4.9, 5.3], 1e15, 15.0, 20.0))),
        good("very weak light", Room::lit_by(spot([2.0, 3.9, 1.2], [5.4, 4.9, 5.3], 1e-15, 15.0, 20.0))),
        good("one lit texel", Room::lit_by(spot([2.0, 3.9, 1.2], [5.4, 4.9, 5.3], 1e5, 0.05, 0.06))),
        good("light of 170°", Room::lit_by(spot([2.78, 5.3, 2.8], [2.78, 0.0, 2.8], 20.0, 84.0, 85.0))),
        good("light on the floor", Room::lit_by(spot([2.0, 0.0, 2.0], [2.0, 1.0, 2.0], 20.0, 30.0, 60.0))),
        good("light at the floor", Room::lit_by(spot([2.0, 1e-6, 2.0], [4.0, 0.0, 2.0], 20.0, 30.0, 60.0))),
        good("light in a block", Room::lit_by(spot([3.7, 1.65, 3.5], [3.7, 4.0, 3.5], 20.0, 30.0, 60.0))),
        good("point light in a corner", Room::lit_by("Point(position: (0.001, 0.001, 5.5), intensity: (9.0, 9.0, 9.0)),".to_owned())),
        good("sun along the floor", Room::lit_by("Directional(direction: (0.0, 0.0, 1.0), irradiance: (9.0, 9.0, 9.0)),".to_owned())),
        good("seven lights", Room::lit_by(lights(7))),
        good("camera in a block", Room::seen([3.7, 1.65, 3.5], [3.7, 1.65, 0.0])),
        case("camera towards nothing", Room::seen([2.78, 2.73, -8.0], [2.78, 2.73, -20.0]), Expect::Black),
        good("camera on the floor", Room::seen([2.78, 0.0, 1.0], [2.78, 0.0, 4.0])),
        good("bad triangles", Room::with(&bad_triangles(folder))),
        case("black room", Room { meshes: painted(folder, 0.0), ..usual.clone() }, Expect::Black),
        good("white room", Room { meshes: painted(folder, 1.0), ..usual.clone() }),
        good("one far away wall", Room::with(&mesh("cube.obj", "wall", "translate: (2.8, 2.8, 3000.0), scale: (1000.0, 1000.0, 1.0)"))),
        case("a thousandth", Room::placed(1e-3, [0.0; 3]), Expect::Like("usual", SCALED)),
        case("ten thousand times", Room::placed(1e4, [0.0; 3]), Expect::Like("usual", SCALED)),
        case("10,000 away", Room::placed(1.0, [1e4, -1e4, 1e4]), Expect::Like("usual", MOVED)),
        Case { name: "metaballs.ron", scene: String::new(), expect: Expect::Good },
        Case { name: "glossy.ron", scene: String::new(), expect: Expect::Good },
        Case { name: "moving.ron", scene: String::new(), expect: Expect::Good },
    ]
}

/// Of a room that is larger or smaller by a factor that is no power of two. All lengths in shaders are relative to the scene or to the
/// distance at hand, so that the rest is rounding, which may move a texel from one cluster to the next.
const SCALED: f64 = 0.01;
/// Of a room 10,000 units away: positions are kept to 0.001 of its 5.6 units.
const MOVED: f64 = 0.02;

/// The picture after some frames, in which no number is bad.
fn render(
    subject: &Subject<'_>,
    (source, scene): &(SceneSource, Scene),
    set: &[(String, String)],
    light: Option<Arc<Baked>>,
) -> Result<Image, String> {
    let mut settings = Settings { size: SIZE, set: set.to_vec(), ..Settings::default() };
    settings.debug.watch_numbers = true;
    // With the account of energy, where a pipeline has one.
    settings.keep = subject.documents.pipeline().resources.keys().filter(|name| *name == "imbalance").cloned().collect();
    settings.baked = light;
    let told = |e: String| format!("on {}, {}: {e}", scene.name, words(&settings));
    let renderer = Renderer::with(gpu(), subject.documents.clone(), source.clone(), scene.clone(), settings.clone());
    let mut renderer = renderer.map_err(|e| told(e.to_string()))?;
    for frame in 0..FRAMES {
        renderer.render_frame(f64::from(frame) * STEP).map_err(|e| told(e.to_string()))?;
    }
    let radiance =
        renderer.plan().radiance.map(|ix| renderer.plan().resources[ix].name.clone()).expect("every pipeline names its radiance");
    renderer.read(&radiance).map_err(|e| told(e.to_string()))
}

/// Mean absolute difference over the mean of the second.
fn difference(a: &Image, b: &Image) -> f64 {
    let rgb = |image: &Image| image.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]].map(f64::from)).collect::<Vec<_>>();
    let (a, b) = (rgb(a), rgb(b));
    let apart: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum();
    apart / b.iter().sum::<f64>().max(1e-300)
}

#[test]
fn every_pipeline_stays_stable_on_hard_scenes() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let mut scenes = Vec::new();
    let cases = cases(folder.path());
    for (i, case) in cases.iter().enumerate() {
        let path = match case.scene.as_str() {
            "" => PathBuf::from(asset(case.name)),
            text => {
                let path = folder.path().join(format!("{i}.ron"));
                fs::write(&path, text).expect("writable");
                path
            }
        };
        let source = SceneSource::file(&path);
        let mut scene = source.load().unwrap_or_else(|faults| panic!("{}: {}", case.name, faults.render()));
        case.name.clone_into(&mut scene.name);
        scenes.push((source, scene));
    }
    let (mut faults, mut record) = (Vec::new(), Vec::new());
    for (path, documents) in documents_of_all_pipelines() {
        let subject = Subject::new(&documents, &scenes);
        let mut pictures: BTreeMap<&str, Image> = BTreeMap::new();
        let (mut tried, mut refused, mut on_scenes, mut worst, before) = (0, 0, 0, BTreeMap::new(), faults.len());
        for (case, scene) in cases.iter().zip(&scenes) {
            // What a scene does not call for must be stable as well.
            let small = [subject.small(), nothing_left_out(documents.pipeline())].concat();
            match subject.plan(&Settings { size: SIZE, set: small.clone(), ..Settings::default() }, &scene.1) {
                Ok(Some(_)) => {}
                Ok(None) => {
                    refused += 1;
                    continue;
                }
                Err(told) => {
                    faults.push(format!("{path} {told}"));
                    continue;
                }
            }
            on_scenes += 1;
            let mut images = Vec::new();
            for light in lights_to_show(&documents, &scene.1, SIZE) {
                tried += 1;
                match render(&subject, scene, &small, light) {
                    Ok(image) => images.push(image),
                    Err(told) => faults.push(format!("{path} {told}")),
                }
            }
            let Some(image) = images.pop() else { continue };
            match case.expect {
                // What its picture must be, the file says.
                _ if shows_baked_light(&documents) => {}
                Expect::Good => {}
                Expect::Black => {
                    if let Some(v) = image.data.chunks_exact(4).flat_map(|p| &p[..3]).find(|v| **v != 0.0) {
                        faults.push(format!("{path} on {}: nothing is lit, but a pixel has {v}", case.name));
                    }
                }
                Expect::Like(other, most) => {
                    let apart = pictures.get(other).map_or(f64::INFINITY, |other| difference(&image, other));
                    worst.insert(case.name, apart);
                    if apart > most {
                        faults.push(format!("{path} on {}: differs from {other} by {apart:.3}, not {most}", case.name));
                    }
                }
            }
            pictures.insert(case.name, image);
        }
        // Every other value of every option, each on some of the scenes.
        let mut turn = 0;
        for factor in &subject.options {
            for value in &factor.values {
                for _ in 0..SCENES_AN_OPTION {
                    turn = (turn + 7) % cases.len();
                    let mut set = subject.small();
                    set.push((factor.name.clone(), value.clone()));
                    match subject.plan(&Settings { size: SIZE, set: set.clone(), ..Settings::default() }, &scenes[turn].1) {
                        Ok(Some(_)) => {
                            for light in lights_to_show(&documents, &scenes[turn].1, SIZE) {
                                tried += 1;
                                faults.extend(render(&subject, &scenes[turn], &set, light).err().map(|told| format!("{path} {told}")));
                            }
                        }
                        Ok(None) => refused += 1,
                        Err(told) => faults.push(format!("{path} {told}")),
                    }
                }
            }
        }
        println!("{path}: {tried} renders, {refused} refused, differences {worst:?}");
        record.push(serde_json::json!({
            "pipeline": path, "scenes": on_scenes, "renders": tried, "refused": refused, "faults": faults.len() - before,
            "differences": worst,
        }));
    }
    records::write("hard_scenes", &record);
    let adapter = gpu().adapter_info();
    records::write("adapter", &[serde_json::json!({ "adapter": adapter.name, "driver": adapter.driver_info })]);
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
