//! An SVG document in the making: text, panels, axes.

use std::fmt::{self, Write};

use super::axis::Tick;

/// The colour of text.
pub(crate) const INK: &str = "#282828";
/// The colour of frames and ticks.
pub(crate) const OUTLINE: &str = "#8c8c8c";
const GRID: &str = "#e4e4e4";
/// Below a panel labels longer than this many characters are slanted.
const SLANTED: usize = 8;
/// About the width of a character of legends and labels, pixels.
pub(crate) const CHARACTER: f64 = 6.4;

/// A document to which elements are added.
#[derive(Default)]
pub(crate) struct Sheet {
    body: String,
}

/// Which part of a text stands at its coordinates.
#[derive(Clone, Copy)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A rectangle, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) left: f64,
    pub(crate) top: f64,
    pub(crate) width: f64,
    pub(crate) height: f64,
}

impl Rect {
    pub(crate) fn right(&self) -> f64 {
        self.left + self.width
    }

    pub(crate) fn bottom(&self) -> f64 {
        self.top + self.height
    }
}

impl Sheet {
    /// Adds any element.
    pub(crate) fn add(&mut self, element: fmt::Arguments<'_>) {
        // Writing to a string does not fail.
        let _ = writeln!(self.body, "{element}");
    }

    /// Adds a line of text, its middle at `y`.
    pub(crate) fn text(&mut self, (x, y): (f64, f64), size: u32, anchor: Anchor, text: &str) {
        let anchor = anchor.name();
        let (y, text) = (y + 0.35 * f64::from(size), escape(text));
        self.add(format_args!(
            r#"<text x="{x:.1}" y="{y:.1}" font-size="{size}" text-anchor="{anchor}">{text}</text>"#
        ));
    }

    /// Adds a panel's title and its frame; `id` names the clip path of what is drawn inside.
    pub(crate) fn panel(&mut self, id: usize, panel: Rect, title: &str) {
        let Rect { left, top, width, height } = panel;
        self.text((left, top - 12.0), 14, Anchor::Start, title);
        let area = format!(r#"x="{left:.1}" y="{top:.1}" width="{width:.1}" height="{height:.1}""#);
        self.add(format_args!(r#"<clipPath id="panel{id}"><rect {area}/></clipPath>"#));
        self.add(format_args!(r#"<rect {area} fill="none" stroke="{OUTLINE}"/>"#));
    }

    /// Adds a line that a panel's frame clips.
    pub(crate) fn path(&mut self, panel: usize, path: &str, stroke: fmt::Arguments<'_>) {
        self.add(format_args!(
            r#"<path d="{path}" clip-path="url(#panel{panel})" fill="none" {stroke}/>"#
        ));
    }

    /// Adds lines across a panel at the ticks of its vertical axis.
    pub(crate) fn grid_across(&mut self, panel: Rect, ticks: &[Tick]) {
        for tick in ticks {
            let (left, y, width) = (panel.left, panel.bottom() - tick.at, panel.width);
            self.add(format_args!(r#"<path d="M{left:.1} {y:.1}h{width:.1}" stroke="{GRID}"/>"#));
        }
    }

    /// Adds lines down a panel at the ticks of its horizontal axis.
    pub(crate) fn grid_down(&mut self, panel: Rect, ticks: &[Tick]) {
        for tick in ticks {
            let (x, top, height) = (panel.left + tick.at, panel.top, panel.height);
            self.add(format_args!(r#"<path d="M{x:.1} {top:.1}v{height:.1}" stroke="{GRID}"/>"#));
        }
    }

    /// Adds the horizontal axis below a panel.
    pub(crate) fn axis_below(&mut self, panel: Rect, ticks: &[Tick], title: &str) {
        let bottom = panel.bottom();
        let is_slanted = is_slanted(ticks.iter().map(|tick| &tick.label));
        for Tick { at, label } in ticks {
            let x = panel.left + at;
            self.add(format_args!(r#"<path d="M{x:.1} {bottom:.1}v4" stroke="{OUTLINE}"/>"#));
            if is_slanted {
                let (y, label) = (bottom + 12.0, escape(label));
                self.add(format_args!(r#"<text transform="translate({x:.1} {y:.1}) rotate(-40)" font-size="11" text-anchor="end">{label}</text>"#));
            } else {
                self.text((x, bottom + 13.0), 12, Anchor::Middle, label);
            }
        }
        let below = if is_slanted { 64.0 } else { 31.0 };
        let middle = panel.left + panel.width / 2.0;
        self.text((middle, bottom + below), 13, Anchor::Middle, title);
    }

    /// Adds the vertical axis left of a panel.
    pub(crate) fn axis_left(&mut self, panel: Rect, ticks: &[Tick], title: &str) {
        for Tick { at, label } in ticks {
            let (x, y) = (panel.left, panel.bottom() - at);
            self.add(format_args!(r#"<path d="M{x:.1} {y:.1}h-4" stroke="{OUTLINE}"/>"#));
            self.text((x - 7.0, y), 12, Anchor::End, label);
        }
        let (x, y) = (panel.left - 46.0, panel.top + panel.height / 2.0);
        let title = escape(title);
        self.add(format_args!(
            r#"<text transform="translate({x:.1} {y:.1}) rotate(-90)" font-size="13" text-anchor="middle">{title}</text>"#
        ));
    }

    /// The document, on white.
    pub(crate) fn finish(self, width: f64, height: f64) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.0}\" height=\"{height:.0}\" \
             viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" fill=\"{INK}\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{}</svg>\n",
            self.body
        )
    }
}

/// The distance that two labels below a panel need.
pub(crate) fn room_below<'a>(labels: impl Iterator<Item = &'a String>) -> fn(&str) -> f64 {
    if is_slanted(labels) { |_| 13.0 } else { |label| 12.0 + CHARACTER * width_of(label) }
}

/// The distance that two labels left of a panel need.
pub(crate) fn room_left(_: &str) -> f64 {
    14.0
}

/// The height that labels and title of a horizontal axis need.
pub(crate) fn axis_height<'a>(labels: impl Iterator<Item = &'a String>) -> f64 {
    if is_slanted(labels) { 78.0 } else { 44.0 }
}

fn is_slanted<'a>(labels: impl Iterator<Item = &'a String>) -> bool {
    labels.map(|label| label.chars().count()).max().unwrap_or(0) > SLANTED
}

/// The length of a text in characters.
pub(crate) fn width_of(text: &str) -> f64 {
    text.chars().count() as f64
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}
