//! Incremental instant radiosity ([IIR]): virtual lights stay in the world as long as their light reaches them.

use std::fs;

use glam::DVec3;
use manylight_passes::Renderer;

use crate::{
    clustering::sums,
    renders::{Cluster, Job, read_clusters},
    support::root,
};

const LIGHTS: usize = 256;
const REPLACED_AT_MOST: usize = 8;
const ACTIVE: u64 = 1;
const CUTOFF_DEG: f64 = 20.0;
/// A texel of the map as an angle: validity is decided by texels.
const TEXEL_DEG: f64 = 2.0 * CUTOFF_DEG / 128.0;

fn incremental(job: Job) -> Job {
    let pipeline = root().join("pipelines/incremental_ir.ron").to_string_lossy().into_owned();
    Job { pipeline, ..job.small() }.set("visibility", "none").keep(&["clusters", "rsm_flux"])
}

fn next(renderer: &mut Renderer, time: f64) -> Vec<Cluster> {
    renderer.render_frame(time).unwrap_or_else(|e| panic!("{e}"));
    let (rsm, sum) = sums(renderer);
    assert!((0..3).all(|i| (sum[i] / rsm[i] - 1.0).abs() < 1e-5), "time {time}: {sum:?} W of {rsm:?} W");
    read_clusters(renderer, "clusters")
}

fn same_place(a: &Cluster, b: &Cluster) -> bool {
    a.position == b.position && a.normal == b.normal
}

#[test]
fn nothing_moves_in_still_light() {
    for scene in ["cornell", "glossy"] {
        let mut renderer = incremental(Job::asset(scene)).renderer();
        let mut before = next(&mut renderer, 0.0);
        assert!(before.iter().filter(|c| c.state == ACTIVE).count() > LIGHTS / 2, "{scene}");
        for frame in 1..40 {
            let now = next(&mut renderer, 0.0);
            let moved = before.iter().zip(&now).filter(|(a, b)| !same_place(a, b) || a.flux != b.flux).count();
            // Seeds that met nothing lit have another try, a few a frame.
            assert!(moved == 0 || frame < 20, "{scene}, frame {frame}: {moved} lights moved");
            before = now;
        }
    }
}

/// In a box without objects a light is valid while it is in the cone.
#[test]
fn valid_lights_stay_while_the_light_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("scene.ron");
    let mesh = root().join("assets/cornell_empty.obj");
    let text = format!(
        "Scene(
            meshes: [{:?}],
            camera: (origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), fov_x_deg: 39.3077),
            lights: [Spot(position: (2.0, 3.9, 1.2), target: (5.4, 4.9, 5.3), intensity: 200.0, beam_deg: 15.0, cutoff_deg: {CUTOFF_DEG},
                motion: [(time: 0.0), (time: 2.0, position: (2.6, 3.0, 1.0), target: (1.0, 2.0, 5.0))])],
        )",
        mesh.to_string_lossy()
    );
    fs::write(&scene, text).expect("written");
    let mut renderer = incremental(Job::scene(&scene)).renderer();
    let mut before = next(&mut renderer, 0.0);
    let (mut stayed, mut gone) = (0, 0);
    for frame in 1..=60 {
        let time = 2.0 * f64::from(frame) / 60.0;
        let now = next(&mut renderer, time);
        let light = renderer.scene().sample(time).lights[0];
        let angle =
            |c: &Cluster| (DVec3::from(c.position) - light.position.as_dvec3()).angle_between(light.direction.as_dvec3()).to_degrees();
        let mut placed = 0;
        for (a, b) in before.iter().zip(&now) {
            if b.generation != a.generation {
                placed += 1;
            }
            if a.state != ACTIVE {
                continue;
            }
            if b.state == ACTIVE && b.generation == a.generation {
                assert!(same_place(a, b), "frame {frame}: {:?} moved to {:?}", a.position, b.position);
                assert!(angle(a) <= CUTOFF_DEG + TEXEL_DEG, "frame {frame}: kept at {} degrees", angle(a));
                stayed += 1;
            } else {
                assert!(angle(a) >= CUTOFF_DEG - 2.0 * TEXEL_DEG, "frame {frame}: dropped at {} degrees", angle(a));
                gone += 1;
            }
        }
        assert!(placed <= REPLACED_AT_MOST, "frame {frame}: {placed} lights placed");
        before = now;
    }
    println!("{stayed} lights stayed, {gone} went");
    // A light lives for more than ten frames on average.
    assert!(gone > LIGHTS && stayed > 10 * gone, "{stayed} lights stayed, {gone} went");
}

/// Objects that come between a light and what it lit, or take it away: what is kept is a point of a surface that the light sees.
#[test]
fn lights_that_are_hidden_or_lose_their_surface_go() {
    let mut renderer = incremental(Job::asset("moving")).renderer();
    let mut before = next(&mut renderer, 0.0);
    let mut gone = 0;
    for frame in 1..=50 {
        let now = next(&mut renderer, 0.1 * f64::from(frame));
        for (a, b) in before.iter().zip(&now).filter(|(a, b)| a.state == ACTIVE && b.state == ACTIVE) {
            assert!(same_place(a, b) == (a.generation == b.generation), "frame {frame}: {:?} and {:?}", a.position, b.position);
            gone += usize::from(a.generation != b.generation);
        }
        before = now;
    }
    assert!(gone > 0, "no light was ever replaced");
}
