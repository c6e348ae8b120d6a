//! What a picture costs and how far it is from the truth: pictures on disk, error metrics, times.
//!
//! ```
//! use manylight_lab::{files::Picture, metrics};
//!
//! let reference = Picture::linear(2, 1, 3, vec![1.0; 6]);
//! let image = Picture::linear(2, 1, 3, vec![1.0, 1.0, 1.0, 1.0, 1.0, 1.5]);
//! let metrics = metrics::compare(&image, &reference)?;
//! assert_eq!(metrics.energy_ratio(), Some(6.5 / 6.0));
//! # Ok::<(), metrics::CompareError>(())
//! ```
//!
//! - [`files`]: EXR and PNG files, written whole or not at all; [`tone`]: from numbers to bytes to look at.
//! - [`metrics`]: how far a picture is from a reference.
//! - [`sweep`]: many runs of pipelines, from one document; [`tune`]: the setting to use.
//! - [`record`]: what a run cost and how far it is off, as JSON Lines; [`sheet`]: how a report shows them; [`report`]: reports as HTML, Markdown
//!   and CSV.
//! - [`bake`]: precomputed indirect light.
//! - [`timing`]: times of frames and nodes; [`facts`]: adapter and parameters as JSON.

pub mod bake;
pub mod facts;
pub mod files;
pub mod metrics;
pub mod record;
pub mod report;
pub mod sheet;
pub mod sweep;
pub mod timing;
pub mod tone;
pub mod tune;

mod samples;
