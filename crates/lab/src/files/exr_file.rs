//! OpenEXR: 32-bit float channels, ZIP-compressed scan lines; any channel names when reading.

use std::{
    fs::File,
    io::{BufReader, Seek},
    path::Path,
};

use exr::{
    meta::MetaData,
    prelude::{
        AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, ReadChannels, ReadLayers, WritableImage, read,
    },
};

use super::{FileError, Picture, Tone, write_whole};

/// No picture is larger, in pixels a side.
const MOST_SIDE: usize = 1 << 16;

/// Reads the first layer of an EXR file with all its channels, in the order of the file (by name).
pub fn read_exr(path: &Path) -> Result<Picture, FileError> {
    let not_usable = |e: exr::error::Error| FileError::read(path, format!("not an EXR file that can be used ({e})"));
    let mut file = BufReader::new(File::open(path).map_err(|e| FileError::read(path, e))?);
    check_size(&MetaData::read_from_buffered(&mut file, false).map_err(not_usable)?).map_err(|reason| FileError::read(path, reason))?;
    file.rewind().map_err(|e| FileError::read(path, e))?;
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(file)
        .map_err(not_usable)?;
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

/// Refuses what does not fit into memory, before it is asked for in earnest: a damaged file may claim any size.
fn check_size(meta: &MetaData) -> Result<(), String> {
    for header in &meta.headers {
        let (width, height, channels) = (header.layer_size.width(), header.layer_size.height(), header.channels.list.len());
        let numbers = width.checked_mul(height).and_then(|n| n.checked_mul(channels));
        // As read, and as returned.
        let fits = numbers.and_then(|n| n.checked_mul(2)).is_some_and(|n| Vec::<f32>::new().try_reserve_exact(n).is_ok());
        if !fits || width > MOST_SIDE || height > MOST_SIDE {
            return Err(format!("it says that it has {width}×{height} pixels of {channels} channels, which do not fit into memory"));
        }
    }
    Ok(())
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

    /// The process ended when memory for such a picture was asked for.
    #[test]
    fn a_damaged_size_is_an_error() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("x.exr");
        write_exr(&path, &Picture::linear(40, 20, 3, vec![0.5; 40 * 20 * 3])).expect("writable");
        let bytes = std::fs::read(&path).expect("readable");
        let name = b"dataWindow\0box2i\0";
        let window = bytes.windows(name.len()).position(|part| part == name).expect("a header") + name.len() + 4;
        for (place, side) in [(8, 0x0fff_ffff_u32), (8, 0x7fff_ffff), (12, 0x00ff_ffff), (8, 70_000)] {
            let mut damaged = bytes.clone();
            damaged[window + place..window + place + 4].copy_from_slice(&side.to_le_bytes());
            std::fs::write(&path, damaged).expect("writable");
            let error = read_exr(&path).expect_err("damaged").to_string();
            assert!(error.contains("x.exr") && error.contains("cannot read"), "{error}");
        }
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
