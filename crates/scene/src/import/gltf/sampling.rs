//! Motion of any kind as key frames that are near enough.

use crate::motion::{Interpolate, Repeat, Track};

/// A part between two keys of the file is halved so many times at most.
const DEPTH: u32 = 8;
/// A track never has more keys than this and those of the file.
const MOST_KEYS: usize = 1 << 16;
/// Where between two keys the motion is compared.
const COMPARED: [f64; 3] = [0.25, 0.5, 0.75];
/// Times closer than this are a step.
const SHORTEST: f64 = 1e-5;

/// Key frames from `span.0` to `span.1`, after which they start again, and how far they are from the motion at most.
///
/// Between two keys of the file more are put in until the motion is within a distance of 1.
pub(super) fn track<T: Interpolate>(
    span: (f64, f64),
    mut breaks: Vec<f64>,
    exact: impl Fn(f64) -> T,
    distance: impl Fn(&T, &T) -> f64,
) -> (Track<T>, f64) {
    breaks.extend([span.0, span.1]);
    breaks.retain(|time| (span.0..=span.1).contains(time));
    breaks.sort_by(f64::total_cmp);
    breaks.dedup();
    let mut keys: Vec<(f64, T)> = vec![(breaks[0], exact(breaks[0]))];
    let mut worst = 0.0_f64;
    for pair in breaks.windows(2) {
        // Parts still to be done, the earliest last.
        let mut open = vec![(pair[1], DEPTH)];
        while let Some((end, depth)) = open.pop() {
            let Some((start, before)) = keys.last() else { break };
            let after = exact(end);
            let length = end - start;
            let at = |share: f64| distance(&before.interpolate(&after, share as f32), &exact(start + share * length));
            let far = if length <= SHORTEST { 0.0 } else { COMPARED.into_iter().map(at).fold(0.0, f64::max) };
            if far > 1.0 && depth > 0 && keys.len() < MOST_KEYS {
                open.push((end, depth - 1));
                open.push((start + 0.5 * length, depth - 1));
            } else {
                worst = worst.max(far);
                keys.push((end, after));
            }
        }
    }
    let (first, still) = (keys[0].1.clone(), keys.iter().all(|key| key.1 == keys[0].1));
    let keyed = if still { None } else { Track::keyed(keys, Repeat::Loop) };
    (keyed.unwrap_or_else(|| Track::fixed(first)), worst)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::motion::LightPose;

    fn pose(x: f64) -> LightPose {
        LightPose { position: Vec3::X * x as f32, target: Vec3::ZERO, strength: Vec3::ONE }
    }

    fn far(a: &LightPose, b: &LightPose) -> f64 {
        f64::from(a.position.distance(b.position)) / 0.01
    }

    #[test]
    fn keys_are_put_in_until_the_motion_is_near_enough() {
        let (track, worst) = track((0.0, 2.0), vec![0.5, 7.0], |time| pose((3.0 * time).sin()), far);
        assert!(worst <= 1.0 && (10..100).contains(&track.keys().len()), "{worst} {}", track.keys().len());
        for i in 0..400 {
            let time = f64::from(i) * 0.005;
            assert!(far(&track.at(time), &pose((3.0 * time).sin())) < 1.2, "{time}");
        }
        assert!(track.keys().iter().any(|key| key.0 == 0.5));
    }

    #[test]
    fn straight_motion_has_the_keys_of_the_file_and_no_motion_has_none() {
        let (straight, worst) = track((0.0, 2.0), vec![1.0], pose, far);
        assert_eq!((straight.keys().len(), worst < 1e-4), (3, true));
        assert!(!track((0.0, 2.0), vec![1.0], |_| pose(1.0), far).0.moves());
        assert!(!track((0.0, 0.0), vec![], pose, far).0.moves());
    }
}
