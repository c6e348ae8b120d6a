//! What naga knows of a composed module: globals, entry points, overrides, layouts.

use std::collections::BTreeMap;

use naga::{
    AddressSpace, ArraySize, Handle, ImageClass, ImageDimension, Module, ScalarKind, ShaderStage, StorageAccess, StorageFormat, Type,
    TypeInner,
    valid::{GlobalUse, ModuleInfo},
};

use crate::{
    diagnostics::Span,
    shader::{Access, Entry, Global, GlobalKind, Layout, Member, MemberKind, SampleKind, Scalar, Stage},
    value::Format,
};

/// The mark that naga_oil puts between a name and its encoded module.
const DECORATION: &str = "X_naga_oil_mod_X";
/// A sampler that does not filter.
pub(crate) const NEAREST_SAMPLER: &str = "nearest_sampler";

/// What was found, and what a node cannot have: name of the global or entry point, its place and the reason.
pub(crate) struct Reflection {
    pub globals: Vec<Global>,
    pub entries: Vec<Entry>,
    pub overrides: Vec<(String, Scalar)>,
    pub layouts: BTreeMap<String, Layout>,
    pub faults: Vec<(String, Span, String)>,
}

/// The name in the source of an item that may come from another file.
pub(crate) fn demangle(name: &str) -> &str {
    name.split(DECORATION).next().unwrap_or(name)
}

/// The short spelling of a WGSL type name: `vec4f` for `vec4<f32>`.
pub(crate) fn canonical_type(name: &str) -> String {
    let compact: String = name.chars().filter(|c| !c.is_whitespace()).collect();
    for (long, short) in [("<f32>", "f"), ("<u32>", "u"), ("<i32>", "i")] {
        if let Some(base) = compact.strip_suffix(long)
            && (base.starts_with("vec") || base.starts_with("mat"))
        {
            return format!("{base}{short}");
        }
    }
    compact
}

/// Where a shader and the modules that it imports declare their items.
pub(crate) trait Places {
    /// The module that an item comes from by its name in the composed module; `None`: the shader itself.
    fn module(&self, decorated: &str) -> Option<&str>;
    /// The place of a declaration (`var`, `fn`) in a module or in the shader itself.
    fn item(&self, module: Option<&str>, keyword: &str, name: &str) -> Span;
}

/// Reads a validated module. Imported globals that no entry point reaches are left out: their module is used for something else.
pub(crate) fn reflect(module: &Module, info: &ModuleInfo, places: &dyn Places) -> Reflection {
    let mut out =
        Reflection { globals: Vec::new(), entries: Vec::new(), overrides: Vec::new(), layouts: BTreeMap::new(), faults: Vec::new() };
    let mut index_of = BTreeMap::new();
    for (handle, variable) in module.global_variables.iter() {
        let Some(binding) = variable.binding else { continue };
        let decorated = variable.name.as_deref().unwrap_or("");
        let name = demangle(decorated).to_owned();
        let home = places.module(decorated).map(str::to_owned);
        let reached = (0..module.entry_points.len()).any(|entry| !info.get_entry_point(entry)[handle].is_empty());
        if home.is_some() && !reached {
            continue;
        }
        let span = places.item(home.as_deref(), "var", &name);
        match global_kind(module, variable.space, variable.ty) {
            Ok(kind) => {
                add_layouts(module, variable.ty, &mut out.layouts);
                index_of.insert(handle.index(), out.globals.len());
                out.globals.push(Global { name, group: binding.group, binding: binding.binding, kind, module: home, span });
            }
            Err(reason) => out.faults.push((name, span, reason)),
        }
    }
    for (index, entry) in module.entry_points.iter().enumerate() {
        let uses_info = info.get_entry_point(index);
        let mut fault = |reason: &str| out.faults.push((entry.name.clone(), places.item(None, "fn", &entry.name), reason.to_owned()));
        let mut uses = Vec::new();
        for (handle, _) in module.global_variables.iter() {
            let used = uses_info[handle];
            if let (Some(&global), false) = (index_of.get(&handle.index()), used.is_empty()) {
                uses.push((global, access_of(used, &out.globals[global].kind)));
            }
        }
        for key in &uses_info.sampling_set {
            let sampler = index_of.get(&key.sampler.index()).map(|s| out.globals[*s].name.as_str());
            if sampler != Some(NEAREST_SAMPLER)
                && let Some(&image) = index_of.get(&key.image.index())
                && let GlobalKind::Texture { filtered, .. } = &mut out.globals[image].kind
            {
                *filtered = true;
            }
        }
        let stage = match entry.stage {
            ShaderStage::Vertex => Stage::Vertex,
            ShaderStage::Fragment => Stage::Fragment,
            ShaderStage::Compute => Stage::Compute,
            _ => {
                fault("only compute, vertex and fragment entry points can be steps");
                continue;
            }
        };
        if stage == Stage::Vertex && has_attributes(module, entry) {
            fault("there are no vertex attributes: read vertices from a buffer by `@builtin(vertex_index)`");
        }
        let workgroup_size = if stage == Stage::Compute { entry.workgroup_size } else { [1; 3] };
        if entry.workgroup_size_overrides.is_some_and(|o| o.iter().any(Option::is_some)) {
            fault("the workgroup size is an override; write numbers or a `const`");
        }
        let color_targets = if stage == Stage::Fragment { targets(module, entry).len() as u32 } else { 0 };
        let bytes_in = |space: AddressSpace| -> u64 {
            let used = module.global_variables.iter().filter(|(handle, v)| v.space == space && !uses_info[*handle].is_empty());
            used.map(|(_, variable)| bytes(module, variable.ty)).sum()
        };
        let own = bytes_in(AddressSpace::Private) + local_bytes(module, &entry.function);
        if own > MOST_OWN_BYTES {
            fault(&too_much_of_its_own(own));
        }
        let workgroup_bytes = bytes_in(AddressSpace::WorkGroup);
        out.entries.push(Entry { name: entry.name.clone(), stage, workgroup_size, uses, color_targets, workgroup_bytes });
    }
    for (_, function) in module.functions.iter() {
        let own = local_bytes(module, function);
        if own > MOST_OWN_BYTES {
            let decorated = function.name.as_deref().unwrap_or("");
            let name = demangle(decorated).to_owned();
            let span = places.item(places.module(decorated), "fn", &name);
            out.faults.push((name, span, too_much_of_its_own(own)));
        }
    }
    for (_, constant) in module.overrides.iter() {
        if let (Some(name), Some(scalar)) = (&constant.name, scalar_of(&module.types[constant.ty].inner)) {
            out.overrides.push((demangle(name).to_owned(), scalar));
        }
    }
    out
}

/// More memory of its own than this no invocation can have: WebGPU promises 8 KiB, and drivers crash when they run out of it.
const MOST_OWN_BYTES: u64 = 64 << 10;

fn too_much_of_its_own(bytes: u64) -> String {
    format!("its variables take {bytes} bytes in each invocation, more than {MOST_OWN_BYTES}: put them into a buffer")
}

fn bytes(module: &Module, ty: Handle<Type>) -> u64 {
    module.types[ty].inner.size(module.to_ctx()).into()
}

/// Bytes of the variables of a function.
fn local_bytes(module: &Module, function: &naga::Function) -> u64 {
    function.local_variables.iter().map(|(_, variable)| bytes(module, variable.ty)).sum()
}

/// Whether a vertex entry point takes `@location` inputs.
fn has_attributes(module: &Module, entry: &naga::EntryPoint) -> bool {
    let located = |binding: &Option<naga::Binding>| matches!(binding, Some(naga::Binding::Location { .. }));
    entry.function.arguments.iter().any(|argument| match &module.types[argument.ty].inner {
        TypeInner::Struct { members, .. } => members.iter().any(|m| located(&m.binding)),
        _ => located(&argument.binding),
    })
}

/// The `@location` outputs of a fragment entry point, in order: what kind of number each writes.
pub(crate) fn targets(module: &Module, entry: &naga::EntryPoint) -> Vec<SampleKind> {
    let Some(result) = &entry.function.result else { return Vec::new() };
    let kind = |ty: Handle<Type>| match module.types[ty].inner.scalar_kind() {
        Some(ScalarKind::Uint) => SampleKind::Uint,
        Some(ScalarKind::Sint) => SampleKind::Sint,
        _ => SampleKind::Float,
    };
    let mut found = Vec::new();
    match (&result.binding, &module.types[result.ty].inner) {
        (Some(naga::Binding::Location { location, .. }), _) => found.push((*location, kind(result.ty))),
        (None, TypeInner::Struct { members, .. }) => {
            for member in members {
                if let Some(naga::Binding::Location { location, .. }) = member.binding {
                    found.push((location, kind(member.ty)));
                }
            }
        }
        _ => {}
    }
    found.sort_by_key(|(location, _)| *location);
    found.into_iter().map(|(_, kind)| kind).collect()
}

fn access_of(used: GlobalUse, kind: &GlobalKind) -> Access {
    // Asking for the size of a storage texture or buffer is no read of its contents.
    let query_reads = !matches!(kind, GlobalKind::Storage { .. } | GlobalKind::StorageTexture { .. });
    Access {
        read: used.intersects(GlobalUse::READ | GlobalUse::ATOMIC) || (query_reads && used.contains(GlobalUse::QUERY)),
        write: used.intersects(GlobalUse::WRITE | GlobalUse::ATOMIC),
    }
}

fn access(access: StorageAccess) -> Access {
    Access { read: access.contains(StorageAccess::LOAD), write: access.intersects(StorageAccess::STORE | StorageAccess::ATOMIC) }
}

fn global_kind(module: &Module, space: AddressSpace, ty: Handle<Type>) -> Result<GlobalKind, String> {
    let inner = &module.types[ty].inner;
    match (space, inner) {
        (AddressSpace::Uniform, _) => {
            let size = inner.size(module.to_ctx());
            Ok(GlobalKind::Uniform { element: type_name(module, ty), size })
        }
        (AddressSpace::Storage { access: declared }, TypeInner::Array { base, size: ArraySize::Dynamic, stride }) => {
            Ok(GlobalKind::Storage { element: type_name(module, *base), stride: *stride, access: access(declared) })
        }
        (AddressSpace::Storage { .. }, _) => {
            Err(format!("a storage buffer is an array without length: write `array<{}>`", type_name(module, ty)))
        }
        (AddressSpace::Handle, TypeInner::Sampler { comparison: false }) => Ok(GlobalKind::Sampler),
        (AddressSpace::Handle, TypeInner::Sampler { comparison: true }) => {
            Err("comparison samplers are not provided: compare in the shader".into())
        }
        (AddressSpace::Handle, TypeInner::Image { dim: ImageDimension::D2, arrayed, class }) => image_kind(*arrayed, class),
        (AddressSpace::Handle, TypeInner::Image { .. }) => Err("only 2D textures and arrays of them are supported".into()),
        _ => Err("this kind of variable cannot be bound".into()),
    }
}

fn image_kind(array: bool, class: &ImageClass) -> Result<GlobalKind, String> {
    match class {
        ImageClass::Sampled { multi: true, .. } | ImageClass::Depth { multi: true } => {
            Err("multisampled textures are not supported".into())
        }
        ImageClass::Sampled { kind, .. } => {
            let sample = match kind {
                ScalarKind::Uint => SampleKind::Uint,
                ScalarKind::Sint => SampleKind::Sint,
                _ => SampleKind::Float,
            };
            Ok(GlobalKind::Texture { sample, array, filtered: false })
        }
        ImageClass::Depth { .. } => Ok(GlobalKind::Texture { sample: SampleKind::Depth, array, filtered: false }),
        ImageClass::Storage { format, access: declared } => {
            let format = storage_format(*format).ok_or_else(|| {
                "this storage format is not supported; use one of r8unorm, rgba8unorm, r16float, rg16float, rgba16float, r32float, \
                 rg32float, rgba32float, r32uint, rg32uint, rgba32uint"
                    .to_owned()
            })?;
            Ok(GlobalKind::StorageTexture { format, array, access: access(*declared) })
        }
        ImageClass::External => Err("external textures are not supported".into()),
    }
}

fn storage_format(format: StorageFormat) -> Option<Format> {
    Some(match format {
        StorageFormat::R8Unorm => Format::R8Unorm,
        StorageFormat::Rgba8Unorm => Format::Rgba8Unorm,
        StorageFormat::R16Float => Format::R16Float,
        StorageFormat::Rg16Float => Format::Rg16Float,
        StorageFormat::Rgba16Float => Format::Rgba16Float,
        StorageFormat::R32Float => Format::R32Float,
        StorageFormat::Rg32Float => Format::Rg32Float,
        StorageFormat::Rgba32Float => Format::Rgba32Float,
        StorageFormat::R32Uint => Format::R32Uint,
        StorageFormat::Rg32Uint => Format::Rg32Uint,
        StorageFormat::Rgba32Uint => Format::Rgba32Uint,
        _ => return None,
    })
}

fn scalar(scalar: naga::Scalar) -> Option<Scalar> {
    match (scalar.kind, scalar.width) {
        (ScalarKind::Float, 4) => Some(Scalar::F32),
        (ScalarKind::Uint, 4) => Some(Scalar::U32),
        (ScalarKind::Sint, 4) => Some(Scalar::I32),
        (ScalarKind::Bool, _) => Some(Scalar::Bool),
        _ => None,
    }
}

fn scalar_of(inner: &TypeInner) -> Option<Scalar> {
    match inner {
        TypeInner::Scalar(s) => scalar(*s),
        _ => None,
    }
}

/// The name of a type as a declaration writes it.
pub(crate) fn type_name(module: &Module, ty: Handle<Type>) -> String {
    let ty = &module.types[ty];
    if let (Some(name), TypeInner::Struct { .. }) = (&ty.name, &ty.inner) {
        return demangle(name).to_owned();
    }
    let letter = |s: naga::Scalar| match scalar(s) {
        Some(Scalar::F32) => "f",
        Some(Scalar::U32) => "u",
        Some(Scalar::I32) => "i",
        _ => "<bool>",
    };
    match &ty.inner {
        TypeInner::Scalar(s) | TypeInner::Atomic(s) => match scalar(*s) {
            Some(Scalar::F32) => "f32",
            Some(Scalar::U32) => "u32",
            Some(Scalar::I32) => "i32",
            Some(Scalar::Bool) => "bool",
            None => "?",
        }
        .to_owned(),
        TypeInner::Vector { size, scalar } => format!("vec{}{}", *size as u32, letter(*scalar)),
        TypeInner::Matrix { columns, rows, scalar } => format!("mat{}x{}{}", *columns as u32, *rows as u32, letter(*scalar)),
        TypeInner::Array { base, size: ArraySize::Constant(n), .. } => format!("array<{},{n}>", type_name(module, *base)),
        TypeInner::Array { base, .. } => format!("array<{}>", type_name(module, *base)),
        _ => "?".to_owned(),
    }
}

fn add_layouts(module: &Module, ty: Handle<Type>, layouts: &mut BTreeMap<String, Layout>) {
    match &module.types[ty].inner {
        TypeInner::Array { base, size, .. } => {
            add_layouts(module, *base, layouts);
            if let ArraySize::Constant(_) = size {
                add_plain(module, ty, layouts);
            }
        }
        TypeInner::Struct { members, span } => {
            let name = type_name(module, ty);
            if layouts.contains_key(&name) {
                return;
            }
            let list = members
                .iter()
                .filter_map(|m| {
                    let kind = member_kind(module, m.ty)?;
                    Some(Member { name: m.name.clone().unwrap_or_default(), offset: m.offset, kind })
                })
                .collect();
            layouts.insert(name, Layout { size: *span, members: list });
            for member in members {
                if matches!(module.types[member.ty].inner, TypeInner::Struct { .. } | TypeInner::Array { .. }) {
                    add_layouts(module, member.ty, layouts);
                }
            }
        }
        TypeInner::Image { .. } | TypeInner::Sampler { .. } => {}
        _ => add_plain(module, ty, layouts),
    }
}

fn add_plain(module: &Module, ty: Handle<Type>, layouts: &mut BTreeMap<String, Layout>) {
    if let Some(kind) = member_kind(module, ty) {
        let size = module.types[ty].inner.size(module.to_ctx());
        // A three-component vector takes the room of four in an array.
        let size = if matches!(kind, MemberKind::Numeric { rows: 3, columns: 1, .. }) { size.next_multiple_of(16) } else { size };
        layouts.insert(type_name(module, ty), Layout { size, members: vec![Member { name: String::new(), offset: 0, kind }] });
    }
}

fn member_kind(module: &Module, ty: Handle<Type>) -> Option<MemberKind> {
    let numeric = |s: naga::Scalar, rows: u32, columns: u32| {
        let column_stride = match (columns, rows) {
            (1, _) => 0,
            (_, 3) => 16,
            _ => rows * 4,
        };
        Some(MemberKind::Numeric { scalar: scalar(s)?, rows, columns, column_stride })
    };
    match &module.types[ty].inner {
        TypeInner::Scalar(s) | TypeInner::Atomic(s) => numeric(*s, 1, 1),
        TypeInner::Vector { size, scalar } => numeric(*scalar, *size as u32, 1),
        TypeInner::Matrix { columns, rows, scalar } => numeric(*scalar, *rows as u32, *columns as u32),
        TypeInner::Array { base, size: ArraySize::Constant(n), stride } => {
            Some(MemberKind::Array { of: Box::new(member_kind(module, *base)?), count: n.get(), stride: *stride })
        }
        TypeInner::Struct { .. } => Some(MemberKind::Struct(type_name(module, ty))),
        _ => None,
    }
}

/// Sizes of plain types, for buffers that no shader declares.
pub(crate) fn plain_layout(name: &str) -> Option<Layout> {
    let (scalar, rows) = match name {
        "f32" => (Scalar::F32, 1),
        "u32" => (Scalar::U32, 1),
        "i32" => (Scalar::I32, 1),
        _ => {
            let rest = name.strip_prefix("vec")?;
            let (digits, letter) = rest.split_at_checked(1)?;
            let rows: u32 = digits.parse().ok().filter(|n| (2..=4).contains(n))?;
            match letter {
                "f" => (Scalar::F32, rows),
                "u" => (Scalar::U32, rows),
                "i" => (Scalar::I32, rows),
                _ => return None,
            }
        }
    };
    let stride = if rows == 3 { 16 } else { rows * 4 };
    let kind = MemberKind::Numeric { scalar, rows, columns: 1, column_stride: 0 };
    Some(Layout { size: stride, members: vec![Member { name: String::new(), offset: 0, kind }] })
}
