//! Formulas that live in one node each, through the node itself on small inputs: tone mapping, the geometry-aware filter, the comparison of clusters,
//! tessellation factors, soft shadows from a map.

use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use glam::{DVec2, DVec3, Mat4, UVec2, Vec2, Vec3};
use half::f16;
use manylight_graph::value::Format;
use manylight_scene::gpu_data::{self, LightView, Object, SceneInfo, Triangle, Vertex};
use proptest::strategy::Strategy;

use super::{
    directions::basis,
    harness::{Outcome, Resource, Want, World, absolute, judge, relative},
    inputs::{Numbers, draw, magnitude, unit_vector},
    light::luminance,
    random::hash,
};

/// A number of [0, 1) that looks random.
fn noise(seed: u32) -> f64 {
    f64::from(hash(seed) >> 8) / f64::from(1 << 24)
}

fn pipeline(resources: &str, nodes: &str, presents: &str) -> String {
    format!("Pipeline(doc: \"One node.\", resources: {{{resources}}}, nodes: [{nodes}], presents: \"{presents}\")")
}

/// [REINHARD] eqs. 1, 2 and 4, and the curve of sRGB.
#[test]
fn tone_mapping_is_as_its_twin() {
    let limits = "steps of the screen, 1/255: half of one by rounding, the rest from exposure, whose logarithm has an error of 1e-5";
    let mut outcome = Outcome::new("tone/reinhard", absolute(0.6 / 255.0, limits));
    let pictures: Vec<(u32, u32, Box<dyn Fn(u32) -> DVec3>)> = vec![
        (16, 8, Box::new(|_| DVec3::ZERO)),
        (16, 8, Box::new(|i| if i == 77 { DVec3::new(5.0, 3.0, 1.0) } else { DVec3::ZERO })),
        (16, 8, Box::new(|i| if i == 77 { DVec3::splat(1e30) } else { DVec3::splat(0.1) })),
        (16, 8, Box::new(|_| DVec3::splat(1e30))),
        (16, 8, Box::new(|_| DVec3::new(1e30, 0.0, 0.0))),
        (16, 8, Box::new(|_| DVec3::splat(1e-29))),
        (1, 1, Box::new(|_| DVec3::splat(3.0))),
        (13, 7, Box::new(|i| DVec3::new(noise(i), noise(i + 500), noise(i + 1000)) * (10.0 * noise(i + 1500) - 5.0).exp())),
        (64, 64, Box::new(|i| DVec3::new(noise(i), noise(i + 9000), noise(i + 20_000)) * (60.0 * noise(i + 30_000) - 30.0).exp())),
    ];
    for (width, height, of) in pictures {
        let pixels: Vec<DVec3> = (0..width * height).map(|i| of(i).as_vec3().as_dvec3()).collect();
        let texels: Vec<f32> = pixels.iter().flat_map(|p| [p.x as f32, p.y as f32, p.z as f32, 1.0]).collect();
        let mut world = World::new(vec![Resource::texture("composed", Format::Rgba32Float, (width, height), &[texels])]);
        world.add_node("tone/luminance");
        world.add_node("tone/reinhard");
        let (w, h) = (width.next_power_of_two(), height.next_power_of_two());
        let resources = format!(
            "\"luminance\": Texture(format: Rg32Float, size: Fixed({w}, {h}), mips: Full), \"tonemapped\": Texture(format: Rgba8Unorm, size: Fixed({width}, {height}))"
        );
        let nodes = "(id: \"luminance\", node: \"tone/luminance\"), (id: \"tonemap\", node: \"tone/reinhard\")";
        world.add("pipelines/test.ron", &pipeline(&resources, nodes, "tonemapped"));
        let image = world.run("tone/reinhard", &[]).image("tonemapped");
        let lit: Vec<f64> = pixels.iter().map(|p| luminance(*p)).filter(|l| *l > 1e-30).map(f64::ln).collect();
        let mean = if lit.is_empty() { 0.0 } else { lit.iter().sum::<f64>() / lit.len() as f64 };
        for (pixel, got) in pixels.iter().zip(image.data.chunks_exact(4)) {
            let l = luminance(*pixel);
            let scaled = (0.18 * (l.max(1e-30).ln() - mean).exp()).min(1e15);
            let mapped = scaled * (1.0 + scaled / 16.0) / (1.0 + scaled);
            let curve = |c: f64| {
                let c = c.clamp(0.0, 1.0);
                if c <= 0.003_130_8 { 12.92 * c } else { 1.055 * c.powf(1.0 / 2.4) - 0.055 }
            };
            let wanted: Vec<Want> =
                if l > 1e-30 { (*pixel / l * mapped).to_array() } else { [0.0; 3] }.map(|c| Want::new(curve(c))).to_vec();
            let got: Vec<f64> = got[..3].iter().map(|v| f64::from(*v)).collect();
            outcome.add(&wanted, &got, || format!("{width}×{height}: {pixel:?}"));
        }
    }
    judge(vec![outcome]);
}

/// A code of a unit vector, with steps of 1/32767.
fn code(unit: DVec3) -> u32 {
    let p = unit / unit.abs().element_sum();
    assert!(unit.z >= 0.0, "the upper half is enough here");
    let part = |v: f64| (v * 32_767.0).round() as i16 as u16;
    match u32::from(part(p.x)) | u32::from(part(p.y)) << 16 {
        0 => 0x8000,
        code => code,
    }
}

/// [ACRSM] 5.3.3: neighbours on the same surface count.
#[test]
fn the_geometry_aware_filter_is_as_its_twin() {
    let directions = [DVec3::Z, DVec3::X, DVec3::new(0.5, 0.0, 0.75_f64.sqrt())];
    let mut outcomes = Vec::new();
    for (filter, name) in [("tent", "lighting/filter (tent)"), ("box", "lighting/filter (box)")] {
        let mut outcome = Outcome::new(name, relative(3e-6, "sums of up to 225 weighted terms of one sign"));
        // What of the surroundings is the same surface: all, none but the pixel itself, some; with and without holes.
        for (n, width, height, kind) in
            [(1, 5, 4, 2), (2, 8, 6, 0), (3, 9, 12, 1), (3, 11, 7, 2), (3, 12, 12, 3), (4, 16, 8, 3), (8, 9, 5, 2), (3, 1, 1, 0)]
        {
            let surface = |x: i64, y: i64| {
                let i = (x + 64 * y) as u32;
                let height = match kind {
                    0 => 0.0,
                    // Far from each other's planes.
                    1 => f64::from(i),
                    _ => f64::from(hash(i) % 2),
                };
                let normal = if kind == 0 { DVec3::Z } else { directions[hash(i + 7) as usize % 3] };
                let exists = kind < 3 || hash(i + 11) % 4 > 0;
                // Positions on X-facing surfaces must be clearly apart as well.
                (DVec3::new(if kind == 0 { f64::from(i) } else { height }, 0.0, height), normal, exists)
            };
            let light = |x: i64, y: i64, channel: u32| 0.5 + noise((x + 64 * y) as u32 * 4 + channel);
            let albedo = |x: i64, y: i64, channel: u32| f16::from_f64(noise((x + 64 * y) as u32 * 4 + channel + 99)).to_f64();
            let tile = UVec2::new((width as u32).div_ceil(n), (height as u32).div_ceil(n));
            let split = tile * n;
            let mut positions = vec![0.0_f32; (4 * split.x * split.y) as usize];
            let mut normals = vec![0_u32; (split.x * split.y) as usize];
            let (mut merged, mut albedos) = (Vec::new(), Vec::new());
            for y in 0..height {
                for x in 0..width {
                    let (position, normal, exists) = surface(x, y);
                    let pixel = UVec2::new(x as u32, y as u32);
                    let at = (pixel % n) * tile + pixel / n;
                    let index = (at.y * split.x + at.x) as usize;
                    let p = position.as_vec3();
                    positions[4 * index..4 * index + 4].copy_from_slice(&[p.x, p.y, p.z, f32::from(u8::from(exists))]);
                    normals[index] = code(normal);
                    merged.extend([0, 1, 2, 3].map(|c| light(x, y, c) as f32));
                    albedos.extend([0, 1, 2, 3].map(|c| f16::from_f64(albedo(x, y, c))));
                }
            }
            let size = (width as u32, height as u32);
            let info = SceneInfo { diagonal: 10.0, ..SceneInfo::default() };
            let mut world = World::new(vec![
                Resource::texture("indirect_merged", Format::Rgba32Float, size, &[merged]),
                Resource::texture("split_position", Format::Rgba32Float, (split.x, split.y), &[positions]),
                Resource::texture("split_normal", Format::R32Uint, (split.x, split.y), &[normals]),
                Resource::texture("gbuffer_albedo", Format::Rgba16Float, size, &[albedos]),
                Resource::uniform("scene_info", "SceneInfo", &info),
            ]);
            world.add_node("lighting/filter");
            let resources = format!("\"indirect\": Texture(format: Rgba32Float, size: Fixed({width}, {height}))");
            let nodes = format!("(id: \"filter\", node: \"lighting/filter\", params: {{\"tiles\": {n}, \"filter\": \"{filter}\"}})");
            world.add("pipelines/test.ron", &pipeline(&resources, &nodes, "indirect"));
            let image = world.run(name, &[]).image("indirect");
            for y in 0..height {
                for x in 0..width {
                    let got: Vec<f64> = image.pixel(x as u32, y as u32).iter().map(|v| f64::from(*v)).collect();
                    let (position, normal, exists) = surface(x, y);
                    // The light of a neighbour, if it counts.
                    let accepted = |nx: i64, ny: i64| {
                        let (other, other_normal, there) = surface(nx, ny);
                        let near = there && normal.dot(other - position).abs() <= 0.2 && normal.dot(other_normal) >= 0.8;
                        (near || (nx, ny) == (x, y)).then(|| [0, 1, 2, 3].map(|c| light(nx, ny, c) as f32 as f64))
                    };
                    let wanted = if exists {
                        let sum = if filter == "tent" {
                            tent((x, y), (width, height), n.into(), accepted)
                        } else {
                            mean((x, y), (width, height), n.into(), accepted)
                        };
                        let rgb = [0, 1, 2].map(|c| albedo(x, y, c) / PI * sum[c as usize]);
                        let visible = (luminance(DVec3::new(sum[0], sum[1], sum[2])) / sum[3]).clamp(0.0, 1.0);
                        rgb.into_iter().chain([visible]).map(Want::new).collect()
                    } else {
                        vec![Want::new(0.0); 4]
                    };
                    outcome.add(&wanted, &got, || format!("{n} tiles, {width}×{height}, kind {kind}: pixel {x}, {y}"));
                }
            }
        }
        outcomes.push(outcome);
    }
    judge(outcomes);
}

type Neighbour = Option<[f64; 4]>;

/// Mean over a window of n × n, moved into the picture.
fn mean((x, y): (i64, i64), (width, height): (i64, i64), n: i64, light: impl Fn(i64, i64) -> Neighbour) -> [f64; 4] {
    let window = |at: i64, size: i64| {
        let n = n.min(size);
        let first = (at - (n - 1) / 2).clamp(0, size - n);
        first..first + n
    };
    let (mut sum, mut count) = ([0.0; 4], 0.0);
    for ny in window(y, height) {
        for nx in window(x, width) {
            if let Some(light) = light(nx, ny) {
                (0..4).for_each(|c| sum[c] += light[c]);
                count += 1.0;
            }
        }
    }
    sum.map(|v| v / count)
}

/// Every tile apart: a tent of the width 2n over its pixels. Mean of the tiles that have any.
fn tent((x, y): (i64, i64), (width, height): (i64, i64), n: i64, light: impl Fn(i64, i64) -> Neighbour) -> [f64; 4] {
    let (mut sum, mut tiles) = ([0.0; 4], 0.0);
    for tile_y in 0..n {
        for tile_x in 0..n {
            let (mut of_tile, mut weights) = ([0.0; 4], 0.0);
            for ny in (y - n + 1..y + n).filter(|ny| ny.rem_euclid(n) == tile_y && (0..height).contains(ny)) {
                for nx in (x - n + 1..x + n).filter(|nx| nx.rem_euclid(n) == tile_x && (0..width).contains(nx)) {
                    if let Some(light) = light(nx, ny) {
                        let weight = ((n - (nx - x).abs()) * (n - (ny - y).abs())) as f64;
                        (0..4).for_each(|c| of_tile[c] += weight * light[c]);
                        weights += weight;
                    }
                }
            }
            if weights > 0.0 {
                (0..4).for_each(|c| sum[c] += of_tile[c] / weights);
                tiles += 1.0;
            }
        }
    }
    sum.map(|v| v / tiles)
}

/// As `common::cluster` declares it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Cluster {
    position: Vec3,
    area: f32,
    normal: Vec3,
    importance: f32,
    flux: Vec3,
    count: u32,
    texel: Vec2,
    state: u32,
    generation: u32,
    delta: f32,
    delta_mean: f32,
    cancelled: u32,
    rank: u32,
}

/// [ACRSM] eqs. 4.6 and 4.7.
#[test]
fn the_comparison_of_clusters_is_as_its_twin() {
    const SIDE: u32 = 128;
    const WINDOW: f64 = 32.0;
    let cluster = |area: f64, importance: f64, x: f64, y: f64| Cluster {
        position: Vec3::ZERO,
        area: area as f32,
        normal: Vec3::Z,
        importance: importance as f32,
        flux: Vec3::ONE,
        count: 4,
        texel: Vec2::new(x as f32, y as f32),
        state: 1,
        generation: 0,
        delta: 7.0,
        delta_mean: 7.0,
        cancelled: 0,
        rank: 3,
    };
    let many = |count: u32, area: &dyn Fn(u32) -> f64, importance: &dyn Fn(u32) -> f64| -> Vec<Cluster> {
        (0..count)
            .map(|i| {
                cluster(area(i), importance(i), 8.0 + (112.0 * noise(3 * i)).floor() + 0.5, 8.0 + (112.0 * noise(3 * i + 1)).floor() + 0.5)
            })
            .collect()
    };
    let mut idle = many(40, &noise, &|i| noise(i + 50));
    idle.iter_mut().step_by(3).for_each(|c| c.state = 0);
    idle.iter_mut().skip(1).step_by(5).for_each(|c| c.count = 0);
    let lists = vec![
        many(1, &|_| 2.0, &|_| 0.5),
        many(1, &|_| 0.0, &|_| 0.0),
        // Σδ = 0, A_max = 0, both.
        many(16, &noise, &|_| 0.0),
        many(16, &|_| 0.0, &noise),
        many(16, &|_| 0.0, &|_| 0.0),
        // No neighbours; all in one place.
        (0..4).map(|i| cluster(1.0 + f64::from(i), 0.25, 10.5 + 100.0 * f64::from(i % 2), 10.5 + 100.0 * f64::from(i / 2))).collect(),
        (0..16).map(|i| cluster(1.0 + f64::from(i), 0.25, 64.5, 64.5)).collect(),
        many(200, &|i| 1e30 * noise(i), &|i| noise(i + 999)),
        many(200, &|i| 1e-12 * noise(i), &|i| noise(i + 999)),
        many(512, &|i| (20.0 * noise(i) - 10.0).exp(), &|i| noise(i + 999)),
        idle,
    ];
    let mut outcome = Outcome::new("clustering/evaluate", relative(4e-6, "sums of up to 512 terms and of their squares, all of 0 or more"));
    for list in lists {
        let view = gpu_data::View::perspective(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0, 1.0, 0.1, 10.0);
        let views = [LightView { view, light: 0, kind: 0, face: 0, weight: 1.0 }];
        let mut world = World::new(vec![
            Resource::buffer("clusters_previous", "Cluster", &list),
            Resource::uniform("frame", "Frame", &gpu_data::Frame::default()),
            Resource::texture("rsm_flux", Format::Rgba32Float, (SIDE, SIDE), &[vec![1.0_f32; (4 * SIDE * SIDE) as usize]]),
            Resource::buffer("scene_light_views", "LightView", &views),
        ]);
        world.add_node("clustering/evaluate");
        let resources = format!(
            "\"clusters_evaluated\": Buffer(of: \"Cluster\", count: {}), \"picture\": Texture(format: Rgba32Float, size: Fixed(1, 1))",
            list.len()
        );
        let nodes = "(id: \"evaluate\", node: \"clustering/evaluate\", params: {\"window\": 32}), (id: \"show\", node: \"test/show\")";
        world.add_picture();
        world.add("pipelines/test.ron", &pipeline(&resources, nodes, "picture"));
        let bytes = world.run("clustering/evaluate", &["clusters_evaluated"]).bytes("clusters_evaluated");
        let found: Vec<Cluster> = bytes.chunks_exact(size_of::<Cluster>()).map(bytemuck::pod_read_unaligned).collect();
        let active: Vec<&Cluster> = list.iter().filter(|c| c.state == 1 && c.count > 0).collect();
        let largest = active.iter().map(|c| f64::from(c.area)).fold(0.0, f64::max);
        let delta = |c: &Cluster| if largest > 0.0 { f64::from(c.area) / largest * f64::from(c.importance) } else { 0.0 };
        for (c, got) in list.iter().zip(&found) {
            let is_active = c.state == 1 && c.count > 0;
            let near = |o: &&&Cluster| f64::from((o.texel - c.texel).abs().max_element()) <= WINDOW;
            let (sum, squares) = active.iter().filter(near).map(|o| delta(o)).fold((0.0, 0.0), |(s, q), d| (s + d, q + d * d));
            let neighbours = active.iter().filter(near).count();
            let own = if is_active { delta(c) } else { 0.0 };
            let mean = if is_active && sum > 0.0 && neighbours > 1 { squares / sum } else { own };
            outcome.add(&[Want::of(own, 1e-20), Want::of(mean, 1e-20)], &[got.delta.into(), got.delta_mean.into()], || {
                format!("{} clusters: {c:?}", list.len())
            });
        }
    }
    judge(vec![outcome]);
}

/// [ACRSM] eqs. 5.3 and 5.4: what a triangle weighs.
#[test]
fn tessellation_is_as_its_twin() {
    let mut outcome =
        Outcome::new("points/dynamic", relative(2e-6, "differences of sums of whole numbers below 2²⁴; factors are rounded up"));
    let [f_min, f_max] = [5.0, 32.0];
    let square = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE - Vec3::Z];
    let random: Vec<Vec3> = (0..60).map(|i| Vec3::new(noise(3 * i) as f32, noise(3 * i + 1) as f32, noise(3 * i + 2) as f32)).collect();
    let scenes: Vec<(Vec<Vec3>, Vec<[u32; 3]>, f32)> = vec![
        // All areas equal, and all edges but one: A_min = A_max.
        (square.to_vec(), vec![[0, 1, 2], [3, 2, 1]], 1.0),
        // A triangle without area, and nothing else without area.
        (square.to_vec(), vec![[0, 0, 1], [0, 1, 2], [1, 1, 1]], 1.0),
        (square.to_vec(), vec![[0, 0, 1]], 1.0),
        (random.clone(), (0..200).map(|i| [i % 60, (7 * i + 1) % 60, (11 * i + 2) % 60]).collect(), 1.0),
        (random.clone(), (0..200).map(|i| [i % 60, (7 * i + 1) % 60, (11 * i + 2) % 60]).collect(), 1e-3),
        (random, (0..200).map(|i| [i % 60, (7 * i + 1) % 60, (11 * i + 2) % 60]).collect(), 1e4),
    ];
    for (places, triangles, scale) in scenes {
        for order in ["3rd", "5th"] {
            let places: Vec<Vec3> = places.iter().map(|p| *p * scale).collect();
            let corners = |t: &[u32; 3]| t.map(|i| places[i as usize].as_dvec3());
            let areas: Vec<f64> = triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = corners(t);
                    (b - a).cross(c - a).length() / 2.0
                })
                .collect();
            let edges_of = |t: &[u32; 3]| {
                let [a, b, c] = corners(t);
                [a.distance(b), b.distance(c), c.distance(a)]
            };
            let edges: Vec<f64> = triangles.iter().flat_map(edges_of).collect();
            let range = |all: &[f64]| (all.iter().copied().fold(f64::MAX, f64::min) as f32, all.iter().copied().fold(0.0, f64::max) as f32);
            let ((area_min, area_max), (edge_min, edge_max)) = (range(&areas), range(&edges));
            let info = SceneInfo { area_min, area_max, edge_min, edge_max, triangle_count: triangles.len() as u32, ..SceneInfo::default() };
            let vertex = |p: &Vec3| Vertex { position: *p, u: 0.0, normal: Vec3::ZERO, v: 0.0 };
            let mut world = World::new(vec![
                Resource::buffer("scene_vertices", "Vertex", &places.iter().map(vertex).collect::<Vec<_>>()),
                Resource::buffer(
                    "scene_triangles",
                    "Triangle",
                    &triangles.iter().map(|[a, b, c]| Triangle { a: *a, b: *b, c: *c, object: 0, material: 0 }).collect::<Vec<_>>(),
                ),
                Resource::buffer(
                    "scene_objects",
                    "Object",
                    &[Object { world_from_object: Mat4::IDENTITY, normal_from_object: Mat4::IDENTITY }],
                ),
                Resource::uniform("scene_info", "SceneInfo", &info),
                Resource::uniform("frame", "Frame", &gpu_data::Frame::default()),
            ]);
            world.add_node("points/dynamic");
            world.add_picture();
            let resources = format!(
                "\"points\": Buffer(of: \"ScenePoint\", count: 4096), \"point_offsets\": Buffer(of: \"f32\", count: {}),
                \"point_block_sums\": Buffer(of: \"f32\", count: 1), \"picture\": Texture(format: Rgba32Float, size: Fixed(1, 1))",
                triangles.len()
            );
            let nodes = format!(
                "(id: \"points\", node: \"points/dynamic\", params: {{\"clusters\": 16, \"method\": \"tessellation\", \"smoothstep\": \"{order}\"}}),
                (id: \"show\", node: \"test/show\")"
            );
            world.add("pipelines/test.ron", &pipeline(&resources, &nodes, "picture"));
            let ran = world.run("points/dynamic", &["points", "point_offsets"]);
            let sums = ran.numbers("point_offsets");
            // Least and greatest of what rounding allows: a factor is rounded up.
            let factor = |value: f64, low: f32, high: f32, slack: f64| {
                let (low, high) = (f64::from(low), f64::from(high));
                let x = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 1.0 };
                let s = if order == "3rd" { x * x * (3.0 - 2.0 * x) } else { x.powi(3) * (10.0 + x * (6.0 * x - 15.0)) };
                (s * f_max + slack).ceil().max(f_min)
            };
            let weight = |t: &[u32; 3], area: f64, slack: f64| {
                let mean = edges_of(t).iter().map(|e| factor(*e, edge_min, edge_max, slack)).sum::<f64>() / 3.0;
                if area > 0.0 { (0.5 * (factor(area, area_min, area_max, slack) + mean).powi(2) + slack).ceil() } else { 0.0 }
            };
            let mut before = 0.0;
            for (index, (t, area)) in triangles.iter().zip(&areas).enumerate() {
                let (least, most) = (weight(t, *area, -1e-4), weight(t, *area, 1e-4));
                let wanted = if least == most { Want::of(least, sums[index]) } else { Want::Between(least, most) };
                outcome.add(&[wanted], &[sums[index] - before], || {
                    format!("{order}, scale {scale}: triangle {index} of {}, area {area}", triangles.len())
                });
                before = sums[index];
            }
            // Points stand for all of the surface, are finite, and none is on a triangle without area.
            let points = ran.numbers("points");
            assert!(points.chunks_exact(8).all(|p| p[..7].iter().all(|v| v.is_finite())), "{order}, scale {scale}");
            let total: f64 = points.chunks_exact(8).map(|p| p[3]).sum();
            let drawn = points.chunks_exact(8).filter(|p| p[3] > 0.0).count();
            assert!(drawn == (before as usize).min(4096), "{drawn} points of {before}");
            let surface: f64 = areas.iter().sum();
            assert!((total - surface).abs() <= 0.1 * surface, "{order}, scale {scale}: points stand for {total} of {surface}");
        }
    }
    judge(vec![outcome]);
}

/// [ACRSM] 5.3.3, [PCSS], [VAL] eqs. 3 and 5.5: light of one disk behind what a map of 64² texels holds.
#[test]
fn soft_shadows_are_as_their_twin() {
    const SIDE: usize = 64;
    const COUNT: usize = 2048;
    const BIAS: f64 = 0.12;
    let diagonal = 10.0_f32;
    let mut outcome =
        Outcome::new("lighting/indirect (pcss)", absolute(1e-6, "a share of 16 taps; where rounding decides about one, any share is good"));
    let receivers: Numbers = (unit_vector(), magnitude(0.05, 5.0), unit_vector())
        .prop_map(|(d, l, n)| {
            let direction = DVec3::new(d[0], d[1], d[2].abs().max(0.02)).normalize();
            let mut normal = DVec3::from_slice(&n);
            // Towards the light.
            if normal.dot(direction) > 0.0 {
                normal = -normal;
            }
            // Codes of the upper half only: the twin has the other half of the vector by its own rounding.
            [(l[0] * direction).to_array(), normal.to_array()].concat()
        })
        .boxed();
    let receivers = draw(&receivers, COUNT);
    type Map = Box<dyn Fn(DVec2) -> f64>;
    // Nothing, all blocked, noise, a wall, at the light itself.
    let maps: Vec<(f64, bool, Map)> = vec![
        (1.0, true, Box::new(|_| 1.0)),
        (1.0, true, Box::new(|_| 1e-3)),
        (1.0, false, Box::new(|_| 0.0)),
        (0.25, true, Box::new(|p| noise((p.x * 977.0 + p.y * 31.0) as u32))),
        (4.0, false, Box::new(|p| noise((p.x * 977.0 + p.y * 31.0) as u32))),
        (1.0, true, Box::new(|p| if p.x < 30.0 { 0.05 } else { 1.0 })),
        // A light without extent: one texel decides.
        (0.0, true, Box::new(|p| if p.x < 30.0 { 0.05 } else { 1.0 })),
        (1e-12, false, Box::new(|p| if p.y < 40.0 { 0.02 } else { 1.0 })),
    ];
    let light_normal = DVec3::new(0.36, -0.48, 0.8);
    let axes = basis(light_normal);
    let (mut facing, mut decided) = (0, 0);
    for (area, plane, map) in maps {
        let texels: Vec<f32> = (0..SIDE * 256)
            .map(|i| if i % 256 < SIDE { map(DVec2::new((i % 256) as f64, (i / 256) as f64)) as f32 } else { 1.0 })
            .collect();
        let cluster = Cluster {
            area: area as f32,
            normal: light_normal.as_vec3(),
            position: Vec3::ZERO,
            importance: 1.0,
            flux: Vec3::ONE,
            count: 1,
            texel: Vec2::ZERO,
            state: 1,
            generation: 0,
            delta: 0.0,
            delta_mean: 0.0,
            cancelled: 0,
            rank: 0,
        };
        // In the light's frame the receivers are above its plane; normals face it.
        let placed: Vec<(Vec3, DVec3)> = receivers
            .iter()
            .map(|r| {
                let position = (axes * DVec3::from_slice(&r[..3])).as_vec3();
                let mut normal = axes * DVec3::from_slice(&r[3..]);
                if normal.z < 0.0 {
                    // Codes here are of the upper half.
                    normal = DVec3::new(normal.x, normal.y, -normal.z);
                }
                (position, decoded(normal))
            })
            .collect();
        let positions: Vec<f32> = placed.iter().flat_map(|(p, _)| [p.x, p.y, p.z, 1.0]).collect();
        let codes: Vec<u32> = placed.iter().map(|(_, n)| code(*n)).collect();
        let size = (COUNT as u32, 1);
        let info = SceneInfo { diagonal, ..SceneInfo::default() };
        let mut world = World::new(vec![
            Resource::texture("split_position", Format::Rgba32Float, size, &[positions]),
            Resource::texture("split_normal", Format::R32Uint, size, &[codes]),
            Resource::buffer("clusters", "Cluster", &[cluster]),
            Resource::buffer("casters", "Cluster", &[cluster]),
            Resource::buffer("caster_of", "u32", &[0_u32]),
            Resource::texture("ism", Format::R32Float, (256, SIDE as u32), &[texels]),
            Resource::uniform("scene_info", "SceneInfo", &info),
        ]);
        world.add_node("lighting/indirect");
        let resources = format!("\"split_light\": Texture(format: Rgba32Float, size: Fixed({COUNT}, 1))");
        let nodes = format!(
            "(id: \"indirect\", node: \"lighting/indirect\", params: {{\"tiles\": 1, \"ism_size\": {SIDE}, \"atlas_width\": 256, \"shadow_plane\": {plane}, \"shadow_bias\": {BIAS}}})"
        );
        world.add("pipelines/test.ron", &pipeline(&resources, &nodes, "split_light"));
        let image = world.run("lighting/indirect", &[]).image("split_light");
        let light = Disk {
            axes: basis(cluster.normal.as_dvec3()),
            area: cluster.area.into(),
            plane,
            bias: BIAS,
            side: SIDE as f64,
            diagonal: diagonal.into(),
        };
        for ((position, normal), got) in placed.iter().zip(image.data.chunks_exact(4)) {
            let (position, got) = (position.as_dvec3(), got.iter().map(|v| f64::from(*v)).collect::<Vec<_>>());
            let direction = position.normalize();
            let cosines = (-normal.dot(direction)).max(0.0) * light.axes.z_axis.dot(direction).max(0.0);
            let irradiance = cosines / (PI * position.length_squared() + f64::from(cluster.area));
            let (share, wanted) = if irradiance < 1e-7 || cosines < 1e-4 {
                (0.0, Want::Between(0.0, 1.0))
            } else {
                let shown = luminance(DVec3::new(got[0], got[1], got[2])) / got[3];
                (shown, light.visibility(position, *normal, &map).map_or(Want::Between(0.0, 1.000_01), Want::new))
            };
            // Of two cosines that have the rounding of unit vectors.
            let slack = 1e-5 * irradiance + 2e-6 / (PI * position.length_squared() + f64::from(cluster.area));
            let unshadowed = Want::Between(irradiance - slack, irradiance + slack);
            facing += usize::from(cosines > 0.0);
            decided += usize::from(matches!(wanted, Want::Value { .. }));
            outcome.add(&[wanted, unshadowed], &[share, got[3]], || format!("area {area}, plane {plane}: {position:?}, {normal:?}"));
        }
    }
    assert!(2 * decided > facing && facing > COUNT, "{decided} of {facing} receivers are compared with a value");
    judge(vec![outcome]);
}

/// [CV] 4.1: light of one disk behind a map that holds one depth everywhere, so that averages over any region are that of a texel.
#[test]
fn series_of_a_map_are_as_their_twin() {
    const SIDE: usize = 64;
    const COUNT: usize = 512;
    const MARGIN: f64 = 1.0;
    let info = SceneInfo { bounds_min: Vec3::splat(-1.0), bounds_max: Vec3::new(3.0, 2.0, 1.0), diagonal: 6.0, ..SceneInfo::default() };
    let range = info.bounds_max.as_dvec3().length();
    let mut outcome =
        Outcome::new("lighting/indirect (cssm)", absolute(1e-3, "the series' terms are half floats, with errors of up to 1/4096"));
    let cluster = Cluster { area: 0.01, normal: Vec3::Z, flux: Vec3::ONE, count: 1, state: 1, ..Cluster::zeroed() };
    // Depths of the whole map: at the light, next to it, in the middle, almost and at the end of the range.
    for z in [0.0, 1e-3, 0.25, 0.5, 0.999, 1.0] {
        for (terms, slope) in [(4_u32, 0.0), (1, 0.0), (16, 0.0), (4, 1.0), (3, 2.0)] {
            let margin = MARGIN / f64::from(2 * terms);
            // From the light to the end of the range, and just where what is in front becomes nothing.
            let depth = |i: usize| match i % 8 {
                0 => (z + margin + 1e-3 * (noise(i as u32) - 0.5)).clamp(1e-3, 1.0),
                1 => 1e-4 + 0.01 * noise(i as u32),
                _ => 1e-3 + 0.999 * i as f64 / COUNT as f64,
            };
            let direction = |i: u32| DVec3::new(noise(3 * i) - 0.5, noise(3 * i + 1) - 0.5, 0.2 + noise(3 * i + 2)).normalize();
            let directions: Vec<DVec3> = (0..COUNT as u32).map(direction).collect();
            let places: Vec<Vec3> = directions.iter().enumerate().map(|(i, d)| (*d * depth(i) * range).as_vec3()).collect();
            // Walls that are lit from the side and below.
            let normals = directions.iter().map(|d| DVec3::new(-d.x, -d.y, 0.0).normalize());
            let positions: Vec<f32> = places.iter().flat_map(|p| [p.x, p.y, p.z, 1.0]).collect();
            let stored = (z * range / f64::from(info.diagonal)) as f32;
            let size = (COUNT as u32, 1);
            let mut world = World::new(vec![
                Resource::texture("split_position", Format::Rgba32Float, size, &[positions]),
                Resource::texture("split_normal", Format::R32Uint, size, &[normals.map(code).collect::<Vec<u32>>()]),
                Resource::buffer("clusters", "Cluster", &[cluster]),
                Resource::buffer("casters", "Cluster", &[cluster]),
                Resource::buffer("caster_of", "u32", &[0_u32]),
                Resource::texture("ism", Format::R32Float, (256, SIDE as u32), &[vec![stored; 256 * SIDE]]),
                Resource::uniform("scene_info", "SceneInfo", &info),
            ]);
            world.add_node("lighting/indirect");
            world.add_node("cssm/basis");
            let resources = format!(
                "\"split_light\": Texture(format: Rgba32Float, size: Fixed({COUNT}, 1)),
                \"cssm\": Texture(format: Rgba16Float, size: Fixed(256, {}), mips: Count(7))",
                SIDE as u32 * (2 * terms.div_ceil(2) + 1)
            );
            let shared = format!("\"terms\": {terms}, \"ism_size\": {SIDE}");
            let nodes = format!(
                "(id: \"basis\", node: \"cssm/basis\", params: {{{shared}}}), (id: \"indirect\", node: \"lighting/indirect\",
                params: {{{shared}, \"tiles\": 1, \"atlas_width\": 256, \"visibility\": \"cssm\", \"cssm_margin\": {MARGIN:?}, \"cssm_slope\": {slope:?}}})"
            );
            world.add("pipelines/test.ron", &pipeline(&resources, &nodes, "split_light"));
            let image = world.run("lighting/indirect", &[]).image("split_light");
            for (place, got) in places.iter().zip(image.data.chunks_exact(4)) {
                let got: Vec<f64> = got.iter().map(|v| f64::from(*v)).collect();
                let shown = luminance(DVec3::new(got[0], got[1], got[2])) / got[3];
                // [CSM]: the step function's series, over that of a surface which is compared with itself.
                let step = |behind: f64| -> f64 {
                    let frequencies = (1..=terms).map(|k| f64::from(2 * k - 1) * PI);
                    0.5 + frequencies.map(|c| 2.0 / c * (c * behind).sin()).sum::<f64>()
                };
                let d = place.as_dvec3().length() / range - margin;
                let wanted = match () {
                    // Moved by the slope, what is compared is another depth: a share in any case.
                    () if slope > 0.0 || d.abs() < 1e-5 => Want::Between(0.0, 1.000_01),
                    () if d < 0.0 => Want::new(1.0),
                    () => Want::new((step(z - d) / step(margin)).clamp(0.0, 1.0)),
                };
                outcome.add(&[wanted], &[shown], || format!("depth {z}, {terms} terms, slope {slope}: a receiver at {d} and the margin"));
            }
        }
    }
    judge(vec![outcome]);
}

/// A vector as its code holds it.
fn decoded(unit: DVec3) -> DVec3 {
    let code = code(unit);
    let part = |bits: u32| f64::from(bits as u16 as i16) / 32_767.0;
    let (x, y) = if code == 0x8000 { (0.0, 0.0) } else { (part(code), part(code >> 16)) };
    DVec3::new(x, y, 1.0 - x.abs() - y.abs()).normalize()
}

struct Disk {
    axes: glam::DMat3,
    area: f64,
    plane: bool,
    bias: f64,
    side: f64,
    diagonal: f64,
}

impl Disk {
    /// Share of the disk that a receiver sees; `None` where rounding decides about a tap.
    fn visibility(&self, position: DVec3, normal: DVec3, map: impl Fn(DVec2) -> f64) -> Option<f64> {
        let local = self.axes.transpose() * position;
        let normal = self.axes.transpose() * normal;
        let (own, direction) = (local.length(), local.normalize());
        let disk = direction.truncate() / (1.0 + direction.z);
        let texel = (0.5 + 0.5 * disk) * self.side;
        let angle = (self.area / PI).sqrt() / own;
        let scale = 0.5 * (1.0 + disk.length_squared()) * 0.5 * self.side;
        // Stored over own distance; of `None` rounding decides.
        let ratio = |offset: DVec2| {
            let at = (texel + offset).clamp(DVec2::ZERO, DVec2::splat(self.side - 1.0));
            let is_border = |v: f64| (v - v.round()).abs() < 1e-3 && v > 0.0 && v < self.side - 1.0;
            if is_border(at.x) || is_border(at.y) {
                return None;
            }
            let at = at.floor();
            let stored = f64::from(map(at) as f32) * self.diagonal;
            let p = (at + 0.5) * (2.0 / self.side) - 1.0;
            let ray = (2.0 * p).extend(1.0 - p.length_squared()) / (1.0 + p.length_squared());
            let (cosine, height) = (normal.dot(ray), normal.dot(local));
            if self.plane && (cosine.abs() - 0.05).abs() < 1e-5 {
                return None;
            }
            let reciprocal = if self.plane && cosine.abs() >= 0.05 { (cosine / height).clamp(0.5 / own, 2.0 / own) } else { 1.0 / own };
            let ratio = stored * reciprocal;
            ((ratio - (1.0 - self.bias)).abs() > 1e-4).then_some(ratio)
        };
        let tap = |i: i32, radius: f64| {
            let turn = f64::from(i) * PI * (3.0 - 5.0_f64.sqrt());
            ratio(DVec2::new(turn.cos(), turn.sin()) * ((f64::from(i) + 0.5) / 16.0).sqrt() * radius)
        };
        let search = (angle * scale).clamp(1.0, 10.0);
        let found: Option<Vec<f64>> = (0..16).map(|i| tap(i, search)).collect();
        let blockers: Vec<f64> = found?.into_iter().filter(|r| *r < 1.0 - self.bias).collect();
        if blockers.is_empty() {
            return Some(1.0);
        }
        let mean = (blockers.iter().sum::<f64>() / blockers.len() as f64).max(1e-3);
        let penumbra = (angle * (1.0 - mean) / mean * scale).clamp(1.0, 10.0);
        let seen: Option<Vec<f64>> = (0..16).map(|i| tap(i, penumbra)).collect();
        Some(seen?.iter().filter(|r| **r >= 1.0 - self.bias).count() as f64 / 16.0)
    }
}
