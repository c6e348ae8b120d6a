//! `manylight explain`: a line a node: what runs, what does not, why, and what that saves.

use manylight::{fault::Fault, lab::facts};
use serde_json::{Value, json};

use super::{
    adapter_line,
    costs::Times,
    session::{Session, of_render, settings, time_of},
    states::{self, NodeState, State},
};
use crate::{
    cli::{Cli, ExplainArgs, TextOrJson},
    progress,
};

/// Plans without a GPU and prints a line a node; with frames, renders these and says what became of the nodes in the last.
pub fn run(cli: &Cli, args: &ExplainArgs) -> Result<(), Fault> {
    let session = Session::open(cli, &args.pipeline.pipeline)?;
    let scene = session.scene(&args.frame.scene)?;
    let settings = settings(&args.pipeline, &args.frame, Vec::new())?;
    let plan = session.plan(Some(&scene), &settings)?;
    let Some(frames) = args.frames else {
        let states = states::of_plan(&plan);
        return match args.format {
            TextOrJson::Text => super::print(&text(&states, None)),
            TextOrJson::Json => super::print(&format!("{:#}\n", report(&session.pipeline().name, &states, None))),
        };
    };
    let gpu = super::open_gpu(args.frame.adapter.as_ref())?;
    let mut renderer = session.renderer(&gpu, scene, settings)?;
    let time = |frame: u32| time_of(&args.frame, frame.into());
    let bar = progress::bar(frames.into(), "rendering");
    for frame in 0..frames {
        renderer.render_frame(time(frame)).map_err(of_render)?;
        renderer.wait_timings();
        bar.inc(1);
    }
    bar.finish_and_clear();
    let states = states::of_frame(renderer.frame());
    let times = Times::measure(&mut renderer, frames, time)?;
    match args.format {
        TextOrJson::Text => {
            let adapter = adapter_line(renderer.gpu());
            super::print(&format!("{}\n{}adapter: {adapter}\n", text(&states, Some(&times)), line(&times, &states, frames)))
        }
        TextOrJson::Json => {
            let mut report = report(&renderer.pipeline().name, &states, Some(&times));
            report["frames"] = json!(frames);
            report["adapter"] = facts::adapter(renderer.gpu());
            let (ran, everything) = times.totals(&states);
            report["time_ms"] = json!({"ran": ran, "everything": everything});
            super::print(&format!("{report:#}\n"))
        }
    }
}

fn line(times: &Times, states: &[NodeState], frames: u32) -> String {
    let (own, all) = times.totals(states);
    let what = if times.has_switches() { "with every switch on and nothing skipped" } else { "with nothing skipped" };
    let compared = match all {
        Some(all) if all > 0.0 => format!("; {what} {all:.3} ms, so that {:.1} % is saved", 100.0 * (1.0 - own / all)),
        _ => String::new(),
    };
    format!("nodes that ran in frame {frames}: {own:.3} ms{compared}\n")
}

fn text(states: &[NodeState], times: Option<&Times>) -> String {
    let width = states.iter().map(|l| l.id.chars().count()).max().unwrap_or(0);
    // A plan alone skips nothing.
    let state_width = if times.is_some() { 7 } else { 4 };
    let line = |node: &NodeState| {
        let saved = times.and_then(|times| times.saved(node)).map(|ms| format!("; saves {ms:.3} ms")).unwrap_or_default();
        format!("{:<width$}  {:<state_width$}  {}{saved}\n", node.id, node.state, node.reason)
    };
    states.iter().map(line).collect()
}

fn report(pipeline: &str, states: &[NodeState], times: Option<&Times>) -> Value {
    let nodes: Vec<Value> = states
        .iter()
        .map(|node| {
            let mut object = node.to_json();
            if let Some(times) = times {
                let is_running = node.state == State::Runs;
                object["time_ms"] = json!(if is_running { times.of(&node.id) } else { None });
                object["saved_ms"] = json!(times.saved(node));
            }
            object
        })
        .collect();
    json!({"pipeline": pipeline, "nodes": nodes})
}
