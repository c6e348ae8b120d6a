//! At which times key frames are: uniform, or by bisection where light changes ([PCA] 3.2).

use std::collections::BTreeMap;

/// When an interval is split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// When its interpolated middle differs from the rendered one: the error that the interval makes.
    Middle,
    /// The paper's: when its interpolated middle differs from its first or its last frame, that is, when these differ from each other.
    Ends,
}

/// Which key frames there are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Schedule {
    /// One every so many seconds; the interval is shortened to a whole part of the period.
    Uniform {
        /// Seconds.
        interval_s: f64,
    },
    /// Intervals are halved while they make more than a mean FLIP.
    Bisection {
        /// No interval is shorter than this, seconds.
        shortest_s: f64,
        /// Intervals longer than this are halved whatever their middle: what happens within them would not be seen, seconds.
        longest_s: f64,
        /// Mean FLIP.
        threshold: f64,
        /// What is compared.
        criterion: Criterion,
    },
}

/// Times of a uniform schedule, from 0, without the end of the period.
pub fn uniform(period_s: f64, interval_s: f64) -> Vec<f64> {
    let count = (period_s / interval_s).ceil().max(1.0) as usize;
    (0..count).map(|i| period_s * i as f64 / count as f64).collect()
}

/// Times of a bisection, which starts with two halves of the period.
///
/// `frame` renders the frame at a time, which is within the period; `mix` is the middle between two frames, `difference` what an eye sees of the
/// difference between an image and a reference. Frames that were only looked at are no keys.
pub fn bisect<F: Clone, E>(
    period_s: f64,
    schedule: (f64, f64, f64, Criterion),
    mut frame: impl FnMut(f64) -> Result<F, E>,
    mix: impl Fn(&F, &F) -> F,
    difference: impl Fn(&F, &F) -> Result<f64, E>,
) -> Result<Vec<f64>, E> {
    let (shortest_s, longest_s, threshold, criterion) = schedule;
    let mut known: BTreeMap<u64, F> = BTreeMap::new();
    // Non-negative numbers have the order of their bits.
    let mut at = |time: f64| -> Result<F, E> {
        let time = if time >= period_s { 0.0 } else { time };
        if let Some(known) = known.get(&time.to_bits()) {
            return Ok(known.clone());
        }
        let new = frame(time)?;
        known.insert(time.to_bits(), new.clone());
        Ok(new)
    };
    let mut keys = vec![0.0, 0.5 * period_s];
    let mut open = vec![(0.5 * period_s, period_s), (0.0, 0.5 * period_s)];
    while let Some((first, last)) = open.pop() {
        let half = 0.5 * (last - first);
        if half < shortest_s {
            continue;
        }
        let middle = first + half;
        let split = 2.0 * half > longest_s || {
            let (a, b) = (at(first)?, at(last)?);
            let mixed = mix(&a, &b);
            match criterion {
                Criterion::Middle => difference(&mixed, &at(middle)?)? > threshold,
                Criterion::Ends => difference(&mixed, &a)? > threshold || difference(&mixed, &b)? > threshold,
            }
        };
        if split {
            keys.push(middle);
            open.push((middle, last));
            open.push((first, middle));
        }
    }
    keys.sort_by(f64::total_cmp);
    Ok(keys)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames are one number, which jumps at 10 h and is linear elsewhere.
    fn light(time: f64) -> Result<f64, ()> {
        Ok(if time < 36_000.0 { time / 36_000.0 } else { 3.0 - (time - 36_000.0) / 50_400.0 })
    }

    fn keys(threshold: f64, criterion: Criterion) -> Vec<f64> {
        let mix = |a: &f64, b: &f64| 0.5 * (a + b);
        bisect(86_400.0, (300.0, 43_200.0, threshold, criterion), light, mix, |a, b| Ok::<_, ()>((a - b).abs())).expect("no error")
    }

    #[test]
    fn intervals_are_short_where_light_changes() {
        let keys = keys(0.2, Criterion::Middle);
        let shortest = keys.windows(2).min_by(|a, b| (a[1] - a[0]).total_cmp(&(b[1] - b[0]))).expect("intervals");
        assert!(shortest[0] <= 36_000.0 && 36_000.0 <= shortest[1], "{shortest:?}");
        assert_eq!(shortest[1] - shortest[0], 337.5, "halved until another half would be below five minutes");
        assert!(keys.len() < 30 && keys[0] == 0.0, "{keys:?}");
    }

    #[test]
    fn the_ends_differ_where_light_is_linear_as_well() {
        assert!(keys(0.2, Criterion::Ends).len() > keys(0.2, Criterion::Middle).len());
    }

    #[test]
    fn a_lower_threshold_keeps_more() {
        let counts: Vec<usize> = [1.0, 0.3, 0.1, 0.01].map(|threshold| keys(threshold, Criterion::Middle).len()).to_vec();
        assert!(counts.is_sorted() && counts[0] < counts[3], "{counts:?}");
    }

    #[test]
    fn long_intervals_are_halved_anyway() {
        let never = bisect(86_400.0, (300.0, 3600.0, 9.0, Criterion::Middle), light, |a, b| 0.5 * (a + b), |_, _| Ok::<_, ()>(0.0));
        assert_eq!(never.expect("no error").len(), 32);
    }

    #[test]
    fn a_uniform_schedule_fills_the_period() {
        assert_eq!(uniform(86_400.0, 300.0).len(), 288);
        assert_eq!(uniform(100.0, 40.0), [0.0, 100.0 / 3.0, 200.0 / 3.0]);
    }
}
