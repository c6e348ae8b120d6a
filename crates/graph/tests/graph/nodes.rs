//! Faults of declarations and shaders: message, place, remedy, and nothing that only follows.

use crate::kit::*;

const RON: &str = "shaders/draw/paint.ron";
const WGSL: &str = "shaders/draw/paint.wgsl";
const COMMON: &str = "shaders/common/cell.wgsl";
const VIEW: &str = "\"view\": Uniform(of: \"View\", doc: \"the camera\")";

#[track_caller]
fn one(file: &str, from: &str, to: &str, parts: &[&str]) {
    assert_faults(&registry_faults(&with(file, from, to)), 1, parts);
}

#[test]
fn a_fault_is_rendered_with_place_caret_and_remedy() {
    let rendered = registry_faults(&with(RON, "over: Texels(\"picture\")", "over: Texels(\"pictur\")"));
    let expected = "\
error: this node has no port `pictur`
   --> shaders/draw/paint.ron:16:39
   |
16 |         (entry: \"paint\", over: Texels(\"pictur\")),
   |                                       ^^^^^^^^
   |
   = help: did you mean `picture`?
";
    assert_eq!(rendered, expected);
}

#[test]
fn a_fault_in_both_files_shows_both() {
    let rendered = registry_faults(&with(RON, "\"picture\": Texture(format: Rgba16Float", "\"picture\": Texture(format: Rgba32Float"));
    let expected = "\
error: `picture` does not fit its port: the port has the format Rgba32Float, the shader Rgba16Float
   --> shaders/draw/paint.wgsl:16:27
   |
16 | @group(0) @binding(2) var picture: texture_storage_2d<rgba16float, write>;
   |                           ^^^^^^^
   |
   --> shaders/draw/paint.ron:7:9
   |
 7 |         \"picture\": Texture(format: Rgba32Float, doc: \"radiance\"),
   |         --------- the port
   |
   = help: write `@group(…) @binding(…) var picture: texture_storage_2d<rgba32float, write>;`
";
    assert_eq!(rendered, expected);
}

#[test]
fn declarations() {
    one(
        RON,
        "doc: \"Writes a picture and its cells.\"",
        "dok: \"x\"",
        &["unknown field `dok` in Node", "paint.ron:2:5", "did you mean `doc`?"],
    );
    one(RON, "doc: \"Writes a picture and its cells.\",", "", &["missing field `doc` in Node", "paint.ron:1:1"]);
    one(RON, VIEW, "\"view\": Unifrm(of: \"View\", doc: \"x\")", &["unknown kind of port `Unifrm`", "paint.ron:4:17", "`Uniform`"]);
    one(RON, VIEW, "\"view\": Texture(R32Uint)", &["Texture takes named fields", "paint.ron:4:25", "`format: …`"]);
    one(RON, VIEW, "\"view\": Uniform(of: \"View\")", &["missing field `doc` in Uniform", "paint.ron:4:17"]);
    one(
        RON,
        VIEW,
        "\"view\": Uniform(of: View, doc: \"x\")",
        &["in quotes, found the name `View`", "paint.ron:4:29", "write it in quotes: \"View\""],
    );
    one(
        RON,
        "Texture(format: Rgba16Float",
        "Texture(format: Rgba16Flaot",
        &["unknown format `Rgba16Flaot`", "paint.ron:7:36", "`Rgba16Float`"],
    );
    one(RON, VIEW, "\"cells\": Buffer(of: \"Cell\", doc: \"x\")", &["`cells` is an input and an output", "paint.ron:8:9"]);
    one(RON, "default: 1.0", "default: 3.0", &["the default 3.0 of `strength` is not allowed", "paint.ron:11:56", "from 0.0 to 2.0"]);
    one(RON, "\"sum\", \"mean\"", "\"sum\", \"sum\", \"mean\"", &["the option `sum` is listed twice", "paint.ron:12:41"]);
    one(RON, "Choice(options", "Choise(options", &["unknown parameter type `Choise`", "paint.ron:12:17", "`Choice`"]);
    one(
        RON,
        "over: Texels(\"picture\")",
        "over: Texels(\"cells\")",
        &["`cells` is no texture", "paint.ron:16:39", "use `Elements` for buffers"],
    );
    one(RON, "over: Texels(\"picture\")", "over: Texel(\"picture\")", &["unknown size `Texel`", "paint.ron:16:32", "`Texels`"]);
    one(RON, "over: Texels(\"picture\")", "over: Groups(Param(\"strength\"), 1, 1)", &["`strength` is no Int", "paint.ron:16:45"]);
    one(RON, "over: Texels(\"picture\")", "over: Groups(Param(\"streng\"), 1, 1)", &["no parameter `streng`", "16:45", "`strength`"]);
    one(
        RON,
        "over: Texels(\"picture\")",
        "over: Texels(\"picture\"), repeat: Down(\"view\")",
        &["`Down` needs an output texture", "16:64"],
    );
    one(RON, "over: Texels(\"picture\")", "over: Texels(\"picture\"), repeat: Twice(2)", &["unknown repetition `Twice`", "16:59"]);
    one(RON, "steps: [", "stepps: [", &["unknown field `stepps`", "14:5", "`steps`"]);
    one("shaders/draw/scene.ron", "depth: \"depth\")", "depth: \"albedo\")", &["`albedo` cannot be a depth attachment", "11:119"]);
    one("shaders/draw/scene.ron", "targets: [\"albedo\"]", "targets: [\"depth\"]", &["`depth` cannot be a colour target", "11:101"]);
}

#[test]
fn draws_have_targets_of_known_format_and_no_attributes() {
    let ron = "shaders/draw/scene.ron";
    one(ron, "targets: [\"albedo\"]", "targets: [\"albedo\", \"albedo\"]", &["the step draws to `albedo` twice", "11:13"]);
    one(ron, "targets: [\"albedo\"], depth: \"depth\"", "targets: []", &["the step draws to nothing", "11:13"]);
    one(
        ron,
        "\"depth\": Texture(format: Depth32Float,",
        "\"depth\": Texture(format: Depth32Float, optional: true,",
        &["`depth` cannot be drawn to", "11:119"],
    );
    one(
        ron,
        "\"depth\": Texture(format: Depth32Float,",
        "\"depth\": Texture(",
        &["an output texture needs a format", "9:18", "`format: …`"],
    );
    one(
        "shaders/draw/scene.wgsl",
        "index: u32)",
        "index: u32, @location(0) x: f32)",
        &["`vs` cannot be used in a node", "scene.wgsl:9:4", "no vertex attributes"],
    );
    one(
        RON,
        "steps: [",
        "requires: [\"FLOAT32_FILTERABL\"], steps: [",
        &["there is no device feature `FLOAT32_FILTERABL`", "14:16", "`FLOAT32_FILTERABLE`"],
    );
}

#[test]
fn conditions_of_ports_test_the_node_s_own_parameters() {
    let when = |condition: &str| format!("\"view\": Uniform(of: \"View\", when: {condition}, doc: \"the camera\")");
    let view = "\"view\": Uniform(of: \"View\", doc: \"the camera\")";
    let fault = |condition: &str, parts: &[&str]| one(RON, view, &when(condition), parts);
    assert_eq!(registry_faults(&with(RON, view, &when("All([Is(\"mode\", \"sum\"), Below(\"strength\", 1.5)])"))), "");
    fault("Is(\"mod\", \"sum\")", &["this node has no parameter `mod`", "paint.ron:4:46", "did you mean `mode`?"]);
    fault("Is(\"mode\", \"some\")", &["`mode` has no option `some`", "paint.ron:4:54", "did you mean `sum`?"]);
    fault("Not(IsOn(\"mode\"))", &["`mode` is Choice", "paint.ron:4:52", "write Is(\"parameter\", \"option\")"]);
    fault("Is(\"strength\", \"1\")", &["`strength` is Float", "paint.ron:4:46", "AtLeast(\"parameter\", n)"]);
    fault("Feature(\"glossy\")", &["a port depends on the node's own parameters only", "paint.ron:4:43", "in a pipeline"]);
    fault("Iss(\"mode\", \"sum\")", &["unknown condition `Iss`", "paint.ron:4:43"]);
    let output = "\"cells\": Buffer(of: \"Cell\", doc: \"cells\")";
    let with_condition = "\"cells\": Buffer(of: \"Cell\", when: Is(\"mode\", \"sum\"), doc: \"cells\")";
    one(RON, output, with_condition, &["an output has no condition of its own", "paint.ron:8:43", "write `optional: true`"]);
}

#[test]
fn filtering_32_bit_floats_needs_a_feature() {
    let wgsl = "shaders/post/blur.wgsl";
    let files = with(wgsl, "textureLoad(mask, vec2i(id.xy), 0)", "textureSampleLevel(mask, linear_sampler, vec2f(0.5), 0.0)");
    let files = edit(files, wgsl, "@compute", "@group(0) @binding(4) var linear_sampler: sampler;\n@compute");
    assert_faults(&registry_faults(&files), 1, &["it is sampled with a filter", "blur.wgsl:4:27", "FLOAT32_FILTERABLE"]);
    let allowed = edit(files.clone(), "shaders/post/blur.ron", "steps: [", "requires: [\"FLOAT32_FILTERABLE\"], steps: [");
    assert_faults(&registry_faults(&allowed), 0, &[]);
    let nearest: Files = files.into_iter().map(|(name, text)| (name, text.replace("linear_sampler", "nearest_sampler"))).collect();
    assert_faults(&registry_faults(&nearest), 0, &[]);
}

#[test]
fn all_faults_of_a_file_come_at_once_in_order() {
    let files = with(RON, VIEW, "\"view\": Unifrm(of: \"View\", doc: \"x\")");
    let files = edit(files, RON, "Texture(format: Rgba16Float", "Texture(format: Rgba16Flaot");
    let files = edit(files, RON, "over: Texels(\"picture\")", "over: Texel(\"picture\")");
    let rendered = registry_faults(&files);
    let places: Vec<_> = rendered.lines().filter(|l| l.contains("-->")).map(|l| l.rsplit_once("paint.ron:").unwrap().1).collect();
    assert_eq!(places, ["4:17", "7:36", "16:32"], "{rendered}");
}

#[test]
fn ports_and_globals() {
    one(
        RON,
        VIEW,
        "\"vew\": Uniform(of: \"View\", doc: \"x\")",
        &["`view` is no port of this node", "paint.wgsl:15:36", "did you mean `vew`?"],
    );
    one(RON, &format!("{VIEW},"), "", &["`view` is no port of this node", "paint.wgsl:15:36", "paint.ron:1:1"]);
    one(RON, VIEW, "\"view\": Uniform(of: \"Viewer\", doc: \"x\")", &["the port is of `Viewer`, the shader of `View`"]);
    one(
        RON,
        VIEW,
        "\"view\": Buffer(of: \"View\", doc: \"x\")",
        &["the port is a storage buffer", "var<storage, read> view: array<View>;"],
    );
    one(
        RON,
        VIEW,
        &format!("{VIEW}, \"more\": Buffer(of: \"u32\", doc: \"x\")"),
        &["the shader does not use the port `more`", "paint.ron:4:57"],
    );
    one(
        RON,
        "Buffer(of: \"Cell\"",
        "Buffer(of: \"Cel\"",
        &["the port is of `Cel`, the shader of `Cell`", "paint.wgsl:17:48", "paint.ron:8:9"],
    );
    one(
        WGSL,
        "@group(0) @binding(3)",
        "@group(0) @binding(4) var s: sampler;\n@group(0) @binding(3)",
        &["`s` is no port", "paint.wgsl:17:27", "linear_sampler"],
    );
    one(WGSL, "@group(0) @binding(3)", "@group(4) @binding(3)", &["`cells` is in group 4", "paint.wgsl:17:48"]);
    let pyramid = "shaders/post/pyramid.wgsl";
    one(
        pyramid,
        "var<storage, read> cells",
        "var<storage, read_write> cells",
        &["`cells` does not fit its port: an input is not written", "3:48"],
    );
    let ron = "shaders/post/pyramid.ron";
    one(
        ron,
        ", repeat: Up(\"pyramid\")",
        "",
        &["`pyramid_coarser` exists only in a step with `repeat: Up(\"pyramid\")`", "pyramid.wgsl:6:27"],
    );
    let files = with("shaders/post/blur.wgsl", "var mask: texture_2d<f32>", "var mask: texture_2d<u32>");
    let files = edit(files, "shaders/post/blur.wgsl", "textureLoad(mask, vec2i(id.xy), 0)", "vec4f(textureLoad(mask, vec2i(id.xy), 0))");
    assert_faults(&registry_faults(&files), 1, &["R32Float does not read as unsigned integers", "blur.wgsl:4:27", "texture_2d<f32>"]);
}

#[test]
fn outputs_must_be_written_and_ports_used_by_a_step() {
    let rendered = registry_faults(&with(RON, "(entry: \"clear\", over: Elements(\"cells\")),", ""));
    assert_faults(
        &rendered,
        2,
        &["error: no step writes the output `cells`", "paint.ron:8:9", "warning: no step runs the entry point `clear`", "paint.wgsl:20:4"],
    );
    let rendered = registry_faults(&with(RON, "(entry: \"paint\", over: Texels(\"picture\")),", ""));
    assert_faults(
        &rendered,
        3,
        &["no step uses the port `view`", "no step uses the port `picture`", "no step runs the entry point `paint`"],
    );
}

#[test]
fn parameters() {
    one(
        RON,
        "\"strength\": Float",
        "\"strenght\": Float",
        &["`strength` is no parameter of this node", "paint.wgsl:4:5", "did you mean `strenght`?"],
    );
    one(
        RON,
        "Float(min: 0.0, max: 2.0, default: 1.0",
        "Int(min: 0, max: 2, default: 1",
        &["wrong type for a parameter of type Int", "4:5", "i32 or u32"],
    );
    one(RON, "\"sum\", \"mean\"", "\"sum\", \"min\"", &["an option `mean` that does not exist", "paint.wgsl:12:10", "did you mean `min`?"]);
    one(RON, "\"mode\":", "\"idle\": Bool(default: true, doc: \"x\"), \"mode\":", &["nothing uses the parameter `idle`", "paint.ron:12:9"]);
    one(RON, "\"mode\": Choice", "\"mod\": Choice", &["the override `mode_is_mean` is no parameter", "paint.wgsl:12:10"]);
    let blur = ("shaders/post/blur.wgsl", "shaders/post/blur.ron");
    let files = edit(with(blur.0, "radius: i32", "radius: u32"), blur.0, "params.radius", "i32(params.radius)");
    let files = edit(files, blur.1, "min: 1", "min: -1");
    assert_faults(&registry_faults(&files), 1, &["`radius` can be negative, and u32 cannot", "blur.wgsl:1:17", "declare it as i32"]);
}

#[test]
fn entry_points() {
    one(RON, "entry: \"paint\"", "entry: \"pant\"", &["no compute entry point `pant`", "paint.ron:16:17", "did you mean `paint`?"]);
    one(RON, "over: Texels(\"picture\")", "over: Elements(\"cells\")", &["`paint` runs over elements, in one dimension", "16:32", "8×8×1"]);
    one(
        "shaders/draw/scene.ron",
        "fragment: \"fs\"",
        "fragment: \"vs\"",
        &["`vs` is a vertex entry point, and this step needs a fragment one", "11:42"],
    );
    one(
        "shaders/draw/scene.ron",
        "targets: [\"albedo\"]",
        "targets: []",
        &["has 0 targets, and `fs` writes 1 locations", "scene.wgsl:14:4"],
    );
    let uint = with(
        "shaders/draw/scene.wgsl",
        "-> @location(0) vec4f {\n    return vec4f(1.0);",
        "-> @location(0) vec4u {\n    return vec4u(1u);",
    );
    assert_faults(
        &registry_faults(&uint),
        1,
        &["location 0 of `fs` writes unsigned integers, and `albedo` has the format Rgba16Float", "scene.wgsl:14:4"],
    );
}

#[test]
fn faults_of_wgsl_point_into_the_text_as_written() {
    // The line has imported names before the fault, which naga_oil makes longer.
    one(WGSL, "area(cells[0])", "area(cells[0]) + foo", &["no definition in scope for identifier: `foo`", "paint.wgsl:28:63"]);
    one(WGSL, "area(cells[0])", "area(cells[0]) +", &["expected expression, found \";\"", "paint.wgsl:28:62"]);
    one(WGSL, "area(cells[0])", "area(cells[0]) + 1u", &["Operation Add can't work with", "(of type u32)", "paint.wgsl:28:17"]);
    one(WGSL, "params.strength", "params.strenth", &["invalid field accessor `strenth`", "paint.wgsl:28:24"]);
    let crlf = with(WGSL, "area(cells[0])", "area(cells[0]) + foo");
    let crlf = crlf.into_iter().map(|(name, text)| (name, text.replace('\n', "\r\n"))).collect();
    assert_faults(&registry_faults(&crlf), 1, &["paint.wgsl:28:63"]);
}

#[test]
fn faults_of_imported_files_point_there_and_are_told_once() {
    // Two shaders import it.
    one(COMMON, "f32(cell.count)", "f32(cell.cout)", &["invalid field accessor `cout`", "shaders/common/cell.wgsl:7:21"]);
    let digits = edit(with(COMMON, "count: u32", "count2: u32"), COMMON, "cell.count", "cell.count2");
    assert_faults(
        &registry_faults(&digits),
        1,
        &["the name `count2` cannot be shared between files", "shaders/common/cell.wgsl:1", "must not end in a digit"],
    );
    one(WGSL, "@workgroup_size(64)", "@workgroup_size(100000)", &["Workgroup size is out of range", "paint.wgsl:19:10"]);
    one(COMMON, "struct Cell", "struc Cell", &["found \"struc\"", "cell.wgsl:1:1"]);
    one(COMMON, "fn area", "fnn area", &["found \"fnn\"", "cell.wgsl:6:1"]);
    one(COMMON, "fn area", "@compute fn area", &["shaders/common has no entry points", "cell.wgsl:6:1"]);
    let numbered = "@group(1) @binding(3) var<storage, read> cells: array<Cell>;\nfn area";
    one(COMMON, "fn area", numbered, &["does not number its globals", "cell.wgsl:6:11", "write `@group(1) @binding(auto)`"]);
    let own = "@group(1) @binding(auto) var<uniform> params: Cell;\nfn area";
    one(COMMON, "fn area", own, &["`params` are a node's own", "cell.wgsl:6:39"]);
    one(COMMON, "fn area", "override k: u32;\nfn area", &["no overrides, and `k` is one", "cell.wgsl:6:10"]);
    one(COMMON, "fn area", "#define_import_path x\nfn area", &["`#define_import_path` is not used here", "cell.wgsl:6:1"]);
}

/// A file of shaders/common with a global that one of its functions reads.
fn with_imported_global() -> Files {
    let files = add(
        files(),
        "shaders/common/light.wgsl",
        "@group(1) @binding(auto) var<storage, read> lights: array<vec4f>;\nfn first() -> f32 {\n    return lights[0].x;\n}\nfn two() -> f32 {\n    return 2.0;\n}\n",
    );
    let files = edit(
        files,
        WGSL,
        "#import common::cell::{Cell, area}\n",
        "#import common::cell::{Cell, area}\n#import common::light::{first, two}\n",
    );
    let files = edit(files, WGSL, "params.strength * view.far", "first() * params.strength * view.far");
    edit(files, RON, VIEW, &format!("{VIEW}, \"lights\": Buffer(of: \"vec4f\", doc: \"x\")"))
}

#[test]
fn imported_globals_are_ports_by_their_plain_names() {
    let files = with_imported_global();
    let (registry, faults) = registry(&files, &[]);
    assert!(faults.is_empty(), "{faults}");
    let shader = registry.nodes["draw/paint"].shader.as_ref().expect("a shader");
    let light = shader.globals.iter().find(|g| g.name == "lights").expect("the imported global");
    assert_eq!((light.group, light.module.as_deref()), (1, Some("common::light")));
    assert_eq!((light.span.source.name.as_str(), light.span.text()), ("shaders/common/light.wgsl", "lights"));
    // The first step clears cells and reads no light.
    let entry = |name: &str| shader.entries.iter().find(|e| e.name == name).expect("an entry point");
    let uses = |name: &str| entry(name).uses.iter().any(|(global, _)| shader.globals[*global].name == "lights");
    assert_eq!((uses("clear"), uses("paint")), (false, true));
    // Who reaches nothing that reads it needs no port.
    let files = edit(files, WGSL, "first() *", "two() *");
    let files = edit(files, RON, ", \"lights\": Buffer(of: \"vec4f\", doc: \"x\")", "");
    assert_faults(&registry_faults(&files), 0, &[]);
}

#[test]
fn globals_of_two_imported_files_have_different_numbers() {
    let files = add(
        with_imported_global(),
        "shaders/common/mass.wgsl",
        "@group(1) @binding(auto) var<uniform> mass: vec4f;\nfn weight() -> f32 {\n    return mass.x;\n}\n",
    );
    let files = edit(files, WGSL, "#import common::light", "#import common::mass::weight\n#import common::light");
    let files = edit(files, WGSL, "first() *", "weight() * first() *");
    let files = edit(files, RON, VIEW, &format!("{VIEW}, \"mass\": Uniform(of: \"vec4f\", doc: \"x\")"));
    let (registry, faults) = registry(&files, &[]);
    assert!(faults.is_empty(), "{faults}");
    let shader = registry.nodes["draw/paint"].shader.as_ref().expect("a shader");
    let mut numbers: Vec<_> = shader.globals.iter().map(|g| (g.group, g.binding)).collect();
    numbers.sort_unstable();
    numbers.dedup();
    assert_eq!(numbers.len(), shader.globals.len());
}

#[test]
fn faults_of_imported_globals_show_the_node_and_the_file() {
    let files = with_imported_global();
    let rendered = registry_faults(&edit(files.clone(), RON, ", \"lights\": Buffer(of: \"vec4f\", doc: \"x\")", ""));
    assert_faults(
        &rendered,
        1,
        &[
            "`lights`, which `common::light` reads, is no port of this node",
            "paint.ron:1:1",
            "paint.wgsl:2:25",
            "imported here",
            "shaders/common/light.wgsl:1:45",
            "declared here",
        ],
    );
    assert_faults(&rendered, 1, &["Add `\"lights\": Buffer(of: \"vec4f\", doc: \"…\")` to the node's inputs"]);
    let misspelt = edit(files.clone(), RON, "\"lights\": Buffer", "\"light\": Buffer");
    assert_faults(&registry_faults(&misspelt), 1, &["`lights`, which `common::light` reads", "did you mean `light`?"]);
    let other = edit(files.clone(), RON, "Buffer(of: \"vec4f\"", "Buffer(of: \"vec3f\"");
    assert_faults(&registry_faults(&other), 1, &["the port is of `vec3f`, the shader of `vec4f`", "light.wgsl:1:45", "paint.ron:4:"]);
    let written = edit(files.clone(), "shaders/common/light.wgsl", "<storage, read>", "<storage, read_write>");
    let written = edit(written, RON, ", \"lights\": Buffer(of: \"vec4f\", doc: \"x\")", "");
    let written = edit(written, RON, "outputs: {", "outputs: { \"lights\": Buffer(of: \"vec4f\", doc: \"x\"),");
    let written = edit(written, "shaders/common/light.wgsl", "return lights[0].x", "lights[0].x = 1.0; return lights[0].x");
    assert_faults(&registry_faults(&written), 1, &["`lights` is written in a file of shaders/common", "light.wgsl:1:"]);
    let twice = "@group(0) @binding(9) var<storage, read> lights: array<vec4f>;\n@group(0) @binding(3)";
    let twice = edit(files.clone(), WGSL, "@group(0) @binding(3)", twice);
    let twice = edit(twice, WGSL, "first() *", "lights[0].y * first() *");
    assert_faults(
        &registry_faults(&twice),
        1,
        &["`lights` is declared twice", "paint.wgsl:18:", "light.wgsl:1:45", "`common::light::lights`"],
    );
    let sampler = "@group(1) @binding(auto) var odd: sampler;\n@group(1) @binding(auto) var map: texture_2d<f32>;\nfn two() -> f32 {";
    let sampler = edit(files.clone(), "shaders/common/light.wgsl", "fn two() -> f32 {", sampler);
    let sampler = edit(sampler, "shaders/common/light.wgsl", "return 2.0;", "return textureSampleLevel(map, odd, vec2f(0.5), 0.0).x;");
    let sampler = edit(sampler, WGSL, "first() *", "two() * first() *");
    let sampler = edit(sampler, RON, VIEW, &format!("{VIEW}, \"map\": Texture(doc: \"x\")"));
    assert_faults(&registry_faults(&sampler), 1, &["`odd` is no port of this node", "light.wgsl:5:30", "linear_sampler"]);
    let group = edit(files, WGSL, "@group(0) @binding(3)", "@group(1) @binding(3)");
    assert_faults(
        &registry_faults(&group),
        1,
        &["group 1 belongs to what imported files declare", "paint.wgsl:18:48", "use another `@group`"],
    );
}

#[test]
fn imports() {
    one(
        WGSL,
        "common::cell::{",
        "common::cel::{",
        &["there is no module `common::cel`", "paint.wgsl:1:23", "did you mean `common::cell`?"],
    );
    one(WGSL, "{Cell, area}", "{Cell, aera}", &["`common::cell` has no item `aera`", "paint.wgsl:1:30", "did you mean `area`?"]);
    one(WGSL, "{Cell, area}", "{Cell, area", &["the import's `{` is never closed", "paint.wgsl:1:23"]);
    let files = add(
        with(COMMON, "struct Cell", "#import common::other::f\nstruct Cell"),
        "shaders/common/other.wgsl",
        "#import common::cell\nfn f() {}\n",
    );
    let rendered = registry_faults(&files);
    assert_faults(
        &rendered,
        1,
        &["modules import each other in a circle: common::cell → common::other → common::cell", "cell.wgsl:1:9", "other.wgsl:1:9"],
    );
}

#[test]
fn modules_of_common_import_each_other_in_any_order_of_names() {
    let files = add(
        with(COMMON, "f32(cell.count)", "zoom::twice(f32(cell.count))"),
        "shaders/common/zoom.wgsl",
        "#import common::aid::one\nfn twice(x: f32) -> f32 { return x * 2.0 * one(); }\n",
    );
    let files = add(
        edit(files, COMMON, "struct Cell", "#import common::zoom\nstruct Cell"),
        "shaders/common/aid.wgsl",
        "fn one() -> f32 { return 1.0; }\n",
    );
    let (registry, faults) = registry(&files, &[]);
    assert!(faults.is_empty(), "{faults}");
    let shader = registry.nodes["draw/paint"].shader.as_ref().unwrap();
    assert_eq!(shader.imports, ["shaders/common/aid.wgsl", "shaders/common/cell.wgsl", "shaders/common/zoom.wgsl"]);
}

#[test]
fn partners() {
    let mut files = files();
    files.retain(|(name, _)| name != WGSL);
    assert_faults(&registry_faults(&files), 1, &["`shaders/draw/paint.ron` has no partner `shaders/draw/paint.wgsl`", "paint.ron:1:1"]);
    let mut files = crate::kit::files();
    files.retain(|(name, _)| name != RON);
    assert_faults(&registry_faults(&files), 1, &["`shaders/draw/paint.wgsl` has no partner `shaders/draw/paint.ron`", "paint.wgsl:1:1"]);
    let files = add(crate::kit::files(), "shaders/lone.ron", "Node(doc: \"x\")");
    assert_faults(&registry_faults(&files), 1, &["`shaders/lone.ron` lies in no stage's folder"]);
}

#[test]
fn a_structure_has_one_layout() {
    let files = with("shaders/draw/scene.wgsl", "origin: vec3f,\n    far: f32,", "origin: vec3f,\n    near: f32,");
    assert_faults(
        &registry_faults(&files),
        1,
        &["`View` differs from that of the node `draw/paint`: member 1 is `near` instead of `far`", "scene.wgsl:1:8", "paint.wgsl:7:8"],
    );
}

/// Drivers crash when an invocation has no room for its variables.
#[test]
fn memory_that_an_invocation_cannot_have_is_refused_at_its_place() {
    let main = "fn main(@builtin(global_invocation_id) id: vec3u) {";
    let own = with("shaders/post/blur.wgsl", main, &format!("{main}\n    var huge: array<vec4f, 16777216>;\n    huge[id.x] = vec4f(1.0);"));
    assert_faults(
        &registry_faults(&own),
        1,
        &["`main` cannot be used in a node", "268435456 bytes", "put them into a buffer", "blur.wgsl:"],
    );
    let called =
        "fn much(i: u32) -> f32 {\n    var huge: array<f32, 65536>;\n    return huge[i];\n}\n\n@compute @workgroup_size(8, 8)\nfn main(";
    let called = with("shaders/post/blur.wgsl", "@compute @workgroup_size(8, 8)\nfn main(", called);
    assert_faults(&registry_faults(&called), 1, &["`much` cannot be used in a node", "262144 bytes", "blur.wgsl:"]);
    let private = with("shaders/post/blur.wgsl", "@compute", "var<private> huge: array<f32, 65536>;\n\n@compute");
    let private = {
        let mut files = private;
        let (_, text) = files.iter_mut().find(|(name, _)| name == "shaders/post/blur.wgsl").unwrap();
        *text = text.replace(main, &format!("{main}\n    huge[id.x] = 1.0;"));
        files
    };
    assert_faults(&registry_faults(&private), 1, &["`main` cannot be used in a node", "262144 bytes"]);
}
