//! A pipeline as its documents say it, with `extends` and `include` carried out and the place of everything.

use std::{collections::BTreeSet, sync::Arc};

use indexmap::IndexMap;

use crate::{
    condition::{Condition, ConditionKind, NamedCondition},
    diagnostics::{Source, Span},
    expr::ExprAt,
    params::Literal,
    quality::Quality,
    reader::Spanned,
    registry::Param,
    value::{Encoding, Format},
};

/// A pipeline, read and merged, but not yet checked against the registry.
#[derive(Debug, Clone)]
pub struct Pipeline {
    /// File stem (`acrsm`).
    pub name: String,
    /// What it does.
    pub doc: String,
    /// Parameters in document order.
    pub params: IndexMap<String, Param>,
    /// Conditions by name, in document order.
    pub conditions: IndexMap<String, NamedCondition>,
    /// Preset values by `parameter` or `node.parameter`.
    pub set: IndexMap<String, Preset>,
    /// Resources in document order.
    pub resources: IndexMap<String, Resource>,
    /// Nodes in document order, by id.
    pub nodes: IndexMap<String, NodeUse>,
    /// Combinations of values that make no sense, those of extended and included files first.
    pub refuse: Vec<Refusal>,
    /// What it gives up to hold a time, if it says so.
    pub quality: Option<Quality>,
    /// The resource to show.
    pub presents: Spanned,
    /// The resource with linear radiance.
    pub radiance: Option<Spanned>,
    /// Every file read, the pipeline's own first.
    pub sources: Vec<Arc<Source>>,
    /// What could not be read; empty in a pipeline without faults.
    pub(crate) gaps: Gaps,
}

/// What is missing from a pipeline because of faults in its text, so that nothing that follows from them is reported.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Gaps {
    pub params: BTreeSet<String>,
    pub resources: BTreeSet<String>,
    pub conditions: BTreeSet<String>,
    /// Some node was left out.
    pub nodes: bool,
    /// Some refusal was left out: what it refuses may be faulty.
    pub refuse: bool,
    /// Some file was left out: any name may have been in it.
    pub files: bool,
}

impl Gaps {
    pub fn extend(&mut self, other: Self) {
        self.params.extend(other.params);
        self.resources.extend(other.resources);
        self.conditions.extend(other.conditions);
        self.nodes |= other.nodes;
        self.refuse |= other.refuse;
        self.files |= other.files;
    }
}

/// A value given in `set`.
#[derive(Debug, Clone, PartialEq)]
pub struct Preset {
    /// The value.
    pub value: Literal,
    /// Where the name stands.
    pub name_span: Span,
    /// Where the value stands.
    pub span: Span,
}

/// A combination of values that makes no sense.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// The values.
    pub when: Condition,
    /// Why, in a sentence.
    pub because: String,
}

/// A texture or buffer that nodes write and read.
#[derive(Debug, Clone, PartialEq)]
pub struct Resource {
    /// What it is.
    pub kind: ResourceKind,
    /// Kept for the next frame.
    pub history: bool,
    /// What it holds.
    pub doc: String,
    /// Where its name stands.
    pub span: Span,
}

/// Format and size of a resource.
#[derive(Debug, Clone, PartialEq)]
pub enum ResourceKind {
    /// A 2D texture.
    Texture {
        /// Texel format.
        format: Format,
        /// Size of mip level 0.
        size: Size,
        /// Number of mip levels.
        mips: Mips,
        /// Meaning of the texels.
        encoding: Encoding,
    },
    /// A storage buffer.
    Buffer {
        /// WGSL type of an element.
        of: String,
        /// Number of elements.
        count: ExprAt,
    },
}

/// The size of a texture.
#[derive(Debug, Clone, PartialEq)]
pub enum Size {
    /// The picture's.
    Output,
    /// The picture's times a fraction, rounded up.
    OutputScaled(u32, u32),
    /// Width and height.
    Exact(Box<ExprAt>, Box<ExprAt>),
    /// Another texture's.
    Like(Spanned),
}

/// The mip levels of a texture.
#[derive(Debug, Clone, PartialEq)]
pub enum Mips {
    /// Only level 0.
    One,
    /// Down to 1×1.
    Full,
    /// That many.
    Count(Box<ExprAt>),
}

/// A node of the pipeline.
#[derive(Debug, Clone, PartialEq)]
pub struct NodeUse {
    /// Its id, unique in the pipeline.
    pub id: Spanned,
    /// Its name in the registry.
    pub node: Spanned,
    /// Connections of inputs by port.
    pub inputs: IndexMap<String, Connection>,
    /// Connections of outputs by port.
    pub outputs: IndexMap<String, Connection>,
    /// Parameters by name.
    pub params: IndexMap<String, Argument>,
    /// When it runs; always, if absent.
    pub when: Option<Condition>,
    /// File stem of the document that declares it.
    pub stage: String,
    /// Something in it could not be read.
    pub(crate) broken: bool,
}

/// A port and the resource at it.
#[derive(Debug, Clone, PartialEq)]
pub struct Connection {
    /// The resource or external.
    pub resource: Spanned,
    /// The last frame's value.
    pub previous: bool,
    /// Where the port's name stands.
    pub port_span: Span,
}

/// The value of a node's parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Argument {
    /// The value or the pipeline's parameter.
    pub value: ArgumentValue,
    /// Where the parameter's name stands.
    pub name_span: Span,
    /// Where the value stands.
    pub span: Span,
}

/// Where the value of a node's parameter comes from.
#[derive(Debug, Clone, PartialEq)]
pub enum ArgumentValue {
    /// Written in the document.
    Literal(Literal),
    /// A parameter of the pipeline.
    Param(String),
    /// One of two values, by a condition.
    If {
        /// The condition.
        when: Box<Condition>,
        /// The value when it holds.
        then: Box<ValueAt>,
        /// The value when it does not.
        otherwise: Box<ValueAt>,
    },
}

/// A value with its place.
#[derive(Debug, Clone, PartialEq)]
pub struct ValueAt {
    /// The value.
    pub value: ArgumentValue,
    /// Where it stands.
    pub span: Span,
}

impl ArgumentValue {
    /// Every condition that it depends on.
    pub fn conditions(&self) -> Vec<&Condition> {
        let Self::If { when, then, otherwise } = self else { return Vec::new() };
        let branches = [then, otherwise].into_iter().flat_map(|branch| branch.value.conditions());
        std::iter::once(&**when).chain(branches).collect()
    }

    /// Every parameter of the pipeline that it may be.
    pub fn params(&self) -> Vec<&str> {
        match self {
            Self::Literal(_) => Vec::new(),
            Self::Param(name) => vec![name],
            Self::If { then, otherwise, .. } => [then, otherwise].into_iter().flat_map(|branch| branch.value.params()).collect(),
        }
    }
}

impl Pipeline {
    /// Every condition in it: those with names, of nodes, of their parameters' values and of refusals.
    pub fn every_condition(&self) -> impl Iterator<Item = &Condition> {
        let named = self.conditions.values().map(|condition| &condition.when);
        let nodes = self.nodes.values().flat_map(|node| {
            let values = node.params.values().flat_map(|argument| argument.value.conditions());
            node.when.iter().chain(values)
        });
        named.chain(nodes).chain(self.refuse.iter().map(|refusal| &refusal.when))
    }

    /// Calls `visit` for every clause of a condition of this pipeline ([`Condition::clauses`]), and of those that it names, each once.
    pub fn clauses<'a>(&'a self, condition: &'a Condition, visit: &mut dyn FnMut(&'a Condition)) {
        let mut seen: BTreeSet<&str> = BTreeSet::new();
        let mut open = vec![condition];
        while let Some(condition) = open.pop() {
            condition.clauses(&mut |clause| {
                visit(clause);
                if let ConditionKind::Holds(name) = &clause.kind
                    && let Some(named) = self.conditions.get(&name.text)
                    && seen.insert(&name.text)
                {
                    open.push(&named.when);
                }
            });
        }
    }

    /// Names of the measured features that its conditions test: without any, a scene need not be measured.
    pub fn measured_features(&self) -> BTreeSet<&str> {
        let mut names = BTreeSet::new();
        for condition in self.every_condition() {
            condition.clauses(&mut |clause| {
                if let ConditionKind::Above(name, _) = &clause.kind {
                    names.insert(name.text.as_str());
                }
            });
        }
        names
    }
}
