//! Plots as SVG: colours that are told apart by colour-blind readers too, legends beside the data, tooltips.

mod axis;
mod bars;
mod marks;
mod xy;

use std::fmt::Write as _;

use maud::{Escaper, Markup, html};
use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

pub(super) use axis::Axis;
pub(super) use bars::{Bar, Bars};
pub(super) use marks::{Look, stage_colour};
pub(super) use xy::{Line, Plot, Point, Series};

use super::text::{printable, shorten};

/// Height of text in pixels.
const TEXT: f64 = 12.0;
/// Width of a character over the height of text, a little generous: what fonts a reader has is not known.
const CHARACTER: f64 = 0.58;
/// Height of a row of a legend.
const ROW: i32 = 18;
/// Width of a legend.
const LEGEND: i32 = 290;
/// Grid lines.
const GRID: RGBColor = RGBColor(221, 221, 221);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Fault = DrawingAreaErrorKind<std::io::Error>;

/// Draws the key of an entry of a legend around a point.
type Key<'a> = Box<dyn Fn(&Area<'_>, (i32, i32)) -> Result<(), Fault> + 'a>;

/// What is told of a rectangle of a plot when the pointer rests on it.
struct Tip {
    from: (i32, i32),
    to: (i32, i32),
    text: String,
}

/// Draws an SVG document on white ground; `title` names it for readers that do not see it.
fn draw(title: &str, size: (u32, u32), on: impl FnOnce(&Area<'_>) -> Result<Vec<Tip>, Fault>) -> Result<String, String> {
    let mut svg = String::new();
    let tips = {
        let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
        let tips = area.fill(&WHITE).and_then(|()| on(&area)).map_err(|e| e.to_string())?;
        area.present().map_err(|e| e.to_string())?;
        tips
    };
    let mut label = String::new();
    // Text in memory does not refuse to be written to.
    let _ = Escaper::new(&mut label).write_str(title);
    svg = svg.replacen("<svg", &format!("<svg role=\"img\" aria-label=\"{label}\""), 1);
    let end = svg.rfind("</svg>").unwrap_or(svg.len());
    svg.insert_str(end, &html! { @for tip in &tips { (tip.markup()) "\n" } }.into_string());
    Ok(printable(&svg))
}

impl Tip {
    fn markup(&self) -> Markup {
        let (width, height) = ((self.to.0 - self.from.0).max(1), (self.to.1 - self.from.1).max(1));
        html! {
            rect x=(self.from.0) y=(self.from.1) width=(width) height=(height) fill="#000000" fill-opacity="0" { title { (self.text) } }
        }
    }
}

/// Writes text at a point; `bold` for titles.
fn write(area: &Area<'_>, text: &str, at: (i32, i32), (h, v): (HPos, VPos), bold: bool) -> Result<(), Fault> {
    let weight = if bold { FontStyle::Bold } else { FontStyle::Normal };
    let style = TextStyle::from(font(TEXT + if bold { 2.0 } else { 0.0 }).style(weight)).pos(Pos::new(h, v));
    area.draw(&Text::new(text.to_owned(), at, style))
}

/// The font whose text is this many pixels high: plotters makes it smaller by this factor.
fn font(pixels: f64) -> FontDesc<'static> {
    ("sans-serif", pixels * 1.24).into_font()
}

/// Pixels that text takes, about.
fn width_of(text: &str) -> i32 {
    (text.chars().count() as f64 * TEXT * CHARACTER).ceil() as i32
}

/// An entry of a legend.
struct Entry<'a> {
    name: &'a str,
    key: Key<'a>,
}

/// Draws a legend from a corner downwards as far as there is room; says how many entries are left out.
fn legend(area: &Area<'_>, (x, y): (i32, i32), bottom: i32, entries: &[Entry<'_>]) -> Result<Vec<Tip>, Fault> {
    let room = usize::try_from((bottom - y) / ROW).unwrap_or(0).max(2);
    let shown = if entries.len() <= room { entries.len() } else { room - 1 };
    let most = (f64::from(LEGEND - 40) / (TEXT * CHARACTER)) as usize;
    let mut tips = Vec::new();
    let mut top = y;
    for entry in &entries[..shown] {
        (entry.key)(area, (x + 12, top + ROW / 2))?;
        write(area, &shorten(entry.name, most), (x + 30, top + ROW / 2), (HPos::Left, VPos::Center), false)?;
        tips.push(Tip { from: (x, top), to: (x + LEGEND - 10, top + ROW), text: entry.name.to_owned() });
        top += ROW;
    }
    if shown < entries.len() {
        let more = format!("and {} more", entries.len() - shown);
        write(area, &more, (x + 30, top + ROW / 2), (HPos::Left, VPos::Center), false)?;
    }
    Ok(tips)
}
