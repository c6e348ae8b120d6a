//! `manylight bake`: indirect light over a day, traced beforehand.

use std::{fs, io::Write, path::Path};

use indicatif::ProgressBar;
use manylight::{
    fault::Fault,
    files::{FileError, write_text, write_whole},
    lab::bake::{BakeError, Criterion, Domain, Event, Keep, Options, Schedule, Task, Tracer, bake, make_work, study},
    library,
    passes::Baked,
};

use super::{lab::cache, note, of_file};
use crate::{
    cli::{BakeArgs, Cli, CriterionArg, LookupArg},
    progress,
};

/// The share of the variance that the paper's ten components hold ([PCA] 3.2).
const DEFAULT_VARIANCE: f64 = 0.986;

/// Of key frames in pixels.
const DEFAULT_SIZE: (u32, u32) = (160, 120);
/// Of a cube's faces in texels.
const DEFAULT_SIDE: u32 = 64;
/// Most texels of key frames that are an atlas.
const DEFAULT_TEXELS: u32 = 32_768;

/// Traces what is not on disk yet, then writes the file, the tables, or both.
pub fn run(cli: &Cli, args: &BakeArgs) -> Result<(), Fault> {
    if let Some(file) = &args.out {
        super::writable(file)?;
    }
    let domain = domain(args)?;
    let library = library::open(cli.root.as_deref())?;
    let source = library::scene(&library, &args.scene)?;
    let work = make_work(&cache(args.work.as_ref(), "bakes")?).map_err(of_file)?;
    let gpu = super::open_gpu(args.adapter.as_ref())?;
    note(&format!("adapter: {}", super::adapter_line(&gpu)));
    let task = Task { library: &library, source: &source, domain, paths: args.paths, work: &work };
    let mut tracer = Tracer::new(&gpu, task).map_err(of_bake)?;
    super::warn(&tracer.scene().warnings);
    let options = options(args);
    let bar = progress::spinner("starting");
    let mut tell = |event: Event| show(&bar, event);
    if let Some(folder) = &args.report {
        fs::create_dir_all(folder).map_err(|e| of_file(FileError::write(folder, &e)))?;
        let study = study(&mut tracer, &options, args.interval, &mut tell).map_err(of_bake)?;
        for table in [&study.components, &study.intervals] {
            write_text(&folder.join(format!("{}.md", table.name)), &table.markdown()).map_err(of_file)?;
            write_text(&folder.join(format!("{}.csv", table.name)), &table.csv()).map_err(of_file)?;
        }
        bar.suspend(|| super::print(&format!("{}\n{}", study.components.markdown(), study.intervals.markdown())))?;
    }
    if let Some(file) = &args.out {
        let baked = bake(&mut tracer, &options, &mut tell).map_err(of_bake)?;
        let bytes = write(file, &baked)?;
        bar.finish_and_clear();
        super::print(&summary(file, &baked, bytes, tracer.traced, tracer.found))?;
    }
    bar.finish_and_clear();
    Ok(())
}

/// What light is traced at.
fn domain(args: &BakeArgs) -> Result<Domain, Fault> {
    let given =
        [("--size", "image", args.size.is_some()), ("--side", "cube", args.side.is_some()), ("--texels", "atlas", args.texels.is_some())];
    let (own, domain) = match args.lookup {
        LookupArg::Image => ("image", Domain::Picture { size: args.size.unwrap_or(DEFAULT_SIZE) }),
        LookupArg::Cube => ("cube", Domain::Cube { side: args.side.unwrap_or(DEFAULT_SIDE) }),
        LookupArg::Atlas => ("atlas", Domain::Atlas { texels: args.texels.unwrap_or(DEFAULT_TEXELS) }),
    };
    match given.into_iter().find(|(_, lookup, is_given)| *is_given && *lookup != own) {
        None => Ok(domain),
        Some((option, lookup, _)) => {
            let remedy = given.into_iter().find(|(_, lookup, _)| *lookup == own).map_or("", |(option, ..)| option);
            Err(Fault::Input(format!("{option} is of the look-up `{lookup}`: add --lookup {lookup}, or give {remedy} instead")))
        }
    }
}

fn options(args: &BakeArgs) -> Options {
    let schedule = match args.threshold {
        None => Schedule::Uniform { interval_s: args.interval },
        Some(threshold) => Schedule::Bisection {
            shortest_s: args.interval,
            longest_s: args.longest,
            threshold,
            criterion: if args.criterion == CriterionArg::Ends { Criterion::Ends } else { Criterion::Middle },
        },
    };
    let keep = match args.components {
        Some(count) => Keep::Components(count.into()),
        None => Keep::Variance(args.variance.unwrap_or(DEFAULT_VARIANCE)),
    };
    Options { schedule, period_s: args.period, keep, subtract_mean: !args.keep_mean }
}

fn show(bar: &ProgressBar, event: Event) {
    let clock = |time: f64| format!("{:02}:{:02}", (time / 3600.0) as u64, (time / 60.0) as u64 % 60);
    match event {
        Event::Frame { time, index, of: Some(of) } => bar.set_message(format!("key frame {}/{of}, {}", index + 1, clock(time))),
        Event::Frame { time, index, of: None } => bar.set_message(format!("looking at frame {}, {}", index + 1, clock(time))),
        Event::Components => bar.set_message("finding components"),
    }
}

fn write(file: &Path, baked: &Baked) -> Result<usize, Fault> {
    let bytes = baked.to_bytes().map_err(|e| Fault::Input(e.to_string()))?;
    write_whole(file, |w| w.write_all(&bytes).map_err(|e| FileError::write(file, &e))).map_err(of_file)?;
    Ok(bytes.len())
}

fn summary(file: &Path, baked: &Baked, bytes: usize, traced: usize, found: usize) -> String {
    let header = &baked.header;
    let kept = header.kept_variance.last().map_or(100.0, |kept| 100.0 * kept);
    format!(
        "{}: {}×{} texels, {} key frames ({} dark, which are not stored), {} components with {kept:.3} % of the variance, {bytes} bytes; {traced} frames traced, {found} found\n",
        file.display(),
        header.width,
        header.height,
        header.keys.len(),
        header.dark_keys,
        header.components
    )
}

fn of_bake(error: BakeError) -> Fault {
    match error {
        BakeError::Documents(diagnostics) => Fault::Documents(diagnostics),
        other => Fault::Input(other.to_string()),
    }
}
