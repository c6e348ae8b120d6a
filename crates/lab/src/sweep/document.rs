//! A sweep's RON document: what it says, with the place of everything that is checked later.

use std::sync::Arc;

use glam::Vec3;
use indexmap::IndexMap;
use manylight_graph::{
    Spanned,
    diagnostics::{Diagnostics, Severity, Source, Span},
    params::Literal,
    pipeline::Preset,
    ron::{Fields, Kind, Reader, Shape, Tree, head, read_literal},
};

use super::extras;
use crate::{
    metrics::Condition,
    sheet::{Axis, Claim, Curve, Paper},
};

/// What a sweep asks for.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Stem of the file's name.
    pub name: String,
    /// The file.
    pub source: Arc<Source>,
    /// The question, in a sentence or two.
    pub doc: String,
    /// What is compared, in document order, the pipelines that stand for themselves first; at least one.
    pub variants: Vec<Variant>,
    /// Knobs of all variants; each entry is crossed with the others.
    pub vary: Vec<Zip>,
    /// At least one.
    pub scenes: Vec<SceneUse>,
    /// Widths and heights in pixels; at least one.
    pub sizes: Vec<(u32, u32)>,
    /// At least one.
    pub seeds: Vec<u32>,
    /// Frames rendered before the picture is taken, that one included.
    pub frames: u32,
    /// Frames measured after that.
    pub measure: u32,
    /// Scene time of the first frame in seconds.
    pub time: f64,
    /// Frames a second of scene time; without it time stands still.
    pub fps: Option<f64>,
    /// Times, positions and targets of the first light, instead of the scene's own; empty: as the scene says.
    pub light_path: Vec<(f64, Vec3, Vec3)>,
    /// Error over time.
    pub sequence: Option<Sequence>,
    /// The resource that is compared.
    pub image: Spanned,
    /// What it is compared with, where a scene names no file.
    pub reference: PathTraced,
    /// The time on the axes.
    pub axis: Axis,
    /// The metric on the error axes.
    pub metric: Spanned,
    /// The metrics in tables; empty: all.
    pub metrics: Vec<Spanned>,
    /// Which pixels count.
    pub mask: Option<MaskUse>,
    /// What the records should bear out, with the places of the two variants' names.
    pub claims: Vec<(Claim, [Spanned; 2])>,
    /// Figures of papers.
    pub papers: Vec<Paper>,
    /// Other renderers.
    pub curves: Vec<Curve>,
}

/// A pipeline with settings.
#[derive(Debug, Clone)]
pub struct Variant {
    /// Its name, unique in the sweep.
    pub name: Spanned,
    /// A file or a name in `pipelines/`.
    pub pipeline: Spanned,
    /// Values of parameters.
    pub set: Vec<(String, Preset)>,
    /// Knobs of this variant only.
    pub vary: Vec<Zip>,
    /// Instead of the sweep's: samples need no frames to settle, clusters do.
    pub frames: Option<u32>,
    /// Instead of the sweep's.
    pub image: Option<Spanned>,
}

/// Knobs that change together: the first values of all, then the second ones.
#[derive(Debug, Clone)]
pub struct Zip(pub Vec<Knob>);

/// A parameter and the values that it takes in turn.
#[derive(Debug, Clone)]
pub struct Knob {
    /// Name of the parameter.
    pub name: String,
    /// Its values; at least one.
    pub values: Vec<Preset>,
}

/// A scene, and its reference if that is a file.
#[derive(Debug, Clone)]
pub struct SceneUse {
    /// A path, relative to the sweep's file or the current folder, or a name in `assets/`.
    pub scene: Spanned,
    /// An EXR file of the sweep's size.
    pub reference: Option<Spanned>,
    /// The standard error of its pixels, an EXR file.
    pub standard_error: Option<Spanned>,
}

/// A reference by the pipeline `reference`.
#[derive(Debug, Clone)]
pub struct PathTraced {
    /// `direct`, `one_bounce` or `full`.
    pub component: Spanned,
    /// Paths a pixel.
    pub paths: u32,
}

/// Frames that are compared one by one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Sequence {
    /// Number of frames.
    pub frames: u32,
    /// Every how many of them one is compared with a reference of its time.
    pub every: u32,
}

/// Only pixels where a channel of a resource is above or below a value count.
#[derive(Debug, Clone)]
pub struct MaskUse {
    /// The resource.
    pub resource: Spanned,
    /// Its channel: 0 for red.
    pub channel: u32,
    /// What its value must be.
    pub condition: Condition,
}

impl MaskUse {
    /// In words: `alpha of indirect below 0.9`.
    pub fn describe(&self) -> String {
        let channel = ["red", "green", "blue", "alpha"].get(self.channel as usize).unwrap_or(&"a channel");
        let bound = match self.condition {
            Condition::Above(bound) => format!("above {bound}"),
            Condition::Below(bound) => format!("below {bound}"),
        };
        format!("{channel} of {} {bound}", self.resource.text)
    }
}

const SWEEP: Shape = Shape {
    what: "Sweep",
    required: &["doc", "scenes"],
    optional: &[
        "pipelines",
        "variants",
        "vary",
        "sizes",
        "seeds",
        "frames",
        "measure",
        "time",
        "fps",
        "light_path",
        "sequence",
        "image",
        "reference",
        "axis",
        "metric",
        "metrics",
        "mask",
        "claims",
        "papers",
        "curves",
        "small",
    ],
};
const SMALL: Shape = Shape {
    what: "the small size",
    required: &[],
    optional: &["scenes", "sizes", "seeds", "frames", "measure", "sequence", "paths", "set"],
};
const VARIANT: Shape = Shape { what: "a variant", required: &["pipeline"], optional: &["set", "vary", "frames", "image"] };
const SCENE: Shape = Shape { what: "a scene", required: &["scene"], optional: &["reference", "standard_error"] };
const REFERENCE: Shape = Shape { what: "the reference", required: &[], optional: &["component", "paths"] };
const SEQUENCE: Shape = Shape { what: "the sequence", required: &["frames"], optional: &["every"] };
const MASK: Shape = Shape { what: "the mask", required: &["resource"], optional: &["channel", "above", "below"] };

/// Largest picture side; adapters refuse larger textures anyway.
const LARGEST_SIDE: i64 = 16384;
const MOST_FRAMES: i64 = 1_000_000;
const MOST_PATHS: i64 = 1_000_000;

/// Values that each knob has in the small size: its first ones.
const SMALL_VALUES: usize = 2;

/// What a sweep has in a full and in a small size.
#[derive(Default)]
struct Extent {
    scenes: Option<Vec<SceneUse>>,
    sizes: Option<Vec<(u32, u32)>>,
    seeds: Option<Vec<u32>>,
    frames: Option<u32>,
    measure: Option<u32>,
    sequence: Option<Sequence>,
    paths: Option<u32>,
    /// Values in every variant, instead of its own and of those of knobs.
    set: Vec<(String, Preset)>,
}

impl Sweep {
    /// The resource of a variant that is compared.
    pub(super) fn image_of(&self, variant: usize) -> &Spanned {
        self.variants[variant].image.as_ref().unwrap_or(&self.image)
    }

    /// Frames of a variant up to its picture.
    pub(super) fn frames_of(&self, variant: usize) -> u32 {
        self.variants[variant].frames.unwrap_or(self.frames)
    }

    /// Reads a sweep in its full or in its small size.
    ///
    /// # Errors
    /// All faults of the text, of both sizes.
    pub fn read(source: &Arc<Source>, small: bool) -> Result<Self, Diagnostics> {
        let (mut reader, tree) = Reader::open(source);
        let sweep = tree.and_then(|tree| read_sweep(&mut reader, &tree, small));
        match sweep {
            Some(sweep) if reader.out.iter().all(|fault| fault.severity != Severity::Error) => Ok(sweep),
            _ => Err(Diagnostics(reader.out).sorted()),
        }
    }
}

fn read_sweep(reader: &mut Reader, tree: &Tree, small: bool) -> Option<Sweep> {
    match &tree.kind {
        Kind::Record(Some(name), _) | Kind::Tuple(Some(name), _) if name.text == "Sweep" => {}
        _ => {
            reader.expected(
                tree,
                "`Sweep(…)`",
                "a sweep has the form Sweep(doc: …, variants: {…}, scenes: […]) or Sweep(doc: …, pipelines: […], scenes: […])",
            );
            return None;
        }
    }
    let fields = reader.record(tree, &SWEEP)?;
    let full = read_extent(reader, &fields);
    let lesser = fields.get("small").and_then(|tree| reader.record(tree, &SMALL));
    let lesser = lesser.map(|fields| {
        let mut extent = read_extent(reader, &fields);
        extent.paths = count(reader, &fields, "paths", MOST_PATHS);
        extent.set = fields.get("set").map(|tree| read_set(reader, tree)).unwrap_or_default();
        extent
    });
    let reference = read_reference(reader, &fields);
    let mut variants = fields.get("pipelines").map(|tree| read_pipelines(reader, tree)).unwrap_or_default();
    variants.extend(fields.get("variants").map(|tree| read_variants(reader, tree)).unwrap_or_default());
    if fields.get("pipelines").is_none() && fields.get("variants").is_none() {
        let help = "add `pipelines: [\"acrsm\", …]`, or `variants: {\"name\": (pipeline: \"acrsm\", set: {…})}`";
        reader.error(&head(tree), "the sweep names no pipeline: nothing would run", help);
    }
    let own = |name: &str| Spanned { text: name.to_owned(), span: Span::new(&reader.source, head(tree)) };
    let (image, metric, component) = (own("indirect"), own("relative_mean_absolute_error"), own("one_bounce"));
    let text = |reader: &mut Reader, name: &str| fields.get(name).and_then(|t| reader.text(t, "a name in quotes"));
    let number = |reader: &mut Reader, name: &str| fields.get(name).and_then(|t| reader.float(t, "a number"));
    let metrics = fields.get("metrics").map(|tree| {
        reader.list(tree, "names of metrics").iter().filter_map(|t| reader.text(t, "the name of a metric in quotes")).collect()
    });
    let fps = number(reader, "fps").filter(|fps| {
        let good = *fps > 0.0;
        if let (false, Some(tree)) = (good, fields.get("fps")) {
            reader.error(&tree.range, "frames a second must be above 0", "leave it out for a time that stands still");
        }
        good
    });
    let chosen = lesser.filter(|_| small).unwrap_or_default();
    let (component_read, paths) = reference;
    let mut sweep = Sweep {
        name: stem(&reader.source.name),
        source: Arc::clone(&reader.source),
        doc: text(reader, "doc").map(|d| d.text).unwrap_or_default(),
        variants,
        vary: fields.get("vary").map(|tree| read_vary(reader, tree)).unwrap_or_default(),
        scenes: chosen.scenes.or(full.scenes).unwrap_or_default(),
        sizes: chosen.sizes.or(full.sizes).unwrap_or_else(|| vec![(256, 256)]),
        seeds: chosen.seeds.or(full.seeds).unwrap_or_else(|| vec![0]),
        frames: chosen.frames.or(full.frames).unwrap_or(24),
        measure: chosen.measure.or(full.measure).unwrap_or(16),
        time: number(reader, "time").unwrap_or(0.0),
        fps,
        light_path: fields.get("light_path").map(|tree| extras::light_path(reader, tree)).unwrap_or_default(),
        sequence: chosen.sequence.or(full.sequence),
        image: text(reader, "image").unwrap_or(image),
        reference: PathTraced { component: component_read.unwrap_or(component), paths: chosen.paths.or(paths).unwrap_or(1024) },
        axis: fields.get("axis").and_then(|tree| extras::axis(reader, tree)).unwrap_or_default(),
        metric: text(reader, "metric").unwrap_or(metric),
        metrics: metrics.unwrap_or_default(),
        mask: fields.get("mask").and_then(|tree| read_mask(reader, tree)),
        claims: fields.get("claims").map(|tree| extras::claims(reader, tree)).unwrap_or_default(),
        papers: fields.get("papers").map(|tree| extras::papers(reader, tree)).unwrap_or_default(),
        curves: fields.get("curves").map(|tree| extras::curves(reader, tree)).unwrap_or_default(),
    };
    if small {
        let zips = sweep.variants.iter_mut().flat_map(|variant| &mut variant.vary).chain(&mut sweep.vary);
        let is_set = |name: &str| chosen.set.iter().any(|(other, _)| other == name);
        for zip in zips {
            zip.0.retain(|knob| !is_set(&knob.name));
            zip.0.iter_mut().for_each(|knob| knob.values.truncate(SMALL_VALUES));
        }
        for variant in &mut sweep.variants {
            variant.set.retain(|(name, _)| !is_set(name));
            variant.set.extend(chosen.set.iter().cloned());
        }
    }
    Some(sweep)
}

/// File stem of a source's name.
fn stem(name: &str) -> String {
    std::path::Path::new(name).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

fn read_extent(reader: &mut Reader, fields: &Fields<'_>) -> Extent {
    Extent {
        scenes: fields.get("scenes").map(|tree| {
            let scenes: Vec<_> = reader.list(tree, "scenes").iter().filter_map(|tree| read_scene(reader, tree)).collect();
            not_empty(reader, tree, "scenes");
            scenes
        }),
        sizes: fields.get("sizes").map(|tree| {
            let sizes = reader.list(tree, "sizes").iter().filter_map(|tree| read_size(reader, tree)).collect();
            not_empty(reader, tree, "sizes");
            sizes
        }),
        seeds: fields.get("seeds").map(|tree| {
            let seeds = reader.list(tree, "seeds").iter().filter_map(|tree| in_range(reader, tree, "a seed", 0, u32::MAX.into())).collect();
            not_empty(reader, tree, "seeds");
            seeds
        }),
        frames: count(reader, fields, "frames", MOST_FRAMES),
        measure: count(reader, fields, "measure", MOST_FRAMES),
        sequence: fields.get("sequence").and_then(|tree| read_sequence(reader, tree)),
        paths: None,
        set: Vec::new(),
    }
}

/// An empty list would give a sweep without runs.
fn not_empty(reader: &mut Reader, tree: &Tree, what: &str) {
    if matches!(&tree.kind, Kind::List(items) if items.is_empty()) {
        reader.error(&tree.range, format!("there are no {what}: nothing would run"), "name at least one, or leave the field out");
    }
}

fn in_range(reader: &mut Reader, tree: &Tree, what: &str, least: i64, most: i64) -> Option<u32> {
    let value = reader.int(tree, what)?;
    if !(least..=most).contains(&value) {
        reader.error(&tree.range, format!("{value} is out of range"), format!("{what} is a whole number from {least} to {most}"));
        return None;
    }
    u32::try_from(value).ok()
}

fn count(reader: &mut Reader, fields: &Fields<'_>, name: &str, most: i64) -> Option<u32> {
    fields.get(name).and_then(|tree| in_range(reader, tree, "a count", 1, most))
}

pub(super) fn read_size(reader: &mut Reader, tree: &Tree) -> Option<(u32, u32)> {
    match &tree.kind {
        Kind::Tuple(None, items) if items.len() == 2 => {
            let side = |reader: &mut Reader, tree: &Tree| in_range(reader, tree, "a side in pixels", 1, LARGEST_SIDE);
            let (width, height) = (side(reader, &items[0]), side(reader, &items[1]));
            Some((width?, height?))
        }
        _ => {
            reader.expected(tree, "a size", "write (width, height), for example (256, 256)");
            None
        }
    }
}

fn read_scene(reader: &mut Reader, tree: &Tree) -> Option<SceneUse> {
    if matches!(tree.kind, Kind::Text(_)) {
        return Some(SceneUse { scene: reader.text(tree, "a scene")?, reference: None, standard_error: None });
    }
    let fields = reader.record(tree, &SCENE)?;
    let text = |reader: &mut Reader, name: &str| fields.get(name).and_then(|t| reader.text(t, "a path in quotes"));
    let (scene, reference, standard_error) = (text(reader, "scene"), text(reader, "reference"), text(reader, "standard_error"));
    if let (None, Some(error)) = (&reference, fields.get("standard_error")) {
        reader.error(&error.range, "there is no reference that this is the standard error of", "add `reference: …`");
    }
    Some(SceneUse { scene: scene?, reference, standard_error })
}

fn read_sequence(reader: &mut Reader, tree: &Tree) -> Option<Sequence> {
    let fields = reader.record(tree, &SEQUENCE)?;
    let frames = count(reader, &fields, "frames", MOST_FRAMES)?;
    Some(Sequence { frames, every: count(reader, &fields, "every", MOST_FRAMES).unwrap_or(frames) })
}

fn read_reference(reader: &mut Reader, fields: &Fields<'_>) -> (Option<Spanned>, Option<u32>) {
    let Some(fields) = fields.get("reference").and_then(|tree| reader.record(tree, &REFERENCE)) else { return (None, None) };
    let component = fields.get("component").and_then(|tree| reader.text(tree, "a component in quotes"));
    (component, count(reader, &fields, "paths", MOST_PATHS))
}

fn read_mask(reader: &mut Reader, tree: &Tree) -> Option<MaskUse> {
    let fields = reader.record(tree, &MASK)?;
    let resource = fields.get("resource").and_then(|t| reader.text(t, "the name of a resource in quotes"));
    let channel = fields.get("channel").and_then(|t| in_range(reader, t, "a channel", 0, 3)).unwrap_or(0);
    let bound = |reader: &mut Reader, name: &str| fields.get(name).and_then(|t| reader.float(t, "a number"));
    let condition = match (bound(reader, "above"), bound(reader, "below")) {
        (Some(above), None) => Condition::Above(above as f32),
        (None, Some(below)) => Condition::Below(below as f32),
        _ => {
            reader.error(&head(tree), "a mask has one bound", "give `above: …` or `below: …`");
            return None;
        }
    };
    Some(MaskUse { resource: resource?, channel, condition })
}

/// A variant of each pipeline, as it is.
fn read_pipelines(reader: &mut Reader, tree: &Tree) -> Vec<Variant> {
    not_empty(reader, tree, "pipelines");
    let names: Vec<Spanned> = reader.list(tree, "pipelines").iter().filter_map(|tree| reader.text(tree, "a pipeline in quotes")).collect();
    let variant = |pipeline: Spanned| {
        let name = Spanned { text: stem(&pipeline.text), span: pipeline.span.clone() };
        Variant { name, pipeline, set: Vec::new(), vary: Vec::new(), frames: None, image: None }
    };
    names.into_iter().map(variant).collect()
}

fn read_variants(reader: &mut Reader, tree: &Tree) -> Vec<Variant> {
    let entries = reader.map(tree, "variants");
    if matches!(&tree.kind, Kind::Map(entries) if entries.is_empty()) {
        reader.error(&tree.range, "there are no variants: nothing would run", "add one: \"name\": (pipeline: \"acrsm\")");
    }
    entries.into_iter().filter_map(|(name, tree)| read_variant(reader, name, tree)).collect()
}

fn read_variant(reader: &mut Reader, name: Spanned, tree: &Tree) -> Option<Variant> {
    let fields = reader.record(tree, &VARIANT)?;
    let pipeline = fields.get("pipeline").and_then(|t| reader.text(t, "a pipeline in quotes"));
    let set = fields.get("set").map(|tree| read_set(reader, tree)).unwrap_or_default();
    let vary = fields.get("vary").map(|tree| read_vary(reader, tree)).unwrap_or_default();
    let frames = count(reader, &fields, "frames", MOST_FRAMES);
    let image = fields.get("image").and_then(|t| reader.text(t, "the name of a resource in quotes"));
    Some(Variant { name, pipeline: pipeline?, set, vary, frames, image })
}

fn read_set(reader: &mut Reader, tree: &Tree) -> Vec<(String, Preset)> {
    let mut set = Vec::new();
    for (name, tree) in reader.map(tree, "values") {
        if let Some(value) = read_literal(reader, tree) {
            set.push((name.text, Preset { value, name_span: name.span, span: reader.span(&tree.range) }));
        }
    }
    set
}

fn read_vary(reader: &mut Reader, tree: &Tree) -> Vec<Zip> {
    let mut all = Vec::new();
    let mut seen: IndexMap<String, Span> = IndexMap::new();
    for tree in reader.list(tree, "maps from parameters to lists of values") {
        let mut zip: Vec<Knob> = Vec::new();
        for (name, tree) in reader.map(tree, "lists of values") {
            let Some(knob) = read_knob(reader, &name, tree) else { continue };
            if let Some(first) = seen.get(&name.text) {
                let fault = manylight_graph::diagnostics::Diagnostic::error(format!("`{}` varies twice", name.text), name.span.clone());
                reader.out.push(fault.and(first.clone(), "first here").help("remove one of them"));
                continue;
            }
            if let Some(first) = zip.first().filter(|first| first.values.len() != knob.values.len()) {
                let message = format!("`{}` has {} values, `{}` has {}", first.name, first.values.len(), knob.name, knob.values.len());
                let help = "parameters of one map change together and need as many values each; to cross them, give each a map of its own";
                reader.error(&tree.range, message, help);
                continue;
            }
            seen.insert(name.text, name.span);
            zip.push(knob);
        }
        if !zip.is_empty() {
            all.push(Zip(zip));
        }
    }
    all
}

fn read_knob(reader: &mut Reader, name: &Spanned, tree: &Tree) -> Option<Knob> {
    let items = reader.list(tree, "values");
    not_empty(reader, tree, "values");
    let values: Vec<Preset> = items
        .iter()
        .filter_map(|tree| {
            let value = read_literal(reader, tree)?;
            Some(Preset { value, name_span: name.span.clone(), span: reader.span(&tree.range) })
        })
        .collect();
    (!values.is_empty()).then(|| Knob { name: name.text.clone(), values })
}

/// A value as [`manylight_passes::Settings::set`] takes it.
pub(super) fn setting(literal: &Literal) -> String {
    match literal {
        Literal::Text(text) => text.clone(),
        other => other.to_string(),
    }
}
