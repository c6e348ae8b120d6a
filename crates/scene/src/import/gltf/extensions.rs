//! Extensions of glTF: what is read, what is lost, and what a file cannot do without.

use std::path::Path;

use gltf::json::Value;
use manylight_graph::diagnostics::Diagnostic;

use super::{document::fault, losses::Losses};

/// Read without loss.
const READ: &[&str] = &["KHR_lights_punctual", "KHR_texture_transform", "KHR_materials_ior", "KHR_mesh_quantization"];

/// A file may need these: it has something to show without them. What is lost is told.
const LOST: &[&str] = &[
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_node_visibility",
    "KHR_animation_pointer",
];

/// What to do about an extension that a file needs.
fn remedy(name: &str) -> &'static str {
    match name {
        "KHR_draco_mesh_compression" | "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "export it without compression of meshes, or decompress it: `gltf-transform copy in.glb out.glb`"
        }
        "KHR_texture_basisu" | "EXT_texture_webp" | "EXT_texture_avif" | "MSFT_texture_dds" => "export it with PNG or JPEG textures",
        "KHR_materials_pbrSpecularGlossiness" => "convert its materials: `gltf-transform metalrough in.glb out.glb`",
        "EXT_mesh_gpu_instancing" => "export every instance as a node",
        _ => "export it without this extension",
    }
}

fn names<'v>(value: &'v Value, list: &str) -> impl Iterator<Item = &'v str> {
    value.get(list).and_then(Value::as_array).into_iter().flatten().filter_map(Value::as_str)
}

/// Refuses a file that needs an extension which is not known, and tells which others are left out.
pub(super) fn check(path: &Path, value: &Value, losses: &mut Losses) -> Result<(), Diagnostic> {
    let unknown: Vec<&str> = names(value, "extensionsRequired").filter(|name| !READ.contains(name) && !LOST.contains(name)).collect();
    if let Some(first) = unknown.first() {
        let list = unknown.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
        return Err(fault(path, format!("extensionsRequired: it cannot be read without {list}, which is not supported"), remedy(first)));
    }
    for (index, name) in names(value, "extensionsUsed").enumerate() {
        lost(&format!("extensionsUsed[{index}]"), name, losses);
    }
    Ok(())
}

/// Tells that an extension is left out, unless it is read or was told before.
pub(super) fn lost(at: &str, name: &str, losses: &mut Losses) {
    let message = format!("the extension `{name}` is left out");
    if !READ.contains(&name) && !losses.has(&message) {
        losses.add(at, message, "the picture lacks what it adds: see `glTF` in the guide to scenes");
    }
}
