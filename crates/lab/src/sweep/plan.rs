//! From a sweep to its runs.

use indexmap::IndexMap;

use super::document::{Sweep, Variant, Zip, setting};

/// One run of a sweep.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Run {
    /// What it is, in words: unique within the sweep, the same whenever the sweep is run.
    pub name: String,
    /// Index into [`Sweep::variants`].
    pub variant: usize,
    /// Index into [`Sweep::scenes`].
    pub scene: usize,
    /// Values of parameters.
    pub set: IndexMap<String, String>,
    /// Those that vary within the variant.
    pub varied: Vec<String>,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Seed.
    pub seed: u32,
}

impl Sweep {
    /// All runs in order: scene by scene, size by size, variant by variant, the last knob fastest, then the seeds.
    pub fn runs(&self) -> Vec<Run> {
        let mut runs = Vec::new();
        for scene in 0..self.scenes.len() {
            for &size in &self.sizes {
                for (index, variant) in self.variants.iter().enumerate() {
                    for knobs in combinations(self, variant) {
                        for &seed in &self.seeds {
                            runs.push(self.run(scene, size, index, &knobs, seed));
                        }
                    }
                }
            }
        }
        runs
    }

    fn run(&self, scene: usize, size: (u32, u32), variant: usize, knobs: &IndexMap<String, String>, seed: u32) -> Run {
        let own = &self.variants[variant];
        let mut set: IndexMap<String, String> = own.set.iter().map(|(name, value)| (name.clone(), setting(&value.value))).collect();
        set.extend(knobs.clone());
        let mut name = own.name.text.clone();
        for (knob, value) in knobs {
            name += &format!(" {knob}={value}");
        }
        name += &format!(" | {} | {}x{} | seed {seed}", self.scenes[scene].scene.text, size.0, size.1);
        Run { name, variant, scene, set, varied: knobs.keys().cloned().collect(), size, seed }
    }
}

/// Every combination of knobs, of the sweep and of the variant.
fn combinations(sweep: &Sweep, variant: &Variant) -> Vec<IndexMap<String, String>> {
    let mut all = vec![IndexMap::new()];
    // A knob of the variant takes the place of the sweep's knob of that name.
    let own = |name: &str| variant.vary.iter().any(|zip| zip.0.iter().any(|knob| knob.name == name));
    let shared = sweep.vary.iter().map(|zip| Zip(zip.0.iter().filter(|knob| !own(&knob.name)).cloned().collect()));
    for zip in shared.chain(variant.vary.iter().cloned()) {
        let steps = zip.0.first().map_or(0, |knob| knob.values.len());
        if steps == 0 {
            continue;
        }
        all = all
            .iter()
            .flat_map(|before: &IndexMap<String, String>| {
                (0..steps).map(|step| {
                    let mut knobs = before.clone();
                    knobs.extend(zip.0.iter().map(|knob| (knob.name.clone(), setting(&knob.values[step].value))));
                    knobs
                })
            })
            .collect();
    }
    all
}

/// Part `index` (from 1) of `count` of the runs: every `count`-th.
pub fn shard(runs: Vec<Run>, index: usize, count: usize) -> Vec<Run> {
    runs.into_iter().enumerate().filter(|(i, _)| i % count == index - 1).map(|(_, run)| run).collect()
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeSet, sync::Arc};

    use manylight_graph::diagnostics::Source;

    use super::*;

    fn read(text: &str) -> Sweep {
        let source = Arc::new(Source { name: "test.ron".to_owned(), path: None, text: Arc::from(text) });
        Sweep::read(&source, false).unwrap_or_else(|faults| panic!("{}", faults.render()))
    }

    fn names(sweep: &Sweep) -> Vec<String> {
        sweep.runs().into_iter().map(|run| run.name).collect()
    }

    #[test]
    fn maps_are_crossed_and_what_is_in_one_changes_together() {
        let sweep = read(
            r#"Sweep(doc: "?", variants: {"a": (pipeline: "p")}, scenes: ["s"], sizes: [(8, 4)],
                vary: [{"x": [1, 2], "y": ["u", "v"]}, {"z": [true, false]}])"#,
        );
        let knobs = ["x=1 y=u z=true", "x=1 y=u z=false", "x=2 y=v z=true", "x=2 y=v z=false"];
        assert_eq!(names(&sweep), knobs.map(|knobs| format!("a {knobs} | s | 8x4 | seed 0")));
    }

    #[test]
    fn a_variants_own_knob_replaces_that_of_the_sweep() {
        let sweep = read(
            r#"Sweep(doc: "?", variants: {"a": (pipeline: "p", vary: [{"x": [7]}]), "b": (pipeline: "p")}, scenes: ["s", "t"], seeds: [3],
                vary: [{"x": [1, 2]}])"#,
        );
        let of_scene = |s: &str| {
            [
                format!("a x=7 | {s} | 256x256 | seed 3"),
                format!("b x=1 | {s} | 256x256 | seed 3"),
                format!("b x=2 | {s} | 256x256 | seed 3"),
            ]
        };
        assert_eq!(names(&sweep), [of_scene("s"), of_scene("t")].concat());
    }

    #[test]
    fn every_run_is_in_one_part() {
        let sweep = read(r#"Sweep(doc: "?", variants: {"a": (pipeline: "p")}, scenes: ["s"], vary: [{"x": [1, 2, 3, 4, 5, 6, 7]}])"#);
        for parts in 1..=9 {
            let all: Vec<String> = (1..=parts).flat_map(|part| shard(sweep.runs(), part, parts)).map(|run| run.name).collect();
            assert_eq!(all.len(), 7);
            assert_eq!(all.into_iter().collect::<BTreeSet<_>>(), names(&sweep).into_iter().collect());
        }
    }

    #[test]
    fn the_small_size_takes_the_place_of_what_it_names() {
        let text = r#"Sweep(doc: "?", variants: {"a": (pipeline: "p", set: {"y": 9, "z": 1})}, scenes: ["s", "t"], frames: 9, vary: [{"x": [1, 2, 3]}],
            small: (scenes: ["u"], paths: 3, set: {"y": 2}))"#;
        let source = Arc::new(Source { name: "test.ron".to_owned(), path: None, text: Arc::from(text) });
        let small = Sweep::read(&source, true).expect("good");
        assert_eq!((small.scenes.len(), small.frames, small.reference.paths), (1, 9, 3));
        assert_eq!((small.runs().len(), read(text).runs().len()), (2, 6));
        let value = |sweep: &Sweep, name: &str| sweep.runs()[0].set[name].clone();
        assert_eq!((value(&small, "y"), value(&small, "z"), value(&read(text), "y")), ("2".to_owned(), "1".to_owned(), "9".to_owned()));
    }
}
