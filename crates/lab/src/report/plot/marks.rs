//! Colours and shapes of what is drawn.

use plotters::prelude::*;

use super::{Area, Fault};

/// Colours by M. Okabe and K. Ito that are told apart by colour-blind readers, but yellow, which is lost on white.
const COLOURS: [RGBColor; Look::COLOURS] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(64, 64, 64),
];
/// Shapes of marks.
const SHAPES: usize = 4;
/// Half the width of a mark in pixels.
pub(super) const MARK: i32 = 4;

/// How a series is told from others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::report) struct Look {
    colour: RGBColor,
    shape: usize,
}

impl Look {
    /// How many colours there are before they repeat.
    pub const COLOURS: usize = 7;

    /// Of the variant with this index; `member` tells the series of one variant apart.
    pub fn of(variant: usize, member: usize) -> Self {
        let (round, shape) = (member / SHAPES, (variant / COLOURS.len() + member) % SHAPES);
        Self { colour: colour(variant, round % 2 == 1), shape }
    }

    pub(super) fn colour(self) -> RGBColor {
        self.colour
    }

    /// Draws a mark around a point.
    pub(super) fn mark(self, area: &Area<'_>, (x, y): (i32, i32)) -> Result<(), Fault> {
        let (style, r) = (self.colour().filled(), MARK);
        let polygon =
            |points: &[(i32, i32)]| area.draw(&Polygon::new(points.iter().map(|p| (x + p.0, y + p.1)).collect::<Vec<_>>(), style));
        match self.shape {
            0 => area.draw(&Circle::new((x, y), r, style)),
            1 => area.draw(&Rectangle::new([(x - r, y - r), (x + r, y + r)], style)),
            2 => polygon(&[(0, -r - 1), (r + 1, r), (-r - 1, r)]),
            _ => polygon(&[(0, -r - 2), (r + 2, 0), (0, r + 2), (-r - 2, 0)]),
        }
    }
}

/// Colour of the stage with this index; those after the seventh are lighter.
pub(in crate::report) fn stage_colour(index: usize) -> RGBColor {
    colour(index, index / COLOURS.len() % 2 == 1)
}

fn colour(index: usize, light: bool) -> RGBColor {
    let RGBColor(r, g, b) = COLOURS[index % COLOURS.len()];
    let shade = |c: u8| if light { c / 2 + 127 } else { c };
    RGBColor(shade(r), shade(g), shade(b))
}
