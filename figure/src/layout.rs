//! Where the parts of a figure stand: title, panels in rows, legend.

use super::{
    sheet::{Anchor, CHARACTER, OUTLINE, Rect, Sheet, width_of},
    style::Style,
};

/// The width of figures whose panels share their axes, pixels.
pub(crate) const WIDTH: f64 = 1100.0;
/// Space for the vertical axis.
pub(crate) const LEFT: f64 = 62.0;
/// Space for a panel's title.
pub(crate) const HEADER: f64 = 26.0;
/// Between panels.
const GAP: f64 = 20.0;
const LINE: f64 = 19.0;

/// Panels of one size, filled row by row.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Grid {
    pub(crate) count: usize,
    pub(crate) columns: usize,
    /// Upper left corner of the first panel.
    pub(crate) origin: (f64, f64),
    pub(crate) panel: (f64, f64),
    /// From one panel to the next.
    pub(crate) pitch: (f64, f64),
}

impl Grid {
    /// Panels that share their axes and fill the width, no higher than wide times `aspect`.
    pub(crate) fn filling(
        count: usize,
        columns: usize,
        top: f64,
        has_titles: bool,
        aspect: f64,
    ) -> Self {
        const HIGHEST: f64 = 400.0;
        let header = if has_titles { HEADER } else { 6.0 };
        let pitch = (WIDTH - LEFT) / columns as f64;
        let panel = (pitch - GAP, (aspect * (pitch - GAP)).min(HIGHEST));
        let pitch = (pitch, header + panel.1 + GAP);
        Self { count, columns, origin: (LEFT, top + header), panel, pitch }
    }

    pub(crate) fn frame(&self, index: usize) -> Rect {
        let (row, column) = (index / self.columns, index % self.columns);
        Rect {
            left: self.origin.0 + column as f64 * self.pitch.0,
            top: self.origin.1 + row as f64 * self.pitch.1,
            width: self.panel.0,
            height: self.panel.1,
        }
    }

    /// Whether a panel is the first of its row.
    pub(crate) fn is_first(&self, index: usize) -> bool {
        index.is_multiple_of(self.columns)
    }

    /// Whether a panel is the lowest of its column.
    pub(crate) fn is_lowest(&self, index: usize) -> bool {
        index + self.columns >= self.count
    }

    /// The lower edge of the last row.
    pub(crate) fn bottom(&self) -> f64 {
        self.frame(self.count.max(1) - 1).bottom()
    }

    /// The empty place at the end of the last row, where there is one.
    pub(crate) fn free(&self) -> Option<Rect> {
        let free = self.count.next_multiple_of(self.columns) - self.count;
        let first = self.frame(self.count);
        let width = free as f64 * self.pitch.0 - GAP;
        (free > 0 && self.count > self.columns).then_some(Rect { width, ..first })
    }
}

/// Draws the title and, smaller, a note below it; returns where the panels begin.
pub(crate) fn heading(sheet: &mut Sheet, title: &str, note: &str) -> f64 {
    let mut top = 4.0;
    if !title.is_empty() {
        sheet.text((LEFT, top + 15.0), 17, Anchor::Start, title);
        top += 30.0;
    }
    for line in wrapped(note, (WIDTH - LEFT) / CHARACTER) {
        sheet.text((LEFT, top + 8.0), 13, Anchor::Start, &line);
        top += LINE;
    }
    top + 4.0
}

/// The symbol before a legend's text.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Symbol {
    /// A curve's stroke, with its marker if it has one.
    Curve(Style, bool),
    /// The cross where a curve ends.
    Cross,
    /// The pattern of cells that diverged.
    Hatching,
    /// A line in every map.
    Limit,
    /// The fill with this number.
    Fill(usize),
}

/// One entry of a legend.
#[derive(Clone, Debug)]
pub(crate) struct LegendEntry {
    pub(crate) symbol: Symbol,
    pub(crate) text: String,
}

/// Before the text.
const SYMBOL: f64 = 34.0;
/// Behind the text.
const SPACE: f64 = 20.0;

impl LegendEntry {
    /// The width of an entry on one line.
    pub(crate) fn width(&self) -> f64 {
        SYMBOL + CHARACTER * width_of(&self.text) + SPACE
    }
}

/// Draws a legend between two edges, in as many lines as it needs; returns its lower edge.
pub(crate) fn legend(
    sheet: &mut Sheet,
    entries: &[LegendEntry],
    (left, right): (f64, f64),
    top: f64,
) -> f64 {
    let (mut x, mut y, mut bottom) = (left, top + LINE / 2.0, top);
    for entry in entries {
        if x > left && x + entry.width() - SPACE > right {
            (x, y) = (left, bottom + LINE / 2.0);
        }
        entry.symbol.draw(sheet, x, y);
        let lines = wrapped(&entry.text, (right - x - SYMBOL) / CHARACTER);
        for (i, line) in lines.iter().enumerate() {
            sheet.text((x + SYMBOL, y + LINE * i as f64), 13, Anchor::Start, line);
        }
        bottom = bottom.max(y + LINE * (lines.len() as f64 - 0.5));
        x += entry.width();
    }
    bottom
}

impl Symbol {
    fn draw(self, sheet: &mut Sheet, x: f64, y: f64) {
        match self {
            Self::Curve(Style { color, dash, marker }, has_marker) => {
                sheet.add(format_args!(
                    r#"<path d="M{x:.1} {y:.1}h26" stroke="{color}" stroke-width="2" stroke-dasharray="{dash}"/>"#
                ));
                if has_marker {
                    let middle = x + 13.0;
                    sheet.add(format_args!(
                        r#"<path d="M{middle:.1} {y:.1}{marker}" fill="{color}"/>"#
                    ));
                }
            }
            Self::Cross => cross(sheet, (x + 13.0, y), OUTLINE, ""),
            Self::Hatching => {
                let top = y - 7.0;
                sheet.add(format_args!(
                    r#"<rect x="{x:.1}" y="{top:.1}" width="26" height="14" fill="url(#diverged)" stroke="{OUTLINE}"/>"#
                ));
            }
            Self::Fill(number) => {
                let top = y - 7.0;
                sheet.add(format_args!(
                    r#"<rect x="{x:.1}" y="{top:.1}" width="26" height="14" fill="url(#fill{number})" stroke="{OUTLINE}"/>"#
                ));
            }
            Self::Limit => {
                for stroke in LIMIT {
                    sheet
                        .add(format_args!(r#"<path d="M{x:.1} {y:.1}h26" fill="none" {stroke}/>"#));
                }
            }
        }
    }
}

/// Black dashes on a light ground can be seen on every colour.
pub(crate) const LIMIT: [&str; 2] = [
    r#"stroke="white" stroke-opacity="0.8" stroke-width="3.4""#,
    r#"stroke="black" stroke-width="1.6" stroke-dasharray="5 3""#,
];

/// Draws a cross with some attributes more.
pub(crate) fn cross(sheet: &mut Sheet, (x, y): (f64, f64), color: &str, attributes: &str) {
    sheet.add(format_args!(
        r#"<path d="M{x:.1} {y:.1}m-4-4l8 8m0-8l-8 8" fill="none" stroke="{color}" stroke-width="1.8"{attributes}/>"#
    ));
}

/// A text in lines of at most so many characters.
fn wrapped(text: &str, most: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width_of(line) + 1.0 + width_of(word) <= most => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_fill_the_width_whatever_their_number() {
        for (count, columns) in [(1, 1), (2, 2), (3, 3), (11, 4), (13, 5)] {
            let grid = Grid::filling(count, columns, 0.0, true, 1.0);
            let right = grid.frame(columns - 1).right();
            assert!((WIDTH - right - GAP).abs() < 1e-9, "{count} panels end at {right}");
        }
        assert_eq!(Grid::filling(4, 4, 0.0, true, 1.0).free(), None);
        let grid = Grid::filling(11, 4, 0.0, true, 1.0);
        assert_eq!(grid.free(), Some(grid.frame(11)));
    }

    #[test]
    fn a_legend_keeps_between_its_edges() {
        let entry = |text: &str| LegendEntry { symbol: Symbol::Cross, text: text.to_owned() };
        let mut sheet = Sheet::default();
        let one = legend(&mut sheet, &[entry("a"), entry("b")], (0.0, 400.0), 0.0);
        let two = legend(&mut sheet, &[entry("a"), entry("b")], (0.0, 70.0), 0.0);
        assert_eq!((one, two), (LINE, 2.0 * LINE));
        assert_eq!(wrapped("one two three", 7.0), ["one two", "three"]);
    }
}
