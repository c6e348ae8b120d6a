//! Which nodes of a frame have to run: those of whose inputs one has changed since they ran.
//!
//! Every resource has a version, which changes when it is written by a node that ran, or set from outside. A node whose inputs have the versions that
//! they had when it ran last would write the same bits again: it is skipped, and its outputs stay. What depends on the number of the frame, or on what
//! it wrote itself in the frame before, has other inputs in every frame: it always runs, or declares that it `settles`: then it stops some frames after
//! the last change of anything else. That is part of what the node means, and holds whether unchanged nodes are skipped or not.

use manylight_graph::plan::{Lifetime, Plan, ResourceIx, Target};

use crate::uses::is_output;

/// The external that is another one in every frame.
const FRAME: &str = "frame";

/// What decides, from frame to frame.
pub(crate) struct Skipper {
    nodes: Vec<NodeState>,
    /// Versions of what each resource holds, of both copies where it has history.
    content: Vec<[u64; 2]>,
    /// The frame in which something that a resource depends on changed last, other than the number of the frame.
    cause: Vec<u64>,
    /// Externals with the stamps that they had.
    externals: Vec<(ResourceIx, String, u64)>,
    /// The resource that changes in every frame.
    frame: Option<ResourceIx>,
    /// Frames decided so far.
    now: u64,
    /// The latest version given out.
    newest: u64,
    /// Whether nodes are skipped where that changes nothing.
    on: bool,
}

/// What became of a node in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Decision {
    /// It ran for the first time, or for the first time after all was forgotten.
    First,
    /// It ran.
    Ran,
    /// It did not run: nothing that it reads changed since it did.
    Unchanged,
    /// It did not run: for as many frames as it `settles` after, nothing changed but the number of the frame and what it wrote itself.
    Settled,
}

impl Decision {
    /// Whether the node ran.
    pub fn ran(self) -> bool {
        matches!(self, Self::First | Self::Ran)
    }
}

struct NodeState {
    inputs: Vec<Target>,
    outputs: Vec<ResourceIx>,
    /// Those of the outputs that have two copies.
    histories: Vec<ResourceIx>,
    settles: Option<u64>,
    on_host: bool,
    /// Versions of the inputs when it ran last.
    ran_with: Vec<u64>,
    /// Whether an input has another version than when it ran before.
    changed: Vec<bool>,
    decision: Decision,
    /// Whether the copies of its histories differ although it does not run.
    copies: bool,
}

impl Skipper {
    /// For a plan; unchanged nodes are skipped only if no memory is shared.
    pub(crate) fn new(plan: &Plan, skip_unchanged: bool) -> Self {
        let transients = plan.resources.iter().filter(|r| matches!(r.lifetime, Lifetime::Transient { .. })).count();
        let on = skip_unchanged && plan.slots >= transients;
        let nodes = plan.nodes.iter().map(|node| {
            let inputs = node.bindings.iter().filter(|(port, target)| !is_output(node, port) && *target != Target::Absent);
            let outputs: Vec<ResourceIx> = node.outputs().collect();
            let inputs: Vec<Target> = inputs.map(|(_, target)| *target).collect();
            NodeState {
                changed: vec![true; inputs.len()],
                inputs,
                histories: outputs.iter().copied().filter(|ix| plan.resources[*ix].lifetime == Lifetime::History).collect(),
                outputs,
                settles: node.settles.map(u64::from),
                on_host: node.decl.shader.is_none(),
                ran_with: Vec::new(),
                decision: Decision::First,
                copies: false,
            }
        });
        let externals = plan.resources.iter().enumerate().filter(|(_, r)| r.lifetime == Lifetime::External);
        Self {
            nodes: nodes.collect(),
            content: vec![[0; 2]; plan.resources.len()],
            cause: vec![0; plan.resources.len()],
            externals: externals.map(|(ix, r)| (ix, r.name.clone(), 0)).collect(),
            frame: plan.resource(FRAME),
            now: 0,
            newest: 0,
            on,
        }
    }

    /// Lets all nodes run once more, as in the first frame.
    pub(crate) fn forget(&mut self) {
        self.nodes.iter_mut().for_each(|node| node.ran_with.clear());
        self.cause.fill(self.now + 1);
    }

    /// Whether a node runs in this frame.
    pub(crate) fn runs(&self, node: usize) -> bool {
        self.nodes[node].decision.ran()
    }

    /// What became of a node in the frame that was decided last.
    pub(crate) fn decision(&self, node: usize) -> Decision {
        self.nodes[node].decision
    }

    /// Inputs of a node that had changed in the frame that was decided last since the node ran before; of nodes on the host, none is known.
    pub(crate) fn changed(&self, node: usize) -> impl Iterator<Item = Target> + '_ {
        let node = &self.nodes[node];
        let is_known = !node.on_host;
        node.inputs.iter().zip(&node.changed).filter(move |(_, changed)| **changed && is_known).map(|(target, _)| *target)
    }

    /// Histories whose other copy must be brought up to date in place of running their node.
    pub(crate) fn copies(&self, node: usize) -> &[ResourceIx] {
        let node = &self.nodes[node];
        if node.copies { &node.histories } else { &[] }
    }

    /// Decides for the next frame, from the stamps of externals and of what host nodes wrote.
    pub(crate) fn decide(&mut self, parity: usize, external: impl Fn(&str) -> u64, host: impl Fn(ResourceIx) -> u64) {
        self.now += 1;
        let Self { nodes, content, cause, externals, frame, now, newest, on } = self;
        for (ix, name, known) in externals {
            let stamp = external(name);
            if *known != stamp {
                *known = stamp;
                content[*ix] = [stamp; 2];
                if Some(*ix) != *frame {
                    cause[*ix] = *now;
                }
            }
        }
        for node in nodes {
            if node.on_host {
                // It ran already, or not.
                node.decision = Decision::Unchanged;
                for &ix in &node.outputs {
                    let stamp = host(ix);
                    if content[ix] != [stamp; 2] {
                        (content[ix], cause[ix], node.decision) = ([stamp; 2], *now, Decision::Ran);
                    }
                }
                continue;
            }
            let version = |target: &Target| match *target {
                Target::Resource(ix) => content[ix][parity],
                Target::Previous(ix) => content[ix][1 - parity],
                Target::Absent => 0,
            };
            let changed = node.inputs.iter().filter_map(|target| match *target {
                Target::Resource(ix) | Target::Previous(ix) if Some(ix) != *frame => Some(cause[ix]),
                _ => None,
            });
            let changed = changed.max().unwrap_or(0);
            let is_first = node.ran_with.is_empty();
            let settled = !is_first && node.settles.is_some_and(|frames| *now - changed > frames);
            let same = !is_first && node.inputs.iter().map(version).eq(node.ran_with.iter().copied());
            // Without inputs there is nothing that could change.
            let same = same || (node.inputs.is_empty() && node.ran_with == [0]);
            node.decision = match () {
                () if is_first => Decision::First,
                () if *on && same => Decision::Unchanged,
                () if settled => Decision::Settled,
                () => Decision::Ran,
            };
            let runs = node.decision.ran();
            for (ix, changed) in node.changed.iter_mut().enumerate() {
                *changed = node.ran_with.get(ix).is_none_or(|known| *known != version(&node.inputs[ix]));
            }
            node.copies = false;
            if runs {
                node.ran_with.clear();
                node.ran_with.extend(node.inputs.iter().map(version));
                if node.inputs.is_empty() {
                    node.ran_with.push(0);
                }
            }
            for &ix in &node.outputs {
                let two = node.histories.contains(&ix);
                if runs && !same {
                    *newest += 1;
                    if two {
                        content[ix][parity] = *newest;
                    } else {
                        content[ix] = [*newest; 2];
                    }
                } else if two && content[ix][parity] != content[ix][1 - parity] {
                    content[ix][parity] = content[ix][1 - parity];
                    node.copies = !runs;
                }
                cause[ix] = cause[ix].max(changed);
            }
        }
    }
}
