//! Power laws through measured points.

/// A power law y = c·x^slope, fitted by least squares in the logarithms of both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PowerLaw {
    /// The exponent.
    pub slope: f64,
    /// ln c.
    pub ln_factor: f64,
    /// Points that it was fitted to.
    pub points: usize,
}

impl PowerLaw {
    /// Through the points with finite positive coordinates; `None` unless they have two different x.
    pub fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let usable = |v: f64| v.is_finite() && v > 0.0;
        let logs: Vec<(f64, f64)> = points.iter().filter(|p| usable(p.0) && usable(p.1)).map(|p| (p.0.ln(), p.1.ln())).collect();
        let (&first, n) = (logs.first()?, logs.len() as f64);
        if logs.iter().all(|l| l.0 == first.0) {
            return None;
        }
        let mean = (logs.iter().map(|l| l.0).sum::<f64>() / n, logs.iter().map(|l| l.1).sum::<f64>() / n);
        let variance: f64 = logs.iter().map(|l| (l.0 - mean.0).powi(2)).sum();
        let covariance: f64 = logs.iter().map(|l| (l.0 - mean.0) * (l.1 - mean.1)).sum();
        let slope = covariance / variance;
        Some(Self { slope, ln_factor: mean.1 - slope * mean.0, points: logs.len() })
    }

    /// Its value at a positive x.
    pub fn at(&self, x: f64) -> f64 {
        (self.ln_factor + self.slope * x.ln()).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_power_law_has_its_exponent() {
        let points: Vec<(f64, f64)> = (4..13).map(|k| f64::from(1 << k)).map(|n| (n, 3.0 * n.powf(-0.5))).collect();
        let law = PowerLaw::fit(&points).expect("two different x");
        assert!((law.slope + 0.5).abs() < 1e-12, "{law:?}");
        assert!((law.at(100.0) - 0.3).abs() < 1e-12, "{law:?}");
        assert_eq!(law.points, 9);
    }

    #[test]
    fn points_without_logarithm_do_not_count() {
        let law = PowerLaw::fit(&[(1.0, 2.0), (10.0, 20.0), (0.0, 5.0), (5.0, f64::NAN), (3.0, -1.0)]).expect("two different x");
        assert!((law.slope - 1.0).abs() < 1e-12);
        assert_eq!(law.points, 2);
        assert_eq!(PowerLaw::fit(&[(2.0, 1.0), (2.0, 3.0)]), None);
        assert_eq!(PowerLaw::fit(&[]), None);
    }
}
