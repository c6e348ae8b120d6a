//! Statistics of repeated measurements.

/// Measurements of one quantity; those that could not be taken are simply not there.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Samples(Vec<f64>);

impl Samples {
    /// Adds a measurement; `None` is "no sample" and leaves everything as it is.
    pub fn push(&mut self, value: Option<f64>) {
        self.0.extend(value.filter(|v| v.is_finite()));
    }

    /// Number of measurements.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Middle value; the mean of the two middle ones when their number is even. `None` without measurements.
    pub fn median(&self) -> Option<f64> {
        let sorted = self.sorted();
        let middle = sorted.len() / 2;
        match sorted.len() {
            0 => None,
            n if n % 2 == 1 => Some(sorted[middle]),
            _ => Some((sorted[middle - 1] + sorted[middle]) / 2.0),
        }
    }

    /// The smallest value that a share of `percent` of the measurements does not exceed (nearest rank).
    pub fn percentile(&self, percent: f64) -> Option<f64> {
        let sorted = self.sorted();
        let rank = ((percent / 100.0) * sorted.len() as f64).ceil().max(1.0) as usize;
        sorted.get((rank - 1).min(sorted.len().saturating_sub(1))).copied()
    }

    fn sorted(&self) -> Vec<f64> {
        let mut sorted = self.0.clone();
        sorted.sort_by(f64::total_cmp);
        sorted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64]) -> Samples {
        Samples(values.to_vec())
    }

    #[test]
    fn medians_and_percentiles() {
        assert_eq!(of(&[3.0, 1.0, 2.0]).median(), Some(2.0));
        assert_eq!(of(&[4.0, 1.0, 2.0, 3.0]).median(), Some(2.5));
        let hundred: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(of(&hundred).percentile(95.0), Some(95.0));
        assert_eq!(of(&[7.0]).percentile(95.0), Some(7.0));
    }

    #[test]
    fn no_sample_is_not_zero() {
        let mut samples = Samples::default();
        samples.push(None);
        samples.push(Some(f64::NAN));
        assert_eq!(samples.len(), 0);
        assert_eq!((samples.median(), samples.percentile(95.0)), (None, None));
    }
}
