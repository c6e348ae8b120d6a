//! What a scene may have: the names that `Feature("…")` conditions can test.

/// Every feature a scene reports.
pub const KNOWN: &[&str] = &["textures", "glossy", "moving_objects", "moving_lights", "moving_camera", "several_lights", "normals"];
