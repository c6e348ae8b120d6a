//! Clusters keep the light's energy and hold every lit texel. [ACRSM] chapter 4.

use manylight_gpu::Image;
use manylight_passes::Renderer;

use crate::renders::{Cluster, Job, read, read_clusters};

const NO_CLUSTER: f32 = u32::MAX as f32;
const ACTIVE: u64 = 1;

fn job() -> Job {
    Job::asset("cornell").small().frames(16).keep(&[
        "clusters",
        "clusters_warped",
        "cluster_map",
        "rsm_flux",
        "rsm_normal",
        "rsm_distance",
        "importance_map",
    ])
}

pub fn texels(flux: &Image) -> impl Iterator<Item = (u32, u32, [f64; 3])> + '_ {
    (0..flux.height).flat_map(move |y| {
        (0..flux.width).map(move |x| {
            let p = flux.pixel(x, y);
            (x, y, [f64::from(p[0]), f64::from(p[1]), f64::from(p[2])])
        })
    })
}

fn add(sum: [f64; 3], more: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| sum[i] + more[i])
}

/// Flux of the reflective shadow map and of the clusters, W.
pub fn sums(renderer: &Renderer) -> ([f64; 3], [f64; 3]) {
    let rsm = texels(&read(renderer, "rsm_flux")).fold([0.0; 3], |sum, (_, _, flux)| add(sum, flux));
    let clusters = read_clusters(renderer, "clusters").into_iter().fold([0.0; 3], |sum, cluster| add(sum, cluster.flux));
    (rsm, clusters)
}

/// Sums of f32 in a tree over at most 2¹⁶ texels: relative error below 1e-5; the claim of the method is 1e-3.
#[test]
fn the_flux_of_the_clusters_is_the_flux_of_the_map() {
    for mapping in ["window", "exact"] {
        for clusters in [16, 64, 256] {
            let (rsm, sum) = sums(&job().set("mapping", mapping).set("clusters", clusters).render());
            for i in 0..3 {
                assert!(rsm[i] > 0.0, "nothing is lit");
                let error = (sum[i] / rsm[i] - 1.0).abs();
                assert!(error < 1e-3, "{mapping}, {clusters} clusters, channel {i}: {} against {}", sum[i], rsm[i]);
            }
        }
    }
}

/// A buffer of clusters has as many elements as there are: a change of their number is another buffer, and what has room in it stays.
#[test]
fn clusters_survive_a_change_of_their_number() {
    let mut renderer = job().set("clusters", 16).set("adaptive", "off").keep(&["clusters_evaluated"]).render();
    for (number, least_active) in [(128, 64), (24, 12)] {
        let before = read_clusters(&renderer, "clusters");
        renderer.set_parameter("clusters", &number.to_string()).unwrap_or_else(|e| panic!("{e}"));
        renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
        let carried = read_clusters(&renderer, "clusters_evaluated");
        assert_eq!(carried.len(), number);
        for (c, (old, new)) in before.iter().zip(&carried).enumerate() {
            assert_eq!((old.texel, old.flux, old.count), (new.texel, new.flux, new.count), "cluster {c} of {number}");
        }
        // New ones are seeded at once, as many as a frame may.
        let active = read_clusters(&renderer, "clusters").iter().filter(|c| c.state == ACTIVE && c.count > 0).count();
        assert!(active >= least_active, "{active} of {number} are active");
        let (rsm, sum) = sums(&renderer);
        assert!((0..3).all(|i| (sum[i] / rsm[i] - 1.0).abs() < 1e-3), "{sum:?} W of {rsm:?} W");
    }
}

/// As many as there can be: each step of the clustering reaches all of them.
#[test]
fn four_thousand_clusters_hold_every_lit_texel() {
    let renderer = job().set("clusters", 4096).set("visibility", "none").set("seed.max_reseeds", 4096).frames(3).render();
    let active = read_clusters(&renderer, "clusters").iter().filter(|c| c.count > 0).count();
    assert!(active > 1000, "only {active} clusters have texels");
    let (rsm, sum) = sums(&renderer);
    assert!((0..3).all(|i| (sum[i] / rsm[i] - 1.0).abs() < 1e-3), "{sum:?} W of {rsm:?} W");
}

#[test]
fn every_lit_texel_lies_in_the_window_of_its_cluster() {
    let window = 96.0;
    let renderer = job().set("window", window).render();
    let map = read(&renderer, "cluster_map");
    let clusters = read_clusters(&renderer, "clusters_warped");
    for (x, y, flux) in texels(&read(&renderer, "rsm_flux")) {
        let cluster = map.pixel(x, y)[0];
        let lit = flux.iter().any(|&v| v > 0.0);
        assert_eq!(lit, cluster != NO_CLUSTER, "texel {x}, {y}: lit {lit}, cluster {cluster}");
        if lit {
            let centre = clusters[cluster as usize].texel;
            let offset = (f64::from(x) + 0.5 - centre[0]).abs().max((f64::from(y) + 0.5 - centre[1]).abs());
            assert!(offset <= window / 2.0, "texel {x}, {y} is {offset} texels from the centre of cluster {cluster}");
        }
    }
}

/// Brute force in f64 from what the map node read: [ACRSM] eqs. 4.4 and 4.5 with the node's default weights.
/// Texels whose two best clusters differ by less than 1e-4 of the distance may fall to either side of the f32 rounding.
#[test]
fn exact_mapping_is_the_nearest_cluster() {
    let renderer = job().set("mapping", "exact").render();
    let parameter = |name: &str| {
        let node = renderer.plan().nodes.iter().find(|n| n.id == "map").expect("a node `map`");
        node.params.iter().find(|(n, _)| n == name).expect("a weight").1.to_string().parse::<f64>().expect("a number")
    };
    let (w_x, w_n, w_rho) = (parameter("weight_position"), parameter("weight_normal"), parameter("weight_attribute"));
    let state = renderer.scene().sample(0.0);
    let diagonal = state.bounds.diagonal();
    let view = state.light_views[0].view;
    let (map, normals, distances, importance) =
        (read(&renderer, "cluster_map"), read(&renderer, "rsm_normal"), read(&renderer, "rsm_distance"), read(&renderer, "importance_map"));
    let clusters: Vec<(usize, Cluster)> =
        read_clusters(&renderer, "clusters_warped").into_iter().enumerate().filter(|(_, c)| c.state == ACTIVE).collect();
    let mut wrong = 0;
    let mut lit = 0;
    for y in 0..map.height {
        for x in 0..map.width {
            let chosen = map.pixel(x, y)[0];
            if chosen == NO_CLUSTER {
                continue;
            }
            lit += 1;
            let ndc = [(f64::from(x) + 0.5) / f64::from(map.width) * 2.0 - 1.0, 1.0 - (f64::from(y) + 0.5) / f64::from(map.height) * 2.0];
            let mut direction: [f64; 3] = std::array::from_fn(|i| {
                f64::from(view.forward[i])
                    + f64::from(view.right[i]) * ndc[0] * f64::from(view.tan_half_x)
                    + f64::from(view.up[i]) * ndc[1] * f64::from(view.tan_half_y)
            });
            let length = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
            direction.iter_mut().for_each(|v| *v /= length);
            let d = f64::from(distances.pixel(x, y)[0]);
            let position: [f64; 3] = std::array::from_fn(|i| f64::from(view.origin[i]) + direction[i] * d);
            let normal: [f64; 3] = std::array::from_fn(|i| f64::from(normals.pixel(x, y)[i]));
            let rho = f64::from(importance.pixel(x, y)[0]);
            let metric = |c: &Cluster| {
                let dx = (0..3).map(|i| (c.position[i] - position[i]).powi(2)).sum::<f64>().sqrt() / diagonal;
                let dn = 1.0 - (0..3).map(|i| c.normal[i] * normal[i]).sum::<f64>();
                w_x * dx + w_n * dn + w_rho * (c.importance - rho).abs()
            };
            let best = clusters.iter().map(|(_, c)| metric(c)).fold(f64::INFINITY, f64::min);
            let mine = clusters.iter().find(|(i, _)| *i == chosen as usize).map_or(f64::INFINITY, |(_, c)| metric(c));
            if mine > best + 1e-4 * best.max(1e-3) {
                wrong += 1;
            }
        }
    }
    assert!(lit > 1000, "only {lit} texels are lit");
    assert_eq!(wrong, 0, "of {lit} lit texels");
}
