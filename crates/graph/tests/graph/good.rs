//! What is right is accepted, and comes to the plan it should.

use crate::kit::*;
use manylight_graph::plan::{Idle, Lifetime, PlanStep, Target, Workgroups};

#[test]
fn the_kit_has_no_faults() {
    assert_eq!(registry_faults(&files()), "");
    assert_eq!(check_faults(&files()), "");
}

#[test]
fn nodes_run_in_order_with_sizes() {
    let plan = try_plan(&files(), &input()).unwrap();
    let ids: Vec<_> = plan.nodes.iter().map(|n| n.id.as_str()).collect();
    assert_eq!(ids, ["paint", "pyramid", "soft", "show"]);
    let reasons: Vec<_> = plan.idle.iter().map(|n| (n.id.as_str(), n.reason.clone())).collect();
    assert_eq!(reasons, [("scene", Idle::Dead), ("hard", Idle::Off("`blur` is on".into()))]);
    let paint = &plan.nodes[0];
    assert_eq!(paint.steps[0], PlanStep::Compute { entry: "clear".into(), groups: Workgroups::Fixed([4, 1, 1]), mip: None });
    assert_eq!(paint.steps[1], PlanStep::Compute { entry: "paint".into(), groups: Workgroups::Fixed([80, 45, 1]), mip: None });
    let pyramid = &plan.nodes[1];
    // 320×180 has 9 levels: the base, 8 down, 8 up.
    assert_eq!(pyramid.steps.len(), 17);
    assert_eq!(
        pyramid.steps[1],
        PlanStep::Compute { entry: "down".into(), groups: Workgroups::Fixed([20, 12, 1]), mip: Some(("pyramid".into(), 1)) }
    );
    assert_eq!(
        pyramid.steps[16],
        PlanStep::Compute { entry: "up".into(), groups: Workgroups::Fixed([40, 23, 1]), mip: Some(("pyramid".into(), 0)) }
    );
    assert_eq!(plan.nodes[3].bindings[1], ("mask".into(), Target::Absent));
    let result = plan.resource("result").unwrap();
    assert_eq!(plan.presents, result);
    assert_eq!(plan.resources[result].lifetime, Lifetime::Kept);
}
