//! What can be known of a sweep without a scene and without a GPU.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use manylight_graph::{
    Spanned, check,
    diagnostics::{Diagnostic, Diagnostics, Span},
    library::Library,
    pipeline::{Pipeline, Preset, ResourceKind},
    registry::Registry,
    ron::suggest,
    value::ParamKind,
};
use manylight_passes::SceneSource;

use super::document::{Sweep, Variant, Zip};
use crate::metrics;

/// Finds a scene by the name that a sweep gives it.
///
/// # Errors
/// There is none: the text says what is near.
pub type SceneFinder<'a> = dyn Fn(&str) -> Result<SceneSource, String> + 'a;

/// The pipeline that makes references.
pub(super) const REFERENCE: &str = "reference";
/// No sweep has more runs.
const MOST_RUNS: usize = 100_000;

impl Sweep {
    /// Faults of names and values: pipelines, parameters, resources, scenes, components, metrics; knobs that give one run twice.
    pub fn check(&self, library: &Library, registry: &Registry, find: &SceneFinder<'_>) -> Diagnostics {
        let mut out = Diagnostics::default();
        for entry in &self.scenes {
            if let Err(fault) = self.scene(&entry.scene, find) {
                out.push(fault);
            }
        }
        for variant in &self.variants {
            match self.pipeline(library, &variant.pipeline) {
                Ok(pipeline) => self.check_variant(variant, &pipeline, registry, &mut out),
                Err(fault) => out.push(fault),
            }
        }
        self.check_component(library, &mut out);
        for metric in std::iter::once(&self.metric).chain(&self.metrics) {
            if !metrics::KNOWN.iter().any(|known| known.name == metric.text) {
                let fault = Diagnostic::error(format!("there is no metric `{}`", metric.text), metric.span.clone());
                out.push(fault.help(suggest(&metric.text, metrics::KNOWN.iter().map(|known| known.name))));
            }
        }
        for name in self.claims.iter().flat_map(|(_, names)| names) {
            if !self.variants.iter().any(|variant| variant.name.text == name.text) {
                let fault = Diagnostic::error(format!("there is no variant `{}`", name.text), name.span.clone());
                out.push(fault.help(suggest(&name.text, self.variants.iter().map(|variant| variant.name.text.as_str()))));
            }
        }
        self.check_number(&mut out);
        if self.sequence.is_some() {
            for reference in self.scenes.iter().filter_map(|scene| scene.reference.as_ref()) {
                let fault = Diagnostic::error("a file holds one time, a sequence is compared at several", reference.span.clone());
                out.push(fault.help("leave the reference out: it is path-traced for each time, once"));
            }
        }
        out.sorted()
    }

    /// The path of something that the sweep names: beside its file if it is there, else as it is.
    pub(super) fn beside(&self, name: &str) -> PathBuf {
        let folder = self.source.path.as_deref().and_then(Path::parent);
        folder.map(|folder| folder.join(name)).filter(|path| path.is_file()).unwrap_or_else(|| PathBuf::from(name))
    }

    /// Where a scene is loaded from.
    pub(super) fn scene(&self, name: &Spanned, find: &SceneFinder<'_>) -> Result<SceneSource, Diagnostic> {
        let path = self.beside(&name.text);
        let source = if path.is_file() { Ok(SceneSource::file(path)) } else { find(&name.text) };
        source.map_err(|reason| Diagnostic::error(reason, name.span.clone()))
    }

    fn pipeline(&self, library: &Library, name: &Spanned) -> Result<Pipeline, Diagnostic> {
        Pipeline::load(library, self.beside(&name.text)).map_err(|faults| {
            let first = faults.0.first();
            let message = first.map_or_else(|| "it has faults".to_owned(), |fault| fault.message.clone());
            let help = first.and_then(|fault| fault.help.clone()).unwrap_or_default();
            Diagnostic::error(format!("the pipeline `{}` cannot be used: {message}", name.text), name.span.clone()).help(help)
        })
    }

    fn check_variant(&self, variant: &Variant, pipeline: &Pipeline, registry: &Registry, out: &mut Diagnostics) {
        let knobs = self.vary.iter().chain(&variant.vary).flat_map(|zip: &Zip| &zip.0);
        let varied = knobs.flat_map(|knob| knob.values.iter().map(|value| (knob.name.as_str(), value)));
        let fixed = variant.set.iter().map(|(name, value): &(String, Preset)| (name.as_str(), value));
        // A knob of the sweep is checked once for each variant: equal faults are told once.
        for fault in check::check_values(pipeline, registry, fixed.chain(varied)).0 {
            if !out.0.iter().any(|known| known.message == fault.message && known.labels == fault.labels) {
                out.push(fault);
            }
        }
        for knob in self.vary.iter().flat_map(|zip| &zip.0) {
            let own = variant.vary.iter().flat_map(|zip| &zip.0).any(|other| other.name == knob.name);
            if let Some((name, value)) = variant.set.iter().find(|(name, _)| *name == knob.name && !own) {
                let message = format!("`{name}` varies in the whole sweep, but variant `{}` sets it", variant.name.text);
                let fault = Diagnostic::error(message, value.name_span.clone()).and(knob.values[0].name_span.clone(), "varied here");
                out.push(fault.help("remove one of them, or let the variants vary it that should"));
            }
        }
        let textures = || {
            let is_texture = |kind: &ResourceKind| matches!(kind, ResourceKind::Texture { .. });
            pipeline.resources.iter().filter(move |(_, r)| is_texture(&r.kind)).map(|(name, _)| name.as_str())
        };
        let names = std::iter::once(variant.image.as_ref().unwrap_or(&self.image)).chain(self.mask.as_ref().map(|mask| &mask.resource));
        for name in names.filter(|name| !textures().any(|known| known == name.text)) {
            let message = format!("the pipeline `{}` of variant `{}` has no texture `{}`", pipeline.name, variant.name.text, name.text);
            out.push(Diagnostic::error(message, name.span.clone()).help(suggest(&name.text, textures())));
        }
    }

    fn check_component(&self, library: &Library, out: &mut Diagnostics) {
        let Ok(pipeline) = Pipeline::load(library, REFERENCE) else { return };
        let Some(ParamKind::Choice { options, .. }) = pipeline.params.get("component").map(|param| &param.kind) else { return };
        let component = &self.reference.component;
        if !options.contains(&component.text) {
            let fault = Diagnostic::error(format!("there is no component `{}`", component.text), component.span.clone());
            out.push(fault.help(suggest(&component.text, options.iter().map(String::as_str))));
        }
    }

    fn check_number(&self, out: &mut Diagnostics) {
        let nowhere = || Span::new(&self.source, 0..0);
        let steps = |zips: &[Zip]| zips.iter().fold(1_usize, |n, zip| n.saturating_mul(zip.0.first().map_or(1, |knob| knob.values.len())));
        let of_variants = self.variants.iter().fold(0_usize, |n, v| n.saturating_add(steps(&self.vary).saturating_mul(steps(&v.vary))));
        let others = self.scenes.len() * self.sizes.len() * self.seeds.len();
        let number = of_variants.saturating_mul(others);
        if number > MOST_RUNS {
            let fault = Diagnostic::error(format!("the sweep has {number} runs, more than {MOST_RUNS}"), nowhere());
            return out.push(fault.help("shorten its lists, or split it into several sweeps"));
        }
        let mut seen = BTreeMap::new();
        for run in self.runs() {
            *seen.entry(run.name).or_insert(0) += 1;
        }
        if let Some((name, times)) = seen.into_iter().find(|(_, times)| *times > 1) {
            let fault = Diagnostic::error(format!("the run `{name}` would be done {times} times"), nowhere());
            out.push(fault.help("a list of values, scenes, sizes or seeds holds something twice"));
        }
    }
}
