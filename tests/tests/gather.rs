//! Gathering from the reflective shadow map ([RSM]) against the virtual lights of the same map, without shadows in both.

use manylight_gpu::Image;

use crate::{
    reference::rgb,
    renders::{Job, read},
    support::root,
};

fn gather(scene: &str) -> Job {
    let pipeline = root().join("pipelines/rsm_gather.ron").to_string_lossy().into_owned();
    Job { pipeline, ..Job::asset(scene) }.set("samples", 4096)
}

/// Mean absolute error over the mean, and the energy ratio.
fn difference(mine: &Image, theirs: &Image) -> (f64, f64) {
    let (mut error, mut sum, mut total) = (0.0, 0.0, 0.0);
    for (x, y) in (0..mine.height).flat_map(|y| (0..mine.width).map(move |x| (x, y))) {
        for (a, b) in rgb(mine, x, y).into_iter().zip(rgb(theirs, x, y)) {
            error += (a - b).abs();
            sum += a;
            total += b;
        }
    }
    (error / total, sum / total)
}

fn render(job: Job) -> Image {
    let job = Job { size: (48, 48), ..job }.frames(1).set("rsm_size", 128).keep(&["indirect"]);
    read(&job.render(), "indirect")
}

/// All texels alike, or a polar pattern that reaches all of them with weights that are one over its density: the same light as that of virtual lights which
/// are samples of the map. A smaller radius loses light; the paper's weights make far texels too bright.
#[test]
fn gathering_over_the_whole_map_is_the_light_of_all_its_texels() {
    let lights = Job::asset("cornell").set("sampling", "samples").set("visibility", "none").set("clusters", 4096).set("tiles", 1);
    let truth = render(lights);
    for pattern in ["uniform", "polar"] {
        let (mae, energy) = difference(&render(gather("cornell").set("pattern", pattern).set("radius", 1.5)), &truth);
        println!("{pattern}: mean absolute error {:.2} %, energy {energy:.4}", 100.0 * mae);
        assert!(mae < 0.02 && (energy - 1.0).abs() < 0.01, "{pattern}: mean absolute error {:.2} %, energy {energy}", 100.0 * mae);
    }
    let narrow = difference(&render(gather("cornell").set("radius", 0.3)), &truth).1;
    assert!((0.1..0.5).contains(&narrow), "within 0.3: energy {narrow}");
    let (mae, energy) = difference(&render(gather("cornell").set("radius", 1.5).set("weights", "paper")), &truth);
    assert!(mae > 0.2, "the paper's weights: mean absolute error {:.2} %, energy {energy}", 100.0 * mae);
}

/// One pattern for all pixels, as in the paper, is the same estimate on average.
#[test]
fn turned_patterns_have_the_energy_of_a_single_one() {
    let [turned, still] = [true, false].map(|turn| render(gather("cornell").set("gather.turn", turn).set("samples", 512)));
    let (mae, energy) = difference(&turned, &still);
    assert!(mae > 1e-3, "nothing was turned");
    assert!((energy - 1.0).abs() < 0.02, "energy {energy}");
}
