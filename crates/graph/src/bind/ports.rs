//! Whether a global fits its port, and what it should be instead.

use super::kind_word;
use crate::{
    registry::{Direction, Port, PortKind},
    shader::{Global, GlobalKind, SampleKind},
    value::Format,
};

/// Why a global cannot be the port, if it cannot.
pub(super) fn mismatch(global: &Global, port: &Port, drawn: bool, requires: &[String]) -> Option<String> {
    let input = port.direction == Direction::Input;
    match (&port.kind, &global.kind) {
        (PortKind::Texture { .. }, _) if drawn && !input => Some("it is a draw target, and targets have no global".into()),
        (PortKind::Texture { format, array }, GlobalKind::Texture { sample, array: is_array, filtered }) if input => {
            if array != is_array {
                return Some(if *array { "the port is an array" } else { "the port is no array" }.into());
            }
            let fits = match format.map(Format::sample_kind) {
                None => matches!(sample, SampleKind::Float),
                Some(SampleKind::Depth) => matches!(sample, SampleKind::Depth) || (matches!(sample, SampleKind::Float) && !filtered),
                Some(kind) => kind == *sample,
            };
            if !fits {
                return Some(match format {
                    Some(format) => format!("{format} does not read as {}", kind_word(*sample)),
                    None => format!("the port reads as float, not as {}", kind_word(*sample)),
                });
            }
            let feature = requires.iter().any(|r| r == "FLOAT32_FILTERABLE");
            if *filtered && format.is_some_and(Format::is_float32) && !feature {
                return Some(
                    "it is sampled with a filter, which 32-bit floats allow only with `requires: [\"FLOAT32_FILTERABLE\"]`".into(),
                );
            }
            None
        }
        (PortKind::Texture { .. }, GlobalKind::StorageTexture { .. }) if input => Some("an input is not written".into()),
        (PortKind::Texture { .. }, GlobalKind::Texture { .. }) => Some("an output is written".into()),
        (PortKind::Texture { format, array }, GlobalKind::StorageTexture { format: written, array: is_array, access }) => {
            if let Some(format) = format
                && format != written
            {
                return Some(format!("the port has the format {format}, the shader {written}"));
            }
            if array != is_array {
                return Some(if *array { "the port is an array" } else { "the port is no array" }.into());
            }
            if !access.write {
                return Some("an output is written".into());
            }
            let both_ways = matches!(written, Format::R32Float | Format::R32Uint);
            let feature = requires.iter().any(|r| r == "TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES");
            if access.read && !both_ways && !feature {
                return Some(format!("{written} cannot be read and written in place; only r32float and r32uint can"));
            }
            None
        }
        (PortKind::Buffer { of }, GlobalKind::Storage { element, access, .. }) => {
            if of != element {
                return Some(format!("the port is of `{of}`, the shader of `{element}`"));
            }
            match (input, access.write) {
                (true, true) => Some("an input is not written".into()),
                (false, false) => Some("an output is written".into()),
                _ => None,
            }
        }
        (PortKind::Uniform { of }, GlobalKind::Uniform { element, .. }) if of == element => None,
        (PortKind::Uniform { of }, GlobalKind::Uniform { element, .. }) => {
            Some(format!("the port is of `{of}`, the shader of `{element}`"))
        }
        (PortKind::Texture { .. }, _) => Some("the port is a texture".into()),
        (PortKind::Buffer { .. }, _) => Some("the port is a storage buffer".into()),
        (PortKind::Uniform { .. }, _) => Some("the port is a uniform".into()),
    }
}

/// The declaration that the shader should have for a port.
pub(super) fn expected_wgsl(name: &str, port: &Port, drawn: bool) -> String {
    let input = port.direction == Direction::Input;
    let declaration = match &port.kind {
        PortKind::Texture { .. } if drawn && !input => return "remove the global: the fragment shader returns the value".into(),
        PortKind::Texture { format, array } if input => {
            let suffix = if *array { "_array" } else { "" };
            match format.map_or(SampleKind::Float, Format::sample_kind) {
                SampleKind::Depth => format!("var {name}: texture_depth_2d{suffix};"),
                SampleKind::Uint => format!("var {name}: texture_2d{suffix}<u32>;"),
                _ => format!("var {name}: texture_2d{suffix}<f32>;"),
            }
        }
        PortKind::Texture { format, array } => {
            let suffix = if *array { "_array" } else { "" };
            let format = format.map_or_else(|| "FORMAT".to_owned(), |f| f.name().to_lowercase());
            format!("var {name}: texture_storage_2d{suffix}<{format}, write>;")
        }
        PortKind::Buffer { of } => format!("var<storage, {}> {name}: array<{of}>;", if input { "read" } else { "read_write" }),
        PortKind::Uniform { of } => format!("var<uniform> {name}: {of};"),
    };
    format!("write `@group(…) @binding(…) {declaration}`")
}
