//! What holds for every plan, over random graphs.

use std::{collections::BTreeSet, fmt::Write as _, sync::LazyLock};

use manylight_graph::{
    library::Library,
    pipeline::Pipeline,
    plan::{Debug, Lifetime, Plan, PlanInput, Target},
    planner::plan,
    registry::{Direction, HostDecl, Registry},
};
use proptest::prelude::*;

const MOST_INPUTS: usize = 3;

/// Host nodes `t/n0` to `t/n3` with that many inputs and one output.
static REGISTRY: LazyLock<Registry> = LazyLock::new(|| {
    let hosts: Vec<HostDecl> = (0..=MOST_INPUTS)
        .map(|count| {
            let inputs: String = (0..count).map(|i| format!("\"in{i}\": Texture(format: R32Float, doc: \"x\"),")).collect();
            let ron = format!("Node(doc: \"x\", inputs: {{{inputs}}}, outputs: {{\"out\": Texture(format: R32Float, doc: \"x\")}})");
            HostDecl { name: format!("t/n{count}").leak(), ron: ron.leak() }
        })
        .collect();
    let (registry, faults) = Registry::load(&Library::default(), &hosts, Vec::new());
    assert!(faults.is_empty(), "{faults}");
    registry
});

/// A node of a random graph: it reads resources of earlier nodes, and any resource of the last frame.
#[derive(Debug, Clone)]
struct Made {
    inputs: Vec<(prop::sample::Index, bool)>,
    size: u8,
    place: u64,
}

fn made() -> impl Strategy<Value = Vec<Made>> {
    let input = (any::<prop::sample::Index>(), prop::bool::weighted(0.15));
    let node = (prop::collection::vec(input, 0..=MOST_INPUTS), 0u8..3, any::<u64>()).prop_map(|(inputs, size, place)| Made {
        inputs,
        size,
        place,
    });
    prop::collection::vec(node, 1..40)
}

/// Reads of node `index`: resource and whether it is the last frame's.
fn reads(nodes: &[Made], index: usize) -> Vec<(usize, bool)> {
    let of = |(at, previous): &(prop::sample::Index, bool)| {
        if *previous { Some((at.index(nodes.len()), true)) } else { (index > 0).then(|| (at.index(index.max(1)), false)) }
    };
    nodes[index].inputs.iter().filter_map(of).collect()
}

fn pipeline(nodes: &[Made], shown: usize) -> Pipeline {
    let mut order: Vec<usize> = (0..nodes.len()).collect();
    order.sort_by_key(|i| (nodes[*i].place, *i));
    let mut text = String::from("Pipeline(doc: \"x\", resources: {");
    for (i, node) in nodes.iter().enumerate() {
        let size = 16 << node.size;
        write!(text, "\"r{i}\": Texture(format: R32Float, size: Fixed({size}, {size}), history: true),").unwrap();
    }
    text.push_str("}, nodes: [");
    for i in order {
        let reads = reads(nodes, i);
        write!(text, "(id: \"n{i}\", node: \"t/n{}\", in: {{", reads.len()).unwrap();
        for (port, (resource, previous)) in reads.iter().enumerate() {
            if *previous {
                write!(text, "\"in{port}\": Previous(\"r{resource}\"),")
            } else {
                write!(text, "\"in{port}\": \"r{resource}\",")
            }
            .unwrap();
        }
        write!(text, "}}, out: {{\"out\": \"r{i}\"}}),").unwrap();
    }
    write!(text, "], presents: \"r{shown}\")").unwrap();
    let library = Library::new(None, vec![("pipelines/random.ron".into(), text.leak())]);
    Pipeline::load(&library, "random").unwrap()
}

fn planned(pipeline: &Pipeline, debug: Debug) -> Plan {
    plan(pipeline, &REGISTRY, &PlanInput { output: (8, 8), debug, ..PlanInput::default() }).unwrap()
}

/// Nodes that feed the picture, found by another way than the planner's.
fn needed(nodes: &[Made], shown: usize) -> BTreeSet<String> {
    let mut live = BTreeSet::from([shown]);
    loop {
        let more: BTreeSet<usize> = live.iter().flat_map(|i| reads(nodes, *i)).map(|(r, _)| r).chain(live.iter().copied()).collect();
        if more == live {
            return live.into_iter().map(|i| format!("n{i}")).collect();
        }
        live = more;
    }
}

fn running(plan: &Plan) -> BTreeSet<String> {
    plan.nodes.iter().map(|n| n.id.clone()).collect()
}

fn verify(plan: &Plan) {
    let mut written: BTreeSet<usize> = BTreeSet::new();
    let mut lives: Vec<Option<(usize, usize)>> = vec![None; plan.resources.len()];
    for (position, node) in plan.nodes.iter().enumerate() {
        for ((port, target), (name, declared)) in node.bindings.iter().zip(&node.decl.ports) {
            assert_eq!(port, name);
            let Target::Resource(ix) = *target else { continue };
            let life = lives[ix].get_or_insert((position, position));
            life.1 = position;
            match declared.direction {
                Direction::Input => assert!(written.contains(&ix), "{} reads before it is written", node.id),
                Direction::Output => assert!(written.insert(ix), "{} writes again", node.id),
            }
        }
    }
    let mut slots: Vec<Vec<(usize, usize, usize)>> = vec![Vec::new(); plan.slots];
    for (ix, resource) in plan.resources.iter().enumerate() {
        if let Lifetime::Transient { first, last, slot } = resource.lifetime {
            assert_eq!(lives[ix], Some((first, last)), "{}", resource.name);
            for (other_first, other_last, other) in &slots[slot] {
                assert_eq!(plan.resources[*other].desc, resource.desc);
                assert!(
                    last < *other_first || *other_last < first,
                    "{} and {} meet in slot {slot}",
                    resource.name,
                    plan.resources[*other].name
                );
            }
            slots[slot].push((first, last, ix));
        }
    }
    assert!(slots.iter().all(|s| !s.is_empty()), "an empty slot");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn plans_are_legal_and_minimal(nodes in made(), shown in any::<prop::sample::Index>(), seed in any::<u64>()) {
        let shown = shown.index(nodes.len());
        let pipeline = pipeline(&nodes, shown);
        let needed = needed(&nodes, shown);

        let plain = planned(&pipeline, Debug::default());
        verify(&plain);
        prop_assert_eq!(running(&plain), needed.clone());
        prop_assert_eq!(plain.idle.len() + plain.nodes.len(), nodes.len());

        let shuffled = planned(&pipeline, Debug { shuffle: Some(seed), ..Debug::default() });
        verify(&shuffled);
        prop_assert_eq!(running(&shuffled), needed);
        let again = planned(&pipeline, Debug { shuffle: Some(seed), ..Debug::default() });
        prop_assert_eq!(again.nodes.iter().map(|n| &n.id).collect::<Vec<_>>(), shuffled.nodes.iter().map(|n| &n.id).collect::<Vec<_>>());

        let all = planned(&pipeline, Debug { no_culling: true, ..Debug::default() });
        verify(&all);
        prop_assert_eq!(all.nodes.len(), nodes.len());

        let own = planned(&pipeline, Debug { no_reuse: true, ..Debug::default() });
        verify(&own);
        let transients = own.resources.iter().filter(|r| matches!(r.lifetime, Lifetime::Transient { .. })).count();
        prop_assert_eq!(own.slots, transients);
        prop_assert!(plain.slots <= own.slots);
    }
}
