//! `manylight render`: frames of a scene, the last one written.

use manylight::{
    Budget,
    fault::Fault,
    files::{FileKind, write_text},
    lab::{
        facts,
        timing::{self, FrameSamples, serial_by_default, timed_frame},
    },
    renderer::Renderer,
};
use serde_json::{Value, json};

use super::{
    budget, note, of_file,
    outputs::Outputs,
    session::{Session, bad_numbers, settings, time_of},
    stats,
};
use crate::{
    cli::{Cli, RenderArgs},
    progress,
};

/// Checks everything that can be known, then renders and writes.
pub fn run(cli: &Cli, args: &RenderArgs) -> Result<(), Fault> {
    let outputs = Outputs { pictures: args.out.clone(), dumps: args.dump.clone() };
    check(args, &outputs)?;
    let session = Session::open(cli, &args.pipeline.pipeline)?;
    let scene = session.scene(&args.frame.scene)?;
    let mut settings = settings(&args.pipeline, &args.frame, outputs.keep(session.documents.registry()))?;
    // Times are those of all work.
    settings.skip_unchanged &= args.stats.is_none();
    outputs.check_plan(&session.plan(Some(&scene), &settings)?)?;
    let gpu = super::open_gpu(args.frame.adapter.as_ref())?;
    let spinner = progress::spinner("compiling shaders");
    let mut renderer = session.renderer(&gpu, scene, settings)?;
    spinner.finish_and_clear();
    let mut budget = budget::open(&args.budget, &renderer)?;
    let (samples, bad_numbers) = frames(&mut renderer, args, budget.as_mut())?;
    outputs.write(&renderer)?;
    if let Some(file) = &args.stats {
        let mut stats = stats(&renderer, args, &samples)?;
        if let Some(budget) = &budget {
            stats["budget"] = budget::to_json(budget);
        }
        write_text(file, &format!("{stats:#}\n")).map_err(of_file)?;
    }
    if let Some(budget) = &budget {
        note(&budget::text(budget));
        budget::write_trace(&args.budget, budget)?;
    }
    bad_numbers.map_or(Ok(()), Err)
}

fn check(args: &RenderArgs, outputs: &Outputs) -> Result<(), Fault> {
    if args.out.is_empty() && args.dump.is_empty() && args.stats.is_none() {
        return Err(Fault::Usage("there is nothing to write: give --out FILE, --dump RESOURCE=FILE or --stats FILE.json".to_owned()));
    }
    outputs.check_files(args.stats.as_deref())?;
    budget::check(&args.budget)?;
    match &args.stats {
        Some(file) if !matches!(FileKind::of(file), Ok(FileKind::Json)) => {
            Err(Fault::Usage(format!("`{}`: --stats writes a .json file", file.display())))
        }
        _ => Ok(()),
    }
}

/// Renders all frames, or until one has bad numbers.
fn frames(renderer: &mut Renderer, args: &RenderArgs, mut budget: Option<&mut Budget>) -> Result<(FrameSamples, Option<Fault>), Fault> {
    let (mut samples, mut found) = (FrameSamples::new(renderer.plan()), None);
    let bar = progress::bar(args.frames.into(), "rendering");
    // Where timestamps say nothing of single nodes, every other frame is measured node by node; the picture is the same.
    let serial = args.stats.is_some() && serial_by_default(renderer.gpu());
    for frame in 0..u64::from(args.frames) {
        let one_by_one = serial && frame % 2 == 1;
        renderer.measure_serially(one_by_one);
        let (timings, wall_ms) = match timed_frame(renderer, time_of(&args.frame, frame)) {
            Ok(timed) => timed,
            Err(error) => {
                found = bad_numbers(Err(error))?;
                break;
            }
        };
        if !one_by_one {
            samples.push_frame(timings, wall_ms);
        }
        if one_by_one == serial {
            samples.push_nodes(timings);
        }
        // Frames measured node by node take longer. Another rung has other nodes, and times of its own.
        if let Some(budget) = budget.as_deref_mut().filter(|_| !one_by_one)
            && budget::follow(budget, renderer, Some(wall_ms))
        {
            samples = FrameSamples::new(renderer.plan());
        }
        bar.inc(1);
    }
    renderer.measure_serially(false);
    bar.finish_and_clear();
    Ok((samples, found))
}

fn stats(renderer: &Renderer, args: &RenderArgs, samples: &FrameSamples) -> Result<Value, Fault> {
    let (plan, scene) = (renderer.plan(), renderer.scene());
    let mut names: Vec<String> = args.dump.iter().map(|(name, _)| name.clone()).collect();
    names.extend(plan.radiance.map(|index| plan.resources[index].name.clone()));
    names.dedup();
    let (width, height) = renderer.settings().size;
    Ok(json!({
        "manylight": env!("CARGO_PKG_VERSION"),
        "pipeline": renderer.pipeline().name,
        "scene": {"name": scene.name, "triangles": scene.triangle_count(), "lights": scene.lights.len(), "features": scene.features()},
        "size": [width, height],
        "frames": args.frames,
        "time": time_of(&args.frame, u64::from(args.frames) - 1),
        "seed": args.frame.seed,
        "adapter": facts::adapter(renderer.gpu()),
        "parameters": facts::parameters(plan),
        "timings": timing::timings(samples, serial_by_default(renderer.gpu())),
        "memory": stats::memory(renderer),
        "plan": plan.to_json(),
        "sums": stats::sums(renderer, &names)?,
    }))
}
