//! Heat maps: small multiples with one colour scale.

use super::{
    colormap::viridis,
    scale::{Scale, short},
    sheet::{self, FRAME, Frame, Hold, Sheet},
};

/// Maps over the same two axes.
#[derive(Clone, Debug)]
pub struct HeatMaps {
    /// What stands above all maps.
    pub title: String,
    /// What the colours mean, with unit; they go by the logarithm.
    pub quantity: String,
    /// The horizontal axis.
    pub x: Scale,
    /// The vertical axis.
    pub y: Scale,
    /// The maps.
    pub maps: Vec<HeatMap>,
    /// What the line means, if there is one.
    pub line: String,
}

/// One map.
#[derive(Clone, Debug)]
pub struct HeatMap {
    /// What stands above it.
    pub title: String,
    /// Column by column, each from below.
    pub cells: Vec<HeatCell>,
    /// For each column the number on the vertical axis where the line passes.
    pub line: Vec<Option<f64>>,
}

/// What one cell shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum HeatCell {
    /// A number greater than zero.
    Number(f64),
    /// The simulation ran away.
    Diverged,
    /// Nothing is known.
    Empty,
}

const MAP: (f64, f64) = (214.0, 214.0);
const LEFT: f64 = 58.0;
const BETWEEN: f64 = 20.0;
const HEADER: f64 = 26.0;
const TITLE: f64 = 38.0;
const LEGEND: f64 = 62.0;

impl HeatMaps {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let count = self.maps.len().max(1);
        let columns = count.min(if count > 12 { 5 } else { 4 });
        let rows = count.div_ceil(columns);
        let row_height = HEADER + MAP.1 + 22.0;
        let body = rows as f64 * row_height + sheet::axis_height(&self.x) - 22.0;
        let width = LEFT + columns as f64 * (MAP.0 + BETWEEN);
        let width = width.max(LEFT + 2.0 * MAP.0 + 150.0);
        let mut sheet = Sheet::default();
        sheet.add(format_args!(
            r##"<defs><pattern id="diverged" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="6" height="6" fill="#efebe6"/><rect width="1.6" height="6" fill="#b5aca2"/></pattern></defs>"##
        ));
        sheet.text((LEFT, TITLE / 2.0), 17, Hold::Start, &self.title);
        let range = self.range();
        for (i, map) in self.maps.iter().enumerate() {
            let (row, column) = (i / columns, i % columns);
            let frame = Frame {
                left: LEFT + column as f64 * (MAP.0 + BETWEEN),
                top: TITLE + HEADER + row as f64 * row_height,
                width: MAP.0,
                height: MAP.1,
            };
            self.draw(&mut sheet, map, frame, range, i);
            if column == 0 {
                sheet.axis_left(frame, &self.y, true);
            }
            if i + columns >= count {
                sheet.axis_below(frame, &self.x, true);
            }
        }
        // The empty places of the last row, where there are any, hold the legend.
        let free = rows * columns - count;
        let last = TITLE + (rows - 1) as f64 * row_height + HEADER;
        if free > 0 && rows > 1 {
            let left = LEFT + (columns - free) as f64 * (MAP.0 + BETWEEN) + 14.0;
            self.legend(&mut sheet, (left, last + 30.0), range, true);
            sheet.finish(width, TITLE + body + 6.0)
        } else {
            self.legend(&mut sheet, (LEFT, TITLE + body + 14.0), range, false);
            sheet.finish(width, TITLE + body + LEGEND)
        }
    }

    /// Least and greatest number.
    fn range(&self) -> (f64, f64) {
        let numbers = self.maps.iter().flat_map(|map| &map.cells).filter_map(|cell| match cell {
            HeatCell::Number(number) if *number > 0.0 => Some(*number),
            _ => None,
        });
        let (least, most) =
            numbers.fold((f64::MAX, 0.0), |(least, most), x| (x.min(least), x.max(most)));
        if least < most { (least, most) } else { (most.max(1e-9) / 2.0, most.max(1e-9) * 2.0) }
    }

    fn draw(&self, sheet: &mut Sheet, map: &HeatMap, frame: Frame, range: (f64, f64), id: usize) {
        sheet.text((frame.left, frame.top - 12.0), 14, Hold::Start, &map.title);
        for (i, cell) in map.cells.iter().enumerate() {
            let (column, row) = (i / self.y.len(), i % self.y.len());
            let (x, width) = sheet::cell(&self.x, frame.width, column);
            let (y, height) = sheet::cell(&self.y, frame.height, row);
            let fill = match cell {
                HeatCell::Number(number) => viridis(part(*number, range)),
                HeatCell::Diverged => "url(#diverged)".to_owned(),
                HeatCell::Empty => continue,
            };
            let (x, y) = (frame.left + x, frame.top + frame.height - y - height);
            // A little larger, so that no seams show.
            let (width, height) = (width + 0.25, height + 0.25);
            sheet.add(format_args!(
                r#"<rect x="{x:.2}" y="{y:.2}" width="{width:.2}" height="{height:.2}" fill="{fill}"/>"#
            ));
        }
        let Frame { left, top, width, height } = frame;
        sheet.add(format_args!(r#"<clipPath id="map{id}"><rect x="{left}" y="{top}" width="{width}" height="{height}"/></clipPath>"#));
        let mut path = String::new();
        let mut is_down = false;
        for (column, limit) in map.line.iter().enumerate() {
            let Some(place) = limit.and_then(|limit| self.y.place(limit)) else {
                is_down = false;
                continue;
            };
            let x = left + sheet::offset(&self.x, width, column as f64);
            let y = top + height - sheet::offset(&self.y, height, place.clamp(-9.0, 1e4));
            path += &format!("{}{x:.1} {y:.1}", if is_down { "L" } else { "M" });
            is_down = true;
        }
        if !path.is_empty() {
            for stroke in LINE {
                sheet.add(format_args!(
                    r#"<path d="{path}" clip-path="url(#map{id})" fill="none" {stroke}/>"#
                ));
            }
        }
        sheet.add(format_args!(r#"<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" stroke="{FRAME}"/>"#));
    }

    fn legend(&self, sheet: &mut Sheet, at: (f64, f64), range: (f64, f64), is_upright: bool) {
        const BAR: f64 = 180.0;
        const STEPS: usize = 60;
        let (x, y) = at;
        sheet.text((x, y), 13, Hold::Start, &self.quantity);
        let top = y + 12.0;
        for step in 0..STEPS {
            let from = x + BAR * step as f64 / STEPS as f64;
            let color = viridis((step as f64 + 0.5) / STEPS as f64);
            let width = BAR / STEPS as f64 + 0.25;
            sheet.add(format_args!(
                r#"<rect x="{from:.2}" y="{top}" width="{width:.2}" height="12" fill="{color}"/>"#
            ));
        }
        let mut taken: Vec<f64> = Vec::new();
        for (digit, exponent) in [1.0, 3.0]
            .into_iter()
            .flat_map(|digit| (-12..12).map(move |exponent| (digit, exponent)))
        {
            let number = digit * 10f64.powi(exponent);
            let tick = x + BAR * part(number, range);
            let is_inside = (range.0..=range.1).contains(&number);
            if is_inside && taken.iter().all(|other| (tick - other).abs() > 26.0) {
                taken.push(tick);
                let below = top + 12.0;
                sheet.add(format_args!(r#"<path d="M{tick:.1} {below}v4" stroke="{FRAME}"/>"#));
                sheet.text((tick, top + 24.0), 12, Hold::Middle, &short(number));
            }
        }
        let (left, mut top) = if is_upright { (x, top + 56.0) } else { (x + BAR + 40.0, y + 2.0) };
        sheet.add(format_args!(
            r#"<rect x="{left}" y="{top}" width="26" height="14" fill="url(#diverged)" stroke="{FRAME}"/>"#
        ));
        sheet.text((left + 36.0, top + 7.0), 13, Hold::Start, "diverged");
        top += if is_upright { 34.0 } else { 24.0 };
        if !self.line.is_empty() {
            let y = top + 7.0;
            for stroke in LINE {
                sheet.add(format_args!(r#"<path d="M{left} {y}h26" fill="none" {stroke}/>"#));
            }
            let lines: Vec<&str> = match is_upright {
                true => self.line.split('\n').collect(),
                false => vec![&self.line],
            };
            for (i, line) in lines.into_iter().enumerate() {
                let line = line.replace('\n', " ");
                sheet.text((left + 36.0, y + 17.0 * i as f64), 13, Hold::Start, &line);
            }
        }
    }
}

/// Black dashes on a light ground can be seen on every colour.
const LINE: [&str; 2] = [
    r#"stroke="white" stroke-opacity="0.8" stroke-width="3.4""#,
    r#"stroke="black" stroke-width="1.6" stroke-dasharray="5 3""#,
];

fn part(number: f64, (least, most): (f64, f64)) -> f64 {
    (number / least).ln() / (most / least).ln()
}
