//! The report as a whole, over made-up sweeps.

use roxmltree::{Document, ParsingOptions};

use super::{
    csv, html, markdown,
    study::{Study, all_stages},
    synthetic::{run, sweep},
};
use crate::sheet::{Axis, Sheet};

const PNG: &[u8] = b"\x89PNG made up";

fn page(sheet: &Sheet, records: &[crate::record::Record]) -> String {
    html(sheet, records, &|name| (!name.contains("missing")).then(|| PNG.to_vec()))
}

/// The page as XML, once its empty elements are closed.
fn xml(page: &str) -> String {
    let mut text = page.to_owned();
    for tag in ["<meta", "<img", "<br"] {
        let mut from = 0;
        while let Some(start) = text[from..].find(tag) {
            let end = from + start + text[from + start..].find('>').expect("a tag ends");
            text.insert(end, '/');
            from = end;
        }
    }
    text
}

fn checked(page: &str) {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    if let Err(e) = Document::parse_with_options(&xml(page), options) {
        panic!("not well formed: {e}");
    }
}

#[test]
fn the_page_is_well_formed_and_shows_each_run() {
    let (sheet, records) = sweep();
    let page = page(&sheet, &records);
    checked(&page);
    for label in Study::new(&sheet, &records).labels {
        assert!(page.contains(&format!("<td>{label}</td>")), "{label}");
        assert!(page.contains(&format!("<strong>{label}</strong>")), "{label}");
    }
    for text in ["How does the error fall", "times are those of a CPU", "Pareto front", "Mitsuba path, 16 cores", "[VAL] table 1"] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("http://") || page.matches("http://").count() == page.matches("http://www.w3.org/2000/svg").count());
    assert!(!page.contains("<script") && !page.contains("class=\"warning\""));
}

#[test]
fn the_slope_of_a_power_law_is_drawn() {
    let (sheet, records) = sweep();
    let page = page(&sheet, &records);
    assert!(page.contains("val filter=tent: RMSE / mean ∝ clusters^−0.50, fitted to 5 points."), "no slope");
    assert!(page.contains("slope −0.50: val filter=tent"));
}

#[test]
fn a_run_without_finite_error_is_left_out_and_counted() {
    let (sheet, mut records) = sweep();
    records[0].metrics.insert("relative_rmse".into(), f64::NAN);
    records[1].metrics.clear();
    records[2].times.nodes[0].median = f64::INFINITY;
    records[3].sequence[0].metrics.insert("relative_rmse".into(), f64::NAN);
    records[4].pictures.image = Some("missing.png".into());
    let page = page(&sheet, &records);
    checked(&page);
    assert!(!page.contains("NaN") && !page.contains(">inf<"));
    let missing = "2 of 20 runs left out, their RMSE / mean or time is missing or not finite: val clusters=16 filter=tent; val clusters=32";
    assert!(page.contains(missing), "not counted");
    assert!(page.contains("1 of 20 runs left out, they have no times of nodes"));
    assert!(page.contains("1 frame left out"));
    assert!(page.contains("1 picture could not be read"));
    assert!(markdown(&sheet, &records).text.contains("2 of 20 runs left out"));
}

#[test]
fn nothing_but_holes_still_makes_a_page() {
    let (sheet, mut records) = sweep();
    for record in &mut records {
        record.metrics.clear();
        record.times.nodes.clear();
        record.times.wall.median = f64::NAN;
        record.sequence.clear();
    }
    let page = page(&sheet, &records);
    checked(&page);
    // The curve of the other renderer is all that is left.
    assert_eq!(page.matches("<svg").count(), 1);
}

#[test]
fn no_records_are_said_to_be_none() {
    let sheet = Sheet { name: "empty".into(), ..Sheet::default() };
    let page = page(&sheet, &[]);
    checked(&page);
    assert!(page.contains("There are no records"));
    assert!(markdown(&sheet, &[]).text.contains("There are no records"));
    assert_eq!(csv(&[]).lines().count(), 1);
}

#[test]
fn names_cannot_be_markup() {
    let (mut sheet, mut records) = sweep();
    let evil = "<script>alert(\"1 & '2'\")</script>\u{1}|";
    sheet.name = evil.into();
    sheet.doc = evil.into();
    sheet.papers[0].source = evil.into();
    sheet.curves[0].name = evil.into();
    for record in &mut records {
        record.variant = evil.into();
        record.scene.name = evil.into();
        record.times.nodes[0].stage = evil.into();
        record.set.insert(evil.into(), evil.into());
        record.varied.push(evil.into());
        record.metrics.insert(evil.into(), 1.0);
    }
    sheet.metric = evil.into();
    let page = page(&sheet, &records);
    assert!(!page.contains("<script"));
    checked(&page);
    let book = markdown(&sheet, &records);
    assert!(!book.text.replace("\\<", "").contains('<'));
    for (name, svg) in book.figures {
        assert!(name.chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c)), "{name}");
        Document::parse(&svg).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
}

#[test]
fn mixed_runs_are_warned_of() {
    let (sheet, mut records) = sweep();
    records[0].adapter = serde_json::json!({"name": "Example GPU", "kind": "discrete"});
    records[1].manylight = "0.2.0".into();
    records[2].reference.hash = "02".into();
    let page = page(&sheet, &records);
    for text in ["different adapters", "different versions of manylight", "The runs of cornell, 256×256 differ in scene files"] {
        assert!(page.contains(text), "{text}");
    }
    assert_eq!(page.matches("class=\"warning\"").count(), 3);
}

#[test]
fn the_book_links_the_figures_that_it_has() {
    let (sheet, records) = sweep();
    let book = markdown(&sheet, &records);
    assert_eq!(book.figures.len(), 4);
    for (name, svg) in &book.figures {
        assert_eq!(book.text.matches(&format!("]({name})")).count(), 1, "{name}");
        Document::parse(svg).unwrap_or_else(|e| panic!("{name}: {e}"));
    }
    assert!(book.text.contains("| ● |"));
}

#[test]
fn ratios_of_a_paper_stand_beside_ours() {
    let (sheet, records) = sweep();
    let text = markdown(&sheet, &records).text;
    let line = text.lines().find(|l| l.starts_with("| vpl-simple | frame |")).expect("row of the paper");
    let cells: Vec<&str> = line.split('|').map(str::trim).collect();
    // Printed, ours, runs, then the ratios of both to the first row and to the first column.
    assert_eq!((cells[3], cells[5], cells[6], cells[8]), ("52.0", "10", "2.00", "1.73"));
}

#[test]
fn the_sheet_chooses_the_time() {
    let (mut sheet, records) = sweep();
    sheet.axis = Axis::Picture;
    let page = page(&sheet, &records);
    assert!(page.contains("cornell, 256×256: RMSE / mean against time until the picture"));
    assert!(page.contains("RMSE / mean 0.291, time until the picture 207 ms"));
    assert!(page.contains("time of a frame, on a CPU (ms)"), "stages are those of a frame");
}

#[test]
fn rates_are_compared_as_times() {
    let (mut sheet, records) = sweep();
    sheet.papers[0].unit = "fps".into();
    let text = markdown(&sheet, &records).text;
    let line = text.lines().find(|l| l.starts_with("| vpl-simple | frame |")).expect("row of the paper");
    assert_eq!(line.split('|').nth(6).map(str::trim), Some("0.500"));
}

#[test]
fn stages_keep_the_order_of_the_plans() {
    let first = run("val", "cornell", 16, "tent");
    let mut second = first.clone();
    second.times.nodes.retain(|n| n.stage != "ism");
    let mut third = first.clone();
    third.times.nodes[4].stage = "cssm".into();
    third.times.nodes.swap(3, 4);
    assert_eq!(all_stages(&[second, first, third]), ["rsm", "ism", "cssm", "lighting", "filter"]);
}

#[test]
fn a_stage_without_a_sample_has_no_time_rather_than_0() {
    let (sheet, mut records) = sweep();
    records[0].times.nodes[0].median = 0.0;
    let row = csv(&records).lines().nth(1).expect("a run").to_owned();
    assert!(row.contains(",,"), "{row}");
    assert!(page(&sheet, &records).contains("<td>val clusters=16 filter=tent</td><td class=\"number\">–</td>"));
}

#[test]
fn hundreds_of_runs_are_split_over_figures() {
    let (sheet, records) = sweep();
    let many: Vec<_> = (0..200)
        .map(|seed| {
            let mut record = records[seed % 10].clone();
            record.seed = seed as u32;
            record
        })
        .collect();
    let page = page(&sheet, &many);
    checked(&page);
    assert!(page.contains("time by stage (7 of 7)"));
    assert!(page.contains("RMSE / mean over time (15 of 15)"));
}
