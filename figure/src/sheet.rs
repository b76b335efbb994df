//! What figures over cells share: panels in rows, axes of cells, text.

use std::fmt::Write;

use super::scale::Scale;

/// Ink for text.
pub const INK: &str = "#282828";
/// Frames and ticks.
pub const FRAME: &str = "#8c8c8c";
/// Space between the first cell and the others, where it stands apart.
const APART: f64 = 4.0;

/// A document that grows.
#[derive(Default)]
pub struct Sheet {
    body: String,
}

/// Where text is held.
#[derive(Clone, Copy)]
pub enum Hold {
    /// At its start.
    Start,
    /// In its middle.
    Middle,
    /// At its end.
    End,
}

/// A rectangle, pixels.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    /// Left edge.
    pub left: f64,
    /// Upper edge.
    pub top: f64,
    /// Width.
    pub width: f64,
    /// Height.
    pub height: f64,
}

impl Sheet {
    /// Adds any element.
    pub fn add(&mut self, element: std::fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = writeln!(self.body, "{element}");
    }

    /// Adds a line of text, its middle at `y`.
    pub fn text(&mut self, (x, y): (f64, f64), size: u32, hold: Hold, text: &str) {
        let anchor = hold.anchor();
        let (y, text) = (y + 0.35 * f64::from(size), escape(text));
        self.add(format_args!(
            r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" text-anchor="{anchor}">{text}</text>"#
        ));
    }

    /// Adds text that reads upwards.
    pub fn upward(&mut self, (x, y): (f64, f64), size: u32, text: &str) {
        let text = escape(text);
        self.add(format_args!(
            r#"<text transform="translate({x:.1} {y:.1}) rotate(-90)" font-size="{size}" text-anchor="middle">{text}</text>"#
        ));
    }

    /// The labels and ticks of a horizontal axis below a frame.
    pub fn axis_below(&mut self, frame: Frame, scale: &Scale, has_title: bool) {
        let bottom = frame.top + frame.height;
        let longest = scale.labels.iter().map(|label| label.chars().count()).max().unwrap_or(0);
        let slanted = longest > 8;
        let mut taken: Vec<f64> = Vec::new();
        for (place, label) in scale.ticks() {
            let x = frame.left + offset(scale, frame.width, place);
            let room = if slanted { 13.0 } else { 11.0 + 6.0 * label.chars().count() as f64 };
            if taken.iter().any(|other| (other - x).abs() < room) {
                continue;
            }
            taken.push(x);
            self.add(format_args!(r#"<path d="M{x:.1} {bottom:.1}v4" stroke="{FRAME}"/>"#));
            if slanted {
                let (y, label) = (bottom + 12.0, escape(&label));
                self.add(format_args!(r#"<text transform="translate({x:.1} {y:.1}) rotate(-40)" font-size="11" text-anchor="end">{label}</text>"#));
            } else {
                self.text((x, bottom + 13.0), 12, Hold::Middle, &label);
            }
        }
        if has_title {
            let below = if slanted { 64.0 } else { 31.0 };
            let middle = frame.left + frame.width / 2.0;
            self.text((middle, bottom + below), 13, Hold::Middle, &scale.title);
        }
    }

    /// The labels and ticks of a vertical axis left of a frame.
    pub fn axis_left(&mut self, frame: Frame, scale: &Scale, has_title: bool) {
        let mut taken: Vec<f64> = Vec::new();
        for (place, label) in scale.ticks() {
            let y = frame.top + frame.height - offset(scale, frame.height, place);
            if taken.iter().any(|other| (other - y).abs() < 14.0) {
                continue;
            }
            taken.push(y);
            let x = frame.left;
            self.add(format_args!(r#"<path d="M{x:.1} {y:.1}h-4" stroke="{FRAME}"/>"#));
            self.text((x - 7.0, y), 12, Hold::End, &label);
        }
        if has_title {
            let middle = frame.top + frame.height / 2.0;
            self.upward((frame.left - 42.0, middle), 13, &scale.title);
        }
    }

    /// The document, on white.
    pub fn finish(self, width: f64, height: f64) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" fill=\"{INK}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{}</svg>\n",
            self.body
        )
    }
}

/// The height that labels and title of a horizontal axis need.
pub fn axis_height(scale: &Scale) -> f64 {
    let longest = scale.labels.iter().map(|label| label.chars().count()).max().unwrap_or(0);
    if longest > 8 { 78.0 } else { 44.0 }
}

/// The distance of a place from the beginning of an axis that is `length` long.
pub fn offset(scale: &Scale, length: f64, place: f64) -> f64 {
    let apart = if scale.is_first_apart() { APART } else { 0.0 };
    let cell = (length - apart) / scale.len().max(1) as f64;
    (place + 0.5) * cell + apart * place.clamp(0.0, 1.0)
}

/// Beginning and length of a cell.
pub fn cell(scale: &Scale, length: f64, index: usize) -> (f64, f64) {
    let apart = if scale.is_first_apart() { APART } else { 0.0 };
    let size = (length - apart) / scale.len().max(1) as f64;
    (offset(scale, length, index as f64) - size / 2.0, size)
}

/// Text for a document.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Hold {
    fn anchor(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}
