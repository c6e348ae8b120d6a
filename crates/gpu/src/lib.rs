//! The executor of manylight: binds a [`Plan`](manylight_graph::plan::Plan) to a device and runs it, frame after frame. It knows
//! no pass by name; everything it does follows from the plan and from what reflection says of the shaders.
//!
//! ```
//! use manylight_gpu::{Externals, Gpu, GpuOptions};
//!
//! // Opens a graphics card, or the software renderer where there is none.
//! let gpu = Gpu::new(&GpuOptions::default())?;
//! println!("{} ({})", gpu.adapter_info().name, gpu.kind());
//! // What the graph reads from outside, by name.
//! let mut externals = Externals::new();
//! externals.set_buffer(&gpu, "weights", "f32", 4, &1.0f32.to_le_bytes())?;
//! let bytes = manylight_gpu::readback::read_bytes(
//!     &gpu, "weights", externals.memory("weights").expect("just set"), externals.desc("weights").expect("just set"))?;
//! assert_eq!(bytes, 1.0f32.to_le_bytes());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A frame is built with [`Frame::build`] and run with [`Frame::record_and_submit`].
//!
//! - [`device`]: adapter, features, limits, and errors that nobody caught.
//! - [`build`]: from a plan to a frame, beside the one that runs.
//! - [`frame`]: running it.
//! - [`externals`]: scene and frame data given from outside.
//! - [`host`]: nodes written in Rust.
//! - [`timing`]: CPU and GPU times of the nodes.
//! - [`readback`]: resources on the host, as pictures and JSON; [`decode`]: their numbers.
//! - [`memory`]: how much the resources take; [`pool`]: where they live; [`limits`]: what the device allows.
//! - [`watch`]: which files really changed.
//! - [`format`](mod@format): formats in wgpu's words.
//! - [`error`]: what can go wrong.

pub mod build;
pub mod decode;
pub mod device;
pub mod error;
pub mod externals;
pub mod format;
pub mod frame;
pub mod host;
pub mod limits;
pub mod memory;
pub mod numbers;
pub mod pool;
pub mod readback;
pub mod timing;
pub mod watch;

mod adapter;
mod bind;
mod params;
mod pipeline_cache;
mod poison;
mod record;
mod skip;
mod steps;
mod uses;

pub use build::{BuildOptions, BuildReport};
pub use device::{Gpu, GpuKind, GpuOptions};
pub use error::{BuildError, Fault, GpuError, HostError, LimitError, ReadError, RunError};
pub use externals::{Externals, TextureArray};
pub use frame::Frame;
pub use host::{HostContext, HostData, HostKind, HostNode, HostNodes};
pub use memory::MemoryReport;
pub use numbers::{BadNumber, BadNumbers, NumberPlace};
pub use pool::Memory;
pub use readback::{Image, Subresource};
pub use skip::Decision;
pub use timing::{FrameTimings, NodeTiming};
pub use watch::{WatchSet, Watcher};

/// The wgpu that this crate is built on.
pub use wgpu;
