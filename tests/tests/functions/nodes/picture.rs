//! Tone mapping and the geometry-aware filter.

use std::f64::consts::PI;

use glam::{DVec3, UVec2};
use half::f16;
use manylight_graph::value::Format;
use manylight_scene::gpu_data::SceneInfo;

use super::{
    super::{
        harness::{Outcome, Resource, Want, World, absolute, judge, relative},
        light::luminance,
        random::hash,
    },
    code, noise, pipeline,
};

/// [REINHARD] eqs. 1, 2 and 4, and the curve of sRGB.
#[test]
fn tone_mapping_is_as_its_twin() {
    let limits = "steps of the screen, 1/255: half of one by rounding, the rest from exposure, whose logarithm has an error of 1e-5";
    let mut outcome = Outcome::new("tone/reinhard", absolute(0.6 / 255.0, limits));
    type Picture = Box<dyn Fn(u32) -> DVec3>;
    let pictures: Vec<(u32, u32, Picture)> = vec![
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
                let exists = kind < 3 || !hash(i + 11).is_multiple_of(4);
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
