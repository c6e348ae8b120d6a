//! The same input gives the same bits, and no debug switch changes the picture.

use manylight_graph::plan::Debug;

use crate::renders::{Job, read};

fn radiance(debug: Debug) -> Vec<u32> {
    let job = Job { debug, ..Job::asset("moving").small() };
    let mut renderer = job.renderer();
    for frame in 0..4 {
        renderer.render_frame(f64::from(frame) * 0.5).unwrap_or_else(|e| panic!("{e}"));
    }
    read(&renderer, "composed").data.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn two_renders_have_the_same_bits() {
    let first = radiance(Debug::default());
    assert!(first.iter().any(|&bits| bits != 0), "the picture is black");
    assert_eq!(first, radiance(Debug::default()));
}

#[test]
fn debug_switches_leave_the_picture_as_it_is() {
    let plain = radiance(Debug::default());
    let switches = [
        ("no culling", Debug { no_culling: true, ..Debug::default() }),
        ("no reuse", Debug { no_reuse: true, ..Debug::default() }),
        ("poison", Debug { poison: true, ..Debug::default() }),
        ("shuffle 1", Debug { shuffle: Some(1), ..Debug::default() }),
        ("shuffle 2", Debug { shuffle: Some(2), ..Debug::default() }),
        ("watched numbers", Debug { watch_numbers: true, ..Debug::default() }),
        ("all", Debug { no_culling: true, no_reuse: true, poison: true, watch_numbers: true, shuffle: Some(3) }),
    ];
    for (name, debug) in switches {
        assert!(plain == radiance(debug), "{name} changes the picture");
    }
}
