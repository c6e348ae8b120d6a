//! Conditions: RON values over parameters and scene features.

use indexmap::IndexMap;

use crate::{
    diagnostics::Span,
    params::check_identifier,
    reader::{Reader, Shape, Spanned},
    render::suggest,
    tree::{Kind, Tree},
};

/// When a node runs, a combination of values is refused, or a parameter has one value rather than another.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// What must hold.
    pub kind: ConditionKind,
    /// Where it stands.
    pub span: Span,
}

/// The forms of a condition.
#[derive(Debug, Clone, PartialEq)]
pub enum ConditionKind {
    /// All of them hold.
    All(Vec<Condition>),
    /// At least one of them holds.
    Any(Vec<Condition>),
    /// It does not hold.
    Not(Box<Condition>),
    /// A choice parameter has this option.
    Is(Spanned, Spanned),
    /// A boolean parameter is on.
    IsOn(Spanned),
    /// A number parameter is not below.
    AtLeast(Spanned, f64),
    /// A number parameter is below.
    Below(Spanned, f64),
    /// The scene has this.
    Feature(Spanned),
    /// What was measured of the scene is more than this, or may be by its error. What was not measured is.
    Above(Spanned, Bound),
    /// A choice of `auto`, `on` and `off`: on, or auto and the condition holds.
    Switch(Spanned, Box<Condition>),
    /// The condition of this name holds.
    Holds(Spanned),
}

/// A number that a measured feature is compared with.
#[derive(Debug, Clone, PartialEq)]
pub enum Bound {
    /// Written in the document.
    Number(f64),
    /// A number parameter of the pipeline.
    Param(Spanned),
}

/// A condition with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedCondition {
    /// What it says, in a sentence.
    pub doc: String,
    /// What must hold.
    pub when: Condition,
    /// Where its name stands.
    pub span: Span,
}

impl Condition {
    /// Calls `visit` for every clause in it that names something: a parameter, a feature or a condition. A switch comes before what it switches;
    /// what is behind the name of another condition is not visited.
    pub fn clauses<'a>(&'a self, visit: &mut dyn FnMut(&'a Condition)) {
        match &self.kind {
            ConditionKind::All(list) | ConditionKind::Any(list) => list.iter().for_each(|c| c.clauses(visit)),
            ConditionKind::Not(inner) => inner.clauses(visit),
            ConditionKind::Switch(_, inner) => {
                visit(self);
                inner.clauses(visit);
            }
            _ => visit(self),
        }
    }

    /// Names of the parameters that a clause tests by itself.
    pub fn params(&self) -> impl Iterator<Item = &Spanned> {
        let tested = match &self.kind {
            ConditionKind::Is(name, _)
            | ConditionKind::IsOn(name)
            | ConditionKind::AtLeast(name, _)
            | ConditionKind::Below(name, _)
            | ConditionKind::Switch(name, _)
            | ConditionKind::Above(_, Bound::Param(name)) => Some(name),
            _ => None,
        };
        tested.into_iter()
    }
}

const FORMS: &[&str] = &["All", "Any", "Not", "Is", "IsOn", "AtLeast", "Below", "Feature", "Above", "Switch", "Holds"];

/// Reads a condition.
pub(crate) fn read(reader: &mut Reader, tree: &Tree) -> Option<Condition> {
    let Kind::Tuple(Some(name), items) = &tree.kind else {
        match &tree.kind {
            Kind::Name(name) if FORMS.contains(&name.as_str()) => {
                reader.error(&tree.range, format!("`{name}` needs something in parentheses"), usage(name));
            }
            Kind::Name(name) => reader.error(&tree.range, format!("unknown condition `{name}`"), suggest(name, FORMS.iter().copied())),
            _ => reader.expected(
                tree,
                "a condition",
                "conditions are All, Any, Not, Is, IsOn, AtLeast, Below, Feature, Above, Switch and Holds",
            ),
        }
        return None;
    };
    let form = name.text.as_str();
    let kind = match (form, items.as_slice()) {
        ("All" | "Any", [list]) => {
            let items: Vec<_> = reader.list(list, "conditions").iter().map(|item| read(reader, item)).collect();
            let items: Vec<_> = items.into_iter().collect::<Option<_>>()?;
            if form == "All" { ConditionKind::All(items) } else { ConditionKind::Any(items) }
        }
        ("Not", [inner]) => ConditionKind::Not(Box::new(read(reader, inner)?)),
        ("Is", [name, option]) => {
            let name = reader.text(name, "the name of a parameter in quotes");
            let option = reader.text(option, "an option in quotes");
            ConditionKind::Is(name?, option?)
        }
        ("IsOn", [name]) => ConditionKind::IsOn(reader.text(name, "the name of a parameter in quotes")?),
        ("Feature", [name]) => ConditionKind::Feature(reader.text(name, "the name of a scene feature in quotes")?),
        ("AtLeast" | "Below", [name, bound]) => {
            let name = reader.text(name, "the name of a parameter in quotes");
            let bound = reader.float(bound, "a number");
            if form == "AtLeast" { ConditionKind::AtLeast(name?, bound?) } else { ConditionKind::Below(name?, bound?) }
        }
        ("Above", [name, bound]) => {
            let name = reader.text(name, "the name of a measured feature in quotes");
            let bound = read_bound(reader, bound);
            ConditionKind::Above(name?, bound?)
        }
        ("Switch", [name, inner]) => {
            let name = reader.text(name, "the name of a parameter in quotes");
            let inner = read(reader, inner);
            ConditionKind::Switch(name?, Box::new(inner?))
        }
        ("Holds", [name]) => ConditionKind::Holds(reader.text(name, "the name of a condition in quotes")?),
        _ if FORMS.contains(&form) => {
            reader.error(&tree.range, format!("`{form}` is not used like this"), usage(form));
            return None;
        }
        _ => {
            reader.error(&name.range, format!("unknown condition `{form}`"), suggest(form, FORMS.iter().copied()));
            return None;
        }
    };
    Some(Condition { kind, span: reader.span(&tree.range) })
}

fn usage(form: &str) -> &'static str {
    match form {
        "All" => "write `All([a, b])`",
        "Any" => "write `Any([a, b])`",
        "Not" => "write `Not(a)`",
        "Is" => "write `Is(\"parameter\", \"option\")`",
        "IsOn" => "write `IsOn(\"parameter\")`",
        "AtLeast" => "write `AtLeast(\"parameter\", 32)`",
        "Below" => "write `Below(\"parameter\", 32)`",
        "Above" => "write `Above(\"feature\", 0.02)` or `Above(\"feature\", Param(\"parameter\"))`",
        "Switch" => "write `Switch(\"parameter\", a)`",
        "Holds" => "write `Holds(\"condition\")`",
        _ => "write `Feature(\"name\")`",
    }
}

fn read_bound(reader: &mut Reader, tree: &Tree) -> Option<Bound> {
    match &tree.kind {
        Kind::Tuple(Some(form), items) if form.text == "Param" && items.len() == 1 => {
            reader.text(&items[0], "the name of a parameter in quotes").map(Bound::Param)
        }
        Kind::Number { .. } => reader.float(tree, "a number").map(Bound::Number),
        _ => {
            reader.expected(tree, "a number or Param(\"parameter\")", usage("Above"));
            None
        }
    }
}

const NAMED: Shape = Shape { what: "a condition with a name", required: &["doc", "when"], optional: &[] };

/// No document has more conditions with names.
const MOST_NAMED: usize = 1000;

/// Reads `conditions: {…}`; the second are the names of those that cannot be read.
pub(crate) fn read_named(reader: &mut Reader, tree: &Tree) -> (IndexMap<String, NamedCondition>, Vec<String>) {
    let mut conditions = IndexMap::new();
    let mut gaps = Vec::new();
    let given = reader.map(tree, "conditions");
    if given.len() > MOST_NAMED {
        reader.error(&tree.range, format!("there are {} conditions, more than the {MOST_NAMED} allowed", given.len()), "");
        return (conditions, given.into_iter().map(|(name, _)| name.text).collect());
    }
    for (name, tree) in given {
        check_identifier(reader, &name, "condition");
        if !matches!(tree.kind, Kind::Record(None, _) | Kind::Tuple(None, _)) {
            reader.expected(tree, "a condition with a name", "write `(doc: \"…\", when: …)`");
            gaps.push(name.text);
            continue;
        }
        let fields = reader.record(tree, &NAMED);
        let doc = fields.as_ref().and_then(|f| f.get("doc")).and_then(|t| reader.text(t, "a sentence in quotes"));
        match fields.as_ref().and_then(|f| f.get("when")).and_then(|t| read(reader, t)) {
            Some(when) => {
                conditions.insert(name.text, NamedCondition { doc: doc.map(|d| d.text).unwrap_or_default(), when, span: name.span });
            }
            None => gaps.push(name.text),
        }
    }
    (conditions, gaps)
}
