//! Lights of scene files.

use std::ops::Range;

use glam::Vec3;
use manylight_graph::{
    diagnostics::Diagnostic,
    ron::{Fields, Kind, Reader, Shape, Tree, head, suggest},
};

use super::{
    document::named,
    motion::{read_motion, warn_opposite_directions},
    sky::read_sun,
    values::{angle, point, strength, vector},
};
use crate::{
    gpu_data::Falloff,
    motion::{LightPose, Track},
    scene::{Light, LightShape},
    sky::{DAY_S, SunLight},
};

const SPOT: Shape = Shape {
    what: "a spot light",
    required: &["position", "target", "intensity", "beam_deg", "cutoff_deg"],
    optional: &["falloff", "motion", "repeat"],
};
const SPOT_KEY: Shape = Shape { what: "a key frame of a spot light", required: &["time"], optional: &["position", "target", "intensity"] };
const POINT: Shape = Shape { what: "a point light", required: &["position", "intensity"], optional: &["motion", "repeat"] };
const POINT_KEY: Shape = Shape { what: "a key frame of a point light", required: &["time"], optional: POINT.required };
const DIRECTIONAL: Shape = Shape { what: "a directional light", required: &["direction", "irradiance"], optional: &["motion", "repeat"] };
const DIRECTIONAL_KEY: Shape = Shape { what: "a key frame of a directional light", required: &["time"], optional: DIRECTIONAL.required };

/// What a light may be, for those who wrote something else.
const FORMS: &str = "a light is `Spot(position: …, target: …, intensity: …, beam_deg: …, cutoff_deg: …)`, \
                     `Point(position: …, intensity: …)`, `Directional(direction: …, irradiance: …)` or \
                     `Sun(latitude_deg: …, day: …, irradiance: …)`";

/// The lights of a scene, and which of them is a sun; faults go to the reader.
pub(super) fn read_lights(reader: &mut Reader, tree: &Tree) -> (Vec<Light>, Option<SunLight>) {
    let mut lights = Vec::new();
    let mut first: Option<(SunLight, Range<usize>)> = None;
    for tree in reader.list(tree, "lights") {
        if !matches!(&tree.kind, Kind::Record(Some(name), _) | Kind::Tuple(Some(name), _) if name.text == "Sun") {
            lights.extend(read_light(reader, tree));
            continue;
        }
        let Some(sun) = read_sun(reader, tree) else { continue };
        if let Some((_, place)) = &first {
            let (fault, place) = (reader.span(&head(tree)), reader.span(place));
            let fault = Diagnostic::error("a scene has at most one sun", fault).and(place, "the other one");
            reader.out.push(fault.help("write `Directional(…)` with `motion` for further ones"));
            continue;
        }
        first = Some((SunLight { light: lights.len(), sun }, head(tree)));
        // What it is without its motion: the sun of noon.
        lights.push(Light { pose: Track::fixed(sun.pose(0.5 * DAY_S)), shape: LightShape::Directional });
    }
    (lights, first.map(|(sun, _)| sun))
}

/// A light; faults go to the reader.
fn read_light(reader: &mut Reader, tree: &Tree) -> Option<Light> {
    match named(reader, tree, &["Spot", "Point", "Directional", "Sun"], FORMS)? {
        "Spot" => read_spot(reader, tree),
        "Point" => {
            let fields = reader.record(tree, &POINT)?;
            Some(Light { pose: read_track(reader, tree, &fields, &POINT_KEY), shape: LightShape::Point })
        }
        _ => {
            let fields = reader.record(tree, &DIRECTIONAL)?;
            Some(Light { pose: read_track(reader, tree, &fields, &DIRECTIONAL_KEY), shape: LightShape::Directional })
        }
    }
}

fn read_spot(reader: &mut Reader, tree: &Tree) -> Option<Light> {
    let fields = reader.record(tree, &SPOT)?;
    let pose = read_track(reader, tree, &fields, &SPOT_KEY);
    let beam = fields.get("beam_deg").and_then(|tree| angle(reader, tree));
    let cutoff = fields.get("cutoff_deg").and_then(|tree| angle(reader, tree).map(|angle| (angle, tree)));
    if let (Some(beam), Some((cutoff, tree))) = (beam, cutoff)
        && cutoff <= beam
    {
        reader.error(
            &tree.range,
            format!("the cut-off {cutoff}° is not above the beam {beam}°"),
            "both are half-angles; the light fades between them",
        );
    }
    let falloff = fields.get("falloff").map_or(Some(Falloff::Linear), |tree| read_falloff(reader, tree));
    Some(Light { pose, shape: LightShape::Spot { beam_deg: beam?, cutoff_deg: cutoff?.0, falloff: falloff? } })
}

/// A light's pose over time; what key frames leave out is as in the light's own record.
fn read_track(reader: &mut Reader, tree: &Tree, fields: &Fields<'_>, key: &Shape) -> Track<LightPose> {
    let none = LightPose { position: Vec3::ZERO, target: Vec3::NEG_Y, strength: Vec3::ZERO };
    let aimed = fields.get("position").is_some() && fields.get("target").is_some();
    let rest = read_pose(reader, tree, fields, &none, aimed);
    let motion = read_motion(reader, fields, |reader, tree| {
        let fields = reader.record(tree, key)?;
        Some(read_pose(reader, tree, &fields, &rest, aimed))
    });
    if let Some(keys) = &motion
        && fields.get("direction").is_some()
    {
        warn_opposite_directions(reader, keys);
    }
    motion.and_then(|keys| keys.track(|pose| pose)).unwrap_or_else(|| Track::fixed(rest))
}

/// The pose of a record of any kind of light; what is missing is taken from `rest`. `aimed`: the light has a position and a target.
fn read_pose(reader: &mut Reader, tree: &Tree, fields: &Fields<'_>, rest: &LightPose, aimed: bool) -> LightPose {
    let before = reader.out.len();
    let position = fields.get("position").and_then(|tree| point(reader, tree)).unwrap_or(rest.position);
    let target = fields.get("target").and_then(|tree| point(reader, tree));
    // Of unit length, so that keys of different lengths are mixed alike.
    let direction = fields.get("direction").and_then(|tree| vector(reader, tree)).map(|way| way.as_dvec3().normalize().as_vec3());
    let target = target.or(direction).unwrap_or(rest.target);
    let strength = fields.get("intensity").or(fields.get("irradiance")).and_then(|tree| strength(reader, tree));
    if reader.out.len() == before && aimed && position == target {
        reader.error(&head(tree), "the light is on its target", "position and target must differ: they give its direction");
    }
    LightPose { position, target, strength: strength.unwrap_or(rest.strength) }
}

fn read_falloff(reader: &mut Reader, tree: &Tree) -> Option<Falloff> {
    let known = [("linear", Falloff::Linear), ("cosine", Falloff::Cosine), ("smooth", Falloff::Smooth)];
    let names = known.map(|(name, _)| name);
    match &tree.kind {
        Kind::Name(name) | Kind::Text(name) => {
            let found = known.iter().find(|(known, _)| known == name).map(|(_, falloff)| *falloff);
            if found.is_none() {
                reader.error(&tree.range, format!("unknown falloff `{name}`"), suggest(name, names));
            }
            found
        }
        _ => {
            reader.expected(tree, "`linear`, `cosine` or `smooth`", "");
            None
        }
    }
}
