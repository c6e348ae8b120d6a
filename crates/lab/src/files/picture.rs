//! A picture in memory: named channels of 32-bit floats.

use manylight_gpu::Image;

/// What the numbers of a picture mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// Linear values: radiance, albedo, distances.
    Linear,
    /// Values for the display, sRGB-encoded, 0 to 1.
    Display,
}

/// Pixels of named channels, interleaved, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Names of the channels in the order of the data: `R`, `G`, `B`, `A`, `Y`, or layered ones such as `albedo.R`.
    pub names: Vec<String>,
    /// `width * height * names.len()` values.
    pub data: Vec<f32>,
    /// What they mean.
    pub tone: Tone,
}

impl Picture {
    /// A linear picture of 1 to 4 channels under their usual names: `Y`, `R G`, `R G B` or `R G B A`.
    pub fn linear(width: usize, height: usize, channels: usize, data: Vec<f32>) -> Self {
        let names: &[&str] = match channels {
            1 => &["Y"],
            2 => &["R", "G"],
            3 => &["R", "G", "B"],
            _ => &["R", "G", "B", "A"],
        };
        Self { width, height, names: names.iter().map(|n| (*n).to_owned()).collect(), data, tone: Tone::Linear }
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.names.len()
    }

    /// The layers in the file: the part of the channel names before the last point; "" for channels without one.
    pub fn layers(&self) -> Vec<String> {
        let mut layers: Vec<String> = self.names.iter().map(|n| layer_of(n).0.to_owned()).collect();
        layers.dedup();
        layers.sort();
        layers.dedup();
        layers
    }

    /// The channels of one layer, named without it and in the order R, G, B, A or X, Y, Z. `None` when there are none.
    /// A channel of exactly that name (`distance`) counts as a layer of one channel, named `Y`.
    pub fn layer(&self, layer: &str) -> Option<Self> {
        let mut found: Vec<(usize, String)> = Vec::new();
        for (index, name) in self.names.iter().enumerate() {
            let (own, channel) = layer_of(name);
            if own == layer {
                found.push((index, channel.to_owned()));
            } else if name == layer {
                found.push((index, "Y".to_owned()));
            }
        }
        if found.is_empty() {
            return None;
        }
        found.sort_by_key(|(_, name)| rank(name));
        Some(self.pick(&found))
    }

    /// The same without alpha.
    #[must_use]
    pub fn without_alpha(&self) -> Self {
        let kept: Vec<(usize, String)> = self.names.iter().enumerate().filter(|(_, n)| *n != "A").map(|(i, n)| (i, n.clone())).collect();
        if kept.is_empty() || kept.len() == self.names.len() { self.clone() } else { self.pick(&kept) }
    }

    fn pick(&self, channels: &[(usize, String)]) -> Self {
        let all = self.names.len();
        let data = self.data.chunks_exact(all).flat_map(|pixel| channels.iter().map(|(i, _)| pixel[*i])).collect();
        Self { width: self.width, height: self.height, names: channels.iter().map(|(_, n)| n.clone()).collect(), data, tone: self.tone }
    }
}

impl From<Image> for Picture {
    /// What was read from the GPU, under the usual names of its channels.
    fn from(image: Image) -> Self {
        Self::linear(image.width as usize, image.height as usize, image.channels as usize, image.data)
    }
}

fn layer_of(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}

fn rank(channel: &str) -> usize {
    ["R", "X", "G", "Y", "B", "Z", "A"].iter().position(|n| *n == channel).unwrap_or(7)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_are_found_in_their_usual_order() {
        let picture = Picture {
            width: 1,
            height: 1,
            names: ["albedo.B", "albedo.G", "albedo.R", "distance", "normal.X", "normal.Y", "normal.Z"].map(str::to_owned).to_vec(),
            data: vec![3.0, 2.0, 1.0, 9.0, 4.0, 5.0, 6.0],
            tone: Tone::Linear,
        };
        assert_eq!(picture.layers(), ["", "albedo", "normal"]);
        let albedo = picture.layer("albedo").expect("a layer");
        assert_eq!((albedo.names.join(""), albedo.data), ("RGB".to_owned(), vec![1.0, 2.0, 3.0]));
        let distance = picture.layer("distance").expect("a channel");
        assert_eq!((distance.names.join(""), distance.data), ("Y".to_owned(), vec![9.0]));
        assert!(picture.layer("nothing").is_none());
    }

    #[test]
    fn alpha_is_left_out() {
        let picture = Picture::linear(1, 2, 4, vec![1.0, 2.0, 3.0, 0.5, 4.0, 5.0, 6.0, 0.5]);
        assert_eq!(picture.without_alpha().data, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    }
}
