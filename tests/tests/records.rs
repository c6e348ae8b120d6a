//! What tests measured, for the book: written where `MANYLIGHT_RECORD_NUMBERS` names a folder.

use std::{env, fs, path::Path};

use serde_json::Value;

/// Writes one file of an array of objects.
pub fn write(name: &str, rows: &[Value]) {
    if let Some(folder) = env::var_os("MANYLIGHT_RECORD_NUMBERS") {
        let file = Path::new(&folder).join(name).with_extension("json");
        let lines: Vec<String> = rows.iter().map(Value::to_string).collect();
        fs::create_dir_all(&folder)
            .and_then(|()| fs::write(file, format!("[\n{}\n]\n", lines.join(",\n"))))
            .expect("the folder for records is writable");
    }
}
