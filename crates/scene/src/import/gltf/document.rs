//! glTF files: the container, the JSON in it, and the buffers that it names.

use std::{borrow::Cow, ops::Range, path::Path, sync::Arc};

use gltf::json::{Index, Root, Value, buffer::View, deserialize, validation};
use manylight_graph::diagnostics::{Diagnostic, Source, Span};

use super::{
    extensions,
    losses::Losses,
    uri::{data_uri, percent_decoded, shortened},
};
use crate::files::{Files, beside, cannot_read};

/// A glTF file with everything in it but its pictures. All indices are in range.
pub(super) struct Model<'a> {
    pub(super) path: &'a Path,
    pub(super) root: Root,
    buffers: Vec<Vec<u8>>,
}

/// An error that names the file.
pub(super) fn fault(path: &Path, message: impl std::fmt::Display, help: impl Into<String>) -> Diagnostic {
    Diagnostic::error_nowhere(format!("`{}`: {message}", path.display())).help(help)
}

/// What to do about a file that breaks the rules of glTF.
pub(super) const EXPORT_AGAIN: &str = "export it again as glTF 2.0, or see what the Khronos glTF validator says of it";

impl<'a> Model<'a> {
    /// Reads a file and its buffers.
    ///
    /// # Errors
    /// It cannot be read, breaks the rules of glTF, or needs an extension that is not known.
    pub(super) fn open(path: &'a Path, files: &mut Files<'_>, losses: &mut Losses) -> Result<Self, Diagnostic> {
        let bytes = files.read(path).map_err(|error| Diagnostic::error_nowhere(cannot_read(path, &error)))?;
        let (json, blob) = split(path, &bytes)?;
        let mut value: Value = deserialize::from_slice(&json).map_err(|error| json_fault(path, &json, &error))?;
        check_version(path, &value)?;
        extensions::check(path, &value, losses)?;
        prepare(&mut value, losses);
        let root: Root = deserialize::from_value(value).map_err(|error| {
            // A value that is taken from a tree knows no line: the same fault is looked for in the text.
            let error = deserialize::from_slice::<Root>(&json).err().unwrap_or(error);
            json_fault(path, &json, &error)
        })?;
        validate(path, &root, losses)?;
        let mut model = Self { path, root, buffers: Vec::new() };
        for index in 0..model.root.buffers.len() {
            let data = model.buffer(index, blob.as_deref(), files)?;
            model.buffers.push(data);
        }
        Ok(model)
    }

    /// The contents of a buffer.
    fn buffer(&self, index: usize, blob: Option<&[u8]>, files: &mut Files<'_>) -> Result<Vec<u8>, Diagnostic> {
        let buffer = &self.root.buffers[index];
        let at = format!("buffers[{index}]");
        let mut data = match (&buffer.uri, blob) {
            (Some(uri), _) => self.fetch(uri, files).map_err(|reason| fault(self.path, format!("{at}: {reason}"), BUFFER_HELP))?,
            (None, Some(blob)) if index == 0 => blob.to_vec(),
            (None, _) => return Err(fault(self.path, format!("{at} has no data"), EXPORT_AGAIN)),
        };
        let length = usize::try_from(buffer.byte_length.0).unwrap_or(usize::MAX);
        if data.len() < length {
            return Err(fault(
                self.path,
                format!("{at} has {} bytes of {length}", data.len()),
                "the file is cut off: copy or export it again",
            ));
        }
        data.truncate(length);
        Ok(data)
    }

    /// What a URI names: data in itself, or a file beside this one.
    pub(super) fn fetch(&self, uri: &str, files: &mut Files<'_>) -> Result<Vec<u8>, String> {
        match data_uri(uri) {
            Some(data) => data,
            None => {
                let path = self.beside(uri)?;
                files.read(&path).map_err(|error| cannot_read(&path, &error))
            }
        }
    }

    /// The path of a file that is named beside this one.
    pub(super) fn beside(&self, uri: &str) -> Result<std::path::PathBuf, String> {
        if uri.contains("://") {
            return Err(format!("`{}` is not a file beside it", shortened(uri)));
        }
        Ok(beside(self.path, &String::from_utf8_lossy(&percent_decoded(uri))))
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: Index<View>) -> Result<(&[u8], &View), String> {
        let view = self.root.get(index).ok_or_else(|| format!("bufferViews[{index}] does not exist"))?;
        let buffer = self.buffers.get(view.buffer.value()).ok_or_else(|| format!("buffers[{}] does not exist", view.buffer))?;
        let bytes = range(view.byte_offset.unwrap_or_default().0, view.byte_length.0).and_then(|range| buffer.get(range));
        let bytes = bytes.ok_or_else(|| format!("bufferViews[{index}] goes beyond the end of buffers[{}]", view.buffer))?;
        Ok((bytes, view))
    }
}

const BUFFER_HELP: &str = "keep the files of a `.gltf` together, or export one `.glb` that holds everything";

/// A range of bytes, if it can be one.
pub(super) fn range(start: u64, length: u64) -> Option<Range<usize>> {
    let end = start.checked_add(length)?;
    Some(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
}

/// A part of a file.
type Bytes<'b> = Cow<'b, [u8]>;

/// Bytes before the chunks of a binary file.
const HEADER: usize = 12;

/// The JSON of a file, and the data that comes with it in a binary one.
fn split<'b>(path: &Path, bytes: &'b [u8]) -> Result<(Bytes<'b>, Option<Bytes<'b>>), Diagnostic> {
    if !bytes.starts_with(b"glTF") {
        return Ok((bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).into(), None));
    }
    let word = |at: usize| bytes.get(at..at + 4).and_then(|word| word.try_into().ok()).map(u32::from_le_bytes);
    // The crate subtracts the size of the header from this length without a look.
    if word(8).is_none_or(|length| (length as usize) < HEADER || bytes.len() < length as usize) {
        return Err(fault(path, "the file is shorter than it says", "it is cut off: copy or export it again"));
    }
    if let Some(version) = word(4).filter(|version| *version != 2) {
        return Err(fault(
            path,
            format!("it is binary glTF of version {version}"),
            "only glTF 2.0 is read: convert it, or export it again",
        ));
    }
    let glb = gltf::Glb::from_slice(bytes).map_err(|error| {
        let reason = match error {
            gltf::Error::Binary(error) => error.to_string(),
            error => error.to_string(),
        };
        fault(path, format!("not a binary glTF file: {reason}"), EXPORT_AGAIN)
    })?;
    Ok((glb.json, glb.bin))
}

/// Texts up to this many bytes are kept for showing the line at fault.
const LONGEST_TEXT_KEPT: usize = 4 << 20;

/// A fault of the JSON, with its place where there is a text to show.
fn json_fault(path: &Path, json: &[u8], error: &gltf::json::Error) -> Diagnostic {
    let (line, column) = (error.line(), error.column());
    let full = error.to_string();
    let reason = full.rsplit_once(" at line ").map_or(full.as_str(), |(reason, _)| reason);
    let message = format!("`{}` is not a glTF file: {reason}", path.display());
    let text = str::from_utf8(json).ok().filter(|text| line > 0 && text.len() <= LONGEST_TEXT_KEPT);
    let fault = match text {
        Some(text) => {
            let start: usize = text.split_inclusive('\n').take(line - 1).map(str::len).sum();
            let mut at = (start + column.saturating_sub(1)).min(text.len());
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            let end = text[at..].chars().next().map_or(at, |c| at + c.len_utf8());
            let source = Source { name: path.display().to_string(), path: Some(path.to_owned()), text: text.into() };
            Diagnostic::error(message, Span { source: Arc::new(source), range: at..end })
        }
        None => Diagnostic::error_nowhere(message),
    };
    fault.help(EXPORT_AGAIN)
}

fn check_version(path: &Path, value: &Value) -> Result<(), Diagnostic> {
    let asset = value.get("asset");
    let version = |name: &str| asset.and_then(|asset| asset.get(name)).and_then(Value::as_str);
    let Some(written) = version("version") else {
        return Err(fault(path, "not a glTF file: it has no `asset.version`", EXPORT_AGAIN));
    };
    let too_new = version("minVersion").filter(|needed| *needed != "2.0");
    match too_new.or((written.split('.').next() != Some("2")).then_some(written)) {
        Some(other) => Err(fault(path, format!("it is glTF {other}"), "only glTF 2.0 is read: convert it, or export it again")),
        None => Ok(()),
    }
}

/// Takes out what the crate cannot read though the format allows it.
fn prepare(value: &mut Value, losses: &mut Losses) {
    without_extras(value);
    let lights = value.pointer_mut("/extensions/KHR_lights_punctual/lights").and_then(Value::as_array_mut);
    for (index, light) in lights.into_iter().flatten().enumerate() {
        if let Some(extensions) = light.as_object_mut().and_then(|light| light.remove("extensions")) {
            for name in extensions.as_object().into_iter().flatten().map(|(name, _)| name) {
                extensions::lost(&format!("extensions.KHR_lights_punctual.lights[{index}].extensions"), name, losses);
            }
        }
    }
    let animations = value.get_mut("animations").and_then(Value::as_array_mut);
    for (index, animation) in animations.into_iter().flatten().enumerate() {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else { continue };
        let mut at = 0;
        channels.retain(|channel| {
            let target = channel.get("target");
            let node = target.is_some_and(|target| target.get("node").is_some());
            let path = target.and_then(|target| target.get("path")).and_then(Value::as_str);
            if !node || path == Some("pointer") {
                let place = format!("animations[{index}].channels[{at}].target");
                losses.add(place, "animations of anything but nodes are left out", "animate the node's translation, rotation or scale");
            }
            at += 1;
            node && path != Some("pointer")
        });
    }
}

/// Removes what applications have added for themselves.
fn without_extras(value: &mut Value) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(without_extras),
        Value::Object(fields) => {
            fields.remove("extras");
            fields.values_mut().for_each(without_extras);
        }
        _ => {}
    }
}

/// At most so many faults of a file are told.
const MOST_FAULTS: usize = 5;

/// Whether everything that is named exists.
fn validate(path: &Path, root: &Root, losses: &mut Losses) -> Result<(), Diagnostic> {
    let mut faults: Vec<String> = Vec::new();
    // The crate looks positions up before it has seen whether they exist.
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            for index in primitive.attributes.values().filter(|index| root.get(**index).is_none()) {
                faults.push(format!("meshes[{m}].primitives[{p}].attributes: accessors[{index}] does not exist"));
            }
        }
    }
    if faults.is_empty() {
        validation::Validate::validate(root, root, gltf::json::Path::new, &mut |at: &dyn Fn() -> gltf::json::Path, error| {
            let at = at().to_string();
            // Bounds of positions are not used, and extensions are looked at elsewhere.
            if at.ends_with(".min") || at.ends_with(".max") || at.starts_with("extensionsRequired") {
                return;
            }
            if at.contains("attributes[\"<") {
                let at = at.split(".attributes").next().unwrap_or_default();
                losses.add(format!("{at}.attributes"), "vertex attributes of names that glTF does not define are left out", "");
                return;
            }
            let what = match error {
                validation::Error::IndexOutOfBounds => "names something that does not exist",
                validation::Error::Missing => "is missing",
                validation::Error::Oversize => "is too large",
                validation::Error::Invalid | validation::Error::Unsupported => "has a value that glTF does not know",
            };
            faults.push(format!("{at} {what}"));
        });
    }
    if faults.is_empty() {
        return Ok(());
    }
    let more = faults.len().saturating_sub(MOST_FAULTS);
    faults.truncate(MOST_FAULTS);
    let more = if more > 0 { format!(", and {more} more") } else { String::new() };
    Err(fault(path, format!("{}{more}", faults.join(", ")), EXPORT_AGAIN))
}
