//! What each published crate would hold: its licences, and for `manylight` the shaders, pipelines and scenes that are embedded.

use crate::shell::{Shell, Stop};

const CRATES: [&str; 6] = ["manylight-graph", "manylight-gpu", "manylight-scene", "manylight-passes", "manylight-lab", "manylight"];
const EVERYWHERE: [&str; 4] = ["Cargo.toml", "LICENSE-APACHE", "LICENSE-MIT", "src/lib.rs"];
/// Beginnings of paths that must be in `manylight`.
const FRONT_DOOR: [&str; 5] = ["README.md", "shaders/common/", "pipelines/acrsm.ron", "pipelines/stages/", "assets/cornell.ron"];

/// Asks cargo what it would pack and checks that nothing is missing.
pub fn check(shell: &Shell) -> Result<String, Stop> {
    let mut faults = Vec::new();
    let mut files = 0;
    for name in CRATES {
        let listing = shell
            .quiet(&["cargo", "package", "--list", "--allow-dirty", "--offline", "--package", name])
            .ok_or_else(|| Stop::failed("`cargo package` could not start"))?;
        if !listing.success {
            faults.push(format!("{name}: {}", listing.stderr.trim()));
            continue;
        }
        files += listing.stdout.lines().count();
        faults.extend(missing(name, &listing.stdout).into_iter().map(|f| format!("{name}: {f} is not packed")));
        faults.extend(listing.stderr.lines().filter(|l| l.contains("manifest has no")).map(|l| format!("{name}: {l}")));
        let folder = name.strip_prefix("manylight-").unwrap_or(name);
        let manifest = std::fs::read_to_string(shell.root.join("crates").join(folder).join("Cargo.toml")).unwrap_or_default();
        faults.extend(poor_description(&manifest).map(|f| format!("{name}: {f}")));
    }
    if faults.is_empty() { Ok(format!("{} crates, {files} files", CRATES.len())) } else { Err(Stop::failed(faults.join("\n"))) }
}

fn missing(name: &str, listing: &str) -> Vec<&'static str> {
    let wanted = EVERYWHERE.iter().chain(FRONT_DOOR.iter().filter(|_| name == "manylight"));
    let packed: Vec<String> = listing.lines().map(|l| l.replace('\\', "/")).collect();
    wanted.copied().filter(|w| !packed.iter().any(|p| p == w || (w.ends_with('/') && p.starts_with(w)))).collect()
}

fn poor_description(manifest: &str) -> Option<&'static str> {
    let description = manifest.lines().find_map(|l| l.strip_prefix("description = "));
    match description.map(|d| d.trim_matches('"')) {
        None | Some("") => Some("Cargo.toml has no description"),
        Some("TODO") => Some("the description in Cargo.toml is still to be written"),
        Some(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_files_are_named() {
        let listing = "Cargo.toml\nLICENSE-MIT\nsrc/lib.rs\n";
        assert_eq!(missing("manylight-gpu", listing), ["LICENSE-APACHE"]);
        let listing = "Cargo.toml\nLICENSE-MIT\nLICENSE-APACHE\nREADME.md\nsrc/lib.rs\nshaders/common/scene.wgsl\npipelines/acrsm.ron\npipelines/stages/rsm.ron\n";
        assert_eq!(missing("manylight", listing), ["assets/cornell.ron"]);
    }

    #[test]
    fn descriptions_are_wanted() {
        assert!(poor_description("[package]\nname = \"x\"\n").is_some());
        assert!(poor_description("description = \"TODO\"\n").is_some());
        assert!(poor_description("description = \"Draws.\"\n").is_none());
    }
}
