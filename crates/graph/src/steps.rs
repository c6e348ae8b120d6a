//! Steps of a node with their sizes: workgroups, vertices, repetitions unrolled.

use std::collections::BTreeMap;

use crate::{
    diagnostics::Diagnostic,
    expr::{self, EvalError, Scope},
    plan::{PlanStep, Target, Workgroups},
    registry::{Expr, NodeDecl, Over, Repeat, Step},
    shader::Stage,
    value::{ResourceDesc, Value},
};

/// Workgroups that a dispatch may have in a dimension.
pub const MOST_GROUPS: u64 = 65_535;
/// A step is not repeated more often than this: the frame would not end.
const MOST_REPEATS: u64 = 4096;

/// What steps are sized by: the node's ports and parameters.
pub(crate) struct NodeScope<'a> {
    pub decl: &'a NodeDecl,
    /// What is connected to each port, with its description.
    pub ports: BTreeMap<&'a str, (Target, ResourceDesc)>,
    pub params: &'a [(String, Value)],
    pub output: (u32, u32),
}

impl Scope for NodeScope<'_> {
    fn param(&self, name: &str) -> Option<i64> {
        self.params.iter().find(|(n, _)| n == name).and_then(|(_, value)| match value {
            Value::Int(v) => Some(*v),
            _ => None,
        })
    }

    fn output(&self) -> (u32, u32) {
        self.output
    }

    /// An unconnected optional port has no texels.
    fn texture(&self, name: &str) -> Option<(u32, u32)> {
        match self.ports.get(name) {
            Some((_, ResourceDesc::Texture { width, height, .. })) => Some((*width, *height)),
            Some(_) => None,
            None => Some((0, 0)),
        }
    }

    /// An unconnected optional port has no elements.
    fn elements(&self, name: &str) -> Option<u64> {
        match self.ports.get(name) {
            Some((_, ResourceDesc::Buffer { count, .. })) => Some(*count),
            Some(_) => None,
            None => Some(0),
        }
    }

    /// A node knows no conditions of pipelines: its declaration cannot name one.
    fn holds(&self, _: &str) -> Option<bool> {
        None
    }
}

/// All steps of the node `id`. Steps without any work are left out. Faults go to `out`.
pub(crate) fn unroll(id: &str, scope: &NodeScope<'_>, out: &mut Vec<Diagnostic>) -> Vec<PlanStep> {
    let mut steps = Vec::new();
    for step in &scope.decl.steps {
        let fault = |what: String, help: &str| {
            let span = match step {
                Step::Compute { span, .. } | Step::Draw { span, .. } => span.clone(),
            };
            Diagnostic::error(format!("a step of node `{id}` {what}"), span).help(help.to_owned())
        };
        if let Err(error) = unroll_step(step, scope, &mut steps) {
            out.push(match error {
                StepError::Eval(EvalError::Unknown(_)) => continue,
                StepError::Eval(error) => fault(format!("cannot be sized: {error}"), "change the parameter or the expression"),
                StepError::Groups(groups) => fault(
                    format!("has {}×{}×{} workgroups, more than {MOST_GROUPS} in a dimension", groups[0], groups[1], groups[2]),
                    "lower the size, or spread the work over more dimensions",
                ),
                StepError::Repeats(count) => fault(
                    format!("is repeated {count} times, more than {MOST_REPEATS}"),
                    "lower the parameter, or do more work in a repetition",
                ),
                StepError::Targets([(a, size), (b, other)]) => fault(
                    format!("draws to `{a}` with {}×{} and to `{b}` with {}×{} texels", size.0, size.1, other.0, other.1),
                    "give the resources of all targets one size",
                ),
                StepError::Draws(count) => {
                    fault(format!("draws {count} vertices or instances, more than 2^32"), "draw fewer triangles, or less often")
                }
            });
        }
    }
    steps
}

enum StepError {
    Eval(EvalError),
    Groups([u64; 3]),
    Repeats(u64),
    /// Vertices or instances.
    Draws(u64),
    /// Two targets with their sizes.
    Targets([(String, (u32, u32)); 2]),
}

impl From<EvalError> for StepError {
    fn from(error: EvalError) -> Self {
        Self::Eval(error)
    }
}

fn unroll_step(step: &Step, scope: &NodeScope<'_>, steps: &mut Vec<PlanStep>) -> Result<(), StepError> {
    match step {
        Step::Compute { entry, over, repeat, .. } => {
            let mut push = |level: u32, mip: Option<(String, u32)>| {
                let groups = match over {
                    // Without a buffer there is no work.
                    Over::Indirect(port) => scope.ports.get(port.as_str()).map(|(target, _)| Workgroups::Indirect(*target)),
                    _ => {
                        let groups = groups(scope, entry, over, mip.as_ref().map(|(port, _)| port.as_str()), level)?;
                        (!groups.contains(&0)).then_some(Workgroups::Fixed(groups))
                    }
                };
                steps.extend(groups.map(|groups| PlanStep::Compute { entry: entry.clone(), groups, mip }));
                Ok::<(), StepError>(())
            };
            let levels = |port: &str| match scope.ports.get(port) {
                Some((_, ResourceDesc::Texture { mips, .. })) => *mips,
                _ => 0,
            };
            match repeat {
                None => push(0, None),
                Some(Repeat::Down(port)) => (1..levels(port)).try_for_each(|level| push(level, Some((port.clone(), level)))),
                Some(Repeat::Up(port)) => {
                    (0..levels(port).saturating_sub(1)).rev().try_for_each(|level| push(level, Some((port.clone(), level))))
                }
                Some(Repeat::Times(count)) => {
                    let count = expr::eval(count, scope)?;
                    if count > MOST_REPEATS {
                        return Err(StepError::Repeats(count));
                    }
                    (0..count).try_for_each(|_| push(0, None))
                }
            }
        }
        Step::Draw { vertex, fragment, vertices, instances, targets, depth, .. } => {
            let count =
                |expr| expr::eval(expr, scope).map_err(StepError::from).and_then(|n| u32::try_from(n).map_err(|_| StepError::Draws(n)));
            let (vertices, instances) = (count(vertices)?, count(instances)?);
            let sized = |port: &String| scope.texture(port).map(|size| (port.clone(), size));
            let is_there = |port: &&String| scope.ports.contains_key(port.as_str());
            let mut all = targets.iter().chain(depth).filter(is_there).filter_map(sized);
            if let Some(first) = all.next()
                && let Some(other) = all.find(|(_, size)| *size != first.1)
            {
                return Err(StepError::Targets([first, other]));
            }
            let resource = |port: &String| match scope.ports.get(port.as_str()) {
                Some((Target::Resource(ix), _)) => Some(*ix),
                _ => None,
            };
            let targets = targets.iter().map(resource).collect();
            let depth = depth.as_ref().and_then(resource);
            steps.push(PlanStep::Draw { vertex: vertex.clone(), fragment: fragment.clone(), vertices, instances, targets, depth });
            Ok(())
        }
    }
}

fn groups(scope: &NodeScope<'_>, entry: &str, over: &Over, mip_port: Option<&str>, level: u32) -> Result<[u32; 3], StepError> {
    let entry = scope.decl.shader.iter().flat_map(|s| &s.entries).find(|e| e.stage == Stage::Compute && e.name == entry);
    let size = entry.map_or([1; 3], |e| e.workgroup_size.map(|n| u64::from(n.max(1))));
    let wanted = match over {
        Over::Texels(port) => {
            let (width, height) = scope.texture(port).unwrap_or_default();
            let at_level = |side: u32| if side == 0 || mip_port != Some(port) { side } else { (side >> level).max(1) };
            [u64::from(at_level(width)).div_ceil(size[0]), u64::from(at_level(height)).div_ceil(size[1]), 1]
        }
        Over::Elements(port) => {
            let groups = scope.elements(port).unwrap_or_default().div_ceil(size[0]);
            if groups > MOST_GROUPS { [MOST_GROUPS, groups.div_ceil(MOST_GROUPS), 1] } else { [groups, groups.min(1), groups.min(1)] }
        }
        Over::Threads(x, y, z) => {
            let [x, y, z] = triple(scope, x, y, z)?;
            [x.div_ceil(size[0]), y.div_ceil(size[1]), z.div_ceil(size[2])]
        }
        Over::Groups(x, y, z) => triple(scope, x, y, z)?,
        Over::Indirect(_) => [0; 3],
    };
    if wanted.iter().any(|n| *n > MOST_GROUPS) {
        return Err(StepError::Groups(wanted));
    }
    // At most 65535 each.
    Ok(wanted.map(|n| n as u32))
}

fn triple(scope: &NodeScope<'_>, x: &Expr, y: &Expr, z: &Expr) -> Result<[u64; 3], StepError> {
    Ok([expr::eval(x, scope)?, expr::eval(y, scope)?, expr::eval(z, scope)?])
}
