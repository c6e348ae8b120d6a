//! Errors of naga and naga_oil as diagnostics in the right file.

use std::{ops::Range, sync::Arc};

use naga_oil::compose::{Composer, ComposerError, ComposerErrorInner, ErrSource};

use super::{Composition, SPAN_SHIFT};
use crate::{
    diagnostics::{Diagnostic, Source, Span},
    reflect::demangle,
    render::suggest,
    wgsl,
};

impl Composition {
    /// Turns the composer's error into a diagnostic in the right file.
    pub(super) fn explain(&self, composer: &Composer, source: &Arc<Source>, path: &str, error: &ComposerError) -> Diagnostic {
        let (file, module_index) = match &error.source {
            ErrSource::Module { name, .. } => match self.modules.get(name) {
                Some(module) => {
                    let index = composer.module_index.iter().find(|(_, n)| *n == name).map_or(0, |(i, _)| *i);
                    (&module.source, index)
                }
                None => (source, 0),
            },
            ErrSource::Constructing { path: at, .. } => match self.modules.values().find(|m| m.path == *at && m.path != path) {
                Some(module) => (&module.source, 0),
                None => (source, 0),
            },
        };
        let replaced = error.source.source(composer);
        let offset = error.source.offset();
        let place = |range: Range<usize>| {
            let local = |at: usize| (at & ((1 << SPAN_SHIFT) - 1)).saturating_sub(offset);
            let start = wgsl::original_offset(&file.text, &replaced, local(range.start));
            let end = wgsl::original_offset(&file.text, &replaced, local(range.end)).max(start);
            Span::new(file, start..end)
        };
        let at = |position: usize| {
            Span::new(file, {
                let p = wgsl::original_offset(&file.text, &replaced, position);
                p..p
            })
        };
        match &error.inner {
            ComposerErrorInner::WgslParseError(e) => {
                let labels = e.labels().filter_map(|(span, text)| Some((span.to_range()?, text.to_owned()))).collect();
                self.labelled(self.undecorate(e.message()), labels, &place, file)
            }
            ComposerErrorInner::HeaderValidationError(e) | ComposerErrorInner::ShaderValidationError(e) => {
                let labels = e
                    .spans()
                    .filter_map(|(span, text)| Some((span.to_range()?, text.clone())))
                    .filter(|(range, _)| matches!(range.start >> SPAN_SHIFT, 0) || range.start >> SPAN_SHIFT == module_index)
                    .collect();
                self.labelled(self.undecorate(&chain(e.as_inner())), labels, &place, file)
            }
            ComposerErrorInner::ImportNotFound(name, position) => {
                let help = suggest(name, self.modules.keys().map(String::as_str));
                Diagnostic::error(format!("there is no module `{name}`"), at(*position)).help(help)
            }
            ComposerErrorInner::ImportParseError(message, position) => {
                Diagnostic::error(format!("the import cannot be read: {message}"), at(*position))
                    .help("write `#import common::file::{a, b}`")
            }
            ComposerErrorInner::InvalidIdentifier { original, at: span } => {
                let range = span.to_range().map_or(0..0, |r| place(r).range);
                Diagnostic::error(format!("the name `{original}` cannot be shared between files"), Span::new(file, range))
                    .help("names of members and items in shaders/common must not end in a digit or be reserved words: rename it")
            }
            ComposerErrorInner::DecorationInSource(range) => {
                Diagnostic::error("this name is reserved by the composer", Span::new(file, range.clone()))
            }
            ComposerErrorInner::NotEnoughEndIfs(p)
            | ComposerErrorInner::TooManyEndIfs(p)
            | ComposerErrorInner::ElseWithoutCondition(p)
            | ComposerErrorInner::DefineInModule(p)
            | ComposerErrorInner::UnknownShaderDef { pos: p, .. }
            | ComposerErrorInner::UnknownShaderDefOperator { pos: p, .. }
            | ComposerErrorInner::OverrideNotVirtual { pos: p, .. }
            | ComposerErrorInner::InvalidShaderDefComparisonValue { pos: p, .. }
            | ComposerErrorInner::InvalidShaderDefDefinitionValue { pos: p, .. } => {
                Diagnostic::error(self.undecorate(&error.inner.to_string()), at(*p))
            }
            ComposerErrorInner::InvalidWgslDirective { position: line, .. } => {
                let start = file.text.lines().take(*line).map(|l| l.len() + 1).sum();
                Diagnostic::error(error.inner.to_string(), Span::new(file, start..start))
            }
            other => Diagnostic::error(self.undecorate(&other.to_string()), Span::new(file, 0..0)),
        }
    }

    pub(super) fn labelled(
        &self,
        message: String,
        labels: Vec<(Range<usize>, String)>,
        place: &dyn Fn(Range<usize>) -> Span,
        file: &Arc<Source>,
    ) -> Diagnostic {
        let mut labels = labels.into_iter();
        match labels.next() {
            None => {
                // naga tells no place of what is wrong with an entry point's attributes.
                let attribute = if message.contains("Workgroup size") { file.text.find("@workgroup_size") } else { None };
                let range = attribute.map_or(0..0, |at| at..at + "@workgroup_size".len());
                Diagnostic::error(message, Span::new(file, range))
            }
            Some((range, text)) => {
                let first = Diagnostic::error(message, place(range)).at(self.label(&text));
                labels.fold(first, |fault, (range, text)| fault.and(place(range), self.label(&text)))
            }
        }
    }

    /// A label in the user's words: indices into naga's tables say nothing.
    pub(super) fn label(&self, text: &str) -> String {
        if text.starts_with("naga::") { String::new() } else { self.undecorate(text) }
    }

    /// Takes naga_oil's marks out of a message.
    pub(super) fn undecorate(&self, text: &str) -> String {
        let mut text = text.to_owned();
        for name in self.modules.keys() {
            let mark = Composer::decorated_name(Some(name), "");
            if text.contains(&mark) {
                text = text.replace(&mark, "");
            }
        }
        debug_assert!(demangle(&text).len() <= text.len());
        text
    }
}

/// An error and its causes, from the outside in. Those that only number an item that the labels show are left out.
pub(super) fn chain(error: &dyn std::error::Error) -> String {
    let mut parts = Vec::new();
    let mut at = Some(error);
    while let Some(cause) = at {
        parts.push(cause.to_string());
        at = cause.source();
    }
    let last = parts.len().saturating_sub(1);
    let numbered = |text: &str| {
        text.ends_with(" is invalid") && ["Expression [", "Function [", "Entry point ", "Call to ["].iter().any(|s| text.starts_with(s))
    };
    let kept: Vec<String> = parts.into_iter().enumerate().filter(|(i, text)| *i == last || !numbered(text)).map(|(_, text)| text).collect();
    wgsl_types(&kept.join(": "))
}

/// naga's spelling of types as WGSL has it.
fn wgsl_types(text: &str) -> String {
    let mut text = text.to_owned();
    for (kind, width, scalar, letter) in
        [("Float", 4, "f32", "f"), ("Uint", 4, "u32", "u"), ("Sint", 4, "i32", "i"), ("Bool", 1, "bool", "<bool>")]
    {
        let inner = format!("Scalar {{ kind: {kind}, width: {width} }}");
        text = text.replace(&format!("Scalar({inner})"), scalar);
        for (size, n) in [("Bi", 2), ("Tri", 3), ("Quad", 4)] {
            text = text.replace(&format!("Vector {{ size: {size}, scalar: {inner} }}"), &format!("vec{n}{letter}"));
        }
    }
    text
}
