//! `manylight profile`: what each node costs.

use manylight::{
    Budget, Settings,
    fault::Fault,
    files::{FileKind, check_writable},
    lab::{
        facts,
        timing::{self, FrameSamples, NodeSamples, Samples, timed_frame},
    },
    renderer::Renderer,
};
use serde_json::json;

use super::{
    adapter_line, budget,
    costs::{Times, has_switches},
    of_file,
    session::{Session, of_render, settings, time_of},
    states::{self, NodeState, State},
    stats,
    table::{Table, bytes},
};
use crate::{
    cli::{Cli, ProfileArgs, TextOrJson, Timing},
    progress,
    trace::Trace,
};

/// Measures frames and prints a table.
pub fn run(cli: &Cli, args: &ProfileArgs) -> Result<(), Fault> {
    if let Some(file) = &args.trace {
        check_writable(file).map_err(of_file)?;
        if !matches!(FileKind::of(file), Ok(FileKind::Json)) {
            return Err(Fault::Usage(format!("`{}`: --trace writes a .json file", file.display())));
        }
    }
    budget::check(&args.budget)?;
    let session = Session::open(cli, &args.pipeline.pipeline)?;
    let scene = session.scene(&args.frame.scene)?;
    let settings = Settings { skip_unchanged: args.skip_unchanged, ..settings(&args.pipeline, &args.frame, Vec::new())? };
    session.plan(Some(&scene), &settings)?;
    let gpu = super::open_gpu(args.frame.adapter.as_ref())?;
    let mut renderer = session.renderer(&gpu, scene, settings)?;
    for frame in 0..args.warm_up {
        renderer.render_frame(time_of(&args.frame, frame.into())).map_err(of_render)?;
        renderer.wait_timings();
    }
    let mut number = u64::from(args.warm_up);
    let budget = budget::open(&args.budget, &renderer)?;
    let budget = budget.map(|budget| steer(&mut renderer, args, budget, &mut number)).transpose()?;
    let mut trace = args.trace.as_ref().map(|_| Trace::start()).transpose()?;
    let samples = measure(&mut renderer, args, number, trace.as_mut())?;
    if let (Some(trace), Some(file)) = (trace, &args.trace) {
        trace.write(file)?;
    }
    let states = node_states(&mut renderer, args, &samples, number + u64::from(args.frames))?;
    match args.format {
        TextOrJson::Text => {
            let budget = budget.as_ref().map_or_else(String::new, |budget| format!("\n{}", budget::text(budget)));
            super::print(&format!("{}{budget}", text(&renderer, args, &samples, &states)))
        }
        TextOrJson::Json => {
            let mut report = report(&renderer, args, &samples, &states);
            if let Some(budget) = &budget {
                report["budget"] = budget::to_json(budget);
            }
            super::print(&format!("{report:#}\n"))
        }
    }
}

/// Renders until the budget has found its rung: that is what is measured then.
fn steer(renderer: &mut Renderer, args: &ProfileArgs, mut budget: Budget, number: &mut u64) -> Result<Budget, Fault> {
    let spinner = progress::spinner("looking for the rung that holds the budget");
    let mut frames = 0;
    while !budget.is_settled() && frames < MOST_STEERED {
        let (_, wall_ms) = timed_frame(renderer, time_of(&args.frame, *number)).map_err(of_render)?;
        budget::follow(&mut budget, renderer, Some(wall_ms));
        *number += 1;
        frames += 1;
    }
    spinner.finish_and_clear();
    if !budget.is_settled() {
        super::note(&format!("the budget has not settled within {MOST_STEERED} frames: the load varies"));
    }
    budget::write_trace(&args.budget, &budget)?;
    Ok(budget)
}

/// Frames after which a budget that has not settled is left as it is.
const MOST_STEERED: u32 = 1000;

/// Whether nodes are submitted one by one.
fn is_serial(renderer: &Renderer, args: &ProfileArgs) -> bool {
    match args.timing {
        Timing::Auto => timing::serial_by_default(renderer.gpu()),
        Timing::Timestamps => false,
        Timing::Serial => true,
    }
}

/// Measures ordinary frames; when nodes are timed serially, as many more for the nodes.
fn measure(renderer: &mut Renderer, args: &ProfileArgs, mut number: u64, mut trace: Option<&mut Trace>) -> Result<FrameSamples, Fault> {
    let mut samples = FrameSamples::new(renderer.plan());
    if let Some(trace) = &mut trace {
        trace.plan(renderer.plan());
    }
    let serial = is_serial(renderer, args);
    let rounds: &[bool] = if serial { &[false, true] } else { &[false] };
    let bar = progress::bar(rounds.len() as u64 * u64::from(args.frames), "measuring");
    for &one_by_one in rounds {
        renderer.measure_serially(one_by_one);
        for _ in 0..args.frames {
            let from_us = trace.as_ref().map_or(0.0, |t| t.now_us());
            let (timings, wall_ms) = timed_frame(renderer, time_of(&args.frame, number)).map_err(of_render)?;
            number += 1;
            if !one_by_one {
                samples.push_frame(timings, wall_ms);
            }
            if one_by_one == serial {
                samples.push_nodes(timings);
                if let (Some(trace), Some(timings)) = (&mut trace, timings) {
                    trace.gpu_frame(timings, from_us);
                }
            }
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    Ok(samples)
}

fn sum(nodes: &[&NodeSamples], value: impl Fn(&NodeSamples) -> Option<f64>) -> Option<f64> {
    nodes.iter().filter_map(|n| value(n)).reduce(|a, b| a + b)
}

/// Milliseconds of the node on the processor that does its work.
fn cost(node: &NodeSamples) -> Option<f64> {
    if node.host { node.cpu.median() } else { node.gpu.median() }
}

/// What became of each node, with the milliseconds that this saved in a frame.
type States = Vec<(NodeState, Option<f64>)>;

/// The states of all nodes; what does not run in every frame is measured for what it would cost.
fn node_states(renderer: &mut Renderer, args: &ProfileArgs, samples: &FrameSamples, frames: u64) -> Result<States, Fault> {
    let states = states::over_frames(renderer.plan(), samples);
    let is_left_out = states.iter().any(|node| node.state != State::Runs) && has_switches(renderer);
    if !is_left_out && samples.nodes.iter().all(|node| node.skipped == 0) {
        return Ok(states.into_iter().map(|node| (node, None)).collect());
    }
    let frames = u32::try_from(frames).unwrap_or(u32::MAX);
    let times = Times::measure(renderer, frames, |frame| time_of(&args.frame, frame.into()))?;
    let saved = |node: &NodeState| {
        let skipped = samples.nodes.iter().find(|samples| samples.id == node.id).filter(|samples| samples.skipped > 0);
        match skipped {
            Some(samples) => times.of(&node.id).map(|ms| ms * samples.skipped as f64 / samples.cpu.len() as f64),
            None => times.saved(node),
        }
    };
    let with_saved = states.into_iter().map(|node| {
        let saved = saved(&node);
        (node, saved)
    });
    Ok(with_saved.collect())
}

/// A table of what does not run, and why.
fn idle_table(states: &States) -> String {
    let mut table = Table::new(&[("does not run", true), ("stage", true), ("state", true), ("saves", false), ("why", true)]);
    let idle = states.iter().filter(|(node, _)| node.state != State::Runs);
    let mut any = false;
    for (node, saved) in idle {
        any = true;
        let saved = saved.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.3}"));
        table.row(vec![node.id.clone(), node.stage.clone(), node.state.to_string(), saved, node.reason.clone()]);
    }
    if any { format!("{}\n", table.render()) } else { String::new() }
}

fn ms(value: Option<f64>) -> String {
    value.map_or("no sample".to_owned(), |v| format!("{v:.3}"))
}

fn share(value: Option<f64>, total: Option<f64>) -> String {
    match (value, total) {
        (Some(value), Some(total)) if total > 0.0 => format!("{:.1} %", 100.0 * value / total),
        _ => "-".to_owned(),
    }
}

fn heading(renderer: &Renderer, args: &ProfileArgs) -> String {
    let (width, height) = renderer.settings().size;
    format!(
        "{}, scene {}, {width} × {height}, {} frames after {} to warm up\nadapter: {}\n",
        renderer.pipeline().name,
        renderer.scene().name,
        args.frames,
        args.warm_up,
        adapter_line(renderer.gpu()),
    )
}

fn text(renderer: &Renderer, args: &ProfileArgs, samples: &FrameSamples, states: &States) -> String {
    let all: Vec<&NodeSamples> = samples.nodes.iter().collect();
    let attributed = sum(&all, |n| n.gpu.median());
    // Work of one pass may overlap the timestamps of another: what the nodes do not account for is shown, not hidden.
    let serial = is_serial(renderer, args);
    let rest = samples.gpu.median().zip(attributed).map(|(frame, nodes)| frame - nodes).filter(|rest| *rest > 0.0 && !serial);
    let total = sum(&all, cost).map(|nodes| nodes + rest.unwrap_or(0.0));
    let columns = [("GPU median", false), ("GPU p95", false), ("share", false), ("CPU median", false), ("CPU p95", false)];
    let times = |node: &NodeSamples| {
        let gpu = |value: Option<f64>| if node.host { "on the host".to_owned() } else { ms(value) };
        let (median, p95) = (gpu(node.gpu.median()), gpu(node.gpu.percentile(95.0)));
        vec![median, p95, share(cost(node), total), ms(node.cpu.median()), ms(node.cpu.percentile(95.0))]
    };
    let mut nodes = Table::new(&[&[("node", true), ("stage", true)][..], &columns].concat());
    for node in &samples.nodes {
        let skipped = match node.skipped {
            0 => String::new(),
            frames => format!(" (skipped in {frames} of {})", args.frames),
        };
        nodes.row([vec![node.id.clone() + &skipped, node.stage.clone()], times(node)].concat());
    }
    if rest.is_some() {
        nodes.row(vec!["(between nodes)".to_owned(), String::new(), ms(rest), String::new(), share(rest, total)]);
    }
    let mut stages = Table::new(&[&[("stage", true), ("nodes", false)][..], &columns].concat());
    for (stage, nodes) in samples.by_stage() {
        let gpu = |value: fn(&NodeSamples) -> Option<f64>| {
            if nodes.iter().all(|n| n.host) { "on the host".to_owned() } else { ms(sum(&nodes, value)) }
        };
        stages.row(vec![
            stage,
            nodes.len().to_string(),
            gpu(|n| n.gpu.median()),
            gpu(|n| n.gpu.percentile(95.0)),
            share(sum(&nodes, cost), total),
            ms(sum(&nodes, |n| n.cpu.median())),
            ms(sum(&nodes, |n| n.cpu.percentile(95.0))),
        ]);
    }
    let mut frame = Table::new(&[("frame", true), ("median", false), ("p95", false)]);
    let mut row = |name: &str, s: &Samples| frame.row(vec![name.to_owned(), ms(s.median()), ms(s.percentile(95.0))]);
    row("until the GPU is done", &samples.wall);
    row("GPU, first pass to last", &samples.gpu);
    row("CPU, record and submit", &samples.cpu);
    let no_timestamps =
        if renderer.gpu().has_timestamps() || serial { "" } else { "this adapter has no timestamps: GPU times are no sample\n" };
    let method = if serial { "; GPU: each node submitted on its own and waited for" } else { "; GPU: timestamps" };
    format!(
        "{}{no_timestamps}\ntimes in milliseconds{method}; CPU: to record\n{}\n{}{}\n{}\n{}",
        heading(renderer, args),
        nodes.render(),
        idle_table(states),
        stages.render(),
        frame.render(),
        memory_table(renderer)
    )
}

fn memory_table(renderer: &Renderer) -> String {
    let report = renderer.memory_report();
    let mut table = Table::new(&[("resource", true), ("memory", false), ("held as", true)]);
    for r in &report.resources {
        table.row(vec![r.name.clone(), bytes(r.bytes), stats::holding(r.holding)]);
    }
    let shared = report.pool_unshared.saturating_sub(report.pool);
    let skipping = bytes(renderer.memory_for_skipping());
    let skipping = if renderer.settings().skip_unchanged {
        format!("skipping unchanged nodes keeps {skipping} that could be shared; `--no-skipping` shares them")
    } else {
        format!("skipping unchanged nodes (`--skip-unchanged`) would take {skipping} more, since nothing is shared then")
    };
    format!(
        "{}total {} (pool {}, of which sharing saves {}; histories {}, kept {}, host {}), besides externals of {}\n{skipping}\n",
        table.render(),
        bytes(report.total()),
        bytes(report.pool),
        bytes(shared),
        bytes(report.history),
        bytes(report.kept),
        bytes(report.host),
        bytes(report.external),
    )
}

fn report(renderer: &Renderer, args: &ProfileArgs, samples: &FrameSamples, states: &States) -> serde_json::Value {
    let (width, height) = renderer.settings().size;
    let stages: Vec<_> = samples
        .by_stage()
        .into_iter()
        .map(|(stage, nodes)| {
            json!({
                "stage": stage,
                "nodes": nodes.len(),
                "gpu_ms": {"median": sum(&nodes, |n| n.gpu.median()), "p95": sum(&nodes, |n| n.gpu.percentile(95.0))},
                "cpu_ms": {"median": sum(&nodes, |n| n.cpu.median()), "p95": sum(&nodes, |n| n.cpu.percentile(95.0))},
            })
        })
        .collect();
    let mut report = timing::timings(samples, is_serial(renderer, args));
    report["stages"] = json!(stages);
    let states = states.iter().map(|(node, saved)| {
        let mut object = node.to_json();
        object["saved_ms"] = json!(saved);
        object
    });
    let states: Vec<_> = states.collect();
    json!({
        "manylight": env!("CARGO_PKG_VERSION"),
        "pipeline": renderer.pipeline().name,
        "scene": renderer.scene().name,
        "size": [width, height],
        "frames": args.frames,
        "warm_up": args.warm_up,
        "adapter": facts::adapter(renderer.gpu()),
        "parameters": facts::parameters(renderer.plan()),
        "timings": report,
        "states": states,
        "memory": stats::memory(renderer),
    })
}
