//! Loading again takes over what did not change.

use std::sync::Arc;

use manylight_graph::registry::Registry;

use crate::kit::*;

fn same(a: &Registry, b: &Registry, node: &str) -> bool {
    let shader = |r: &Registry| Arc::clone(r.nodes[node].shader.as_ref().unwrap());
    Arc::ptr_eq(&shader(a), &shader(b))
}

#[test]
fn unchanged_shaders_are_taken_over() {
    let (first, _) = registry(&files(), &[]);
    let (second, faults) = first.reload(&library(&files()), &[], externals());
    assert!(faults.is_empty());
    assert!(first.nodes.keys().all(|node| same(&first, &second, node)));
}

#[test]
fn a_changed_shader_is_composed_again_and_its_declaration_alone_is_not() {
    let (first, _) = registry(&files(), &[]);
    let (second, _) = first.reload(&library(&with("shaders/post/blur.wgsl", "a + b", "a - b")), &[], externals());
    assert!(!same(&first, &second, "post/blur") && same(&first, &second, "draw/paint"));
    let (third, faults) = first.reload(&library(&with("shaders/post/blur.ron", "Blurs.", "Blurs more.")), &[], externals());
    assert!(faults.is_empty());
    assert!(same(&first, &third, "post/blur"));
    assert_eq!(third.nodes["post/blur"].doc, "Blurs more.");
}

#[test]
fn a_changed_import_reaches_all_who_import_it() {
    let (first, _) = registry(&files(), &[]);
    let (second, _) = first.reload(&library(&with("shaders/common/cell.wgsl", "0.5", "0.25")), &[], externals());
    assert!(!same(&first, &second, "draw/paint") && !same(&first, &second, "post/pyramid"));
    assert!(same(&first, &second, "post/blur"));
    let (broken, faults) = second.reload(&library(&with("shaders/common/cell.wgsl", "0.5", "0.5 +")), &[], externals());
    assert_faults(&faults.render(), 1, &["shaders/common/cell.wgsl:7"]);
    assert!(broken.faulty.contains("draw/paint") && !broken.nodes.contains_key("draw/paint"));
    let (healed, faults) = broken.reload(&library(&files()), &[], externals());
    assert!(faults.is_empty() && healed.nodes.contains_key("draw/paint"));
}

#[test]
fn a_faulty_declaration_keeps_its_shader_for_later() {
    let (first, _) = registry(&files(), &[]);
    let (second, faults) = first.reload(&library(&with("shaders/post/blur.ron", "steps", "stepps")), &[], externals());
    assert!(faults.has_errors() && second.faulty.contains("post/blur"));
    let (third, _) = second.reload(&library(&files()), &[], externals());
    assert!(same(&first, &third, "post/blur"));
}

/// Numbers of bindings are part of a module, and a module is known by the hash of its texts.
#[test]
fn a_shader_that_is_mended_has_the_bindings_that_it_had() {
    let common = "@group(1) @binding(auto) var<storage, read> lights: array<vec4f>;\nfn first() -> f32 {\n    return lights[0].x;\n}\n";
    let imports = |text: &str| format!("#import common::lights::first\n{}", text.replace("a + b", "a * first() + b"));
    let (_, text) = files().into_iter().find(|(name, _)| name == "shaders/post/blur.wgsl").unwrap();
    let lit = add(files(), "shaders/common/lights.wgsl", common);
    // Another module with a global, which is composed before in some orders.
    let lit = add(
        lit,
        "shaders/common/aaa.wgsl",
        "@group(1) @binding(auto) var<storage, read> more: array<vec4f>;\nfn more_of() -> f32 {\n    return more[0].x;\n}\n",
    );
    let lit = add(lit, "shaders/post/blur.wgsl", &imports(&text));
    let ron = files().into_iter().find(|(name, _)| name == "shaders/post/blur.ron").unwrap().1;
    let lit = add(lit, "shaders/post/blur.ron", &ron.replace("inputs: {", "inputs: { \"lights\": Buffer(of: \"vec4f\", doc: \"lights\"),"));
    let load = |old: &Registry, files: &Files| {
        let (registry, faults) = old.reload(&library(files), &[], externals());
        assert!(faults.is_empty(), "{faults}");
        registry
    };
    let bindings = |registry: &Registry| {
        let shader = registry.nodes["post/blur"].shader.as_ref().unwrap();
        (shader.hash, shader.globals.iter().map(|g| (g.name.clone(), g.group, g.binding)).collect::<Vec<_>>())
    };
    let first = load(&Registry::default(), &lit);
    let edited = load(&first, &add(lit.clone(), "shaders/post/blur.wgsl", &imports(&text).replace("+ b", "- b")));
    let mended = load(&edited, &lit);
    assert_ne!(bindings(&first).0, bindings(&edited).0);
    assert_eq!(bindings(&first), bindings(&mended));
}
