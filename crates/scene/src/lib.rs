//! Scenes for manylight: meshes, materials, textures, lights, a camera and their motion, read from RON, OBJ, MTL, glTF and picture files into
//! the structures that shaders read.
//!
//! ```
//! use manylight_scene::Scene;
//! # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets");
//!
//! let scene = Scene::load(format!("{folder}/moving.ron"))?;
//! assert!(scene.features()["moving_lights"]);
//!
//! let state = scene.sample(2.5);
//! let view = state.camera_view(16.0 / 9.0);
//! assert!(view.forward.is_normalized() && state.light_views.len() == 1);
//! # Ok::<(), manylight_graph::diagnostics::Diagnostics>(())
//! ```
//!
//! - [`scene`]: [`Scene`], how it is loaded, what it has.
//! - [`state`]: [`SceneState`], the scene at one time.
//! - [`motion`]: key frames.
//! - [`sky`]: the sun over a day, and the light of the sky.
//! - [`points`]: points on the surfaces for imperfect shadow maps.
//! - [`gpu_data`]: the structures that shaders read, and their layouts.
//! - [`files`]: reading from disk, from the program itself, or from anywhere else.
//! - [`bounds`]: axis-aligned boxes.
//! - [`deform`]: meshes whose shape changes, by key frames or as metaballs.
//! - [`bvh`]: a hierarchy of boxes over all triangles, for who traces rays: shaders, and the host.
//! - [`measure`]: what a scene is like, measured by rays.
//!
//! # Scene files
//!
//! ```ron
//! Scene(
//!     meshes: [
//!         "box.obj",                                     // relative to this file; or glTF: "box.glb"
//!         Mesh(
//!             file: "ball.obj",
//!             name: "ball",
//!             transform: (translate: (1.0, 0.5, 2.0), rotate_deg: (axis: (0.0, 1.0, 0.0), angle: 30.0), scale: 0.5),
//!             motion: [(time: 0.0), (time: 2.0, translate: (3.0, 0.5, 2.0))], // what a key leaves out is as in `transform`
//!             repeat: loop,                              // or clamp (default)
//!         ),
//!         Mesh(file: "flag_0.obj", motion: [(time: 0.0), (time: 1.0, file: "flag_1.obj")]), // a key with another file: its shape changes
//!         Metaballs(
//!             balls: [(position: (0.0, 1.0, 0.0), radius: 0.5, strength: 1.0, motion: [(time: 0.0), (time: 2.0, radius: 0.8)])],
//!             level: 0.25, cells: 32, material: "clay",      // and `name`, `transform`, `motion`, `repeat` as of a mesh
//!         ),
//!     ],
//!     camera: (origin: (0.0, 1.0, 5.0), target: (0.0, 1.0, 0.0), up: (0.0, 1.0, 0.0), fov_x_deg: 50.0),
//!     lights: [
//!         Spot(position: (0.0, 2.0, 0.0), target: (0.0, 0.0, 0.0), intensity: (9.0, 9.0, 9.0), // W/sr; or one number
//!              beam_deg: 20.0, cutoff_deg: 30.0, falloff: linear), // half-angles; linear, cosine or smooth
//!         Point(position: (0.0, 1.0, 0.0), intensity: 2.0),             // W/sr in all directions
//!         Directional(direction: (1.0, -2.0, 0.0), irradiance: 3.0),    // the way its light goes; W/m² on a surface that faces it
//!         Sun(latitude_deg: 55.5, day: 172.0, irradiance: 4.0,           // goes over the sky in a day; time 0 is midnight
//!             north_deg: 0.0, fade_deg: 8.0, twilight_deg: 6.0),         // or `declination_deg: 23.4` instead of `day`
//!     ],
//!     sky: Sky(zenith: (0.3, 0.5, 0.9), horizon: 0.8, ground: 0.0, exponent: 0.5), // W/(m² sr); or one radiance for all directions
//!     materials: {"white": (diffuse: (0.7, 0.7, 0.7), specular: 0.2, shininess: 50.0, texture: "wood.png")},
//! )
//! ```
//!
//! There may be one `Sun`: its light fades below `fade_deg` of elevation, and that of the sky ends `twilight_deg` below the horizon.
//!
//! Only `meshes` is needed; without `sky` there is none. A camera or a light that is missing is fitted to the meshes, with a warning. `rotate_deg` may also be three angles:
//! about x, then y, then z. Cameras (`origin`, `target`, `up`, `fov_x_deg`) and lights (`position`, `target`, `intensity`; `direction`,
//! `irradiance`) take `motion` and `repeat` in the same way. Values are mixed linearly from key to key, rotations and directions on the
//! shortest arc.

pub mod bounds;
pub mod bvh;
pub mod deform;
mod file;
pub mod files;
mod fit;
pub mod gpu_data;
mod import;
mod lights;
pub mod measure;
pub mod motion;
pub mod points;
mod random;
pub mod scene;
pub mod sky;
pub mod state;

pub use deform::{Deformation, Deformed, Metaballs};
pub use import::{DEFAULT_SHININESS, MAX_TEXTURE_SIZE, Material, Mesh, MeshStatistics, MeshTriangle, Textures};
pub use measure::{MeasureOptions, Measures};
pub use scene::{Light, LightShape, Scene, SceneObject};
pub use state::SceneState;
