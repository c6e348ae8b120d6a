//! Whether a resource or an external fits a port.

use crate::{
    pipeline::{Resource, ResourceKind},
    registry::{Direction, NodeDecl, Port, PortKind},
    shader::{GlobalKind, SampleKind},
    value::Format,
};

/// Why a resource of the pipeline does not fit, if it does not.
pub(crate) fn resource(port: &Port, resource: &Resource, decl: &NodeDecl, name: &str) -> Option<String> {
    match (&port.kind, &resource.kind) {
        (PortKind::Texture { array: true, .. }, ResourceKind::Texture { .. }) => Some("the port takes a texture array".into()),
        (PortKind::Texture { format: wanted, .. }, ResourceKind::Texture { format, .. }) => texture(port, *wanted, *format, decl, name),
        (PortKind::Buffer { of: wanted }, ResourceKind::Buffer { of, .. }) if wanted == of => None,
        (PortKind::Buffer { of: wanted }, ResourceKind::Buffer { of, .. }) => Some(format!("it is a buffer of `{of}`, not of `{wanted}`")),
        (wanted, ResourceKind::Texture { .. }) => Some(format!("it is a texture, not {}", describe(wanted))),
        (wanted, ResourceKind::Buffer { of, .. }) => Some(format!("it is a buffer of `{of}`, not {}", describe(wanted))),
    }
}

/// Why scene data does not fit, if it does not.
pub(crate) fn external(port: &Port, kind: &PortKind, decl: &NodeDecl, name: &str) -> Option<String> {
    match (&port.kind, kind) {
        (PortKind::Texture { format: wanted, array }, PortKind::Texture { format, array: is_array }) => {
            if array != is_array {
                return Some(if *is_array { "it is a texture array" } else { "it is no texture array" }.into());
            }
            format.and_then(|format| texture(port, *wanted, format, decl, name))
        }
        (PortKind::Buffer { of: wanted }, PortKind::Buffer { of }) | (PortKind::Uniform { of: wanted }, PortKind::Uniform { of })
            if wanted == of =>
        {
            None
        }
        (wanted, kind) => Some(format!("it is {}, not {}", describe(kind), describe(wanted))),
    }
}

fn texture(port: &Port, wanted: Option<Format>, format: Format, decl: &NodeDecl, name: &str) -> Option<String> {
    let filtered = decl.shader.as_ref().is_some_and(|shader| {
        shader.globals.iter().any(|g| g.name == name && matches!(g.kind, GlobalKind::Texture { filtered: true, .. }))
    });
    match wanted {
        Some(wanted) if wanted != format => return Some(format!("it has the format {format}, not {wanted}")),
        Some(_) => {}
        None => match format.sample_kind() {
            SampleKind::Float => {}
            SampleKind::Depth if !filtered => {}
            SampleKind::Depth => return Some("depth cannot be sampled with a filter".into()),
            _ => return Some(format!("the port reads floats, and {format} holds integers")),
        },
    }
    let feature = decl.requires.iter().any(|r| r == "FLOAT32_FILTERABLE");
    if port.direction == Direction::Input && filtered && format.is_float32() && !feature {
        return Some(format!(
            "it is sampled with a filter, and {format} cannot be without `requires: [\"FLOAT32_FILTERABLE\"]` in the node"
        ));
    }
    None
}

/// A kind of port in words.
pub(crate) fn describe(kind: &PortKind) -> String {
    match kind {
        PortKind::Texture { format: Some(format), array: false } => format!("a texture {format}"),
        PortKind::Texture { format: Some(format), array: true } => format!("a texture array {format}"),
        PortKind::Texture { format: None, array: false } => "a texture".into(),
        PortKind::Texture { format: None, array: true } => "a texture array".into(),
        PortKind::Buffer { of } => format!("a buffer of `{of}`"),
        PortKind::Uniform { of } => format!("a uniform `{of}`"),
    }
}
