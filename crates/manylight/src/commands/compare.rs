//! `manylight compare`: error of an image against a reference.

use std::path::{Path, PathBuf};

use manylight::{
    fault::Fault,
    files::{FileKind, Picture, read_picture, write_exr, write_png},
    metrics::{
        CompareError, Condition, ErrorMap, ErrorMapKind, Estimate, KNOWN, Known, Mask, Metrics, ZTest, compare, compare_over, error_map,
        z_test,
    },
};
use serde_json::json;

use super::of_file;
use crate::cli::{CompareArgs, ErrorMapArg, ErrorMapArgs, MaskArgs, NoiseArgs, TextOrJson};

/// Reads both pictures, compares them, writes the error map and prints the numbers.
pub fn run(args: &CompareArgs) -> Result<(), Fault> {
    check_output(&args.map)?;
    let (image, image_layers) = read_layer(&args.image, args.layer.as_deref())?;
    let (reference, reference_layers) = read_layer(&args.reference, args.reference_layer.as_deref())?;
    let mask = mask(&args.mask)?;
    let fault = |error: CompareError| {
        let mut text = format!("`{}` against `{}`: {error}", args.image.display(), args.reference.display());
        if matches!(error, CompareError::Channels { .. }) {
            for (what, option, layers) in [("image", "--layer", &image_layers), ("reference", "--reference-layer", &reference_layers)] {
                if !layers.is_empty() {
                    text.push_str(&format!("; the {what} has the layers {} ({option} NAME)", layers.join(", ")));
                }
            }
        }
        Fault::Input(text)
    };
    let metrics = match &mask {
        Some(mask) => compare_over(&image, &reference, mask),
        None => compare(&image, &reference),
    };
    let metrics = metrics.map_err(fault)?;
    let test = noise(&args.noise, &image, &reference, mask.as_ref(), fault)?;
    let map = match &args.map.error_map {
        Some(file) => {
            let kind = kind(args.map.error_map_kind);
            let map = error_map(kind, &image, &reference, mask.as_ref(), args.map.error_map_range).map_err(fault)?;
            write(file, &map)?;
            Some((file.as_path(), map))
        }
        None => None,
    };
    match args.format {
        TextOrJson::Json => super::print(&format!("{:#}\n", json(&metrics, test.as_ref(), map.as_ref()))),
        TextOrJson::Text => super::print(&text(&metrics, test.as_ref(), map.as_ref())),
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

fn mask(args: &MaskArgs) -> Result<Option<Mask>, Fault> {
    let condition = args.mask_above.map(Condition::Above).or(args.mask_below.map(Condition::Below));
    let (Some(file), Some(condition)) = (&args.mask, condition) else { return Ok(None) };
    let (picture, _) = read_layer(file, args.mask_layer.as_deref())?;
    Ok(Some(Mask::new(&picture, condition)))
}

/// The test against noise, if some is known.
fn noise(
    args: &NoiseArgs,
    image: &Picture,
    reference: &Picture,
    mask: Option<&Mask>,
    fault: impl Fn(CompareError) -> Fault,
) -> Result<Option<ZTest>, Fault> {
    let read = |file: &Option<PathBuf>, batches: Option<u32>, option: &str| -> Result<Option<Picture>, Fault> {
        let Some(file) = file else { return Ok(None) };
        let (errors, _) = read_layer(file, None)?;
        if batches.is_none() && !errors.names.iter().any(|n| n == "A") {
            let file = file.display();
            super::note(&format!("note: `{file}` has no alpha channel with its number of batches and counts as exact; {option} N says it"));
        }
        Ok(Some(errors))
    };
    let of_image = read(&args.standard_error, args.batches, "--batches")?;
    let of_reference = read(&args.reference_standard_error, args.reference_batches, "--reference-batches")?;
    if of_image.is_none() && of_reference.is_none() {
        return Ok(None);
    }
    let image = Estimate { picture: image, standard_error: of_image.as_ref(), batches: args.batches };
    let reference = Estimate { picture: reference, standard_error: of_reference.as_ref(), batches: args.reference_batches };
    z_test(image, reference, mask).map(Some).map_err(fault)
}

fn kind(arg: Option<ErrorMapArg>) -> ErrorMapKind {
    match arg {
        None | Some(ErrorMapArg::Difference) => ErrorMapKind::Difference,
        Some(ErrorMapArg::Absolute) => ErrorMapKind::Absolute,
        Some(ErrorMapArg::Relative) => ErrorMapKind::Relative,
        Some(ErrorMapArg::Flip) => ErrorMapKind::Flip,
    }
}

/// Refuses, before any work, what cannot be written.
fn check_output(args: &ErrorMapArgs) -> Result<(), Fault> {
    let Some(file) = &args.error_map else { return Ok(()) };
    super::writable(file)?;
    if FileKind::of(file).map_err(of_file)? == FileKind::Json {
        return Err(Fault::Usage(format!("`{}`: --error-map writes .png or .exr", file.display())));
    }
    Ok(())
}

fn write(file: &Path, map: &ErrorMap) -> Result<(), Fault> {
    match FileKind::of(file).map_err(of_file)? {
        FileKind::Exr => write_exr(file, &map.picture),
        _ => write_png(file, map.picture.width, map.picture.height, 3, &map.rgb),
    }
    .map_err(of_file)
}

fn json(metrics: &Metrics, test: Option<&ZTest>, map: Option<&(&Path, ErrorMap)>) -> serde_json::Value {
    let mut json = metrics.to_json();
    if let Some(test) = test {
        json["z_test"] = test.to_json();
    }
    if let Some((file, map)) = map {
        json["error_map"] = json!({"file": file, "range": map.range, "legend": map.legend()});
    }
    json
}

fn text(metrics: &Metrics, test: Option<&ZTest>, map: Option<&(&Path, ErrorMap)>) -> String {
    let mut lines = vec![
        ("pixels", format!("{} × {} ({})", metrics.width, metrics.height, metrics.channels.join(", "))),
        ("mean of image", format!("{:.6}", metrics.mean_image)),
        ("mean of reference", format!("{:.6}", metrics.mean_reference)),
    ];
    lines.extend(KNOWN.iter().filter(|known| known.of_two_pictures()).map(|known| (known.title, value(known, metrics))));
    let excluded = metrics.non_finite_image + metrics.non_finite_reference;
    let not_finite = match excluded {
        0 => "none".to_owned(),
        _ => format!(
            "{excluded} pixels left out ({} of the image, {} of the reference)",
            metrics.non_finite_image, metrics.non_finite_reference
        ),
    };
    lines.push(("not finite", not_finite));
    if metrics.masked > 0 {
        lines.push(("mask", format!("{} pixels count, {} are outside", metrics.counted(), metrics.masked)));
    }
    if let Some(test) = test {
        let verdict = if test.fair { "fair" } else { "not fair" };
        let shares = format!("{:.3} % of {} pixels pass, 99.75 % must", 100.0 * test.passing, test.tested);
        lines.push(("z-test", format!("{verdict}: {shares} (p > {:.2e}, smallest {:.2e})", test.significance, test.smallest_p)));
        if let Some(ratio) = test.ratio {
            lines.push(("z-test, energy ratio", format!("{:.5} ± {:.5}", ratio.value, ratio.standard_error)));
        }
        if test.non_finite > excluded {
            lines.push(("z-test, left out", format!("{} pixels without a finite standard error", test.non_finite - excluded)));
        }
    }
    if let Some((file, map)) = map {
        lines.push(("error map", format!("{} ({})", file.display(), map.legend())));
    }
    lines.iter().map(|(name, value)| format!("{name:<26}{value}\n")).collect()
}

/// A metric's value for the eye: shares of the mean in per cent.
fn value(known: &Known, metrics: &Metrics) -> String {
    match (known.of(metrics), known.name) {
        (Some(v), "relative_bias") => format!("{:+.3} %", v * 100.0),
        (Some(v), "relative_rmse" | "relative_mean_absolute_error" | "relative_percentile_99_9") => format!("{:.3} %", v * 100.0),
        (Some(v), "bias") => format!("{v:+.6}"),
        (Some(v), "energy_ratio") => format!("{v:.5}"),
        (Some(v), _) => format!("{v:.6}"),
        (None, "flip") => "undefined (the channels are no colours)".to_owned(),
        (None, "ssim") => "undefined (the channels are no colours, or fewer than 11 × 11 pixels)".to_owned(),
        (None, _) => "undefined (the mean of the reference is 0)".to_owned(),
    }
}
