//! Charts over the surfaces of a scene and their places in one texture ([PCA] 3.1: a texture atlas, for a camera that moves freely).

use std::collections::BTreeMap;

use glam::Vec3;
use half::f16;
use manylight_passes::{
    Baked,
    baked::{CORNERS, Header, Lookup},
};
use manylight_scene::Scene;
use uvunwrap::{Atlas, Density, MeshInput, Options, generate};

use super::{BakeError, encode::header};

/// Faces of a chart differ from its mean normal by no more than this, in degrees: two faces at a right angle are never in one, so that light of one is not
/// mixed into the other.
const WIDEST_ANGLE_DEG: f32 = 40.0;
/// Free texels around each chart. Bilinear look-ups reach one texel beyond those that a chart touches.
const BORDER: u32 = 1;

/// All triangles that stand still, in world space, object by object.
struct Surfaces {
    positions: Vec<[f32; 3]>,
    indices: Vec<u32>,
    objects: Vec<u32>,
}

impl Surfaces {
    fn of(scene: &Scene) -> Self {
        let state = scene.sample(0.0);
        let (vertices, triangles) = (scene.gpu_vertices_at(&state), scene.gpu_triangles_at(&state));
        let mut surfaces = Self { positions: Vec::new(), indices: Vec::new(), objects: Vec::new() };
        let mut known: BTreeMap<(u32, u32), u32> = BTreeMap::new();
        let used = &triangles[..(state.info.triangle_count as usize).min(triangles.len())];
        for triangle in used.iter().filter(|t| scene.stands_still(&scene.objects[t.object as usize])) {
            let to_world = &state.objects[triangle.object as usize].world_from_object;
            for vertex in [triangle.a, triangle.b, triangle.c] {
                let index = *known.entry((triangle.object, vertex)).or_insert_with(|| {
                    let position: Vec3 = to_world.transform_point3(vertices[vertex as usize].position);
                    surfaces.positions.push(position.to_array());
                    surfaces.positions.len() as u32 - 1
                });
                surfaces.indices.push(index);
            }
            surfaces.objects.push(triangle.object);
        }
        surfaces
    }
}

/// An atlas over both sides of all surfaces that stand still, of at most so many texels: light without any components, which says where the triangles are.
///
/// # Errors
/// There is no such surface, or there are too many charts for so many texels.
pub fn atlas(scene: &Scene, texels: u32) -> Result<Baked, BakeError> {
    let front = Surfaces::of(scene);
    if front.objects.is_empty() {
        return Err(BakeError::Input(format!("every object of `{}` moves or deforms: there is nothing to bake", scene.name)));
    }
    // A surface is seen from both sides. Its back is the same triangle the other way round, in charts of its own.
    let back: Vec<u32> = front.indices.chunks_exact(3).flat_map(|t| [t[0], t[2], t[1]]).collect();
    let mesh = |indices| MeshInput { face_materials: Some(&front.objects), ..MeshInput::new(&front.positions, indices) };
    let page_size = texels.isqrt();
    let options =
        Options { max_chart_angle: WIDEST_ANGLE_DEG, density: Density::Auto { page_size }, padding: BORDER, ..Options::default() };
    let packed = generate(&[mesh(&front.indices), mesh(&back)], &options)
        .map_err(|e| BakeError::Input(format!("no atlas over `{}`: {e}", scene.name)))?;
    if packed.page_count != 1 {
        let charts = packed.chart_count;
        return Err(BakeError::Input(format!(
            "`{}` has {charts} charts, which {texels} texels cannot hold: give more by --texels",
            scene.name
        )));
    }
    Ok(blank(scene, &packed, front.objects.len()))
}

/// Light without components in the layout of an atlas.
fn blank(scene: &Scene, packed: &Atlas, triangles: usize) -> Baked {
    let (width, height) = (packed.width as usize, packed.height as usize);
    let mut corners = vec![[0.0; 2]; CORNERS * triangles];
    // Of the back, the second and the third corner are exchanged.
    for (mesh, order) in packed.meshes.iter().zip([[0, 1, 2], [3, 5, 4]]) {
        for (own, triangle) in corners.chunks_exact_mut(CORNERS).zip(mesh.indices.chunks_exact(3)) {
            let vertices = [0, 1, 2].map(|corner| mesh.vertices[triangle[corner] as usize]);
            if vertices.iter().all(|vertex| vertex.chart.is_some()) {
                (0..3).for_each(|i| own[order[i]] = [vertices[i].uv[0] * width as f32, vertices[i].uv[1] * height as f32]);
            }
        }
    }
    let header = Header { width, height, triangles, keys: vec![0.0], ..header(scene, Lookup::Atlas, 1.0, false, 0) };
    let texels = vec![f16::ZERO; 4 * width * height * header.layers()];
    Baked { weights: vec![0.0; header.columns()], texels, corners, header }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use glam::{DVec2, DVec3};
    use manylight_passes::atlas::texels;
    use manylight_scene::gpu_data::{NO_TRIANGLE, SurfaceTexel};

    use super::*;

    fn scene(name: &str) -> Scene {
        Scene::load(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets").join(name)).expect("a scene")
    }

    /// A side of a triangle: its corners in the world and in the atlas, and its unit normal there.
    struct Side {
        triangle: usize,
        world: [DVec3; 3],
        place: [DVec2; 3],
        normal: DVec3,
    }

    fn sides(scene: &Scene, baked: &Baked) -> Vec<Side> {
        let state = scene.sample(0.0);
        let (vertices, triangles) = (scene.gpu_vertices_at(&state), scene.gpu_triangles_at(&state));
        let mut sides = Vec::new();
        for (triangle, corners) in baked.corners_at(scene, &state).chunks_exact(CORNERS).enumerate() {
            let t = triangles[triangle];
            let to_world = state.objects[t.object as usize].world_from_object.as_dmat4();
            let world = [t.a, t.b, t.c].map(|v| to_world.transform_point3(vertices[v as usize].position.as_dvec3()));
            let normal = (world[1] - world[0]).cross(world[2] - world[0]).normalize_or_zero();
            for (side, corners) in corners.chunks_exact(3).enumerate().filter(|(_, corners)| !corners.contains(&[0.0; 2])) {
                let place = [0, 1, 2].map(|i| DVec2::new(corners[i][0].into(), corners[i][1].into()));
                sides.push(Side { triangle, world, place, normal: if side == 0 { normal } else { -normal } });
            }
        }
        sides
    }

    /// By how much two triangles are apart, at least; negative where they overlap. Over the normals of all edges: one of them parts what can be parted.
    fn gap(a: &[DVec2; 3], b: &[DVec2; 3]) -> f64 {
        let reach = |t: &[DVec2; 3], axis: DVec2| {
            let all = t.map(|p| p.dot(axis));
            (all.iter().copied().fold(f64::MAX, f64::min), all.iter().copied().fold(f64::MIN, f64::max))
        };
        let edges = [a, b].into_iter().flat_map(|t| [t[1] - t[0], t[2] - t[1], t[0] - t[2]]);
        let gaps = edges.filter_map(|edge| edge.perp().try_normalize()).map(|axis| {
            let ((a_low, a_high), (b_low, b_high)) = (reach(a, axis), reach(b, axis));
            (b_low - a_high).max(a_low - b_high)
        });
        gaps.fold(f64::MIN, f64::max)
    }

    /// A number in [0, 1) that looks random and is the same on each run.
    fn random(state: &mut u64) -> f64 {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 11) as f64 / (1_u64 << 53) as f64
    }

    #[test]
    fn no_two_triangles_share_a_place() {
        for name in ["day.ron", "cornell.ron", "floating.ron"] {
            let scene = scene(name);
            let sides = sides(&scene, &atlas(&scene, 8192).expect("an atlas"));
            for (i, a) in sides.iter().enumerate() {
                for b in &sides[..i] {
                    // Coordinates are 32-bit floats below 128, so that edges that are shared may be off by 2⁻¹⁷ at each end.
                    assert!(gap(&a.place, &b.place) >= -4.0 * 2.0_f64.powi(-17), "{name}: {} and {}", a.triangle, b.triangle);
                }
            }
        }
    }

    #[test]
    fn texels_are_points_of_their_triangles() {
        for name in ["day.ron", "cornell.ron", "floating.ron"] {
            let scene = scene(name);
            let baked = atlas(&scene, 4096).expect("an atlas");
            let sides = sides(&scene, &baked);
            let mut used = 0;
            for texel in texels(&scene, &scene.sample(0.0), &baked).iter().filter(|texel| texel.triangle != NO_TRIANGLE) {
                let own = |side: &&Side| side.triangle == texel.triangle as usize && side.normal.dot(texel.geometric.as_dvec3()) > 0.999;
                let side = sides.iter().find(own).expect("a side");
                let (u, v) = (f64::from(texel.u), f64::from(texel.v));
                let [a, b, c] = side.world;
                let expected = a + u * (b - a) + v * (c - a);
                assert!(u > 0.0 && v > 0.0 && u + v < 1.0, "{name}: within its edges: {texel:?}");
                // Positions and weights are 32-bit floats; edges are up to some ten metres long.
                assert!(expected.distance(texel.position.as_dvec3()) < 1e-5, "{name}: {texel:?}");
                assert!((texel.normal.length() - 1.0).abs() < 1e-5 && texel.normal.dot(texel.geometric) >= 0.0);
                used += 1;
            }
            println!("{name}: {used} of {} texels", baked.header.width * baked.header.height);
            assert!(2 * used > baked.header.width * baked.header.height, "{name}: {used}");
        }
    }

    /// Whatever point of a surface is looked up, the four texels around it are of surfaces that are near and face the same way.
    #[test]
    fn look_ups_stay_in_their_chart() {
        let mut state = 1;
        for name in ["day.ron", "cornell.ron", "floating.ron"] {
            let scene = scene(name);
            let baked = atlas(&scene, 8192).expect("an atlas");
            let texels = texels(&scene, &scene.sample(0.0), &baked);
            for side in sides(&scene, &baked) {
                let area = |[a, b, c]: [DVec3; 3]| (b - a).cross(c - a).length();
                // The side of a texel on this triangle.
                let side_world = (area(side.world) / area(side.place.map(|p| p.extend(0.0)))).sqrt();
                for _ in 0..64 {
                    let (u, v) = (random(&mut state), random(&mut state));
                    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                    let at = |[a, b, c]: [DVec3; 3]| a + u * (b - a) + v * (c - a);
                    let (place, point) = (at(side.place.map(|p| p.extend(0.0))), at(side.world));
                    let first = (place - 0.5).floor();
                    for (dx, dy) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
                        let index = (first.y + dy) as usize * baked.header.width + (first.x + dx) as usize;
                        let texel: &SurfaceTexel = &texels[index];
                        assert!(texel.triangle != NO_TRIANGLE, "{name}: triangle {} at {place}", side.triangle);
                        let (far, cosine) = (point.distance(texel.position.as_dvec3()), side.normal.dot(texel.geometric.as_dvec3()));
                        // A texel along both axes, twice that for charts that are not planes; both within the angle of a chart.
                        assert!(far <= 4.0 * side_world, "{name}: triangle {}: {far} of {side_world}", side.triangle);
                        assert!(cosine >= f64::from(2.0 * WIDEST_ANGLE_DEG).to_radians().cos(), "{name}: triangle {}", side.triangle);
                    }
                }
            }
        }
    }

    #[test]
    fn an_atlas_is_always_the_same() {
        let scene = scene("cornell.ron");
        assert_eq!(atlas(&scene, 4096).expect("an atlas"), atlas(&scene, 4096).expect("an atlas"));
    }

    #[test]
    fn what_moves_has_no_place() {
        let scene = scene("moving.ron");
        let baked = atlas(&scene, 4096).expect("an atlas");
        let state = scene.sample(0.0);
        let corners = baked.corners_at(&scene, &state);
        let triangles = scene.gpu_triangles_at(&state);
        for (own, triangle) in corners.chunks_exact(CORNERS).zip(&triangles) {
            let still = scene.stands_still(&scene.objects[triangle.object as usize]);
            assert_eq!(own.iter().all(|corner| *corner != [0.0; 2]), still, "{triangle:?}");
            assert_eq!(own.contains(&[0.0; 2]), !still, "{triangle:?}");
        }
    }

    #[test]
    fn too_few_texels_are_refused() {
        let error = atlas(&scene("floating.ron"), 64).expect_err("many charts").to_string();
        assert!(error.contains("--texels") || error.contains("no atlas"), "{error}");
    }
}
