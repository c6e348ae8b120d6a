//! The library, a pipeline and a scene as the command line names them; plans without a GPU.

use std::{fs, path::Path, sync::Arc};

use manylight::{
    Documents, SceneSource, Settings,
    fault::Fault,
    gpu::Gpu,
    graph::{
        pipeline::Pipeline,
        plan::{Debug, Plan, PlanInput},
    },
    library,
    passes::Baked,
    plan_input,
    renderer::{RenderError, Renderer},
    scene::Scene,
};

use crate::cli::{Cli, DebugArgs, FrameArgs, PipelineArgs};

/// Documents of a pipeline, loaded.
pub struct Session {
    pub documents: Documents,
}

/// A scene and where it came from.
pub struct LoadedScene {
    pub source: SceneSource,
    pub scene: Scene,
}

impl Session {
    /// Opens the library and loads the pipeline.
    pub fn open(cli: &Cli, pipeline: &str) -> Result<Self, Fault> {
        let library = library::open(cli.root.as_deref())?;
        Ok(Self { documents: Documents::load(library, Path::new(pipeline))? })
    }

    pub fn pipeline(&self) -> &Pipeline {
        self.documents.pipeline()
    }

    /// Finds and loads a scene; what was mended is printed as warnings.
    pub fn scene(&self, name: &str) -> Result<LoadedScene, Fault> {
        let source = library::scene(self.documents.library(), name)?;
        let scene = source.load()?;
        super::warn(&scene.warnings);
        Ok(LoadedScene { source, scene })
    }

    /// What will run. Without a scene, one that has no features is assumed.
    pub fn plan(&self, scene: Option<&LoadedScene>, settings: &Settings) -> Result<Plan, Fault> {
        let input = match scene {
            Some(loaded) => plan_input(self.pipeline(), settings, &loaded.scene),
            None => PlanInput {
                output: settings.size,
                set: settings.set.clone(),
                features: manylight::graph::features::flags().map(|name| (name.to_owned(), false)).collect(),
                keep: settings.keep.clone(),
                debug: settings.debug,
                ..PlanInput::default()
            },
        };
        Ok(self.documents.plan(&input)?)
    }

    /// Binds everything to a device.
    pub fn renderer(self, gpu: &Gpu, scene: LoadedScene, settings: Settings) -> Result<Renderer, Fault> {
        Renderer::with(gpu, self.documents, scene.source, scene.scene, settings).map_err(of_render)
    }
}

/// Settings as the command line gives them.
pub fn settings(pipeline: &PipelineArgs, frame: &FrameArgs, keep: Vec<String>) -> Result<Settings, Fault> {
    let baked = frame.baked.as_deref().map(baked).transpose()?.map(Arc::new);
    Ok(Settings {
        size: frame.size.size,
        set: pipeline.set.clone(),
        keep,
        debug: debug(&frame.debug),
        skip_unchanged: !frame.debug.no_skipping,
        seed: frame.seed,
        baked,
    })
}

/// Reads a file of baked light.
fn baked(file: &Path) -> Result<Baked, Fault> {
    let fault = |reason: String| Fault::Input(format!("cannot use `{}`: {reason}", file.display()));
    let bytes = fs::read(file).map_err(|e| fault(e.to_string()))?;
    Baked::from_bytes(&bytes).map_err(|e| fault(e.to_string()))
}

fn debug(args: &DebugArgs) -> Debug {
    Debug {
        no_culling: args.no_culling,
        no_reuse: args.no_reuse,
        poison: args.poison,
        watch_numbers: args.watch_numbers,
        shuffle: args.shuffle,
    }
}

/// Scene time of a frame.
pub fn time_of(args: &FrameArgs, frame: u64) -> f64 {
    args.time + args.fps.map_or(0.0, |fps| frame as f64 / fps)
}

/// A render error as a fault of the input.
pub fn of_render(error: RenderError) -> Fault {
    Fault::Documents(error.diagnostics())
}

/// Bad numbers of a frame, which is there all the same.
pub fn bad_numbers(frame: Result<(), RenderError>) -> Result<Option<Fault>, Fault> {
    match frame {
        Ok(()) => Ok(None),
        Err(error @ RenderError::Numbers { .. }) => Ok(Some(of_render(error))),
        Err(error) => Err(of_render(error)),
    }
}
