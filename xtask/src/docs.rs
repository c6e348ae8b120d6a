//! What of the book is generated: one page a node, from the declarations by `manylight nodes --format markdown`; one page a sweep, from the records
//! in docs/records by `manylight sweep --report --markdown`; the tables of errors and stability, from the records of `cargo xtask numbers`.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    path::{Path, PathBuf},
};

use crate::{
    links, numbers,
    shell::{Shell, Stop},
};

const PAGES: &str = "docs/src/nodes";
const RECORDS: &str = "docs/records";
const RESULTS: &str = "docs/src/results/sweeps";
/// Pages of which parts are tables of errors and stability.
const WITH_TABLES: [&str; 2] = ["docs/src/methods/stability.md", "docs/src/results/numbers.md"];
const SUMMARY: &str = "docs/src/SUMMARY.md";
const INDEX_LINE: &str = "(nodes/index.md)";

/// Writes the node reference (or, with `check`, compares it) and builds the book.
pub fn docs(shell: &Shell, check: bool) -> Result<(), Stop> {
    if shell.show(&["cargo", "build", "--package", "manylight"]) != Some(0) {
        return Err(Stop::failed("the build failed"));
    }
    let program = shell.manylight("debug")?;
    if check {
        println!("{}", fresh(shell, &program)?);
        return Ok(());
    }
    let wanted = reference(shell, &program)?;
    for path in stale(shell, &wanted)? {
        let full = shell.root.join(&path);
        let result = match wanted.get(&path) {
            Some(text) => std::fs::create_dir_all(full.parent().unwrap_or(&shell.root)).and_then(|()| std::fs::write(&full, text)),
            None => std::fs::remove_file(&full),
        };
        result.map_err(|e| Stop::failed(format!("{}: {e}", path.display())))?;
        println!("{} {}", if wanted.contains_key(&path) { "wrote  " } else { "removed" }, path.display());
    }
    links::check(&shell.root)?;
    println!("{}", book(shell)?);
    Ok(())
}

/// Fails when the reference on disk is not what the declarations say, when a link leads nowhere, or when the book does not build.
pub fn fresh(shell: &Shell, program: &str) -> Result<String, Stop> {
    let wanted = reference(shell, program)?;
    let mut faults: Vec<String> =
        stale(shell, &wanted)?.iter().map(|p| format!("{} is stale: run `cargo xtask docs`", p.display())).collect();
    faults.extend(links::check(&shell.root).err().map(|stop| stop.message));
    if !faults.is_empty() {
        return Err(Stop::failed(faults.join("\n")));
    }
    book(shell)
}

fn book(shell: &Shell) -> Result<String, Stop> {
    if !shell.has(&["mdbook"]) {
        return Ok("mdbook is not installed (cargo install mdbook --locked): the book was not built".to_owned());
    }
    match shell.show(&["mdbook", "build", "docs"]) {
        Some(0) => Ok("the book is in docs/book".to_owned()),
        _ => Err(Stop::failed("mdbook could not build the book")),
    }
}

/// Every generated file with its text, by path from the root.
fn reference(shell: &Shell, program: &str) -> Result<BTreeMap<PathBuf, String>, Stop> {
    let output =
        shell.quiet(&[program, "nodes", "--format", "markdown"]).ok_or_else(|| Stop::failed(format!("{program} could not start")))?;
    if !output.success {
        return Err(Stop::failed(format!("`manylight nodes --format markdown` failed:\n{}", output.stderr.trim())));
    }
    let nodes = split(&output.stdout);
    if nodes.is_empty() {
        return Err(Stop::failed("`manylight nodes --format markdown` printed no heading of the form `stage/name`"));
    }
    let summary = std::fs::read_to_string(shell.root.join(SUMMARY)).map_err(|e| Stop::failed(format!("{SUMMARY}: {e}")))?;
    let summary = summary_with(&summary, &nodes).ok_or_else(|| Stop::failed(format!("{SUMMARY} has no line with {INDEX_LINE}")))?;
    let mut files: BTreeMap<PathBuf, String> =
        nodes.iter().map(|(name, text)| (Path::new(PAGES).join(format!("{name}.md")), text.clone())).collect();
    files.insert(Path::new(PAGES).join("index.md"), index(&nodes));
    files.insert(PathBuf::from(SUMMARY), summary);
    files.extend(results(shell, program)?);
    let tables = numbers::tables(&shell.root)?;
    for page in WITH_TABLES {
        let text = std::fs::read_to_string(shell.root.join(page)).map_err(|e| Stop::failed(format!("{page}: {e}")))?;
        files.insert(PathBuf::from(page), numbers::with_tables(&text, &tables).map_err(|e| Stop::failed(format!("{page}: {e}")))?);
    }
    Ok(files)
}

/// The pages of the sweeps whose records are in the repository, with their figures.
fn results(shell: &Shell, program: &str) -> Result<BTreeMap<PathBuf, String>, Stop> {
    let failed = |path: &Path, e: std::io::Error| Stop::failed(format!("{}: {e}", path.display()));
    let pages = shell.root.join("target/docs/pages");
    let _ = std::fs::remove_dir_all(shell.root.join("target/docs"));
    let mut files = BTreeMap::new();
    for name in names(&shell.root.join(RECORDS))?.into_iter().filter(|name| name != numbers::FOLDER) {
        // The command writes beside the records: into a copy of them.
        let copy = shell.root.join("target/docs").join(&name);
        let records = shell.root.join(RECORDS).join(&name).join("records.jsonl");
        std::fs::create_dir_all(&copy)
            .and_then(|()| std::fs::copy(&records, copy.join("records.jsonl")))
            .map_err(|e| failed(&records, e))?;
        let (out, folder) = (copy.to_string_lossy().into_owned(), pages.to_string_lossy().into_owned());
        let words = [program, "sweep", &name, "--out", &out, "--report", "--markdown", &folder];
        let output = shell.quiet(&words).ok_or_else(|| Stop::failed(format!("{program} could not start")))?;
        if !output.success {
            return Err(Stop::failed(format!("`manylight sweep {name} --report` failed:\n{}", output.stderr.trim())));
        }
    }
    for name in names(&pages)? {
        let text = std::fs::read_to_string(pages.join(&name)).map_err(|e| failed(&pages.join(&name), e))?;
        files.insert(Path::new(RESULTS).join(name), text);
    }
    Ok(files)
}

/// Names of what is in a folder, sorted; none if it is not there.
fn names(folder: &Path) -> Result<Vec<String>, Stop> {
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let entries = std::fs::read_dir(folder).map_err(|e| Stop::failed(format!("{}: {e}", folder.display())))?;
    let mut names: Vec<String> = entries.filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned())).collect();
    names.sort();
    Ok(names)
}

/// Paths whose text differs from what is wanted, and generated pages that nobody wants any more.
fn stale(shell: &Shell, wanted: &BTreeMap<PathBuf, String>) -> Result<Vec<PathBuf>, Stop> {
    let mut paths: Vec<PathBuf> = wanted
        .iter()
        .filter(|(p, text)| std::fs::read_to_string(shell.root.join(p)).ok().as_ref() != Some(*text))
        .map(|(p, _)| p.clone())
        .collect();
    let mut existing = Vec::new();
    for folder in [PAGES, RESULTS] {
        existing.extend(links::markdown_files(&shell.root.join(folder)).map_err(|e| Stop::failed(format!("{folder}: {e}")))?);
    }
    let existing = existing.iter().filter_map(|p| p.strip_prefix(&shell.root).ok()).map(Path::to_path_buf);
    paths.extend(existing.filter(|p| !wanted.contains_key(p)));
    Ok(paths)
}

/// Splits the program's output into nodes: a node's part begins at a heading that is its name (`## clustering/average`, with or without back-ticks) and
/// ends at the next heading of the same or a higher level. Its heading becomes the page's title, and the headings in it move up with it.
fn split(markdown: &str) -> BTreeMap<String, String> {
    let mut nodes: BTreeMap<String, String> = BTreeMap::new();
    let mut current: Option<(String, usize)> = None;
    let mut fenced = false;
    for line in markdown.lines() {
        fenced ^= line.trim_start().starts_with("```");
        let heading = heading(line).filter(|_| !fenced);
        if let Some((level, text)) = heading {
            if let Some(name) = node_name(text) {
                nodes.insert(name.to_owned(), format!("# {name}\n"));
                current = Some((name.to_owned(), level));
                continue;
            }
            if current.as_ref().is_some_and(|(_, at)| level <= *at) {
                current = None;
            }
        }
        let Some((name, at)) = &current else { continue };
        let page = nodes.entry(name.clone()).or_default();
        match heading {
            Some((level, text)) => page.push_str(&format!("{} {text}", "#".repeat(level - at + 1))),
            None => page.push_str(line.trim_end()),
        }
        page.push('\n');
    }
    for page in nodes.values_mut() {
        *page = format!("{}\n", page.trim_end());
    }
    nodes
}

/// Level and text of a heading.
fn heading(line: &str) -> Option<(usize, &str)> {
    let text = line.trim_start_matches('#');
    let level = line.len() - text.len();
    (1..=6).contains(&level).then(|| text.strip_prefix(' ')).flatten().map(|text| (level, text.trim()))
}

/// `stage/name`, if that is what the heading says.
fn node_name(heading: &str) -> Option<&str> {
    let name = heading.trim_matches('`');
    let (stage, stem) = name.split_once('/')?;
    let word = |w: &str| !w.is_empty() && w.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
    (word(stage) && word(stem)).then_some(name)
}

/// The overview: a table a stage.
fn index(nodes: &BTreeMap<String, String>) -> String {
    let mut text = String::from(
        "# Node reference\n\nEvery node that a pipeline can name, generated from the declarations by `cargo xtask docs`. In a terminal\n\
         `manylight nodes NAME` says the same.\n",
    );
    let mut last = "";
    for (name, page) in nodes {
        let (stage, stem) = name.split_once('/').unwrap_or(("", name));
        if stage != last {
            let _ = write!(text, "\n## {stage}\n\n| node | what it does |\n|---|---|\n");
            last = stage;
        }
        let _ = writeln!(text, "| [{stem}]({name}.md) | {} |", first_sentence(page).replace('|', "\\|"));
    }
    text
}

/// The first sentence of the first paragraph under the title.
fn first_sentence(page: &str) -> String {
    let paragraph: Vec<&str> = page.lines().skip(1).map(str::trim).skip_while(|l| l.is_empty()).take_while(|l| !l.is_empty()).collect();
    let paragraph = paragraph.join(" ");
    // A full stop before a number or a small letter is that of an abbreviation: `eqs. 4.4`.
    let goes_on = |rest: &str| rest.starts_with(|c: char| c.is_ascii_digit() || c.is_lowercase());
    match paragraph.match_indices(". ").find(|(at, stop)| !goes_on(&paragraph[at + stop.len()..])) {
        Some((at, _)) => paragraph[..=at].to_owned(),
        None => paragraph,
    }
}

/// The summary with the lines under the node reference replaced by one for each node; `None` without such a line.
fn summary_with(summary: &str, nodes: &BTreeMap<String, String>) -> Option<String> {
    let mut text = String::new();
    let mut found = false;
    for line in summary.lines().filter(|l| !l.contains("(nodes/") || l.contains(INDEX_LINE)) {
        text.push_str(line);
        text.push('\n');
        if line.contains(INDEX_LINE) {
            found = true;
            let indent = line.len() - line.trim_start().len() + 2;
            for name in nodes.keys() {
                let _ = writeln!(text, "{:indent$}- [{name}](nodes/{name}.md)", "");
            }
        }
    }
    found.then_some(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OUTPUT: &str = "# Nodes\n\nSome words.\n\n## clustering\n\n### `clustering/average`\n\nMean position | normal. [ACRSM] 4.7.\n\n#### Inputs\n\n| a |\n\n```ron\n# no/heading\n```\n\n## ism\n\nwords\n\n### ism/splat\n\nDraws points.\n";

    #[test]
    fn nodes_become_pages() {
        let nodes = split(OUTPUT);
        assert_eq!(nodes.keys().collect::<Vec<_>>(), ["clustering/average", "ism/splat"]);
        assert_eq!(
            nodes["clustering/average"],
            "# clustering/average\n\nMean position | normal. [ACRSM] 4.7.\n\n## Inputs\n\n| a |\n\n```ron\n# no/heading\n```\n"
        );
        assert_eq!(nodes["ism/splat"], "# ism/splat\n\nDraws points.\n");
    }

    #[test]
    fn the_index_has_a_table_for_each_stage() {
        let index = index(&split(OUTPUT));
        assert!(index.contains("\n## clustering\n"));
        assert!(index.contains("| [average](clustering/average.md) | Mean position \\| normal. |\n"));
        assert!(index.contains("| [splat](ism/splat.md) | Draws points. |\n"));
    }

    #[test]
    fn the_summary_keeps_what_is_not_generated() {
        let before = "# Summary\n\n- [Node reference](nodes/index.md)\n  - [old/one](nodes/old/one.md)\n- [Results](results/index.md)\n";
        let after = summary_with(before, &split(OUTPUT)).unwrap();
        assert_eq!(
            after,
            "# Summary\n\n- [Node reference](nodes/index.md)\n  - [clustering/average](nodes/clustering/average.md)\n  - [ism/splat](nodes/ism/splat.md)\n- [Results](results/index.md)\n"
        );
        assert_eq!(summary_with(&after, &split(OUTPUT)).unwrap(), after);
        assert_eq!(summary_with("# Summary\n", &split(OUTPUT)), None);
    }

    #[test]
    fn an_abbreviation_ends_no_sentence() {
        assert_eq!(
            first_sentence("# a/b\n\nMaps texels ([ACRSM] 4.6, eqs. 4.4 and 4.5; cf. fig. 2). More.\n"),
            "Maps texels ([ACRSM] 4.6, eqs. 4.4 and 4.5; cf. fig. 2)."
        );
        assert_eq!(first_sentence("# a/b\n\nOne sentence.\n"), "One sentence.");
    }

    #[test]
    fn only_lower_case_paths_are_names() {
        assert_eq!(node_name("`views/cluster_map`"), Some("views/cluster_map"));
        assert_eq!(node_name("Inputs/outputs"), None);
        assert_eq!(node_name("a/b/c"), None);
        assert_eq!(node_name("views/"), None);
    }
}
