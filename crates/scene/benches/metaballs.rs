//! Host time of a frame of metaballs by the number of cells: `cargo bench -p manylight-scene --bench metaballs`.

use std::{fs, io, path::Path, time::Instant};

use manylight_scene::Scene;

/// Times over the loop of six seconds.
const FRAMES: u32 = 20;
/// Times each is measured; the least counts, so that other work on the machine does not.
const RUNS: u32 = 10;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let assets = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets"));
    let written = fs::read_to_string(assets.join("metaballs.ron"))?;
    println!("cells  triangles (least … most)  loading  a frame (median)");
    for cells in [16, 32, 64, 128] {
        let text = written.replace("cells: 32", &format!("cells: {cells}"));
        let reader = |path: &Path| -> io::Result<Vec<u8>> {
            if path == Path::new("metaballs.ron") { Ok(text.clone().into_bytes()) } else { fs::read(assets.join(path)) }
        };
        let start = Instant::now();
        let scene = Scene::load_with("metaballs.ron", &reader).map_err(|faults| faults.to_string())?;
        let loading = start.elapsed();
        let mut frames: Vec<_> = (0..FRAMES)
            .map(|frame| {
                let time = 6.0 * f64::from(frame) / f64::from(FRAMES);
                let runs = (0..RUNS).map(|_| {
                    let start = Instant::now();
                    let state = scene.sample(time);
                    (start.elapsed(), state.info.triangle_count)
                });
                runs.min().unwrap_or_default()
            })
            .collect();
        let (least, most) = frames.iter().fold((u32::MAX, 0), |(least, most), frame| (least.min(frame.1), most.max(frame.1)));
        frames.sort();
        let median = frames[frames.len() / 2].0;
        println!(
            "{cells:5}  {least:6} … {most:6} of {:6}  {:5.0} ms  {:6.2} ms",
            scene.room.triangles,
            1e3 * loading.as_secs_f64(),
            1e3 * median.as_secs_f64()
        );
    }
    Ok(())
}
