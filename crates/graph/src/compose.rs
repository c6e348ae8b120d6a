//! Composes WGSL files with their imports into one naga module, with faults pointing into the file they are in.

use std::{
    collections::{BTreeMap, BTreeSet},
    hash::{DefaultHasher, Hash, Hasher},
    ops::Range,
    panic::{AssertUnwindSafe, catch_unwind},
    sync::Arc,
};

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor};

use crate::{
    bind::PARAMS,
    diagnostics::{Diagnostic, Source, Span},
    reflect::{Places, demangle},
    render::{and_also, suggest},
    wgsl::{self, Scan},
};

mod explain;

use explain::chain;

/// naga_oil keeps the module number above this bit of a span.
const SPAN_SHIFT: usize = 21;
/// The bind group of what imported files declare. Nodes that import such a file leave it to them.
pub(crate) const IMPORTED_GROUP: u32 = 1;

/// A file of `shaders/common/`.
#[derive(Debug)]
pub(crate) struct Module {
    pub source: Arc<Source>,
    /// Path in the library.
    pub path: String,
    scan: Scan,
    /// Modules that it imports, directly or not, by name.
    imports: BTreeSet<String>,
    /// It, or something that it imports, has faults, which are reported.
    faulty: bool,
    /// Hash of its text and its imports.
    hash: u64,
}

/// All modules of `shaders/common/`, and the composer that knows them.
pub(crate) struct Composition {
    pub modules: BTreeMap<String, Module>,
    composer: Option<Composer>,
    /// Names in the order in which naga_oil needs them.
    order: Vec<String>,
}

/// A text with its imports resolved.
pub(crate) struct Resolved {
    pub scan: Scan,
    pub imports: BTreeSet<String>,
    pub hash: u64,
    /// It imports something faulty: nothing is to be said about it.
    pub faulty: bool,
}

/// What a text imports by itself.
struct Direct {
    modules: BTreeSet<String>,
    /// Items that a module does not have: the module and the fault.
    lacking: Vec<(String, Diagnostic)>,
}

impl Composition {
    /// Takes in all modules and checks each by itself, save those whose hash is in `known_good`.
    pub fn new(sources: Vec<(String, Arc<Source>)>, known_good: &BTreeSet<u64>, out: &mut Vec<Diagnostic>) -> Self {
        let mut modules = BTreeMap::new();
        for (path, source) in sources {
            let name = path.trim_start_matches("shaders/").trim_end_matches(".wgsl").replace('/', "::");
            let scan = wgsl::scan(&source.text);
            modules.insert(name, Module { source, path, scan, imports: BTreeSet::new(), faulty: false, hash: 0 });
        }
        let mut this = Self { modules, composer: None, order: Vec::new() };
        let mut direct = BTreeMap::new();
        let mut lacking = Vec::new();
        for name in this.modules.keys().cloned().collect::<Vec<_>>() {
            let module = &this.modules[&name];
            let before = out.len();
            check_common(module, out);
            let Direct { modules: found, lacking: lacks } = this.direct_imports(&module.source, &module.scan, out);
            let faulty = out.len() > before || !lacks.is_empty();
            direct.insert(name.clone(), found);
            lacking.extend(lacks);
            if let Some(module) = this.modules.get_mut(&name) {
                module.faulty = faulty;
            }
        }
        this.sort(&direct, out);
        this.settle(&direct);
        for name in this.order.clone() {
            let module = &this.modules[&name];
            if module.faulty || known_good.contains(&module.hash) {
                continue;
            }
            let (source, path) = (Arc::clone(&module.source), module.path.clone());
            if let Err(faults) = this.compose(&source, &path, &module_needs(&this.modules[&name])) {
                out.extend(faults);
                this.mark_faulty(&name);
            }
        }
        out.extend(this.own(lacking));
        this
    }

    /// Missing items, save those of modules that have faults: an item that cannot be read is not missing.
    fn own(&self, lacking: Vec<(String, Diagnostic)>) -> impl Iterator<Item = Diagnostic> + use<'_> {
        lacking.into_iter().filter(|(module, _)| !self.modules[module].faulty).map(|(_, fault)| fault)
    }

    /// Hashes of the modules without faults.
    pub fn good(&self) -> BTreeSet<u64> {
        self.modules.values().filter(|m| !m.faulty).map(|m| m.hash).collect()
    }

    /// Resolves the imports of a text that is not a module itself.
    pub fn resolve(&self, source: &Arc<Source>, out: &mut Vec<Diagnostic>) -> Resolved {
        let scan = wgsl::scan(&source.text);
        let before = out.len();
        let Direct { modules: direct, lacking } = self.direct_imports(source, &scan, out);
        out.extend(self.own(lacking));
        let mut imports = direct.clone();
        for name in &direct {
            imports.extend(self.modules[name].imports.iter().cloned());
        }
        let faulty = out.len() > before || imports.iter().any(|name| self.modules[name].faulty);
        let hash = self.hash(&source.text, &imports);
        Resolved { scan, imports, hash, faulty }
    }

    /// The module that a path names or lies in, and the item in it.
    fn module_of<'a>(&self, path: &'a str) -> Option<(String, Option<&'a str>)> {
        if self.modules.contains_key(path) {
            return Some((path.to_owned(), None));
        }
        let (module, item) = path.rsplit_once("::")?;
        self.modules.contains_key(module).then(|| (module.to_owned(), Some(item)))
    }

    fn direct_imports(&self, source: &Arc<Source>, scan: &Scan, out: &mut Vec<Diagnostic>) -> Direct {
        let mut found = BTreeSet::new();
        let mut lacking = Vec::new();
        let mut named: BTreeSet<&str> = BTreeSet::new();
        if let Some((range, what)) = wgsl::too_deep(&source.text) {
            let fault = Diagnostic::error(format!("{what} are nested too deeply"), Span::new(source, range));
            out.push(fault.help("name parts of it with `let`, or move them to functions"));
        }
        if let Some(range) = &scan.unclosed {
            out.push(Diagnostic::error("the import's `{` is never closed", Span::new(source, range.clone())).help("add the missing `}`"));
        }
        for path in &scan.paths {
            if !path.import {
                continue;
            }
            let span = Span::new(source, path.range.clone());
            match self.module_of(&path.text) {
                Some((module, None)) => {
                    found.insert(module);
                }
                Some((module, Some(item))) => {
                    let items = &self.modules[&module].scan.items;
                    if !items.iter().any(|i| i.name == item) {
                        let known = items.iter().map(|i| i.name.as_str());
                        let fault = Diagnostic::error(format!("`{module}` has no item `{item}`"), span).help(suggest(item, known));
                        lacking.push((module.clone(), fault));
                    }
                    found.insert(module);
                }
                None => {
                    let module = path.text.rsplit_once("::").map_or(path.text.as_str(), |(module, _)| module);
                    if named.insert(module) {
                        let help = suggest(module, self.modules.keys().map(String::as_str));
                        out.push(
                            Diagnostic::error(format!("there is no module `{module}`"), span)
                                .help(and_also(help, "A file `shaders/common/x.wgsl` is the module `common::x`")),
                        );
                    }
                }
            }
        }
        // Paths in code may name a module without an import line.
        for path in scan.paths.iter().filter(|p| !p.import) {
            found.extend(self.module_of(&path.text).map(|(module, _)| module));
        }
        Direct { modules: found, lacking }
    }

    /// Orders the modules; those in or behind a cycle are faulty and left out.
    fn sort(&mut self, direct: &BTreeMap<String, BTreeSet<String>>, out: &mut Vec<Diagnostic>) {
        let mut done: BTreeSet<&String> = BTreeSet::new();
        loop {
            let ready: Vec<&String> = direct
                .iter()
                .filter(|(name, needs)| !done.contains(name) && needs.iter().all(|n| done.contains(n)))
                .map(|(n, _)| n)
                .collect();
            if ready.is_empty() {
                break;
            }
            self.order.extend(ready.iter().map(|n| (*n).clone()));
            done.extend(ready);
        }
        let left: BTreeSet<&String> = direct.keys().filter(|name| !done.contains(name)).collect();
        let Some(mut at) = left.first().copied() else { return };
        // Every module that is left needs one that is left: walking on must meet a module twice.
        let mut walk = Vec::new();
        while !walk.contains(&at) {
            walk.push(at);
            match direct[at].iter().find(|n| left.contains(n)) {
                Some(next) => at = next,
                None => break,
            }
        }
        let start = walk.iter().position(|n| *n == at).unwrap_or(0);
        let cycle = &walk[start..];
        let shown: Vec<&str> = cycle.iter().map(|n| n.as_str()).chain(cycle.first().map(|n| n.as_str())).collect();
        let place = |from: &str, to: &str| {
            let module = &self.modules[from];
            let range =
                module.scan.paths.iter().find(|p| p.text == to || p.text.starts_with(&format!("{to}::"))).map_or(0..0, |p| p.range.clone());
            Span::new(&module.source, range)
        };
        if let [first, second, ..] = shown.as_slice() {
            let mut fault =
                Diagnostic::error(format!("modules import each other in a circle: {}", shown.join(" → ")), place(first, second));
            for pair in shown.windows(2).skip(1) {
                fault = fault.and(place(pair[0], pair[1]), format!("`{}` imports `{}`", pair[0], pair[1]));
            }
            out.push(fault.help("move what they share into a module of its own"));
        }
        let left: Vec<String> = left.into_iter().cloned().collect();
        for name in left {
            if let Some(module) = self.modules.get_mut(&name) {
                module.faulty = true;
            }
        }
    }

    /// Computes transitive imports and hashes in order, and passes faults on to importers.
    fn settle(&mut self, direct: &BTreeMap<String, BTreeSet<String>>) {
        for name in self.order.clone() {
            let mut imports = direct[&name].clone();
            for import in &direct[&name] {
                imports.extend(self.modules[import].imports.iter().cloned());
            }
            let faulty = imports.iter().any(|i| self.modules[i].faulty);
            let hash = self.hash(&self.modules[&name].source.text, &imports);
            if let Some(module) = self.modules.get_mut(&name) {
                module.faulty |= faulty;
                module.imports = imports;
                module.hash = hash;
            }
        }
    }

    fn mark_faulty(&mut self, name: &str) {
        for (other, module) in &mut self.modules {
            module.faulty |= other == name || module.imports.contains(name);
        }
    }

    fn hash(&self, text: &str, imports: &BTreeSet<String>) -> u64 {
        let mut hasher = DefaultHasher::new();
        text.hash(&mut hasher);
        for import in imports {
            import.hash(&mut hasher);
            self.modules[import].source.text.hash(&mut hasher);
        }
        hasher.finish()
    }

    /// Where the items of a text and of its imports are declared.
    pub fn places<'a>(&'a self, source: &'a Arc<Source>, scan: &'a Scan) -> impl Places + 'a {
        PlacesOf { composition: self, source, scan }
    }

    /// Composes a text; its imports must be without faults.
    pub fn compose(
        &mut self,
        source: &Arc<Source>,
        path: &str,
        imports: &BTreeSet<String>,
    ) -> Result<(naga::Module, ModuleInfo), Vec<Diagnostic>> {
        let mut composer = self.composer.take().unwrap_or_else(|| Composer::default().with_capabilities(Capabilities::all()));
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            for name in self.order.iter().filter(|name| imports.contains(*name)) {
                if composer.contains_module(name) {
                    continue;
                }
                let module = &self.modules[name];
                let description = ComposableModuleDescriptor {
                    source: &module.source.text,
                    file_path: &module.path,
                    as_name: Some(name.clone()),
                    ..Default::default()
                };
                if let Err(error) = composer.add_composable_module(description) {
                    return Err(self.explain(&composer, source, path, &error));
                }
            }
            let description = NagaModuleDescriptor { source: &source.text, file_path: path, ..Default::default() };
            composer.make_naga_module(description).map_err(|error| self.explain(&composer, source, path, &error))
        }));
        let Ok(outcome) = outcome else {
            let fault = Diagnostic::error("the shader cannot be composed", Span::new(source, 0..0))
                .help("its imports or preprocessor lines have a form that the composer does not understand");
            return Err(vec![fault]);
        };
        self.composer = Some(composer);
        let mut module = outcome.map_err(|fault| vec![fault])?;
        number_imported(&mut module);
        match Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module) {
            Ok(info) => Ok((module, info)),
            Err(error) => {
                let message = format!("the shader is not valid: {}", self.undecorate(&chain(&error)));
                Err(vec![Diagnostic::error(message, Span::new(source, 0..0))])
            }
        }
    }
}

/// Numbers the bindings of imported globals by their names. The composer counts on over all that it has composed, so that its numbers depend on what that was;
/// but equal text with equal imports must be an equal module.
fn number_imported(module: &mut naga::Module) {
    let imported =
        |variable: &naga::GlobalVariable| variable.name.clone().filter(|name| demangle(name) != name && variable.binding.is_some());
    let names: BTreeSet<String> = module.global_variables.iter().filter_map(|(_, variable)| imported(variable)).collect();
    for (_, variable) in module.global_variables.iter_mut() {
        if let Some(number) = imported(variable).and_then(|name| names.iter().position(|other| *other == name))
            && let Some(binding) = &mut variable.binding
        {
            binding.binding = number as u32;
        }
    }
}

struct PlacesOf<'a> {
    composition: &'a Composition,
    source: &'a Arc<Source>,
    scan: &'a Scan,
}

impl Places for PlacesOf<'_> {
    fn module(&self, decorated: &str) -> Option<&str> {
        let mut names = self.composition.modules.keys();
        names.find(|name| decorated.ends_with(&Composer::decorated_name(Some(name), ""))).map(String::as_str)
    }

    fn item(&self, module: Option<&str>, keyword: &str, name: &str) -> Span {
        let (source, scan) = match module.and_then(|name| self.composition.modules.get(name)) {
            Some(module) => (&module.source, &module.scan),
            None => (self.source, self.scan),
        };
        Span::new(source, scan.item(keyword, name).map_or(0..0, |item| item.range.clone()))
    }
}

fn module_needs(module: &Module) -> BTreeSet<String> {
    module.imports.clone()
}

/// What a file of `shaders/common/` must not have.
fn check_common(module: &Module, out: &mut Vec<Diagnostic>) {
    let fault =
        |range: &Range<usize>, message: String, help: &str| Diagnostic::error(message, Span::new(&module.source, range.clone())).help(help);
    for (name, range) in &module.scan.attributes {
        match name.as_str() {
            "compute" | "vertex" | "fragment" => {
                out.push(fault(range, "a file of shaders/common has no entry points".into(), "move it to a node's shader"));
            }
            // Numbers that the composer gives out cannot collide, whichever files a node imports.
            "group" | "binding" => {
                let wanted = if name == "group" { format!("({IMPORTED_GROUP})") } else { "(auto)".to_owned() };
                if !module.source.text[range.end..].starts_with(&wanted) {
                    let message = "a file of shaders/common does not number its globals".to_owned();
                    out.push(fault(range, message, &format!("write `@group({IMPORTED_GROUP}) @binding(auto)`")));
                }
            }
            _ => {}
        }
    }
    for (name, range) in &module.scan.directives {
        if name == "define_import_path" {
            out.push(fault(range, "`#define_import_path` is not used here".into(), "remove it: the file's path is its import path"));
        }
    }
    if let Some(item) = module.scan.item("var", PARAMS) {
        let message = format!("`{PARAMS}` are a node's own, and a file of shaders/common has none");
        out.push(fault(&item.range, message, "pass the value to the function as an argument"));
    }
    for item in module.scan.items.iter().filter(|i| i.keyword == "override") {
        out.push(fault(
            &item.range,
            format!("a file of shaders/common has no overrides, and `{}` is one", item.name),
            "pass the value to the function as an argument",
        ));
    }
}
