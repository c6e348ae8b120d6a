//! Exact visibility: rays to the lights, and what runs for them.

use std::fs;

use crate::{
    reference::{error, exr, scenes},
    renders::{Job, read},
};

/// Measured: 7.8 and 4.7 %; a prototype of the method reached 8.6 and 4.2 %.
#[test]
fn area_lights_with_exact_visibility_converge_to_the_reference() {
    let scene = &scenes()[0];
    let reference = exr(&scene.reference.join("onebounce.exr"));
    let errors = [(64, 0.095), (256, 0.05)].map(|(count, most)| {
        let job = Job::scene(&scene.file).set("rsm_size", 256).set("visibility", "exact").set("clusters", count);
        let (mae, energy) = error(&read(&job.keep(&["indirect"]).render(), "indirect"), &reference);
        println!("{count} lights: mean absolute error {:.2} %, energy {energy:.3}", 100.0 * mae);
        assert!(mae <= most, "{count} lights: mean absolute error {:.2} %", 100.0 * mae);
        assert!((0.92..=1.02).contains(&energy), "{count} lights: energy {energy}");
        mae
    });
    assert!(errors[1] < errors[0]);
}

/// A wall that the light hits, one that the camera sees, facing it, and a larger one in the middle: every way of the light leads through that.
const WALLS: &str = "\
v -2 -1 -1\nv -2 1 -1\nv -2 1 1\nv -2 -1 1\nf 1 2 3 4
v 2 -1 -1\nv 2 1 -1\nv 2 1 1\nv 2 -1 1\nf 5 6 7 8
v 0 -3 -3\nv 0 3 -3\nv 0 3 3\nv 0 -3 3\nf 9 10 11 12
";

const SCENE: &str = "Scene(
    meshes: [\"walls.obj\"],
    camera: (origin: (0.5, 0.0, 0.0), target: (2.0, 0.0, 0.0), fov_x_deg: 40.0),
    lights: [Spot(position: (-1.0, 0.0, 0.0), target: (-2.0, 0.0, 0.0), intensity: 10.0, beam_deg: 15.0, cutoff_deg: 20.0)],
)";

#[test]
fn a_light_behind_a_wall_lights_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("walls.obj"), WALLS).expect("written");
    fs::write(folder.path().join("walls.ron"), SCENE).expect("written");
    for sampling in ["clusters", "samples"] {
        let lights = |visibility: &str| -> Vec<f32> {
            let job = Job::scene(&folder.path().join("walls.ron")).small().set("visibility", visibility).set("sampling", sampling);
            read(&job.keep(&["indirect"]).render(), "indirect").data.chunks(4).map(|pixel| pixel[0]).collect()
        };
        assert!(lights("none").iter().all(|&v| v > 0.0), "{sampling}: without shadows each pixel of the wall is lit");
        // Lights and pixels are placed so evenly that some rays meet the middle wall's diagonal, an edge of two triangles.
        assert!(lights("exact").iter().all(|&v| v == 0.0), "{sampling}: light comes through the wall");
    }
}

#[test]
fn only_what_a_visibility_needs_runs() {
    let runs = |visibility: &str| -> Vec<String> {
        let renderer = Job::asset("cornell").small().set("visibility", visibility).renderer();
        renderer.plan().nodes.iter().map(|n| n.id.clone()).collect()
    };
    let maps = ["points_static", "splat", "pull_push"];
    for (visibility, with_maps, with_rays) in
        [("none", false, false), ("simple", true, false), ("pcss", true, false), ("exact", false, true)]
    {
        let nodes = runs(visibility);
        let has = |id: &str| nodes.iter().any(|n| n == id);
        assert!(maps.iter().all(|id| has(id) == with_maps), "{visibility}: {nodes:?}");
        assert_eq!(has("bvh"), with_rays, "{visibility}: {nodes:?}");
    }
}
