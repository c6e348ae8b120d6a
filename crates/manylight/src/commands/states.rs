//! What becomes of each node of a plan, and why: for `explain`, `profile` and traces.

use std::fmt;

use manylight::{
    gpu::{Decision, Frame},
    graph::{
        plan::{Idle, Lifetime, Plan, PlanNode, Target},
        registry::Direction,
    },
    lab::timing::FrameSamples,
};
use serde_json::{Value, json};

/// What becomes of a node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// It is part of the frame.
    Runs,
    /// It is part of the frame, but did not run in the latest one.
    Skipped,
    /// Its condition does not hold.
    Off,
    /// Nobody reads what it writes.
    Dead,
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Runs => "runs",
            Self::Skipped => "skipped",
            Self::Off => "off",
            Self::Dead => "dead",
        })
    }
}

/// A node with its state.
#[derive(Debug, Clone)]
pub struct NodeState {
    pub id: String,
    /// Its name in the registry.
    pub node: String,
    pub stage: String,
    pub state: State,
    pub reason: String,
    /// What its condition came to, where it has one.
    pub condition: Option<String>,
    /// What it reads that had changed since it ran before, in the latest frame; `None` where no frame is known.
    pub changed: Option<Vec<String>>,
    /// The rest of what it reads.
    pub unchanged: Option<Vec<String>>,
}

impl NodeState {
    /// As an object.
    pub fn to_json(&self) -> Value {
        let mut object = json!({
            "id": self.id, "state": self.state.to_string(), "reason": self.reason, "node": self.node, "stage": self.stage,
            "condition": self.condition,
        });
        if let (Some(changed), Some(unchanged)) = (&self.changed, &self.unchanged) {
            object["changed"] = json!(changed);
            object["unchanged"] = json!(unchanged);
        }
        object
    }
}

/// What is known of a plan alone: nodes that run, in their order, then those that do not.
pub fn of_plan(plan: &Plan) -> Vec<NodeState> {
    let running = plan.nodes.iter().map(|node| NodeState {
        id: node.id.clone(),
        node: node.decl.name.clone(),
        stage: node.stage.clone(),
        state: State::Runs,
        reason: reason(plan, node),
        condition: node.because.clone(),
        changed: None,
        unchanged: None,
    });
    let idle = plan.idle.iter().map(|node| {
        let (state, reason, condition) = match &node.reason {
            Idle::Off(clause) => (State::Off, format!("its condition does not hold: {clause}"), Some(clause.clone())),
            Idle::Dead => (State::Dead, "nothing that is shown, kept or remembered needs what it writes".to_owned(), None),
        };
        let (id, stage) = (node.id.clone(), node.stage.clone());
        NodeState { id, node: node.kind.clone(), stage, state, reason, condition, changed: None, unchanged: None }
    });
    running.chain(idle).collect()
}

/// Who reads what a node writes, why its condition holds, and what conditions chose.
fn reason(plan: &Plan, node: &PlanNode) -> String {
    let condition = node.because.iter().map(|because| format!("; its condition holds: {because}"));
    let chosen = node.chosen.iter().map(|chosen| format!("; with {} {}: {}", chosen.param, chosen.value, chosen.because));
    condition.chain(chosen).fold(readers(plan, node), |all, part| all + &part)
}

/// As [`of_plan`], with what became of the nodes in the latest frame.
pub fn of_frame(frame: &Frame) -> Vec<NodeState> {
    let plan = frame.plan();
    let mut states = of_plan(plan);
    for (ix, (state, node)) in states.iter_mut().zip(&plan.nodes).enumerate() {
        let changed: Vec<Target> = frame.changed_inputs(ix).collect();
        let names = |has_changed: bool| -> Vec<String> {
            let inputs = inputs(node).filter(|target| changed.contains(target) == has_changed);
            inputs.filter_map(|target| name(plan, target)).collect()
        };
        let (changed, unchanged) = (names(true), names(false));
        match frame.decision(ix) {
            Decision::First | Decision::Ran if node.decl.shader.is_none() => state.reason.push_str("; what it depends on changed"),
            Decision::First => state.reason.push_str("; it ran for the first time"),
            Decision::Ran if changed.is_empty() => state.reason.push_str("; it ran, as every node does where none is skipped"),
            Decision::Ran => state.reason.push_str(&format!("; it ran for the change of {}", quoted(&changed))),
            Decision::Unchanged => {
                state.state = State::Skipped;
                state.reason = unchanged_reason(&unchanged);
            }
            Decision::Settled => {
                state.state = State::Skipped;
                state.reason = settled_reason(node, &unchanged);
            }
        }
        if node.decl.shader.is_some() {
            (state.changed, state.unchanged) = (Some(changed), Some(unchanged));
        }
    }
    states
}

/// Why a node is skipped whose inputs are these.
fn unchanged_reason(inputs: &[String]) -> String {
    if inputs.is_empty() { "what it depends on is as it was".to_owned() } else { format!("unchanged since it ran: {}", quoted(inputs)) }
}

fn settled_reason(node: &PlanNode, unchanged: &[String]) -> String {
    let frames = node.settles.map_or(String::new(), |frames| format!(" after {frames} frames"));
    let others = if unchanged.is_empty() { String::new() } else { format!("; unchanged: {}", quoted(unchanged)) };
    format!("it has settled{frames} in which nothing changed but the number of the frame and what it writes itself{others}")
}

/// Why a node of a plan is skipped, for all frames in which it is: by whether it has settled.
pub fn skipped_reason(plan: &Plan, node: &PlanNode, settled: bool) -> String {
    if settled {
        return settled_reason(node, &[]);
    }
    // What a host node depends on besides what it reads (the scene) has no name.
    let names: Vec<String> =
        if node.decl.shader.is_some() { inputs(node).filter_map(|target| name(plan, target)).collect() } else { Vec::new() };
    unchanged_reason(&names)
}

/// What is known of a plan and of some frames of it: a node that was skipped in all of them is skipped.
pub fn over_frames(plan: &Plan, samples: &FrameSamples) -> Vec<NodeState> {
    let mut states = of_plan(plan);
    for ((state, node), samples) in states.iter_mut().zip(&plan.nodes).zip(&samples.nodes) {
        if samples.skipped == 0 {
            continue;
        }
        let frames = samples.cpu.len();
        let reason = skipped_reason(plan, node, samples.settled > 0);
        if samples.skipped == frames {
            (state.state, state.reason) = (State::Skipped, reason);
        } else {
            state.reason.push_str(&format!("; skipped in {} of {frames} frames: {reason}", samples.skipped));
        }
    }
    states
}

fn inputs(node: &PlanNode) -> impl Iterator<Item = Target> + '_ {
    let is_input = |port: &str| node.decl.ports.get(port).is_some_and(|p| p.direction == Direction::Input);
    node.bindings.iter().filter(move |(port, target)| is_input(port) && *target != Target::Absent).map(|(_, target)| *target)
}

fn name(plan: &Plan, target: Target) -> Option<String> {
    match target {
        Target::Resource(ix) => Some(plan.resources.get(ix)?.name.clone()),
        Target::Previous(ix) => Some(format!("{} of the last frame", plan.resources.get(ix)?.name)),
        Target::Absent => None,
    }
}

fn quoted(names: &[String]) -> String {
    let quote = |name: &String| match name.split_once(' ') {
        Some((name, rest)) => format!("`{name}` {rest}"),
        None => format!("`{name}`"),
    };
    names.iter().map(quote).collect::<Vec<_>>().join(", ")
}

/// Who needs what the node writes.
fn readers(plan: &Plan, node: &PlanNode) -> String {
    let uses = |ix: usize| Some(uses(plan, ix)).filter(|uses| !uses.is_empty()).map(|uses| (ix, uses));
    let parts: Vec<String> =
        node.outputs().filter_map(uses).map(|(ix, uses)| format!("`{}` is {}", plan.resources[ix].name, uses.join(" and "))).collect();
    if parts.is_empty() { "culling is off: nobody needs what it writes".to_owned() } else { parts.join("; ") }
}

fn uses(plan: &Plan, resource: usize) -> Vec<String> {
    let mut uses = Vec::new();
    if plan.presents == resource {
        uses.push("presented".to_owned());
    } else if plan.radiance == Some(resource) {
        uses.push("the linear radiance".to_owned());
    } else if plan.resources[resource].lifetime == Lifetime::Kept {
        uses.push("kept for reading".to_owned());
    }
    let readers = |wanted: Target| -> Vec<&str> {
        plan.nodes.iter().filter(|node| inputs(node).any(|target| target == wanted)).map(|node| node.id.as_str()).collect()
    };
    let now = readers(Target::Resource(resource));
    if !now.is_empty() {
        uses.push(format!("read by {}", now.join(", ")));
    }
    let next = readers(Target::Previous(resource));
    if !next.is_empty() {
        uses.push(format!("read in the next frame by {}", next.join(", ")));
    }
    uses
}
