//! Files of baked light whose header was changed and sealed again, as a faulty program would write them.

use std::time::Duration;

use manylight::passes::{Baked, baked::Header};
use sha2::{Digest, Sha256};

use super::mutate::{Random, fuzz, ron};

/// Before the header: eight bytes, version and length.
const FIXED: usize = 16;
const CHECKSUM: usize = 32;

fn good() -> Baked {
    let header = serde_json::json!({
        "scene": "day", "scene_hash": "0123456789abcdef", "lookup": "image", "triangles": 0, "width": 3, "height": 2, "components": 2, "keys": [0.0, 21600.0, 64800.0],
        "period_s": 86400.0, "kept_variance": [0.9, 0.99], "mean_subtracted": true, "dark_keys": 1, "sky_scale": 2.5, "paths": 16, "manylight": "0.1.0",
    });
    let header: Header = serde_json::from_value(header).expect("a header");
    let count = header.layers() * header.width * header.height * 4;
    let weights = vec![0.5; header.keys.len() * header.columns()];
    Baked { weights, texels: vec![half::f16::from_f32(0.25); count], corners: Vec::new(), header }
}

#[test]
fn sealed_headers_are_used_or_refused_with_a_reason() {
    let bytes = good().to_bytes().expect("writable");
    let length = u32::from_le_bytes(bytes[12..FIXED].try_into().expect("four bytes")) as usize;
    let header = String::from_utf8(bytes[FIXED..FIXED + length].to_vec()).expect("JSON");
    let rest = bytes[FIXED + length..bytes.len() - CHECKSUM].to_vec();
    fuzz("baked", 5000, Duration::from_secs(10), move |random: &mut Random| {
        let header = ron(&header, &header, random);
        let mut file = bytes[..12].to_vec();
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
            }
        }
    });
}
