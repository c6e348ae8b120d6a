//! Links between the Markdown files of the repository: each leads to a file, and each page of the book is in its summary.

use std::path::{Path, PathBuf};

use crate::shell::Stop;

const BOOK: &str = "docs/src";
const DECISIONS: &str = "docs/decisions";
const TOP: [&str; 3] = ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"];

/// Fails with every link that leads nowhere and every page that the summary does not name.
pub fn check(root: &Path) -> Result<(), Stop> {
    let book = root.join(BOOK);
    let mut files = markdown_files(&book).map_err(|e| Stop::failed(format!("{BOOK}: {e}")))?;
    files.extend(markdown_files(&root.join(DECISIONS)).map_err(|e| Stop::failed(format!("{DECISIONS}: {e}")))?);
    files.extend(TOP.iter().map(|name| root.join(name)));
    let mut faults = Vec::new();
    for file in &files {
        let shown = file.strip_prefix(root).unwrap_or(file).display();
        let text = match std::fs::read_to_string(file) {
            Ok(text) => text,
            Err(error) => {
                faults.push(format!("{shown}: {error}"));
                continue;
            }
        };
        let folder = file.parent().unwrap_or(root);
        let broken = targets(&text).into_iter().filter(|(_, target)| !folder.join(target).exists());
        faults.extend(broken.map(|(line, target)| format!("{shown}:{line}: there is no `{target}`")));
    }
    let summary = std::fs::read_to_string(book.join("SUMMARY.md")).unwrap_or_default();
    let named: Vec<PathBuf> = targets(&summary).into_iter().map(|(_, t)| book.join(t)).collect();
    let orphans = files.iter().filter(|f| f.starts_with(&book) && !f.ends_with("SUMMARY.md") && !named.contains(f));
    faults.extend(orphans.map(|f| format!("{}: SUMMARY.md does not name this page", f.strip_prefix(root).unwrap_or(f).display())));
    if faults.is_empty() { Ok(()) } else { Err(Stop::failed(faults.join("\n"))) }
}

/// Every `.md` file below a folder, sorted; none when the folder is not there.
pub fn markdown_files(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    if !folder.exists() {
        return Ok(files);
    }
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            files.extend(markdown_files(&path)?);
        } else if path.extension().is_some_and(|e| e == "md") {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// Line and path of every inline link or picture that names a file of the repository; code is left out.
fn targets(markdown: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut fenced = false;
    for (number, line) in markdown.lines().enumerate() {
        let fence = line.trim_start().starts_with("```");
        fenced ^= fence;
        if fenced || fence {
            continue;
        }
        // Every second part lies between back-ticks, or begins a text without an end.
        let prose: String = line.split('`').step_by(2).collect();
        for part in prose.split("](").skip(1) {
            let target = part.split([')', ' ', '#']).next().unwrap_or_default();
            if !target.is_empty() && !target.contains("://") && !target.starts_with("mailto:") {
                found.push((number + 1, target.to_owned()));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_are_found_outside_of_code() {
        let text = "See [a](x/y.md#part), [b](https://example.org/z), ![p](i.png \"t\") and [here](#below).\n```\n[c](no.md)\n```\nA `[d](no.md)` b.\n";
        assert_eq!(targets(text), [(1, "x/y.md".to_owned()), (1, "i.png".to_owned())]);
    }

    #[test]
    fn a_link_whose_text_is_code_counts() {
        assert_eq!(targets("[`a`](b.md)"), [(1, "b.md".to_owned())]);
    }
}
