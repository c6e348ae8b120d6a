//! Every pipeline under every combination of its options: each is planned, or refused with a reason; and of what is planned so many are
//! rendered that every two options meet, and every number that a node writes is looked at. Nothing here names a pipeline or an option.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    time::Instant,
};

use manylight_graph::{
    condition::{Condition, ConditionKind},
    library::Library,
    pipeline::{ArgumentValue, Pipeline},
    plan::{Debug, Plan},
    registry::Direction,
    value::ParamKind,
};
use manylight_passes::{Documents, Renderer, SceneSource, Settings, load_registry, plan_input};
use manylight_scene::Scene;

use crate::{
    records,
    renders::{Job, gpu, lights_to_show},
    support::{Random, project_with, root},
};

const SIZE: (u32, u32) = (24, 16);
const FRAMES: u32 = 2;
/// Seconds from frame to frame: what moves has moved.
const STEP: f64 = 0.5;
/// Whole numbers above this are set to it, or to the least that they may be.
const SMALL: i64 = 32;
/// The same of counts, which are room for what a scene asks for: with less, a node may say that it needs more.
const SMALL_COUNT: i64 = 16_384;
/// Of larger products, so many combinations are planned, chosen evenly.
const MOST_PLANNED: usize = 20_000;
/// So many where another pipeline of the same stages has all of them: only the numbers differ.
const MOST_AGAIN: usize = 1_000;
/// Combinations that are looked at to find the next one to render.
const CANDIDATES: usize = 40;
/// Faults that are told of one pipeline.
const MOST_TOLD: usize = 6;

/// A parameter and the values that it takes.
#[derive(Debug, Clone)]
pub struct Factor {
    pub name: String,
    pub values: Vec<String>,
}

/// An index of a value by factor.
type Row = Vec<usize>;

/// A pipeline with the scenes that it is tried on.
pub struct Subject<'a> {
    pub documents: &'a Documents,
    scenes: &'a [(SceneSource, Scene)],
    /// Choices and switches that change what is computed.
    pub options: Vec<Factor>,
    /// Those that only choose what is shown.
    views: Vec<Factor>,
    /// Numbers, small ones first.
    numbers: Vec<Factor>,
}

impl<'a> Subject<'a> {
    pub fn new(documents: &'a Documents, scenes: &'a [(SceneSource, Scene)]) -> Self {
        let pipeline = documents.pipeline();
        let preset = |name: &str| pipeline.set.get(name).map(|preset| preset.value.to_string());
        let (mut options, mut views, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
        for (name, param) in &pipeline.params {
            let factor = |values: Vec<String>| Factor { name: name.clone(), values };
            match &param.kind {
                ParamKind::Choice { options: all, .. } if only_shows(documents, name) => views.push(factor(all.clone())),
                ParamKind::Choice { options: all, .. } => options.push(factor(all.clone())),
                ParamKind::Bool { .. } if only_shows(documents, name) => views.push(factor(switch())),
                ParamKind::Bool { .. } => options.push(factor(switch())),
                ParamKind::Int { min, default, .. } => {
                    let usual = preset(name).and_then(|value| value.parse().ok()).unwrap_or(*default);
                    let is_count = name.ends_with("_count");
                    let small = usual.min(if is_count { SMALL_COUNT } else { SMALL }).max(*min);
                    let mut values = vec![small.to_string()];
                    // A greatest factor of tessellation below the least is a fault of its own, whatever the rest is.
                    values.extend((!is_count && small > *min && name != "f_max").then(|| min.to_string()));
                    numbers.push(factor(values));
                }
                ParamKind::Float { .. } => {}
            }
        }
        Self { documents, scenes, options, views, numbers }
    }

    /// Numbers as they are first listed.
    pub fn small(&self) -> Vec<(String, String)> {
        self.numbers.iter().map(|factor| (factor.name.clone(), factor.values[0].clone())).collect()
    }

    fn settings(&self, factors: &[Factor], row: &[usize]) -> Settings {
        let mut set = self.small();
        set.retain(|(name, _)| factors.iter().all(|factor| factor.name != *name));
        set.extend(factors.iter().zip(row).map(|(factor, &value)| (factor.name.clone(), factor.values[value].clone())));
        Settings { size: SIZE, set, ..Settings::default() }
    }

    /// The plan; nothing where it is refused with a reason; else the faults.
    pub fn plan(&self, settings: &Settings, scene: &Scene) -> Result<Option<Plan>, String> {
        let input = plan_input(self.documents.pipeline(), settings, scene);
        let faults = match self.documents.plan(&input) {
            Ok(plan) => return Ok(Some(plan)),
            Err(faults) => faults,
        };
        let refusals = self.documents.refusals(&input);
        let reasons = self.documents.pipeline().refuse.iter().all(|refusal| !refusal.because.trim().is_empty());
        if refusals == faults && reasons { Ok(None) } else { Err(format!("{}: {}", words(settings), faults.render())) }
    }

    /// Plans the product of all options on all scenes, or `most` of it; returns the rows that all scenes accept, and how many were refused.
    fn plan_all(&self, most: usize, chance: &mut Random, faults: &mut Vec<String>) -> (Vec<Row>, usize) {
        let product = self.options.iter().try_fold(1_usize, |n, factor| n.checked_mul(factor.values.len()));
        let row = |mut index: usize| -> Row {
            let digit = |factor: &Factor| {
                let value = index % factor.values.len();
                index /= factor.values.len();
                value
            };
            self.options.iter().map(digit).collect()
        };
        let rows: Vec<Row> = match product {
            Some(all) if all <= most => (0..all).map(row).collect(),
            _ => (0..most).map(|_| self.options.iter().map(|factor| chance.below(factor.values.len())).collect()).collect(),
        };
        // Every view of what the pipeline does by itself.
        for view in &self.views {
            for value in 0..view.values.len() {
                let settings = self.settings(std::slice::from_ref(view), &[value]);
                faults.extend(self.scenes.iter().filter_map(|(_, scene)| self.plan(&settings, scene).err()));
            }
        }
        let threads = std::thread::available_parallelism().map_or(1, usize::from);
        let parts: Vec<(Vec<Row>, Vec<Row>, Vec<String>)> = std::thread::scope(|scope| {
            let parts = rows.chunks(rows.len().div_ceil(threads).max(1)).map(|part| scope.spawn(|| self.plan_rows(part)));
            parts.collect::<Vec<_>>().into_iter().map(|part| part.join().expect("no panic")).collect()
        });
        let (mut accepted, mut refused) = (Vec::new(), 0);
        for (good, senseless, told) in parts {
            accepted.extend(good);
            refused += senseless.len();
            faults.extend(told);
        }
        (accepted, refused)
    }

    /// The rows that all scenes accept, those that some scene refuses, and a fault for each that is neither, until there are enough.
    fn plan_rows(&self, rows: &[Row]) -> (Vec<Row>, Vec<Row>, Vec<String>) {
        let (mut accepted, mut refused, mut faults) = (Vec::new(), Vec::new(), Vec::new());
        // Where no condition asks for the scene, all scenes have the same nodes.
        let pipeline = self.documents.pipeline();
        let asks = pipeline
            .every_condition()
            .any(|when| some_clause(pipeline, when, |clause| matches!(clause.kind, ConditionKind::Feature(_) | ConditionKind::Above(..))));
        let scenes = if asks { self.scenes } else { &self.scenes[..1] };
        for row in rows {
            let settings = self.settings(&self.options, row);
            let plans: Result<Vec<_>, String> = scenes.iter().map(|(_, scene)| self.plan(&settings, scene)).collect();
            match plans {
                Ok(plans) if plans.iter().all(Option::is_some) => accepted.push(row.clone()),
                Ok(_) => refused.push(row.clone()),
                Err(told) => faults.push(told),
            }
            if faults.len() >= MOST_TOLD {
                break;
            }
        }
        (accepted, refused, faults)
    }

    /// Rows over options and numbers in which every two values meet that meet in an accepted row. The first one is the pipeline as it is.
    fn pairs(&self, accepted: &[Row], chance: &mut Random) -> Vec<Row> {
        let factors = self.factors();
        let options = self.options.len();
        let pairs_of = |row: &Row| -> BTreeSet<[(usize, usize); 2]> {
            let each = |i: usize| (i + 1..row.len()).map(move |j| (i, j));
            (0..row.len()).flat_map(each).map(|(i, j)| [(i, row[i]), (j, row[j])]).collect()
        };
        let mut open: BTreeSet<[(usize, usize); 2]> = BTreeSet::new();
        // Which options meet, the accepted rows say; numbers meet everything.
        for row in accepted {
            open.extend(pairs_of(row));
        }
        for (i, factor) in factors.iter().enumerate().skip(options) {
            for value in 0..factor.values.len() {
                let others = factors.iter().enumerate().take(i).flat_map(|(j, other)| (0..other.values.len()).map(move |w| (j, w)));
                let met = |&(j, w): &(usize, usize)| j >= options || accepted.iter().any(|row| row[j] == w);
                open.extend(others.filter(met).map(|other| [other, (i, value)]));
            }
        }
        let mut rows: Vec<Row> = Vec::new();
        while let Some(&wanted) = open.first() {
            let fits = |row: &&Row| wanted.iter().all(|&(i, value)| i >= options || row[i] == value);
            let fitting: Vec<&Row> = accepted.iter().filter(fits).collect();
            let candidate = |chance: &mut Random| -> Row {
                let mut row = fitting[chance.below(fitting.len())].clone();
                row.extend(factors[options..].iter().map(|factor| chance.below(factor.values.len())));
                wanted.iter().for_each(|&(i, value)| row[i] = value);
                row
            };
            let found: Vec<Row> = (0..CANDIDATES).map(|_| candidate(chance)).collect();
            let gain = |row: &Row| pairs_of(row).intersection(&open).count();
            let best = found.into_iter().max_by_key(gain).expect("candidates");
            for pair in pairs_of(&best) {
                open.remove(&pair);
            }
            rows.push(best);
        }
        rows
    }

    fn factors(&self) -> Vec<Factor> {
        self.options.iter().chain(&self.numbers).cloned().collect()
    }

    /// Renders a row on a scene and looks at everything; `None` where the numbers are refused.
    fn render(&self, row: &Row, (source, scene): &(SceneSource, Scene)) -> Result<Option<()>, String> {
        let mut settings = self.settings(&self.factors(), row);
        if self.plan(&settings, scene)?.is_none() {
            return Ok(None);
        }
        settings.debug.watch_numbers = true;
        for light in lights_to_show(self.documents, scene, SIZE) {
            let settings = Settings { baked: light, ..settings.clone() };
            let told = |what: String| format!("on {}, {}: {what}", scene.name, words(&settings));
            let mut renderer = Renderer::with(gpu(), self.documents.clone(), source.clone(), scene.clone(), settings.clone())
                .map_err(|e| told(e.to_string()))?;
            for frame in 0..FRAMES {
                renderer.render_frame(f64::from(frame) * STEP).map_err(|e| told(e.to_string()))?;
            }
        }
        Ok(Some(()))
    }
}

fn switch() -> Vec<String> {
    ["false", "true"].map(str::to_owned).to_vec()
}

pub fn words(settings: &Settings) -> String {
    let lookup = settings.baked.iter().map(|light| format!("with the look-up {:?}", light.header.lookup));
    settings.set.iter().map(|(name, value)| format!("--set {name}={value}")).chain(lookup).collect::<Vec<_>>().join(" ")
}

/// Whether a parameter does nothing but turn on and off nodes that write what is presented.
fn only_shows(documents: &Documents, name: &str) -> bool {
    let pipeline = documents.pipeline();
    let mut tested = false;
    for node in pipeline.nodes.values() {
        let Some(decl) = documents.registry().nodes.get(&node.node.text) else { return false };
        let given = |argument: &ArgumentValue| {
            argument.params().contains(&name) || argument.conditions().into_iter().any(|when| tests(pipeline, when, name))
        };
        if decl.params.contains_key(name) || node.params.values().any(|argument| given(&argument.value)) {
            return false;
        }
        if node.when.as_ref().is_some_and(|when| tests(pipeline, when, name)) {
            tested = true;
            let outputs = decl.ports.iter().filter(|(_, port)| port.direction == Direction::Output);
            let resource = |port: &str| node.outputs.get(port).map_or(port.to_owned(), |connection| connection.resource.text.clone());
            if outputs.into_iter().any(|(port, _)| resource(port) != pipeline.presents.text) {
                return false;
            }
        }
    }
    tested
}

/// Whether a condition tests a parameter.
fn tests(pipeline: &Pipeline, condition: &Condition, name: &str) -> bool {
    some_clause(pipeline, condition, |clause| clause.params().any(|param| param.text == name))
}

fn some_clause(pipeline: &Pipeline, condition: &Condition, is: impl Fn(&Condition) -> bool) -> bool {
    let mut found = false;
    pipeline.clauses(condition, &mut |clause| found |= is(clause));
    found
}

/// The Cornell box, and a room without a spot light: a point light, a sun, and a block that turns.
fn scenes(folder: &Path) -> Vec<(SceneSource, Scene)> {
    let asset = |name: &str| root().join("assets").join(name).to_string_lossy().replace('\\', "/");
    let text = format!(
        r#"Scene(
    meshes: [
        "{}",
        Mesh(file: "{}", name: "block", transform: (translate: (1.9, 0.01, 3.4), scale: (1.4, 2.8, 1.4)),
             motion: [(time: 0.0, rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 0.0)), (time: 2.0, rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 90.0))]),
    ],
    camera: (origin: (2.78, 2.73, -8.0), target: (2.78, 2.73, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 39.3),
    lights: [Point(position: (2.78, 4.5, 2.8), intensity: (2.0, 3.0, 4.0)), Directional(direction: (0.3, -0.5, 1.0), irradiance: (3.0, 2.0, 1.0))],
)"#,
        asset("cornell_empty.obj"),
        asset("cube.obj"),
    );
    let own = folder.join("point_and_sun.ron");
    fs::write(&own, text).expect("writable");
    let load = |path: PathBuf| {
        let source = SceneSource::file(path);
        let scene = source.load().unwrap_or_else(|faults| panic!("{}", faults.render()));
        (source, scene)
    };
    vec![load(root().join("assets/cornell.ron")), load(own)]
}

/// The files that a pipeline is made of, where it adds nothing but values to them: then what they allow does not depend on the pipeline.
fn stages(documents: &Documents) -> Option<Vec<String>> {
    let pipeline = documents.pipeline();
    let (own, stages) = pipeline.sources.split_first()?;
    let params = pipeline.params.values().map(|param| &param.span);
    let resources = pipeline.resources.values().map(|resource| &resource.span);
    let nodes = pipeline.nodes.values().map(|node| &node.id.span);
    let refuse = pipeline.refuse.iter().map(|refusal| &refusal.when.span);
    let conditions = pipeline.conditions.values().map(|condition| &condition.span);
    let adds = params.chain(resources).chain(nodes).chain(refuse).chain(conditions).any(|span| span.source.name == own.name);
    (!adds).then(|| stages.iter().map(|source| source.name.clone()).collect())
}

/// The pipelines in `pipelines/`, without stages and such, whatever there is.
pub fn pipelines() -> Vec<String> {
    let part = |path: &String| path["pipelines/".len()..].contains('/');
    Library::new(Some(root()), Vec::new()).list("pipelines", "ron").into_iter().filter(|path| !part(path)).collect()
}

/// All of [`pipelines`].
pub fn documents_of_all_pipelines() -> Vec<(String, Documents)> {
    let library = Library::new(Some(root()), Vec::new());
    let (registry, found) = load_registry(&library);
    let load = |path: String| {
        let documents = Documents::with(library.clone(), registry.clone(), found.clone(), Path::new(&path));
        (path, documents.unwrap_or_else(|faults| panic!("{}", faults.render())))
    };
    pipelines().into_iter().map(load).collect()
}

/// How many combinations of a pipeline's options were tried, and what came of them.
#[derive(Default)]
struct Tried {
    /// Accepted by the planner on all scenes.
    planned: usize,
    /// Refused with a reason.
    refused: usize,
    /// Pictures.
    rendered: usize,
    /// Of those that were to be rendered, refused for their numbers.
    without: usize,
}

/// Plans and renders a pipeline in all ways; returns the counts, and the faults.
fn try_all(subject: &Subject<'_>, most: usize, seed: u64) -> (Tried, Vec<String>) {
    let (mut chance, mut faults) = (Random(seed), Vec::new());
    let (accepted, refused) = subject.plan_all(most, &mut chance, &mut faults);
    let rows = if faults.is_empty() { subject.pairs(&accepted, &mut chance) } else { Vec::new() };
    let mut tried = Tried { planned: accepted.len(), refused, ..Tried::default() };
    for (row, scene) in rows.iter().flat_map(|row| subject.scenes.iter().map(move |scene| (row, scene))) {
        match subject.render(row, scene) {
            Ok(Some(())) => tried.rendered += 1,
            Ok(None) => tried.without += 1,
            Err(told) => faults.push(told),
        }
        if faults.len() >= MOST_TOLD {
            break;
        }
    }
    (tried, faults)
}

#[test]
fn every_combination_of_options_renders_finite_numbers_or_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().expect("temporary folder");
    let scenes = scenes(folder.path());
    let mut all: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let (mut seen, mut record) = (BTreeSet::new(), Vec::new());
    for (path, documents) in documents_of_all_pipelines() {
        let (again, start) = (stages(&documents).is_some_and(|stages| !seen.insert(stages)), Instant::now());
        let (tried, faults) = try_all(&Subject::new(&documents, &scenes), if again { MOST_AGAIN } else { MOST_PLANNED }, 7);
        let Tried { planned, refused, rendered, without } = tried;
        let seconds = start.elapsed().as_secs_f64();
        println!("{path}: {planned} planned, {refused} refused, {rendered} rendered, {without} refused for their numbers, {seconds:.1} s");
        record.push(serde_json::json!({
            "pipeline": path, "planned": planned, "refused": refused, "rendered": rendered, "refused_for_numbers": without, "faults": faults.len(),
        }));
        if !faults.is_empty() {
            all.insert(path, faults);
        }
    }
    let told: Vec<String> =
        all.iter().flat_map(|(path, faults)| faults.iter().take(MOST_TOLD).map(move |fault| format!("{path} {fault}"))).collect();
    records::write("combinations", &record);
    assert!(told.is_empty(), "{}", told.join("\n"));
}

/// The scan sees what it is there for: one texel of one node that divides by zero, or takes away light that is not there.
#[test]
fn what_is_planted_in_a_shader_is_found_at_its_node() {
    const DECLARATION: &str = r#"Node(
        doc: "Adds two kinds of light, but is wrong in one pixel.",
        inputs: {
            "direct": Texture(format: Rgba32Float, doc: "W/(m² sr)"),
            "indirect": Texture(format: Rgba32Float, doc: "W/(m² sr)"),
        },
        outputs: { "composed": Texture(format: Rgba32Float, at_least: 0.0, doc: "W/(m² sr)") },
        steps: [(entry: "compose", over: Texels("composed"))],
    )"#;
    const SHADER: &str = "
        @group(0) @binding(0) var direct: texture_2d<f32>;
        @group(0) @binding(1) var indirect: texture_2d<f32>;
        @group(0) @binding(2) var composed: texture_storage_2d<rgba32float, write>;
        @compute @workgroup_size(8, 8)
        fn compose(@builtin(global_invocation_id) id: vec3u) {
            if any(id.xy >= textureDimensions(composed)) {
                return;
            }
            let both = textureLoad(direct, id.xy, 0).rgb + textureLoad(indirect, id.xy, 0).rgb;
            let distance = vec2f(id.xy) - vec2f(5.0, 3.0);
            textureStore(composed, id.xy, vec4f(both + PLANTED, 1.0));
        }";
    let planted = [
        ("1e-9 / dot(distance, distance)", "infinite, and so are 2 numbers after it"),
        ("sqrt(dot(distance, distance) - 1e-9)", "NaN, and so are 2 numbers after it"),
        ("select(0.0, -1e9, all(distance == vec2f(0.0)))", "less than 0, and so are 2 numbers after it"),
    ];
    for (expression, value) in planted {
        let project = project_with(&[
            ("shaders/test/planted.ron", DECLARATION),
            ("shaders/test/planted.wgsl", &SHADER.replace("PLANTED", expression)),
            ("pipelines/planted.ron", "Pipeline(doc: \"x\", extends: \"acrsm.ron\", nodes: [(id: \"compose\", node: \"test/planted\")])"),
        ]);
        let debug = Debug { watch_numbers: true, ..Debug::default() };
        let job = Job { root: project.path().to_owned(), pipeline: "planted".to_owned(), debug, ..Job::asset("cornell").small() };
        let told = job.renderer().render_frame(0.0).expect_err("it has a fault").to_string();
        let place = "frame 0: node `compose` (test/planted) writes `composed`: texel (5, 3) of level 0, layer 0, channel 0 is";
        assert!(told.contains(&format!("{place} {value}")), "{expression}: {told}");
    }
}
