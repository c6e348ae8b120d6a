//! Picture files with changed bytes.

use std::{fs, time::Duration};

use manylight::files::{Picture, read_picture, write_exr, write_png};

use super::mutate::fuzz;
use crate::support::Random;

#[test]
fn damaged_pictures_are_read_or_refused_with_a_reason() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let (exr, png) = (folder.path().join("x.exr"), folder.path().join("x.png"));
    let data: Vec<f32> = (0..3 * 40 * 20).map(|i| i as f32 / 64.0).collect();
    write_exr(&exr, &Picture::linear(40, 20, 3, data)).expect("writable");
    let samples: Vec<u8> = (0..3 * 40 * 20).map(|i| (i * 7 % 256) as u8).collect();
    write_png(&png, 40, 20, 3, &samples).expect("writable");
    let good = [exr, png].map(|file| (fs::read(&file).expect("readable"), file));
    fuzz("pictures", 1500, Duration::from_secs(20), move |random: &mut Random| {
        let _folder = &folder;
        let (bytes, file) = random.of(&good);
        let mut bytes = bytes.clone();
        for _ in 0..1 + random.below(4) {
            // Most of what can be wrong is at the beginning.
            let most = if random.below(3) > 0 { 400.min(bytes.len()) } else { bytes.len() };
            let at = random.below(most.max(1));
            match random.below(4) {
                0 => bytes.truncate(at.max(1)),
                1 => bytes[at] = *random.of(&[0, 1, 0x7f, 0x80, 0xff]),
                2 => bytes[at] ^= 1 << random.below(8),
                _ => drop(bytes.splice(at..(at + 4).min(bytes.len()), [0xff, 0xff, 0xff, 0x7f])),
            }
        }
        fs::write(file, &bytes).expect("writable");
        match read_picture(file) {
            Ok(picture) => assert_eq!(picture.data.len(), picture.width * picture.height * picture.channels()),
            Err(fault) => assert!(fault.to_string().contains("cannot read")),
        }
    });
}
