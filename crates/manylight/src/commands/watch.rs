//! `manylight watch`: renders again whenever a file changes.

use std::{
    path::PathBuf,
    time::{Duration, Instant, SystemTime},
};

use manylight::{
    Budget,
    fault::Fault,
    gpu::Watcher,
    graph::diagnostics::Diagnostics,
    lab::timing::timed_frame,
    renderer::{ReloadReport, Renderer},
};

use super::{
    budget, note,
    outputs::Outputs,
    session::{Session, bad_numbers, of_render, settings, time_of},
};
use crate::cli::{Cli, WatchArgs};

/// How long to wait for a change before looking again.
const PATIENCE: Duration = Duration::from_secs(3600);

/// Times to wait before a device is asked for once more: a driver that is reset needs a moment.
const WAITS: [Duration; 4] = [Duration::ZERO, Duration::from_millis(500), Duration::from_secs(2), Duration::from_secs(5)];

/// Renders once, then after every change until interrupted.
pub fn run(cli: &Cli, args: &WatchArgs) -> Result<(), Fault> {
    let mut watch = open(cli, args)?;
    let mut watcher = Watcher::new(watch.renderer.watch_set()).map_err(|e| Fault::Input(e.to_string()))?;
    let start = Instant::now();
    watch.picture(args.frames)?;
    let files = watcher_files(&watch.renderer);
    note(&format!("first picture after {:.0} ms; watching {files}; Ctrl+C ends", start.elapsed().as_secs_f64() * 1e3));
    while !watch.is_done() {
        let changed = watcher.recv_timeout(PATIENCE);
        if changed.is_empty() {
            continue;
        }
        watch.follow(&changed);
        watcher.set(watch.renderer.watch_set()).map_err(|e| Fault::Input(e.to_string()))?;
    }
    Ok(())
}

/// Everything up to the first picture.
fn open<'a>(cli: &Cli, args: &'a WatchArgs) -> Result<Watch<'a>, Fault> {
    let outputs = Outputs { pictures: args.out.clone(), dumps: Vec::new() };
    outputs.check_files(None)?;
    let session = Session::open(cli, &args.pipeline.pipeline)?;
    let scene = session.scene(&args.frame.scene)?;
    let settings = settings(&args.pipeline, &args.frame, Vec::new())?;
    outputs.check_plan(&session.plan(Some(&scene), &settings)?)?;
    let gpu = super::open_gpu(args.frame.adapter.as_ref())?;
    let renderer = session.renderer(&gpu, scene, settings)?;
    let budget = args.budget.budget.map(|ms| Budget::new(ms, &renderer)).transpose()?;
    Ok(Watch { args, outputs, renderer, budget, frame: 0, pictures: 0 })
}

struct Watch<'a> {
    args: &'a WatchArgs,
    outputs: Outputs,
    renderer: Renderer,
    /// Holds the time, while the pipeline has what it can give up.
    budget: Option<Budget>,
    /// Frames rendered so far.
    frame: u64,
    /// Changes that led to a picture.
    pictures: u32,
}

impl Watch<'_> {
    fn is_done(&self) -> bool {
        self.args.pictures.is_some_and(|most| self.pictures >= most)
    }

    fn picture(&mut self, frames: u32) -> Result<(), Fault> {
        for _ in 0..frames {
            let (time, mut wall_ms) = (time_of(&self.args.frame, self.frame), None);
            let rendered = if self.budget.is_some() && !self.renderer.gpu().has_timestamps() {
                timed_frame(&mut self.renderer, time).map(|(_, ms)| wall_ms = Some(ms))
            } else {
                self.renderer.render_frame(time)
            };
            if let Some(fault) = bad_numbers(rendered)? {
                note(&fault.render());
            }
            if let Some(budget) = &mut self.budget {
                budget::follow(budget, &mut self.renderer, wall_ms);
            }
            self.frame += 1;
        }
        self.outputs.write(&self.renderer)?;
        Ok(())
    }

    /// Opens a new device if the old one is lost.
    fn recover(&mut self) -> Result<(), Fault> {
        let Some(reason) = self.renderer.gpu().lost() else { return Ok(()) };
        note(&format!("the GPU was lost: {reason}; opening it again"));
        let mut last = None;
        for wait in WAITS {
            std::thread::sleep(wait);
            match super::open_gpu(self.args.frame.adapter.as_ref()) {
                Ok(gpu) => {
                    self.renderer = self.renderer.on(&gpu).map_err(of_render)?;
                    self.hold();
                    return Ok(());
                }
                Err(fault) => last = Some(fault),
            }
        }
        last.map_or(Ok(()), Err)
    }

    /// Renders frames and writes the last; once more on a new device when the one there is gets lost.
    fn picture_or_recover(&mut self, frames: u32) -> Result<(), Fault> {
        match self.picture(frames) {
            Err(_) if self.renderer.gpu().lost().is_some() => {
                self.recover()?;
                self.picture(self.args.frames)
            }
            done => done,
        }
    }

    /// Reads changed files. What a rung sets may be gone from them: then once more without it.
    fn reload(&mut self, changed: &[PathBuf]) -> Result<ReloadReport, Diagnostics> {
        let reloaded = self.renderer.reload(changed);
        match (&reloaded, &self.budget) {
            (Err(_), Some(budget)) if budget.rung() > 0 => {
                budget.first_rung(&mut self.renderer)?;
                let again = self.renderer.reload(changed);
                if again.is_err() {
                    budget.this_rung(&mut self.renderer)?;
                }
                again
            }
            _ => reloaded,
        }
    }

    /// Holds the budget with what is loaded now.
    fn hold(&mut self) {
        let Some(ms) = self.args.budget.budget else { return };
        let held = match &mut self.budget {
            Some(budget) => budget.reconsider(&mut self.renderer),
            None => Budget::new(ms, &self.renderer).map(|budget| self.budget = Some(budget)),
        };
        if let Err(faults) = held {
            self.budget = None;
            note(&format!("{}\nthe budget is not held", faults.render().trim_end()));
        }
    }

    /// Takes over a change: the picture is written after one frame, and again when the iterative parts have settled. What fails is told: the next
    /// change may mend it.
    fn follow(&mut self, changed: &[PathBuf]) {
        if let Err(fault) = self.try_follow(changed) {
            note(&fault.render());
        }
    }

    fn try_follow(&mut self, changed: &[PathBuf]) -> Result<(), Fault> {
        let saved = saved_at(changed);
        let names: Vec<String> = changed.iter().map(|path| shown(path)).collect();
        note(&format!("changed: {}", names.join(", ")));
        self.recover()?;
        let report = match self.reload(changed) {
            Ok(report) => report,
            Err(faults) => {
                note(&format!("{}\nthe last good frame is kept", faults.render().trim_end()));
                return Ok(());
            }
        };
        self.hold();
        self.outputs.check_plan(self.renderer.plan())?;
        self.picture_or_recover(1)?;
        let took = saved.elapsed().unwrap_or(report.took);
        note(&describe(&report, took));
        if self.args.frames > 1 {
            self.picture_or_recover(self.args.frames - 1)?;
        }
        self.pictures += 1;
        Ok(())
    }
}

fn describe(report: &ReloadReport, took: Duration) -> String {
    let build = &report.build;
    let mut parts = vec![format!("{} nodes kept", build.kept.len())];
    let list = |what: &str, names: &[String]| format!("{what} {}", names.join(", "));
    if build.rebuilt.is_empty() {
        parts.push("none rebuilt".to_owned());
    } else {
        parts.push(list("rebuilt", &build.rebuilt));
    }
    if !build.reset.is_empty() {
        parts.push(list("reset", &build.reset));
    }
    if report.scene_changed {
        parts.push("scene loaded again".to_owned());
    }
    let warnings = if report.warnings.is_empty() { String::new() } else { format!("{}\n", report.warnings.render().trim_end()) };
    format!("{warnings}{}; {:.0} ms from save to picture", parts.join("; "), took.as_secs_f64() * 1e3)
}

/// A change is noticed sooner than this: a file saved earlier was moved here as it was.
const SOON: Duration = Duration::from_secs(2);

/// When the newest of the files was saved; now, for files that are gone or that were moved.
fn saved_at(changed: &[PathBuf]) -> SystemTime {
    let modified = |path: &PathBuf| path.metadata().and_then(|m| m.modified()).ok();
    let soon = |saved: &SystemTime| saved.elapsed().is_ok_and(|age| age < SOON);
    changed.iter().filter_map(modified).max().filter(soon).unwrap_or_else(SystemTime::now)
}

fn shown(path: &std::path::Path) -> String {
    let here = std::env::current_dir().ok().and_then(|here| path.strip_prefix(here).ok().map(std::path::Path::to_owned));
    here.as_deref().unwrap_or(path).display().to_string()
}

fn watcher_files(renderer: &Renderer) -> String {
    let set = renderer.watch_set();
    let mut names: Vec<String> = set.folders.iter().map(|f| shown(f)).collect();
    names.push(format!("{} files", set.files.len()));
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use clap::Parser;

    use super::*;
    use crate::cli::Command;

    const NODE: &str = r#"Node(doc: "Paints.", outputs: {"picture": Texture(format: Rgba8Unorm, doc: "colour")}, steps: [(entry: "fill", over: Texels("picture"))])"#;
    const SHADER: &str = "@group(0) @binding(0) var picture: texture_storage_2d<rgba8unorm, write>;
        @compute @workgroup_size(8, 8) fn fill(@builtin(global_invocation_id) id: vec3u) { textureStore(picture, id.xy, vec4f(0.2)); }";
    const PIPELINE: &str = r#"Pipeline(doc: "Paints.", resources: {"picture": Texture(format: Rgba8Unorm, size: Output)},
        nodes: [(id: "fill", node: "test/fill")], presents: "picture")"#;

    /// The device is taken away between two changes, and again while a picture is made.
    #[test]
    fn a_lost_device_is_opened_again() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let at = |name: &str| folder.path().join(name);
        for (name, text) in [("shaders/test/fill.ron", NODE), ("shaders/test/fill.wgsl", SHADER), ("pipelines/test.ron", PIPELINE)] {
            fs::create_dir_all(at(name).parent().expect("a folder")).expect("creatable");
            fs::write(at(name), text).expect("writable");
        }
        let (root, out) = (at("").display().to_string(), at("x.png").display().to_string());
        let line = ["manylight", "--root", &root, "watch", "test", "--scene", "cornell", "--size", "16x16", "--frames", "2", "--out", &out];
        let cli = Cli::try_parse_from(line).expect("a command line");
        let Command::Watch(args) = &cli.command else { panic!("watch") };
        let mut watch = open(&cli, args).unwrap_or_else(|fault| panic!("{}", fault.render()));
        watch.picture(1).expect("a picture");
        let picture = || fs::read(at("x.png")).expect("a picture");
        let first = picture();

        watch.renderer.gpu().device().destroy();
        fs::write(at("shaders/test/fill.wgsl"), SHADER.replace("0.2", "0.8")).expect("writable");
        watch.follow(&[at("shaders/test/fill.wgsl")]);
        assert!(watch.renderer.gpu().lost().is_none() && watch.pictures == 1);
        assert!(picture() != first, "the change is in the picture");

        fs::write(at("shaders/test/fill.wgsl"), SHADER).expect("writable");
        watch.follow(&[at("shaders/test/fill.wgsl")]);
        fs::remove_file(at("x.png")).expect("there");
        watch.renderer.gpu().device().destroy();
        watch.picture_or_recover(1).expect("a picture on a new device");
        assert_eq!(picture(), first);
    }

    #[test]
    fn a_file_that_was_moved_was_not_saved_when_it_was_written() {
        let folder = tempfile::tempdir().expect("temporary folder");
        let path = folder.path().join("old.ron");
        let file = std::fs::File::create(&path).expect("created");
        assert!(saved_at(std::slice::from_ref(&path)).elapsed().is_ok_and(|age| age < SOON));
        file.set_modified(SystemTime::now() - Duration::from_secs(3600)).expect("set");
        assert!(saved_at(&[path]).elapsed().is_ok_and(|age| age < SOON));
    }
}
