//! The sun over a day, and the light of the sky.

use glam::{DVec3, Vec3};
use manylight_scene::sky::{DAY_S, Sky, Sun};

use crate::memory::{load, ron, summary};

const NOON: f64 = 0.5 * DAY_S;

fn sun(latitude_deg: f64, declination_deg: f64) -> Sun {
    Sun { latitude_deg, declination_deg, north_deg: 0.0, irradiance: Vec3::splat(2.0), fade_deg: 8.0, twilight_deg: 6.0 }
}

#[track_caller]
fn assert_near(actual: DVec3, expected: DVec3) {
    assert!(actual.distance(expected) < 1e-9, "{actual} is not {expected}");
}

#[test]
fn the_sun_is_where_astronomy_has_it() {
    // At an equinox it rises in the east (+x), culminates in the south (+z) at 90° less the latitude, and sets in the west.
    let spring = sun(50.0, 0.0);
    assert_near(spring.to_sun(0.25 * DAY_S), DVec3::X);
    assert_near(spring.to_sun(0.75 * DAY_S), DVec3::NEG_X);
    let (sin, cos) = 40.0_f64.to_radians().sin_cos();
    assert_near(spring.to_sun(NOON), DVec3::new(0.0, sin, cos));
    // Elevation at noon is 90° − latitude + declination, at midnight latitude + declination − 90°.
    let summer = sun(50.0, 23.44);
    assert!((summer.elevation_deg(NOON) - 63.44).abs() < 1e-9);
    assert!((summer.elevation_deg(0.0) + 16.56).abs() < 1e-9);
    // South of the equator it culminates in the north (−z).
    assert!(sun(-50.0, 0.0).to_sun(NOON).z < 0.0);
    // Turned by 90° about +y, south (+z) is east as it was (+x).
    assert_near(Sun { north_deg: 90.0, ..spring }.to_sun(NOON), DVec3::new(cos, sin, 0.0));
}

#[test]
fn every_day_is_the_same_and_odd_times_have_a_sun() {
    let sun = sun(57.0, 11.0);
    assert_near(sun.to_sun(1234.0), sun.to_sun(1234.0 + 3.0 * DAY_S));
    assert_near(sun.to_sun(-1234.0), sun.to_sun(DAY_S - 1234.0));
    for time in [f64::NAN, f64::INFINITY, 1e300] {
        assert!(sun.to_sun(time).is_finite() && sun.daylight(time).is_finite());
    }
}

#[test]
fn light_fades_at_the_horizon_and_the_sky_after_it() {
    let sun = sun(0.0, 0.0);
    // On the equator at an equinox the sun climbs 15° an hour.
    let at = |elevation: f64| 0.25 * DAY_S + elevation / 15.0 * 3600.0;
    let strength = |elevation: f64| sun.pose(at(elevation)).strength.x;
    assert_eq!((strength(-0.1), strength(8.1), strength(60.0)), (0.0, 2.0, 2.0));
    assert!((strength(4.0) - 1.0).abs() < 1e-5, "half way of a smooth step");
    assert_eq!((sun.daylight(at(-6.1)), sun.daylight(at(8.1))), (0.0, 1.0));
    assert!((sun.daylight(at(1.0)) - 0.5).abs() < 1e-9);
}

#[test]
fn days_have_their_declination() {
    // Solstices and equinoxes: 21 June, 21 December, 22 March.
    for (day, expected) in [(172.0, 23.44), (355.0, -23.44), (81.0, 0.0)] {
        assert!((Sun::declination_of_day_deg(day) - expected).abs() < 0.5, "{day}");
    }
}

const LIGHTS: &str = "Point(position: (0, 1, 0), intensity: 1), Sun(latitude_deg: 50, declination_deg: 0, irradiance: (1, 2, 3))";

#[test]
fn a_scene_has_sun_and_sky() {
    let sky = "Sky(zenith: (0.1, 0.2, 0.3), horizon: 2, exponent: 0.5)";
    let scene = ron(&format!("Scene(meshes: [\"tri.obj\"], lights: [{LIGHTS}], sky: {sky})")).unwrap();
    assert!(scene.features()["moving_lights"] && scene.sun.is_some_and(|sun| sun.light == 1));
    assert_eq!(scene.sky, Sky { zenith: Vec3::new(0.1, 0.2, 0.3), horizon: Vec3::splat(2.0), ground: Vec3::ZERO, exponent: 0.5 });
    let noon = scene.sample(NOON);
    assert_eq!((noon.lights[1].strength, noon.sky.daylight, noon.sky.is_lit), (Vec3::new(1.0, 2.0, 3.0), 1.0, 1));
    assert!(noon.lights[1].direction.y < -0.5);
    assert_eq!(noon.sky.zenith, scene.sky.zenith);
    let night = scene.sample(0.0);
    assert_eq!((night.lights[1].strength, night.sky.is_lit, night.sky.horizon), (Vec3::ZERO, 0, Vec3::ZERO));
    // Other lights are as they were.
    assert_eq!(night.lights[0].strength, Vec3::ONE);
}

#[test]
fn without_a_sun_the_sky_is_as_it_is_and_without_a_sky_black() {
    let scene = ron("Scene(meshes: [\"tri.obj\"], lights: [], sky: 0.5)").unwrap();
    assert_eq!((scene.sky, scene.sample(0.0).sky.daylight), (Sky::uniform(Vec3::splat(0.5)), 1.0));
    assert!(!summary(&scene.warnings).iter().any(|text| text.contains("black")), "a sky is light enough");
    let scene = ron("Scene(meshes: [\"tri.obj\"], lights: [])").unwrap();
    assert!(scene.sky.is_black() && scene.sample(0.0).sky.is_lit == 0);
}

#[test]
fn faults_of_sun_and_sky_are_told() {
    let scene = |rest: &str| format!("Scene(meshes: [\"tri.obj\"], {rest})");
    let sun = |rest: &str| scene(&format!("lights: [Sun(latitude_deg: 50, irradiance: 1, {rest})]"));
    for (text, words) in [
        (sun("north_deg: 0"), "either `declination_deg` or `day`"),
        (sun("day: 100, declination_deg: 3"), "either `declination_deg` or `day`"),
        (sun("day: 400"), "out of range"),
        (sun("day: 100, fade_deg: 0"), "out of range"),
        (sun("day: 100, sunrise: 6"), "unknown field `sunrise`"),
        (scene("lights: [Sun()]"), "a sun"),
        (scene(&format!("lights: [{LIGHTS}, Sun(latitude_deg: 1, day: 1, irradiance: 1)]")), "at most one sun"),
        (scene("sky: -1"), "light is not negative"),
        (scene("sky: Sky(zenith: 1)"), "missing field `horizon`"),
        (scene("sky: Cloud(zenith: 1)"), "`Sky(…)`"),
    ] {
        let faults = load("s.ron", &[("s.ron", text.as_str()), ("tri.obj", crate::memory::TRIANGLE)]).expect_err(&text);
        assert!(faults.render().contains(words), "{text}:\n{}", faults.render());
    }
}
