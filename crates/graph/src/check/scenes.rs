//! Scenes to check a pipeline with: with and without what a scene may have, and with what is measured on either side of every bound.

use std::collections::BTreeMap;

use crate::{
    assign::Values,
    condition::{Bound, ConditionKind},
    facts::Seen,
    features::{self, Measured},
    resolve::Linked,
};

/// What is known of a scene that is tried, and when a fault that it shows happens.
pub(super) struct Tried {
    features: BTreeMap<String, bool>,
    measured: BTreeMap<String, Measured>,
    pub when: String,
}

impl Tried {
    pub fn seen(&self) -> Seen<'_> {
        Seen { features: &self.features, measured: &self.measured }
    }
}

/// Numbers that what is measured is compared with, by feature, ascending.
fn bounds(linked: &Linked<'_>, values: &Values<'_>) -> BTreeMap<String, Vec<f64>> {
    let mut bounds: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for condition in linked.pipeline.every_condition() {
        condition.clauses(&mut |clause| {
            if let ConditionKind::Above(name, bound) = &clause.kind {
                let bound = match bound {
                    Bound::Number(bound) => Some(*bound),
                    Bound::Param(param) => values.get(&param.text).and_then(crate::value::Value::number),
                };
                bounds.entry(name.text.clone()).or_default().extend(bound);
            }
        });
    }
    for list in bounds.values_mut() {
        list.sort_by(f64::total_cmp);
        list.dedup();
    }
    bounds
}

fn flags(has: impl Fn(&str) -> bool) -> BTreeMap<String, bool> {
    features::flags().map(|name| (name.to_owned(), has(name))).collect()
}

/// With all flags and none, and nothing that is measured or nothing of it above a bound.
pub(super) fn extremes(linked: &Linked<'_>, values: &Values<'_>) -> Vec<Tried> {
    let mut all: Vec<Tried> =
        [true, false].map(|has| Tried { features: flags(|_| has), measured: BTreeMap::new(), when: String::new() }).into();
    let low = lowest(&bounds(linked, values));
    if !low.is_empty() {
        let when = "nothing measured of the scene is above a bound";
        all.extend([true, false].map(|has| Tried { features: flags(|_| has), measured: low.clone(), when: when.to_owned() }));
    }
    all
}

/// As [`extremes`], each flag alone, and everything that is measured on either side of each of its bounds, with all else above and below.
pub(super) fn scenes(linked: &Linked<'_>, values: &Values<'_>) -> Vec<Tried> {
    let tried = |features, measured, when: &str| Tried { features, measured, when: when.to_owned() };
    let unmeasured = BTreeMap::new;
    let mut all =
        vec![tried(flags(|_| true), unmeasured(), ""), tried(flags(|_| false), unmeasured(), "when the scene has no special features")];
    all.extend(features::flags().map(|only| tried(flags(|name| name == only), unmeasured(), &format!("when the scene has only `{only}`"))));
    let bounds = bounds(linked, values);
    let low = lowest(&bounds);
    for has in [true, false] {
        let plain = if has { "" } else { " and the scene has no special features" };
        if !low.is_empty() {
            all.push(tried(flags(|_| has), low.clone(), &format!("when nothing measured of the scene is above a bound{plain}")));
        }
        for (name, list) in &bounds {
            for bound in list {
                let at: BTreeMap<_, _> = [(name.clone(), exactly(*bound))].into();
                all.push(tried(flags(|_| has), at, &format!("when `{name}` is {bound}{plain}")));
            }
            for bound in list.iter().skip(1).map(Some).chain([None]) {
                let mut measured = low.clone();
                match bound {
                    Some(bound) => measured.insert(name.clone(), exactly(*bound)),
                    None => measured.remove(name),
                };
                all.push(tried(flags(|_| has), measured, &format!("when nothing measured but `{name}` is above a bound{plain}")));
            }
        }
    }
    all
}

/// Everything below all of its bounds.
fn lowest(bounds: &BTreeMap<String, Vec<f64>>) -> BTreeMap<String, Measured> {
    bounds.iter().filter_map(|(name, list)| Some((name.clone(), exactly(*list.first()?)))).collect()
}

/// What is exactly at a bound is not above it.
fn exactly(value: f64) -> Measured {
    Measured { value, standard_error: 0.0 }
}
