//! What a report says besides the records: the sweep's words, the axes of its plots, figures of papers to set beside ours.

/// How a sweep wants its records to be shown.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sheet {
    /// The sweep's name.
    pub name: String,
    /// What it asks, in its own words.
    pub doc: String,
    /// The time on the time axes.
    pub axis: Axis,
    /// The metric on the error axes, by its name in [`crate::metrics`].
    pub metric: String,
    /// The columns of tables, by name.
    pub metrics: Vec<String>,
    /// Runs that make no sense and have no records, each with the reason.
    pub refused: Vec<(String, String)>,
    /// What the records should bear out.
    pub claims: Vec<Claim>,
    /// Tables of a paper.
    pub papers: Vec<Paper>,
    /// Error over time of other renderers.
    pub curves: Vec<Curve>,
}

/// Which time a plot shows.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Axis {
    /// Of one frame: what a moving picture costs.
    #[default]
    Frame,
    /// Of all frames until the picture: what one picture costs from nothing.
    Picture,
}

impl Axis {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Frame, Self::Picture];

    /// Its name in a sweep.
    pub fn name(self) -> &'static str {
        match self {
            Self::Frame => "frame",
            Self::Picture => "picture",
        }
    }
}

/// A variant is cheaper than another, or more accurate.
#[derive(Debug, Clone, PartialEq)]
pub struct Claim {
    /// The variant.
    pub variant: String,
    /// The one that it is compared with.
    pub than: String,
    /// Largest ratio of their times.
    pub time: f64,
    /// Largest ratio of their errors.
    pub error: f64,
}

/// A table of a paper, as printed there.
#[derive(Debug, Clone, PartialEq)]
pub struct Paper {
    /// Paper and table or figure: `[VAL] table 1`.
    pub source: String,
    /// What its numbers are: `ms`, `fps`.
    pub unit: String,
    /// Label of the row, of the column and number. Where a row has the name of a variant (or of a whole run) and a column that of a stage
    /// or `frame`, the report sets ours beside it.
    pub values: Vec<(String, String, f64)>,
}

/// Error over time of another renderer.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// What it is and where it was measured.
    pub name: String,
    /// The scene that it is of.
    pub scene: String,
    /// Width and height of its pictures: it is drawn beside runs of that size.
    pub size: [u32; 2],
    /// The metric.
    pub metric: String,
    /// Milliseconds and error.
    pub points: Vec<(f64, f64)>,
}
