//! Shaders that are edited while their pipeline renders, as in `watch`.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

use manylight::{
    Gpu, GpuOptions, Renderer, SceneSource, Settings,
    graph::{
        library::Library,
        plan::{Lifetime, Plan},
        registry::Registry,
    },
};

use super::{
    check_faults,
    mutate::{fuzz, wgsl},
};
use crate::support::{Random, copy_of_library, root};

/// Compiling a pipeline takes seconds on a machine that does other things as well.
const BOUND: Duration = Duration::from_secs(120);
/// Frames after which clusters have moved.
const FRAMES: u32 = 3;

/// A renderer, and a copy of the library that it reads.
struct Bench {
    library: PathBuf,
    renderer: Renderer,
    /// The picture of frame [`FRAMES`].
    good: Vec<u32>,
    /// Nothing of one frame is left in the next: the picture is the same in each.
    forgets: bool,
    /// Shaders that are used, by their paths in the library.
    shaders: Vec<String>,
}

fn bits(renderer: &Renderer) -> Vec<u32> {
    let plan = renderer.plan();
    let shown = &plan.resources[plan.radiance.unwrap_or(plan.presents)].name;
    renderer.read(shown).unwrap_or_else(|e| panic!("{e}")).data.iter().map(|v| v.to_bits()).collect()
}

fn frames(renderer: &mut Renderer) -> Vec<u32> {
    for _ in 0..FRAMES {
        renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
    }
    bits(renderer)
}

impl Bench {
    fn new(gpu: &Gpu, library: &Path, pipeline: &str) -> Self {
        let set = [("rsm_size", "32"), ("point_count", "500"), ("clusters", "16"), ("lights", "16")];
        let scene = SceneSource::file(root().join("assets/cornell.ron"));
        let files = Library::new(Some(library.to_owned()), Vec::new());
        let mut settings = Settings { size: (24, 16), ..Settings::default() };
        let mut renderer = Renderer::new(gpu, files, pipeline, scene, settings.clone()).unwrap_or_else(|e| panic!("{e}"));
        // Of the small sizes those that the pipeline has.
        for (name, value) in set {
            if renderer.set_parameter(name, value).is_ok() {
                settings = renderer.settings().clone();
            }
        }
        renderer.set(settings).unwrap_or_else(|e| panic!("{e}"));
        let mut renderer = renderer.on(gpu).unwrap_or_else(|e| panic!("{e}"));
        let good = frames(&mut renderer);
        let forgets = !renderer.plan().resources.iter().any(|r| r.lifetime == Lifetime::History);
        let shaders = shaders(renderer.plan(), renderer.documents().registry());
        Self { library: library.to_owned(), renderer, good, forgets, shaders }
    }

    fn edit(&mut self, gpu: &Gpu, random: &mut Random) {
        let file = self.library.join(random.of(&self.shaders));
        let text = fs::read_to_string(&file).expect("a shader");
        fs::write(&file, wgsl(&text, random)).expect("written");
        let before = bits(&self.renderer);
        match self.renderer.reload(std::slice::from_ref(&file)) {
            Err(faults) => {
                assert!(faults.has_errors());
                check_faults(&faults);
                assert!(bits(&self.renderer) == before, "the picture changed with the fault");
            }
            // Whatever it shows now, it is rendered.
            Ok(report) => check_faults(&report.warnings),
        }
        self.renderer.render_frame(0.0).unwrap_or_else(|e| panic!("{e}"));
        bits(&self.renderer);
        assert_eq!(gpu.take_errors(), Vec::<String>::new());

        fs::write(&file, text).expect("written");
        self.renderer.reload(&[file]).unwrap_or_else(|e| panic!("{e}"));
        if self.forgets {
            self.renderer.restart();
            assert!(frames(&mut self.renderer) == self.good, "the picture is another one than before the edit");
        } else {
            // What was left by the edited shader is forgotten with the frame.
            self.renderer = self.renderer.on(gpu).unwrap_or_else(|e| panic!("{e}"));
            assert!(frames(&mut self.renderer) == self.good, "the picture is another one than before the edit");
        }
    }
}

/// Shaders of the nodes that run, and what they import.
fn shaders(plan: &Plan, registry: &Registry) -> Vec<String> {
    let of_node = |name: &str| format!("shaders/{name}.wgsl");
    let mut all: BTreeSet<String> =
        plan.nodes.iter().filter(|node| node.decl.shader.is_some()).map(|node| of_node(&node.decl.name)).collect();
    assert!(all.len() > 3 && registry.faulty.is_empty());
    all.extend(["common/scene", "common/math"].map(of_node).into_iter().filter(|path| root().join(path).is_file()));
    all.into_iter().collect()
}

#[test]
fn edited_shaders_are_shown_or_refused_with_a_reason_and_mended_ones_give_the_same_bits() {
    let library = Arc::new(copy_of_library());
    let gpu = Gpu::new(&GpuOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let mut benches: Vec<Bench> = ["acrsm", "rsm_gather", "instant_radiosity"].map(|name| Bench::new(&gpu, library.path(), name)).into();
    fuzz("shaders", 20, BOUND, move |random: &mut Random| {
        let _folder = &library;
        let at = random.below(benches.len());
        benches[at].edit(&gpu, random);
    });
}
