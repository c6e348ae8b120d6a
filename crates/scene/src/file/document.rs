//! What a scene file says, with every fault in it.

use glam::Vec3;
use manylight_graph::{
    diagnostics::Diagnostic,
    ron::{Fields, Kind, Reader, Shape, Spanned, Tree, head, suggest},
};

use super::{
    light::read_lights,
    motion::read_motion,
    object::{ObjectEntry, read_object},
    sky::read_sky,
    values::{albedo, checked, point, vector},
};
use crate::{
    motion::{CameraPose, Track},
    scene::Light,
    sky::{Sky, SunLight},
};

/// A scene file.
#[derive(Default)]
pub(super) struct Document {
    pub(super) objects: Vec<ObjectEntry>,
    pub(super) camera: Option<Track<CameraPose>>,
    pub(super) lights: Option<Vec<Light>>,
    pub(super) sun: Option<SunLight>,
    pub(super) sky: Option<Sky>,
    pub(super) materials: Vec<MaterialEntry>,
}

/// Changes to the materials of a name.
pub(super) struct MaterialEntry {
    pub(super) name: Spanned,
    pub(super) diffuse: Option<Vec3>,
    pub(super) specular: Option<Vec3>,
    pub(super) shininess: Option<f32>,
    pub(super) texture: Option<Spanned>,
}

const SCENE: Shape = Shape { what: "a scene", required: &["meshes"], optional: &["camera", "lights", "sky", "materials"] };
const CAMERA: Shape = Shape { what: "a camera", required: &["origin", "target"], optional: &["up", "fov_x_deg", "motion", "repeat"] };
const CAMERA_KEY: Shape =
    Shape { what: "a key frame of a camera", required: &["time"], optional: &["origin", "target", "up", "fov_x_deg"] };
const MATERIAL: Shape = Shape { what: "a material", required: &[], optional: &["diffuse", "specular", "shininess", "texture"] };

/// Field of view of a camera that does not say.
const DEFAULT_FOV_X_DEG: f32 = 50.0;

/// Reads a document; faults go to the reader.
pub(super) fn read(reader: &mut Reader, tree: &Tree) -> Document {
    let mut document = Document::default();
    if named(reader, tree, &["Scene"], "a scene file is `Scene(meshes: [\"mesh.obj\"], …)`").is_none() {
        return document;
    }
    let Some(fields) = reader.record(tree, &SCENE) else { return document };
    if let Some(tree) = fields.get("meshes") {
        let list = reader.list(tree, "meshes");
        if list.is_empty() && matches!(tree.kind, Kind::List(_)) {
            reader.error(&tree.range, "a scene needs a mesh", "write `meshes: [\"mesh.obj\"]`");
        }
        document.objects = list.iter().filter_map(|tree| read_object(reader, tree)).collect();
    }
    document.camera = fields.get("camera").and_then(|tree| read_camera(reader, tree));
    if let Some(tree) = fields.get("lights") {
        let (lights, sun) = read_lights(reader, tree);
        (document.lights, document.sun) = (Some(lights), sun);
    }
    document.sky = fields.get("sky").and_then(|tree| read_sky(reader, tree));
    if let Some(tree) = fields.get("materials") {
        let entries = reader.map(tree, "materials");
        document.materials = entries.into_iter().filter_map(|(name, tree)| read_material(reader, name, tree)).collect();
    }
    document
}

/// Which of the wanted names a value of the form `NAME(…)` has; if none, that is reported.
pub(super) fn named(reader: &mut Reader, tree: &Tree, wanted: &[&'static str], help: &str) -> Option<&'static str> {
    let forms = wanted.iter().map(|name| format!("`{name}(…)`")).collect::<Vec<_>>().join(" or ");
    let (Kind::Record(Some(name), _) | Kind::Tuple(Some(name), _)) = &tree.kind else {
        reader.expected(tree, &forms, help);
        return None;
    };
    let found = wanted.iter().find(|known| **known == name.text);
    if found.is_none() {
        let known = suggest(&name.text, wanted.iter().copied());
        reader.error(&name.range, format!("expected {forms}, found `{}(…)`", name.text), known);
    }
    found.copied()
}

fn read_camera(reader: &mut Reader, tree: &Tree) -> Option<Track<CameraPose>> {
    let fields = reader.record(tree, &CAMERA)?;
    let none = CameraPose { origin: Vec3::ZERO, target: Vec3::NEG_Z, up: Vec3::Y, fov_x_deg: DEFAULT_FOV_X_DEG };
    let complete = fields.get("origin").is_some() && fields.get("target").is_some();
    let rest = read_camera_pose(reader, tree, &fields, &none, complete);
    let motion = read_motion(reader, &fields, |reader, tree| {
        let fields = reader.record(tree, &CAMERA_KEY)?;
        Some(read_camera_pose(reader, tree, &fields, &rest, complete))
    });
    Some(motion.and_then(|keys| keys.track(|pose| pose)).unwrap_or_else(|| Track::fixed(rest)))
}

/// The camera of a record; what is missing is taken from `rest`.
fn read_camera_pose(reader: &mut Reader, tree: &Tree, fields: &Fields<'_>, rest: &CameraPose, complete: bool) -> CameraPose {
    let before = reader.out.len();
    let read = |name: &str, reader: &mut Reader| fields.get(name).and_then(|tree| point(reader, tree));
    let origin = read("origin", reader).unwrap_or(rest.origin);
    let target = read("target", reader).unwrap_or(rest.target);
    let up = fields.get("up").and_then(|tree| vector(reader, tree)).unwrap_or(rest.up);
    let fov = fields.get("fov_x_deg").and_then(|tree| {
        checked(reader, tree, |fov| (fov <= 0.0 || fov >= 180.0).then_some("a field of view is between 0 and 180 degrees, without these"))
    });
    if reader.out.len() == before && complete {
        let forward = target.as_dvec3() - origin.as_dvec3();
        let sine = forward.normalize_or_zero().cross(up.as_dvec3().normalize_or_zero()).length();
        if origin == target {
            reader.error(&head(tree), "the camera is on its target", "origin and target must differ");
        } else if sine < 1e-6 {
            let help = "`up` must not be along the line of sight";
            reader.error(&fields.get("up").map_or(head(tree), |tree| tree.range.clone()), "the camera looks along `up`", help);
        }
    }
    CameraPose { origin, target, up, fov_x_deg: fov.unwrap_or(rest.fov_x_deg) }
}

fn read_material(reader: &mut Reader, name: Spanned, tree: &Tree) -> Option<MaterialEntry> {
    let fields = reader.record(tree, &MATERIAL)?;
    let diffuse = fields.get("diffuse").and_then(|tree| albedo(reader, tree));
    let specular = fields.get("specular").and_then(|tree| albedo(reader, tree));
    let shininess = fields.get("shininess").and_then(|tree| checked(reader, tree, |n| (n < 0.0).then_some("an exponent is at least 0")));
    let texture = fields.get("texture").and_then(|tree| reader.text(tree, "a file"));
    if [diffuse, specular].iter().all(Option::is_none) && shininess.is_none() && texture.is_none() && matches!(&tree.kind, Kind::Tuple(..))
    {
        let span = name.span.clone();
        reader.out.push(Diagnostic::warning(format!("nothing of `{}` is changed", name.text), span).help("give `diffuse`, `specular`, …"));
    }
    Some(MaterialEntry { name, diffuse, specular, shininess, texture })
}
