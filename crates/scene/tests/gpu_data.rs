//! Layouts as WGSL has them, and views against their formulas in 64 bits.

use glam::{DVec3, Vec3};
use manylight_graph::shader::MemberKind;
use manylight_scene::gpu_data::{View, layouts};
use proptest::prelude::*;

/// Alignment, size and name of the WGSL types that occur.
fn wgsl_type(name: &str) -> (u32, u32) {
    match name {
        "f32" | "u32" => (4, 4),
        "vec3f" => (16, 12),
        "mat4x4f" => (16, 64),
        "View" => (16, size_of::<View>() as u32),
        other => panic!("unexpected type {other}"),
    }
}

fn round_up(value: u32, to: u32) -> u32 {
    value.div_ceil(to) * to
}

/// Name, offset and size of a member.
type Member = (String, u32, u32);

/// Structures of a WGSL text: names, members, size; laid out by the rules of WGSL.
fn wgsl_structs(text: &str) -> Vec<(String, Vec<Member>, u32)> {
    let mut out = Vec::new();
    for part in text.split("struct ").skip(1) {
        let (name, rest) = part.split_once('{').unwrap();
        let (body, _) = rest.split_once('}').unwrap();
        let (mut end, mut align) = (0, 1);
        let mut members = Vec::new();
        for line in body.lines() {
            let line = line.split("//").next().unwrap().trim().trim_end_matches(',');
            let Some((member, kind)) = line.split_once(": ") else { continue };
            let (alignment, size) = wgsl_type(kind);
            let offset = round_up(end, alignment);
            members.push((member.to_owned(), offset, size));
            (end, align) = (offset + size, align.max(alignment));
        }
        out.push((name.trim().to_owned(), members, round_up(end, align)));
    }
    out
}

#[test]
fn layouts_are_those_of_the_wgsl() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/common");
    let mut wgsl = wgsl_structs(&std::fs::read_to_string(format!("{folder}/scene.wgsl")).unwrap());
    wgsl.extend(wgsl_structs(&std::fs::read_to_string(format!("{folder}/points.wgsl")).unwrap()));
    wgsl.extend(wgsl_structs(&std::fs::read_to_string(format!("{folder}/texels.wgsl")).unwrap()));
    // Besides rays and hits, which only shaders make.
    let hierarchy = wgsl_structs(&std::fs::read_to_string(format!("{folder}/bvh.wgsl")).unwrap());
    wgsl.extend(hierarchy.into_iter().filter(|(name, ..)| name.starts_with("Bvh")));
    let rust = layouts();
    assert_eq!(rust.len(), wgsl.len());
    for (name, members, size) in wgsl {
        let (_, layout) = rust.iter().find(|(rust, _)| *rust == name).unwrap_or_else(|| panic!("no Rust twin of {name}"));
        assert_eq!(layout.size, size, "{name}");
        let ours: Vec<_> = layout
            .members
            .iter()
            .map(|member| {
                let size = match &member.kind {
                    MemberKind::Numeric { rows, columns, .. } => 4 * rows * columns,
                    MemberKind::Struct(other) => wgsl_type(other).1,
                    MemberKind::Array { .. } => panic!("{name}.{}", member.name),
                };
                (member.name.clone(), member.offset, size)
            })
            .collect();
        assert_eq!(ours, members, "{name}");
    }
}

#[test]
fn the_known_view_of_the_cornell_box() {
    let view =
        View::perspective(Vec3::new(2.78, 2.73, -8.0), Vec3::new(2.78, 2.73, 0.0), Vec3::Y, 39.3077_f32.to_radians(), 1.0, 0.01, 50.0);
    assert_eq!(view.forward, Vec3::Z);
    assert_eq!(view.right, Vec3::NEG_X);
    assert_eq!(view.up, Vec3::Y);
    assert!((view.tan_half_x - 0.357_14).abs() < 1e-5, "{}", view.tan_half_x);
    // The middle of the picture, and a point to the right and above.
    let clip = view.clip_from_world * Vec3::new(2.78, 2.73, 2.0).extend(1.0);
    assert!(clip.x.abs() < 1e-5 && clip.y.abs() < 1e-5 && (clip.w - 10.0).abs() < 1e-5);
    let clip = view.clip_from_world * Vec3::new(1.78, 3.73, 2.0).extend(1.0);
    assert!(clip.x > 0.0 && clip.y > 0.0);
}

#[test]
fn degenerate_views_are_views() {
    let views = [
        View::perspective(Vec3::ONE, Vec3::ONE, Vec3::Y, 1.0, 1.0, 0.1, 10.0),
        View::perspective(Vec3::ZERO, Vec3::Y, Vec3::Y, 1.0, 1.0, 0.1, 10.0),
        View::perspective(Vec3::ZERO, Vec3::X, Vec3::ZERO, 1.0, 1.0, 0.1, 10.0),
        View::perspective(Vec3::ZERO, -Vec3::Y, Vec3::Y, 3.1, 1e-3, 0.1, 10.0),
    ];
    for view in views {
        assert!(view.clip_from_world.is_finite());
        assert!(view.right.is_normalized() && view.up.is_normalized() && view.forward.is_normalized());
        assert!(view.right.dot(view.up).abs() < 1e-6 && view.right.dot(view.forward).abs() < 1e-6);
    }
}

fn vector(size: f32) -> impl Strategy<Value = Vec3> {
    (-size..size, -size..size, -size..size).prop_map(|(x, y, z)| Vec3::new(x, y, z))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    /// Clip coordinates in 32 bits against the formulas in 64 bits: x = (p−o)·right / (tan·depth), z = near / depth.
    #[test]
    fn clip_coordinates_follow_their_formulas(
        origin in vector(10.0), target in vector(10.0), point in vector(10.0), fov in 0.1_f32..3.0, aspect in 0.2_f32..5.0,
    ) {
        let (o, t, p) = (origin.as_dvec3(), target.as_dvec3(), point.as_dvec3());
        let forward = (t - o).normalize_or_zero();
        let across = forward.cross(DVec3::Y);
        prop_assume!(across.length() > 0.05);
        let right = across.normalize();
        let up = right.cross(forward);
        let near = 0.01_f32;
        let view = View::perspective(origin, target, Vec3::Y, fov, aspect, near, 100.0);
        let tan = (f64::from(fov) / 2.0).tan();
        let depth = (p - o).dot(forward);
        let clip = view.clip_from_world * point.extend(1.0);
        // Three products and sums of numbers up to 60, scaled by 1/tan.
        let tolerance = 60.0 * 8.0 * f64::from(f32::EPSILON) * (1.0 + 1.0 / tan) * (1.0 + f64::from(aspect));
        prop_assert!((f64::from(clip.x) - (p - o).dot(right) / tan).abs() < tolerance);
        prop_assert!((f64::from(clip.y) - (p - o).dot(up) / tan * f64::from(aspect)).abs() < tolerance);
        prop_assert_eq!(clip.z, near);
        prop_assert!((f64::from(clip.w) - depth).abs() < tolerance);
        prop_assert!((f64::from(view.tan_half_y) * f64::from(aspect) - tan).abs() < 1e-5 * tan);
    }
}
