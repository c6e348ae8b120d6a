//! Makes a plan: which nodes run, in what order, on what memory, with what sizes.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    assign::Values,
    declaration::when,
    diagnostics::{Diagnostic, Diagnostics, Severity, Span},
    expr::Scope,
    facts::{Facts, Seen, Verdict},
    order::{self, Dag},
    pipeline::Pipeline,
    plan::{Chosen, Idle, IdleNode, Lifetime, Plan, PlanInput, PlanNode, PlanResource, PlanStep, Target, Usage},
    refuse,
    registry::{Direction, Port, Registry, Step},
    resolve::{Linked, LinkedNode, ParamSource, Wire, link},
    sizes::{LARGEST_SIDE, Sizes},
    slots,
    steps::{self, NodeScope},
    value::Value,
};

/// Plans a frame.
///
/// # Errors
/// Everything that is wrong with the pipeline, the values set, or the sizes that come of them; a combination of values that it refuses.
pub fn plan(pipeline: &Pipeline, registry: &Registry, input: &PlanInput) -> Result<Plan, Diagnostics> {
    let mut out = Vec::new();
    let (width, height) = input.output;
    if width == 0 || height == 0 || u64::from(width.max(height)) > LARGEST_SIDE {
        let fault = Diagnostic::error_nowhere(format!("a picture of {width}×{height} pixels cannot be rendered"));
        return Err(fault.help(format!("sides are 1 to {LARGEST_SIDE} pixels")).into());
    }
    let linked = link(pipeline, registry, input.features.keys().map(String::as_str).collect(), &mut out);
    for node in linked.nodes.iter().filter(|n| registry.faulty.contains(&n.usage.node.text)) {
        let name = &node.usage.node.text;
        let fault = Diagnostic::error(
            format!("the node `{name}` cannot be used: its declaration or shader has faults"),
            node.usage.node.span.clone(),
        );
        out.push(fault.help("mend those first; `check` shows them"));
    }
    let values = Values::assign(&linked, &input.set, &mut out);
    let refused = refuse::refused(&linked, &values, &input.set, input.into());
    if !refused.is_empty() {
        // What else is wrong with these values follows from it.
        out.extend(refused);
        return Err(Diagnostics(out).sorted());
    }
    let plan = Planner::new(&linked, &values, input, &mut out).run();
    let faults = Diagnostics(out).sorted();
    match plan {
        Some(plan) if !faults.has_errors() => Ok(plan),
        _ if faults.has_errors() => Err(faults),
        _ => Err(Diagnostic::error_nowhere(format!("the pipeline `{}` cannot be planned", pipeline.name)).into()),
    }
}

/// Why the pipeline refuses the values of an input; empty if it does not. What is wrong otherwise is told by [`plan`].
pub fn refusals(pipeline: &Pipeline, registry: &Registry, input: &PlanInput) -> Diagnostics {
    let mut unheard = Vec::new();
    let linked = link(pipeline, registry, input.features.keys().map(String::as_str).collect(), &mut unheard);
    let values = Values::assign(&linked, &input.set, &mut unheard);
    Diagnostics(refuse::refused(&linked, &values, &input.set, input.into())).sorted()
}

mod live;

/// An edge of the graph: the consumer's document index and where it names the resource.
#[derive(Debug, Clone, Copy)]
struct Read<'a> {
    resource: &'a str,
    span: &'a Span,
}

pub(crate) struct Planner<'a, 'p> {
    pub linked: &'p Linked<'a>,
    pub values: &'p Values<'a>,
    pub input: &'p PlanInput,
    facts: Facts<'p>,
    pub out: &'p mut Vec<Diagnostic>,
    /// Parameters of each node.
    params: Vec<Vec<(String, Value)>>,
    /// Of each node the ports that its parameters leave unused.
    unused: Vec<BTreeSet<&'a str>>,
}

/// What conditions leave: who is on and who writes what.
struct Activity<'a> {
    /// What its condition came to, by node; `None` where it has none.
    verdicts: Vec<Option<Verdict>>,
    /// The node that writes a resource.
    producer: BTreeMap<&'a str, usize>,
}

impl Activity<'_> {
    fn is_on(&self, node: usize) -> bool {
        self.verdicts[node].as_ref().is_none_or(|verdict| verdict.holds)
    }

    /// Why a node is off.
    fn off(&self, node: usize) -> Option<String> {
        self.verdicts[node].as_ref().filter(|verdict| !verdict.holds).map(Verdict::why)
    }
}

impl<'a, 'p> Planner<'a, 'p> {
    pub fn new(linked: &'p Linked<'a>, values: &'p Values<'a>, input: &'p PlanInput, out: &'p mut Vec<Diagnostic>) -> Self {
        let facts = Facts::new(linked, values, Seen::from(input));
        let params: Vec<_> = linked.nodes.iter().map(|node| values.of_node(node, &|condition| facts.holds(condition))).collect();
        let unused = |(node, params): (&LinkedNode<'a>, &Vec<(String, Value)>)| {
            let holds = |port: &Port| port.when.as_ref().is_none_or(|when| when::holds(when, params));
            node.ports().filter(|(_, port, _)| !holds(port)).map(|(name, ..)| name).collect()
        };
        let unused = linked.nodes.iter().zip(&params).map(unused).collect();
        Self { linked, values, input, facts, out, params, unused }
    }

    /// Ports of a node with what they are wired to; nothing where the port is not used.
    fn ports(&self, node: usize) -> Vec<(&'a str, &'a Port, Wire<'a>)> {
        let wire = |name: &str, wire| if self.unused[node].contains(name) { Wire::Absent } else { wire };
        self.linked.nodes[node].ports().map(|(name, port, own)| (name, port, wire(name, own))).collect()
    }

    /// The plan, if it can be made; what is in the way goes to `out`.
    pub fn run(mut self) -> Option<Plan> {
        let before = self.out.iter().filter(|d| d.severity == Severity::Error).count();
        let activity = self.activity();
        let dag = self.dag(&activity);
        let cyclic = self.cycles(&dag);
        let live = self.live(&activity);
        let runs = if self.input.debug.no_culling { self.runnable(&activity, &live) } else { live };
        let mut sizes = Sizes::new(self.linked, self.values, self.input, self.facts.named());
        let plan = self.assemble(&activity, &dag, &runs, &mut sizes);
        let faults = self.out.iter().filter(|d| d.severity == Severity::Error).count();
        if cyclic || faults > before { None } else { plan }
    }

    fn assemble(
        &mut self,
        activity: &Activity<'a>,
        dag: &Dag<Read<'a>>,
        runs: &BTreeSet<usize>,
        sizes: &mut Sizes<'a, '_>,
    ) -> Option<Plan> {
        let kept_dag = dag.filter_map(|_, n| runs.contains(n).then_some(*n), |_, e| Some(*e));
        let order = order::sort(&kept_dag, self.input.debug.shuffle);
        let mut table = Table::default();
        // In the order of the documents, so that plans of one pipeline look alike.
        let mut used: BTreeSet<&str> = BTreeSet::new();
        let wanted = self.wanted(runs);
        for index in &order {
            for (_, port, wire) in self.ports(*index) {
                match wire {
                    Wire::Resource { name, .. } if is_left_out(port, name, &wanted) => false,
                    Wire::Resource { name, .. } if activity.producer.get(name).is_some_and(|p| runs.contains(p)) => used.insert(name),
                    Wire::External(name) => used.insert(name),
                    _ => false,
                };
            }
        }
        let names = self.linked.pipeline.resources.keys().chain(self.linked.registry.externals.keys());
        for name in names.map(String::as_str).filter(|n| used.contains(n)) {
            if let Some(desc) = sizes.get(name, self.out) {
                let external = !self.linked.pipeline.resources.contains_key(name);
                table.add(name, desc, sizes.sized_by(name), external);
            }
        }
        let mut nodes = Vec::with_capacity(order.len());
        for (position, index) in order.iter().enumerate() {
            nodes.extend(self.node(*index, position, activity, &mut table, &wanted));
        }
        let presents = table.index.get(self.linked.pipeline.presents.text.as_str()).copied();
        let radiance = self.linked.pipeline.radiance.as_ref().and_then(|r| table.index.get(r.text.as_str()).copied());
        let share = !self.input.debug.no_reuse && !self.input.keep_unchanged;
        let slots = table.lifetimes(self.linked.pipeline, &nodes, [presents, radiance], &self.input.keep, share);
        let idle = self.idle(activity, runs);
        Some(Plan {
            nodes,
            idle,
            resources: table.resources,
            presents: presents?,
            radiance,
            params: self.values.pipeline.iter().map(|(n, v)| ((*n).to_owned(), v.clone())).collect(),
            slots,
        })
    }

    /// Resources that somebody reads.
    fn wanted(&self, runs: &BTreeSet<usize>) -> BTreeSet<&'a str> {
        let pipeline = self.linked.pipeline;
        let shown = [Some(&pipeline.presents), pipeline.radiance.as_ref()].into_iter().flatten().map(|name| name.text.as_str());
        let kept = pipeline.resources.keys().map(String::as_str).filter(|name| self.input.keep.iter().any(|kept| kept == name));
        shown.chain(kept).chain(runs.iter().flat_map(|node| self.reads(*node)).map(|(name, ..)| name)).collect()
    }

    fn node(
        &mut self,
        index: usize,
        position: usize,
        activity: &Activity<'a>,
        table: &mut Table<'a>,
        wanted: &BTreeSet<&str>,
    ) -> Option<PlanNode> {
        let linked = &self.linked.nodes[index];
        let mut bindings = Vec::with_capacity(linked.wires.len());
        let mut ports = BTreeMap::new();
        for (port_name, port, wire) in self.ports(index) {
            let drawn = linked.decl.is_some_and(|d| {
                d.steps.iter().any(|s| matches!(s, Step::Draw { targets, depth, .. } if targets.iter().any(|t| t == port_name) || depth.as_deref() == Some(port_name)))
            });
            let target = match wire {
                Wire::Resource { name, .. } if is_left_out(port, name, wanted) => Target::Absent,
                Wire::Resource { name, previous, .. } => match table.index.get(name).copied() {
                    Some(ix) if previous => {
                        table.previous[ix] = true;
                        Target::Previous(ix)
                    }
                    Some(ix) => {
                        table.touch(ix, position);
                        Target::Resource(ix)
                    }
                    None => Target::Absent,
                },
                Wire::External(name) => table.index.get(name).map_or(Target::Absent, |ix| Target::Resource(*ix)),
                Wire::Missing => {
                    let id = &linked.usage.id;
                    let fault = Diagnostic::error(format!("the input `{port_name}` of `{}` is not connected", id.text), id.span.clone());
                    let fault = fault.and(port.span.clone(), "the port, which is used with these parameters");
                    self.out
                        .push(fault.help(format!("add `\"{port_name}\": \"resource\"` to `in`, or set the node's parameters otherwise")));
                    Target::Absent
                }
                Wire::Absent | Wire::Faulty => Target::Absent,
            };
            if let Target::Resource(ix) | Target::Previous(ix) = target {
                let resource = &mut table.resources[ix];
                match port.direction {
                    Direction::Input => resource.usage.read = true,
                    Direction::Output if drawn => resource.usage.target = true,
                    Direction::Output => {
                        resource.usage.storage = true;
                        // The neighbouring level is read while the other is written.
                        resource.usage.read |= matches!(resource.desc, crate::value::ResourceDesc::Texture { mips, .. } if mips > 1);
                    }
                }
                ports.insert(port_name, (target, resource.desc.clone()));
            }
            bindings.push((port_name.to_owned(), target));
        }
        let params = self.params[index].clone();
        let id = linked.usage.id.text.clone();
        // Nodes without a declaration write nothing that is known, so none is live.
        let decl = std::sync::Arc::clone(linked.decl?);
        let scope = NodeScope { decl: &decl, ports, params: &params, output: self.input.output };
        let steps = steps::unroll(&id, &scope, self.out);
        steps.iter().filter_map(PlanStep::indirect).for_each(|ix| table.resources[ix].usage.indirect = true);
        let frames = decl.settles.as_ref().and_then(|name| scope.param(name)).filter(|frames| *frames > 0);
        let settles = frames.and_then(|frames| u32::try_from(frames).ok());
        let because = activity.verdicts[index].as_ref().map(Verdict::why);
        let chosen = linked.params.iter().zip(&params).filter_map(|((name, source), (_, value))| match source {
            ParamSource::If(when, ..) if !self.values.is_set(&id, name) => {
                Some(Chosen { param: (*name).to_owned(), value: value.clone(), because: self.facts.verdict(when).why() })
            }
            _ => None,
        });
        let chosen = chosen.collect();
        Some(PlanNode { id, stage: linked.usage.stage.clone(), decl, bindings, params, steps, because, chosen, settles })
    }

    fn idle(&self, activity: &Activity<'a>, runs: &BTreeSet<usize>) -> Vec<IdleNode> {
        let nodes = self.linked.nodes.iter().enumerate().filter(|(index, _)| !runs.contains(index));
        nodes
            .map(|(index, node)| IdleNode {
                id: node.usage.id.text.clone(),
                stage: node.usage.stage.clone(),
                kind: node.usage.node.text.clone(),
                reason: activity.off(index).map_or(Idle::Dead, Idle::Off),
            })
            .collect()
    }
}

/// Whether an output is not made, as nobody reads it.
fn is_left_out(port: &Port, resource: &str, wanted: &BTreeSet<&str>) -> bool {
    port.direction == Direction::Output && port.optional && !wanted.contains(resource)
}

/// Resources of the plan while it is made.
#[derive(Default)]
struct Table<'a> {
    index: BTreeMap<&'a str, usize>,
    resources: Vec<PlanResource>,
    /// First and last node, where any.
    lives: Vec<Option<(usize, usize)>>,
    previous: Vec<bool>,
}

impl<'a> Table<'a> {
    fn add(&mut self, name: &'a str, desc: crate::value::ResourceDesc, sized_by: Vec<String>, external: bool) {
        self.index.insert(name, self.resources.len());
        let lifetime = if external { Lifetime::External } else { Lifetime::Kept };
        self.resources.push(PlanResource { name: name.to_owned(), desc, sized_by, lifetime, usage: Usage::default() });
        self.lives.push(None);
        self.previous.push(false);
    }

    fn touch(&mut self, ix: usize, position: usize) {
        let (first, last) = self.lives[ix].get_or_insert((position, position));
        *first = (*first).min(position);
        *last = (*last).max(position);
    }

    fn lifetimes(&mut self, pipeline: &Pipeline, nodes: &[PlanNode], shown: [Option<usize>; 2], keep: &[String], share: bool) -> usize {
        // What a node left when it settled must stay: it would come to something else if it ran again.
        let settled: BTreeSet<usize> = nodes.iter().filter(|node| node.settles.is_some()).flat_map(PlanNode::outputs).collect();
        for (ix, resource) in self.resources.iter_mut().enumerate() {
            if resource.lifetime == Lifetime::External {
                continue;
            }
            let history = pipeline.resources.get(&resource.name).is_some_and(|r| r.history);
            let shown = shown.contains(&Some(ix));
            resource.usage.read |= shown;
            resource.lifetime = match self.lives[ix] {
                _ if history && self.previous[ix] => Lifetime::History,
                Some((first, last)) if !shown && !keep.contains(&resource.name) && !settled.contains(&ix) => {
                    Lifetime::Transient { first, last, slot: 0 }
                }
                _ => Lifetime::Kept,
            };
        }
        slots::assign(&mut self.resources, share)
    }
}
