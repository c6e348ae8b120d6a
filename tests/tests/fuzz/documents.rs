//! Pipelines, stages, declarations of nodes and sweeps.

use std::{
    collections::BTreeSet,
    fs,
    path::Path,
    sync::{Arc, LazyLock},
    time::Duration,
};

use manylight::{
    SceneSource,
    graph::{
        check::check,
        diagnostics::Source,
        features,
        library::Library,
        pipeline::Pipeline,
        plan::{Lifetime, Plan, PlanInput, PlanStep, Target},
        planner,
        registry::{Direction, Registry},
        value::ResourceDesc,
    },
    lab::sweep::Sweep,
    load_registry,
};

use super::{
    check_faults,
    mutate::{fuzz, ron},
};
use crate::support::{Random, root};

/// Much longer than the slowest of tens of thousands of cases, on a machine that does other things as well.
const BOUND: Duration = Duration::from_secs(20);

/// Every document and shader of the repository by its path in the library.
static FILES: LazyLock<Vec<(String, &'static str)>> = LazyLock::new(|| {
    let mut files = Vec::new();
    for folder in ["pipelines", "shaders"] {
        read(&root().join(folder), folder, &mut files);
    }
    files.sort();
    files
});

static REGISTRY: LazyLock<Registry> = LazyLock::new(|| {
    let (registry, faults) = load_registry(&Library::new(None, FILES.clone()));
    assert!(faults.is_empty(), "{faults}");
    registry
});

fn read(folder: &Path, name: &str, files: &mut Vec<(String, &'static str)>) {
    for entry in fs::read_dir(folder).expect("a folder of the repository") {
        let entry = entry.expect("an entry");
        let inner = format!("{name}/{}", entry.file_name().to_string_lossy());
        if entry.path().is_dir() {
            read(&entry.path(), &inner, files);
        } else if let Ok(text) = fs::read_to_string(entry.path()) {
            files.push((inner, text.leak()));
        }
    }
}

fn text_of(path: impl AsRef<str>) -> &'static str {
    FILES.iter().find(|(name, _)| name == path.as_ref()).map_or("", |(_, text)| text)
}

/// Paths of the library that `of` wants.
fn paths(of: impl Fn(&str) -> bool) -> Vec<&'static str> {
    FILES.iter().map(|(name, _)| name.as_str()).filter(|name| of(name)).collect()
}

/// The files of the library in `names`, with another text for one of them.
fn library(names: &[&str], changed: &str, text: String) -> Library {
    let mut files: Vec<(String, &'static str)> =
        names.iter().filter(|name| **name != changed).map(|name| ((*name).to_owned(), text_of(name))).collect();
    files.push((changed.to_owned(), text.leak()));
    Library::new(None, files)
}

/// What a frame relies on: nothing is read before it is written, lives of shared memory do not meet, and sizes can be allocated.
fn check_plan(plan: &Plan) {
    let mut written = BTreeSet::new();
    for node in &plan.nodes {
        for ((_, target), (_, port)) in node.bindings.iter().zip(&node.decl.ports) {
            let Target::Resource(ix) = *target else { continue };
            let external = plan.resources[ix].lifetime == Lifetime::External;
            match port.direction {
                Direction::Input => assert!(external || written.contains(&ix), "{} reads too early", node.id),
                Direction::Output => assert!(!external && written.insert(ix), "{} writes again", node.id),
            }
        }
        for step in &node.steps {
            if let PlanStep::Draw { targets, .. } = step {
                assert!(targets.iter().flatten().all(|ix| written.contains(ix)));
            }
        }
    }
    let mut slots = vec![Vec::new(); plan.slots];
    for resource in &plan.resources {
        match resource.desc {
            ResourceDesc::Texture { width, height, layers, mips, .. } => {
                assert!((1..=16384).contains(&width) && (1..=16384).contains(&height) && layers >= 1 && mips >= 1, "{resource:?}");
            }
            ResourceDesc::Buffer { stride, count, .. } => assert!(u64::from(stride) * count <= 2 << 30, "{resource:?}"),
            ResourceDesc::Uniform { .. } => {}
        }
        if let Lifetime::Transient { first, last, slot } = resource.lifetime {
            assert!(slots[slot].iter().all(|(other_first, other_last)| last < *other_first || *other_last < first), "{}", resource.name);
            slots[slot].push((first, last));
        }
    }
}

/// A plan of a pipeline without faults for a scene that has everything or nothing.
fn input(has: bool) -> PlanInput {
    PlanInput { output: (96, 64), features: features::flags().map(|name| (name.to_owned(), has)).collect(), ..PlanInput::default() }
}

/// Reads, checks and plans a pipeline. Whether it has no faults.
fn use_pipeline(library: &Library, path: &str, registry: &Registry, thorough: bool) -> bool {
    let pipeline = match Pipeline::load(library, path) {
        Ok(pipeline) => pipeline,
        Err(faults) => {
            assert!(faults.has_errors());
            check_faults(&faults);
            return false;
        }
    };
    let mut good = true;
    for has in [true, false] {
        match planner::plan(&pipeline, registry, &input(has)) {
            Ok(plan) => check_plan(&plan),
            Err(faults) => {
                assert!(faults.has_errors());
                check_faults(&faults);
                good = false;
            }
        }
    }
    if thorough {
        let faults = check(&pipeline, registry);
        check_faults(&faults);
        // What the check passes can be planned; the plan may refuse more than the check tells of, as for the size of the picture.
        assert!(good || faults.has_errors() || !planner::refusals(&pipeline, registry, &input(true)).0.is_empty(), "{faults}");
    }
    good
}

#[test]
fn pipelines_are_planned_or_refused_with_a_reason() {
    let documents = paths(|name| name.starts_with("pipelines/") && !name.contains("/sweeps/"));
    let tops: Vec<(&str, Vec<String>)> = documents
        .iter()
        .filter(|name| !name.contains("/stages/"))
        .map(|name| {
            let pipeline = Pipeline::load(&library(&documents, name, text_of(name).to_owned()), name).unwrap_or_else(|e| panic!("{e}"));
            (*name, pipeline.sources.iter().map(|source| source.name.clone()).collect())
        })
        .collect();
    fuzz("pipelines", 3000, BOUND, move |random: &mut Random| {
        let (top, sources) = random.of(&tops);
        let changed = random.of(sources).clone();
        let text = ron(text_of(&changed), text_of(random.of(&documents)), random);
        use_pipeline(&library(&documents, &changed, text), top, &REGISTRY, random.below(16) == 0);
    });
}

#[test]
fn declarations_of_nodes_are_accepted_whole_or_refused_with_a_reason() {
    let nodes: Vec<&str> = paths(|name| name.starts_with("shaders/") && name.ends_with(".ron"));
    let common = paths(|name| name.starts_with("shaders/common/"));
    fuzz("nodes", 150, BOUND, move |random: &mut Random| {
        let changed = *random.of(&nodes);
        let shader = changed.replace(".ron", ".wgsl");
        let text = ron(text_of(changed), text_of(random.of(&nodes)), random);
        let names: Vec<&str> = common.iter().copied().chain([shader.as_str()]).collect();
        let (registry, faults) = load_registry(&library(&names, changed, text));
        check_faults(&faults);
        let name = changed.trim_start_matches("shaders/").trim_end_matches(".ron");
        assert_eq!(registry.nodes.contains_key(name), !faults.has_errors(), "{faults}");
    });
}

#[test]
fn sweeps_list_their_runs_or_are_refused_with_a_reason() {
    let sweeps = paths(|name| name.starts_with("pipelines/sweeps/"));
    let find = |name: &str| match name {
        "gone" => Err("there is no scene `gone`".to_owned()),
        _ => Ok(SceneSource::file(name)),
    };
    let all = Library::new(None, FILES.clone());
    fuzz("sweeps", 2000, BOUND, move |random: &mut Random| {
        let text = ron(text_of(random.of(&sweeps)), text_of(random.of(&sweeps)), random);
        let source = Arc::new(Source { name: "sweep.ron".to_owned(), path: None, text: Arc::from(text) });
        match Sweep::read(&source, random.below(2) == 0) {
            Err(faults) => {
                assert!(faults.has_errors());
                check_faults(&faults);
            }
            Ok(sweep) => {
                let faults = sweep.check(&all, &REGISTRY, &find);
                check_faults(&faults);
                if !faults.has_errors() {
                    let runs = sweep.runs();
                    assert!(!runs.is_empty() && runs.len() <= 100_000);
                }
            }
        }
    });
}
