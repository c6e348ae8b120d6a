//! Sizes of resources, with every limit checked.

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    assign::Values,
    diagnostics::{Diagnostic, Span},
    expr::{self, EvalError, ExprAt, RefKind, Scope},
    pipeline::{Mips, ResourceKind, Size},
    plan::PlanInput,
    registry::{External, PortKind},
    resolve::Linked,
    value::{Encoding, Format, ResourceDesc, Value},
};

/// The largest side of a texture in texels.
pub const LARGEST_SIDE: u64 = 16_384;
/// The largest buffer in bytes.
pub const LARGEST_BUFFER: u64 = 1 << 31;

/// Sizes may refer to sizes this often.
pub(crate) const LONGEST_CHAIN: usize = 256;

/// Descriptions by name, computed on demand.
pub(crate) struct Sizes<'a, 'p> {
    linked: &'p Linked<'a>,
    values: &'p Values<'a>,
    input: &'p PlanInput,
    /// Whether conditions with names hold.
    conditions: BTreeMap<&'p str, bool>,
    /// `None` for a resource without a size, whose fault is reported.
    known: BTreeMap<&'a str, Option<ResourceDesc>>,
    /// Resources whose sizes are being computed.
    depth: usize,
}

impl<'a, 'p> Sizes<'a, 'p> {
    pub fn new(linked: &'p Linked<'a>, values: &'p Values<'a>, input: &'p PlanInput, conditions: BTreeMap<&'p str, bool>) -> Self {
        Self { linked, values, input, conditions, known: BTreeMap::new(), depth: 0 }
    }

    /// The description of a resource or external.
    pub fn get(&mut self, name: &'a str, out: &mut Vec<Diagnostic>) -> Option<ResourceDesc> {
        if let Some(known) = self.known.get(name) {
            return known.clone();
        }
        // Resources whose sizes need each other are tainted and never come here twice.
        self.known.insert(name, None);
        let found = match self.linked.pipeline.resources.get(name) {
            Some(resource) if self.depth < LONGEST_CHAIN => {
                self.depth += 1;
                let found = self.resource(name, resource, out);
                self.depth -= 1;
                found
            }
            Some(resource) => {
                let message = format!("sizes refer to each other through more than {LONGEST_CHAIN} resources");
                out.push(Diagnostic::error(message, resource.span.clone()).help("give some of them sizes of their own"));
                None
            }
            None => self.external(name, out),
        };
        self.known.insert(name, found.clone());
        found
    }

    fn external(&self, name: &str, out: &mut Vec<Diagnostic>) -> Option<ResourceDesc> {
        let external = self.linked.registry.externals.get(name)?;
        match self.input.externals.get(name) {
            Some(given) if same_kind(&external.kind, given) => Some(given.clone()),
            Some(given) => {
                let message = format!("the scene gives `{name}` as {given}, and nodes expect {}", crate::fit::describe(&external.kind));
                out.push(Diagnostic::error_nowhere(message).help("this is a fault of the program that provides the scene"));
                None
            }
            None => stand_in(external, self.linked),
        }
    }

    fn resource(&mut self, name: &'a str, resource: &'a crate::pipeline::Resource, out: &mut Vec<Diagnostic>) -> Option<ResourceDesc> {
        if self.linked.tainted.contains(name) && self.depends_on_itself(name) {
            return None;
        }
        match &resource.kind {
            ResourceKind::Texture { format, size, mips, encoding } => {
                self.texture(name, *format, size, mips, *encoding, &resource.span, out)
            }
            ResourceKind::Buffer { of, count } => {
                let stride = self.linked.registry.layout(of).map(|l| l.size.max(1))?;
                let count_value = self.eval(name, "number of elements", count, out)?;
                if count_value == 0 {
                    let fault = Diagnostic::error(format!("the buffer `{name}` has no elements"), count.span.clone());
                    out.push(fault.help(self.remedy("raise", "the count", &count.refs)));
                    return None;
                }
                match count_value.checked_mul(stride.into()) {
                    Some(bytes) if bytes <= LARGEST_BUFFER => {
                        Some(ResourceDesc::Buffer { element: of.clone(), stride, count: count_value })
                    }
                    bytes => {
                        let bytes = bytes.map_or_else(|| "more than 2^64".to_owned(), |b| b.to_string());
                        let message = format!(
                            "the buffer `{name}` is too large: {count_value} elements of {stride} bytes are {bytes} bytes, more than {LARGEST_BUFFER}"
                        );
                        out.push(Diagnostic::error(message, count.span.clone()).help(self.remedy("lower", "the count", &count.refs)));
                        None
                    }
                }
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn texture(
        &mut self,
        name: &'a str,
        format: Format,
        size: &'a Size,
        mips: &'a Mips,
        encoding: Encoding,
        span: &Span,
        out: &mut Vec<Diagnostic>,
    ) -> Option<ResourceDesc> {
        let (output_w, output_h) = self.input.output;
        let (width, height, place, refs) = match size {
            Size::Output => (output_w.into(), output_h.into(), span, Vec::new()),
            Size::OutputScaled(a, b) => {
                let scale = |v: u32| (u64::from(v) * u64::from(*a)).div_ceil(u64::from(*b));
                (scale(output_w), scale(output_h), span, Vec::new())
            }
            Size::Exact(w, h) => {
                let width = self.eval(name, "width", w, out);
                let height = self.eval(name, "height", h, out);
                let (width, height) = (width?, height?);
                let place = if (1..=LARGEST_SIDE).contains(&width) { &h.span } else { &w.span };
                // Of a side that is as it should be, nothing need change.
                let wrong = |side: u64| !(1..=LARGEST_SIDE).contains(&side);
                let refs =
                    [(width, w), (height, h)].into_iter().filter(|(side, _)| wrong(*side)).flat_map(|(_, e)| e.refs.clone()).collect();
                (width, height, place, refs)
            }
            Size::Like(other) => {
                let (key, _) = self.linked.pipeline.resources.get_key_value(&other.text).map_or_else(
                    || self.linked.registry.externals.get_key_value(&other.text).map(|(k, _)| (k, ())),
                    |(k, _)| Some((k, ())),
                )?;
                match self.get(key, out)? {
                    ResourceDesc::Texture { width, height, .. } => (width.into(), height.into(), &other.span, Vec::new()),
                    _ => return None,
                }
            }
        };
        if width == 0 || height == 0 {
            let fault = Diagnostic::error(format!("the texture `{name}` has no texels: {width}×{height}"), place.clone());
            out.push(fault.help(self.remedy("raise", "the size", &refs)));
            return None;
        }
        if width > LARGEST_SIDE || height > LARGEST_SIDE {
            let message = format!("the texture `{name}` is too large: {width}×{height} texels, more than {LARGEST_SIDE} a side");
            let remedy = if matches!(size, Size::Output | Size::OutputScaled(..)) {
                "render a smaller picture".into()
            } else {
                self.remedy("lower", "the size", &refs)
            };
            out.push(Diagnostic::error(message, place.clone()).help(remedy));
            return None;
        }
        // Both are at most 16384 here.
        let (width, height) = (width as u32, height as u32);
        let full = 32 - width.max(height).leading_zeros();
        let mips = match mips {
            Mips::One => 1,
            Mips::Full => full,
            Mips::Count(count) => {
                let levels = self.eval(name, "number of mip levels", count, out)?;
                if !(1..=u64::from(full)).contains(&levels) {
                    let message = format!("the texture `{name}` cannot have {levels} mip levels: {width}×{height} texels have 1 to {full}");
                    let word = if levels == 0 { "raise" } else { "lower" };
                    out.push(Diagnostic::error(message, count.span.clone()).help(self.remedy(word, "the number of levels", &count.refs)));
                    return None;
                }
                levels as u32
            }
        };
        Some(ResourceDesc::Texture { format, width, height, layers: 1, array: false, mips, encoding })
    }

    fn depends_on_itself(&self, name: &'a str) -> bool {
        // Linking reports circles among sizes and taints them; a tainted resource outside of a circle still has a size.
        self.mentioned(name).1.contains(name)
    }

    /// Parameters that decide the size of a resource, by themselves or through other resources.
    pub fn sized_by(&self, name: &'a str) -> Vec<String> {
        self.mentioned(name).0.into_iter().map(str::to_owned).collect()
    }

    /// Parameters and resources that the size of a resource is computed from, also through others.
    fn mentioned(&self, name: &'a str) -> (BTreeSet<&'a str>, BTreeSet<&'a str>) {
        let (mut params, mut seen) = (BTreeSet::new(), BTreeSet::new());
        let mut at = vec![name];
        while let Some(next) = at.pop() {
            let Some(resource) = self.linked.pipeline.resources.get(next) else { continue };
            let mut names: Vec<&'a str> = Vec::new();
            let exprs: Vec<&'a ExprAt> = match &resource.kind {
                ResourceKind::Texture { size, mips, .. } => {
                    let mut exprs = Vec::new();
                    match size {
                        Size::Exact(w, h) => exprs.extend([&**w, &**h]),
                        Size::Like(other) => names.push(&other.text),
                        _ => {}
                    }
                    if let Mips::Count(count) = mips {
                        exprs.push(count);
                    }
                    exprs
                }
                ResourceKind::Buffer { count, .. } => vec![count],
            };
            for r in exprs.iter().flat_map(|e| &e.refs) {
                match r.kind {
                    RefKind::Param => _ = params.insert(r.name.text.as_str()),
                    RefKind::Texture | RefKind::Buffer => names.push(&r.name.text),
                    RefKind::Condition => {}
                }
            }
            at.extend(names.into_iter().filter(|n| seen.insert(*n)));
        }
        (params, seen)
    }

    fn eval(&mut self, name: &str, what: &str, at: &'a ExprAt, out: &mut Vec<Diagnostic>) -> Option<u64> {
        let mut found = BTreeMap::new();
        for r in at.refs.iter().filter(|r| matches!(r.kind, RefKind::Texture | RefKind::Buffer)) {
            let desc = self.get(&r.name.text, out)?;
            found.insert(r.name.text.as_str(), desc);
        }
        let scope = ResourceScope { values: self.values, conditions: &self.conditions, output: self.input.output, found };
        match expr::eval(&at.expr, &scope) {
            Ok(value) => Some(value),
            Err(EvalError::Unknown(_)) => None,
            Err(error) => {
                let message = format!("the {what} of `{name}` cannot be computed: {error}");
                let remedy = match error {
                    EvalError::DivisionByZero => "make the divisor at least 1".to_owned(),
                    EvalError::Negative(..) => self.remedy("raise", "", &at.refs),
                    _ => self.remedy("lower", "the numbers", &at.refs),
                };
                out.push(Diagnostic::error(message, at.span.clone()).help(remedy));
                None
            }
        }
    }

    /// Names the parameters that decide.
    fn remedy(&self, verb: &str, noun: &str, refs: &[expr::ExprRef]) -> String {
        let shown = |divides: bool| -> String {
            let mut params: Vec<&str> =
                refs.iter().filter(|r| r.kind == RefKind::Param && r.divides == divides).map(|r| r.name.text.as_str()).collect();
            params.sort_unstable();
            params.dedup();
            let value = |name: &str| self.values.get(name).map(Value::to_string).unwrap_or_default();
            params.iter().map(|p| format!("`{p}` (now {})", value(p))).collect::<Vec<_>>().join(" or ")
        };
        let opposite = if verb == "lower" { "raise" } else { "lower" };
        match (shown(false), shown(true)) {
            (same, other) if same.is_empty() && other.is_empty() => format!("{verb} {noun}"),
            (same, other) if other.is_empty() => format!("{verb} the parameter {same}"),
            (same, other) if same.is_empty() => format!("{opposite} the parameter {other}"),
            (same, other) => format!("{verb} the parameter {same}, or {opposite} {other}"),
        }
    }
}

struct ResourceScope<'s, 'a> {
    values: &'s Values<'a>,
    conditions: &'s BTreeMap<&'s str, bool>,
    output: (u32, u32),
    found: BTreeMap<&'s str, ResourceDesc>,
}

impl Scope for ResourceScope<'_, '_> {
    fn param(&self, name: &str) -> Option<i64> {
        match self.values.get(name) {
            Some(Value::Int(v)) => Some(*v),
            _ => None,
        }
    }

    fn output(&self) -> (u32, u32) {
        self.output
    }

    fn texture(&self, name: &str) -> Option<(u32, u32)> {
        match self.found.get(name)? {
            ResourceDesc::Texture { width, height, .. } => Some((*width, *height)),
            _ => None,
        }
    }

    fn elements(&self, name: &str) -> Option<u64> {
        match self.found.get(name)? {
            ResourceDesc::Buffer { count, .. } => Some(*count),
            _ => None,
        }
    }

    fn holds(&self, name: &str) -> Option<bool> {
        self.conditions.get(name).copied()
    }
}

fn same_kind(kind: &PortKind, desc: &ResourceDesc) -> bool {
    match (kind, desc) {
        (PortKind::Texture { format, array }, ResourceDesc::Texture { format: given, array: is_array, .. }) => {
            array == is_array && format.is_none_or(|f| f == *given)
        }
        (PortKind::Buffer { of }, ResourceDesc::Buffer { element, .. })
        | (PortKind::Uniform { of }, ResourceDesc::Uniform { element, .. }) => of == element,
        _ => false,
    }
}

/// The smallest thing of the right kind, for checks without a scene.
fn stand_in(external: &External, linked: &Linked<'_>) -> Option<ResourceDesc> {
    let size = |of: &str| external.layout.clone().or_else(|| linked.registry.layout(of)).map_or(16, |l| l.size.max(1));
    Some(match &external.kind {
        PortKind::Texture { format, array } => ResourceDesc::Texture {
            format: format.unwrap_or(Format::Rgba8Unorm),
            width: 1,
            height: 1,
            layers: 1,
            array: *array,
            mips: 1,
            encoding: Encoding::Plain,
        },
        PortKind::Buffer { of } => ResourceDesc::Buffer { element: of.clone(), stride: size(of), count: 1 },
        PortKind::Uniform { of } => ResourceDesc::Uniform { element: of.clone(), size: size(of) },
    })
}
