//! Loads the registry: every declaration with its shader; again, only what changed.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

use crate::{
    bind,
    compose::Composition,
    declaration::{self, Declaration},
    diagnostics::{Diagnostic, Diagnostics, Severity, Source, Span},
    library::{Library, ReadError, stem},
    reflect,
    registry::{External, HostDecl, NodeDecl, PortKind, Registry},
    shader::{Layout, Shader},
    wgsl,
};

const COMMON: &str = "shaders/common/";
/// Bytes; only what is used costs memory.
const STACK: usize = 64 << 20;

impl Registry {
    /// Reads every node: host declarations and pairs of `.ron` and `.wgsl` in the library's `shaders/`.
    /// A faulty node is left out; its faults, and all others, are in the diagnostics.
    pub fn load(library: &Library, host: &[HostDecl], externals: Vec<External>) -> (Self, Diagnostics) {
        Self::default().reload(library, host, externals)
    }

    /// Loads again. Shaders whose text and imports are the same are taken over (`Arc::ptr_eq`).
    pub fn reload(&self, library: &Library, host: &[HostDecl], externals: Vec<External>) -> (Self, Diagnostics) {
        // Parsers of WGSL recurse: with room to do so, an odd text is a fault and not the end of the program.
        let roomy = std::thread::Builder::new().name("shader registry".into()).stack_size(STACK);
        std::thread::scope(|scope| match roomy.spawn_scoped(scope, || self.load_all(library, host, externals.clone())) {
            Ok(handle) => handle.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)),
            Err(_) => self.load_all(library, host, externals.clone()),
        })
    }

    fn load_all(&self, library: &Library, host: &[HostDecl], externals: Vec<External>) -> (Self, Diagnostics) {
        let mut out = Vec::new();
        let mut commons = Vec::new();
        for path in library.list("shaders/common", "wgsl") {
            match library.fetch(&path) {
                Ok(source) => commons.push((path, source)),
                Err(error) => out.push(error.diagnostic()),
            }
        }
        for path in library.list("shaders/common", "ron") {
            out.push(
                Diagnostic::error_nowhere(format!("`{path}` declares a node in shaders/common"))
                    .help("move it and its shader to a stage's folder"),
            );
        }
        let mut loader = Loader {
            library,
            old: self,
            new: Registry::default(),
            composition: Composition::new(commons, &self.good_modules, &mut out),
            out,
        };
        for external in externals {
            loader.new.externals.insert(external.name.clone(), external);
        }
        loader.hosts(host);
        loader.shaders();
        loader.types();
        loader.new.good_modules = loader.composition.good();
        (loader.new, Diagnostics(loader.out).sorted())
    }

    /// The layout of a WGSL type: of a structure that a shader or an external declares, or of a plain type.
    pub fn layout(&self, name: &str) -> Option<Layout> {
        self.types.get(name).cloned().or_else(|| reflect::plain_layout(name))
    }
}

struct Loader<'a> {
    library: &'a Library,
    old: &'a Registry,
    new: Registry,
    composition: Composition,
    out: Vec<Diagnostic>,
}

impl Loader<'_> {
    fn hosts(&mut self, host: &[HostDecl]) {
        for HostDecl { name, ron } in host {
            let source = Arc::new(Source { name: format!("declaration of {name}"), path: None, text: Arc::from(*ron) });
            match declaration::read(&source, true, &mut self.out) {
                Some(declaration) => self.insert((*name).to_owned(), declaration, None),
                None => {
                    self.new.faulty.insert((*name).to_owned());
                }
            }
        }
    }

    fn insert(&mut self, name: String, declaration: Declaration, shader: Option<Arc<Shader>>) {
        if let Some(first) = self.new.nodes.get(&name) {
            self.out.push(
                Diagnostic::error(format!("there are two nodes `{name}`"), declaration.span)
                    .and(first.span.clone(), "the other one")
                    .help("rename one of them"),
            );
            return;
        }
        let node = declaration.into_node(&name, shader);
        self.new.nodes.insert(name, Arc::new(node));
    }

    fn shaders(&mut self) {
        let of_nodes = |paths: Vec<String>| -> BTreeSet<String> { paths.into_iter().filter(|p| !p.starts_with(COMMON)).collect() };
        let declarations = of_nodes(self.library.list("shaders", "ron"));
        let texts = of_nodes(self.library.list("shaders", "wgsl"));
        for path in &texts {
            let partner = format!("{}.ron", path.trim_end_matches(".wgsl"));
            if !declarations.contains(&partner) {
                self.orphan(path, &partner, "a shader outside of shaders/common is a node and needs a declaration");
            }
        }
        for path in &declarations {
            let partner = format!("{}.wgsl", path.trim_end_matches(".ron"));
            let name = path.trim_start_matches("shaders/").trim_end_matches(".ron").to_owned();
            if !name.contains('/') {
                let fault = Diagnostic::error_nowhere(format!("`{path}` lies in no stage's folder"));
                self.out.push(fault.help(format!("move it and its shader to shaders/STAGE/{}.ron", stem(path))));
                continue;
            }
            let good = if texts.contains(&partner) {
                self.node(&name, path, &partner)
            } else {
                self.orphan(path, &partner, "a node declared in `shaders/` needs a shader; nodes in Rust bring their own declaration");
                false
            };
            if !good {
                self.new.faulty.insert(name);
            }
        }
    }

    fn orphan(&mut self, path: &str, partner: &str, why: &str) {
        let fault = match self.fetch(path) {
            Some(source) => Diagnostic::error(format!("`{path}` has no partner `{partner}`"), Span::new(&source, 0..0)),
            None => return,
        };
        self.out.push(fault.help(format!("{why}: add `{partner}` or remove this file")));
    }

    fn fetch(&mut self, path: &str) -> Option<Arc<Source>> {
        match self.library.fetch(path) {
            Ok(source) => Some(source),
            // Gone between listing and reading: the next reload sees it.
            Err(ReadError::Missing(_)) => None,
            Err(error) => {
                self.out.push(error.diagnostic());
                None
            }
        }
    }

    fn node(&mut self, name: &str, path: &str, wgsl_path: &str) -> bool {
        let (Some(ron), Some(source)) = (self.fetch(path), self.fetch(wgsl_path)) else { return false };
        let declaration = declaration::read(&ron, false, &mut self.out);
        let Some(shader) = self.shader(name, &source, wgsl_path) else { return false };
        let Some(declaration) = declaration else { return false };
        let mut faults = Vec::new();
        bind::bind(&declaration, &shader, &wgsl::scan(&source.text), &mut faults);
        let faulty = faults.iter().any(|f| f.severity == Severity::Error);
        self.out.append(&mut faults);
        if !faulty {
            self.insert(name.to_owned(), declaration, Some(shader));
        }
        !faulty
    }

    fn shader(&mut self, name: &str, source: &Arc<Source>, path: &str) -> Option<Arc<Shader>> {
        let resolved = self.composition.resolve(source, &mut self.out);
        if resolved.faulty {
            return None;
        }
        let shader = match self.old.shaders.get(name) {
            Some(old) if old.hash == resolved.hash && old.source.name == source.name => Arc::clone(old),
            _ => {
                let (module, info) = match self.composition.compose(source, path, &resolved.imports) {
                    Ok(composed) => composed,
                    Err(faults) => {
                        self.out.extend(faults);
                        return None;
                    }
                };
                let found = reflect::reflect(&module, &info, &self.composition.places(source, &resolved.scan));
                if !found.faults.is_empty() {
                    let fault = |(name, span, reason): (String, Span, String)| {
                        Diagnostic::error(format!("`{name}` cannot be used in a node"), span).help(reason)
                    };
                    self.out.extend(found.faults.into_iter().map(fault));
                    return None;
                }
                Arc::new(Shader {
                    source: Arc::clone(source),
                    module,
                    globals: found.globals,
                    entries: found.entries,
                    overrides: found.overrides,
                    layouts: found.layouts,
                    imports: resolved.imports.iter().map(|i| self.composition.modules[i].path.clone()).collect(),
                    hash: resolved.hash,
                })
            }
        };
        self.new.shaders.insert(name.to_owned(), Arc::clone(&shader));
        Some(shader)
    }

    /// Collects the structures that ports share; one name must mean one layout.
    fn types(&mut self) {
        let mut types: BTreeMap<String, (Layout, String, Option<Span>)> = BTreeMap::new();
        for external in self.new.externals.values() {
            if let (Some(layout), PortKind::Buffer { of } | PortKind::Uniform { of }) = (&external.layout, &external.kind) {
                types.entry(of.clone()).or_insert_with(|| (layout.clone(), format!("the external `{}`", external.name), None));
            }
        }
        let mut bad = BTreeSet::new();
        for (name, node) in &self.new.nodes {
            let Some(shader) = &node.shader else { continue };
            let ported: BTreeSet<&String> = node
                .ports
                .values()
                .filter_map(|p| match &p.kind {
                    PortKind::Buffer { of } | PortKind::Uniform { of } => Some(of),
                    PortKind::Texture { .. } => None,
                })
                .collect();
            for (ty, layout) in &shader.layouts {
                if !ported.contains(ty) {
                    continue;
                }
                let place = struct_place(&self.composition, node, ty);
                match types.get(ty) {
                    None => {
                        types.insert(ty.clone(), (layout.clone(), format!("the node `{name}`"), Some(place)));
                    }
                    Some((known, owner, other)) => {
                        if let Some(difference) = difference(known, layout) {
                            let mut fault = Diagnostic::error(format!("`{ty}` differs from that of {owner}: {difference}"), place);
                            if let Some(other) = other {
                                fault = fault.and(other.clone(), format!("as {owner} has it"));
                            }
                            self.out.push(fault.help("write the structure once, in shaders/common, and import it"));
                            bad.insert(name.clone());
                        }
                    }
                }
            }
        }
        self.out.dedup();
        for name in bad {
            self.new.nodes.remove(&name);
            self.new.faulty.insert(name);
        }
        self.new.types = types.into_iter().map(|(name, (layout, ..))| (name, layout)).collect();
    }
}

/// Where the structure is written: in the shader or in an import.
fn struct_place(composition: &Composition, node: &NodeDecl, ty: &str) -> Span {
    let Some(shader) = &node.shader else { return node.span.clone() };
    let imported = composition.modules.values().filter(|m| shader.imports.contains(&m.path)).map(|m| &m.source);
    for source in std::iter::once(&shader.source).chain(imported) {
        if let Some(item) = wgsl::scan(&source.text).item("struct", ty) {
            return Span::new(source, item.range.clone());
        }
    }
    node.span.clone()
}

/// The first difference of two layouts, in words.
fn difference(expected: &Layout, found: &Layout) -> Option<String> {
    for (index, wanted) in expected.members.iter().enumerate() {
        match found.members.get(index) {
            None => return Some(format!("it lacks the member `{}`", wanted.name)),
            Some(member) if member.name != wanted.name => {
                return Some(format!("member {index} is `{}` instead of `{}`", member.name, wanted.name));
            }
            Some(member) if member.offset != wanted.offset => {
                return Some(format!("`{}` is at byte {} instead of {}", member.name, member.offset, wanted.offset));
            }
            Some(member) if member.kind != wanted.kind => return Some(format!("`{}` has another type", member.name)),
            Some(_) => {}
        }
    }
    if let Some(extra) = found.members.get(expected.members.len()) {
        return Some(format!("it has the member `{}` in addition", extra.name));
    }
    (expected.size != found.size).then(|| format!("it has {} bytes instead of {}", found.size, expected.size))
}
