//! How stable the methods are in numbers: the tests that measure it, their records in docs/records/numbers, and the tables of the book made of these.

use std::{collections::BTreeMap, fmt::Write as _, path::Path, time::Instant};

use crate::{
    json::Value,
    shell::{Shell, Stop},
};

/// The records, beside those of sweeps.
pub const FOLDER: &str = "numbers";
const RECORDS: &str = "docs/records/numbers";
/// While the tests run; what is in the repository is replaced only when all of them pass.
const FRESH: &str = "target/numbers";
const VARIABLE: &str = "MANYLIGHT_RECORD_NUMBERS";
/// The modules of tests that write records. They share a process, as the functions of several tests share one file.
const TESTS: [&str; 5] = ["functions::", "hard_scenes::", "matrix::", "energy::", "temporal::"];

/// Runs the tests that measure, keeps what they record, and says how long it took.
pub fn numbers(shell: &Shell) -> Result<(), Stop> {
    let (fresh, records) = (shell.root.join(FRESH), shell.root.join(RECORDS));
    let failed = |path: &Path, e: std::io::Error| Stop::failed(format!("{}: {e}", path.display()));
    let _ = std::fs::remove_dir_all(&fresh);
    let build = ["cargo", "test", "--release", "--package", "manylight-tests", "--test", "main"];
    if shell.show(&[&build[..], &["--no-run"]].concat()) != Some(0) {
        return Err(Stop::failed("the build failed"));
    }
    let start = Instant::now();
    let folder = fresh.to_string_lossy().into_owned();
    if shell.show_with(&[(VARIABLE, &folder)], &[&build[..], &["--"], &TESTS[..]].concat()) != Some(0) {
        return Err(Stop::failed(format!("a test failed: {RECORDS} stays as it is")));
    }
    std::fs::create_dir_all(&records).map_err(|e| failed(&records, e))?;
    for entry in std::fs::read_dir(&fresh).map_err(|e| failed(&fresh, e))?.flatten() {
        let target = records.join(entry.file_name());
        std::fs::copy(entry.path(), &target).map_err(|e| failed(&target, e))?;
    }
    println!("{RECORDS} written after {:.0} s of tests; `cargo xtask docs` makes the tables", start.elapsed().as_secs_f64());
    Ok(())
}

/// The tables, by name, from the records.
pub fn tables(root: &Path) -> Result<BTreeMap<&'static str, String>, Stop> {
    let read = |name| rows(root, name);
    let (functions, nodes): (Vec<Value>, Vec<Value>) = read("functions")?.into_iter().partition(|row| !name(row, "function").contains('/'));
    let (scenes, combinations, sphere, sequences) =
        (read("hard_scenes")?, read("combinations")?, read("hollow_sphere")?, read("temporal")?);
    let adapter = read("adapter")?.first().map(|row| format!("{}, {}", name(row, "adapter"), name(row, "driver"))).unwrap_or_default();
    Ok(BTreeMap::from([
        ("summary", summary(&functions, &nodes, &scenes, &combinations, &sphere, &sequences, &adapter)),
        ("functions", functions_table(&functions)),
        ("nodes", functions_table(&nodes)),
        ("scenes", scenes_table(&scenes)),
        ("combinations", combinations_table(&combinations)),
        ("sphere", sphere_table(&sphere)),
        ("sequences", sequences_table(&sequences)),
    ]))
}

/// A page in which what stands between `<!-- numbers: NAME -->` and `<!-- end -->` is the table of that name.
pub fn with_tables(page: &str, tables: &BTreeMap<&str, String>) -> Result<String, String> {
    let mut text = String::new();
    let mut rest = page;
    while let Some((before, after)) = rest.split_once("<!-- numbers: ") {
        let (name, after) = after.split_once(" -->").ok_or("a table's name does not end with ` -->`")?;
        let (_, after) = after.split_once("<!-- end -->").ok_or_else(|| format!("the table `{name}` has no `<!-- end -->`"))?;
        let table = tables.get(name).ok_or_else(|| format!("there is no table `{name}`"))?;
        let _ = write!(text, "{before}<!-- numbers: {name} -->\n\n{}\n\n<!-- end -->", table.trim());
        rest = after;
    }
    Ok(text + rest)
}

fn rows(root: &Path, name: &str) -> Result<Vec<Value>, Stop> {
    let path = format!("{RECORDS}/{name}.json");
    let text =
        std::fs::read_to_string(root.join(&path)).map_err(|e| Stop::failed(format!("{path}: {e}: `cargo xtask numbers` writes it")))?;
    match Value::parse(&text) {
        Some(Value::Array(rows)) => Ok(rows),
        _ => Err(Stop::failed(format!("{path}: this is no array in JSON: `cargo xtask numbers` writes it anew"))),
    }
}

fn name<'a>(row: &'a Value, key: &str) -> &'a str {
    row.get(key).and_then(Value::text).unwrap_or_default()
}

fn number(row: &Value, key: &str) -> f64 {
    row.get(key).and_then(Value::number).unwrap_or_default()
}

fn sum(rows: &[Value], key: &str) -> f64 {
    rows.iter().map(|row| number(row, key)).sum()
}

/// The stem of a pipeline's file.
fn pipeline(row: &Value) -> &str {
    let path = name(row, "pipeline");
    Path::new(path).file_stem().and_then(|stem| stem.to_str()).unwrap_or(path)
}

/// The largest value of a row's differences, or of one of them.
fn difference(row: &Value, wanted: impl Fn(&str) -> bool) -> Option<f64> {
    let Some(Value::Object(all)) = row.get("differences") else { return None };
    all.iter().filter(|(case, _)| wanted(case)).filter_map(|(_, value)| value.number()).reduce(f64::max)
}

/// Of the cases of a scene that is elsewhere; all others are of its size.
fn is_moved(case: &str) -> bool {
    case.ends_with("away")
}

fn summary(
    functions: &[Value],
    nodes: &[Value],
    scenes: &[Value],
    combinations: &[Value],
    sphere: &[Value],
    sequences: &[Value],
    adapter: &str,
) -> String {
    let nearest = |rows: &[Value]| {
        let share = |row: &Value| number(row, "worst") / number(row, "bound").max(f64::MIN_POSITIVE);
        let row = rows.iter().max_by(|a, b| share(a).total_cmp(&share(b)));
        row.map(|row| format!("each is within its bound, `{}` the nearest at {:.0} % of it", name(row, "function"), 100.0 * share(row)))
            .unwrap_or_default()
    };
    let worst = |moved: bool| scenes.iter().filter_map(|row| difference(row, |case| is_moved(case) == moved)).fold(0.0, f64::max);
    let largest = |rows: &[Value], value: &dyn Fn(&Value) -> f64| rows.iter().map(|row| value(row).abs()).fold(0.0, f64::max);
    let off = |row: &Value| number(row, "mean") - 1.0;
    let mut text = String::from("| what | tried | what came of it |\n|---|---|---|\n");
    for (what, rows) in [("functions of `shaders/common` and their twins", functions), ("formulas of single nodes and their twins", nodes)]
    {
        let _ = writeln!(text, "| {what} | {}, {} calls | {} |", rows.len(), grouped(sum(rows, "inputs")), nearest(rows));
    }
    let _ = writeln!(
        text,
        "| pipelines on hard scenes | {} pipelines, up to {} scenes, {} renders | numbers that are NaN, infinite or below zero, and other faults: {} |",
        scenes.len(),
        largest(scenes, &|row| number(row, "scenes")),
        sum(scenes, "renders"),
        sum(scenes, "faults")
    );
    let _ =
        writeln!(text, "| the same scene a thousandth or ten thousand times as large | | difference: at most {} |", percent(worst(false)));
    let _ = writeln!(text, "| the same scene 10,000 units away | | difference: at most {} |", percent(worst(true)));
    let _ = writeln!(
        text,
        "| combinations of options | {} planned, {} refused with a reason, {} renders | numbers that are NaN, infinite or below zero, and other faults: {} |",
        grouped(sum(combinations, "planned")),
        grouped(sum(combinations, "refused")),
        grouped(sum(combinations, "rendered")),
        sum(combinations, "faults")
    );
    let _ = writeln!(
        text,
        "| a hollow sphere, whose light is known | {} pipelines | mean off by at most {} (`{}`) |",
        sphere.len(),
        percent(largest(sphere, &off)),
        sphere.iter().max_by(|a, b| off(a).abs().total_cmp(&off(b).abs())).map_or("", pipeline)
    );
    let _ = writeln!(
        text,
        "| sequences, played twice | {} pipelines, {} frames | the same bits; drift at most {} |",
        sequences.len(),
        grouped(sum(sequences, "frames")),
        percent(largest(sequences, &|row| number(row, "drift")))
    );
    let _ = write!(text, "\nMeasured on the adapter {adapter}.");
    text
}

/// A table for each module (or stage).
fn functions_table(rows: &[Value]) -> String {
    let mut text = String::new();
    let mut last = "";
    for row in rows {
        let function = name(row, "function");
        let (module, stem) = function.split_once("::").or_else(|| function.split_once('/')).unwrap_or(("", function));
        if module != last {
            let _ = write!(text, "\n### {module}\n\n| function | calls | worst error | bound | why that much |\n|---|---|---|---|---|\n");
            last = module;
        }
        let unit = name(row, "unit");
        let _ = writeln!(
            text,
            "| `{stem}` | {} | {} | {} | {} |",
            grouped(number(row, "inputs")),
            error(number(row, "worst"), unit),
            error(number(row, "bound"), unit),
            name(row, "reason").replace('|', "\\|"),
        );
    }
    text
}

fn scenes_table(rows: &[Value]) -> String {
    let mut text =
        String::from("| pipeline | scenes | renders | refused | faults | other size | moved by 10,000 |\n|---|---|---|---|---|---|---|\n");
    for row in rows {
        let shown = |moved: bool| difference(row, |case| is_moved(case) == moved).map_or("–".to_owned(), percent);
        let _ = writeln!(
            text,
            "| `{}` | {} | {} | {} | {} | {} | {} |",
            pipeline(row),
            number(row, "scenes"),
            number(row, "renders"),
            number(row, "refused"),
            number(row, "faults"),
            shown(false),
            shown(true)
        );
    }
    text
}

fn combinations_table(rows: &[Value]) -> String {
    let mut text = String::from("| pipeline | planned | refused | renders | refused for a number | faults |\n|---|---|---|---|---|---|\n");
    for row in rows {
        let [planned, refused, rendered, without, faults] =
            ["planned", "refused", "rendered", "refused_for_numbers", "faults"].map(|key| grouped(number(row, key)));
        let _ = writeln!(text, "| `{}` | {planned} | {refused} | {rendered} | {without} | {faults} |", pipeline(row));
    }
    text
}

fn sphere_table(rows: &[Value]) -> String {
    let mut text = String::from("| pipeline | mean over the analytic value | standard deviation over pixels |\n|---|---|---|\n");
    for row in rows {
        let _ = writeln!(text, "| `{}` | {:.4} | {:.4} |", pipeline(row), number(row, "mean"), number(row, "spread"));
    }
    text
}

fn sequences_table(rows: &[Value]) -> String {
    let mut text = String::from("| pipeline | frames | drift | flicker |\n|---|---|---|---|\n");
    for row in rows {
        let drift = row.get("drift").and_then(Value::number).map_or("–".to_owned(), percent);
        let _ = writeln!(text, "| `{}` | {} | {drift} | {} |", pipeline(row), number(row, "frames"), percent(number(row, "flicker")));
    }
    text
}

fn percent(share: f64) -> String {
    if share != 0.0 && share.abs() < 5e-5 { "< 0.01 %".to_owned() } else { format!("{:.2} %", 100.0 * share) }
}

/// An error in its unit; relative ones are shares.
fn error(value: f64, unit: &str) -> String {
    match (unit, value == 0.0) {
        (_, true) => "0".to_owned(),
        ("ulp", _) => format!("{value:.1} ulp"),
        ("relative", _) => format!("{} of the value", scientific(value)),
        _ => scientific(value),
    }
}

/// Two digits and a power of ten, where there are many zeros.
fn scientific(value: f64) -> String {
    let digits = |exponent: &str| -> String {
        let superscript = |letter: char| {
            if letter == '-' { '⁻' } else { ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][letter as usize & 15] }
        };
        exponent.chars().map(superscript).collect()
    };
    match format!("{value:.1e}").split_once('e') {
        Some((digit, exponent)) if value.abs() < 0.01 => format!("{digit}·10{}", digits(exponent)),
        _ => format!("{value:.2}"),
    }
}

/// A whole number with commas.
fn grouped(value: f64) -> String {
    let digits = format!("{value:.0}");
    let comma = |at: usize| at > 0 && (digits.len() - at).is_multiple_of(3);
    digits.chars().enumerate().flat_map(|(at, digit)| [comma(at).then_some(','), Some(digit)]).flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_shown_as_people_read_them() {
        assert_eq!(grouped(0.0), "0");
        assert_eq!(grouped(1_234_567.0), "1,234,567");
        assert_eq!(scientific(3.14e-7), "3.1·10⁻⁷");
        assert_eq!(scientific(0.25), "0.25");
        assert_eq!(error(1.26, "ulp"), "1.3 ulp");
        assert_eq!(error(0.0, "ulp"), "0");
        assert_eq!([percent(0.0), percent(-0.0019), percent(1e-6)], ["0.00 %", "-0.19 %", "< 0.01 %"]);
    }

    #[test]
    fn tables_replace_what_stood_at_their_place() {
        let tables = BTreeMap::from([("a", "| new |\n".to_owned())]);
        let page = "before\n<!-- numbers: a -->\nold\n<!-- end -->\nafter\n";
        let wanted = "before\n<!-- numbers: a -->\n\n| new |\n\n<!-- end -->\nafter\n";
        assert_eq!(with_tables(page, &tables).as_deref(), Ok(wanted));
        assert_eq!(with_tables(wanted, &tables).as_deref(), Ok(wanted));
        assert!(with_tables("<!-- numbers: b --><!-- end -->", &tables).is_err());
        assert!(with_tables("<!-- numbers: a -->", &tables).is_err());
    }

    #[test]
    fn functions_have_a_table_for_each_module() {
        let rows =
            r#"[{"function": "a::f", "inputs": 4096, "worst": 1.5, "unit": "ulp", "bound": 2.0, "reason": "x|y"}, {"function": "b::g"}]"#;
        let Some(Value::Array(rows)) = Value::parse(rows) else { panic!("JSON") };
        let text = functions_table(&rows);
        assert!(text.contains("### a\n") && text.contains("| `f` | 4,096 | 1.5 ulp | 2.0 ulp | x\\|y |\n"), "{text}");
        assert!(text.contains("### b\n") && text.contains("| `g` | 0 | 0 | 0 |"), "{text}");
    }

    #[test]
    fn differences_of_size_and_place_are_told_apart() {
        let row = Value::parse(r#"{"differences": {"a thousandth": 0.001, "ten thousand times": 0.002, "10,000 away": 0.005}}"#).unwrap();
        assert_eq!(difference(&row, |case| !is_moved(case)), Some(0.002));
        assert_eq!(difference(&row, is_moved), Some(0.005));
    }
}
