//! `manylight compare`: error of an image against a reference.

use std::path::Path;

use manylight::{
    fault::Fault,
    files::{Picture, read_picture},
    metrics::{Metrics, compare},
};

use crate::cli::{CompareArgs, TextOrJson};

/// Reads both pictures, compares them and prints the numbers.
pub fn run(args: &CompareArgs) -> Result<(), Fault> {
    let image = read_layer(&args.image, args.layer.as_deref())?;
    let reference = read_layer(&args.reference, args.reference_layer.as_deref())?;
    let metrics = compare(&image, &reference).map_err(|e| Fault::Input(e.to_string()))?;
    match args.format {
        TextOrJson::Json => super::print(&format!("{:#}\n", metrics.to_json())),
        TextOrJson::Text => super::print(&text(&metrics)),
    }
}

fn read_layer(path: &Path, layer: Option<&str>) -> Result<Picture, Fault> {
    let picture = read_picture(path).map_err(|e| Fault::Input(e.to_string()))?;
    let wanted = layer.unwrap_or("");
    picture.layer(wanted).ok_or_else(|| {
        let named: Vec<String> = picture.layers().into_iter().filter(|l| !l.is_empty()).collect();
        let what = if wanted.is_empty() { "no plain channels".to_owned() } else { format!("no layer `{wanted}`") };
        let has = if named.is_empty() { format!("the channels {}", picture.names.join(", ")) } else { format!("the layers {}", named.join(", ")) };
        Fault::Input(format!("`{}` has {what}, but {has}", path.display()))
    })
}

fn text(metrics: &Metrics) -> String {
    let ratio = |value: Option<f64>| value.map_or("undefined (the mean of the reference is 0)".to_owned(), |v| format!("{:.3} %", v * 100.0));
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
    lines.push(("not finite", if excluded == 0 {
        "none".to_owned()
    } else {
        format!("{excluded} pixels left out ({} of the image, {} of the reference)", metrics.non_finite_image, metrics.non_finite_reference)
    }));
    lines.iter().map(|(name, value)| format!("{name:<24}{value}\n")).collect()
}
