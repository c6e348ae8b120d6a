//! `manylight compare`: error of an image against a reference.

use std::path::Path;

use manylight::{
    fault::Fault,
    files::{Picture, read_picture},
    metrics::{CompareError, Metrics, compare},
};

use crate::cli::{CompareArgs, TextOrJson};

/// Reads both pictures, compares them and prints the numbers.
pub fn run(args: &CompareArgs) -> Result<(), Fault> {
    let (image, image_layers) = read_layer(&args.image, args.layer.as_deref())?;
    let (reference, reference_layers) = read_layer(&args.reference, args.reference_layer.as_deref())?;
    let metrics = compare(&image, &reference).map_err(|error| {
        let mut text = error.to_string();
        if matches!(error, CompareError::Channels { .. }) {
            for (what, option, layers) in [("image", "--layer", image_layers), ("reference", "--reference-layer", reference_layers)] {
                if !layers.is_empty() {
                    text.push_str(&format!("; the {what} has the layers {} ({option} NAME)", layers.join(", ")));
                }
            }
        }
        Fault::Input(text)
    })?;
    match args.format {
        TextOrJson::Json => super::print(&format!("{:#}\n", metrics.to_json())),
        TextOrJson::Text => super::print(&text(&metrics)),
    }
}

/// The channels of a layer, and the names of all layers in the file.
fn read_layer(path: &Path, layer: Option<&str>) -> Result<(Picture, Vec<String>), Fault> {
    let picture = read_picture(path).map_err(|e| Fault::Input(e.to_string()))?;
    let layers: Vec<String> = picture.layers().into_iter().filter(|l| !l.is_empty()).collect();
    let wanted = layer.unwrap_or("");
    match picture.layer(wanted) {
        Some(found) => Ok((found, layers)),
        None if wanted.is_empty() => {
            Err(Fault::Input(format!("`{}` has no plain channels, only the layers {}", path.display(), layers.join(", "))))
        }
        None => Err(Fault::Input(format!("`{}` has no layer `{wanted}`; its channels are {}", path.display(), picture.names.join(", ")))),
    }
}

fn text(metrics: &Metrics) -> String {
    let ratio =
        |value: Option<f64>| value.map_or("undefined (the mean of the reference is 0)".to_owned(), |v| format!("{:.3} %", v * 100.0));
    let energy = metrics.energy_ratio().map_or("undefined (the mean of the reference is 0)".to_owned(), |v| format!("{v:.5}"));
    let mut lines = vec![
        ("pixels", format!("{} × {} ({})", metrics.width, metrics.height, metrics.channels.join(", "))),
        ("mean of image", format!("{:.6}", metrics.mean_image)),
        ("mean of reference", format!("{:.6}", metrics.mean_reference)),
        ("RMSE", format!("{:.6}", metrics.rmse)),
        ("RMSE / mean", ratio(metrics.relative_rmse())),
        ("mean absolute error", format!("{:.6}", metrics.mean_absolute_error)),
        ("mean abs. error / mean", ratio(metrics.relative_mean_absolute_error())),
        ("bias", format!("{:+.6}", metrics.bias())),
        ("energy ratio", energy),
        ("largest difference", format!("{:.6}", metrics.max)),
        ("99.9th percentile", format!("{:.6}", metrics.percentile_999)),
    ];
    let excluded = metrics.non_finite_image + metrics.non_finite_reference;
    lines.push((
        "not finite",
        if excluded == 0 {
            "none".to_owned()
        } else {
            format!(
                "{excluded} pixels left out ({} of the image, {} of the reference)",
                metrics.non_finite_image, metrics.non_finite_reference
            )
        },
    ));
    lines.iter().map(|(name, value)| format!("{name:<24}{value}\n")).collect()
}
