//! Line figures: panels of curves over a continuous axis, each with axes of its own.

use std::{ops::Range, path::Path};

use super::{
    FigureError, Written,
    axis::{self, Tick},
    layout::{self, Grid, HEADER, LEFT, LegendEntry, Symbol},
    sheet::{Rect, Sheet},
    style::Style,
    thin::thin,
    write,
};

/// Panels of one size, filled row by row.
#[derive(Clone, Debug)]
pub struct LineFigure {
    /// Above all panels; empty for nothing.
    pub title: String,
    /// Panels in a row.
    pub columns: usize,
    /// Width and height of one panel with its axes, pixels.
    pub panel_size: (f64, f64),
    /// The panels.
    pub panels: Vec<LinePanel>,
}

/// Curves over one pair of axes.
#[derive(Clone, Debug)]
pub struct LinePanel {
    /// Above the panel, on the left.
    pub title: String,
    /// The horizontal axis.
    pub x: ValueAxis,
    /// The vertical axis.
    pub y: ValueAxis,
    /// Drawn in this order; their names stand above the panel, on the right.
    pub curves: Vec<Curve>,
}

/// An axis of numbers.
#[derive(Clone, Debug)]
pub struct ValueAxis {
    /// Quantity and unit.
    pub title: String,
    /// The numbers at its ends.
    pub range: Range<f64>,
}

/// One line.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Its name in the legend; empty for none.
    pub name: String,
    /// Its points; where x never decreases they are thinned to what the picture can show.
    pub points: Vec<(f64, f64)>,
}

const RIGHT: f64 = 16.0;
/// Labels and title of the horizontal axis.
const BELOW: f64 = 50.0;

impl ValueAxis {
    /// An axis over `range`.
    pub fn new(title: &str, range: Range<f64>) -> Self {
        Self { title: title.to_owned(), range }
    }

    fn offset(&self, number: f64, length: f64) -> f64 {
        (number - self.range.start) / (self.range.end - self.range.start) * length
    }

    fn ticks(&self, length: f64, room: f64) -> Vec<Tick> {
        axis::linear(&self.range, |number| Some(self.offset(number, length)), |_| room)
    }
}

impl Curve {
    /// A line through `points`.
    pub fn new(name: &str, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { name: name.to_owned(), points: points.into_iter().collect() }
    }
}

impl LineFigure {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let mut sheet = Sheet::default();
        let top = layout::heading(&mut sheet, &self.title, "");
        let (width, height) = self.panel_size;
        let grid = Grid {
            count: self.panels.len(),
            columns: self.columns.max(1),
            origin: (LEFT, top + HEADER),
            panel: (width - LEFT - RIGHT, height - HEADER - BELOW),
            pitch: self.panel_size,
        };
        for (i, panel) in self.panels.iter().enumerate() {
            panel.draw(&mut sheet, i, grid.frame(i));
        }
        sheet.finish(width * grid.columns as f64, grid.bottom() + BELOW)
    }

    /// Writes `folder/name.svg` and `folder/name.png`.
    ///
    /// # Errors
    ///
    /// [`FigureError::File`] if a file cannot be written.
    pub fn write(&self, folder: &Path, name: &str) -> Result<Written, FigureError> {
        write(&self.svg(), folder, name)
    }
}

impl LinePanel {
    fn draw(&self, sheet: &mut Sheet, id: usize, frame: Rect) {
        let (x, y) = (self.x.ticks(frame.width, 50.0), self.y.ticks(frame.height, 26.0));
        sheet.grid_down(frame, &x);
        sheet.grid_across(frame, &y);
        sheet.panel(id, frame, &self.title);
        sheet.axis_below(frame, &x, &self.x.title);
        sheet.axis_left(frame, &y, &self.y.title);
        for (i, curve) in self.curves.iter().enumerate() {
            let Style { color, dash, .. } = Style::of(i);
            let range = &self.x.range;
            let points = thin(&curve.points, range.start, range.end, frame.width as usize);
            let places =
                points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).map(|(x, y)| {
                    let x = frame.left + self.x.offset(*x, frame.width);
                    format!("{x:.2} {:.2}", frame.bottom() - self.y.offset(*y, frame.height))
                });
            let path = format!("M{}", places.collect::<Vec<_>>().join("L"));
            sheet.path(
                id,
                &path,
                format_args!(r#"stroke="{color}" stroke-width="1.25" stroke-dasharray="{dash}""#),
            );
        }
        let named = self.curves.iter().enumerate().filter(|(_, curve)| !curve.name.is_empty());
        let entries: Vec<LegendEntry> = named
            .map(|(i, curve)| LegendEntry {
                symbol: Symbol::Curve(Style::of(i), false),
                text: curve.name.clone(),
            })
            .collect();
        let width: f64 = entries.iter().map(LegendEntry::width).sum();
        let left = (frame.right() + 14.0 - width).max(frame.left);
        layout::legend(sheet, &entries, (left, f64::INFINITY), frame.top - 21.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panel_has_round_ticks_and_a_legend() {
        let line = Curve::new("τ₁", (0..100).map(|i| (f64::from(i), f64::from(i) / 7.0)));
        let figure = LineFigure {
            title: "title".to_owned(),
            columns: 1,
            panel_size: (440.0, 300.0),
            panels: vec![LinePanel {
                title: "panel".to_owned(),
                x: ValueAxis::new("time (s)", 3.0..98.0),
                y: ValueAxis::new("torque (N m)", -14.2..14.2),
                curves: vec![line.clone(), line],
            }],
        };
        let svg = figure.svg();
        for label in ["20", "40", "80", "−10", "0", "10", "time (s)", "panel", "title", "τ₁"] {
            assert!(svg.contains(&format!(">{label}</text>")), "{label}");
        }
        assert!(svg.contains(r##"stroke="#d55e00""##), "the second curve has a colour of its own");
    }
}
