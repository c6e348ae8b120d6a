//! Files of baked light whose header was changed and sealed again, as a faulty program would write them.

use std::time::Duration;

use manylight::passes::{
    Baked, SceneSource,
    baked::{CORNERS, Header, Lookup},
};
use sha2::{Digest, Sha256};

use super::mutate::{fuzz, ron};
use crate::support::{Random, root};

/// Before the header: eight bytes, version and length.
const FIXED: usize = 16;
const CHECKSUM: usize = 32;
const LOOKUPS: [Lookup; 3] = [Lookup::Image, Lookup::Cube, Lookup::Atlas];

/// Light of a way of look-up, of the scene `day` if it is in an atlas.
fn good(lookup: Lookup) -> Baked {
    let (width, height, triangles) = match lookup {
        Lookup::Image => (3, 2, 0),
        Lookup::Cube => (24, 16, 0),
        Lookup::Atlas => (3, 2, 2),
    };
    let header = serde_json::json!({
        "scene": "day", "scene_hash": "0123456789abcdef", "lookup": lookup, "triangles": triangles, "width": width, "height": height, "components": 2,
        "keys": [0.0, 21600.0, 64800.0], "period_s": 86400.0, "kept_variance": [0.9, 0.99], "mean_subtracted": true, "dark_keys": 1, "sky_scale": 2.5,
        "paths": 16, "manylight": "0.1.0",
    });
    let header: Header = serde_json::from_value(header).expect("a header");
    let count = header.layers() * header.width * header.height * 4;
    let weights = vec![0.5; header.keys.len() * header.columns()];
    let corners = vec![[2.5, 0.5]; header.corners()];
    Baked { weights, texels: vec![half::f16::from_f32(0.25); count], corners, header }
}

/// A file in parts: what is before the length of its header, the header, and what is after it but for the checksum.
fn parts(lookup: Lookup) -> (Vec<u8>, String, Vec<u8>) {
    let bytes = good(lookup).to_bytes().expect("writable");
    let length = u32::from_le_bytes(bytes[12..FIXED].try_into().expect("four bytes")) as usize;
    let header = String::from_utf8(bytes[FIXED..FIXED + length].to_vec()).expect("JSON");
    (bytes[..12].to_vec(), header, bytes[FIXED + length..bytes.len() - CHECKSUM].to_vec())
}

#[test]
fn sealed_headers_are_used_or_refused_with_a_reason() {
    for lookup in LOOKUPS {
        let baked = good(lookup);
        let bytes = baked.to_bytes().expect("writable");
        assert_eq!(Baked::from_bytes(&bytes), Ok(baked), "unchanged it is read");
    }
    let files = LOOKUPS.map(parts);
    let scene = SceneSource::file(root().join("assets/day.ron")).load().unwrap_or_else(|faults| panic!("{}", faults.render()));
    let state = scene.sample(0.0);
    fuzz("baked", 15_000, Duration::from_secs(10), move |random: &mut Random| {
        let (before, header, rest) = random.of(&files).clone();
        let donor = random.of(&files).1.clone();
        let header = ron(&header, &donor, random);
        let mut file = before;
        file.extend((header.len() as u32).to_le_bytes());
        file.extend(header.as_bytes());
        file.extend(&rest);
        let checksum = Sha256::digest(&file);
        file.extend(checksum);
        match Baked::from_bytes(&file) {
            Err(fault) => assert!(!fault.to_string().is_empty()),
            Ok(baked) => {
                for time in [0.0, -1.0, 3e4, 86_399.9, 1e300, f64::NAN] {
                    let weights = baked.weights_at(time, 1.0);
                    assert_eq!(weights.len(), baked.header.layers());
                    assert!(weights.iter().all(|w| w.is_finite()), "{header}: {weights:?}");
                }
                // It may be of another scene, or of a state of this one with other triangles.
                let corners = baked.corners_at(&scene, &state);
                assert_eq!(corners.len(), CORNERS * scene.room.triangles, "{header}");
            }
        }
    });
}
