//! The hierarchy holds every triangle where the objects are.

use std::{collections::BTreeSet, path::Path};

use manylight_scene::{Scene, bvh::Bvh};

fn asset(name: &str) -> Scene {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets")).join(name);
    Scene::load(&path).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn every_triangle_lies_in_one_leaf_and_in_all_boxes_above_it() {
    let scene = asset("moving.ron");
    for time in [0.0, 1.7] {
        let bvh = Bvh::build(&scene, &scene.sample(time));
        assert_eq!(bvh.triangles.len(), scene.triangle_count());
        assert!(bvh.nodes.len() < 2 * bvh.triangles.len());
        let mut seen = BTreeSet::new();
        let mut open = vec![(0_usize, Vec::new())];
        while let Some((index, mut above)) = open.pop() {
            let node = bvh.nodes[index];
            above.push((node.low, node.high));
            if node.count == 0 {
                open.push((node.first as usize, above.clone()));
                open.push((node.first as usize + 1, above));
                continue;
            }
            for t in &bvh.triangles[node.first as usize..(node.first + node.count) as usize] {
                assert!(seen.insert(t.index), "triangle {} lies in two leaves", t.index);
                for corner in [t.a, t.a + t.ab, t.a + t.ac] {
                    for (low, high) in &above {
                        assert!((corner - *low).min_element() >= -1e-5 && (corner - *high).max_element() <= 1e-5, "{corner} outside");
                    }
                }
            }
        }
        assert_eq!(seen.len(), scene.triangle_count());
    }
}

#[test]
fn it_follows_objects_that_move() {
    let scene = asset("moving.ron");
    let at = |time| Bvh::build(&scene, &scene.sample(time)).triangles;
    let mean = |time| at(time).iter().map(|t| f64::from(t.a.y)).sum::<f64>();
    assert!(mean(2.5) > mean(0.0) + 1.0, "the ball goes up");
}
