//! Which nodes run: conditions, who writes what, cycles, who feeds the picture.

use std::collections::{BTreeMap, BTreeSet};

use petgraph::graph::{EdgeIndex, NodeIndex};

use super::{Activity, Planner, Read};
use crate::{
    condition::ConditionKind,
    diagnostics::{Diagnostic, Span},
    order::{self, Dag},
    registry::Direction,
    render::suggest,
    resolve::Wire,
};

/// So many nodes that are off are all told of.
const MOST_TOLD: usize = 3;

impl<'a> Planner<'a, '_> {
    pub(super) fn activity(&mut self) -> Activity<'a> {
        let conditions = self.linked.nodes.iter().map(|node| node.usage.when.as_ref());
        let verdicts = conditions.map(|when| when.map(|when| self.facts.verdict(when))).collect();
        let mut activity = Activity { verdicts, producer: BTreeMap::new() };
        for (index, node) in self.linked.nodes.iter().enumerate() {
            if !activity.is_on(index) {
                continue;
            }
            for (_, port, wire) in node.ports() {
                let (Direction::Output, Wire::Resource { name, span, .. }) = (port.direction, wire) else { continue };
                match activity.producer.get(name) {
                    // Whether one of them runs may be unknown.
                    Some(other) if *other != index && self.linked.tainted.contains(name) => {}
                    Some(other) if *other != index => {
                        let other = &self.linked.nodes[*other].usage.id;
                        self.out.push(
                            Diagnostic::error(
                                format!("`{name}` is written by two nodes: `{}` and `{}`", other.text, node.usage.id.text),
                                span.clone(),
                            )
                            .and(other.span.clone(), "the other one")
                            .help("give them conditions that exclude each other, or resources of their own"),
                        );
                    }
                    _ => {
                        activity.producer.insert(name, index);
                    }
                }
            }
        }
        activity
    }

    /// Resources that a node reads, with the last frame's told apart.
    pub(super) fn reads(&self, node: usize) -> impl Iterator<Item = (&'a str, bool, bool, &'a Span)> + use<'a> {
        let reads: Vec<_> = self
            .ports(node)
            .into_iter()
            .filter_map(|(_, port, wire)| match (port.direction, wire) {
                (Direction::Input, Wire::Resource { name, previous, span }) => Some((name, previous, port.optional, span)),
                _ => None,
            })
            .collect();
        reads.into_iter()
    }

    pub(super) fn dag(&self, activity: &Activity<'a>) -> Dag<Read<'a>> {
        let mut dag = Dag::with_capacity(self.linked.nodes.len(), self.linked.nodes.len() * 4);
        for index in 0..self.linked.nodes.len() {
            dag.add_node(index);
        }
        for index in (0..self.linked.nodes.len()).filter(|index| activity.is_on(*index)) {
            for (resource, previous, _, span) in self.reads(index) {
                if let (false, Some(from)) = (previous, activity.producer.get(resource)) {
                    dag.update_edge(NodeIndex::new(*from), NodeIndex::new(index), Read { resource, span });
                }
            }
        }
        dag
    }

    pub(super) fn cycles(&mut self, dag: &Dag<Read<'a>>) -> bool {
        let cycles = order::cycles(dag);
        for cycle in &cycles {
            let id = |n: NodeIndex| self.linked.nodes[dag[n]].usage.id.text.as_str();
            let next = |at: usize| cycle[(at + 1) % cycle.len()];
            let edge = |at: usize| -> Option<Read<'a>> {
                let edge: EdgeIndex = dag.find_edge(cycle[at], next(at))?;
                dag.edge_weight(edge).copied()
            };
            let names: Vec<&str> = (0..=cycle.len()).map(|at| id(cycle[at % cycle.len()])).collect();
            let message = if cycle.len() == 1 {
                format!("node `{}` reads what it writes itself", names[0])
            } else {
                format!("nodes wait for each other in a cycle: {}", names.join(" → "))
            };
            let mut labels = (0..cycle.len()).filter_map(|at| edge(at).map(|read| (at, read)));
            let Some((at, first)) = labels.next() else { continue };
            let say =
                |at: usize, read: &Read<'_>| format!("`{}` reads `{}`, which `{}` writes", id(next(at)), read.resource, id(cycle[at]));
            let mut fault = Diagnostic::error(message, first.span.clone()).at(say(at, &first));
            for (at, read) in labels {
                fault = fault.and(read.span.clone(), say(at, &read));
            }
            self.out.push(fault.help("read the last frame's value with Previous(\"…\") in one place, or write to another resource"));
        }
        !cycles.is_empty()
    }

    /// Nodes that feed what is shown or kept. Reading what nobody writes is a fault for these.
    pub(super) fn live(&mut self, activity: &Activity<'a>) -> BTreeSet<usize> {
        let mut wanted: Vec<usize> = Vec::new();
        let pipeline = self.linked.pipeline;
        let shown = [Some(&pipeline.presents), pipeline.radiance.as_ref()];
        for name in shown.into_iter().flatten() {
            match activity.producer.get(name.text.as_str()) {
                Some(node) => wanted.push(*node),
                None => self.unproduced(&name.text, &name.span, "", activity),
            }
        }
        for name in &self.input.keep {
            if !pipeline.resources.contains_key(name) {
                if pipeline.gaps.files || pipeline.gaps.resources.contains(name) {
                    continue;
                }
                let help = suggest(name, pipeline.resources.keys().map(String::as_str));
                self.out.push(Diagnostic::error_nowhere(format!("the pipeline `{}` has no resource `{name}`", pipeline.name)).help(help));
            } else if let Some(node) = activity.producer.get(name.as_str()) {
                wanted.push(*node);
            } else if !self.linked.tainted.contains(name) && !self.linked.incomplete {
                let why = self.producers_off(name, activity);
                self.out.push(
                    Diagnostic::error_nowhere(format!("`{name}` is not written in this frame{why}"))
                        .help("set the parameters so that it is"),
                );
            }
        }
        let mut live = BTreeSet::new();
        let mut said = BTreeSet::new();
        while let Some(node) = wanted.pop() {
            if !live.insert(node) {
                continue;
            }
            for (resource, _, optional, span) in self.reads(node) {
                match activity.producer.get(resource) {
                    Some(from) => wanted.push(*from),
                    None if optional => {}
                    None => {
                        if said.insert((node, resource)) {
                            let id = &self.linked.nodes[node].usage.id.text;
                            self.unproduced(resource, span, &format!("`{id}` reads it"), activity);
                        }
                    }
                }
            }
        }
        live
    }

    /// With culling off: live nodes, and all others that have what they need.
    pub(super) fn runnable(&self, activity: &Activity<'a>, live: &BTreeSet<usize>) -> BTreeSet<usize> {
        let mut runs: BTreeSet<usize> =
            (0..self.linked.nodes.len()).filter(|n| activity.is_on(*n) && self.linked.nodes[*n].decl.is_some()).collect();
        loop {
            let lacking: Vec<usize> = runs
                .iter()
                .copied()
                .filter(|n| !live.contains(n))
                .filter(|n| {
                    self.reads(*n).any(|(r, _, optional, _)| !optional && activity.producer.get(r).is_none_or(|p| !runs.contains(p)))
                })
                .collect();
            if lacking.is_empty() {
                return runs;
            }
            lacking.iter().for_each(|n| {
                runs.remove(n);
            });
        }
    }

    pub(super) fn producers_off(&self, resource: &str, activity: &Activity<'a>) -> String {
        let reasons: Vec<String> = self
            .nearly_on(resource, activity)
            .into_iter()
            .filter_map(|index| {
                let why = activity.off(index)?;
                Some(format!("node `{}`, which writes it, is off: {why}", self.linked.nodes[index].usage.id.text))
            })
            .collect();
        if reasons.is_empty() { String::new() } else { format!(": {}", reasons.join("; ")) }
    }

    /// Nodes that would write a resource but are off; of many, where some fulfil more clauses of their conditions than others, only those:
    /// of seven views, the one that was chosen.
    fn nearly_on(&self, resource: &str, activity: &Activity<'a>) -> Vec<usize> {
        let writes = |index: &usize| {
            self.linked.nodes[*index].ports().any(|(_, port, wire)| {
                port.direction == Direction::Output && matches!(wire, Wire::Resource { name, .. } if name == resource)
            })
        };
        let fulfilled = |index: usize| -> usize {
            match self.linked.nodes[index].usage.when.as_ref().map(|when| &when.kind) {
                Some(ConditionKind::All(clauses)) => clauses.iter().filter(|c| self.facts.holds(c)).count(),
                _ => 0,
            }
        };
        let off: Vec<(usize, usize)> = (0..self.linked.nodes.len())
            .filter(|index| !activity.is_on(*index) && writes(index))
            .map(|index| (index, fulfilled(index)))
            .collect();
        let most = if off.len() > MOST_TOLD { off.iter().map(|(_, count)| *count).max().unwrap_or(0) } else { 0 };
        off.into_iter().filter(|(_, count)| *count >= most).map(|(index, _)| index).collect()
    }

    pub(super) fn unproduced(&mut self, resource: &str, span: &Span, reader: &str, activity: &Activity<'a>) {
        if self.linked.tainted.contains(resource) || self.linked.incomplete {
            return;
        }
        let why = self.producers_off(resource, activity);
        let producers = self.nearly_on(resource, activity);
        let mut fault = Diagnostic::error(format!("`{resource}` is read, but not written in this frame{why}"), span.clone()).at(reader);
        for node in producers.iter().map(|index| &self.linked.nodes[*index]) {
            if let Some(when) = &node.usage.when {
                fault = fault.and(when.span.clone(), format!("the condition of `{}`", node.usage.id.text));
            }
        }
        self.out.push(fault.help(if producers.is_empty() {
            "let a node write it"
        } else {
            "set the parameters so that it is written, give the reader the same condition, or let another node write it otherwise"
        }));
    }
}
