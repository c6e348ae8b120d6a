//! One run: render, compare, measure.

use std::{collections::HashMap, fs, path::Path, time::SystemTime};

use indexmap::IndexMap;
use manylight_gpu::{Gpu, GpuKind};
use manylight_passes::{Renderer, plan_input};

use super::{
    SweepError,
    document::MaskUse,
    plan::Run,
    prepare::Prepared,
    reference::{Reference, batches_of, rgb},
};
use crate::{
    facts,
    files::{FileError, Picture, write_png},
    metrics::{self, ErrorMapKind, Estimate, Mask, Metrics},
    record::{FORMAT, FrameError, Pictures, Record, SceneFacts, Summary, Times, node_times},
    timing::{FrameSamples, serial_by_default, timed_frame},
};

/// Folder of the pictures, in the folder of the records.
const PICTURES: &str = "pictures";

/// The texture in which a pipeline tells its noise.
pub(super) const STANDARD_ERROR: &str = "standard_error";

/// What runs share.
pub(super) struct Bench<'a> {
    pub gpu: &'a Gpu,
    pub prepared: &'a Prepared,
    /// Folder of the records.
    pub out: &'a Path,
    /// Folder of references.
    pub cache: &'a Path,
    /// References in memory, by hash.
    pub references: HashMap<String, Reference>,
}

impl Bench<'_> {
    /// Hash of everything that a run's numbers depend on.
    pub fn inputs(&self, run: &Run) -> Result<String, SweepError> {
        let sweep = &self.prepared.sweep;
        let scene = &self.prepared.scenes[run.scene].scene;
        let documents = &self.prepared.documents[run.variant];
        let plan = documents.plan(&plan_input(documents.pipeline(), &self.prepared.settings(run), scene))?;
        let reference = match self.prepared.reference_file(run) {
            Some(reference) => reference.facts.hash.clone(),
            None => self.prepared.task(run, self.time(sweep.frames_of(run.variant) - 1)).hash()?,
        };
        let asked = format!(
            "{:016x} {:?} {} {} {} {:?} {:?} {:?} {}",
            scene.hash,
            run.size,
            run.seed,
            sweep.frames_of(run.variant),
            sweep.measure,
            (sweep.time, sweep.fps),
            sweep.sequence,
            sweep.mask.as_ref().map(MaskUse::describe),
            sweep.image_of(run.variant).text,
        );
        let adapter = facts::adapter(self.gpu).to_string();
        Ok(facts::hash(&[&facts::fingerprint(&plan), &asked, &reference, &adapter, &env!("CARGO_PKG_VERSION").to_owned()]))
    }

    /// Scene time of a frame.
    fn time(&self, frame: u32) -> f64 {
        let sweep = &self.prepared.sweep;
        sweep.time + sweep.fps.map_or(0.0, |fps| f64::from(frame) / fps)
    }

    /// The reference of a run at a frame.
    fn reference(&mut self, run: &Run, frame: u32, progress: &mut dyn FnMut(u32, u32)) -> Result<Reference, SweepError> {
        if let Some(reference) = self.prepared.reference_file(run) {
            return Ok(reference.clone());
        }
        let task = self.prepared.task(run, self.time(frame));
        let hash = task.hash()?;
        if let Some(known) = self.references.get(&hash) {
            return Ok(known.clone());
        }
        let reference = task.obtain(self.gpu, self.cache, progress)?;
        self.references.insert(hash, reference.clone());
        Ok(reference)
    }

    /// Renders, compares and measures. `progress` is told the batches of a reference that are done, and all of them.
    pub fn run(&mut self, run: &Run, inputs: String, progress: &mut dyn FnMut(u32, u32)) -> Result<Record, SweepError> {
        let sweep = &self.prepared.sweep;
        let frames = sweep.frames_of(run.variant);
        let reference = self.reference(run, frames - 1, progress)?;
        let loaded = &self.prepared.scenes[run.scene];
        let documents = self.prepared.documents[run.variant].clone();
        let settings = self.prepared.settings(run);
        let mut renderer = Renderer::with(self.gpu, documents, loaded.source.clone(), loaded.scene.clone(), settings)?;
        for frame in 0..frames {
            timed_frame(&mut renderer, self.time(frame))?;
        }
        let image = self.image(run, &renderer)?;
        let mask = self.mask(&renderer)?;
        let compared = compare(&image, &reference, mask.as_ref())?;
        let counted = compared.counted() as u64;
        let not_finite = (compared.non_finite_image + compared.non_finite_reference) as u64;
        let mut errors = compared.named();
        errors.extend(passing(&renderer, &image, &reference, mask.as_ref())?.map(|share| ("z_passing".to_owned(), share)));
        let pictures = self.write_pictures(&inputs, &image, &reference, mask.as_ref())?;
        let sequence = self.sequence(run, &mut renderer, mask.as_ref(), &mut errors, progress)?;
        let (samples, serial) = self.measure(run, &mut renderer)?;
        let wall = Summary::of(&samples.wall).unwrap_or(Summary { median: 0.0, p95: 0.0, samples: 0 });
        let mut times = Times {
            method: if serial { "serial" } else { "timestamps" }.to_owned(),
            software: self.gpu.kind() == GpuKind::Software,
            wall,
            gpu: Summary::of(&samples.gpu),
            cpu: Summary::of(&samples.cpu),
            until_picture: 0.0,
            nodes: node_times(&samples),
        };
        times.until_picture = times.frame() * f64::from(frames);
        let plan = renderer.plan();
        Ok(Record {
            format: FORMAT,
            run: run.name.clone(),
            inputs,
            sweep: sweep.name.clone(),
            variant: sweep.variants[run.variant].name.text.clone(),
            pipeline: renderer.pipeline().name.clone(),
            set: run.set.clone(),
            varied: run.varied.clone(),
            parameters: facts::parameters(plan),
            scene: SceneFacts {
                name: loaded.scene.name.clone(),
                hash: format!("{:016x}", loaded.scene.hash),
                triangles: loaded.scene.triangle_count() as u64,
            },
            size: [run.size.0, run.size.1],
            frames,
            measured: sweep.measure,
            time: sweep.time,
            fps: sweep.fps,
            light_path: sweep.light_path.iter().map(|(time, position, target)| (*time, position.to_array(), target.to_array())).collect(),
            sequence_frames: sweep.sequence.map(|sequence| [sequence.frames, sequence.every]),
            seed: run.seed,
            image: sweep.image_of(run.variant).text.clone(),
            reference: reference.facts,
            mask: sweep.mask.as_ref().map(MaskUse::describe),
            adapter: facts::adapter(self.gpu),
            manylight: env!("CARGO_PKG_VERSION").to_owned(),
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            times,
            memory: renderer.memory_report().total(),
            metrics: errors,
            counted,
            not_finite,
            sequence,
            pictures,
        })
    }

    fn image(&self, run: &Run, renderer: &Renderer) -> Result<Picture, SweepError> {
        let image = renderer.read(&self.prepared.sweep.image_of(run.variant).text).map_err(|e| SweepError::Render(e.to_string()))?;
        Ok(rgb(image))
    }

    fn mask(&self, renderer: &Renderer) -> Result<Option<Mask>, SweepError> {
        let Some(wanted) = &self.prepared.sweep.mask else { return Ok(None) };
        let image = renderer.read(&wanted.resource.text).map_err(|e| SweepError::Render(e.to_string()))?;
        let channels = image.channels as usize;
        let Some(channel) = Some(wanted.channel as usize).filter(|channel| *channel < channels) else {
            let text = format!("the mask's channel is {}, but `{}` has only {channels}, from 0", wanted.channel, wanted.resource.text);
            return Err(SweepError::Render(text));
        };
        let values = image.data.iter().skip(channel).step_by(channels).copied().collect();
        let picture = Picture::linear(image.width as usize, image.height as usize, 1, values);
        Ok(Some(Mask::new(&picture, wanted.condition)))
    }

    /// Goes on from the picture, frame by frame in time; flicker is added to `errors`.
    fn sequence(
        &mut self,
        run: &Run,
        renderer: &mut Renderer,
        mask: Option<&Mask>,
        errors: &mut IndexMap<String, f64>,
        progress: &mut dyn FnMut(u32, u32),
    ) -> Result<Vec<FrameError>, SweepError> {
        let sweep = &self.prepared.sweep;
        let Some(sequence) = sweep.sequence else { return Ok(Vec::new()) };
        let mut all = Vec::new();
        let mut step = |index: u32| -> Result<Picture, SweepError> {
            let frame = sweep.frames_of(run.variant) + index;
            renderer.render_frame(self.time(frame))?;
            let image = self.image(run, renderer)?;
            if index.is_multiple_of(sequence.every) {
                let reference = self.reference(run, frame, progress)?;
                let metrics = compare(&image, &reference, self.mask(renderer)?.as_ref())?.named();
                all.push(FrameError { time: self.time(frame), metrics });
            }
            Ok(image)
        };
        let mut fault = None;
        let frames = (0..sequence.frames).map_while(|index| step(index).map_err(|e| fault = Some(e)).ok());
        let flicker = metrics::flicker(frames, mask)?;
        if let Some(fault) = fault {
            return Err(fault);
        }
        errors.extend(flicker.map(|value| ("flicker".to_owned(), value)));
        Ok(all)
    }

    /// Measures frames after the picture; nodes one by one in frames of their own where timestamps say nothing of them.
    fn measure(&self, run: &Run, renderer: &mut Renderer) -> Result<(FrameSamples, bool), SweepError> {
        let sweep = &self.prepared.sweep;
        let mut samples = FrameSamples::new(renderer.plan());
        let serial = serial_by_default(self.gpu);
        let mut frame = sweep.frames_of(run.variant) + sweep.sequence.map_or(0, |sequence| sequence.frames);
        for one_by_one in [false, true].into_iter().take(1 + usize::from(serial)) {
            renderer.measure_serially(one_by_one);
            for _ in 0..sweep.measure {
                let (timings, wall_ms) = timed_frame(renderer, self.time(frame))?;
                frame += 1;
                if !one_by_one {
                    samples.push_frame(timings, wall_ms);
                }
                if one_by_one == serial {
                    samples.push_nodes(timings);
                }
            }
        }
        Ok((samples, serial))
    }

    /// Writes image, reference and error map; all pictures of a reference have one exposure.
    fn write_pictures(&self, name: &str, image: &Picture, reference: &Reference, mask: Option<&Mask>) -> Result<Pictures, SweepError> {
        let folder = self.out.join(PICTURES);
        fs::create_dir_all(&folder).map_err(|e| FileError::write(&folder, &e))?;
        let exposure = metrics::exposure_of(&reference.picture);
        let write = |stem: &str, bytes: &[u8]| -> Result<Option<String>, FileError> {
            let name = format!("{stem}.png");
            write_png(&folder.join(&name), image.width, image.height, 3, bytes)?;
            Ok(Some(format!("{PICTURES}/{name}")))
        };
        let map = metrics::error_map(ErrorMapKind::Difference, image, &reference.picture, mask, None)?;
        Ok(Pictures {
            image: write(name, &metrics::display(image, exposure))?,
            reference: write(&reference.facts.hash, &metrics::display(&reference.picture, exposure))?,
            error: write(&format!("{name}_error"), &map.rgb)?,
        })
    }
}

fn compare(image: &Picture, reference: &Reference, mask: Option<&Mask>) -> Result<Metrics, SweepError> {
    Ok(match mask {
        Some(mask) => metrics::compare_over(image, &reference.picture, mask)?,
        None => metrics::compare(image, &reference.picture)?,
    })
}

/// Share of the pixels whose difference noise explains, for pipelines that know their noise: those with a texture `standard_error`, whose
/// alpha is the number of batches.
fn passing(renderer: &Renderer, image: &Picture, reference: &Reference, mask: Option<&Mask>) -> Result<Option<f64>, SweepError> {
    let Some(reference_error) = &reference.standard_error else { return Ok(None) };
    let Ok(error) = renderer.read(STANDARD_ERROR) else { return Ok(None) };
    let error = Picture::from(error);
    // One frame has no spread.
    let Some(batches) = batches_of(&error).filter(|batches| *batches > 1) else { return Ok(None) };
    let error = error.without_alpha();
    let ours = Estimate { picture: image, standard_error: Some(&error), batches: Some(batches) };
    let theirs = Estimate { picture: &reference.picture, standard_error: Some(reference_error), batches: reference.batches };
    Ok(Some(metrics::z_test(ours, theirs, mask)?.passing))
}
