//! `manylight nodes`: what pipelines can use.

use manylight::{fault::Fault, graph::reference, library, load_registry};

use crate::cli::{Cli, NodesArgs, NodesFormat};

/// Prints the list of nodes, or one node in full.
pub fn run(cli: &Cli, args: &NodesArgs) -> Result<(), Fault> {
    let library = library::open(cli.root.as_deref())?;
    let (registry, faults) = load_registry(&library);
    let Some(name) = &args.name else {
        super::warn(&faults);
        return super::print(&match args.format {
            NodesFormat::Text => reference::text(&registry),
            NodesFormat::Json => format!("{:#}\n", reference::json(&registry)),
            NodesFormat::Markdown => reference::markdown(&registry),
        });
    };
    if registry.faulty.contains(name) {
        return Err(Fault::Documents(faults));
    }
    let node = reference::find(&registry, name).map_err(|fault| Fault::Documents(fault.into()))?;
    super::print(&match args.format {
        NodesFormat::Text => reference::node_text(node),
        NodesFormat::Json => format!("{:#}\n", reference::node_json(node)),
        NodesFormat::Markdown => reference::node_markdown(node),
    })
}
