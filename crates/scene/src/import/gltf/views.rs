//! Cameras and lights.

use glam::{DMat4, DVec3, Vec3};
use gltf::json::{camera, extensions::scene::khr_lights_punctual as punctual, validation::Checked};

use super::{
    document::Model,
    losses::Losses,
    nodes::{Nodes, direction},
    sampling,
};
use crate::{
    gpu_data::Falloff,
    motion::{CameraPose, LightPose, Track},
    scene::{Light, LightShape},
};

/// Luminous efficacy of light of 555 nm in lm/W, by definition of the candela: what exporters take from watts to lumens with.
pub(super) const LUMENS_PER_WATT: f32 = 683.0;

/// Width over height of the picture of a camera that does not say.
const ASPECT: f64 = 16.0 / 9.0;

/// How far tracks may be from the motion: directions in radians, positions as a share of the scene's diagonal.
const TOLERANCE: f64 = 1e-4;
/// Largest half-angle of a spot light in degrees: at 90 its view has no end.
const WIDEST_CONE_DEG: f32 = 89.0;
/// The beam of a spot light is narrower than its cone by this factor at least.
const BEAM_BELOW_CONE: f32 = 0.999;

/// The first perspective camera of the scene. `diagonal`: of the scene.
pub(super) fn camera(model: &Model<'_>, nodes: &Nodes, diagonal: f64, losses: &mut Losses) -> Option<Track<CameraPose>> {
    let mut found = None;
    for node in nodes.order.iter().copied() {
        let Some(index) = model.root.nodes[node].camera else { continue };
        let at = format!("cameras[{index}]");
        let perspective = model.root.get(index).and_then(|camera| match camera.type_ {
            Checked::Valid(camera::Type::Perspective) => camera.perspective.as_ref(),
            _ => None,
        });
        let Some(perspective) = perspective else {
            losses.add(at, "cameras without perspective are left out", "use a perspective camera");
            continue;
        };
        if found.is_some() {
            losses.add(at, "cameras other than the first are left out", "put the one to be used first");
            continue;
        }
        let aspect = perspective.aspect_ratio.map(f64::from).filter(|aspect| *aspect > 0.0 && aspect.is_finite());
        if aspect.is_none() {
            losses.add(
                format!("{at}.perspective.aspectRatio"),
                "a camera of unknown aspect ratio has the width of 16:9",
                "set `aspectRatio`",
            );
        }
        let fov_y = f64::from(perspective.yfov);
        let fov_x_deg = 2.0 * ((0.5 * fov_y).tan() * aspect.unwrap_or(ASPECT)).atan().to_degrees();
        // So wide that the tangent of its half is a number.
        if !((1e-3..=179.9).contains(&fov_x_deg) && fov_y > 0.0 && fov_y < std::f64::consts::PI) {
            losses.add(
                format!("{at}.perspective.yfov"),
                "cameras with a field of view of 0 or 180 degrees are left out",
                "set `yfov` in radians",
            );
            continue;
        }
        found = Some((node, fov_x_deg as f32));
    }
    let (node, fov_x_deg) = found?;
    let at = |time: f64| {
        let matrix = nodes.at(node, time).matrix();
        // As far as the scene is long, so that rounding does not turn the camera.
        let target = matrix.w_axis.truncate() + diagonal * direction(&matrix, DVec3::NEG_Z);
        let up = up(&matrix);
        CameraPose { origin: matrix.w_axis.truncate().as_vec3(), target: target.as_vec3(), up: up.as_vec3(), fov_x_deg }
    };
    let way = |pose: &CameraPose| (pose.target - pose.origin).as_dvec3().normalize_or_zero();
    let distance = |a: &CameraPose, b: &CameraPose| {
        let up = |pose: &CameraPose| pose.up.as_dvec3().normalize_or_zero();
        let turned = way(a).distance(way(b)).max(up(a).distance(up(b)));
        turned.max(a.origin.as_dvec3().distance(b.origin.as_dvec3()) / diagonal) / TOLERANCE
    };
    Some(tracked(nodes, node, at, distance, "camera", losses))
}

/// The top of a camera's picture: perpendicular to where it looks, whatever its matrix is.
fn up(matrix: &DMat4) -> DVec3 {
    let forward = direction(matrix, DVec3::NEG_Z);
    let up = direction(matrix, DVec3::Y);
    (up - forward * up.dot(forward)).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector())
}

/// The lights of the scene. `diagonal`: of the scene.
pub(super) fn lights(model: &Model<'_>, nodes: &Nodes, diagonal: f64, losses: &mut Losses) -> Vec<Light> {
    let light = |node: &usize| {
        let index = model.root.nodes[*node].extensions.as_ref()?.khr_lights_punctual.as_ref()?.light;
        Some((*node, index.value(), model.root.get(index)?))
    };
    let found: Vec<_> = nodes.order.iter().filter_map(light).collect();
    found.into_iter().filter_map(|(node, index, light)| read_light(node, index, light, nodes, diagonal, losses)).collect()
}

fn read_light(node: usize, index: usize, light: &punctual::Light, nodes: &Nodes, diagonal: f64, losses: &mut Losses) -> Option<Light> {
    let at = format!("extensions.KHR_lights_punctual.lights[{index}]");
    let kind = match light.type_ {
        Checked::Valid(kind) => kind,
        Checked::Invalid => return None,
    };
    let strength = Vec3::from_array(light.color) * light.intensity / LUMENS_PER_WATT;
    if !(strength.cmpge(Vec3::ZERO).all() && strength.max_element() <= super::primitives::LARGEST) {
        losses.add(at, "lights whose strength is negative or not finite are left out", "set `intensity` and `color`");
        return None;
    }
    if light.range.is_some() {
        losses.add(format!("{at}.range"), "ranges of lights are left out: light goes on for ever", "");
    }
    let shape = match kind {
        punctual::Type::Directional => LightShape::Directional,
        punctual::Type::Point => LightShape::Point,
        punctual::Type::Spot => cone(light.spot.as_ref()?, &at, losses)?,
    };
    let pose = |time: f64| {
        let matrix = nodes.at(node, time).matrix();
        let (place, way) = (matrix.w_axis.truncate(), direction(&matrix, DVec3::NEG_Z));
        match kind {
            punctual::Type::Directional => LightPose { position: Vec3::ZERO, target: way.as_vec3(), strength },
            punctual::Type::Point => LightPose { position: place.as_vec3(), target: Vec3::NEG_Y, strength },
            punctual::Type::Spot => LightPose { position: place.as_vec3(), target: (place + diagonal * way).as_vec3(), strength },
        }
    };
    let distance = |a: &LightPose, b: &LightPose| {
        let turned = if kind == punctual::Type::Point { 0.0 } else { f64::from(a.direction().distance(b.direction())) };
        turned.max(a.position.as_dvec3().distance(b.position.as_dvec3()) / diagonal) / TOLERANCE
    };
    Some(Light { pose: tracked(nodes, node, pose, distance, "light", losses), shape })
}

fn cone(spot: &punctual::Spot, at: &str, losses: &mut Losses) -> Option<LightShape> {
    let [beam, cutoff] = [spot.inner_cone_angle, spot.outer_cone_angle].map(f32::to_degrees);
    if !(cutoff > 0.0 && cutoff <= 180.0 && beam >= 0.0) {
        losses.add(format!("{at}.spot"), "spot lights whose cone has no angle are left out", "`outerConeAngle` is above 0, in radians");
        return None;
    }
    if cutoff > WIDEST_CONE_DEG {
        losses.add(format!("{at}.spot.outerConeAngle"), "cones of spot lights end at 89 degrees from their axis", "use a point light");
    }
    let cutoff_deg = cutoff.min(WIDEST_CONE_DEG);
    Some(LightShape::Spot { beam_deg: beam.min(cutoff_deg * BEAM_BELOW_CONE), cutoff_deg, falloff: Falloff::Smooth })
}

/// The motion of a node's camera or light.
fn tracked<T: crate::motion::Interpolate>(
    nodes: &Nodes,
    node: usize,
    at: impl Fn(f64) -> T,
    distance: impl Fn(&T, &T) -> f64,
    what: &str,
    losses: &mut Losses,
) -> Track<T> {
    if !nodes.moves(node) {
        return Track::fixed(at(0.0));
    }
    let (track, worst) = sampling::track(nodes.span(), nodes.breaks(node), at, distance);
    if worst > 1.0 {
        let message =
            format!("its {what} moves too fast for key frames: it is off by up to {:.2e} rad or diagonals of the scene", worst * TOLERANCE);
        losses.add(format!("nodes[{node}]"), message, "slow it down, or put in more key frames");
    }
    track
}
