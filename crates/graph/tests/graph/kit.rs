//! A small library of nodes and a pipeline that is right, to be made wrong in one place at a time.

use manylight_graph::{
    check::{check, check_file},
    diagnostics::Diagnostics,
    features,
    library::Library,
    pipeline::Pipeline,
    plan::{Plan, PlanInput},
    planner::plan,
    registry::{External, HostDecl, PortKind, Registry},
    value::ResourceDesc,
};

/// Texts by path.
pub type Files = Vec<(String, String)>;

const CELL: &str = "\
struct Cell {
    mean: vec3f,
    count: u32,
}

fn area(cell: Cell) -> f32 {
    return f32(cell.count) * 0.5;
}
";

const DRAW_RON: &str = r#"Node(
    doc: "Writes a picture and its cells.",
    inputs: {
        "view": Uniform(of: "View", doc: "the camera"),
    },
    outputs: {
        "picture": Texture(format: Rgba16Float, doc: "radiance"),
        "cells": Buffer(of: "Cell", doc: "cells"),
    },
    params: {
        "strength": Float(min: 0.0, max: 2.0, default: 1.0, doc: "how strong"),
        "mode": Choice(options: ["sum", "mean"], default: "sum", doc: "how to add up"),
    },
    steps: [
        (entry: "clear", over: Elements("cells")),
        (entry: "paint", over: Texels("picture")),
    ],
)
"#;

const DRAW_WGSL: &str = "\
#import common::cell::{Cell, area}

struct Params {
    strength: f32,
}

struct View {
    origin: vec3f,
    far: f32,
}

override mode_is_mean: bool = false;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> view: View;
@group(0) @binding(2) var picture: texture_storage_2d<rgba16float, write>;
@group(0) @binding(3) var<storage, read_write> cells: array<Cell>;

@compute @workgroup_size(64)
fn clear(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&cells) {
        cells[id.x] = Cell(vec3f(0.0), 0u);
    }
}

@compute @workgroup_size(8, 8)
fn paint(@builtin(global_invocation_id) id: vec3u) {
    var value = params.strength * view.far * area(cells[0]);
    if mode_is_mean {
        value /= 2.0;
    }
    textureStore(picture, id.xy, vec4f(value));
}
";

const BLUR_RON: &str = r#"Node(
    doc: "Blurs.",
    inputs: { "source": Texture(doc: "what to blur"), "mask": Texture(format: R32Float, optional: true, doc: "where") },
    outputs: { "blurred": Texture(format: Rgba16Float, doc: "blurred") },
    params: { "radius": Int(min: 1, max: 64, default: 4, doc: "texels") },
    steps: [(entry: "main", over: Texels("blurred"))],
)
"#;

const BLUR_WGSL: &str = "\
struct Params { radius: i32 }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var source: texture_2d<f32>;
@group(0) @binding(2) var mask: texture_2d<f32>;
@group(0) @binding(3) var blurred: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let a = textureLoad(source, vec2i(id.xy) + params.radius, 0);
    let b = textureLoad(mask, vec2i(id.xy), 0);
    textureStore(blurred, id.xy, a + b);
}
";

const PYRAMID_RON: &str = r#"Node(
    doc: "Builds a pyramid.",
    inputs: { "cells": Buffer(of: "Cell", doc: "cells") },
    outputs: { "pyramid": Texture(format: R32Float, doc: "all levels") },
    steps: [
        (entry: "base", over: Texels("pyramid")),
        (entry: "down", over: Texels("pyramid"), repeat: Down("pyramid")),
        (entry: "up", over: Texels("pyramid"), repeat: Up("pyramid")),
    ],
)
"#;

const PYRAMID_WGSL: &str = "\
#import common::cell

@group(0) @binding(0) var<storage, read> cells: array<cell::Cell>;
@group(0) @binding(1) var pyramid: texture_storage_2d<r32float, write>;
@group(0) @binding(2) var pyramid_finer: texture_2d<f32>;
@group(0) @binding(3) var pyramid_coarser: texture_2d<f32>;

@compute @workgroup_size(8, 8)
fn base(@builtin(global_invocation_id) id: vec3u) {
    textureStore(pyramid, id.xy, vec4f(cell::area(cells[0])));
}

@compute @workgroup_size(8, 8)
fn down(@builtin(global_invocation_id) id: vec3u) {
    textureStore(pyramid, id.xy, textureLoad(pyramid_finer, id.xy * 2u, 0));
}

@compute @workgroup_size(8, 8)
fn up(@builtin(global_invocation_id) id: vec3u) {
    textureStore(pyramid, id.xy, textureLoad(pyramid_coarser, id.xy / 2u, 0));
}
";

const SCENE_RON: &str = r#"Node(
    doc: "Draws the scene.",
    inputs: {
        "view": Uniform(of: "View", doc: "the camera"),
        "triangles": Buffer(of: "u32", doc: "triangles"),
    },
    outputs: {
        "albedo": Texture(format: Rgba16Float, doc: "albedo"),
        "depth": Texture(format: Depth32Float, doc: "depth"),
    },
    steps: [Draw(vertex: "vs", fragment: "fs", vertices: Mul([3, Elements("triangles")]), targets: ["albedo"], depth: "depth")],
)
"#;

const SCENE_WGSL: &str = "\
struct View {
    origin: vec3f,
    far: f32,
}
@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> triangles: array<u32>;

@vertex
fn vs(@builtin(vertex_index) index: u32) -> @builtin(position) vec4f {
    return vec4f(view.origin, f32(triangles[index / 3u]));
}

@fragment
fn fs() -> @location(0) vec4f {
    return vec4f(1.0);
}
";

const PIPELINE: &str = r#"Pipeline(
    doc: "A pipeline that is right.",
    params: {
        "blur": Bool(default: true, doc: "whether to blur"),
        "count": Int(min: 1, max: 4096, default: 100, doc: "cells"),
        "radius": Int(min: 1, max: 32, default: 3, doc: "texels"),
        "kind": Choice(options: ["plain", "masked"], default: "plain", doc: "kind of blur"),
    },
    resources: {
        "albedo": Texture(format: Rgba16Float, size: Output),
        "depth": Texture(format: Depth32Float, size: Like("albedo")),
        "picture": Texture(format: Rgba16Float, size: Output),
        "cells": Buffer(of: "Cell", count: Mul([Param("count"), 2])),
        "pyramid": Texture(format: R32Float, size: OutputScaled(1, 2), mips: Full),
        "blurred": Texture(format: Rgba16Float, size: Output),
        "result": Texture(format: Rgba16Float, size: Like("blurred")),
    },
    nodes: [
        (id: "show", node: "post/blur", in: {"source": "blurred"}, out: {"blurred": "result"}, params: {"radius": 1}),
        (id: "scene", node: "draw/scene", in: {"view": "scene_camera", "triangles": "scene_triangles"}),
        (id: "paint", node: "draw/paint", in: {"view": "scene_camera"}, params: {"strength": 0.5}),
        (id: "pyramid", node: "post/pyramid"),
        (id: "soft", node: "post/blur", in: {"source": "picture", "mask": "pyramid"}, when: All([IsOn("blur"), Any([Is("kind", "plain"), Is("kind", "masked")])])),
        (id: "hard", node: "post/blur", in: {"source": "albedo"}, params: {"radius": Param("radius")}, when: Not(IsOn("blur"))),
    ],
    presents: "result",
)
"#;

/// The files of the library.
pub fn files() -> Files {
    [
        ("shaders/common/cell.wgsl", CELL),
        ("shaders/draw/paint.ron", DRAW_RON),
        ("shaders/draw/paint.wgsl", DRAW_WGSL),
        ("shaders/draw/scene.ron", SCENE_RON),
        ("shaders/draw/scene.wgsl", SCENE_WGSL),
        ("shaders/post/blur.ron", BLUR_RON),
        ("shaders/post/blur.wgsl", BLUR_WGSL),
        ("shaders/post/pyramid.ron", PYRAMID_RON),
        ("shaders/post/pyramid.wgsl", PYRAMID_WGSL),
        ("pipelines/test.ron", PIPELINE),
    ]
    .map(|(name, text)| (name.to_owned(), text.to_owned()))
    .to_vec()
}

/// The files with one text replaced in one of them; the text must be there.
pub fn with(file: &str, from: &str, to: &str) -> Files {
    edit(files(), file, from, to)
}

/// As [`with`], on files that are already changed.
pub fn edit(mut files: Files, file: &str, from: &str, to: &str) -> Files {
    let (_, text) = files.iter_mut().find(|(name, _)| name == file).expect("the file is in the kit");
    assert!(text.contains(from), "{file} does not contain {from}");
    *text = text.replacen(from, to, 1);
    files
}

/// The files with one more, or another text for one.
pub fn add(mut files: Files, file: &str, text: &str) -> Files {
    files.retain(|(name, _)| name != file);
    files.push((file.to_owned(), text.to_owned()));
    files
}

pub fn library(files: &Files) -> Library {
    Library::new(None, files.iter().map(|(name, text)| (name.clone(), &*text.clone().leak())).collect())
}

pub fn externals() -> Vec<External> {
    let external = |name: &str, kind| External { name: name.into(), kind, doc: "test".into(), layout: None };
    vec![
        external("scene_camera", PortKind::Uniform { of: "View".into() }),
        external("scene_triangles", PortKind::Buffer { of: "u32".into() }),
    ]
}

pub fn registry(files: &Files, host: &[HostDecl]) -> (Registry, Diagnostics) {
    Registry::load(&library(files), host, externals())
}

pub fn input() -> PlanInput {
    PlanInput {
        output: (640, 360),
        features: features::flags().map(|name| (name.to_owned(), false)).collect(),
        externals: [("scene_triangles".to_owned(), ResourceDesc::Buffer { element: "u32".into(), stride: 4, count: 12 })].into(),
        ..PlanInput::default()
    }
}

/// Faults of loading the registry.
pub fn registry_faults(files: &Files) -> String {
    registry(files, &[]).1.render()
}

/// Faults of loading and checking the pipeline; the registry must be right.
pub fn check_faults(files: &Files) -> String {
    let (registry, faults) = registry(files, &[]);
    assert!(faults.is_empty(), "{faults}");
    let library = library(files);
    let rendered = check_file(&library, "test", &registry).render();
    if let Ok(pipeline) = Pipeline::load(&library, "test") {
        assert_eq!(check(&pipeline, &registry).render(), rendered);
    }
    rendered
}

/// Plans the pipeline; everything before must be right.
pub fn try_plan(files: &Files, input: &PlanInput) -> Result<Plan, Diagnostics> {
    let (registry, faults) = registry(files, &[]);
    assert!(faults.is_empty(), "{faults}");
    let pipeline = Pipeline::load(&library(files), "test").unwrap_or_else(|faults| panic!("{faults}"));
    plan(&pipeline, &registry, input)
}

/// Asserts that a rendering contains all parts and has that number of faults.
#[track_caller]
pub fn assert_faults(rendered: &str, count: usize, parts: &[&str]) {
    for part in parts {
        assert!(rendered.contains(part), "missing: {part}\n--- in:\n{rendered}");
    }
    let found = rendered.lines().filter(|l| l.starts_with("error:") || l.starts_with("warning:")).count();
    assert_eq!(found, count, "{rendered}");
}
