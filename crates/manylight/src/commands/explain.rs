//! `manylight explain`: a line a node: what will run, what will not, and why.

use manylight::{
    Settings,
    fault::Fault,
    graph::plan::{Idle, Lifetime, Plan, PlanNode, Target},
    graph::registry::Direction,
};
use serde_json::json;

use super::session::Session;
use crate::cli::{Cli, ExplainArgs, TextOrJson};

/// A line of the explanation.
struct Line {
    id: String,
    state: &'static str,
    reason: String,
    node: String,
    stage: String,
}

/// Plans without a GPU and prints a line a node.
pub fn run(cli: &Cli, args: &ExplainArgs) -> Result<(), Fault> {
    let session = Session::open(cli, &args.pipeline.pipeline)?;
    let scene = session.scene(&args.scene)?;
    let settings = Settings { size: args.size.size, set: args.pipeline.set.clone(), ..Settings::default() };
    let plan = session.plan(Some(&scene), &settings)?;
    let lines = lines(&plan);
    match args.format {
        TextOrJson::Text => super::print(&text(&lines)),
        TextOrJson::Json => {
            let nodes: Vec<_> =
                lines.iter().map(|l| json!({"id": l.id, "state": l.state, "reason": l.reason, "node": l.node, "stage": l.stage})).collect();
            super::print(&format!("{:#}\n", json!({"pipeline": session.pipeline().name, "nodes": nodes})))
        }
    }
}

fn text(lines: &[Line]) -> String {
    let width = lines.iter().map(|l| l.id.chars().count()).max().unwrap_or(0);
    lines.iter().map(|l| format!("{:<width$}  {:<4}  {}\n", l.id, l.state, l.reason)).collect()
}

fn lines(plan: &Plan) -> Vec<Line> {
    let running = plan.nodes.iter().map(|node| Line {
        id: node.id.clone(),
        state: "runs",
        reason: reason(plan, node),
        node: node.decl.name.clone(),
        stage: node.stage.clone(),
    });
    let idle = plan.idle.iter().map(|node| {
        let (state, reason) = match &node.reason {
            Idle::Off(clause) => ("off", format!("its condition does not hold: {clause}")),
            Idle::Dead => ("dead", "nothing that is shown, kept or remembered needs what it writes".to_owned()),
        };
        Line { id: node.id.clone(), state, reason, node: node.kind.clone(), stage: node.stage.clone() }
    });
    running.chain(idle).collect()
}

/// Who needs what the node writes.
fn reason(plan: &Plan, node: &PlanNode) -> String {
    let mut parts = Vec::new();
    for (port, target) in &node.bindings {
        let (Target::Resource(index), Some(declared)) = (target, node.decl.ports.get(port)) else { continue };
        if declared.direction != Direction::Output {
            continue;
        }
        let uses = uses(plan, *index);
        if !uses.is_empty() {
            parts.push(format!("`{}` is {}", plan.resources[*index].name, uses.join(" and ")));
        }
    }
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
    let readers = |wanted: Target| -> Vec<String> {
        plan.nodes
            .iter()
            .filter(|n| {
                n.bindings
                    .iter()
                    .any(|(port, target)| *target == wanted && n.decl.ports.get(port).is_some_and(|p| p.direction == Direction::Input))
            })
            .map(|n| n.id.clone())
            .collect()
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
