//! Objects of scene files: meshes, also key-framed ones, and metaballs.

use glam::Vec3;
use manylight_graph::{
    diagnostics::Severity,
    ron::{Fields, Kind, Reader, Shape, Spanned, Tree},
};

use super::{
    document::named,
    motion::{Keys, read_motion, warn_long_turns},
    values::{checked, point, rotation, scale},
};
use crate::{
    deform::{Ball, MAX_CELLS},
    motion::{Pose, Track},
};

/// An object.
pub(super) struct ObjectEntry {
    pub(super) name: Option<String>,
    pub(super) pose: Track<Pose>,
    pub(super) shape: ShapeEntry,
}

/// What an object looks like.
pub(super) enum ShapeEntry {
    /// A mesh, and meshes of the same triangles at some times if it deforms.
    Mesh { file: Spanned, keys: Option<Track<Spanned>> },
    /// Balls that melt into one another.
    Metaballs(MetaballsEntry),
}

/// The surface of a field.
pub(super) struct MetaballsEntry {
    pub(super) balls: Vec<Track<Ball>>,
    pub(super) level: f32,
    pub(super) cells: u32,
    pub(super) material: String,
    /// The list of balls.
    pub(super) place: Spanned,
}

const MESH: Shape = Shape { what: "a mesh", required: &["file"], optional: &["name", "transform", "motion", "repeat"] };
const METABALLS: Shape =
    Shape { what: "metaballs", required: &["balls"], optional: &["level", "cells", "material", "name", "transform", "motion", "repeat"] };
const BALL: Shape = Shape { what: "a ball", required: &["position", "radius"], optional: &["strength", "motion", "repeat"] };
const BALL_KEY: Shape = Shape { what: "a key frame of a ball", required: &["time"], optional: &["position", "radius", "strength"] };
const TRANSFORM: Shape = Shape { what: "a transform", required: &[], optional: &["translate", "rotate_deg", "scale"] };
const TRANSFORM_KEY: Shape = Shape { what: "a key frame of an object", required: &["time"], optional: TRANSFORM.optional };
const MESH_KEY: Shape =
    Shape { what: "a key frame of a mesh", required: &["time"], optional: &["file", "translate", "rotate_deg", "scale"] };

/// What an object may be, for those who wrote something else.
const FORMS: &str = "an object is \"mesh.obj\", `Mesh(file: \"mesh.obj\", …)` or `Metaballs(balls: […], …)`";

/// Name and material of metaballs that do not say.
const METABALLS_NAME: &str = "metaballs";
/// Field on their surface: that of a lone ball of strength 1 lies at 0.61 of its radius.
const DEFAULT_LEVEL: f32 = 0.25;
const DEFAULT_CELLS: u32 = 32;

/// An object; faults go to the reader.
pub(super) fn read_object(reader: &mut Reader, tree: &Tree) -> Option<ObjectEntry> {
    if let Kind::Text(_) = tree.kind {
        let file = reader.text(tree, "a file")?;
        return Some(ObjectEntry { name: None, pose: Track::fixed(Pose::default()), shape: ShapeEntry::Mesh { file, keys: None } });
    }
    match named(reader, tree, &["Mesh", "Metaballs"], FORMS)? {
        "Mesh" => read_mesh(reader, tree),
        _ => read_metaballs(reader, tree),
    }
}

fn read_mesh(reader: &mut Reader, tree: &Tree) -> Option<ObjectEntry> {
    let fields = reader.record(tree, &MESH)?;
    let (name, rest) = read_rest(reader, &fields);
    let file = fields.get("file").and_then(|tree| reader.text(tree, "a file"));
    let motion = read_motion(reader, &fields, |reader, tree| {
        let fields = reader.record(tree, &MESH_KEY)?;
        let other = fields.get("file").and_then(|tree| reader.text(tree, "a file"));
        let pose = read_pose(reader, &fields, &rest);
        Some((pose, other.or(file.clone())?))
    });
    let poses = motion.as_ref().map(|keys| keys.map(|(pose, _)| *pose));
    let pose = pose_track(reader, poses, rest);
    let file = file?;
    let keys = motion.filter(|keys| keys.values().any(|(_, other)| other.text != file.text)).and_then(|keys| keys.track(|(_, file)| file));
    Some(ObjectEntry { name, pose, shape: ShapeEntry::Mesh { file, keys } })
}

fn read_metaballs(reader: &mut Reader, tree: &Tree) -> Option<ObjectEntry> {
    let before = reader.out.len();
    let fields = reader.record(tree, &METABALLS)?;
    let (name, rest) = read_rest(reader, &fields);
    let motion = read_motion(reader, &fields, |reader, tree| {
        let fields = reader.record(tree, &TRANSFORM_KEY)?;
        Some(read_pose(reader, &fields, &rest))
    });
    let pose = pose_track(reader, motion, rest);
    let level = fields
        .get("level")
        .map_or(Some(DEFAULT_LEVEL), |tree| checked(reader, tree, |level| (level <= 0.0).then_some("the field on the surface is above 0")));
    let cells = fields.get("cells").map_or(Some(DEFAULT_CELLS), |tree| read_cells(reader, tree));
    let material = fields.get("material").map_or(Some(METABALLS_NAME.to_owned()), |tree| Some(reader.text(tree, "a material")?.text));
    let place = fields.get("balls")?;
    let list = reader.list(place, "balls");
    if list.is_empty() && matches!(place.kind, Kind::List(_)) {
        reader.error(&place.range, "metaballs need a ball", "write `balls: [(position: (x, y, z), radius: 1.0)]`");
    }
    let balls: Vec<_> = list.iter().filter_map(|tree| read_ball(reader, tree)).collect();
    // Whether there is a surface can only be told of balls without faults.
    if reader.out.iter().skip(before).any(|fault| fault.severity == Severity::Error) {
        return None;
    }
    let place = Spanned { text: METABALLS_NAME.to_owned(), span: reader.span(&place.range) };
    let entry = MetaballsEntry { balls, level: level?, cells: cells?, material: material?, place };
    Some(ObjectEntry { name: Some(name.unwrap_or(METABALLS_NAME.to_owned())), pose, shape: ShapeEntry::Metaballs(entry) })
}

fn read_cells(reader: &mut Reader, tree: &Tree) -> Option<u32> {
    let cells = reader.int(tree, "a number of cells")?;
    let fits = u32::try_from(cells).ok().filter(|cells| (1..=MAX_CELLS).contains(cells));
    if fits.is_none() {
        reader.error(&tree.range, format!("{cells} cells are out of range"), format!("1 to {MAX_CELLS} cells along the longest side"));
    }
    fits
}

fn read_ball(reader: &mut Reader, tree: &Tree) -> Option<Track<Ball>> {
    let fields = reader.record(tree, &BALL)?;
    let rest = read_ball_at(reader, &fields, &Ball { position: Vec3::ZERO, radius: 0.0, strength: 1.0 });
    let motion = read_motion(reader, &fields, |reader, tree| {
        let fields = reader.record(tree, &BALL_KEY)?;
        Some(read_ball_at(reader, &fields, &rest))
    });
    Some(motion.and_then(|keys| keys.track(|ball| ball)).unwrap_or_else(|| Track::fixed(rest)))
}

/// The ball of a record; what is missing is taken from `rest`.
fn read_ball_at(reader: &mut Reader, fields: &Fields<'_>, rest: &Ball) -> Ball {
    let position = fields.get("position").and_then(|tree| point(reader, tree));
    let radius = fields.get("radius").and_then(|tree| checked(reader, tree, |radius| (radius < 0.0).then_some("a radius is not negative")));
    let strength = fields.get("strength").and_then(|tree| checked(reader, tree, |_| None));
    Ball { position: position.unwrap_or(rest.position), radius: radius.unwrap_or(rest.radius), strength: strength.unwrap_or(rest.strength) }
}

/// Name of an object, and where it is without motion.
fn read_rest(reader: &mut Reader, fields: &Fields<'_>) -> (Option<String>, Pose) {
    let name = fields.get("name").and_then(|tree| reader.text(tree, "a name")).map(|name| name.text);
    let mut rest = Pose::default();
    if let Some(tree) = fields.get("transform") {
        let before = reader.out.len();
        if let Some(fields) = reader.record(tree, &TRANSFORM) {
            rest = read_pose(reader, &fields, &rest).0;
        }
        if reader.out.len() == before && rest.scale.to_array().contains(&0.0) {
            reader.error(&tree.range, "the scale is zero", "an object that stands still needs a size along every axis");
        }
    }
    (name, rest)
}

/// Where an object is over time. One whose keys are all alike stands still: they are there for its shape.
fn pose_track(reader: &mut Reader, motion: Option<Keys<WrittenPose>>, rest: Pose) -> Track<Pose> {
    let Some(keys) = motion else { return Track::fixed(rest) };
    warn_long_turns(reader, &keys);
    if let Some((first, _)) = keys.values().next().copied()
        && keys.values().all(|(pose, _)| *pose == first)
    {
        return Track::fixed(first);
    }
    keys.track(|(pose, _)| pose).unwrap_or_else(|| Track::fixed(rest))
}

/// A pose, and its rotation as axis and angle if it is written so.
pub(super) type WrittenPose = (Pose, Option<(Vec3, f32)>);

/// The pose of a record; what is missing is taken from `rest`.
fn read_pose(reader: &mut Reader, fields: &Fields<'_>, rest: &Pose) -> WrittenPose {
    let mut pose = *rest;
    let mut turn = None;
    if let Some(translate) = fields.get("translate").and_then(|tree| point(reader, tree)) {
        pose.translate = translate;
    }
    if let Some((rotate, written)) = fields.get("rotate_deg").and_then(|tree| rotation(reader, tree)) {
        pose.rotate = rotate;
        turn = written;
    }
    if let Some(scale) = fields.get("scale").and_then(|tree| scale(reader, tree)) {
        pose.scale = scale;
    }
    (pose, turn)
}
