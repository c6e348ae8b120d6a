//! Reads one pipeline or stage file.

use std::sync::Arc;

use indexmap::IndexMap;

use crate::{
    condition::{self, NamedCondition},
    declaration::read_type,
    diagnostics::{Diagnostic, Source, Span},
    expr, format,
    params::{Literal, check_identifier, read_literal, read_params},
    pipeline::{Argument, ArgumentValue, Connection, Gaps, Mips, NodeUse, Preset, Refusal, Resource, ResourceKind, Size, ValueAt},
    quality::{self, Quality},
    reader::{Reader, Shape, Spanned, head},
    registry::Param,
    render::suggest,
    tree::{Kind, Tree, keys},
    value::Encoding,
};

/// What one file says.
pub(crate) struct Document {
    pub doc: String,
    pub is_stage: bool,
    /// Place of the word `Pipeline` or `Stage`.
    pub head: Span,
    pub extends: Option<Spanned>,
    pub include: Vec<Spanned>,
    pub set: Vec<(String, Preset)>,
    pub params: IndexMap<String, Param>,
    pub conditions: IndexMap<String, NamedCondition>,
    pub resources: IndexMap<String, Resource>,
    pub nodes: Vec<NodeUse>,
    pub refuse: Vec<Refusal>,
    pub quality: Option<Quality>,
    pub presents: Option<Spanned>,
    pub radiance: Option<Spanned>,
    pub gaps: Gaps,
}

const PIPELINE: Shape = Shape {
    what: "Pipeline",
    required: &["doc"],
    optional: &["extends", "set", "include", "params", "conditions", "resources", "nodes", "refuse", "quality", "presents", "radiance"],
};
const STAGE: Shape =
    Shape { what: "Stage", required: &["doc"], optional: &["include", "params", "conditions", "resources", "nodes", "refuse", "quality"] };

/// Reads a file; faults go to `out`.
pub(crate) fn read(source: &Arc<Source>, stage: &str, out: &mut Vec<Diagnostic>) -> Option<Document> {
    let (mut reader, tree) = Reader::open(source);
    let document = tree.and_then(|tree| read_document(&mut reader, &tree, stage));
    out.append(&mut reader.out);
    document
}

fn read_document(reader: &mut Reader, tree: &Tree, stage: &str) -> Option<Document> {
    let shape = match &tree.kind {
        Kind::Record(Some(name), _) | Kind::Tuple(Some(name), _) if name.text == "Pipeline" => PIPELINE,
        Kind::Record(Some(name), _) | Kind::Tuple(Some(name), _) if name.text == "Stage" => STAGE,
        _ => {
            reader.expected(tree, "`Pipeline(…)` or `Stage(…)`", "a pipeline has the form Pipeline(doc: …, nodes: […], presents: …)");
            return None;
        }
    };
    let is_stage = shape.what == "Stage";
    let fields = reader.record(tree, &shape)?;
    let text = |reader: &mut Reader, name: &str, what: &str| fields.get(name).and_then(|t| reader.text(t, what));
    let doc = text(reader, "doc", "a sentence in quotes").map(|d| d.text).unwrap_or_default();
    let extends = text(reader, "extends", "the path of a pipeline in quotes");
    let mut include = Vec::new();
    if let Some(tree) = fields.get("include") {
        for item in reader.list(tree, "paths") {
            include.extend(reader.text(item, "the path of a stage in quotes"));
        }
    }
    let mut set = Vec::new();
    if let Some(tree) = fields.get("set") {
        for (name, tree) in reader.map(tree, "values") {
            if let Some(value) = read_literal(reader, tree) {
                set.push((name.text, Preset { value, name_span: name.span, span: reader.span(&tree.range) }));
            }
        }
    }
    let params = fields.get("params").map(|t| read_params(reader, t)).unwrap_or_default();
    let declared = fields.get("params").map(keys).unwrap_or_default();
    let mut gaps = Gaps { params: declared.into_iter().filter(|name| !params.contains_key(name)).collect(), ..Gaps::default() };
    let (conditions, unread) = fields.get("conditions").map(|t| condition::read_named(reader, t)).unwrap_or_default();
    gaps.conditions.extend(unread);
    let mut resources = IndexMap::new();
    if let Some(tree) = fields.get("resources") {
        for (name, tree) in reader.map(tree, "resources") {
            // Whoever names it has another name in mind.
            gaps.files |= !check_identifier(reader, &name, "resource");
            if let Some(resource) = read_resource(reader, &name, tree) {
                resources.insert(name.text, resource);
            } else {
                gaps.resources.insert(name.text);
            }
        }
    }
    let mut nodes = Vec::new();
    if let Some(tree) = fields.get("nodes") {
        for item in reader.list(tree, "nodes") {
            match read_node(reader, item, stage) {
                Some(node) => nodes.push(node),
                None => gaps.nodes = true,
            }
        }
    }
    let mut refuse = Vec::new();
    if let Some(tree) = fields.get("refuse") {
        for item in reader.list(tree, "refusals") {
            match read_refusal(reader, item) {
                Some(refusal) => refuse.push(refusal),
                None => gaps.refuse = true,
            }
        }
    }
    let quality = fields.get("quality").map(|t| quality::read(reader, t));
    let mut presents = text(reader, "presents", "the name of a resource in quotes");
    if presents.is_none() && fields.tried("presents") {
        // Reported already; it is not missing.
        presents = Some(Spanned { text: String::new(), span: reader.span(&head(tree)) });
    }
    let radiance = text(reader, "radiance", "the name of a resource in quotes");
    Some(Document {
        doc,
        is_stage,
        head: reader.span(&head(tree)),
        extends,
        include,
        set,
        params,
        conditions,
        resources,
        nodes,
        refuse,
        quality,
        presents,
        radiance,
        gaps,
    })
}

const TEXTURE: Shape = Shape { what: "Texture", required: &["format", "size"], optional: &["mips", "encoding", "history", "doc"] };
const BUFFER: Shape = Shape { what: "Buffer", required: &["of", "count"], optional: &["history", "doc"] };

fn read_resource(reader: &mut Reader, name: &Spanned, tree: &Tree) -> Option<Resource> {
    let kind_name = match &tree.kind {
        Kind::Record(Some(n), _) | Kind::Tuple(Some(n), _) => n.text.clone(),
        Kind::Name(n) => n.clone(),
        _ => {
            reader.expected(tree, "a resource: Texture(…) or Buffer(…)", "");
            return None;
        }
    };
    let (fields, kind) = match kind_name.as_str() {
        "Texture" => {
            let fields = reader.record(tree, &TEXTURE)?;
            let format = fields.get("format").and_then(|t| format::read(reader, t));
            let size = fields.get("size").and_then(|t| read_size(reader, t));
            let mips = match fields.get("mips") {
                Some(tree) => read_mips(reader, tree),
                None => Some(Mips::One),
            };
            let encoding = match fields.get("encoding") {
                Some(tree) => format::read_encoding(reader, tree),
                None => Some(Encoding::Plain),
            };
            if encoding == Some(Encoding::Octahedral) && format.is_some_and(|f| f != crate::value::Format::R32Uint) {
                reader.error(
                    &head(tree),
                    format!("`{}` is octahedral, which needs the format R32Uint", name.text),
                    "change the format or the encoding",
                );
            }
            (fields, ResourceKind::Texture { format: format?, size: size?, mips: mips?, encoding: encoding? })
        }
        "Buffer" => {
            let fields = reader.record(tree, &BUFFER)?;
            let of = fields.get("of").and_then(|t| read_type(reader, t));
            let count = fields.get("count").and_then(|t| expr::read(reader, t));
            (fields, ResourceKind::Buffer { of: of?, count: count? })
        }
        other => {
            reader.error(&head(tree), format!("unknown kind of resource `{other}`"), suggest(other, ["Texture", "Buffer"]));
            return None;
        }
    };
    let history = fields.get("history").and_then(|t| reader.boolean(t)).unwrap_or(false);
    let doc = fields.get("doc").and_then(|t| reader.text(t, "a sentence in quotes")).map(|d| d.text).unwrap_or_default();
    Some(Resource { kind, history, doc, span: name.span.clone() })
}

fn read_size(reader: &mut Reader, tree: &Tree) -> Option<Size> {
    const FORMS: [&str; 5] = ["Output", "OutputScaled", "Fixed", "Size", "Like"];
    match &tree.kind {
        Kind::Name(name) if name == "Output" => Some(Size::Output),
        Kind::Name(name) if !FORMS.contains(&name.as_str()) => {
            reader.error(&tree.range, format!("unknown size `{name}`"), suggest(name, FORMS));
            None
        }
        Kind::Tuple(Some(name), items) => match (name.text.as_str(), items.as_slice()) {
            ("OutputScaled", [a, b]) => {
                let (a, b) = (positive(reader, a), positive(reader, b));
                Some(Size::OutputScaled(a?, b?))
            }
            ("Fixed" | "Size", [w, h]) => {
                let (w, h) = (expr::read(reader, w), expr::read(reader, h));
                Some(Size::Exact(Box::new(w?), Box::new(h?)))
            }
            ("Like", [item]) => reader.text(item, "the name of a texture in quotes").map(Size::Like),
            (form, _) if FORMS.contains(&form) => {
                let usage = match form {
                    "Output" => "write `Output`",
                    "OutputScaled" => "write `OutputScaled(1, 2)`",
                    "Like" => "write `Like(\"texture\")`",
                    _ => "write `Size(width, height)`",
                };
                reader.error(&tree.range, format!("`{form}` is not used like this"), usage);
                None
            }
            (form, _) => {
                reader.error(&name.range, format!("unknown size `{form}`"), suggest(form, FORMS));
                None
            }
        },
        _ => {
            reader.expected(tree, "a size", "sizes are Output, OutputScaled(a, b), Fixed(w, h), Size(expr, expr) and Like(\"texture\")");
            None
        }
    }
}

fn positive(reader: &mut Reader, tree: &Tree) -> Option<u32> {
    let value = reader.int(tree, "a whole number")?;
    let value = u32::try_from(value).ok().filter(|v| *v > 0);
    if value.is_none() {
        reader.error(&tree.range, "this number must be at least 1", "");
    }
    value
}

fn read_mips(reader: &mut Reader, tree: &Tree) -> Option<Mips> {
    match &tree.kind {
        Kind::Name(name) if name == "Full" => Some(Mips::Full),
        Kind::Tuple(Some(name), items) if name.text == "Count" && items.len() == 1 => {
            expr::read(reader, &items[0]).map(|e| Mips::Count(Box::new(e)))
        }
        Kind::Number { .. } => {
            reader.expected(tree, "mip levels", "write `Count(4)` or `Full`");
            None
        }
        _ => {
            reader.expected(tree, "mip levels: Full or Count(n)", "");
            None
        }
    }
}

const REFUSAL: Shape = Shape { what: "a refusal", required: &["when", "because"], optional: &[] };

fn read_refusal(reader: &mut Reader, tree: &Tree) -> Option<Refusal> {
    if !matches!(tree.kind, Kind::Record(None, _) | Kind::Tuple(None, _)) {
        reader.expected(tree, "a refusal", "write `(when: All([…]), because: \"…\")`");
        return None;
    }
    let fields = reader.record(tree, &REFUSAL)?;
    let when = fields.get("when").and_then(|t| condition::read(reader, t));
    let because = fields.get("because").and_then(|t| reader.text(t, "a sentence in quotes"));
    Some(Refusal { when: when?, because: because?.text })
}

const NODE: Shape = Shape { what: "a node", required: &["id", "node"], optional: &["in", "out", "params", "when"] };

fn read_node(reader: &mut Reader, tree: &Tree, stage: &str) -> Option<NodeUse> {
    if !matches!(tree.kind, Kind::Record(None, _) | Kind::Tuple(None, _)) {
        reader.expected(tree, "a node", "write `(id: \"…\", node: \"stage/name\", in: {…}, out: {…})`");
        return None;
    }
    let before = reader.out.len();
    let fields = reader.record(tree, &NODE)?;
    let id = fields.get("id").and_then(|t| reader.text(t, "a name in quotes"));
    if let Some(id) = &id {
        check_identifier(reader, id, "node");
    }
    let node = fields.get("node").and_then(|t| reader.text(t, "the name of a node in quotes (`stage/name`)"));
    let mut inputs = IndexMap::new();
    if let Some(tree) = fields.get("in") {
        read_connections(reader, tree, true, &mut inputs);
    }
    let mut outputs = IndexMap::new();
    if let Some(tree) = fields.get("out") {
        read_connections(reader, tree, false, &mut outputs);
    }
    let mut params = IndexMap::new();
    if let Some(tree) = fields.get("params") {
        for (name, tree) in reader.map(tree, "parameters") {
            if let Some(ValueAt { value, span }) = read_argument(reader, tree) {
                params.insert(name.text, Argument { value, name_span: name.span, span });
            }
        }
    }
    let when = fields.get("when").and_then(|t| condition::read(reader, t));
    let broken = reader.out.len() > before;
    Some(NodeUse { id: id?, node: node?, inputs, outputs, params, when, stage: stage.to_owned(), broken })
}

fn read_argument(reader: &mut Reader, tree: &Tree) -> Option<ValueAt> {
    let value = match &tree.kind {
        Kind::Tuple(Some(form), items) => match (form.text.as_str(), items.as_slice()) {
            ("Param", [name]) => ArgumentValue::Param(reader.text(name, "the name of a parameter in quotes")?.text),
            ("If", [when, then, otherwise]) => {
                let when = condition::read(reader, when);
                let (then, otherwise) = (read_argument(reader, then), read_argument(reader, otherwise));
                ArgumentValue::If { when: Box::new(when?), then: Box::new(then?), otherwise: Box::new(otherwise?) }
            }
            ("Param" | "If", _) => {
                let usage = if form.text == "If" { "write `If(condition, value, other value)`" } else { "write `Param(\"parameter\")`" };
                reader.error(&tree.range, format!("`{}` is not used like this", form.text), usage);
                return None;
            }
            _ => ArgumentValue::Literal(read_literal(reader, tree)?),
        },
        _ => ArgumentValue::Literal(read_literal(reader, tree)?),
    };
    Some(ValueAt { value, span: reader.span(&tree.range) })
}

fn read_connections(reader: &mut Reader, tree: &Tree, input: bool, found: &mut IndexMap<String, Connection>) {
    for (port, tree) in reader.map(tree, "ports and resources") {
        let (item, previous) = match &tree.kind {
            Kind::Tuple(Some(form), items) if form.text == "Previous" && items.len() == 1 => (&items[0], true),
            Kind::Tuple(Some(form), _) | Kind::Record(Some(form), _) => {
                reader.error(&form.range, format!("unknown connection `{}`", form.text), "write \"resource\" or Previous(\"resource\")");
                continue;
            }
            _ => (tree, false),
        };
        let Some(resource) = reader.text(item, "the name of a resource in quotes") else { continue };
        if previous && !input {
            reader.error(&tree.range, "a node cannot write the last frame's value", format!("write \"{}\"", resource.text));
            continue;
        }
        found.insert(port.text, Connection { resource, previous, port_span: port.span });
    }
}

impl Preset {
    /// For messages.
    pub(crate) fn shown(&self) -> String {
        match &self.value {
            Literal::Text(text) => format!("`{text}`"),
            other => format!("`{other}`"),
        }
    }
}
