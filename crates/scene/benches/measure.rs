//! Host time of the measured features: `cargo bench -p manylight-scene --bench measure [SCENE…]`.

use std::{env, num::NonZeroUsize, path::PathBuf, time::Instant};

use manylight_scene::{MeasureOptions, Scene, bvh::Bvh};

/// Times each is measured; the median counts.
const RUNS: usize = 5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let root = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let mut scenes: Vec<PathBuf> = env::args().skip(1).filter(|argument| !argument.starts_with('-')).map(PathBuf::from).collect();
    if scenes.is_empty() {
        scenes.extend(["cornell", "glossy", "moving", "day"].map(|name| root.join(format!("assets/{name}.ron"))));
        let sponza = root.join("../shared/scenes/sponza/sponza.ron");
        if sponza.is_file() {
            scenes.push(sponza);
        } else {
            println!("sponza was not measured: ../shared is not there");
        }
    }
    println!("{} threads, median of {RUNS} runs", std::thread::available_parallelism().map_or(1, NonZeroUsize::get));
    for path in scenes {
        let scene = Scene::load(&path).map_err(|faults| faults.to_string())?;
        let median = |work: &dyn Fn()| {
            let mut times: Vec<f64> = (0..RUNS)
                .map(|_| {
                    let start = Instant::now();
                    work();
                    1e3 * start.elapsed().as_secs_f64()
                })
                .collect();
            times.sort_by(f64::total_cmp);
            times[RUNS / 2]
        };
        let options = MeasureOptions::default();
        let all = median(&|| drop(scene.measure(&options)));
        let bvh = median(&|| drop(Bvh::build(&scene, &scene.sample(0.0))));
        println!("{}: {all:.0} ms, of which the hierarchy of one time {bvh:.0} ms", scene.name);
        let measures = scene.measure(&options);
        for (name, measured) in &measures.features {
            println!("    {name:20} {:.4} ± {:.4}", measured.value, measured.standard_error);
        }
    }
    Ok(())
}
