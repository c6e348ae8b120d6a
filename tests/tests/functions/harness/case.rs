//! A function, its arguments and its twin.

use std::fmt::Write as _;

use super::{Bound, EXACT, Outcome, Resource, Want, World, judge};
use crate::functions::inputs::{Numbers, draw};

/// Random arguments that each function is called with, besides the edges that its case lists.
const RANDOM_INPUTS: usize = 4096;

/// The twin of a function: what it must return for arguments.
pub type Twin = Box<dyn Fn(&[f64]) -> Vec<Want> + Send + Sync>;

/// A function, what it is called with, and its twin.
pub struct Case {
    /// Module and name: `octahedral::octahedral_encode`.
    pub function: &'static str,
    imports: Vec<&'static str>,
    takes: Vec<(&'static str, &'static str)>,
    before: &'static str,
    gives: Vec<(&'static str, String)>,
    resources: Vec<Resource>,
    edges: Vec<Vec<f64>>,
    random: Vec<Numbers>,
    count: usize,
    twin: Twin,
    bound: Bound,
}

impl Case {
    /// A function, and its parameters as it declares them: `unit: vec3f, seed: u32`. Unless told otherwise it is called with just these.
    pub fn new(function: &'static str, takes: &'static str) -> Self {
        let takes = takes.split(',').filter_map(|parameter| parameter.trim().split_once(": ")).collect();
        Self {
            function,
            imports: Vec::new(),
            takes,
            before: "",
            gives: Vec::new(),
            resources: Vec::new(),
            edges: Vec::new(),
            random: Vec::new(),
            count: RANDOM_INPUTS,
            twin: Box::new(|_| Vec::new()),
            bound: EXACT,
        }
    }

    /// Its return type.
    pub fn gives(self, of: &'static str) -> Self {
        let name = self.function.rsplit("::").next().unwrap_or(self.function);
        let arguments: Vec<&str> = self.takes.iter().map(|(name, _)| *name).collect();
        let call = format!("{name}({})", arguments.join(", "));
        self.also(of, call)
    }

    /// What is compared instead: an expression and its type. May be said several times.
    pub fn also(mut self, of: &'static str, expression: impl Into<String>) -> Self {
        self.gives.push((of, expression.into()));
        self
    }

    /// Statements before.
    pub fn before(self, statements: &'static str) -> Self {
        Self { before: statements, ..self }
    }

    /// Other items that the statements name: `scene::{View, Light}`.
    pub fn imports(mut self, items: &'static str) -> Self {
        self.imports.push(items);
        self
    }

    /// What it reads besides its arguments.
    pub fn reads(mut self, resources: &[Resource]) -> Self {
        self.resources.extend_from_slice(resources);
        self
    }

    /// Arguments that must be among those tried.
    pub fn edges(mut self, edges: impl IntoIterator<Item = Vec<f64>>) -> Self {
        self.edges.extend(edges);
        self
    }

    /// Where random arguments come from. May be said several times.
    pub fn random(mut self, strategy: Numbers) -> Self {
        self.random.push(strategy);
        self
    }

    /// How many of them, where the twin takes long.
    pub fn count(self, count: usize) -> Self {
        Self { count, ..self }
    }

    /// What it must return, and how exactly.
    pub fn twin(self, bound: Bound, twin: impl Fn(&[f64]) -> Vec<Want> + Send + Sync + 'static) -> Self {
        Self { twin: Box::new(twin), bound, ..self }
    }

    /// With a twin that is wrong by four times the bound, or four units where there is none.
    pub fn with_wrong_twin(mut self) -> Self {
        let Bound { limit, unit, .. } = self.bound;
        let twin = std::mem::replace(&mut self.twin, Box::new(|_| Vec::new()));
        let off = move |want: Want| match want {
            Want::Value { value, scale } => Want::of(value + 4.0 * if limit > 0.0 { limit } else { 1.0 } * unit.size(scale), scale),
            other => other,
        };
        self.twin = Box::new(move |input| twin(input).into_iter().map(off).collect());
        self
    }

    /// Arguments as the shader gets them, and as exact numbers.
    fn inputs(&self) -> (Vec<u32>, Vec<Vec<f64>>) {
        let mut all = self.edges.clone();
        all.extend(self.random.iter().flat_map(|strategy| draw(strategy, self.count)));
        let kinds: Vec<bool> = self.takes.iter().flat_map(|(_, of)| vec![is_float(of); width(of)]).collect();
        let mut words = Vec::with_capacity(all.len() * kinds.len());
        for input in &mut all {
            assert_eq!(input.len(), kinds.len(), "{}: arguments {input:?}", self.function);
            for (value, is_float) in input.iter_mut().zip(&kinds) {
                if *is_float {
                    let rounded = *value as f32;
                    *value = f64::from(rounded);
                    words.push(rounded.to_bits());
                } else {
                    words.push(*value as u32);
                }
            }
        }
        (words, all)
    }

    fn shader(&self, calls: usize) -> String {
        let (module, name) = self.function.split_once("::").expect("module::function");
        let mut text = format!("#import common::{module}::{name}\n");
        for items in &self.imports {
            writeln!(text, "#import common::{items}").expect("a string");
        }
        text.push_str("@group(0) @binding(0) var<storage, read> arguments: array<u32>;\n");
        text.push_str("@group(0) @binding(1) var<storage, read_write> results: array<u32>;\n");
        text.push_str("@group(0) @binding(2) var picture: texture_storage_2d<rgba32float, write>;\n");
        for (binding, resource) in (3..).zip(&self.resources) {
            if let Some(global) = resource.declared {
                writeln!(text, "@group(0) @binding({binding}) {global};").expect("a string");
            }
        }
        let (takes, gives) =
            (self.takes.iter().map(|(_, of)| width(of)).sum::<usize>(), self.gives.iter().map(|(of, _)| width(of)).sum::<usize>());
        writeln!(
            text,
            "fn number(at: u32) -> f32 {{ return bitcast<f32>(arguments[at]); }}
@compute @workgroup_size(64)
fn call(@builtin(global_invocation_id) invocation: vec3u) {{
    if invocation.x == 0u {{ textureStore(picture, vec2u(0u), vec4f(0.0)); }}
    if invocation.x >= {calls}u {{ return; }}
    let first_argument = invocation.x * {takes}u;
    let first_result = invocation.x * {gives}u;"
        )
        .expect("a string");
        let mut at = 0;
        for (name, of) in &self.takes {
            let words: Vec<String> = (at..at + width(of))
                .map(|word| match (is_float(of), *of) {
                    (true, _) => format!("number(first_argument + {word}u)"),
                    (false, "bool") => format!("arguments[first_argument + {word}u] != 0u"),
                    (false, "i32") => format!("bitcast<i32>(arguments[first_argument + {word}u])"),
                    (false, _) => format!("arguments[first_argument + {word}u]"),
                })
                .collect();
            at += width(of);
            writeln!(text, "    let {name} = {of}({});", words.join(", ")).expect("a string");
        }
        writeln!(text, "    {}", self.before).expect("a string");
        let mut at = 0;
        for (result, (of, expression)) in self.gives.iter().enumerate() {
            writeln!(text, "    let result_{result} = {expression};").expect("a string");
            for word in 0..width(of) {
                let part = match *of {
                    "f32" | "u32" | "bool" | "i32" => format!("result_{result}"),
                    "mat3x3f" => format!("result_{result}[{}][{}]", word / 3, word % 3),
                    _ => format!("result_{result}[{word}]"),
                };
                let bits = match (is_float(of), *of) {
                    (false, "bool") => format!("select(0u, 1u, {part})"),
                    (false, "u32" | "vec2u" | "vec3u") => part,
                    _ => format!("bitcast<u32>({part})"),
                };
                writeln!(text, "    results[first_result + {at}u] = {bits};").expect("a string");
                at += 1;
            }
        }
        text.push_str("}\n");
        text
    }

    /// Calls it and compares. `edited` changes the text of a module first: a planted fault.
    pub fn measure_with(&self, edited: Option<(&str, &str, &str)>) -> Outcome {
        let (words, inputs) = self.inputs();
        let gives: Vec<&str> = self.gives.iter().flat_map(|(of, _)| vec![*of; width(of)]).collect();
        let ports: Vec<String> =
            self.resources.iter().filter_map(|r| r.port().map(|(_, port)| format!("\"{}\": {port}", r.name))).collect();
        let node = format!(
            "Node(doc: \"Calls a function.\", inputs: {{\"arguments\": Buffer(of: \"u32\", doc: \"of all calls\"), {}}},
            outputs: {{\"results\": Buffer(of: \"u32\", doc: \"of all calls\"), \"picture\": Texture(format: Rgba32Float, doc: \"nothing\")}},
            steps: [(entry: \"call\", over: Threads({}, 1, 1))])",
            ports.join(", "),
            inputs.len()
        );
        let pipeline = format!(
            "Pipeline(doc: \"Calls a function.\", resources: {{\"results\": Buffer(of: \"u32\", count: {}),
            \"picture\": Texture(format: Rgba32Float, size: Fixed(1, 1))}}, nodes: [(id: \"call\", node: \"test/call\")], presents: \"picture\")",
            (inputs.len() * gives.len()).max(1)
        );
        let mut resources = self.resources.clone();
        resources.push(Resource::buffer("arguments", "u32", &words));
        let mut world = World::new(resources);
        world.add("shaders/test/call.ron", &node);
        world.add("shaders/test/call.wgsl", &self.shader(inputs.len()));
        world.add("pipelines/test.ron", &pipeline);
        if let Some((path, from, to)) = edited {
            world.edit(path, from, to);
        }
        let bytes = world.run(self.function, &["results"]).bytes("results");
        let results: Vec<f64> = bytes
            .chunks_exact(4)
            .zip(gives.iter().cycle())
            .map(|(b, of)| {
                let bits = u32::from_le_bytes([b[0], b[1], b[2], b[3]]);
                if is_float(of) { f64::from(f32::from_bits(bits)) } else { f64::from(bits) }
            })
            .collect();
        let mut outcome = Outcome::new(self.function, self.bound);
        for (input, got) in inputs.iter().zip(results.chunks_exact(gives.len())) {
            outcome.add(&(self.twin)(input), got, || format!("{input:?}"));
        }
        outcome
    }
}

/// Components of a WGSL type.
fn width(of: &str) -> usize {
    match of {
        "f32" | "u32" | "i32" | "bool" => 1,
        "vec2f" | "vec2u" => 2,
        "vec3f" | "vec3u" => 3,
        "vec4f" => 4,
        "mat3x3f" => 9,
        _ => panic!("the harness passes no `{of}`"),
    }
}

fn is_float(of: &str) -> bool {
    of.ends_with('f') || of == "f32"
}

/// Calls and compares all of them; fails with everything that is beyond its bound.
pub fn check(cases: Vec<Case>) {
    let mut outcomes: Vec<Outcome> = Vec::new();
    for outcome in cases.iter().map(|case| case.measure_with(None)) {
        // A function that reads something may have a case for each of several things to read.
        match outcomes.iter_mut().find(|known| known.function == outcome.function) {
            Some(known) => known.join(outcome),
            None => outcomes.push(outcome),
        }
    }
    judge(outcomes);
}
