//! Soft shadows from maps, by taps and by series.

use std::f64::consts::PI;

use bytemuck::Zeroable;
use glam::{DVec2, DVec3, Vec3};
use manylight_graph::value::Format;
use manylight_scene::gpu_data::SceneInfo;
use proptest::strategy::Strategy;

use super::{
    super::{
        directions::basis,
        harness::{Outcome, Resource, Want, World, absolute, judge},
        inputs::{Numbers, draw, magnitude, unit_vector},
        light::luminance,
    },
    Cluster, code, noise, pipeline,
};

/// The node that lists the blocks of receivers to be lit.
const BLOCKS: &str = "(id: \"blocks\", node: \"lighting/blocks\", params: {\"tiles\": 1})";

/// Of a row of receivers that stands for a picture.
fn block_resources(receivers: usize) -> String {
    let count = receivers.div_ceil(8);
    format!(
        "\"surface_blocks\": Buffer(of: \"SurfaceBounds\", count: {count}), \"lit_blocks\": Buffer(of: \"u32\", count: {count}),
        \"lit_block_groups\": Buffer(of: \"vec4u\", count: 1)"
    )
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
        let cluster =
            Cluster { area: area as f32, normal: light_normal.as_vec3(), flux: Vec3::ONE, count: 1, state: 1, ..Cluster::zeroed() };
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
        world.add_node("lighting/blocks");
        world.add_node("lighting/indirect");
        let resources = format!("\"split_light\": Texture(format: Rgba32Float, size: Fixed({COUNT}, 1)), {}", block_resources(COUNT));
        let nodes = format!(
            "{BLOCKS}, (id: \"indirect\", node: \"lighting/indirect\", params: {{\"tiles\": 1, \"ism_size\": {SIDE}, \"atlas_width\": 256, \"shadow_plane\": {plane}, \"shadow_bias\": {BIAS}}})"
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
            world.add_node("lighting/blocks");
            world.add_node("lighting/indirect");
            world.add_node("cssm/basis");
            let resources = format!(
                "{}, \"split_light\": Texture(format: Rgba32Float, size: Fixed({COUNT}, 1)),
                \"cssm\": Texture(format: Rgba16Float, size: Fixed(256, {}), mips: Count(7))",
                block_resources(COUNT),
                SIDE as u32 * (2 * terms.div_ceil(2) + 1)
            );
            let shared = format!("\"terms\": {terms}, \"ism_size\": {SIDE}");
            let nodes = format!(
                "{BLOCKS}, (id: \"basis\", node: \"cssm/basis\", params: {{{shared}}}), (id: \"indirect\", node: \"lighting/indirect\",
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
