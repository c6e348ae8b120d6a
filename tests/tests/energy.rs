//! Energy is kept from stage to stage, and comes to what it must where that is known by thought.

use std::{f64::consts::PI, fs};

use manylight_graph::plan::Debug;

use crate::{
    matrix::documents_of_all_pipelines,
    records,
    renders::{Job, nothing_left_out, read, shows_baked_light},
    support::{project_with, root},
};

const WATCHED: Debug = Debug { watch_numbers: true, no_culling: false, no_reuse: false, poison: false, shuffle: None };

/// In a hollow sphere with a light in the middle all of the wall gets the same light, and what it reflects reaches all of the wall alike:
/// indirect light is albedo² I / (π R²) everywhere (integrating sphere). Disks of area A lose what lies in the A of d² / (d² + A / π): squared distances
/// between points of a sphere are evenly distributed, so that N lights lose ln(1 + N) / N.
#[test]
fn a_hollow_sphere_is_lit_evenly_by_each_pipeline() {
    const ALBEDO: f64 = 0.5;
    const RADIUS: f64 = 2.0;
    const INTENSITY: f64 = 3.0;
    // The sphere is 1280 triangles inside of it, nearer by up to 1.4 %, lights are few, and gathering takes few samples.
    const MEAN: f64 = 0.06;
    const SPREAD: f64 = 0.06;
    let folder = tempfile::tempdir().expect("temporary folder");
    let mesh = fs::read_to_string(root().join("assets/sphere.obj")).expect("readable");
    fs::write(folder.path().join("wall.obj"), mesh.replace("objects.mtl", "wall.mtl")).expect("writable");
    fs::write(folder.path().join("wall.mtl"), format!("newmtl ball\nKd {ALBEDO} {ALBEDO} {ALBEDO}\n")).expect("writable");
    let text = format!(
        "Scene(
            meshes: [Mesh(file: \"wall.obj\", transform: (scale: {RADIUS:?}))],
            camera: (origin: (1.1, 0.3, -0.2), target: (-2.0, 0.0, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 90.0),
            lights: [Point(position: (0.0, 0.0, 0.0), intensity: ({INTENSITY:?}, {INTENSITY:?}, {INTENSITY:?}))],
        )"
    );
    let scene = folder.path().join("sphere.ron");
    fs::write(&scene, text).expect("writable");
    let analytic = ALBEDO * ALBEDO * INTENSITY / (PI * RADIUS * RADIUS);
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for (pipeline, documents) in documents_of_all_pipelines() {
        let resources = &documents.pipeline().resources;
        // Baked light is of another scene; the reference has all light in one.
        if !resources.contains_key("indirect") || shows_baked_light(&documents) {
            continue;
        }
        let job =
            Job { pipeline: root().join(&pipeline).to_string_lossy().into_owned(), size: (48, 48), debug: WATCHED, ..Job::scene(&scene) };
        let job = job.frames(8).set("rsm_size", 64).keep(&["indirect"]);
        // A convex room calls for no shadows: that they take nothing is what is tested, of maps with few texels all the more.
        let mut set = nothing_left_out(documents.pipeline());
        set.extend(documents.pipeline().params.contains_key("ism_size").then(|| ("ism_size".to_owned(), "64".to_owned())));
        let renderer = set.iter().fold(job, |job, (name, value)| job.set(name, value)).render();
        let param = |name: &str| renderer.plan().params.iter().find(|(n, _)| n == name).map(|(_, value)| value.to_string());
        let lights =
            param("clusters").and_then(|n| n.parse::<f64>().ok()).filter(|_| param("lights").is_some_and(|kind| kind.contains("val")));
        let analytic = analytic * (1.0 - lights.map_or(0.0, |n| n.ln_1p() / n));
        let image = read(&renderer, "indirect");
        let values: Vec<f64> = image.data.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]].map(|v| f64::from(v) / analytic)).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let spread = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        println!("{pipeline}: mean {mean:.4}, spread {spread:.4} of the analytic value");
        if (mean - 1.0).abs() > MEAN || spread > SPREAD {
            faults.push(format!("{pipeline}: {mean:.4} ± {spread:.4} of {analytic}"));
        }
        rows.push(serde_json::json!({ "pipeline": pipeline, "mean": mean, "spread": spread }));
    }
    assert!(rows.len() > 5 && faults.is_empty(), "{}", faults.join("\n"));
    records::write("hollow_sphere", &rows);
}

#[test]
fn holes_filled_in_an_empty_map_hold_no_occluder() {
    for levels in 0..=4 {
        let map = read(&Job::asset("cornell").small().set("splat_factor", 0.0).set("pull_push", levels).keep(&["ism"]).render(), "ism");
        assert!(map.data.iter().all(|&v| v == 1.0), "{levels} levels fill an empty map with something");
    }
}

/// The filter is given the same light in each pixel: what it returns is that light on each surface, whatever it leaves out.
#[test]
fn the_filter_keeps_a_constant() {
    const LIGHT: f64 = 0.7;
    let merge = "Node(doc: \"The same light everywhere.\", inputs: { \"split_light\": Texture(format: Rgba32Float, doc: \"not read\") },
        outputs: { \"indirect_merged\": Texture(format: Rgba32Float, doc: \"W/m²\") }, steps: [(entry: \"merge\", over: Texels(\"indirect_merged\"))])";
    let shader = "@group(0) @binding(0) var split_light: texture_2d<f32>;
        @group(0) @binding(1) var indirect_merged: texture_storage_2d<rgba32float, write>;
        @compute @workgroup_size(8, 8) fn merge(@builtin(global_invocation_id) id: vec3u) {
            let nothing = 0.0 * textureLoad(split_light, vec2u(0u), 0);
            textureStore(indirect_merged, id.xy, nothing + vec4f(0.7));
        }";
    let pipeline =
        "Pipeline(doc: \"Acrsm with constant light.\", extends: \"acrsm.ron\", nodes: [(id: \"merge\", node: \"test/constant\")])";
    let project =
        project_with(&[("shaders/test/constant.ron", merge), ("shaders/test/constant.wgsl", shader), ("pipelines/constant.ron", pipeline)]);
    for tiles in [1, 3, 8] {
        let job = Job { root: project.path().to_owned(), pipeline: "constant".to_owned(), ..Job::asset("cornell").small() };
        let renderer = job.set("tiles", tiles).keep(&["indirect", "gbuffer_albedo"]).frames(1).render();
        let (light, albedo) = (read(&renderer, "indirect"), read(&renderer, "gbuffer_albedo"));
        let lit = |p: &[f32], a: &[f32]| [0, 1, 2].map(|i| f64::from(p[i]) - f64::from(a[i]) / PI * LIGHT);
        let worst =
            light.data.chunks_exact(4).zip(albedo.data.chunks_exact(4)).flat_map(|(p, a)| lit(p, a)).fold(0.0, |w: f64, d| w.max(d.abs()));
        // Of some hundred weights in 32 bits, and of a sum no larger than 0.3.
        assert!(worst < 1e-5, "{tiles}×{tiles} tiles: off by {worst}");
    }
}

#[test]
fn a_loss_of_energy_is_told_by_the_ledger() {
    let shader = fs::read_to_string(root().join("shaders/clustering/average.wgsl")).expect("readable");
    let sum = "cluster.flux = select(";
    assert!(shader.contains(sum), "the shader that is spoilt here has changed");
    let spoilt = |factor: &str| {
        let project =
            project_with(&[("shaders/clustering/average.wgsl", &shader.replace(sum, &format!("cluster.flux = {factor} * select(")))]);
        let job = Job { root: project.path().to_owned(), pipeline: "acrsm".to_owned(), debug: WATCHED, ..Job::asset("cornell").small() };
        job.keep(&["imbalance"]).renderer().render_frame(0.0).map_err(|e| e.to_string())
    };
    assert_eq!(spoilt("1.0"), Ok(()));
    let told = spoilt("0.99").expect_err("1 % of the energy is gone");
    assert!(told.contains("node `ledger` (ledger/balance) writes `imbalance`: element 0 is more than 0.001"), "{told}");
}
