//! Every function of `shaders/common`, called on the GPU with thousands of arguments and compared with a twin in 64 bits.

mod culling;
mod directions;
mod harness;
mod inputs;
mod light;
mod maps;
mod nodes;
mod paths;
mod precomputed;
mod random;
mod rays;
mod scene;
mod series;
mod surface;

use std::{collections::BTreeSet, fs};

use harness::{Case, modules};

use crate::support::root;

fn cases() -> Vec<Case> {
    [
        random::cases(),
        directions::cases(),
        light::cases(),
        series::cases(),
        maps::cases(),
        rays::cases(),
        paths::cases(),
        surface::cases(),
        precomputed::cases(),
        culling::cases(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// `module::function` of all functions in `shaders/common`.
pub fn functions() -> BTreeSet<String> {
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

/// A fault planted in a module: the function that it breaks, and the change of its text.
const FAULTS: &[(&str, &str, &str)] = &[
    ("octahedral::octahedral_encode", "(1.0 - abs(p.yx))", "(1.0 - abs(p.xy))"),
    ("octahedral::octahedral_encode", "max(abs(unit.x) + abs(unit.y) + abs(unit.z), 1e-37)", "(abs(unit.x) + abs(unit.y) + abs(unit.z))"),
    ("random::radical_inverse_3", "i < 15u", "i < 14u"),
    // Twelve units in the last place: four times the bound.
    ("radiometry::luminance", "0.7152", "0.715201023"),
    ("radiometry::disk_form_factor", "max(PI * d2 + area, 1e-30)", "(PI * d2 + area)"),
    ("radiometry::spot_falloff", "angle >= light.cutoff_rad", "angle > 1.01 * light.cutoff_rad"),
    ("paraboloid::above_horizon", "max(p.z, q.z) < 0.0", "max(p.z, q.z) <= 0.0"),
    ("warp::warp_quad", "p.x < share_x", "p.x <= share_x"),
    ("cssm::series", "2.0 / (c + 2.0 * PI)", "2.0 / (c + 2.001 * PI)"),
    ("rsm::view_towards", "size.x >= size.y && size.x >= size.z", "size.x >= size.y"),
    ("rsm::place_towards", "let least = 1e-3 * length(v);", "let least = 0.0;"),
    ("bvh::hit_triangle", "min(min(u, v), 1.0 - u - v)", "min(u, v)"),
    ("bvh::intersect", "l < MISSED || r < MISSED", "l < MISSED"),
    ("path::weighted_direct", "pdf_light(y, arrival), 1e-30", "2.0 * pdf_light(y, arrival), 1e-30"),
    ("metric::cluster_distance", "select(abs(cosine), cosine", "select(cosine, cosine"),
    ("baked::is_baked", "return (distance <= 0.0) == (baked >= NOWHERE);", "return false;"),
    ("baked::is_between", "inverse += weights.x * weights.y", "inverse += weights.x"),
    ("baked::tap", "any(texel < vec2i(0)) || ", ""),
    ("baked::seen_light", "i / 3 - 1", "i / 3"),
    ("bounds::form_factor_bounds", "- group.low + slack", "- group.high + slack"),
    ("bounds::form_factor_bounds", "cosine_beside_cone(cosine, sine, group.spread, false)", "cosine"),
    ("bounds::form_factor_bounds", "length(beyond) - slack", "length(beyond) + slack"),
    ("bounds::cosine_beside_cone", "cosine >= cos_half", "cosine > 1.0"),
    ("culling::full_word", "rest >= 32u", "rest > 32u"),
    ("view::pixel_solid_angle", "cosine * cosine * cosine", "cosine * cosine"),
];

#[test]
fn faults_in_functions_are_noticed() {
    let cases = cases();
    for (function, from, to) in FAULTS {
        let module = function.split("::").next().unwrap_or_default();
        let path = format!("shaders/common/{module}.wgsl");
        let outcomes = cases.iter().filter(|case| case.function == *function).map(|case| case.measure_with(Some((&path, from, to))));
        let noticed = outcomes.filter(|outcome| !outcome.is_good() && outcome.worst_call.contains("input")).count();
        assert!(noticed > 0, "{function} with `{to}` in place of `{from}` counts as good");
    }
}

#[test]
fn wrong_twins_are_noticed() {
    let functions =
        ["random::hash", "view::ray_direction", "cssm::series_value", "sky::sky_radiance", "path::coupling", "path::bounce_from_light"];
    for case in cases().into_iter().filter(|case| functions.contains(&case.function)).map(Case::with_wrong_twin) {
        assert!(!case.measure_with(None).is_good(), "{} is as a wrong twin", case.function);
    }
}
