//! `manylight graph`: a pipeline as a drawing.

use manylight::{Settings, fault::Fault, files::write_text};

use super::{of_file, session::Session};
use crate::cli::{Cli, GraphArgs, GraphFormat};

/// Plans without a GPU and draws the plan.
pub fn run(cli: &Cli, args: &GraphArgs) -> Result<(), Fault> {
    if let Some(file) = &args.out {
        super::writable(file)?;
    }
    let session = Session::open(cli, &args.pipeline.pipeline)?;
    let scene = args.scene.as_ref().map(|name| session.scene(name)).transpose()?;
    let settings = Settings { size: args.size.size, set: args.pipeline.set.clone(), ..Settings::default() };
    let plan = session.plan(scene.as_ref(), &settings)?;
    let text = match args.format {
        GraphFormat::Svg => plan.to_svg(),
        GraphFormat::Dot => plan.to_dot(),
        GraphFormat::Mermaid => plan.to_mermaid(),
        GraphFormat::Json => format!("{:#}\n", plan.to_json()),
    };
    match &args.out {
        Some(file) => write_text(file, &text).map_err(of_file),
        None => super::print(&text),
    }
}
