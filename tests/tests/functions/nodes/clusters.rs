//! The comparison of clusters, and tessellation factors.

use glam::{Mat4, Vec2, Vec3};
use manylight_graph::value::Format;
use manylight_scene::gpu_data::{self, LightView, Object, SceneInfo, Triangle, Vertex};

use super::{
    super::harness::{Outcome, Ran, Resource, Want, World, judge, relative},
    Cluster, noise, pipeline,
};

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

/// What `points/dynamic` makes of triangles between places of the world; `info` without their number.
fn points_on(places: &[Vec3], triangles: &[[u32; 3]], info: SceneInfo, count: u32, params: &str) -> Ran {
    let vertex = |p: &Vec3| Vertex { position: *p, u: 0.0, normal: Vec3::ZERO, v: 0.0 };
    let triangle = |[a, b, c]: &[u32; 3]| Triangle { a: *a, b: *b, c: *c, object: 0, material: 0 };
    let info = SceneInfo { triangle_count: triangles.len() as u32, ..info };
    let mut world = World::new(vec![
        Resource::buffer("scene_vertices", "Vertex", &places.iter().map(vertex).collect::<Vec<_>>()),
        Resource::buffer("scene_triangles", "Triangle", &triangles.iter().map(triangle).collect::<Vec<_>>()),
        Resource::buffer("scene_objects", "Object", &[Object { world_from_object: Mat4::IDENTITY, normal_from_object: Mat4::IDENTITY }]),
        Resource::uniform("scene_info", "SceneInfo", &info),
        Resource::uniform("seed", "Seed", &gpu_data::Seed::default()),
    ]);
    world.add_node("points/dynamic");
    world.add_picture();
    let resources = format!(
        "\"points\": Buffer(of: \"ScenePoint\", count: {count}), \"point_offsets\": Buffer(of: \"f32\", count: {}),
        \"point_block_sums\": Buffer(of: \"f32\", count: {}), \"picture\": Texture(format: Rgba32Float, size: Fixed(1, 1))",
        triangles.len(),
        triangles.len().div_ceil(256)
    );
    let nodes = format!("(id: \"points\", node: \"points/dynamic\", params: {{{params}}}), (id: \"show\", node: \"test/show\")");
    world.add("pipelines/test.ron", &pipeline(&resources, &nodes, "picture"));
    world.run("points/dynamic", &["points", "point_offsets"])
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
            let info = SceneInfo { area_min, area_max, edge_min, edge_max, ..SceneInfo::default() };
            let params = format!("\"method\": \"tessellation\", \"smoothstep\": \"{order}\"");
            let ran = points_on(&places, &triangles, info, 4096, &params);
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

/// Point i belongs to map i mod N, and pipelines choose N: each map must see all of the surface.
#[test]
fn dynamic_points_are_even_in_each_map() {
    const SIDE: u32 = 32;
    const COUNT: u32 = 16384;
    // Rows of a grid, whose period meets numbers of maps.
    let places: Vec<Vec3> =
        (0..(SIDE + 1) * (SIDE + 1)).map(|i| Vec3::new((i % (SIDE + 1)) as f32, 0.0, (i / (SIDE + 1)) as f32)).collect();
    let triangles: Vec<[u32; 3]> = (0..SIDE * SIDE)
        .flat_map(|i| {
            let a = i / SIDE * (SIDE + 1) + i % SIDE;
            [[a, a + 1, a + SIDE + 2], [a, a + SIDE + 2, a + SIDE + 1]]
        })
        .collect();
    let ran = points_on(&places, &triangles, SceneInfo::default(), COUNT, "");
    let points = ran.numbers("points");
    // 16 equal squares of the grid.
    let squares: Vec<usize> = points.chunks_exact(8).map(|p| (p[0] / 8.0) as usize + 4 * (p[2] / 8.0) as usize).collect();
    let deviation = |maps: usize| {
        let (mut found, mut random) = (0.0, 0.0);
        for map in 0..maps {
            let mut counts = [0.0_f64; 16];
            squares.iter().skip(map).step_by(maps).for_each(|square| counts[*square] += 1.0);
            let of_map: f64 = counts.iter().sum();
            found += counts.iter().map(|count| (count - of_map / 16.0).powi(2)).sum::<f64>();
            random += of_map * (1.0 - 1.0 / 16.0);
        }
        found / random
    };
    for maps in [16, 32, 64, 96, 100, 128, 233, 377] {
        let ratio = deviation(maps);
        // Independent random points: 1. Stratified in blocks of 256 of 16384, a map's points vary within a block alone.
        assert!(ratio < 0.6, "{maps} maps: the variance of points in a square is {ratio} of that of random ones");
    }
}
