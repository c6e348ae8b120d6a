//! The metrics by name: what reports and sweeps choose from.

use super::Metrics;

/// The value that a perfect picture has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Best {
    /// 0, and the nearer the better, from either side.
    Zero,
    /// 1, and the nearer the better, from either side.
    One,
    /// The higher the better; 1 cannot be exceeded.
    Highest,
}

impl Best {
    /// That value.
    pub fn value(self) -> f64 {
        match self {
            Self::Zero => 0.0,
            Self::One | Self::Highest => 1.0,
        }
    }
}

/// A metric.
#[derive(Debug, Clone, Copy)]
pub struct Known {
    /// Its name in JSON and in sweeps.
    pub name: &'static str,
    /// Its name in tables.
    pub title: &'static str,
    /// What it is, in a sentence.
    pub doc: &'static str,
    /// Its unit: that of the picture (`W/(m² sr)` for radiance), or `1`.
    pub unit: &'static str,
    /// What is best.
    pub best: Best,
    value: Value,
}

/// Where its value comes from.
#[derive(Debug, Clone, Copy)]
enum Value {
    Pictures(fn(&Metrics) -> Option<f64>),
    /// From more than a picture and its reference.
    Elsewhere,
}

impl Known {
    /// The metric of that name.
    pub fn find(name: &str) -> Option<&'static Self> {
        KNOWN.iter().find(|known| known.name == name)
    }

    /// Whether a picture and its reference are all that it needs: [`super::flicker`] needs several frames, [`super::z_test`] standard errors.
    pub fn of_two_pictures(&self) -> bool {
        matches!(self.value, Value::Pictures(_))
    }

    /// Its value; `None` where it is not defined, and for what needs more than two pictures.
    pub fn of(&self, metrics: &Metrics) -> Option<f64> {
        match self.value {
            Value::Pictures(value) => value(metrics).filter(|v| v.is_finite()),
            Value::Elsewhere => None,
        }
    }
}

const fn picture(
    name: &'static str,
    title: &'static str,
    doc: &'static str,
    unit: &'static str,
    best: Best,
    value: fn(&Metrics) -> Option<f64>,
) -> Known {
    Known { name, title, doc, unit, best, value: Value::Pictures(value) }
}

const SAME: &str = "as the picture";

/// Every metric. a is the image, b the reference, m the mean of b; means are over the pixels that count and their channels.
pub const KNOWN: &[Known] = &[
    picture("rmse", "RMSE", "Root of the mean of (a − b)².", SAME, Best::Zero, |m| Some(m.rmse)),
    picture("relative_rmse", "RMSE / mean", "RMSE over |m|.", "1", Best::Zero, Metrics::relative_rmse),
    picture(
        "relative_mse",
        "relative MSE",
        "Mean of (a − b)² / (b² + 0.01 m²): every pixel weighs by its own brightness.",
        "1",
        Best::Zero,
        |m| m.relative_mse,
    ),
    picture("mean_absolute_error", "mean absolute error", "Mean of |a − b|.", SAME, Best::Zero, |m| Some(m.mean_absolute_error)),
    picture(
        "relative_mean_absolute_error",
        "mean abs. error / mean",
        "Mean of |a − b| over |m|.",
        "1",
        Best::Zero,
        Metrics::relative_mean_absolute_error,
    ),
    picture("bias", "bias", "Mean of a − b.", SAME, Best::Zero, |m| Some(m.bias())),
    picture("relative_bias", "bias / mean", "Mean of a − b over |m|.", "1", Best::Zero, Metrics::relative_bias),
    picture("energy_ratio", "energy ratio", "Mean of a over m.", "1", Best::One, Metrics::energy_ratio),
    picture("percentile_99_9", "99.9th percentile", "The |a − b| that 99.9 % of the values do not exceed.", SAME, Best::Zero, |m| {
        Some(m.percentile_999)
    }),
    picture(
        "relative_percentile_99_9",
        "99.9th percentile / mean",
        "The |a − b| that 99.9 % of the values do not exceed, over |m|.",
        "1",
        Best::Zero,
        Metrics::relative_percentile_999,
    ),
    picture("max", "largest difference", "Largest |a − b|.", SAME, Best::Zero, |m| Some(m.max)),
    picture(
        "flip",
        "FLIP",
        "Mean FLIP of the displayed pictures at 67 pixels a degree: how visible the difference is, 0 to 1.",
        "1",
        Best::Zero,
        |m| m.flip,
    ),
    picture("ssim", "SSIM", "Mean structural similarity of the displayed pictures' luma, −1 to 1.", "1", Best::Highest, |m| m.ssim),
    Known {
        name: "z_passing",
        title: "pixels within noise",
        doc: "Share of the pixels whose difference the standard errors of image and reference explain (z-test with Šidák's correction).",
        unit: "1",
        best: Best::Highest,
        value: Value::Elsewhere,
    },
    Known {
        name: "flicker",
        title: "flicker",
        doc: "Mean magnitude of the second difference of pixels over frames, over the mean of the frames.",
        unit: "1",
        best: Best::Zero,
        value: Value::Elsewhere,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        for known in KNOWN {
            assert_eq!(KNOWN.iter().filter(|k| k.name == known.name).count(), 1, "{}", known.name);
            assert_eq!(Known::find(known.name).map(|k| k.title), Some(known.title));
            assert!(known.doc.ends_with('.') && !known.title.is_empty());
        }
        assert!(Known::find("psnr").is_none());
    }
}
