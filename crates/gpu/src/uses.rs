//! What a plan asks of its resources: who writes them, how they are used, and what the host must hold.

use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
};

use manylight_graph::{
    plan::{Lifetime, Plan, PlanNode, PlanResource, PlanStep, ResourceIx, Target, Usage},
    registry::Direction,
    shader::GlobalKind,
    value::ResourceDesc,
};

use crate::{
    externals::Externals,
    format::byte_size,
    frame::{Frame, Host, UsedExternal},
    host::{HostBytes, HostNodes},
};

/// Whether the port gives.
pub(crate) fn is_output(node: &PlanNode, port: &str) -> bool {
    node.decl.ports.get(port).is_some_and(|p| p.direction == Direction::Output)
}

/// Which resources a host node writes.
pub(crate) fn host_outputs(plan: &Plan) -> Vec<bool> {
    let mut all = vec![false; plan.resources.len()];
    let on_host = plan.nodes.iter().filter(|n| n.decl.shader.is_none());
    on_host.flat_map(PlanNode::outputs).for_each(|ix| all[ix] = true);
    all
}

/// Zeroed contents for the outputs of host nodes.
pub(crate) fn host_bytes(plan: &Plan, host_outputs: &[bool]) -> BTreeMap<ResourceIx, HostBytes> {
    let mut all = BTreeMap::new();
    for (ix, r) in plan.resources.iter().enumerate() {
        if let ResourceDesc::Buffer { stride, count, .. } = r.desc
            && host_outputs[ix]
        {
            let bytes = (u64::from(stride) * count).min(byte_size(&r.desc)) as usize;
            all.insert(ix, HostBytes { bytes: vec![0; bytes], stride, stamp: 0 });
        }
    }
    all
}

/// The state of a host node: that of the previous frame, if it has one of this id and kind.
pub(crate) fn host(plan: &Plan, hosts: &HostNodes, previous: Option<&Frame>, node: &PlanNode) -> Option<Host> {
    let kept = previous.and_then(|f| {
        let at = f.plan.nodes.iter().position(|n| n.id == node.id && n.decl.name == node.decl.name)?;
        Some(f.nodes[at].host.as_ref()?.node.clone())
    });
    let make = || {
        let kind = hosts.find(&node.decl.name)?;
        Some(Arc::new(Mutex::new((kind.make)())))
    };
    let mut host = Host { node: kept.or_else(make)?, outputs: Vec::new(), externals: Vec::new(), inputs: Vec::new(), ran_with: None };
    for (port, target) in &node.bindings {
        match *target {
            Target::Resource(ix) if is_output(node, port) => host.outputs.push(ix),
            Target::Resource(ix) | Target::Previous(ix) => {
                let r = &plan.resources[ix];
                if r.lifetime == Lifetime::External {
                    host.externals.push(r.name.clone());
                } else {
                    host.inputs.push(ix);
                }
            }
            Target::Absent => {}
        }
    }
    Some(host)
}

/// The externals that the plan reads, as they are now.
pub(crate) fn used_externals(plan: &Plan, externals: &Externals) -> Vec<UsedExternal> {
    let of = |(resource, r): (usize, &PlanResource)| {
        let bound = externals.memory(&r.name)?.clone();
        (r.lifetime == Lifetime::External).then_some(UsedExternal { resource, bound })
    };
    plan.resources.iter().enumerate().filter_map(of).collect()
}

/// Usages over all nodes: what the plan says, and what the shaders declare.
pub(crate) fn usages(plan: &Plan) -> Vec<Usage> {
    let mut all: Vec<Usage> = plan.resources.iter().map(|r| r.usage).collect();
    for node in &plan.nodes {
        for step in &node.steps {
            if let PlanStep::Draw { targets, depth, .. } = step {
                for &ix in targets.iter().flatten().chain(depth) {
                    all[ix].target = true;
                }
            }
        }
        let Some(shader) = &node.decl.shader else {
            continue;
        };
        for global in &shader.globals {
            let port = node.bindings.iter().find(|(port, _)| *port == global.name);
            if let Some((_, Target::Resource(ix) | Target::Previous(ix))) = port
                && matches!(global.kind, GlobalKind::StorageTexture { .. })
            {
                all[*ix].storage = true;
            }
        }
    }
    all
}
