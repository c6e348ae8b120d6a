//! What `render` and `watch` write: checked before any work, written whole afterwards.

use std::path::{Path, PathBuf};

use manylight::{
    fault::Fault,
    files::{FileKind, Picture, write_exr, write_png, write_text},
    gpu::Image,
    graph::{
        nearest,
        plan::Plan,
        registry::Registry,
        value::{Encoding, Format, ResourceDesc},
    },
    renderer::Renderer,
    tone,
};
use serde_json::{Value, json};

use super::of_file;

/// Files to write from the last frame.
#[derive(Debug, Default)]
pub struct Outputs {
    /// Pictures: PNG as presented, EXR as linear radiance.
    pub pictures: Vec<PathBuf>,
    /// Resources by name.
    pub dumps: Vec<(String, PathBuf)>,
}

impl Outputs {
    /// Checks names, kinds and folders of all files; needs no pipeline.
    pub fn check_files(&self, also: Option<&Path>) -> Result<(), Fault> {
        let mut seen: Vec<&Path> = Vec::new();
        let all = self.pictures.iter().chain(self.dumps.iter().map(|(_, file)| file)).map(PathBuf::as_path);
        for file in all.chain(also) {
            super::writable(file)?;
            if seen.contains(&file) {
                return Err(Fault::Usage(format!("two outputs are to be written to `{}`", file.display())));
            }
            seen.push(file);
        }
        for file in &self.pictures {
            if FileKind::of(file).map_err(of_file)? == FileKind::Json {
                return Err(Fault::Usage(format!("`{}`: --out writes .png or .exr; buffers are written with --dump", file.display())));
            }
        }
        for (_, file) in &self.dumps {
            FileKind::of(file).map_err(of_file)?;
        }
        Ok(())
    }

    /// Names of the resources that must be kept for dumping: all but scene and frame data, which are there anyway.
    pub fn keep(&self, registry: &Registry) -> Vec<String> {
        self.dumps.iter().map(|(name, _)| name.clone()).filter(|name| !registry.externals.contains_key(name)).collect()
    }

    /// Checks the outputs against what the plan has.
    pub fn check_plan(&self, plan: &Plan) -> Result<(), Fault> {
        if plan.radiance.is_none()
            && let Some(file) = self.pictures.iter().find(|f| FileKind::of(f).is_ok_and(|k| k == FileKind::Exr))
        {
            return Err(Fault::Input(format!("`{}`: the pipeline names no `radiance` to write; write a .png", file.display())));
        }
        for (name, file) in &self.dumps {
            let resource = plan.resource(name).ok_or_else(|| unknown(plan, name))?;
            let desc = &plan.resources[resource].desc;
            let fits = match (FileKind::of(file).map_err(of_file)?, desc) {
                (FileKind::Json, ResourceDesc::Texture { format, .. }) => is_integer(*format),
                (FileKind::Json, _) => true,
                (_, desc) => matches!(desc, ResourceDesc::Texture { .. }),
            };
            if !fits {
                let help =
                    if matches!(desc, ResourceDesc::Texture { .. }) { "a texture: write .exr or .png" } else { "a buffer: write .json" };
                return Err(Fault::Usage(format!("`{name}` cannot be written to `{}`, it is {help}", file.display())));
            }
        }
        Ok(())
    }

    /// Writes all files from the latest frame.
    pub fn write(&self, renderer: &Renderer) -> Result<(), Fault> {
        for file in &self.pictures {
            self.write_picture(renderer, file)?;
        }
        for (name, file) in &self.dumps {
            write_dump(renderer, name, file)?;
        }
        Ok(())
    }

    fn write_picture(&self, renderer: &Renderer, file: &Path) -> Result<(), Fault> {
        let plan = renderer.plan();
        match (FileKind::of(file).map_err(of_file)?, plan.radiance) {
            (FileKind::Exr, Some(radiance)) => {
                let image = read(renderer, &plan.resources[radiance].name)?;
                write_exr(file, &Picture::from(image).without_alpha()).map_err(of_file)
            }
            _ => {
                let shown = &plan.resources[plan.presents];
                write_as_png(file, &read(renderer, &shown.name)?, &shown.desc)
            }
        }
    }
}

fn unknown(plan: &Plan, name: &str) -> Fault {
    let known = plan.resources.iter().map(|r| r.name.as_str());
    let help = nearest(name, known).map_or_else(String::new, |near| format!("; did you mean `{near}`?"));
    Fault::Input(format!("no node that runs writes a resource `{name}`{help}"))
}

fn is_integer(format: Format) -> bool {
    matches!(format, Format::R32Uint | Format::Rg32Uint | Format::Rgba32Uint)
}

fn write_dump(renderer: &Renderer, name: &str, file: &Path) -> Result<(), Fault> {
    let plan = renderer.plan();
    let desc = &plan.resources[plan.resource(name).ok_or_else(|| unknown(plan, name))?].desc;
    let is_texture = matches!(desc, ResourceDesc::Texture { .. });
    match FileKind::of(file).map_err(of_file)? {
        FileKind::Json => {
            let value = if is_texture {
                texels(&read(renderer, name)?)
            } else {
                renderer.read_json(name).map_err(|e| Fault::Input(e.to_string()))?
            };
            write_text(file, &format!("{value:#}\n")).map_err(of_file)
        }
        FileKind::Exr => write_exr(file, &read(renderer, name)?.into()).map_err(of_file),
        FileKind::Png => write_as_png(file, &read(renderer, name)?, desc),
    }
}

/// An integer texture as JSON: rows from top to bottom, channels interleaved.
fn texels(image: &Image) -> Value {
    let data: Vec<u64> = image.data.iter().map(|v| *v as u64).collect();
    json!({"width": image.width, "height": image.height, "channels": image.channels, "data": data})
}

/// Reads a texture of the latest frame.
pub fn read(renderer: &Renderer, name: &str) -> Result<Image, Fault> {
    renderer.read(name).map_err(|e| Fault::Input(e.to_string()))
}

fn write_as_png(file: &Path, image: &Image, desc: &ResourceDesc) -> Result<(), Fault> {
    let meaning = match desc {
        ResourceDesc::Texture { encoding: Encoding::Octahedral, .. } => tone::Meaning::Direction,
        ResourceDesc::Texture { format: Format::Rgba8Unorm | Format::R8Unorm, .. } => tone::Meaning::Display,
        ResourceDesc::Texture { format, .. } if image.channels == 1 || is_integer(*format) => tone::Meaning::Quantity,
        _ => tone::Meaning::Light,
    };
    let (channels, samples) = tone::to_bytes(&image.data, image.channels as usize, meaning);
    write_png(file, image.width as usize, image.height as usize, channels, &samples).map_err(of_file)
}
