//! Horizontal bars of stacked parts.

use plotters::{
    prelude::*,
    style::text_anchor::{HPos, VPos},
};

use super::{Area, Axis, Entry, Fault, GRID, LEGEND, ROW, TEXT, Tip, draw, font, legend, stage_colour, width_of, write};
use crate::report::text::{number, shorten};

const WIDTH: i32 = 940;
const HEAD: i32 = 34;
/// From one bar to the next.
const PITCH: i32 = 22;
/// Characters of a bar's label.
const LABEL: usize = 34;
/// Room at the end of the longest bar for its sum.
const SUM: i32 = 52;

/// Bars of parts, all with the same parts in the same order.
pub(in crate::report) struct Bars<'a> {
    pub title: String,
    /// What their lengths are; from 0.
    pub x: Axis,
    /// Names of the parts.
    pub parts: &'a [String],
    pub bars: Vec<Bar>,
    /// What the upright line on a bar is.
    pub line: &'static str,
}

/// One bar.
pub(in crate::report) struct Bar {
    pub label: String,
    /// Lengths by part; `None`: it has no such part.
    pub lengths: Vec<Option<f64>>,
    /// Where its upright line is.
    pub line: Option<f64>,
}

impl Bars<'_> {
    /// Its SVG document.
    pub fn svg(&self) -> Result<String, String> {
        let rows = self.bars.len() as i32 * PITCH;
        // The legend has room for all parts and the line.
        let height = HEAD + 60 + rows.max((self.parts.len() as i32 + 1) * ROW - 40);
        draw(&self.title, (WIDTH as u32, height as u32), |area| self.draw(area, height))
    }

    fn draw(&self, area: &Area<'_>, height: i32) -> Result<Vec<Tip>, Fault> {
        write(area, &self.title, (10, 10), (HPos::Left, VPos::Top), true)?;
        let labels: Vec<String> = self.bars.iter().map(|b| shorten(&b.label, LABEL)).collect();
        let margin = labels.iter().map(|l| width_of(l)).max().unwrap_or(0) + 20;
        let mut chart = ChartBuilder::on(area)
            .margin_top(HEAD)
            .margin_right(LEGEND + SUM)
            .margin_bottom(height - HEAD - 52 - self.bars.len() as i32 * PITCH)
            .margin_left(margin)
            .x_label_area_size(44)
            .build_cartesian_2d(self.x.clone(), -0.5..self.bars.len() as f64 - 0.5)?;
        chart
            .configure_mesh()
            .disable_y_mesh()
            .disable_y_axis()
            .light_line_style(TRANSPARENT)
            .bold_line_style(GRID)
            .label_style(font(TEXT))
            .axis_desc_style(font(TEXT))
            .x_desc(&self.x.title)
            .draw()?;
        let mut tips = Vec::new();
        for (row, (bar, label)) in self.bars.iter().zip(&labels).enumerate() {
            let middle = HEAD + row as i32 * PITCH + PITCH / 2;
            write(area, label, (margin - 8, middle), (HPos::Right, VPos::Center), false)?;
            tips.push(Tip { from: (0, middle - PITCH / 2), to: (margin - 4, middle + PITCH / 2), text: bar.label.clone() });
            tips.extend(self.draw_bar(area, bar, middle, |v| chart.backend_coord(&(v, 0.0)).0)?);
        }
        tips.extend(legend(area, (WIDTH - LEGEND + 10, HEAD), height, &self.entries())?);
        Ok(tips)
    }

    fn draw_bar(&self, area: &Area<'_>, bar: &Bar, middle: i32, x: impl Fn(f64) -> i32) -> Result<Vec<Tip>, Fault> {
        let (top, bottom) = (middle - PITCH / 2 + 3, middle + PITCH / 2 - 3);
        let (mut sum, mut tips) = (0.0, Vec::new());
        for (index, length) in bar.lengths.iter().enumerate() {
            let Some(length) = length else { continue };
            let (from, to) = (x(sum), x(sum + length));
            sum += length;
            area.draw(&Rectangle::new([(from, top), (to, bottom)], stage_colour(index).filled()))?;
            // A seam of the ground's colour parts neighbours of like colours.
            area.draw(&PathElement::new(vec![(to, top), (to, bottom)], WHITE.stroke_width(1)))?;
            tips.push(Tip { from: (from, top), to: (to, bottom), text: format!("{}: {} ms", self.parts[index], number(*length)) });
        }
        if let Some(line) = bar.line {
            area.draw(&PathElement::new(vec![(x(line), top - 2), (x(line), bottom + 2)], BLACK.stroke_width(2)))?;
        }
        let end = x(sum.max(bar.line.unwrap_or(0.0)));
        write(area, &number(sum), (end + 6, middle), (HPos::Left, VPos::Center), false)?;
        Ok(tips)
    }

    fn entries(&self) -> Vec<Entry<'_>> {
        let box_of = |index: usize| {
            move |area: &Area<'_>, (x, y): (i32, i32)| {
                area.draw(&Rectangle::new([(x - 9, y - 6), (x + 9, y + 6)], stage_colour(index).filled()))
            }
        };
        let parts = self.parts.iter().enumerate().map(|(index, name)| Entry { name, key: Box::new(box_of(index)) });
        let line = |area: &Area<'_>, (x, y): (i32, i32)| area.draw(&PathElement::new(vec![(x, y - 8), (x, y + 8)], BLACK.stroke_width(2)));
        parts.chain([Entry { name: self.line, key: Box::new(line) }]).collect()
    }
}
