//! PNG: 8 bits a channel, values for the display.

use std::path::Path;

use image::{ColorType, ImageEncoder, ImageReader, codecs::png::PngEncoder};

use super::{FileError, Picture, Tone, write_whole};

/// Reads a PNG as RGB display values of 0 to 1.
pub fn read_png(path: &Path) -> Result<Picture, FileError> {
    let image = ImageReader::open(path)
        .map_err(|e| FileError::read(path, e))?
        .decode()
        .map_err(|e| FileError::read(path, format!("not a PNG file that can be used ({e})")))?;
    // 16-bit files keep their precision.
    let rgb = image.into_rgb32f();
    let mut picture = Picture::linear(rgb.width() as usize, rgb.height() as usize, 3, rgb.into_raw());
    picture.tone = Tone::Display;
    Ok(picture)
}

/// Writes 8-bit samples of 1 (grey), 3 (RGB) or 4 (RGBA) channels.
pub fn write_png(path: &Path, width: usize, height: usize, channels: usize, samples: &[u8]) -> Result<(), FileError> {
    let color = match channels {
        1 => ColorType::L8,
        3 => ColorType::Rgb8,
        _ => ColorType::Rgba8,
    };
    write_whole(path, |w| {
        PngEncoder::new(w)
            .write_image(samples, width as u32, height as u32, color.into())
            .map_err(|e| FileError::write(path, &std::io::Error::other(e.to_string())))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_come_back() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("x.png");
        write_png(&path, 2, 1, 3, &[0, 51, 255, 1, 2, 3]).expect("writable");
        let back = read_png(&path).expect("readable");
        assert_eq!((back.width, back.height, back.tone), (2, 1, Tone::Display));
        let bytes: Vec<u8> = back.data.iter().map(|v| (v * 255.0).round() as u8).collect();
        assert_eq!(bytes, [0, 51, 255, 1, 2, 3]);
    }

    #[test]
    fn what_is_no_png_is_an_error() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("x.png");
        std::fs::write(&path, b"\x89PNG\r\n").expect("writable");
        assert!(matches!(read_png(&path), Err(FileError::Read { .. })));
    }
}
