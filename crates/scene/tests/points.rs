//! Points for imperfect shadow maps.

use glam::DVec3;
use manylight_scene::{
    Scene,
    gpu_data::ScenePoint,
    points::{MAX_POINTS, PointError, PointMethod, PointOptions, Smoothness, generate, on_triangle},
};

use crate::memory::{obj, ron};

fn area(count: u32, seed: u32) -> PointOptions {
    PointOptions { method: PointMethod::Area { count }, seed }
}

fn tessellation(min: u32, max: u32, smoothness: Smoothness) -> PointOptions {
    PointOptions { method: PointMethod::Tessellation { min, max, smoothness }, seed: 1 }
}

fn room() -> Scene {
    Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/cornell.ron")).unwrap()
}

/// World position at time 0.
fn world(scene: &Scene, point: &ScenePoint) -> DVec3 {
    let matrix = scene.objects[point.object as usize].pose.at(0.0).world_from_object();
    matrix.transform_point3(point.position.as_dvec3())
}

/// Area and centroid of all surfaces in world space at time 0.
fn surface(scene: &Scene) -> (f64, DVec3) {
    let (mut total, mut moment) = (0.0, DVec3::ZERO);
    for object in &scene.objects {
        let (mesh, matrix) = (&scene.meshes[object.mesh], object.pose.at(0.0).world_from_object());
        for triangle in &mesh.triangles {
            let [a, b, c] = mesh.corners(triangle).map(|corner| matrix.transform_point3(corner));
            let area = 0.5 * (b - a).cross(c - a).length();
            total += area;
            moment += area * (a + b + c) / 3.0;
        }
    }
    (total, moment / total)
}

fn mean<'a>(scene: &Scene, points: impl Iterator<Item = &'a ScenePoint>) -> DVec3 {
    let (mut sum, mut count) = (DVec3::ZERO, 0.0);
    for point in points {
        sum += world(scene, point);
        count += 1.0;
    }
    sum / count
}

#[test]
fn counts_and_areas_are_exact() {
    let moved = ron("Scene(meshes: [\"room.obj\", Mesh(file: \"tri.obj\", transform: (scale: (3.0, 1.0, 2.0)), motion: [(time: 0.0, scale: 2.0), (time: 1.0)])])").unwrap();
    for scene in [&room(), &moved] {
        let (total, centroid) = surface(scene);
        for count in [1, 2, 7, 1000, 64_000] {
            let points = generate(scene, &[], &area(count, 5)).unwrap();
            assert_eq!(points.len(), count as usize);
            let sum: f64 = points.iter().map(|p| f64::from(p.area)).sum();
            assert!((sum / total - 1.0).abs() < 1e-6, "{sum} of {total}");
            if count >= 1000 {
                let error = mean(scene, points.iter()).distance(centroid);
                assert!(error < 5.0 / f64::from(count) * total.sqrt() * 10.0, "{count} points: {error}");
            }
        }
    }
}

#[test]
fn points_lie_on_their_triangles_with_their_normals() {
    let scene = room();
    for options in [area(5000, 3), tessellation(2, 12, Smoothness::Third)] {
        let points = generate(&scene, &[], &options).unwrap();
        let mesh = &scene.meshes[0];
        for point in &points {
            assert!(point.normal.is_normalized());
            let on_one = mesh.triangles.iter().any(|triangle| {
                let [a, b, c] = mesh.corners(triangle);
                let normal = (b - a).cross(c - a);
                let p = point.position.as_dvec3();
                let inside = [(a, b), (b, c), (c, a)].iter().all(|(a, b)| (b - a).cross(p - a).dot(normal) >= -1e-4);
                inside && (p - a).dot(normal.normalize()).abs() < 1e-5 && normal.normalize().as_vec3().dot(point.normal) > 0.999
            });
            assert!(on_one, "{point:?}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_points() {
    let scene = room();
    for method in [PointMethod::Area { count: 3000 }, PointMethod::Tessellation { min: 3, max: 9, smoothness: Smoothness::Fifth }] {
        let points = |seed| generate(&scene, &[], &PointOptions { method, seed }).unwrap();
        assert_eq!(points(7), points(7));
        assert_ne!(points(7), points(8));
    }
}

/// The share of the surface in each of 8 boxes and of each normal's side, for one map of N against all points.
#[test]
fn every_map_gets_an_even_share_of_the_scene() {
    let scene = room();
    let centre = scene.sample(0.0).bounds.centre();
    let cell = |point: &ScenePoint| {
        let above = world(&scene, point).cmpgt(centre);
        usize::from(above.x) + 2 * usize::from(above.y) + 4 * usize::from(above.z)
    };
    for options in [area(64_000, 1), area(64_000, 2), tessellation(5, 64, Smoothness::Third)] {
        let points = generate(&scene, &[], &options).unwrap();
        let mut share = [0.0_f64; 8];
        points.iter().for_each(|point| share[cell(point)] += 1.0 / points.len() as f64);
        for maps in [16, 64, 100, 233, 377, 512] {
            let (mut squares, mut expected_squares, mut worst) = (0.0, 0.0, 0.0_f64);
            for map in 0..maps {
                let of_map: Vec<_> = points.iter().skip(map).step_by(maps).collect();
                let n = of_map.len() as f64;
                for (index, share) in share.iter().enumerate() {
                    let found = of_map.iter().filter(|point| cell(point) == index).count() as f64;
                    let variance = n * share * (1.0 - share);
                    squares += (found - n * share).powi(2);
                    expected_squares += variance;
                    worst = worst.max((found - n * share).abs() / variance.sqrt());
                }
            }
            // Independent random points have a ratio of 1; their worst of 4096 deviations is about 4 σ.
            let ratio = squares / expected_squares;
            assert!(ratio < 0.35, "{options:?}, {maps} maps: variance is {ratio} of random");
            assert!(worst < 3.5, "{options:?}, {maps} maps: worst deviation {worst} σ");
        }
    }
}

#[test]
fn the_rows_of_a_grid_do_not_meet_the_number_of_maps() {
    // 64 × 64 cells, a map for each column: without shuffling, all points of a map would fall into one column.
    let mut text = String::new();
    for y in 0..=64 {
        for x in 0..=64 {
            text.push_str(&format!("v {x} 0 {y}\n"));
        }
    }
    for y in 0..64 {
        for x in 0..64 {
            let i = y * 65 + x + 1;
            text.push_str(&format!("f {} {} {} {}\n", i, i + 1, i + 66, i + 65));
        }
    }
    let scene = obj(&text).unwrap();
    let points = generate(&scene, &[], &area(8192, 1)).unwrap();
    for maps in [64, 128] {
        for map in 0..maps {
            let columns: std::collections::BTreeSet<_> =
                points.iter().skip(map).step_by(maps).map(|point| point.position.x as u32 / 8).collect();
            assert!(columns.len() >= 7, "map {map} of {maps} has points in {} of 8 bands", columns.len());
        }
    }
}

#[test]
fn tessellation_follows_the_sizes_of_triangles() {
    // Areas 0.5 and 50: the least and the greatest factor.
    let scene = obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 10 0 1\nv 0 10 1\nf 1 2 3\nf 4 5 6\n").unwrap();
    let points = generate(&scene, &[], &tessellation(5, 64, Smoothness::Third)).unwrap();
    let small = points.iter().filter(|point| point.position.z == 0.0).count();
    let large = points.len() - small;
    // The walk takes steps of 2/n in n rows, n = t_e + t_A from 64 + 49 (the legs) to 64 + 64: about n²/4 points.
    assert!((20..=45).contains(&small), "{small}");
    assert!((3200..=4200).contains(&large), "{large}");
    let total: f64 = points.iter().map(|point| f64::from(point.area)).sum();
    assert!((total / 50.5 - 1.0).abs() < 1e-5);
}

#[test]
fn smooth_steps_are_polynomials() {
    for (x, third, fifth) in
        [(0.0, 0.0, 0.0), (0.25, 0.15625, 0.103_515_625), (0.5, 0.5, 0.5), (1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (-1.0, 0.0, 0.0)]
    {
        assert!((Smoothness::Third.step(0.0, 1.0, x) - third).abs() < 1e-15);
        assert!((Smoothness::Fifth.step(0.0, 1.0, x) - fifth).abs() < 1e-15);
    }
    assert_eq!(Smoothness::Third.step(2.0, 2.0, 2.0), 1.0);
}

#[test]
fn equal_triangles_get_the_greatest_factor() {
    let scene = obj(crate::memory::TRIANGLE).unwrap();
    let points = generate(&scene, &[], &tessellation(1, 8, Smoothness::Third)).unwrap();
    // The longest edge has the greatest factor as well, the shorter ones the least.
    assert!(points.len() > 20, "{}", points.len());
}

#[test]
fn too_much_is_refused_before_it_is_made() {
    let scene = room();
    assert_eq!(
        generate(&scene, &[], &area(u32::MAX, 0)),
        Err(PointError::TooMany { wanted: u32::MAX.into(), lower: "the number of points" })
    );
    for max in [100_000, u32::MAX] {
        let fault = generate(&scene, &[], &tessellation(1, max, Smoothness::Third)).unwrap_err();
        assert!(matches!(fault, PointError::TooMany { wanted, .. } if wanted > MAX_POINTS), "{fault}");
    }
    assert_eq!(generate(&scene, &[], &tessellation(0, 4, Smoothness::Third)), Err(PointError::Factors { min: 0, max: 4 }));
    assert_eq!(generate(&scene, &[], &tessellation(5, 4, Smoothness::Third)), Err(PointError::Factors { min: 5, max: 4 }));
    assert_eq!(generate(&scene, &[], &area(0, 0)), Ok(Vec::new()));
}

#[test]
fn objects_without_size_get_no_points() {
    let scene = ron("Scene(meshes: [\"room.obj\", Mesh(file: \"tri.obj\", motion: [(time: 0.0, scale: 0.0), (time: 1.0)])])").unwrap();
    assert!(generate(&scene, &[], &area(1000, 0)).unwrap().iter().all(|point| point.object == 0));
    let points = generate(&scene, &[], &tessellation(5, 20, Smoothness::Third)).unwrap();
    assert!(points.iter().any(|point| point.object == 1 && point.area == 0.0), "tessellation has them for later");
}

#[test]
fn needles_and_huge_scenes_have_finite_points() {
    for scale in ["1e-3", "1e4"] {
        let scene = obj(&format!("v 0 0 0\nv {scale} 0 0\nv {scale} 1e-6 0\nv 0 {scale} {scale}\nf 1 2 3\nf 1 2 4\n")).unwrap();
        for point in generate(&scene, &[], &area(100, 0)).unwrap() {
            assert!(point.position.is_finite() && point.normal.is_normalized() && point.area > 0.0);
        }
    }
}

#[test]
fn the_line_fills_the_triangle_evenly() {
    // The first moments of 4096 equal steps, and each corner's quarter has a quarter of them.
    let n = 4096;
    let mut sum = DVec3::ZERO;
    let mut corner = 0;
    for i in 0..n {
        let w = DVec3::from_array(on_triangle((f64::from(i) + 0.5) / f64::from(n)));
        assert!(w.min_element() >= 0.0 && (w.element_sum() - 1.0).abs() < 1e-12);
        sum += w;
        corner += u32::from(w.x > 0.5);
    }
    assert!((sum / f64::from(n) - DVec3::splat(1.0 / 3.0)).length() < 1e-3);
    assert_eq!(corner, 1024);
    assert!(on_triangle(1.0).iter().all(|w| w.is_finite()));
}
