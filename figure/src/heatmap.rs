//! Heat maps: panels with one logarithmic colour scale.

use super::{
    axis,
    cells::{CellAxis, CellValue},
    colormap::viridis,
    layout::{self, Grid, LEFT, LIMIT, LegendEntry, Symbol, WIDTH},
    sheet::{self, Anchor, OUTLINE, Rect, Sheet},
};

/// Maps over the same two axes.
#[derive(Clone, Debug)]
pub struct HeatMaps {
    /// Above all maps.
    pub title: String,
    /// Below the title, smaller; empty for nothing.
    pub note: String,
    /// The quantity that the colours show, with unit, on a logarithmic scale.
    pub quantity: String,
    /// The horizontal axis.
    pub x: CellAxis,
    /// The vertical axis.
    pub y: CellAxis,
    /// The maps.
    pub maps: Vec<HeatMap>,
    /// The meaning of the line; empty if there is none.
    pub line: String,
}

/// One map.
///
/// The mark of a cell has the attribute `data-at="MAP,COLUMN,ROW"`, by which a page finds it.
#[derive(Clone, Debug)]
pub struct HeatMap {
    /// Above the map, on the left.
    pub title: String,
    /// Column by column, each from below; the median is drawn.
    pub cells: Vec<CellValue>,
    /// For each column the number on the vertical axis where the line passes.
    pub line: Vec<Option<f64>>,
}

impl HeatMaps {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let mut sheet = Sheet::default();
        sheet.add(format_args!(
            r##"<defs><pattern id="diverged" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="6" height="6" fill="#efebe6"/><rect width="1.6" height="6" fill="#b5aca2"/></pattern></defs>"##
        ));
        let top = layout::heading(&mut sheet, &self.title, &self.note);
        let has_titles = self.maps.iter().any(|map| !map.title.is_empty());
        let count = self.maps.len();
        let grid = Grid::filling(count, columns(count), top, has_titles, 1.0);
        let range = self.range();
        let below = self.x.ticks(grid.panel.0, sheet::room_below(self.x.labels.iter()));
        let left = self.y.ticks(grid.panel.1, sheet::room_left);
        for (i, map) in self.maps.iter().enumerate() {
            let panel = grid.frame(i);
            self.draw(&mut sheet, map, panel, range, i);
            if grid.is_first(i) {
                sheet.axis_left(panel, &left, &self.y.title);
            }
            if grid.is_lowest(i) {
                sheet.axis_below(panel, &below, &self.x.title);
            }
        }
        let end = grid.bottom() + sheet::axis_height(below.iter().map(|tick| &tick.label));
        match grid.free() {
            Some(free) => {
                let bottom = self.legend(&mut sheet, free, range, true);
                sheet.finish(WIDTH, end.max(bottom) + 8.0)
            }
            None => {
                let area = Rect { left: LEFT, top: end + 4.0, width: WIDTH - LEFT, height: 0.0 };
                let bottom = self.legend(&mut sheet, area, range, false);
                sheet.finish(WIDTH, bottom + 8.0)
            }
        }
    }

    /// Least and greatest number.
    fn range(&self) -> (f64, f64) {
        let numbers = self.maps.iter().flat_map(|map| &map.cells).filter_map(|cell| cell.spread());
        let numbers = numbers.map(|spread| spread.median).filter(|number| *number > 0.0);
        let (least, most) =
            numbers.fold((f64::MAX, 0.0), |(least, most), x| (x.min(least), x.max(most)));
        if least < most { (least, most) } else { (most.max(1e-9) / 2.0, most.max(1e-9) * 2.0) }
    }

    fn draw(&self, sheet: &mut Sheet, map: &HeatMap, panel: Rect, range: (f64, f64), id: usize) {
        let (width, height) = (self.x.size(panel.width), self.y.size(panel.height));
        for (i, cell) in map.cells.iter().enumerate() {
            let (column, row) = (i / self.y.len(), i % self.y.len());
            let fill = match cell {
                CellValue::Known(spread) if spread.median > 0.0 => {
                    viridis(part(spread.median, range))
                }
                CellValue::Diverged => "url(#diverged)".to_owned(),
                CellValue::Known(_) | CellValue::Empty => continue,
            };
            let (x, y) = self.middle(panel, column as f64, row as f64);
            let (x, y) = (x - width / 2.0, y - height / 2.0);
            // A little larger, so that no seams show.
            let (width, height) = (width + 0.25, height + 0.25);
            sheet.add(format_args!(
                r#"<rect x="{x:.2}" y="{y:.2}" width="{width:.2}" height="{height:.2}" fill="{fill}" data-at="{id},{column},{row}"/>"#
            ));
        }
        sheet.panel(id, panel, &map.title);
        let mut path = String::new();
        let mut is_down = false;
        for (column, limit) in map.line.iter().enumerate() {
            let place = limit.and_then(|limit| self.y.place(limit));
            if let Some(place) = place {
                let (x, y) = self.middle(panel, column as f64, place.clamp(-9.0, 1e4));
                path += &format!("{}{x:.1} {y:.1}", if is_down { "L" } else { "M" });
            }
            is_down = place.is_some();
        }
        if !path.is_empty() {
            for stroke in LIMIT {
                sheet.path(id, &path, format_args!("{stroke}"));
            }
        }
    }

    /// The middle of a cell, or of a place between cells.
    fn middle(&self, panel: Rect, column: f64, row: f64) -> (f64, f64) {
        let y = panel.bottom() - self.y.offset(panel.height, row);
        (panel.left + self.x.offset(panel.width, column), y)
    }

    /// The colours and what else there is to explain; returns the lower edge.
    fn legend(&self, sheet: &mut Sheet, area: Rect, range: (f64, f64), is_upright: bool) -> f64 {
        const STEPS: usize = 60;
        let bar = area.width.min(240.0);
        let (x, top) = (area.left, area.top + 24.0);
        sheet.text((x, area.top + 10.0), 13, Anchor::Start, &self.quantity);
        for step in 0..STEPS {
            let from = x + bar * step as f64 / STEPS as f64;
            let color = viridis((step as f64 + 0.5) / STEPS as f64);
            let width = bar / STEPS as f64 + 0.25;
            sheet.add(format_args!(
                r#"<rect x="{from:.2}" y="{top}" width="{width:.2}" height="12" fill="{color}"/>"#
            ));
        }
        let below = top + 12.0;
        let place = |number| Some(bar * part(number, range));
        for tick in axis::logarithmic(&(range.0..range.1), place, |_| 26.0) {
            let at = x + tick.at;
            sheet.add(format_args!(r#"<path d="M{at:.1} {below}v4" stroke="{OUTLINE}"/>"#));
            sheet.text((at, top + 24.0), 12, Anchor::Middle, &tick.label);
        }
        let entry = |symbol, text: &str| LegendEntry { symbol, text: text.to_owned() };
        let mut entries = vec![entry(Symbol::Hatching, "diverged")];
        if !self.line.is_empty() {
            entries.push(entry(Symbol::Limit, &self.line));
        }
        let bottom = top + 32.0;
        let (left, y) = if is_upright { (x, bottom + 6.0) } else { (x + bar + 40.0, area.top) };
        // A line of its own for each.
        let end = entries.iter().fold(y, |y, entry| {
            layout::legend(sheet, std::slice::from_ref(entry), (left, area.right()), y) + 4.0
        });
        end.max(bottom)
    }
}

/// The columns that leave the fewest places empty.
fn columns(count: usize) -> usize {
    let free = |columns: &usize| count.next_multiple_of(*columns) - count;
    if count <= 4 { count.max(1) } else { [4, 5, 3].into_iter().min_by_key(free).unwrap_or(4) }
}

fn part(number: f64, (least, most): (f64, f64)) -> f64 {
    (number / least).ln() / (most / least).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cells::Spread;

    fn maps(count: usize) -> HeatMaps {
        let map = HeatMap {
            title: "map".to_owned(),
            cells: vec![
                CellValue::Known(Spread::of(1.0)),
                CellValue::Diverged,
                CellValue::Empty,
                CellValue::Known(Spread::of(2.0)),
            ],
            line: vec![Some(0.5), Some(1.5)],
        };
        HeatMaps {
            title: "title".to_owned(),
            note: "with seed=2".to_owned(),
            quantity: "error (mm)".to_owned(),
            x: CellAxis::of_numbers("x", &[1.0, 2.0], false),
            y: CellAxis::of_numbers("y", &[0.0, 1.0], false),
            maps: vec![map; count],
            line: "limit".to_owned(),
        }
    }

    #[test]
    fn one_map_fills_the_page() {
        let svg = maps(1).svg();
        let widths = svg.split("<rect ").filter_map(|rect| {
            rect.split_once("data-at=").map(|(rect, _)| rect)?.split(r#"width=""#).nth(1)
        });
        let widths = widths.filter_map(|rest| rest.split('"').next()?.parse::<f64>().ok());
        assert!(
            widths.clone().all(|width| width > WIDTH / 3.0),
            "{:?}",
            widths.collect::<Vec<_>>()
        );
    }

    #[test]
    fn maps_leave_few_places_empty() {
        assert_eq!([1, 2, 4, 5, 7, 9, 11, 15].map(columns), [1, 2, 4, 5, 4, 3, 4, 5]);
    }

    #[test]
    fn cells_carry_their_place_and_an_empty_one_is_not_drawn() {
        let svg = maps(2).svg();
        for place in ["0,0,0", "0,0,1", "0,1,1", "1,1,1"] {
            assert!(svg.contains(&format!(r#"data-at="{place}""#)), "{place}");
        }
        assert!(!svg.contains(r#"data-at="0,1,0""#));
        assert!(svg.contains("with seed=2") && svg.contains(">diverged<"));
    }
}
