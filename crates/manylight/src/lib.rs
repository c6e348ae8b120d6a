//! Many-light global illumination from render graphs written in RON: the library's front door.
//!
//! ```no_run
//! use manylight::{Gpu, GpuOptions, Renderer, Settings, library};
//!
//! let gpu = Gpu::new(&GpuOptions::default())?;
//! let library = library::open(None)?; // shaders/ and pipelines/ on disk, or those built in
//! let scene = library::scene(&library, "cornell")?;
//! let mut renderer = Renderer::new(&gpu, library, "acrsm", scene, Settings { size: (256, 256), ..Settings::default() })?;
//! for _ in 0..16 {
//!     renderer.render_frame(0.0)?; // iterative clustering settles
//! }
//! let radiance = renderer.read("composed")?;
//! println!("{} × {}, {:?}", radiance.width, radiance.height, renderer.wait_timings());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! What needs no GPU works without one:
//!
//! ```
//! use manylight::{Documents, library};
//!
//! let (registry, faults) = manylight::load_registry(&library::at(None));
//! assert!(registry.nodes.contains_key("points/static") && registry.externals.contains_key("scene_camera"));
//! ```
//!
//! - [`library`]: the embedded shaders, pipelines and scenes, and where files on disk are found.
//! - [`renderer`] and [`documents`]: render, read, reload (from `manylight-passes`).
//! - [`budget`]: a frame time that is held by giving up quality.
//! - [`files`]: EXR and PNG files, written whole or not at all; [`tone`]: from numbers to bytes to look at.
//! - [`metrics`]: how far a picture is from a reference.
//! - [`fault`]: what ends a command early, with its exit code.
//! - [`graph`], [`gpu`], [`scene`], [`passes`], [`lab`]: the crates below.

pub mod fault;
pub mod library;

pub use manylight_gpu as gpu;
pub use manylight_graph as graph;
pub use manylight_lab as lab;
pub use manylight_passes as passes;
pub use manylight_scene as scene;

pub use manylight_lab::{files, metrics, tone};

pub use manylight_gpu::{Gpu, GpuOptions, Image};
pub use manylight_passes::{
    Budget, Documents, ReloadReport, RenderError, Renderer, SceneSource, Settings, budget, documents, load_registry, plan_input, renderer,
};
