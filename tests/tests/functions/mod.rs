//! Every function of `shaders/common`, called on the GPU with thousands of arguments and compared with a twin in 64 bits.

mod directions;
mod harness;
mod inputs;
mod light;
mod maps;
mod random;
mod rays;
mod series;
mod surface;

use std::{collections::BTreeSet, fs};

use harness::{Case, modules};

use crate::support::root;

fn cases() -> Vec<Case> {
    [random::cases(), directions::cases(), light::cases(), series::cases(), maps::cases(), rays::cases(), surface::cases()]
        .into_iter()
        .flatten()
        .collect()
}

/// `module::function` of all functions in `shaders/common`.
fn functions() -> BTreeSet<String> {
    let mut all = BTreeSet::new();
    for path in modules() {
        let text = fs::read_to_string(root().join(&path)).unwrap_or_else(|e| panic!("{path}: {e}"));
        let module = path.trim_start_matches("shaders/common/").trim_end_matches(".wgsl");
        for line in text.lines() {
            if let Some((name, _)) = line.trim_start().strip_prefix("fn ").and_then(|rest| rest.split_once('(')) {
                all.insert(format!("{module}::{}", name.trim()));
            }
        }
    }
    all
}

#[test]
fn every_function_has_a_twin() {
    let functions = functions();
    assert!(functions.len() > 100 && functions.contains("random::hash"), "the functions of shaders/common were not found: {functions:?}");
    let cases = cases();
    let known: BTreeSet<String> = cases.iter().map(|case| case.function).chain([surface::DRAWN]).map(str::to_owned).collect();
    let without: Vec<&String> = functions.difference(&known).collect();
    assert!(without.is_empty(), "these functions have no twin in tests/tests/functions:\n{without:#?}");
    let gone: Vec<&String> = known.difference(&functions).collect();
    assert!(gone.is_empty(), "these twins have no function in shaders/common:\n{gone:#?}");
}
