//! The renderer on a small library of its own: parameters, host nodes, hot reload.

use std::{fs, path::Path};

use manylight_gpu::{Gpu, GpuOptions};
use manylight_graph::library::Library;
use manylight_passes::{RenderError, Renderer, SceneSource, Settings};
use tempfile::TempDir;

const FILL_RON: &str = r#"Node(
    doc: "One value everywhere, and what is known of the points.",
    inputs: {
        "frame": Uniform(of: "Frame", doc: "number of the frame"),
        "points": Buffer(of: "ScenePoint", doc: "scene points"),
    },
    outputs: { "picture": Texture(format: Rgba32Float, doc: "value, number of points, summed area, frame") },
    params: { "value": Float(min: 0.0, max: 100.0, default: 1.0, doc: "the value") },
    steps: [(entry: "fill", over: Texels("picture"))],
)
"#;

const FILL_WGSL: &str = "#import common::scene::{Frame, ScenePoint}
struct Params { value: f32 }
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(2) var<storage, read> points: array<ScenePoint>;
@group(0) @binding(3) var picture: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8, 8)
fn fill(@builtin(global_invocation_id) id: vec3u) {
    var used = 0.0;
    var area = 0.0;
    for (var i = 0u; i < arrayLength(&points); i++) {
        used += select(0.0, 1.0, points[i].area > 0.0);
        area += points[i].area;
    }
    textureStore(picture, id.xy, vec4f(params.value, used, area, f32(frame.index)));
}
";

const COMMON_WGSL: &str = "struct Frame { index: u32, seed: u32, time: f32, delta_time: f32 }
struct ScenePoint { position: vec3f, area: f32, normal: vec3f, object: u32 }
";

const PIPELINE: &str = r#"Pipeline(
    doc: "test",
    params: {
        "value": Float(min: 0.0, max: 10.0, default: 2.0, doc: "the value"),
        "point_count": Int(min: 1, max: 4096, default: 100, doc: "points"),
        "method": Choice(options: ["area", "tessellation"], default: "area", doc: "how"),
    },
    resources: {
        "points": Buffer(of: "ScenePoint", count: Param("point_count"), doc: "points"),
        "picture": Texture(format: Rgba32Float, size: Output, doc: "picture"),
    },
    nodes: [(id: "points", node: "points/static"), (id: "fill", node: "test/fill")],
    presents: "picture",
)
"#;

const SCENE: &str = r#"Scene(meshes: ["square.obj"], camera: (origin: (0.0, 0.0, 5.0), target: (0.0, 0.0, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 50.0),
    lights: [Spot(position: (0.0, 0.0, 2.0), target: (0.0, 0.0, 0.0), intensity: (9.0, 9.0, 9.0), beam_deg: 20.0, cutoff_deg: 30.0, falloff: linear)])
"#;

/// A square of side 2.
const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";

fn library() -> TempDir {
    let folder = tempfile::tempdir().expect("temporary folder");
    for (name, text) in [
        ("shaders/common/scene.wgsl", COMMON_WGSL),
        ("shaders/test/fill.ron", FILL_RON),
        ("shaders/test/fill.wgsl", FILL_WGSL),
        ("pipelines/test.ron", PIPELINE),
        ("square.ron", SCENE),
        ("square.obj", SQUARE),
    ] {
        write(folder.path(), name, text);
    }
    folder
}

fn write(root: &Path, name: &str, text: &str) {
    let path = root.join(name);
    fs::create_dir_all(path.parent().expect("a folder")).expect("creatable");
    fs::write(path, text).expect("writable");
}

fn renderer(root: &Path, set: &[(&str, &str)]) -> Result<Renderer, RenderError> {
    let gpu = Gpu::new(&GpuOptions::default()).expect("a GPU: apt-get install libvulkan1 mesa-vulkan-drivers");
    let set = set.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned())).collect();
    let scene = SceneSource::file(root.join("square.ron"));
    Renderer::new(
        &gpu,
        Library::new(Some(root.to_owned()), Vec::new()),
        "test",
        scene,
        Settings { size: (8, 4), set, ..Settings::default() },
    )
}

/// Renders a frame and returns value, number of points, summed area and frame number.
fn pixel(renderer: &mut Renderer) -> Vec<f32> {
    renderer.render_frame(0.0).expect("renders");
    let image = renderer.read("picture").expect("readable");
    assert_eq!((image.width, image.height, image.channels), (8, 4, 4));
    image.pixel(7, 3).to_vec()
}

fn assert_close(actual: f32, expected: f32) {
    assert!((actual - expected).abs() <= 1e-4 * expected, "{actual} is not {expected}");
}

#[test]
fn parameters_points_and_frame_numbers_reach_the_shader() {
    let folder = library();
    let mut renderer = renderer(folder.path(), &[("value", "3.5")]).expect("builds");
    let first = pixel(&mut renderer);
    assert_eq!((first[0], first[1], first[3]), (3.5, 100.0, 0.0));
    assert_close(first[2], 4.0); // the square's area
    assert_eq!(pixel(&mut renderer)[3], 1.0);
}

#[test]
fn setting_a_parameter_keeps_the_frame_number_and_a_wrong_value_changes_nothing() {
    let folder = library();
    let mut renderer = renderer(folder.path(), &[]).expect("builds");
    pixel(&mut renderer);
    let fault = renderer.set_parameter("value", "11").expect_err("out of range").render();
    assert!(fault.contains("`value`") && fault.contains("10"), "{fault}");
    assert_eq!(pixel(&mut renderer)[0], 2.0);
    renderer.set_parameter("value", "4").expect("in range");
    let after = pixel(&mut renderer);
    assert_eq!((after[0], after[3]), (4.0, 2.0));
    renderer.set_parameter("point_count", "7").expect("in range");
    assert_eq!(pixel(&mut renderer)[1], 7.0);
}

#[test]
fn too_many_points_name_the_parameter_to_raise() {
    let folder = library();
    let mut renderer = renderer(folder.path(), &[("method", "tessellation")]).expect("builds");
    let fault = renderer.render_frame(0.0).expect_err("32 × 32 × 2 points do not fit into 100").to_string();
    assert!(fault.contains("`point_count`") && fault.contains("points"), "{fault}");
    renderer.set_parameter("point_count", "4096").expect("in range");
    let fits = pixel(&mut renderer);
    assert!(fits[1] > 100.0);
    assert_close(fits[2], 4.0);
}

#[test]
fn a_faulty_shader_keeps_the_last_good_frame() {
    let folder = library();
    let mut renderer = renderer(folder.path(), &[]).expect("builds");
    assert_eq!(pixel(&mut renderer)[0], 2.0);
    let shader = folder.path().join("shaders/test/fill.wgsl");
    write(folder.path(), "shaders/test/fill.wgsl", &FILL_WGSL.replace("params.value", "params.valve"));
    let faults = renderer.reload(std::slice::from_ref(&shader)).expect_err("no such member").render();
    assert!(faults.contains("fill.wgsl:16:47"), "{faults}");
    assert_eq!(faults.matches("error:").count(), 1, "what follows from it is not told: {faults}");
    assert_eq!(pixel(&mut renderer)[0], 2.0);
    fs::remove_file(&shader).expect("removable");
    renderer.reload(std::slice::from_ref(&shader)).expect_err("it is gone");
    assert_eq!(pixel(&mut renderer)[3], 2.0);
    write(folder.path(), "shaders/test/fill.wgsl", &FILL_WGSL.replace("params.value", "2.0 * params.value"));
    let report = renderer.reload(&[shader]).expect("mended");
    assert_eq!((report.build.rebuilt, report.scene_changed), (vec!["fill".to_owned()], false));
    let after = pixel(&mut renderer);
    assert_eq!((after[0], after[3]), (4.0, 3.0));
}

#[test]
fn a_changed_mesh_is_loaded_again() {
    let folder = library();
    let mut renderer = renderer(folder.path(), &[]).expect("builds");
    pixel(&mut renderer);
    let mesh = folder.path().join("square.obj");
    write(folder.path(), "square.obj", "v nonsense\n");
    renderer.reload(std::slice::from_ref(&mesh)).expect_err("no triangle");
    assert_close(pixel(&mut renderer)[2], 4.0);
    write(folder.path(), "square.obj", &SQUARE.replace('1', "2").replace("f 2 2 3 4", "f 1 2 3 4"));
    let report = renderer.reload(&[mesh]).expect("mended");
    assert!(report.scene_changed);
    assert_close(pixel(&mut renderer)[2], 16.0);
}

#[test]
fn a_pipeline_edit_that_cannot_be_planned_keeps_the_last_good_frame() {
    let folder = library();
    let mut renderer = renderer(folder.path(), &[]).expect("builds");
    pixel(&mut renderer);
    let path = folder.path().join("pipelines/test.ron");
    write(folder.path(), "pipelines/test.ron", &PIPELINE.replace("\"test/fill\"", "\"test/fil\""));
    let faults = renderer.reload(std::slice::from_ref(&path)).expect_err("unknown node").render();
    assert!(faults.contains("did you mean `test/fill`?"), "{faults}");
    write(folder.path(), "pipelines/test.ron", &PIPELINE[..PIPELINE.len() / 2]);
    renderer.reload(std::slice::from_ref(&path)).expect_err("half of a file");
    assert_eq!(pixel(&mut renderer)[3], 1.0);
    write(folder.path(), "pipelines/test.ron", &PIPELINE.replace("default: 2.0", "default: 6.0"));
    renderer.reload(&[path]).expect("mended");
    let after = pixel(&mut renderer);
    assert_eq!((after[0], after[3]), (6.0, 2.0));
}

#[test]
fn a_swap_to_what_the_pipeline_refuses_keeps_the_last_good_frame() {
    let folder = library();
    let rule = "refuse: [(when: All([Is(\"method\", \"tessellation\"), AtLeast(\"value\", 5)]), because: \"so bright, triangles show\")],";
    write(folder.path(), "pipelines/test.ron", &PIPELINE.replace("presents:", &format!("{rule}\n    presents:")));
    let mut renderer = renderer(folder.path(), &[("point_count", "4096"), ("method", "tessellation")]).expect("builds");
    pixel(&mut renderer);
    let told = "these values are refused: so bright, triangles show";
    let fault = renderer.set_parameter("value", "5").expect_err("refused").render();
    assert!(fault.contains(told) && fault.contains("set `method` to `area`"), "{fault}");
    assert_eq!(pixel(&mut renderer)[3], 1.0);
    // The same by an edit, as `watch` takes it over.
    let path = folder.path().join("pipelines/test.ron");
    let text = fs::read_to_string(&path).expect("readable");
    write(folder.path(), "pipelines/test.ron", &text.replace("default: 2.0", "default: 6.0"));
    let fault = renderer.reload(std::slice::from_ref(&path)).expect_err("refused").render();
    assert!(fault.contains(told) && fault.contains("test.ron:13:"), "{fault}");
    let kept = pixel(&mut renderer);
    assert_eq!((kept[0], kept[3]), (2.0, 2.0));
    write(folder.path(), "pipelines/test.ron", &text.replace("default: 2.0", "default: 4.0"));
    renderer.reload(&[path]).expect("accepted");
    assert_eq!(pixel(&mut renderer)[0], 4.0);
}

#[test]
fn what_is_watched_covers_documents_shaders_and_scene() {
    let folder = library();
    let renderer = renderer(folder.path(), &[]).expect("builds");
    let set = renderer.watch_set();
    assert!(set.folders.iter().any(|f| f.ends_with("shaders")) && set.folders.iter().any(|f| f.ends_with("pipelines")));
    assert!(set.files.iter().any(|f| f.ends_with("square.ron")) && set.files.iter().any(|f| f.ends_with("square.obj")));
}

#[test]
fn faults_of_text_and_meaning_are_told_together_without_a_gpu() {
    let folder = library();
    let text = PIPELINE.replace("node: \"test/fill\"", "node: \"test/fil\"").replace("size: Output", "sise: Output");
    write(folder.path(), "pipelines/test.ron", &text);
    let library = Library::new(Some(folder.path().to_owned()), Vec::new());
    let faults = manylight_passes::Documents::load(library, Path::new("test")).expect_err("two faults").render();
    assert!(faults.contains("unknown field `sise`") && faults.contains("there is no node `test/fil`"), "{faults}");
    assert_eq!(faults.matches("error:").count(), 2, "{faults}");
}
