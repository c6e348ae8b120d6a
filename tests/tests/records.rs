//! What tests measured, for the book: `cargo xtask numbers` keeps it in `docs/records/numbers`, by setting `MANYLIGHT_RECORD_NUMBERS` to a folder.

use std::{collections::BTreeSet, env, fs, path::Path};

use serde_json::Value;

use crate::{functions, matrix::pipelines, support::root};

/// Writes one file of an array of objects, one a line.
pub fn write(name: &str, rows: &[Value]) {
    if let Some(folder) = env::var_os("MANYLIGHT_RECORD_NUMBERS") {
        let file = Path::new(&folder).join(name).with_extension("json");
        let lines: Vec<String> = rows.iter().map(Value::to_string).collect();
        fs::create_dir_all(&folder)
            .and_then(|()| fs::write(file, format!("[\n{}\n]\n", lines.join(",\n"))))
            .expect("the folder for records is writable");
    }
}

/// The values of a key in all rows of a file in the repository.
fn recorded(name: &str, key: &str) -> BTreeSet<String> {
    let file = root().join("docs/records/numbers").join(name).with_extension("json");
    let text = fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}: `cargo xtask numbers` writes it", file.display()));
    let rows: Vec<Value> = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    rows.iter().map(|row| row[key].as_str().unwrap_or_else(|| panic!("{}: {row} has no {key}", file.display())).to_owned()).collect()
}

/// Fails when something is not in a record, or is there and nowhere else.
fn assert_fits(what: &str, recorded: &BTreeSet<String>, there: &BTreeSet<String>) {
    let (new, gone): (Vec<_>, Vec<_>) = (there.difference(recorded).collect(), recorded.difference(there).collect());
    let remedy = "run `cargo xtask numbers`, then `cargo xtask docs`";
    assert!(new.is_empty() && gone.is_empty(), "docs/records/numbers: of {what} {new:?} are missing, {gone:?} are no more: {remedy}");
}

#[test]
fn every_function_is_in_the_record() {
    let known = functions::functions();
    // Names with a slash are those of nodes.
    let recorded = recorded("functions", "function").into_iter().filter(|name| !name.contains('/')).collect();
    assert_fits("the functions of shaders/common", &recorded, &known);
}

#[test]
fn every_pipeline_is_in_the_records() {
    let known: BTreeSet<String> = pipelines().into_iter().collect();
    for name in ["hard_scenes", "combinations"] {
        assert_fits("the pipelines", &recorded(name, "pipeline"), &known);
    }
}
