//! Lights of all kinds, one and several at once, in the pipeline `reference`.

use std::{f64::consts::PI, fs, path::Path};

use glam::DVec3;
use manylight_gpu::Image;
use manylight_passes::Renderer;

use crate::{
    blocks::{Block, blocks, compare},
    reference::rgb,
    renders::{Job, read},
    support::root,
    twin::{Camera, Light, Twin, quad},
};

/// Side of the pictures in pixels.
const SIZE: u32 = 32;

const WHITE: DVec3 = DVec3::splat(0.8);

fn job(scene: &Path, component: &str) -> Job {
    let pipeline = root().join("pipelines/reference.ron").to_string_lossy().into_owned();
    Job { pipeline, size: (SIZE, SIZE), ..Job::scene(scene) }.set("component", component).set("paths", 16).keep(&["standard_error"])
}

fn blocks_of(renderer: &Renderer) -> Vec<Block> {
    let (mean, error) = (read(renderer, "composed"), read(renderer, "standard_error"));
    blocks(mean.width, |x, y| rgb(&mean, x, y), |x, y| rgb(&error, x, y))
}

/// Mean over all blocks and channels, and its standard error.
fn overall(blocks: &[Block]) -> (f64, f64) {
    let n = 3.0 * blocks.len() as f64;
    let sum: f64 = blocks.iter().flat_map(|(mean, _)| *mean).sum();
    let variance: f64 = blocks.iter().flat_map(|(_, error)| *error).map(|error| error * error).sum();
    (sum / n, variance.sqrt() / n)
}

/// Differences of blocks, and of the means of the whole pictures, are such as noise makes. The means are known to 0.5 %.
#[track_caller]
fn assert_agree(name: &str, mine: &[Block], theirs: &[Block]) {
    let (beyond, ratio) = compare(mine, theirs);
    let ((mean, error), (expected, expected_error)) = (overall(mine), overall(theirs));
    let noise = error.hypot(expected_error);
    println!("{name}: ratio of means {ratio:.4} ± {:.4}, {:.2} % of blocks beyond four standard errors", noise / expected, 100.0 * beyond);
    assert!(noise <= 0.005 * expected, "{name}: noise of {} hides errors", noise / expected);
    assert!((mean - expected).abs() <= 4.0 * noise, "{name}: ratio of means {ratio}");
    assert_eq!(beyond, 0.0, "{name}: blocks differ");
}

/// The mean of `frames` frames of a scene that has been edited. Its lights must have changed: that starts it anew.
#[track_caller]
fn again(renderer: &mut Renderer, scene: &Path, frames: u32) {
    renderer.reload(&[scene.to_owned()]).unwrap_or_else(|e| panic!("{e}"));
    for _ in 0..frames {
        renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
    }
}

/// A floor seen from above, three across in a picture that shows two.
fn floor(light: Light) -> Twin {
    let corners = [(-1.5, -1.5), (-1.5, 1.5), (1.5, 1.5), (1.5, -1.5)].map(|(x, z)| DVec3::new(x, 0.0, z));
    Twin {
        triangles: quad(corners, [DVec3::Y; 4], DVec3::new(0.8, 0.4, 0.2)).into(),
        lights: vec![light],
        camera: Camera { origin: DVec3::Y, target: DVec3::ZERO, up: DVec3::NEG_Z, fov_deg: 90.0 },
    }
}

/// A corner of floor and wall, whose normals lean so that the edge looks round, and a table that throws shadows on both.
fn corner(lights: &[Light]) -> Twin {
    let at = |corners: [[f64; 3]; 4]| corners.map(DVec3::from);
    let table = at([[0.3, 0.4, 0.3], [0.3, 0.4, 0.6], [0.6, 0.45, 0.6], [0.6, 0.45, 0.3]]);
    let triangles = [
        quad(at([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), [DVec3::Y; 4], DVec3::new(0.9, 0.6, 0.3)),
        quad(
            at([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]),
            at([[1.0, 0.8, 0.0], [1.0, -0.3, 0.2], [1.0, -0.3, -0.2], [1.0, 0.8, 0.0]]),
            DVec3::new(0.4, 0.7, 0.9),
        ),
        quad(table, [(table[1] - table[0]).cross(table[3] - table[0]); 4], WHITE),
    ];
    Twin {
        triangles: triangles.into_iter().flatten().collect(),
        lights: lights.to_vec(),
        camera: Camera { origin: DVec3::new(2.2, 1.4, 1.6), target: DVec3::new(0.3, 0.3, 0.45), up: DVec3::Y, fov_deg: 40.0 },
    }
}

const POINT: Light = Light::Point { position: DVec3::new(0.55, 0.7, 0.35), intensity: DVec3::new(1.0, 2.0, 3.0) };
const SUN: Light = Light::Directional { direction: DVec3::new(-0.6, -1.0, -0.2), irradiance: DVec3::new(6.0, 5.0, 4.0) };
const SPOT: Light = Light::Spot {
    position: DVec3::new(0.9, 0.9, 0.9),
    target: DVec3::new(0.0, 0.3, 0.4),
    intensity: DVec3::splat(8.0),
    beam_deg: 5.0,
    cutoff_deg: 15.0,
};
const DARK: Light = Light::Point { position: DVec3::new(0.5, 0.5, 0.5), intensity: DVec3::ZERO };

/// L = ρ/π · I cos θ / d² of a point light and L = ρ/π · E cos θ of a directional one.
#[test]
fn direct_light_on_a_floor_has_its_closed_form() {
    let folder = tempfile::tempdir().expect("a folder");
    let albedo = DVec3::new(0.8, 0.4, 0.2);
    let position = DVec3::new(0.3, 0.6, -0.2);
    let intensity = DVec3::new(1.0, 2.0, 4.0);
    let of_point = |p: DVec3| {
        let d = position - p;
        albedo / PI * intensity * d.y / d.length().powi(3)
    };
    let (direction, irradiance) = (DVec3::new(3.0, -4.0, 0.0), DVec3::new(2.0, 3.0, 5.0));
    let of_directional = |_| albedo / PI * irradiance * 0.8;
    // A pixel is 1/16 wide: its mean differs from the value at its centre by less than 0.5 % at this height of the light, and its
    // 1024 paths have a standard error of less than 0.2 %. Parallel light is the same everywhere.
    type Radiance<'a> = &'a dyn Fn(DVec3) -> DVec3;
    let cases: [(Light, Radiance<'_>, f64); 2] =
        [(Light::Point { position, intensity }, &of_point, 0.01), (Light::Directional { direction, irradiance }, &of_directional, 1e-5)];
    for (light, expected, tolerance) in cases {
        let twin = floor(light);
        let image = read(&job(&twin.write(&folder), "direct").frames(64).render(), "composed");
        for (x, y) in (0..SIZE).flat_map(|y| (0..SIZE).map(move |x| (x, y))) {
            let ray = twin.camera.ray((f64::from(x) + 0.5) / f64::from(SIZE), (f64::from(y) + 0.5) / f64::from(SIZE));
            let expected = expected(twin.camera.origin - ray / ray.y);
            let error = (DVec3::from(rgb(&image, x, y)) / expected - 1.0).abs().max_element();
            assert!(error <= tolerance, "{}, pixel {x} {y}: {:?} instead of {expected}", light.ron(), rgb(&image, x, y));
        }
    }
}

/// Shadows, smooth normals and lights of very different power, near surfaces and far away.
#[test]
fn light_is_that_of_a_plain_path_tracer_in_64_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = corner(&[]).write(&folder);
    let mut renderers = ["direct", "one_bounce"].map(|component| (component, job(&scene, component).renderer()));
    for (name, lights) in [("point", vec![POINT]), ("directional", vec![SUN]), ("several", vec![DARK, SPOT, POINT, SUN])] {
        let twin = corner(&lights);
        twin.write(&folder);
        for ((component, renderer), expected) in renderers.iter_mut().zip(twin.render(SIZE, 2048)) {
            again(renderer, &scene, 64);
            assert_agree(&format!("{name}, {component}"), &blocks_of(renderer), &expected);
        }
    }
}

/// The Cornell box: one light in the middle, one through the open front, and the spot light of the asset.
#[test]
fn light_of_several_lights_is_the_sum_of_their_light() {
    let folder = tempfile::tempdir().expect("a folder");
    let lights = [
        "Spot(position: (2.0, 3.9, 1.2), target: (5.4, 4.9, 5.3), intensity: 200.0, beam_deg: 15.0, cutoff_deg: 20.0)",
        "Point(position: (2.78, 4.5, 2.8), intensity: (2.0, 3.0, 4.0))",
        "Directional(direction: (0.3, -0.5, 1.0), irradiance: (3.0, 2.0, 1.0))",
    ];
    let mesh = root().join("assets/cornell.obj");
    let scene = corner(&[]).write(&folder);
    let mut renderer = job(&scene, "full").set("paths", 8).renderer();
    let mut render = |lights: &[&str]| {
        let camera = "(origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), fov_x_deg: 39.3077)";
        let text = format!("Scene(meshes: [{:?}], camera: {camera}, lights: [{}])", mesh.to_string_lossy(), lights.join(", "));
        fs::write(&scene, text).expect("written");
        again(&mut renderer, &scene, 32);
        blocks_of(&renderer)
    };
    let single = lights.map(|light| render(&[light]));
    let sum: Vec<Block> = (0..single[0].len())
        .map(|i| {
            let values = |pick: fn(&Block) -> [f64; 3]| single.each_ref().map(|blocks| DVec3::from(pick(&blocks[i])));
            let mean: DVec3 = values(|block| block.0).into_iter().sum();
            let variance: DVec3 = values(|block| block.1).into_iter().map(|error| error * error).sum();
            (mean.to_array(), variance.map(f64::sqrt).to_array())
        })
        .collect();
    assert_agree("three lights", &render(&lights), &sum);
}

/// Every number of every pixel.
fn values(image: &Image) -> impl Iterator<Item = f32> {
    (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y))).flat_map(|(x, y)| image.pixel(x, y)[..3].to_vec())
}

/// Lights in and on surfaces, without strength, of extreme cones and strengths, over nothing.
#[test]
fn odd_lights_give_finite_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    let cases = [
        ("none", "", true),
        ("dark", "Point(position: (0.5, 0.5, 0.5), intensity: 0.0), Directional(direction: (0.0, -1.0, 0.0), irradiance: 0.0)", true),
        ("on the floor", "Point(position: (0.5, 0.0, 0.5), intensity: 1.0)", false),
        ("in the edge", "Point(position: (0.0, 0.0, 0.5), intensity: 1.0)", false),
        ("in a corner of a triangle", "Point(position: (0.0, 0.0, 0.0), intensity: 1e15)", false),
        ("along the wall", "Directional(direction: (0.0, -1.0, 0.0), irradiance: 1e15)", false),
        ("beneath the floor", "Directional(direction: (0.0, 1e-20, 0.0), irradiance: 3.0)", false),
        (
            "a needle of a cone",
            "Spot(position: (0.5, 0.9, 0.5), target: (0.5, 0.0, 0.5), intensity: 1.0, beam_deg: 0.0, cutoff_deg: 1e-30)",
            false,
        ),
    ];
    let scene = corner(&[]).write(&folder);
    let mut renderer = job(&scene, "full").renderer();
    let text = fs::read_to_string(&scene).expect("a text");
    let point = "Mesh(file: \"scene.obj\", motion: [(time: 0.0, scale: 0.0)])";
    for (name, lights, black) in cases {
        for mesh in ["\"scene.obj\"", point] {
            let text = text.replace("\"scene.obj\"", mesh).replace("lights: []", &format!("lights: [{lights}]"));
            fs::write(&scene, text).expect("written");
            again(&mut renderer, &scene, 2);
            let image = read(&renderer, "composed");
            assert!(values(&image).chain(values(&read(&renderer, "standard_error"))).all(|v| v.is_finite() && v >= 0.0), "{name}, {mesh}");
            assert!(!black || values(&image).all(|v| v == 0.0), "{name}, {mesh}: not black");
        }
    }
}

/// A scene that is edited while it is rendered: a mean of two lights would be of neither.
#[test]
fn a_change_of_any_light_starts_anew() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut lights = vec![SPOT, POINT, SUN];
    let scene = corner(&lights).write(&folder);
    let mut renderer = job(&scene, "direct").frames(3).render();
    let frames = |renderer: &Renderer| read(renderer, "standard_error").pixel(0, 0)[3];
    assert_eq!(frames(&renderer), 3.0);
    let edits: [fn(&mut Vec<Light>); 4] = [
        |lights| lights[1] = Light::Point { position: DVec3::new(0.55, 0.7, 0.35), intensity: DVec3::new(1.0, 2.0, 3.5) },
        |lights| lights[2] = Light::Directional { direction: DVec3::new(-0.5, -1.0, -0.2), irradiance: DVec3::new(6.0, 5.0, 4.0) },
        |lights| lights.swap(0, 1),
        |lights| lights.truncate(2),
    ];
    for (i, edit) in edits.into_iter().enumerate() {
        edit(&mut lights);
        corner(&lights).write(&folder);
        again(&mut renderer, &scene, 2);
        assert_eq!(frames(&renderer), 2.0, "edit {i}");
    }
}
