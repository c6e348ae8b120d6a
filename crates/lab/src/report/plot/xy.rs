//! Points and lines over two axes.

use plotters::{
    prelude::*,
    style::text_anchor::{HPos, VPos},
};

use super::{Area, Axis, Entry, Fault, GRID, LEGEND, Look, TEXT, Tip, draw, font, legend, marks::MARK, width_of, write};

const SIZE: (i32, i32) = (940, 440);
const HEAD: i32 = 34;
/// Labels beside points; more would hide the points.
const LABELS: usize = 16;

/// A scatter plot or a plot of curves. Its axes hold all points.
pub(in crate::report) struct Plot {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    /// What a ring around a point means.
    pub ring: Option<&'static str>,
}

/// Points that belong together. Series of one name share one entry of the legend; those without a name have none.
pub(in crate::report) struct Series {
    pub name: String,
    pub look: Look,
    pub line: Line,
    pub marks: bool,
    pub points: Vec<Point>,
}

/// How the points of a series are joined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::report) enum Line {
    None,
    Solid,
    Dashed,
}

/// A point of a series.
#[derive(Debug, Clone, Default, PartialEq)]
pub(in crate::report) struct Point {
    pub at: (f64, f64),
    /// Told when the pointer rests on it.
    pub tip: String,
    /// Written beside it where there is room.
    pub label: Option<String>,
    /// It has a ring.
    pub ring: bool,
}

type Box4 = (i32, i32, i32, i32);

impl Plot {
    /// Its SVG document.
    pub fn svg(&self) -> Result<String, String> {
        draw(&self.title, (SIZE.0 as u32, SIZE.1 as u32), |area| self.draw(area))
    }

    fn draw(&self, area: &Area<'_>) -> Result<Vec<Tip>, Fault> {
        write(area, &self.title, (10, 10), (HPos::Left, VPos::Top), true)?;
        let mut chart = ChartBuilder::on(area)
            .margin_top(HEAD)
            .margin_right(LEGEND + 20)
            .margin_bottom(8)
            .margin_left(8)
            .x_label_area_size(44)
            .y_label_area_size(36 + 7 * self.y.widest_label() as i32)
            .build_cartesian_2d(self.x.clone(), self.y.clone())?;
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .label_style(font(TEXT))
            .axis_desc_style(font(TEXT))
            .x_desc(&self.x.title)
            .y_desc(&self.y.title)
            .draw()?;
        let (columns, rows) = chart.plotting_area().get_pixel_range();
        let inside = (columns.start, rows.start, columns.end, rows.end);
        let place = |p: &Point| chart.backend_coord(&p.at);
        for series in &self.series {
            series.draw_line(area, series.points.iter().map(place).collect())?;
        }
        let mut tips = Vec::new();
        let placed: Vec<(&Series, &Point, (i32, i32))> =
            self.series.iter().flat_map(|s| s.points.iter().map(move |p| (s, p, place(p)))).collect();
        for (series, point, at) in placed.iter().filter(|p| p.0.marks) {
            series.look.mark(area, *at)?;
            if point.ring {
                ring(area, *at)?;
            }
            tips.push(Tip { from: (at.0 - 6, at.1 - 6), to: (at.0 + 6, at.1 + 6), text: point.tip.clone() });
        }
        let marks: Vec<Box4> = placed.iter().filter(|p| p.0.marks).map(|p| around(p.2, MARK + 2)).collect();
        draw_labels(area, inside, marks, placed.iter().filter_map(|p| Some((p.1.label.as_deref()?, p.2))))?;
        tips.extend(legend(area, (SIZE.0 - LEGEND, HEAD), SIZE.1 - 8, &self.entries())?);
        Ok(tips)
    }

    fn entries(&self) -> Vec<Entry<'_>> {
        let mut entries: Vec<Entry<'_>> = Vec::new();
        for series in self.series.iter().filter(|s| !s.name.is_empty()) {
            if entries.iter().all(|e| e.name != series.name) {
                let key = Box::new(move |area: &Area<'_>, (x, y): (i32, i32)| {
                    series.draw_line(area, vec![(x - 11, y), (x + 11, y)])?;
                    if series.marks { series.look.mark(area, (x, y)) } else { Ok(()) }
                });
                entries.push(Entry { name: &series.name, key });
            }
        }
        if let Some(name) = self.ring {
            entries.push(Entry { name, key: Box::new(ring) });
        }
        entries
    }
}

impl Series {
    fn draw_line(&self, area: &Area<'_>, path: Vec<(i32, i32)>) -> Result<(), Fault> {
        let colour = self.look.colour();
        match self.line {
            Line::None => Ok(()),
            _ if path.len() < 2 => Ok(()),
            Line::Solid => area.draw(&PathElement::new(path, colour.mix(0.7).stroke_width(2))),
            Line::Dashed => area.draw(&plotters::element::DashedPathElement::new(path, 6, 4, colour.stroke_width(1))),
        }
    }
}

fn ring(area: &Area<'_>, at: (i32, i32)) -> Result<(), Fault> {
    area.draw(&Circle::new(at, MARK + 3, BLACK.stroke_width(1)))
}

fn around((x, y): (i32, i32), r: i32) -> Box4 {
    (x - r, y - r, x + r, y + r)
}

/// Writes labels right, left, above or below their points, where they cover nothing; those without such a place are left out.
fn draw_labels<'l>(
    area: &Area<'_>,
    inside: Box4,
    mut taken: Vec<Box4>,
    labels: impl Iterator<Item = (&'l str, (i32, i32))>,
) -> Result<(), Fault> {
    let (gap, half) = (MARK + 5, TEXT as i32 / 2 + 1);
    for (label, (x, y)) in labels.take(LABELS) {
        let width = width_of(label);
        let places = [(x + gap, y), (x - gap - width, y), (x - width / 2, y - gap - half), (x - width / 2, y + gap + half)];
        let free = places.into_iter().map(|(x, y)| (x, y - half, x + width, y + half)).find(|b| {
            let within = b.0 >= inside.0 && b.1 >= inside.1 && b.2 <= inside.2 && b.3 <= inside.3;
            within && taken.iter().all(|t| b.2 <= t.0 || t.2 <= b.0 || b.3 <= t.1 || t.3 <= b.1)
        });
        if let Some(place) = free {
            // Lines beneath stay faintly in sight.
            area.draw(&Rectangle::new([(place.0, place.1), (place.2, place.3)], WHITE.mix(0.75).filled()))?;
            write(area, label, (place.0, place.1 + half), (HPos::Left, VPos::Center), false)?;
            taken.push(place);
        }
    }
    Ok(())
}
