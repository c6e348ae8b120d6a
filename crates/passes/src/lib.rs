//! Scene resources, host nodes and the renderer of manylight: what joins the graph, the GPU and the scene.
//!
//! ```no_run
//! use manylight_gpu::{Gpu, GpuOptions};
//! use manylight_graph::library::Library;
//! use manylight_passes::{Renderer, SceneSource, Settings};
//!
//! let gpu = Gpu::new(&GpuOptions::default())?;
//! let library = Library::new(Some(".".into()), Vec::new());
//! let scene = SceneSource::file("assets/cornell.ron");
//! let settings = Settings { size: (256, 256), set: vec![("clusters".into(), "64".into())], ..Settings::default() };
//! let mut renderer = Renderer::new(&gpu, library, "acrsm", scene, settings)?;
//! for _ in 0..16 {
//!     renderer.render_frame(0.0)?; // iterative clustering settles
//! }
//! let radiance = renderer.read("composed")?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! - [`renderer`]: [`Renderer`], the library's front door: render, read, reload.
//! - [`documents`]: a library with its nodes and a pipeline; plans without a GPU.
//! - [`atlas`]: the texels of an atlas over the surfaces of a scene.
//! - [`budget`]: a frame time that is held by giving up quality.
//! - [`baked`]: precomputed indirect light, its file and its weights.
//! - [`externals`]: scene and frame data as pipelines see them.
//! - [`host`]: the nodes that are written in Rust.
//! - [`scene_source`]: where a scene is loaded from.

pub mod atlas;
pub mod baked;
pub mod budget;
mod bvh;
pub mod documents;
pub mod externals;
pub mod host;
mod points_static;
pub mod renderer;
pub mod scene_source;

pub use baked::Baked;
pub use budget::Budget;
pub use documents::{Documents, load_registry};
pub use host::HostScene;
pub use renderer::{ReloadReport, RenderError, Renderer, Settings, plan_input};
pub use scene_source::SceneSource;
