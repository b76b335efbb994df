//! The arm at scale.

use mtj_model::scene::Point;
use ratatui::{
    buffer::Buffer,
    layout::Rect,
    symbols::Marker,
    text::{Line, Span},
    widgets::{
        Widget,
        canvas::{Canvas, Line as Link, Points},
    },
};

use super::Picture;
use crate::terminal::{palette::Tone, view::Bounds};

/// The part of the trail that is drawn densely, s.
const FRESH: f64 = 0.6;

/// The arm, the desired path and point, the measured tip and its trail.
pub(super) fn render(picture: &Picture, area: Rect, buf: &mut Buffer) {
    let area = picture.rule("Arm", Line::default(), area, buf);
    let (Some(bounds), Some(arm)) = (picture.view.bounds, picture.view.arm()) else { return };
    if area.is_empty() {
        return;
    }
    let legend = area.height >= 9;
    let drawing = Rect { height: area.height - u16::from(legend), ..area };
    let frame = Frame::of(bounds, drawing);
    draw_lines(picture, &frame, &arm, drawing, buf);
    draw_points(picture, &frame, &arm, drawing, buf);
    if legend {
        draw_legend(picture, &frame, Rect { y: area.bottom() - 1, height: 1, ..area }, buf);
    }
}

/// Maps the plane to an area; a metre has the same length in both directions.
struct Frame {
    x: [f64; 2],
    y: [f64; 2],
    dots: (f64, f64),
}

impl Frame {
    fn of(bounds: Bounds, area: Rect) -> Self {
        let dots = (f64::from(area.width) * 2.0, f64::from(area.height) * 4.0);
        let Bounds { low, high } = bounds;
        let size = |axis: usize| (high[axis] - low[axis]) * 1.04;
        let dot = (size(0) / dots.0).max(size(1) / dots.1).max(1e-9);
        let around = |axis: usize, dots: f64| {
            let middle = f64::midpoint(low[axis], high[axis]);
            [middle - dot * dots / 2.0, middle + dot * dots / 2.0]
        };
        Self { x: around(0, dots.0), y: around(1, dots.1), dots }
    }

    /// The character position of a point.
    fn cell(&self, point: &Point, area: Rect) -> (u16, u16) {
        let along =
            |value: f64, [low, high]: [f64; 2]| ((value - low) / (high - low)).clamp(0.0, 1.0);
        let x = (along(point[0], self.x) * (self.dots.0 - 1.0)).round() as u16 / 2;
        let y = ((1.0 - along(point[1], self.y)) * (self.dots.1 - 1.0)).round() as u16 / 4;
        (area.x + x, area.y + y)
    }

    /// The length in columns.
    fn columns(&self, length: f64) -> f64 {
        length / (self.x[1] - self.x[0]) * self.dots.0 / 2.0
    }
}

fn draw_lines(picture: &Picture, frame: &Frame, arm: &[Point], area: Rect, buf: &mut Buffer) {
    let color = |tone| picture.palette.color(tone);
    let flat = |point: &Point| (point[0], point[1]);
    let path: Vec<_> = picture.view.scene.iter().flat_map(|scene| scene.path()).map(flat).collect();
    let now = picture.view.overview.time();
    // The trail fades by getting thinner, which needs no colour.
    let trail: Vec<_> = picture
        .view
        .trail
        .iter()
        .enumerate()
        .filter(|(i, (time, _))| now - time < FRESH || i % 8 == 0)
        .map(|(_, (_, point))| flat(point))
        .collect();
    Canvas::default()
        .marker(Marker::Braille)
        .x_bounds(frame.x)
        .y_bounds(frame.y)
        .paint(|canvas| {
            canvas.draw(&Points { coords: &path, color: color(Tone::Faint) });
            canvas.layer();
            canvas.draw(&Points { coords: &trail, color: color(Tone::Tip) });
            canvas.layer();
            for link in arm.windows(2) {
                let [(x1, y1), (x2, y2)] = [flat(&link[0]), flat(&link[1])];
                canvas.draw(&Link { x1, y1, x2, y2, color: color(Tone::Strong) });
            }
        })
        .render(area, buf);
}

fn draw_points(picture: &Picture, frame: &Frame, arm: &[Point], area: Rect, buf: &mut Buffer) {
    let mut put = |cell: (u16, u16), symbol: &str, tone| {
        buf[cell].set_symbol(symbol).set_style(picture.palette.style(tone));
    };
    let [base, elbows @ .., tip] = arm else { return };
    put(frame.cell(base, area), "■", Tone::Strong);
    for elbow in elbows {
        put(frame.cell(elbow, area), "●", Tone::Strong);
    }
    let tip = frame.cell(tip, area);
    let desired = picture.view.desired().map(|point| frame.cell(&point, area));
    if let Some(desired) = desired {
        put(desired, "○", Tone::Desired);
    }
    put(tip, if desired == Some(tip) { "◉" } else { "●" }, Tone::Tip);
}

/// The legend: what the points mean, and the scale.
fn draw_legend(picture: &Picture, frame: &Frame, area: Rect, buf: &mut Buffer) {
    let room = f64::from(area.width) / 4.0;
    let mut lengths =
        (-3..4).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10f64.powi(power)));
    let Some(length) = lengths.rfind(|length| frame.columns(*length) <= room) else {
        return;
    };
    let dashes = (frame.columns(length).round() as usize).saturating_sub(2);
    let scale = format!("├{}┤ {length} m", "─".repeat(dashes));
    picture.styled(scale, Tone::Faint).render(area, buf);
    let legend = Line::from(vec![
        picture.styled("○", Tone::Desired),
        Span::raw(" desired "),
        picture.styled("●", Tone::Tip),
        Span::raw(" tip"),
    ]);
    let width = legend.width() as u16;
    if area.width > width + room as u16 + 8 {
        legend.render(Rect { x: area.right() - width, width, ..area }, buf);
    }
}
