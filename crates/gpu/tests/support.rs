//! A world for one test: a device, an inline library, and frames built from it.

use manylight_gpu::{BuildError, BuildOptions, BuildReport, Externals, Frame, Gpu, GpuOptions, HostData, HostNodes, Image, Subresource};
use manylight_graph::{
    library::Library,
    pipeline::Pipeline,
    plan::{Plan, PlanInput},
    planner,
    registry::{External, Registry},
};

/// Copies the first value of a buffer into a picture, for tests that look at the buffer itself.
pub const SHOW: [(&str, &str); 2] = [
    (
        "shaders/test/show.ron",
        r#"Node(doc: "Shows a number.", inputs: {"values": Buffer(of: "f32", doc: "numbers")},
             outputs: {"picture": Texture(format: Rgba32Float, doc: "the first")}, steps: [(entry: "show", over: Texels("picture"))])"#,
    ),
    (
        "shaders/test/show.wgsl",
        r"@group(0) @binding(0) var<storage, read> values: array<f32>;
          @group(0) @binding(1) var picture: texture_storage_2d<rgba32float, write>;
          @compute @workgroup_size(1) fn show(@builtin(global_invocation_id) id: vec3u) {
              textureStore(picture, id.xy, vec4f(values[0]));
          }",
    ),
];

pub struct World {
    pub gpu: Gpu,
    pub externals: Externals,
    pub declared: Vec<External>,
    pub hosts: HostNodes,
    pub input: PlanInput,
    pub options: BuildOptions,
    files: Vec<(String, &'static str)>,
}

impl World {
    /// A library of these files; the pipeline is `pipelines/test.ron`.
    pub fn new(files: &[(&str, &str)]) -> Self {
        let gpu = Gpu::new(&GpuOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let mut world = Self {
            gpu,
            externals: Externals::new(),
            declared: Vec::new(),
            hosts: HostNodes::new(),
            input: PlanInput { output: (8, 4), ..Default::default() },
            options: BuildOptions::default(),
            files: Vec::new(),
        };
        files.iter().for_each(|(path, text)| world.write(path, text));
        world
    }

    pub fn write(&mut self, path: &str, text: &str) {
        self.files.retain(|(known, _)| known != path);
        self.files.push((path.to_owned(), String::leak(text.to_owned())));
    }

    pub fn keep(mut self, names: &[&str]) -> Self {
        self.input.keep = names.iter().map(|n| (*n).to_owned()).collect();
        self
    }

    pub fn plan(&self) -> Plan {
        let library = Library::new(None, self.files.clone());
        let (registry, faults) = Registry::load(&library, &self.hosts.declarations(), self.declared.clone());
        assert!(!faults.has_errors(), "{faults}");
        let pipeline = Pipeline::load(&library, "pipelines/test.ron").unwrap_or_else(|e| panic!("{e}"));
        let mut input = self.input.clone();
        input.externals = self.externals.descs();
        planner::plan(&pipeline, &registry, &input).unwrap_or_else(|e| panic!("{e}"))
    }

    pub fn try_build(&self, previous: Option<&Frame>) -> Result<(Frame, BuildReport), BuildError> {
        Frame::build(&self.gpu, &self.plan(), &self.externals, &self.hosts, previous, self.options)
    }

    pub fn build(&self) -> Frame {
        self.try_build(None).unwrap_or_else(|e| panic!("{e}")).0
    }

    pub fn run(&self, frame: &mut Frame) {
        frame.record_and_submit(&self.gpu, &self.externals, HostData::none()).unwrap_or_else(|e| panic!("{e}"));
    }

    /// Builds, runs once and returns the frame.
    pub fn once(&self) -> Frame {
        let mut frame = self.build();
        self.run(&mut frame);
        frame
    }

    pub fn image(&self, frame: &Frame, name: &str) -> Image {
        self.image_at(frame, name, 0)
    }

    pub fn image_at(&self, frame: &Frame, name: &str, mip: u32) -> Image {
        let part = Subresource { mip, layer: 0 };
        frame.read_image(&self.gpu, &self.externals, name, part).unwrap_or_else(|e| panic!("{e}"))
    }

    pub fn json(&self, frame: &Frame, name: &str) -> serde_json::Value {
        frame.read_json(&self.gpu, &self.externals, name).unwrap_or_else(|e| panic!("{e}"))
    }

    pub fn floats(&self, frame: &Frame, name: &str) -> Vec<f32> {
        let bytes = frame.read_bytes(&self.gpu, &self.externals, name).unwrap_or_else(|e| panic!("{e}"));
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }
}
