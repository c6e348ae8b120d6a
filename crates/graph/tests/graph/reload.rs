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
