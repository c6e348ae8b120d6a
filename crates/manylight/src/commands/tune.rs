//! `manylight tune`: a preset from a sweep's records.

use std::path::Path;

use manylight::{
    fault::Fault,
    files::{check_writable, write_text},
    lab::{
        metrics::Known,
        sweep::SceneUse,
        tune::{Goal, choose, preset},
    },
    library,
};

use super::{lab, note, of_file};
use crate::cli::{Cli, TuneArgs};

/// Runs the sweep on the scene, chooses, and writes the preset.
pub fn run(cli: &Cli, args: &TuneArgs) -> Result<(), Fault> {
    check_writable(&args.out).map_err(of_file)?;
    if args.out.file_name().is_some_and(|file| file == extended(&args.pipeline).as_str()) {
        return Err(Fault::Usage(format!("the preset would extend itself: give `{}` another name", args.out.display())));
    }
    let goal = match (args.budget, args.error) {
        (Some(budget), _) => Goal::Budget(budget),
        (None, Some(error)) => Goal::Error(error),
        (None, None) => return Err(Fault::Usage("give --budget TIME or --error ERROR".to_owned())),
    };
    let library = library::open(cli.root.as_deref())?;
    library::scene(&library, &args.scene)?;
    let mut sweep = lab::read(&library, &args.sweep, &args.lab)?;
    sweep.scenes = vec![SceneUse { scene: lab::given(&sweep, &args.scene), reference: None, standard_error: None }];
    if sweep.sizes.len() > 1 {
        return Err(Fault::Usage(format!(
            "the sweep `{}` has several sizes, whose times do not compare: choose one with --size",
            sweep.name
        )));
    }
    // Settings compete, not seeds; what is claimed of variants is not asked here.
    sweep.seeds.truncate(1);
    sweep.claims.clear();
    sweep.variants.retain(|variant| name(&variant.pipeline.text) == name(&args.pipeline));
    if sweep.variants.is_empty() {
        let text = format!("the sweep `{}` has no variant of the pipeline `{}`; name another with --sweep", sweep.name, args.pipeline);
        return Err(Fault::Input(text));
    }
    let records = lab::cache(args.records.as_ref(), &format!("tune/{}", sweep.name))?;
    let prepared = lab::load(sweep, &library)?;
    let outcome = lab::run(&prepared, &records, None, &args.lab)?;
    let report = lab::write_report(&prepared.sweep, &outcome.records, &records)?;
    let metric = &prepared.sweep.metric.text;
    let record =
        choose(&outcome.records, metric, goal).map_err(|why| Fault::Input(format!("no setting of the sweep keeps to that: {why}")))?;
    let title = Known::find(metric).map_or(metric.as_str(), |known| known.title);
    let found = format!("{title} {:.4} in {:.2} ms a frame", record.metrics[metric], record.times.frame());
    let adapter = record.adapter["name"].as_str().unwrap_or("unknown adapter").to_owned();
    let doc = format!("Tuned for {}: {found} at {}x{} on {adapter}.", record.scene.name, record.size[0], record.size[1]);
    write_text(&args.out, &preset(record, &extended(&args.pipeline), &doc)).map_err(of_file)?;
    let failed = if outcome.failed > 0 { format!(", {} more failed", outcome.failed) } else { String::new() };
    note(&format!("{} runs were tried{failed}: {}", outcome.records.len(), report.display()));
    super::print(&format!("{}: {found}\n{}\n", record.run, args.out.display()))
}

/// A pipeline's name, however it is given.
fn name(pipeline: &str) -> String {
    Path::new(pipeline).file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// What the preset extends: a file by its whole path, so that the preset may lie anywhere; else a name in `pipelines/`.
fn extended(pipeline: &str) -> String {
    match Path::new(pipeline).canonicalize() {
        Ok(path) if path.is_file() => path.to_string_lossy().into_owned(),
        _ => format!("{}.ron", name(pipeline)),
    }
}
