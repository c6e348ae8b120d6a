//! Sun and sky of scene files.

use glam::Vec3;
use manylight_graph::ron::{Fields, Kind, Reader, Shape, Tree, head};

use super::{
    document::named,
    values::{checked, strength},
};
use crate::sky::{Sky, Sun};

const SUN: Shape = Shape {
    what: "a sun",
    required: &["latitude_deg", "irradiance"],
    optional: &["declination_deg", "day", "north_deg", "fade_deg", "twilight_deg"],
};
const SKY: Shape = Shape { what: "a sky", required: &["zenith", "horizon"], optional: &["ground", "exponent"] };

/// The sun near the horizon loses most of its light below this elevation.
const FADE_DEG: f32 = 8.0;
/// Civil twilight.
const TWILIGHT_DEG: f32 = 6.0;

/// A sun; faults go to the reader.
pub(super) fn read_sun(reader: &mut Reader, tree: &Tree) -> Option<Sun> {
    let fields = reader.record(tree, &SUN)?;
    let before = reader.out.len();
    let latitude_deg = number(reader, &fields, "latitude_deg", 0.0, -90.0..=90.0, "a latitude lies between -90 and 90 degrees");
    let declination = number(reader, &fields, "declination_deg", 0.0, -90.0..=90.0, "on Earth it lies between -23.44 and 23.44 degrees");
    let day = number(reader, &fields, "day", 1.0, 1.0..=366.0, "a day of the year, 1 to 366");
    let declination_deg = match (fields.get("declination_deg"), fields.get("day")) {
        (Some(_), None) => declination,
        (None, Some(_)) => Sun::declination_of_day_deg(day),
        _ => {
            reader.error(&head(tree), "a sun has either `declination_deg` or `day`", "write `day: 172.0` for midsummer in the north");
            0.0
        }
    };
    let north_deg = number(reader, &fields, "north_deg", 0.0, -360.0..=360.0, "a full turn at most");
    let fade_deg = number(reader, &fields, "fade_deg", FADE_DEG, 1e-3..=90.0, "above 0, at most 90 degrees");
    let twilight_deg = number(reader, &fields, "twilight_deg", TWILIGHT_DEG, 0.0..=90.0, "at least 0, at most 90 degrees");
    let irradiance = fields.get("irradiance").and_then(|tree| strength(reader, tree))?;
    (reader.out.len() == before).then_some(Sun { latitude_deg, declination_deg, north_deg, irradiance, fade_deg, twilight_deg })
}

/// A number of a record within a range, or its default.
fn number(
    reader: &mut Reader,
    fields: &Fields<'_>,
    name: &str,
    default: f32,
    range: std::ops::RangeInclusive<f32>,
    help: &'static str,
) -> f64 {
    let read = fields.get(name).and_then(|tree| checked(reader, tree, |value| (!range.contains(&value)).then_some(help)));
    f64::from(read.unwrap_or(default))
}

/// A sky: one radiance, or `Sky(…)`; faults go to the reader.
pub(super) fn read_sky(reader: &mut Reader, tree: &Tree) -> Option<Sky> {
    if !matches!(&tree.kind, Kind::Record(..)) {
        return strength(reader, tree).map(Sky::uniform);
    }
    named(reader, tree, &["Sky"], "a sky is a radiance in W/(m² sr), or `Sky(zenith: …, horizon: …)`")?;
    let fields = reader.record(tree, &SKY)?;
    let mut radiance = |name: &str| fields.get(name).map(|tree| strength(reader, tree));
    let (zenith, horizon, ground) = (radiance("zenith"), radiance("horizon"), radiance("ground"));
    let exponent = number(reader, &fields, "exponent", 1.0, 0.01..=100.0, "between 0.01 and 100");
    Some(Sky { zenith: zenith??, horizon: horizon??, ground: ground.unwrap_or(Some(Vec3::ZERO))?, exponent: exponent as f32 })
}
