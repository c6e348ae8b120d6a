//! What nodes cost, and what is saved by not running them: their times in frames in which all of them run.

use std::collections::BTreeMap;

use manylight::{
    Settings,
    fault::Fault,
    graph::value::Value,
    lab::timing::{FrameSamples, serial_by_default, timed_frame},
    renderer::Renderer,
};

use super::{
    session::of_render,
    states::{NodeState, State},
};

/// Frames of which a time is the median.
const SAMPLES: u32 = 5;
/// Frames that are rendered with every switch on before they are measured.
const WARM_UP: u32 = 4;

/// Milliseconds of each node in a frame; nodes without a sample are not there.
struct Costs(BTreeMap<String, f64>);

impl Costs {
    /// Renders the frame of this time some times, with no node skipped.
    fn measure(renderer: &mut Renderer, time: f64) -> Result<Self, Fault> {
        let mut samples = FrameSamples::new(renderer.plan());
        renderer.measure_serially(serial_by_default(renderer.gpu()));
        // The first warms up what was skipped for long.
        for round in 0..=SAMPLES {
            renderer.forget();
            let (timings, _) = timed_frame(renderer, time).map_err(of_render)?;
            if round > 0 {
                samples.push_nodes(timings);
            }
        }
        renderer.measure_serially(false);
        Ok(Self(samples.nodes.into_iter().filter_map(|node| Some((node.id, node.running.median()?))).collect()))
    }
}

/// What nodes cost when they run, as the pipeline is set and with every switch on.
pub struct Times {
    own: Costs,
    /// With every switch on that is `auto`; `None` where there is none, or the pipeline cannot run so.
    everything: Option<Costs>,
    has_switches: bool,
}

impl Times {
    /// Measures the last of so many frames, which was rendered already, by the time of each. The renderer is then as it was, but for its history.
    pub fn measure(renderer: &mut Renderer, frames: u32, time: impl Fn(u32) -> f64) -> Result<Self, Fault> {
        let last = time(frames.saturating_sub(1));
        let own = Costs::measure(renderer, last)?;
        let before = renderer.settings().clone();
        let Some(on) = everything_on(renderer) else { return Ok(Self { own, everything: None, has_switches: false }) };
        let everything = match renderer.set(on) {
            Ok(_) => {
                for frame in frames.saturating_sub(WARM_UP)..frames {
                    renderer.render_frame(time(frame)).map_err(of_render)?;
                }
                let costs = Costs::measure(renderer, last)?;
                renderer.set(before).map_err(Fault::Documents)?;
                Some(costs)
            }
            Err(faults) => {
                super::note("with every switch on the pipeline does not run, so that what is off has no time:");
                super::warn(&faults);
                None
            }
        };
        Ok(Self { own, everything, has_switches: true })
    }

    /// Whether there are switches that are `auto`.
    pub fn has_switches(&self) -> bool {
        self.has_switches
    }

    /// What a node costs that is part of the frame, when it runs.
    pub fn of(&self, id: &str) -> Option<f64> {
        self.own.0.get(id).copied()
    }

    /// What a node would cost, where it does not run.
    pub fn saved(&self, node: &NodeState) -> Option<f64> {
        match node.state {
            State::Runs => None,
            State::Skipped => self.of(&node.id),
            State::Off | State::Dead => self.everything.as_ref()?.0.get(&node.id).copied(),
        }
    }

    /// Of the nodes that run, and of a frame in which everything does.
    pub fn totals(&self, states: &[NodeState]) -> (f64, Option<f64>) {
        let ran = states.iter().filter(|node| node.state == State::Runs).filter_map(|node| self.of(&node.id));
        let all = if self.has_switches { self.everything.as_ref() } else { Some(&self.own) };
        (sum(ran), all.map(|costs| sum(costs.0.values().copied())))
    }
}

/// Of nothing, 0: `Iterator::sum` makes that -0.
fn sum(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |sum, number| sum + number)
}

/// Whether there are switches that are `auto`.
pub fn has_switches(renderer: &Renderer) -> bool {
    everything_on(renderer).is_some()
}

/// The same settings with every switch on that is `auto` now; `None` where there is none.
fn everything_on(renderer: &Renderer) -> Option<Settings> {
    let switches = renderer.pipeline().params.iter().filter(|(_, param)| param.kind.is_switch());
    let is_auto = |name: &str| matches!(renderer.plan().param(name), Some(Value::Choice(position)) if position == "auto");
    let on: Vec<(String, String)> = switches.filter(|(name, _)| is_auto(name)).map(|(name, _)| (name.clone(), "on".to_owned())).collect();
    if on.is_empty() {
        return None;
    }
    let mut settings = renderer.settings().clone();
    settings.set.extend(on);
    Some(settings)
}
