//! OpenEXR: 32-bit float channels, ZIP-compressed scan lines; any channel names when reading.

use std::{fs::File, io::BufReader, path::Path};

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, WritableImage, read,
};

use super::{FileError, Picture, Tone, write_whole};

/// Reads the first layer of an EXR file with all its channels, in the order of the file (by name).
pub fn read_exr(path: &Path) -> Result<Picture, FileError> {
    let file = File::open(path).map_err(|e| FileError::read(path, e))?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(BufReader::new(file))
        .map_err(|e| FileError::read(path, format!("not an EXR file that can be used ({e})")))?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.width(), layer.size.height());
    let list = layer.channel_data.list;
    let channels = list.len();
    let mut data = vec![0.0; width * height * channels];
    for (c, channel) in list.iter().enumerate() {
        if channel.sample_data.len() != width * height {
            return Err(FileError::read(path, format!("channel `{}` is subsampled, which is not supported", channel.name)));
        }
        for (pixel, value) in channel.sample_data.values_as_f32().enumerate() {
            data[pixel * channels + c] = value;
        }
    }
    Ok(Picture { width, height, names: list.iter().map(|c| c.name.to_string()).collect(), data, tone: Tone::Linear })
}

/// Writes a picture's channels under their names as 32-bit floats.
pub fn write_exr(path: &Path, picture: &Picture) -> Result<(), FileError> {
    let channels = picture.channels();
    let list = picture
        .names
        .iter()
        .enumerate()
        .map(|(c, name)| {
            let plane: Vec<f32> = picture.data.iter().skip(c).step_by(channels).copied().collect();
            AnyChannel::new(name.as_str(), FlatSamples::F32(plane))
        })
        .collect();
    let layer = Layer::new((picture.width, picture.height), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, AnyChannels::sort(list));
    let image = Image::from_layer(layer);
    write_whole(path, |w| image.write().to_buffered(w).map_err(|e| FileError::write(path, &std::io::Error::other(e.to_string()))))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_come_back_bit_for_bit() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("x.exr");
        let data: Vec<f32> = (0..5 * 3 * 3).map(|i| (i as f32).sin() * 1e6).chain([]).collect();
        let picture = Picture::linear(5, 3, 3, data);
        write_exr(&path, &picture).expect("writable");
        let back = read_exr(&path).expect("readable").layer("").expect("plain channels");
        assert_eq!(back, picture);
    }

    #[test]
    fn single_channels_and_non_finite_values_survive() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("y.exr");
        write_exr(&path, &Picture::linear(2, 1, 1, vec![f32::INFINITY, f32::NAN])).expect("writable");
        let back = read_exr(&path).expect("readable");
        assert_eq!(back.names, ["Y"]);
        assert!(back.data[0].is_infinite() && back.data[1].is_nan());
    }

    #[test]
    fn what_is_no_exr_is_an_error_and_not_a_panic() {
        let folder = tempfile::tempdir().expect("temporary folder");
        for (name, bytes) in [("empty.exr", &b""[..]), ("text.exr", &b"hello"[..]), ("cut.exr", &b"v/1\x01\x02\x00\x00\x00chann"[..])] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("writable");
            assert!(matches!(read_exr(&path), Err(FileError::Read { .. })), "{name}");
        }
    }
}
