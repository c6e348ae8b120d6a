//! A library, what its nodes read from outside, and one frame of it.

use std::{collections::BTreeMap, fs};

use manylight_gpu::{BuildOptions, Externals, Frame, HostData, HostNodes, Image, Subresource, TextureArray};
use manylight_graph::{
    library::Library,
    pipeline::Pipeline,
    plan::PlanInput,
    planner,
    registry::{External, PortKind, Registry},
    value::{Format, ResourceDesc},
};

use crate::{renders::gpu, support::root};

/// What a function reads besides its arguments.
#[derive(Debug, Clone)]
pub struct Resource {
    pub(super) name: &'static str,
    kind: Kind,
    /// The global that the shader around the function declares; without it, the function's module does.
    pub(super) declared: Option<&'static str>,
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

    /// What it is as a port of a node, and how a declaration says so; a sampler is none.
    pub(super) fn port(&self) -> Option<(PortKind, String)> {
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
