//! Calls functions of `shaders/common` on the GPU over arrays of arguments and compares what they return with a twin in 64 bits.
//!
//! The shader around a function is made here and goes through everything that a node's shader goes through: composition, planning, execution.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs,
    path::Path,
    sync::{Mutex, PoisonError},
};

use manylight_gpu::{BuildOptions, Externals, Frame, HostData, HostNodes, Image, Subresource, TextureArray};
use manylight_graph::{
    library::Library,
    pipeline::Pipeline,
    plan::PlanInput,
    planner,
    registry::{External, PortKind, Registry},
    value::{Format, ResourceDesc},
};

use super::inputs::{Numbers, draw};
use crate::{renders::gpu, support::root};

/// Random arguments that each function is called with, besides the edges that its case lists.
const RANDOM_INPUTS: usize = 4096;

/// What a result must be.
#[derive(Debug, Clone)]
pub enum Want {
    /// This value; the error counts in the unit of the case at the magnitude `scale`.
    Value { value: f64, scale: f64 },
    /// Any number from the first to the second: all that a function promises where it has no value, or where rounding decides between two.
    Between(f64, f64),
    /// One of several values, as [`Want::Value`]: rounding decides which.
    OneOf(Vec<Want>),
}

impl Want {
    /// A value; units are those of its own magnitude.
    pub fn new(value: f64) -> Self {
        Self::Value { value, scale: value.abs() }
    }

    /// A value that is the sum of terms of the magnitude `scale`, or follows from such: their rounding counts, however small it is itself.
    pub fn of(value: f64, scale: f64) -> Self {
        Self::Value { value, scale: scale.abs().max(value.abs()) }
    }

    /// Any finite number.
    pub fn finite() -> Self {
        Self::Between(f64::MIN, f64::MAX)
    }
}

/// Values with units of their own magnitude.
pub fn values(all: impl IntoIterator<Item = f64>) -> Vec<Want> {
    all.into_iter().map(Want::new).collect()
}

/// Values with units of a common magnitude.
pub fn values_of(all: impl IntoIterator<Item = f64>, scale: f64) -> Vec<Want> {
    all.into_iter().map(|value| Want::of(value, scale)).collect()
}

/// What errors are counted in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Units in the last place of 32-bit floats.
    Ulps,
    /// As it is.
    Absolute,
    /// Shares of the value.
    Relative,
}

impl Unit {
    fn size(self, scale: f64) -> f64 {
        match self {
            // Numbers below the smallest normal one have its unit.
            Self::Ulps => (scale.max(f64::from(f32::MIN_POSITIVE)).log2().floor() - 23.0).exp2(),
            Self::Absolute => 1.0,
            Self::Relative => scale.max(f64::from(f32::MIN_POSITIVE)),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Ulps => "ulp",
            Self::Absolute => "absolute",
            Self::Relative => "relative",
        }
    }
}

/// How far results may be off.
#[derive(Debug, Clone, Copy)]
pub struct Bound {
    pub limit: f64,
    pub unit: Unit,
    pub reason: &'static str,
}

/// Whole numbers, switches, and values that are rounded nowhere.
pub const EXACT: Bound = Bound { limit: 0.0, unit: Unit::Ulps, reason: "nothing is rounded" };

/// A bound in units in the last place.
pub const fn ulps(limit: f64, reason: &'static str) -> Bound {
    Bound { limit, unit: Unit::Ulps, reason }
}

/// A bound on the difference itself.
pub const fn absolute(limit: f64, reason: &'static str) -> Bound {
    Bound { limit, unit: Unit::Absolute, reason }
}

/// A bound on the difference over the value.
pub const fn relative(limit: f64, reason: &'static str) -> Bound {
    Bound { limit, unit: Unit::Relative, reason }
}

/// What a function reads besides its arguments.
#[derive(Debug, Clone)]
pub struct Resource {
    name: &'static str,
    kind: Kind,
    /// The global that the shader around the function declares; without it, the function's module does.
    declared: Option<&'static str>,
}

#[derive(Debug, Clone)]
enum Kind {
    Bytes { element: &'static str, stride: u32, uniform: bool, bytes: Vec<u8> },
    Texture { format: Format, array: bool, size: (u32, u32), layers: Vec<Vec<u8>>, mips: u32 },
    Sampler,
}

impl Resource {
    /// A storage buffer of structures as Rust fills them.
    pub fn buffer<T: bytemuck::Pod>(name: &'static str, element: &'static str, values: &[T]) -> Self {
        let bytes = bytemuck::cast_slice(values).to_vec();
        Self { name, kind: Kind::Bytes { element, stride: size_of::<T>() as u32, uniform: false, bytes }, declared: None }
    }

    /// A uniform structure.
    pub fn uniform<T: bytemuck::Pod>(name: &'static str, element: &'static str, value: &T) -> Self {
        let bytes = bytemuck::bytes_of(value).to_vec();
        Self { name, kind: Kind::Bytes { element, stride: size_of::<T>() as u32, uniform: true, bytes }, declared: None }
    }

    /// A texture; its levels one after another.
    pub fn texture<T: bytemuck::Pod>(name: &'static str, format: Format, size: (u32, u32), levels: &[Vec<T>]) -> Self {
        let bytes = levels.iter().flat_map(|level| bytemuck::cast_slice::<T, u8>(level).to_vec()).collect();
        let of = if format == Format::R32Uint { "texture_2d<u32>" } else { "texture_2d<f32>" };
        let kind = Kind::Texture { format, array: false, size, layers: vec![bytes], mips: levels.len() as u32 };
        Self { name, kind, declared: Some(String::leak(format!("var {name}: {of}"))) }
    }

    /// An array of textures with one level, which the function's module declares.
    pub fn texture_array<T: bytemuck::Pod>(name: &'static str, format: Format, size: (u32, u32), layers: &[Vec<T>]) -> Self {
        let layers = layers.iter().map(|layer| bytemuck::cast_slice::<T, u8>(layer).to_vec()).collect();
        Self { name, kind: Kind::Texture { format, array: true, size, layers, mips: 1 }, declared: None }
    }

    /// Declared by the shader around the function, as this: `var<uniform> scene_info: SceneInfo`.
    pub fn declared(self, global: &'static str) -> Self {
        Self { declared: Some(global), ..self }
    }

    /// The sampler of that name, for functions that take one.
    pub fn sampler(name: &'static str) -> Self {
        Self { name, kind: Kind::Sampler, declared: Some(String::leak(format!("var {name}: sampler"))) }
    }

    fn port(&self) -> Option<(PortKind, String)> {
        match &self.kind {
            Kind::Bytes { element, uniform: true, .. } => {
                Some((PortKind::Uniform { of: (*element).to_owned() }, format!("Uniform(of: \"{element}\", doc: \"test data\")")))
            }
            Kind::Bytes { element, .. } => {
                Some((PortKind::Buffer { of: (*element).to_owned() }, format!("Buffer(of: \"{element}\", doc: \"test data\")")))
            }
            Kind::Texture { format, array, .. } => Some((
                PortKind::Texture { format: Some(*format), array: *array },
                format!("Texture(format: {format:?}, array: {array}, doc: \"test data\")"),
            )),
            Kind::Sampler => None,
        }
    }

    fn upload(&self, externals: &mut Externals) {
        let set = match &self.kind {
            Kind::Bytes { element, uniform: true, bytes, .. } => externals.set_uniform(gpu(), self.name, element, bytes),
            Kind::Bytes { element, stride, bytes, .. } => externals.set_buffer(gpu(), self.name, element, *stride, bytes),
            Kind::Texture { format, size: (width, height), layers, mips, .. } => {
                let layers: Vec<&[u8]> = layers.iter().map(Vec::as_slice).collect();
                let data = TextureArray { format: *format, width: *width, height: *height, mips: *mips, layers: &layers };
                externals.set_texture_array(gpu(), self.name, data)
            }
            Kind::Sampler => Ok(()),
        };
        set.unwrap_or_else(|e| panic!("{e}"));
        let Kind::Texture { array: false, .. } = self.kind else { return };
        // The same memory, seen as a plain texture.
        let (memory, desc) = (externals.memory(self.name).cloned(), externals.desc(self.name).cloned());
        if let (Some(memory), Some(ResourceDesc::Texture { format, width, height, layers, mips, encoding, .. })) = (memory, desc) {
            externals.insert(self.name, ResourceDesc::Texture { format, width, height, layers, array: false, mips, encoding }, memory);
        }
    }
}

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

/// What came of the comparison of one function.
#[derive(Debug, Clone)]
pub struct Outcome {
    pub function: &'static str,
    pub inputs: usize,
    pub worst: f64,
    pub bound: Bound,
    /// The call with the worst error.
    pub worst_call: String,
}

impl Outcome {
    /// Nothing compared yet.
    pub fn new(function: &'static str, bound: Bound) -> Self {
        Self { function, inputs: 0, worst: 0.0, bound, worst_call: String::new() }
    }

    /// Compares the results of one more call.
    pub fn add(&mut self, want: &[Want], got: &[f64], input: impl Fn() -> String) {
        assert_eq!(want.len(), got.len(), "{}: the twin gives {} numbers for {} results", self.function, want.len(), got.len());
        self.inputs += 1;
        for (place, (want, got)) in want.iter().zip(got).enumerate() {
            let error = error(want, *got, self.bound.unit);
            if error > self.worst || error.is_nan() {
                self.worst = if error.is_nan() { f64::INFINITY } else { error };
                self.worst_call = format!("input {}: {}; result {place}: {got:e} instead of {want:?}", self.inputs - 1, input());
            }
        }
    }

    fn join(&mut self, other: Self) {
        self.inputs += other.inputs;
        if other.worst > self.worst {
            (self.worst, self.worst_call) = (other.worst, other.worst_call);
        }
    }

    /// Whether the worst error is within the bound.
    pub fn is_good(&self) -> bool {
        self.inputs > 0 && self.worst <= self.bound.limit
    }
}

fn error(want: &Want, got: f64, unit: Unit) -> f64 {
    match want {
        Want::Value { value, scale } => {
            let difference = (got - value).abs();
            // A device may take numbers below the smallest normal one for zero.
            if difference < f64::from(f32::MIN_POSITIVE) { 0.0 } else { difference / unit.size(*scale) }
        }
        Want::Between(low, high) => {
            if got.is_finite() && (*low..=*high).contains(&got) {
                0.0
            } else {
                f64::INFINITY
            }
        }
        Want::OneOf(all) => all.iter().map(|want| error(want, got, unit)).fold(f64::INFINITY, f64::min),
    }
}

/// A library of the modules in `shaders/common` and some files beside them, with everything that its node reads from outside.
pub struct World {
    files: BTreeMap<String, String>,
    externals: Externals,
    declared: Vec<External>,
}

impl World {
    /// With these resources.
    pub fn new(resources: Vec<Resource>) -> Self {
        let mut files = BTreeMap::new();
        for path in modules() {
            let text = fs::read_to_string(root().join(&path)).unwrap_or_else(|e| panic!("{path}: {e}"));
            files.insert(path, text);
        }
        let mut externals = Externals::new();
        let mut declared = Vec::new();
        for resource in resources {
            resource.upload(&mut externals);
            if let Some((kind, _)) = resource.port() {
                declared.push(External { name: resource.name.to_owned(), kind, doc: "test data".to_owned(), layout: None });
            }
        }
        Self { files, externals, declared }
    }

    /// One more file.
    pub fn add(&mut self, path: &str, text: &str) {
        self.files.insert(path.to_owned(), text.to_owned());
    }

    /// The two files of a node of the repository.
    pub fn add_node(&mut self, name: &str) {
        for extension in ["ron", "wgsl"] {
            let path = format!("shaders/{name}.{extension}");
            let text = fs::read_to_string(root().join(&path)).unwrap_or_else(|e| panic!("{path}: {e}"));
            self.files.insert(path, text);
        }
    }

    /// A node `test/show` without inputs that gives the texture `picture`: for pipelines of buffers, which must present one.
    pub fn add_picture(&mut self) {
        self.add(
            "shaders/test/show.ron",
            "Node(doc: \"Nothing to see.\", outputs: {\"picture\": Texture(format: Rgba32Float, doc: \"black\")},
            steps: [(entry: \"show\", over: Texels(\"picture\"))])",
        );
        self.add(
            "shaders/test/show.wgsl",
            "@group(0) @binding(0) var picture: texture_storage_2d<rgba32float, write>;
            @compute @workgroup_size(1) fn show(@builtin(global_invocation_id) id: vec3u) { textureStore(picture, id.xy, vec4f(0.0)); }",
        );
    }

    /// Changes a file.
    pub fn edit(&mut self, path: &str, from: &str, to: &str) {
        let text = self.files.get_mut(path).unwrap_or_else(|| panic!("there is no {path}"));
        assert_eq!(text.matches(from).count(), 1, "`{from}` in {path}");
        *text = text.replace(from, to);
    }

    /// Runs `pipelines/test.ron` once and keeps some of its resources.
    pub fn run(self, subject: &str, keep: &[&str]) -> Ran {
        let files = self.files.into_iter().map(|(path, text)| (path, &*String::leak(text))).collect();
        let library = Library::new(None, files);
        let (registry, faults) = Registry::load(&library, &[], self.declared);
        assert!(!faults.has_errors(), "{subject}: {faults}");
        let pipeline = Pipeline::load(&library, "pipelines/test.ron").unwrap_or_else(|e| panic!("{subject}: {e}"));
        let keep = keep.iter().map(|name| (*name).to_owned()).collect();
        let input = PlanInput { output: (1, 1), keep, externals: self.externals.descs(), ..Default::default() };
        let plan = planner::plan(&pipeline, &registry, &input).unwrap_or_else(|e| panic!("{subject}: {e}"));
        let built = Frame::build(gpu(), &plan, &self.externals, &HostNodes::new(), None, BuildOptions::default());
        let (mut frame, _) = built.unwrap_or_else(|e| panic!("{subject}: {e}"));
        frame.record_and_submit(gpu(), &self.externals, HostData::none()).unwrap_or_else(|e| panic!("{subject}: {e}"));
        Ran { frame, externals: self.externals }
    }
}

/// A frame that has run.
pub struct Ran {
    frame: Frame,
    externals: Externals,
}

impl Ran {
    /// Bytes of a buffer.
    pub fn bytes(&self, name: &str) -> Vec<u8> {
        self.frame.read_bytes(gpu(), &self.externals, name).unwrap_or_else(|e| panic!("{e}"))
    }

    /// A buffer of numbers.
    pub fn numbers(&self, name: &str) -> Vec<f64> {
        self.bytes(name).chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect()
    }

    /// Level 0 of a texture.
    pub fn image(&self, name: &str) -> Image {
        self.frame.read_image(gpu(), &self.externals, name, Subresource { mip: 0, layer: 0 }).unwrap_or_else(|e| panic!("{e}"))
    }
}

/// Paths of the modules in `shaders/common`.
pub fn modules() -> Vec<String> {
    let folder = root().join("shaders/common");
    let files = fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let names = files.map(|file| file.expect("readable").file_name().to_string_lossy().into_owned());
    let mut paths: Vec<String> = names.filter(|name| name.ends_with(".wgsl")).map(|name| format!("shaders/common/{name}")).collect();
    paths.sort();
    paths
}

/// The folder that a record of all comparisons is written to, when this variable is set.
const RECORD_FOLDER: &str = "MANYLIGHT_RECORD_NUMBERS";

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

/// Records outcomes, and fails with everything that is beyond its bound.
pub fn judge(outcomes: Vec<Outcome>) {
    record(&outcomes);
    let bad: Vec<String> = outcomes
        .iter()
        .filter(|outcome| !outcome.is_good())
        .map(|o| {
            format!("{}: worst error {:.3e}, bound {:.3e} ({}), {}", o.function, o.worst, o.bound.limit, o.bound.unit.name(), o.worst_call)
        })
        .collect();
    assert!(bad.is_empty(), "{} of {} functions are not as their twins:\n{}", bad.len(), outcomes.len(), bad.join("\n"));
}

/// Adds outcomes to the record, which is one array of objects in `functions.json`, by the names of the functions.
fn record(outcomes: &[Outcome]) {
    static ALL: Mutex<BTreeMap<&str, Outcome>> = Mutex::new(BTreeMap::new());
    let Some(folder) = std::env::var_os(RECORD_FOLDER) else { return };
    let mut all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
    all.extend(outcomes.iter().map(|o| (o.function, o.clone())));
    let rows: Vec<serde_json::Value> = all
        .values()
        .map(|o| {
            let Bound { limit, unit, reason } = o.bound;
            // A number that JSON lacks is a failure of the test, which says more.
            serde_json::json!({
                "function": o.function, "inputs": o.inputs, "worst": o.worst, "unit": unit.name(), "bound": limit, "reason": reason,
            })
        })
        .collect();
    let folder = Path::new(&folder);
    fs::create_dir_all(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let path = folder.join("functions.json");
    let text = serde_json::to_string_pretty(&rows).expect("rows are plain");
    fs::write(&path, text + "\n").unwrap_or_else(|e| panic!("{}: {e}", path.display()));
}
