//! Which lights of a scene a pipeline does not render.

use manylight_graph::{
    diagnostics::{Diagnostic, Severity},
    plan::Plan,
};
use manylight_scene::{LightShape, Scene};

/// A warning that names the lights which a pipeline leaves out because it reads the first spot light only.
pub fn lights_left_out(scene: &Scene, plan: &Plan) -> Option<Diagnostic> {
    if plan.resource("scene_light").is_none() || plan.resource("scene_lights").is_some() {
        return None;
    }
    let count = |of: fn(&LightShape) -> bool| scene.lights.iter().filter(|light| of(&light.shape)).count();
    let spots = count(|shape| matches!(shape, LightShape::Spot { .. }));
    let dark = [
        (spots.saturating_sub(1), "spot"),
        (count(|shape| *shape == LightShape::Point), "point"),
        (count(|shape| *shape == LightShape::Directional), "directional"),
    ];
    let dark: Vec<String> = dark.iter().filter(|(count, _)| *count > 0).map(|(count, kind)| format!("{count} {kind}")).collect();
    if dark.is_empty() {
        return None;
    }
    let rendered = if spots > 0 { "the first spot light" } else { "a spot light, which the scene does not have" };
    let message = format!("this pipeline renders only {rendered}; lights not rendered: {}", dark.join(", "));
    let warning = Diagnostic { severity: Severity::Warning, ..Diagnostic::error_nowhere(message) };
    Some(warning.help("the pipeline `reference` renders all lights"))
}
