//! Options of a frame time that is held.

use std::path::PathBuf;

use clap::Args;

use super::values;

/// The time alone.
#[derive(Debug, Args)]
#[command(next_help_heading = "Budget")]
pub struct BudgetTimeArgs {
    /// Hold this frame time by giving up what the pipeline's `quality` allows, rung by rung, and regain it where there is time: 16ms, 0.1s or 60fps.
    /// Values given by --set stay
    #[arg(long, value_name = "TIME", value_parser = values::milliseconds)]
    pub budget: Option<f64>,
}

/// The time, and its record.
#[derive(Debug, Args)]
#[command(next_help_heading = "Budget")]
#[group(id = "budget_options")]
pub struct BudgetArgs {
    #[command(flatten)]
    #[allow(missing_docs)]
    pub time: BudgetTimeArgs,
    /// Write the times that counted and the changes that they led to
    #[arg(long, value_name = "FILE.json", requires = "budget")]
    pub budget_trace: Option<PathBuf>,
    /// Take the times from such a file in place of measured ones: the same rungs in the same frames, hence the same picture
    #[arg(long, value_name = "FILE.json", conflicts_with = "budget")]
    pub budget_replay: Option<PathBuf>,
}
