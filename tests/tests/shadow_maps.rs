//! Shadow maps of the virtual lights: exact ones by triangles and by rays, lights that share them, and their Fourier series. [CV]

use manylight_gpu::Image;
use manylight_passes::Renderer;

use crate::{
    reference::{error, exr, scenes},
    renders::{Cluster, Job, read, read_clusters},
};

/// Pipelines that are presets of the shared stages.
fn preset(name: &str, job: Job) -> Job {
    Job { pipeline: format!("pipelines/{name}.ron"), ..job }
}

/// Texels of the atlas whose whole image is above the horizon, with their values in both renders.
fn texels<'a>(a: &'a Image, b: &'a Image, map_size: u32) -> impl Iterator<Item = [f32; 2]> + 'a {
    let inside = move |v: u32| (f64::from(v % map_size) + 0.5) * 2.0 / f64::from(map_size) - 1.0;
    (0..a.height)
        .flat_map(move |y| (0..a.width).map(move |x| (x, y)))
        .filter(move |&(x, y)| inside(x).hypot(inside(y)) < 1.0)
        .map(|(x, y)| [a.pixel(x, y)[0], b.pixel(x, y)[0]])
}

/// Triangles are rasterized texel by texel with each texel's own ray, so the two ways differ in rays that graze an edge, and by rounding: distances
/// come from a determinant here and from a plane there, 1e-4 of each other. Both kinds of scene: large triangles that curve, small ones of a sphere.
#[test]
fn rasterized_maps_are_traced_maps() {
    for scene in ["cornell", "glossy", "moving"] {
        let map = |maps: &str| {
            let job = Job::asset(scene)
                .small()
                .frames(2)
                .set("visibility", "simple")
                .set("maps", maps)
                .set("ism_size", 64)
                .set("atlas_width", 1024);
            read(&job.keep(&["ism"]).render(), "ism")
        };
        let (rasterized, traced) = (map("rasterized"), map("traced"));
        let all = texels(&rasterized, &traced, 64).count();
        let other = texels(&rasterized, &traced, 64).filter(|[a, b]| (a - b).abs() > 1e-4 * b).count();
        let full = texels(&rasterized, &traced, 64).filter(|[a, _]| *a < 1.0).count();
        println!("{scene}: {other} of {all} texels differ, {full} hold something");
        assert!(full > all / 4, "{scene}: {full} of {all} texels hold something");
        assert!(other < all / 500, "{scene}: {other} of {all} texels differ");
    }
}

fn grouped(casters: u32) -> Job {
    let job = Job::asset("cornell").small().frames(1).set("sampling", "samples").set("clusters", 256).set("visibility", "simple");
    job.set("casters", casters).set("casters.caster_centre", "mean").keep(&["clusters", "casters", "caster_of"])
}

fn caster_of(renderer: &Renderer) -> Vec<usize> {
    let json = renderer.read_json("caster_of").unwrap_or_else(|e| panic!("{e}"));
    json.as_array().expect("an array").iter().map(|v| v.as_u64().expect("a number") as usize).collect()
}

#[test]
fn as_many_casters_as_lights_are_the_lights() {
    let renderer = grouped(4096).render();
    let same = |a: &Cluster, b: &Cluster| a.position == b.position && a.normal == b.normal && a.area == b.area && a.flux == b.flux;
    let (lights, casters) = (read_clusters(&renderer, "clusters"), read_clusters(&renderer, "casters"));
    assert_eq!(lights.len(), casters.len());
    assert!(lights.iter().zip(&casters).all(|(a, b)| same(a, b)));
    assert!(caster_of(&renderer).into_iter().eq(0..lights.len()));
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|i| a[i] - b[i])
}

/// The orthonormal basis of Duff et al., as in `shaders/common/paraboloid.wgsl`.
fn basis(n: [f64; 3]) -> [[f64; 3]; 2] {
    let s = if n[2] >= 0.0 { 1.0 } else { -1.0 };
    let a = -1.0 / (s + n[2]);
    let b = n[0] * n[1] * a;
    [[1.0 + s * n[0] * n[0] * a, s * b, -s * n[0]], [b, s + n[1] * n[1] * a, -n[1]]]
}

/// A twin in 64 bits of the final assignment and of the rectangles, by distance alone and by angle alone: the scene's size does not matter then.
/// Distances tie within rounding: a light may go to a caster that is 1e-3 farther (units; radians, whose square is half of what a cosine loses).
#[test]
fn groups_are_those_of_the_nearest_caster() {
    for (count, weight) in [(1, 1.0), (5, 1.0), (30, 1.0), (5, 0.0)] {
        let renderer = grouped(count).set("casters.caster_position_weight", weight).render();
        let (lights, casters, of) = (read_clusters(&renderer, "clusters"), read_clusters(&renderer, "casters"), caster_of(&renderer));
        assert_eq!(casters.len(), count as usize);
        let distance = |light: &Cluster, caster: &Cluster| {
            let offset = minus(light.position, caster.position);
            let angle = dot(light.normal, caster.normal).clamp(-1.0, 1.0).acos();
            if weight > 0.0 { dot(offset, offset).sqrt() } else { angle }
        };
        let active: Vec<_> = casters.iter().filter(|c| c.state == 1).collect();
        // By their normals alone the lights of a box are of five kinds at most.
        assert!(weight == 0.0 || active.len() * 4 >= casters.len() * 3, "{} of {count} casters have lights", active.len());
        for (light, &own) in lights.iter().zip(&of).filter(|(light, _)| light.state == 1) {
            let least = active.iter().map(|c| distance(light, c)).fold(f64::MAX, f64::min);
            assert!(distance(light, &casters[own]) <= least + 1e-3, "{own}: {} against {least}", distance(light, &casters[own]));
        }
        for (k, caster) in casters.iter().enumerate().filter(|(_, c)| c.state == 1) {
            let own: Vec<_> = lights.iter().zip(&of).filter(|&(l, &o)| o == k && l.state == 1).map(|(l, _)| l).collect();
            for i in 0..3 {
                let flux: f64 = own.iter().map(|l| l.flux[i]).sum();
                assert!((caster.flux[i] - flux).abs() <= 1e-4 * flux, "flux of caster {k}: {} against {flux}", caster.flux[i]);
            }
            let sides = basis(caster.normal).map(|axis| {
                let along = own.iter().map(|l| dot(minus(l.position, caster.position), axis));
                let (low, high) = along.fold((0.0_f64, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
                high - low
            });
            let area = own.iter().map(|l| l.area).fold(sides[0] * sides[1], f64::max);
            assert!((caster.area - area).abs() <= 1e-3 * area, "area of caster {k}: {} against {area}", caster.area);
        }
    }
}

/// In an empty box nothing casts a shadow; what a series darkens there it makes up. The more terms, the less a surface may be in front of itself.
/// Measured, mean over pixels at 64²: 0.965 for M = 4, 0.914 for 8, nearly all of it in corners.
#[test]
fn a_series_invents_little_shadow() {
    for (terms, least) in [(4, 0.95), (8, 0.9)] {
        let job = preset("clustered_visibility", Job::asset("cornell_empty").small())
            .set("terms", terms)
            .set("ism_size", 64)
            .set("atlas_width", 512);
        let image = read(&job.keep(&["indirect"]).render(), "indirect");
        let (mut kept, mut lit) = (0.0, 0.0);
        for y in 0..image.height {
            for x in 0..image.width {
                let p = image.pixel(x, y);
                if p[0] > 0.0 {
                    kept += f64::from(p[3]);
                    lit += 1.0;
                }
            }
        }
        println!("{terms} terms: {:.4} of the light is kept", kept / lit);
        assert!(lit > 0.0 && kept / lit > least && kept / lit <= 1.0 + 1e-3, "{terms} terms: {}", kept / lit);
    }
}

/// [CV] fig. 10: 1024 lights whose shadows come from 30 casters are nearly as right as with a shadow for each light: at most 1.25 times the error.
/// Measured on the Cornell box: 8.0 against 7.6 %.
#[test]
fn thirty_casters_are_nearly_as_right_as_a_shadow_for_each_light() {
    let scene = &scenes()[0];
    let reference = exr(&scene.reference.join("onebounce.exr"));
    let measure = |job: Job| {
        let (mae, energy) = error(&read(&job.frames(1).keep(&["indirect"]).render(), "indirect"), &reference);
        println!("mean absolute error {:.2} %, energy {energy:.3}", 100.0 * mae);
        mae
    };
    let job = || preset("clustered_visibility", Job::scene(&scene.file));
    let shared = measure(job().set("ism_size", 128));
    let own = measure(job().set("visibility", "exact"));
    assert!(shared <= 1.25 * own, "{shared} against {own}");
}
