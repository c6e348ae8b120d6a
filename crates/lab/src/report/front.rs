//! The Pareto front: what no other run beats.

/// Indices of the points that no other point beats: none is at least as good in both coordinates and better in one. Less is better.
///
/// Equal points are on the front together. A point with a coordinate that is not finite is neither on the front nor beats another.
/// The indices come by rising first coordinate, then rising index.
pub fn pareto(points: &[(f64, f64)]) -> Vec<usize> {
    let finite = |i: &usize| points[*i].0.is_finite() && points[*i].1.is_finite();
    let mut order: Vec<usize> = (0..points.len()).filter(finite).collect();
    // Adding 0 makes −0 and 0 one number, as they are when compared.
    let key = |i: usize| (points[i].0 + 0.0, points[i].1 + 0.0);
    order.sort_by(|&a, &b| key(a).0.total_cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let mut front: Vec<usize> = Vec::new();
    for i in order {
        // All points before this one cost no more, so that it has to be more accurate than the last of the front, or its equal.
        if front.last().is_none_or(|&last| points[i].1 < points[last].1 || points[i] == points[last]) {
            front.push(i);
        }
    }
    front
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(points: &[(f64, f64)]) -> Vec<usize> {
        let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && (a.0 < b.0 || a.1 < b.1);
        let finite = |p: (f64, f64)| p.0.is_finite() && p.1.is_finite();
        (0..points.len()).filter(|&i| finite(points[i]) && !points.iter().any(|&p| finite(p) && beats(p, points[i]))).collect()
    }

    fn coordinate() -> impl Strategy<Value = f64> {
        // Few values, so that ties are common.
        prop_oneof![8 => (-3i32..4).prop_map(f64::from), 1 => Just(f64::NAN), 1 => Just(f64::INFINITY), 1 => Just(-0.0), 1 => Just(f64::NEG_INFINITY)]
    }

    proptest! {
        #[test]
        fn the_front_is_what_no_other_point_beats(points in prop::collection::vec((coordinate(), coordinate()), 0..24)) {
            let mut front = pareto(&points);
            front.sort_unstable();
            prop_assert_eq!(front, brute_force(&points));
        }
    }

    #[test]
    fn the_front_comes_in_the_order_of_cost() {
        assert_eq!(pareto(&[(3.0, 1.0), (1.0, 3.0), (2.0, 2.0), (2.5, 2.5), (1.0, 3.0)]), [1, 4, 2, 0]);
        assert_eq!(pareto(&[(f64::NAN, 0.0)]), Vec::<usize>::new());
    }
}
