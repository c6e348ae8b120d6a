//! Key frames.

use glam::{Quat, Vec3};
use manylight_scene::motion::{Pose, Repeat, Track};

fn pose(x: f32, angle_deg: f32) -> Pose {
    Pose { translate: Vec3::X * x, rotate: Quat::from_rotation_y(angle_deg.to_radians()), scale: Vec3::splat(1.0 + x) }
}

#[test]
fn values_are_mixed_between_keys_and_stay_outside() {
    let track = Track::keyed(vec![(1.0, pose(0.0, 0.0)), (3.0, pose(4.0, 90.0))], Repeat::Clamp).unwrap();
    assert!(track.moves());
    assert_eq!(track.at(-5.0), pose(0.0, 0.0));
    assert_eq!(track.at(1.0), pose(0.0, 0.0));
    assert_eq!(track.at(3.0), pose(4.0, 90.0));
    assert_eq!(track.at(99.0), pose(4.0, 90.0));
    let middle = track.at(2.0);
    assert_eq!(middle.translate, Vec3::X * 2.0);
    assert_eq!(middle.scale, Vec3::splat(3.0));
    assert!(middle.rotate.angle_between(Quat::from_rotation_y(45_f32.to_radians())) < 1e-3);
}

#[test]
fn a_loop_starts_again() {
    let track = Track::keyed(vec![(1.0, pose(0.0, 0.0)), (2.0, pose(1.0, 0.0)), (3.0, pose(0.0, 0.0))], Repeat::Loop).unwrap();
    for (time, x) in [(1.5, 0.5), (2.0, 1.0), (3.5, 0.5), (4.0, 1.0), (-0.5, 0.5), (1001.25, 0.25)] {
        assert!((track.at(time).translate.x - x).abs() < 1e-5, "{time}: {}", track.at(time).translate.x);
    }
}

#[test]
fn odd_times_are_harmless() {
    let track = Track::keyed(vec![(0.0, pose(0.0, 0.0)), (1.0, pose(1.0, 0.0))], Repeat::Loop).unwrap();
    for time in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE] {
        assert!(track.at(time).translate.is_finite());
    }
    assert_eq!(Track::fixed(pose(2.0, 0.0)).at(f64::NAN), pose(2.0, 0.0));
}

#[test]
fn keys_must_be_in_order() {
    assert!(Track::<Pose>::keyed(Vec::new(), Repeat::Clamp).is_none());
    assert!(Track::keyed(vec![(1.0, pose(0.0, 0.0)), (1.0, pose(0.0, 0.0))], Repeat::Clamp).is_none());
    assert!(Track::keyed(vec![(f64::NAN, pose(0.0, 0.0))], Repeat::Clamp).is_none());
}
