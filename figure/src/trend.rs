//! Curves over cells: small multiples with one logarithmic vertical axis.

use super::{
    scale::{Scale, short},
    sheet::{self, FRAME, Frame, Hold, Sheet},
};

/// Curves over the same two axes.
#[derive(Clone, Debug)]
pub struct Trends {
    /// What stands above all panels.
    pub title: String,
    /// The vertical axis, with unit.
    pub quantity: String,
    /// The horizontal axis.
    pub x: Scale,
    /// The panels.
    pub panels: Vec<TrendPanel>,
}

/// One panel.
#[derive(Clone, Debug)]
pub struct TrendPanel {
    /// What stands above it.
    pub title: String,
    /// A name and, for each position on the horizontal axis, the middle, least and greatest number.
    pub curves: Vec<(String, Vec<Option<[f64; 3]>>)>,
}

/// Colours that stay apart for colour-blind readers, dark to light.
pub const COLORS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#7a5195", "#5c5c5c"];

const PANEL: (f64, f64) = (380.0, 250.0);
const LEFT: f64 = 66.0;
const BETWEEN: f64 = 22.0;
const HEADER: f64 = 24.0;
const TITLE: f64 = 38.0;
const LINE: f64 = 20.0;

impl Trends {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let columns = self.panels.len().clamp(1, 3);
        let rows = self.panels.len().div_ceil(columns).max(1);
        let size = if columns == 1 { (620.0, 340.0) } else { PANEL };
        let names: Vec<&str> = self
            .panels
            .first()
            .map(|panel| panel.curves.iter().map(|(name, _)| name.as_str()).collect())
            .unwrap_or_default();
        let row_height = HEADER + size.1 + 20.0;
        let width = LEFT + columns as f64 * (size.0 + BETWEEN);
        let below = TITLE + rows as f64 * row_height + sheet::axis_height(&self.x) - 8.0;
        let mut sheet = Sheet::default();
        sheet.text((LEFT, TITLE / 2.0), 17, Hold::Start, &self.title);
        let range = self.range();
        for (i, panel) in self.panels.iter().enumerate() {
            let (row, column) = (i / columns, i % columns);
            let frame = Frame {
                left: LEFT + column as f64 * (size.0 + BETWEEN),
                top: TITLE + HEADER + row as f64 * row_height,
                width: size.0,
                height: size.1,
            };
            self.draw(&mut sheet, panel, frame, range, column == 0);
            if i + columns >= self.panels.len() {
                sheet.axis_below(frame, &self.x, true);
            }
        }
        let (mut x, mut y) = (LEFT, below + 8.0);
        for (name, color) in names.iter().zip(COLORS.iter().cycle()) {
            let room = 34.0 + 7.0 * name.chars().count() as f64 + 18.0;
            if x > LEFT && x + room > width {
                (x, y) = (LEFT, y + LINE);
            }
            sheet.add(format_args!(
                r#"<path d="M{x} {y}h24" stroke="{color}" stroke-width="2.4"/>"#
            ));
            sheet.text((x + 31.0, y), 13, Hold::Start, name);
            x += room;
        }
        sheet.finish(width, y + LINE)
    }

    fn range(&self) -> (f64, f64) {
        let all = self.panels.iter().flat_map(|panel| &panel.curves).flat_map(|(_, at)| at);
        let positive = all.flatten().flatten().copied().filter(|x| *x > 0.0);
        let (least, most) =
            positive.fold((f64::MAX, 0.0), |(least, most), x| (x.min(least), x.max(most)));
        if least < most { (least / 1.15, most * 1.15) } else { (0.5, 2.0) }
    }

    fn draw(
        &self,
        sheet: &mut Sheet,
        panel: &TrendPanel,
        frame: Frame,
        (least, most): (f64, f64),
        is_labelled: bool,
    ) {
        let Frame { left, top, width, height } = frame;
        let place =
            |y: f64| top + height * (1.0 - (y.max(least) / least).ln() / (most / least).ln());
        sheet.text((left, top - 11.0), 14, Hold::Start, &panel.title);
        let mut taken: Vec<f64> = Vec::new();
        for (digit, exponent) in
            [1.0, 3.0, 2.0, 5.0].into_iter().flat_map(|d| (-12..12).map(move |e| (d, e)))
        {
            let number = digit * 10f64.powi(exponent);
            let y = place(number);
            if (least..=most).contains(&number) && taken.iter().all(|at| (at - y).abs() > 26.0) {
                taken.push(y);
                sheet.add(format_args!(r##"<path d="M{left} {y:.1}h{width}" stroke="#e4e4e4"/>"##));
                if is_labelled {
                    sheet.text((left - 7.0, y), 12, Hold::End, &short(number));
                }
            }
        }
        if is_labelled {
            sheet.upward((left - 46.0, top + height / 2.0), 13, &self.quantity);
        }
        for ((_, at), color) in panel.curves.iter().zip(COLORS.iter().cycle()) {
            let points = at.iter().enumerate().map(|(i, at)| {
                let x = left + sheet::offset(&self.x, width, i as f64);
                at.map(|at| (x, at.map(place)))
            });
            let points: Vec<Option<(f64, [f64; 3])>> = points.collect();
            for run in points.split(Option::is_none) {
                draw_run(sheet, &run.iter().flatten().copied().collect::<Vec<_>>(), color);
            }
        }
        sheet.add(format_args!(r#"<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="{FRAME}"/>"#));
    }
}

/// A band from least to greatest, the middle line and its points.
fn draw_run(sheet: &mut Sheet, run: &[(f64, [f64; 3])], color: &str) {
    let line = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        points.map(|(x, y)| format!("{x:.1} {y:.1}")).collect::<Vec<_>>().join("L")
    };
    if run.iter().any(|(_, [_, least, most])| (least - most).abs() > 0.1) {
        let up = line(&mut run.iter().map(|(x, at)| (*x, at[1])));
        let back = line(&mut run.iter().rev().map(|(x, at)| (*x, at[2])));
        sheet.add(format_args!(r#"<path d="M{up}L{back}Z" fill="{color}" fill-opacity="0.16"/>"#));
    }
    let middle = line(&mut run.iter().map(|(x, at)| (*x, at[0])));
    if run.len() > 1 {
        sheet.add(format_args!(
            r#"<path d="M{middle}" fill="none" stroke="{color}" stroke-width="1.8"/>"#
        ));
    }
    for (x, at) in run {
        let y = at[0];
        sheet.add(format_args!(r#"<circle cx="{x:.1}" cy="{y:.1}" r="2.3" fill="{color}"/>"#));
    }
}
