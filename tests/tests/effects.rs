//! Effects that a scene does not call for are left out: each decision turns where it should, and what is left out is hardly missed.

use std::{collections::BTreeMap, fs, path::Path};

use manylight_graph::{
    features::{MEASURED, Measured},
    plan::{Plan, PlanInput},
    value::Value,
};
use manylight_passes::{Documents, SceneSource, Settings, plan_input};

use crate::{matrix::documents_of_all_pipelines, support::root};

/// A switch with what it asks of a scene, and a look at a plan.
struct Effect {
    switch: &'static str,
    feature: &'static str,
    threshold: &'static str,
    /// Values without which it does not show.
    set: &'static [(&'static str, &'static str)],
    is_on: fn(&Plan) -> bool,
}

fn has_node(plan: &Plan, id: &str) -> bool {
    plan.nodes.iter().any(|node| node.id == id)
}

/// A parameter of a node.
fn param<'a>(plan: &'a Plan, id: &str, name: &str) -> &'a Value {
    let node = plan.nodes.iter().find(|node| node.id == id).unwrap_or_else(|| panic!("`{id}` does not run"));
    node.params.iter().find(|(known, _)| known == name).map(|(_, value)| value).expect("a parameter of the node")
}

const EFFECTS: &[Effect] = &[
    Effect {
        switch: "indirect_shadows",
        feature: "indirect_occlusion",
        threshold: "indirect_shadow_threshold",
        set: &[("visibility", "pcss"), ("negative_lights", "0")],
        is_on: |plan| has_node(plan, "casters"),
    },
    Effect {
        switch: "direct_shadows",
        feature: "direct_occlusion",
        threshold: "direct_shadow_threshold",
        set: &[],
        is_on: |plan| *param(plan, "direct", "direct_shadows") == Value::Bool(true),
    },
    Effect {
        switch: "specular",
        feature: "specular_energy",
        threshold: "specular_threshold",
        set: &[],
        is_on: |plan| {
            let is_on = *param(plan, "direct", "specular") == Value::Bool(true);
            assert_eq!(plan.resource("gbuffer_specular").is_some(), is_on, "what nobody reads is made, or what is read is not");
            is_on
        },
    },
    Effect {
        switch: "view_importance",
        feature: "unseen_light",
        threshold: "view_importance_threshold",
        set: &[("sampling", "clusters")],
        is_on: |plan| *param(plan, "importance", "view_importance") == Value::Bool(true),
    },
    Effect {
        switch: "second_bounce",
        feature: "second_bounce",
        threshold: "second_bounce_threshold",
        set: &[],
        is_on: |plan| has_node(plan, "second_bounce"),
    },
];

/// All that is measured, at its greatest.
fn everything() -> BTreeMap<String, Measured> {
    MEASURED.iter().map(|feature| (feature.name.to_owned(), Measured { value: 1.0, standard_error: 0.0 })).collect()
}

/// A scene that has all features, as a plan sees it.
fn input(effect: &Effect, switch: &str, measured: Measured) -> PlanInput {
    let set = effect.set.iter().copied().chain([(effect.switch, switch)]);
    let features = manylight_graph::features::flags().map(|flag| (flag.to_owned(), !flag.starts_with("baked_")));
    let mut all = everything();
    all.insert(effect.feature.to_owned(), measured);
    PlanInput {
        output: (64, 64),
        set: set.map(|(name, value)| (name.to_owned(), value.to_owned())).collect(),
        features: features.collect(),
        measured: all,
        ..PlanInput::default()
    }
}

/// In every pipeline that has the switch: on above the threshold, off below, on where the error leaves it open; by hand whatever is measured.
#[test]
fn each_switch_turns_at_its_threshold_in_every_pipeline() {
    let mut tried = BTreeMap::<&str, u32>::new();
    for (path, documents) in documents_of_all_pipelines() {
        let params = &documents.pipeline().params;
        for effect in EFFECTS.iter().filter(|effect| params.contains_key(effect.switch)) {
            let is_on = |switch: &str, value: f64, standard_error: f64| {
                let planned = documents.plan(&input(effect, switch, Measured { value, standard_error }));
                (effect.is_on)(&planned.unwrap_or_else(|faults| panic!("{path}, {}: {}", effect.switch, faults.render())))
            };
            let Value::Float(bound) = params[effect.threshold].kind.default_value() else { panic!("{} is no number", effect.threshold) };
            let what = format!("{path}, `{}`", effect.switch);
            assert!(!is_on("auto", bound * 0.999, 0.0), "{what}: on below its threshold");
            assert!(is_on("auto", bound * 1.001, 0.0), "{what}: off above its threshold");
            assert!(!is_on("auto", bound * 0.9, bound * 0.049), "{what}: on where the error does not reach the threshold");
            assert!(is_on("auto", bound * 0.9, bound * 0.051), "{what}: off where the feature may be above the threshold");
            assert!(is_on("on", 0.0, 0.0) && !is_on("off", 1.0, 0.0), "{what}: the switch does not switch");
            *tried.entry(effect.switch).or_default() += 1;
        }
    }
    assert!(EFFECTS.iter().all(|effect| tried.get(effect.switch).is_some_and(|count| *count >= 8)), "{tried:?}");
}

/// The Cornell box with a block, of which one property follows a number.
struct Family {
    switch: &'static str,
    /// The ends of the number, on either side of the threshold.
    ends: [f64; 2],
    /// Size of the block, reflectance of its lobe, albedo of the walls, field of view in degrees.
    of: fn(f64) -> [f64; 4],
}

const FAMILIES: &[Family] = &[
    Family { switch: "indirect_shadows", ends: [0.01, 1.2], of: |x| [x, 0.0, 0.6, 39.0] },
    Family { switch: "direct_shadows", ends: [0.001, 1.2], of: |x| [x, 0.0, 0.6, 39.0] },
    Family { switch: "specular", ends: [0.0001, 0.4], of: |x| [1.0, x, 0.6, 39.0] },
    Family { switch: "view_importance", ends: [60.0, 1.0], of: |x| [0.3, 0.0, 0.6, x] },
    Family { switch: "second_bounce", ends: [0.001, 0.8], of: |x| [0.3, 0.0, x, 39.0] },
];

/// Writes a scene of a family. The block stands in the beam, between the light and the wall.
fn write(folder: &Path, [block, lobe, albedo, view]: [f64; 4]) -> SceneSource {
    let assets = root().join("assets").to_string_lossy().replace('\\', "/");
    let wall = |name: &str| format!("\"{name}\": (diffuse: ({albedo}, {albedo}, {albedo}), specular: {lobe}, shininess: 20.0)");
    let text = format!(
        "Scene(
            meshes: [
                \"{assets}/cornell_empty.obj\",
                Mesh(file: \"{assets}/cube.obj\", name: \"block\", transform: (translate: (3.7, 4.0, 3.25), scale: {block})),
            ],
            camera: (origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: {view}),
            lights: [Spot(position: (2.0, 3.9, 1.2), target: (5.4, 4.9, 5.3), intensity: 200.0, beam_deg: 15.0, cutoff_deg: 20.0)],
            materials: {{{}}},
        )",
        ["white", "green", "red", "block"].map(wall).join(", ")
    );
    let file = folder.join("scene.ron");
    fs::write(&file, text).expect("writable");
    SceneSource::file(file)
}

/// Real scenes, brought as near to each threshold from both sides as 2 % of what makes them different.
#[test]
fn scenes_just_above_and_just_below_a_threshold_are_told_apart() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = root().join("pipelines/acrsm.ron");
    let documents = documents_of_all_pipelines().into_iter().find(|(name, _)| name.ends_with("/acrsm.ron")).map(|(_, d)| d);
    let documents: Documents = documents.unwrap_or_else(|| panic!("{} is gone", path.display()));
    for family in FAMILIES {
        let effect = EFFECTS.iter().find(|effect| effect.switch == family.switch).expect("an effect");
        let Value::Float(bound) = documents.pipeline().params[effect.threshold].kind.default_value() else { panic!("no number") };
        let set = vec![(family.switch.to_owned(), "auto".to_owned())];
        let settings = Settings { size: (64, 64), set, ..Settings::default() };
        let look = |number: f64| {
            let scene = write(folder.path(), (family.of)(number)).load().unwrap_or_else(|faults| panic!("{}", faults.render()));
            let input = plan_input(documents.pipeline(), &settings, &scene);
            let plan = documents.plan(&input).unwrap_or_else(|faults| panic!("{}", faults.render()));
            (input.measured[effect.feature], (effect.is_on)(&plan))
        };
        let [mut below, mut above] = family.ends;
        let ends = [look(below), look(above)];
        assert_eq!(ends.map(|(_, on)| on), [false, true], "{}: {ends:?}, {bound}", family.switch);
        while (above / below).max(below / above) > 1.02 {
            let middle = (below * above).sqrt();
            *(if look(middle).1 { &mut above } else { &mut below }) = middle;
        }
        let [(low, _), (high, _)] = [look(below), look(above)];
        println!("{}: off at {low} ({below:.4}), on at {high} ({above:.4}); threshold {bound}", family.switch);
        let at_most = |measured: Measured| measured.value + 2.0 * measured.standard_error;
        assert!(at_most(low) <= bound && bound < at_most(high), "{}: {low:?} {high:?}", family.switch);
        assert!(at_most(high) < 1.3 * bound && at_most(low) > 0.7 * bound, "{}: {low:?}, {high:?} are not near {bound}", family.switch);
    }
}

/// What moves and what deforms decides about merging and splitting, and about points.
#[test]
fn motion_decides_about_evaluation_and_points() {
    let documents = documents_of_all_pipelines().into_iter().find(|(name, _)| name.ends_with("/acrsm.ron")).expect("the pipeline").1;
    let plan = |moves: &[&str]| {
        let features = manylight_graph::features::flags().map(|flag| (flag.to_owned(), moves.contains(&flag)));
        let set = vec![("adaptive".to_owned(), "auto".to_owned())];
        let input = PlanInput { output: (64, 64), features: features.collect(), measured: everything(), set, ..PlanInput::default() };
        documents.plan(&input).unwrap_or_else(|faults| panic!("{}", faults.render()))
    };
    let adapts = |moves: &[&str]| *param(&plan(moves), "evaluate", "adaptive") == Value::Bool(true);
    assert!(!adapts(&[]) && !adapts(&["moving_camera"]), "nothing that lights depend on moves");
    assert!(["moving_lights", "moving_objects", "deforming_objects"].iter().all(|what| adapts(&[what])));
    let dynamic = |moves: &[&str]| [has_node(&plan(moves), "points_dynamic"), has_node(&plan(moves), "points_static")];
    assert_eq!(dynamic(&["moving_objects", "moving_lights"]), [false, true]);
    assert_eq!(dynamic(&["deforming_objects"]), [true, false]);
}
