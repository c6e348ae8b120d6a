//! Faults of pipelines: message, place, remedy, and nothing that only follows.

use crate::kit::*;

const FILE: &str = "pipelines/test.ron";
const SHOW_IN: &str = "in: {\"source\": \"blurred\"}";
const SHOW_OUT: &str = "out: {\"blurred\": \"result\"}";
const SHOW_PARAMS: &str = "params: {\"radius\": 1}";
const PICTURE: &str = "\"picture\": Texture(format: Rgba16Float, size: Output)";
const COUNT: &str = "count: Mul([Param(\"count\"), 2])";
const SOFT_IN: &str = "in: {\"source\": \"picture\", \"mask\": \"pyramid\"}";
const HARD_WHEN: &str = "when: Not(IsOn(\"blur\"))";
const PLAIN: &str = "Is(\"kind\", \"plain\")";

#[track_caller]
fn one(from: &str, to: &str, parts: &[&str]) {
    assert_faults(&check_faults(&with(FILE, from, to)), 1, parts);
}

#[test]
fn names_of_fields_nodes_ports_and_resources() {
    one(
        "presents: \"result\"",
        "presnts: \"result\"",
        &["unknown field `presnts` in Pipeline", "test.ron:26:5", "did you mean `presents`?"],
    );
    one("presents: \"result\",", "", &["missing field `presents` in Pipeline", "test.ron:1:1"]);
    one("presents: \"result\"", "presents: \"reslt\"", &["there is no resource `reslt`", "26:15", "`result`"]);
    one("presents: \"result\"", "presents: \"cells\"", &["`presents` names a texture, and `cells` is a buffer", "26:15", "13 |"]);
    one("Pipeline(", "Pipelin(", &["expected `Pipeline(…)` or `Stage(…)`, found `Pipelin(…)`", "test.ron:1:1"]);
    one("node: \"post/pyramid\"", "node: \"post/pyramd\"", &["there is no node `post/pyramd`", "22:31", "did you mean `post/pyramid`?"]);
    one("(id: \"scene\", node", "(id: \"scene\", nod", &["unknown field `nod` in a node", "20:23", "`node`"]);
    one(SHOW_IN, "in: {\"sorce\": \"blurred\"}", &["`post/blur` has no input `sorce`", "19:46", "did you mean `source`?"]);
    one(SHOW_IN, "inn: {\"source\": \"blurred\"}", &["unknown field `inn` in a node", "19:41", "`in`"]);
    one(SHOW_OUT, "out: {\"blured\": \"result\"}", &["`post/blur` has no output `blured`", "19:74", "did you mean `blurred`?"]);
    one(SHOW_OUT, "out: {\"source\": \"result\"}", &["`source` is an input of `post/blur`", "19:74", "blur.ron:3:15", "move it to `in`"]);
    one(SHOW_IN, "in: {\"source\": \"blured\"}", &["there is no resource `blured`", "19:56", "did you mean `blurred`?"]);
    one(SHOW_OUT, "out: {\"blurred\": Previous(\"result\")}", &["cannot write the last frame's value", "19:85"]);
    one("\"picture\": Texture(", "\"pic.ture\": Texture(", &["`pic.ture` is no name for a resource", "12:9"]);
    one("(id: \"pyramid\"", "(id: \"paint\"", &["there are two nodes `paint`", "22:14", "21 |"]);
    one(PICTURE, &format!("{PICTURE}, {PICTURE}"), &["`picture` is given twice", "12:64", "first given here"]);
    one(
        "\"pyramid\": Texture",
        "\"scene_camera\": Texture(format: R32Float, size: Output), \"pyramid\": Texture",
        &["`scene_camera` is the name of scene data"],
    );
}

#[test]
fn types_and_formats() {
    one(
        SHOW_IN,
        "in: {\"source\": \"cells\"}",
        &["`cells` does not fit the input `source` of `show`: it is a buffer of `Cell`, not a texture", "19:56", "13 |", "blur.ron:3:15"],
    );
    one(PICTURE, &PICTURE.replace("Rgba16Float", "Rgba16Flat"), &["unknown format `Rgba16Flat`", "12:36", "`Rgba16Float`"]);
    one(
        PICTURE,
        &PICTURE.replace("Rgba16Float", "Rgba8Unorm"),
        &["`picture` does not fit the output `picture` of `paint`", "it has the format Rgba8Unorm, not Rgba16Float", "21:14"],
    );
    one(
        "source\": \"albedo\"",
        "source\": \"depth\", \"mask\": \"picture\"",
        &["`picture` does not fit the input `mask` of `hard`: it has the format Rgba16Float, not R32Float"],
    );
    one("of: \"Cell\"", "of: \"Cel\"", &["no shader of a node has the type `Cel`", "13:9", "did you mean `Cell`?"]);
    one(
        "in: {\"view\": \"scene_camera\"}, params",
        "params",
        &["the input `view` of `paint` is not connected", "21:14", "paint.ron:4:9", "add `\"view\": \"resource\"` to `in`"],
    );
    one(
        "in: {\"view\": \"scene_camera\"}, params",
        "in: {\"view\": \"scene_camra\"}, params",
        &["there is no resource `scene_camra`", "21:56", "`scene_camera`"],
    );
    one(
        "in: {\"view\": \"scene_camera\"}, params",
        "in: {\"view\": \"scene_triangles\"}, params",
        &["it is a buffer of `u32`, not a uniform `View`", "21:56"],
    );
}

#[test]
fn an_output_must_be_connected() {
    let rendered = check_faults(&with(FILE, "\"pyramid\": Texture(format: R32Float, size: OutputScaled(1, 2), mips: Full),\n", ""));
    assert_faults(
        &rendered,
        2,
        &["the output `pyramid` of `pyramid` is not connected", "21:14", "there is no resource `pyramid`", "22:75"],
    );
    one(SHOW_OUT, "out: {\"blurred\": \"scene_camera\"}", &["`scene_camera` is scene data and cannot be written", "19:85"]);
}

#[test]
fn parameters() {
    one(SHOW_PARAMS, "params: {\"radus\": 1}", &["`post/blur` has no parameter `radus`", "19:105", "did you mean `radius`?"]);
    one(
        SHOW_PARAMS,
        "params: {\"radius\": 100}",
        &["100 is no value of the parameter `radius`", "19:115", "blur.ron:5:15", "a whole number from 1 to 64"],
    );
    one(SHOW_PARAMS, "params: {\"radius\": 1.5}", &["1.5 is no value of the parameter `radius`", "19:115"]);
    one(SHOW_PARAMS, "params: {\"radius\": Param(\"coun\")}", &["the pipeline has no parameter `coun`", "19:115", "did you mean `count`?"]);
    one(
        SHOW_PARAMS,
        "params: {\"radius\": Param(\"count\")}",
        &["parameter `count` does not fit `radius` of node `show`: its range 1 to 4096 is wider than 1 to 64", "19:115", " 5 |"],
    );
    one(SHOW_PARAMS, "params: {\"radius\": Param(\"kind\")}", &["it is Choice, not Int"]);
    one("default: 100, doc", "default: 10000, doc", &["the default 10000 of `count` is not allowed", "5:50", "from 1 to 4096"]);
    one("default: 100, doc", "defalt: 100, doc", &["unknown field `defalt` in Int", "5:41", "`default`"]);
    one("min: 1, max: 4096", "min: 5000, max: 4096", &["the range is empty: max 4096 is below min 5000", "5:38"]);
    one("default: \"plain\"", "default: \"plane\"", &["the default \"plane\" of `kind` is not allowed", "7:63", "did you mean `plain`?"]);
    one(
        "params: {\"strength\": 0.5}",
        "params: {\"mode\": \"men\"}",
        &["\"men\" is no value of the parameter `mode`", "did you mean `mean`?"],
    );
}

#[test]
fn a_parameter_of_the_same_name_must_fit() {
    let rendered = check_faults(&with(FILE, "\"radius\": Int(min: 1, max: 32", "\"radius\": Int(min: 0, max: 32"));
    assert_faults(
        &rendered,
        2,
        &["parameter `radius` does not fit `radius` of node `soft`: its range 0 to 32 is wider than 1 to 64", "6:9", "24:86"],
    );
}

#[test]
fn presets() {
    let set = "set: {\"cont\": 1, \"count\": 0, \"paint.strenth\": 1, \"pint.strength\": 1, \"paint.strength\": 3.0, \"radius\": 5},";
    let rendered = check_faults(&with(FILE, "    params: {", &format!("    {set}\n    params: {{")));
    let parts = [
        "the pipeline `test` has no parameter `cont`",
        "3:11",
        "`0` is no value of `count`",
        "3:31",
        "the node `paint` (draw/paint) has no parameter `strenth`",
        "3:34",
        "the pipeline `test` has no node `pint`",
        "3:54",
        "`3.0` is no value of `paint.strength`",
        "3:92",
        "a number from 0.0 to 2.0",
    ];
    assert_faults(&rendered, 5, &parts);
}

#[test]
fn conditions() {
    one(PLAIN, "Is(\"kind\", \"plan\")", &["`kind` has no option `plan`", "23:128", "did you mean `plain`?"]);
    one(PLAIN, "Is(\"knd\", \"plain\")", &["the pipeline has no parameter `knd`", "23:120", "`kind`"]);
    one(PLAIN, "IsOn(\"kind\")", &["`IsOn` tests a Bool, and `kind` is Choice", "23:122", " 7 |", "Is(\"parameter\", \"option\")"]);
    one(PLAIN, "AtLeast(\"blur\", 3)", &["`AtLeast` tests a number, and `blur` is Bool", "23:125"]);
    one(PLAIN, "Iss(\"kind\")", &["unknown condition `Iss`", "23:117", "did you mean `Is`?"]);
    one(PLAIN, "Is(\"kind\")", &["`Is` is not used like this", "23:117", "write `Is(\"parameter\", \"option\")`"]);
    one(PLAIN, "Feature(\"texture\")", &["there is no scene feature `texture`", "23:125", "did you mean `textures`?"]);
}

#[test]
fn conditions_must_leave_one_producer() {
    one(
        PLAIN,
        "AtLeast(\"count\", 200)",
        &[
            "`blurred` is read, but not written in this frame: node `soft`, which writes it, is off: `count` is 100, below 200; `kind` is not `masked` but `plain`; \
         node `hard`, which writes it, is off: `blur` is on",
            "19:56",
            "`show` reads it",
            "the condition of `soft`",
        ],
    );
    let rendered = check_faults(&with(FILE, HARD_WHEN, "when: IsOn(\"blur\")"));
    assert_faults(&rendered, 2, &["`blurred` is written by two nodes: `soft` and `hard`", "24:14", "23 |", "(when `blur` is `false`)"]);
    let rendered = check_faults(&with(FILE, HARD_WHEN, "when: Not(Feature(\"glossy\"))"));
    assert_faults(
        &rendered,
        2,
        &["`soft` and `hard` (when the scene has no special features)", "the scene has `glossy` (when `blur` is `false`)"],
    );
}

#[test]
fn cycles_name_the_nodes_in_order() {
    one(
        SOFT_IN,
        "in: {\"source\": \"result\", \"mask\": \"pyramid\"}",
        &[
            "nodes wait for each other in a cycle: show → soft → show",
            "23:56",
            "`show` reads `blurred`, which `soft` writes",
            "`soft` reads `result`, which `show` writes",
            "Previous",
        ],
    );
    one(SOFT_IN, "in: {\"source\": \"blurred\", \"mask\": \"pyramid\"}", &["node `soft` reads what it writes itself", "23:56"]);
    // Another fault does not hide it.
    let files =
        edit(with(FILE, SOFT_IN, "in: {\"source\": \"result\", \"mask\": \"pyramid\"}"), FILE, "{\"strength\": 0.5}", "{\"strenth\": 0.5}");
    assert_faults(&check_faults(&files), 2, &["cycle: show → soft → show", "has no parameter `strenth`"]);
}

#[test]
fn the_last_frame_needs_history_and_makes_no_cycle() {
    one(
        SOFT_IN,
        "in: {\"source\": Previous(\"picture\"), \"mask\": \"pyramid\"}",
        &["`picture` is not kept from frame to frame", "23:65", "12 |", "`history: true`"],
    );
    let files = with(FILE, SOFT_IN, "in: {\"source\": Previous(\"result\"), \"mask\": \"pyramid\"}");
    let files = edit(files, FILE, "size: Like(\"blurred\")", "size: Like(\"blurred\"), history: true");
    assert_faults(&check_faults(&files), 0, &[]);
}

#[test]
fn a_resource_that_no_node_writes() {
    let files = with(FILE, PICTURE, &format!("{PICTURE}, \"lost\": Texture(format: Rgba16Float, size: Output)"));
    assert_faults(&check_faults(&files), 1, &["warning: nothing uses the resource `lost`", "12:64"]);
    let files = edit(files, FILE, SHOW_IN, "in: {\"source\": \"lost\"}");
    assert_faults(
        &check_faults(&files),
        1,
        &["`lost` is read before it is written: no node writes it", "19:56", "read by the input `source` of `show`", "12 |"],
    );
}

#[test]
fn sizes() {
    one(PICTURE, &PICTURE.replace("Output", "Outptu"), &["unknown size `Outptu`", "12:55", "did you mean `Output`?"]);
    one(PICTURE, &PICTURE.replace("Output", "Like(\"pictur\")"), &["there is no resource `pictur`", "12:60", "`picture`"]);
    one(PICTURE, &PICTURE.replace("Output", "Like(\"cells\")"), &["`cells` is a buffer", "12:60", "Elements"]);
    one(PICTURE, &PICTURE.replace("Output", "Like(\"picture\")"), &["the size of `picture` depends on itself: picture → picture", "12:60"]);
    one(PICTURE, &PICTURE.replace("Output", "Fixed(0, 4)"), &["the texture `picture` has no texels: 0×4", "12:61"]);
    one(
        PICTURE,
        &PICTURE.replace("Output", "Fixed(4, 20000)"),
        &["the texture `picture` is too large: 4×20000 texels, more than 16384 a side", "12:64"],
    );
    one(
        PICTURE,
        &PICTURE.replace("Output", "Size(Param(\"count\"), Mul([100, Param(\"count\")]))"),
        &["too large: 4096×409600 texels", "(when `count` is `4096`)", "12:76", "lower the parameter `count` (now 4096)"],
    );
    one(
        COUNT,
        "count: Mul([Param(\"count\"), 20000000])",
        &[
            "the buffer `cells` is too large: 2000000000 elements of 16 bytes are 32000000000 bytes",
            "13:44",
            "lower the parameter `count` (now 100)",
        ],
    );
    one(
        COUNT,
        "count: Mul([Param(\"count\"), 4611686018427387904, 16])",
        &["the number of elements of `cells` cannot be computed: the result does not fit in 64 bits", "13:44"],
    );
    one(COUNT, "count: Div(Param(\"count\"), 0)", &["cannot be computed: division by zero", "13:44"]);
    one(COUNT, "count: Div(3)", &["`Div` takes two expressions", "13:44", "write `Div(a, b)`"]);
    one(COUNT, "count: Div(3, Param(\"cout\"))", &["no parameter `cout`", "13:57", "`count`"]);
    one(COUNT, "count: DivCeil(Param(\"count\"), 0)", &["cannot be computed: division by zero", "13:44"]);
    one(COUNT, "count: Mul([Param(\"count\"), -1])", &["sizes and counts are not negative", "13:65"]);
    one(COUNT, "count: Mul(Param(\"count\"))", &["expected a list of expressions", "13:48"]);
    one(COUNT, "count: Param(\"blur\")", &["parameter `blur` is Bool, and sizes need Int", "13:50"]);
    one(COUNT, "count: Parm(\"count\")", &["unknown expression `Parm`", "13:44", "`Param`"]);
    one("mips: Full", "mips: Count(12)", &["the texture `pyramid` cannot have 12 mip levels: 960×540 texels have 1 to 10", "14:84"]);
    one(
        ", mips: Full",
        "",
        &["warning: `pyramid` works on the mip levels of `pyramid`, which has only one", "22:14", "14 |", "`mips: Full`"],
    );
    one("mips: Full", "mips: 4", &["expected mip levels, found a number", "14:78", "write `Count(4)` or `Full`"]);
}

#[test]
fn faults_of_text_and_meaning_come_together_and_in_order() {
    let files = with(FILE, PICTURE, &PICTURE.replace("Rgba16Float", "Rgba16Flat"));
    let files = edit(files, FILE, "default: 100, doc", "defalt: 100, doc");
    let files = edit(files, FILE, SHOW_PARAMS, "params: {\"radus\": 1}");
    let files = edit(files, FILE, "(id: \"pyramid\", node", "(id: \"pyramid\", nod");
    let files = edit(files, FILE, PLAIN, "Is(\"kind\", \"plan\")");
    let rendered = check_faults(&files);
    let places: Vec<_> = rendered.lines().filter_map(|l| l.split_once("--> pipelines/test.ron:")).map(|(_, place)| place).collect();
    assert_eq!(places, ["5:41", "12:36", "19:105", "22:25", "23:128"], "{rendered}");
}

#[test]
fn faults_as_json() {
    let (registry, _) = registry(&files(), &[]);
    let library = library(&with(FILE, SHOW_PARAMS, "params: {\"radus\": 1}"));
    let json = manylight_graph::check::check_file(&library, "test", &registry).to_json();
    assert_eq!(json[0]["severity"], "error");
    assert_eq!(json[0]["labels"][0]["file"], "pipelines/test.ron");
    assert_eq!((&json[0]["labels"][0]["line"], &json[0]["labels"][0]["column"]), (&19.into(), &105.into()));
    assert_eq!(json[0]["help"], "did you mean `radius`?");
}
