//! Names of features: what a scene may have, and what a node may require of the device.

/// Every feature that a scene reports and that `Feature("…")` conditions can test.
pub const KNOWN: &[&str] =
    &["textures", "glossy", "moving_objects", "deforming_objects", "moving_lights", "moving_camera", "several_lights", "normals"];

/// Device features that a node's `requires` can name: those of wgpu that change what a shader may do.
pub const DEVICE: &[&str] = &[
    "FLOAT32_FILTERABLE",
    "FLOAT32_BLENDABLE",
    "TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES",
    "TEXTURE_ATOMIC",
    "TEXTURE_INT64_ATOMIC",
    "TEXTURE_FORMAT_16BIT_NORM",
    "FORMATS_TIER_1",
    "RW_STORAGE_TEXTURE_TIER_1",
    "RG11B10UFLOAT_RENDERABLE",
    "BGRA8UNORM_STORAGE",
    "SHADER_F16",
    "SHADER_F64",
    "SHADER_I16",
    "SHADER_INT64",
    "SHADER_INT64_ATOMIC_MIN_MAX",
    "SHADER_INT64_ATOMIC_ALL_OPS",
    "SHADER_FLOAT32_ATOMIC",
    "SHADER_EARLY_DEPTH_TEST",
    "SHADER_BARYCENTRICS",
    "SHADER_PER_VERTEX",
    "SHADER_DRAW_INDEX",
    "SUBGROUP",
    "SUBGROUP_VERTEX",
    "SUBGROUP_BARRIER",
    "VERTEX_WRITABLE_STORAGE",
    "CONSERVATIVE_RASTERIZATION",
    "DEPTH_CLIP_CONTROL",
    "DUAL_SOURCE_BLENDING",
    "CLIP_DISTANCES",
    "PRIMITIVE_INDEX",
    "EXPERIMENTAL_RAY_QUERY",
    "EXPERIMENTAL_COOPERATIVE_MATRIX",
];
