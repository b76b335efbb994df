//! Maps of which of several is best in each cell.

use super::{
    cells::CellAxis,
    layout::{self, Grid, HEADER, LEFT, LegendEntry, Symbol, WIDTH},
    sheet::{self, Anchor, CHARACTER, Rect, Sheet, width_of},
    style::Style,
};

/// Maps over the same two axes.
#[derive(Clone, Debug)]
pub struct WinnerMaps {
    /// Above all maps.
    pub title: String,
    /// Below the title, smaller; empty for nothing.
    pub note: String,
    /// The horizontal axis.
    pub x: CellAxis,
    /// The vertical axis.
    pub y: CellAxis,
    /// What may win; those that win somewhere have a colour and a place in the legend.
    pub names: Vec<String>,
    /// The maps.
    pub maps: Vec<WinnerMap>,
}

/// One map.
#[derive(Clone, Debug)]
pub struct WinnerMap {
    /// Above the map, on the left.
    pub title: String,
    /// Column by column, each from below; `None` where nothing wins, which is not drawn.
    pub cells: Vec<Option<Winner>>,
}

/// What wins in a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Winner {
    /// Its number among the names.
    pub name: usize,
    /// Written into the cell where there is room.
    pub text: String,
    /// The attribute `data-at` of the cell's mark, by which a page finds it.
    pub at: String,
}

/// The size of the text in cells.
const TEXT: u32 = 10;
/// The height of a map that is alone.
const ALONE: f64 = 620.0;
/// The space on the right of a map that is alone.
const RIGHT: f64 = 20.0;

impl WinnerMaps {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let mut sheet = Sheet::default();
        let winners = self.winners();
        for place in 0..winners.len() {
            define(&mut sheet, place);
        }
        let top = layout::heading(&mut sheet, &self.title, &self.note);
        let grid = self.grid(top);
        let below = self.x.ticks(grid.panel.0, sheet::room_below(self.x.labels.iter()));
        let left = self.y.ticks(grid.panel.1, sheet::room_left);
        for (i, map) in self.maps.iter().enumerate() {
            let panel = grid.frame(i);
            self.draw(&mut sheet, map, panel, &winners);
            sheet.panel(i, panel, &map.title);
            if grid.is_first(i) {
                sheet.axis_left(panel, &left, &self.y.title);
            }
            if grid.is_lowest(i) {
                sheet.axis_below(panel, &below, &self.x.title);
            }
        }
        let end = grid.bottom() + sheet::axis_height(below.iter().map(|tick| &tick.label));
        let entries: Vec<_> = winners
            .iter()
            .enumerate()
            .map(|(place, name)| LegendEntry {
                symbol: Symbol::Fill(place),
                text: self.names[*name].clone(),
            })
            .collect();
        let bottom = layout::legend(&mut sheet, &entries, (LEFT, WIDTH - 8.0), end + 4.0);
        sheet.finish(WIDTH, bottom + 8.0)
    }

    fn grid(&self, top: f64) -> Grid {
        let count = self.maps.len();
        let has_titles = self.maps.iter().any(|map| !map.title.is_empty());
        if count != 1 {
            return Grid::filling(count, count.clamp(1, 3), top, has_titles, 1.0);
        }
        let panel = (WIDTH - LEFT - RIGHT, ALONE);
        let header = if has_titles { HEADER } else { 6.0 };
        Grid { count, columns: 1, origin: (LEFT, top + header), panel, pitch: panel }
    }

    /// Those that win somewhere, in the order of their names.
    fn winners(&self) -> Vec<usize> {
        let wins = |name: &usize| {
            let mut cells = self.maps.iter().flat_map(|map| map.cells.iter().flatten());
            cells.any(|cell| cell.name == *name)
        };
        (0..self.names.len()).filter(wins).collect()
    }

    fn draw(&self, sheet: &mut Sheet, map: &WinnerMap, panel: Rect, winners: &[usize]) {
        let (width, height) = (self.x.size(panel.width), self.y.size(panel.height));
        for (i, cell) in map.cells.iter().enumerate() {
            let Some(Winner { name, text, at }) = cell else { continue };
            let (column, row) = ((i / self.y.len()) as f64, (i % self.y.len()) as f64);
            let place = winners.iter().position(|winner| winner == name).unwrap_or(0);
            let x = panel.left + self.x.offset(panel.width, column);
            let y = panel.bottom() - self.y.offset(panel.height, row);
            let (left, top) = (x - width / 2.0, y - height / 2.0);
            // A little larger, so that no seams show.
            let (wide, high) = (width + 0.25, height + 0.25);
            sheet.add(format_args!(
                r#"<rect x="{left:.2}" y="{top:.2}" width="{wide:.2}" height="{high:.2}" fill="url(#fill{place})" data-at="{at}"/>"#
            ));
            let size = f64::from(TEXT);
            let has_room = width_of(text) * CHARACTER * size / 13.0 < width && size < height;
            if has_room {
                // The mark below takes the pointer.
                sheet.add(format_args!(r#"<g pointer-events="none">"#));
                sheet.text((x, y), TEXT, Anchor::Middle, text);
                sheet.add(format_args!("</g>"));
            }
        }
    }
}

/// How many colours there are before stripes tell them apart.
const COLORS: usize = 8;

/// Defines the fill of the winner with this place in the legend: light enough for text.
fn define(sheet: &mut Sheet, place: usize) {
    let color = Style::of(place % COLORS).color;
    let stripes = if place < COLORS {
        String::new()
    } else {
        r#"<path d="M0 0h8" stroke="white" stroke-width="4"/>"#.to_owned()
    };
    sheet.add(format_args!(
        r#"<defs><pattern id="fill{place}" width="8" height="8" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="8" height="8" fill="white"/><rect width="8" height="8" fill="{color}" fill-opacity="0.62"/>{stripes}</pattern></defs>"#
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_winners_are_in_the_legend_and_cells_carry_their_place() {
        let winner =
            |name, at: &str| Some(Winner { name, text: "1.5".to_owned(), at: at.to_owned() });
        let maps = WinnerMaps {
            title: "title".to_owned(),
            note: String::new(),
            x: CellAxis::of_numbers("x", &[1.0, 2.0], false),
            y: CellAxis::of_numbers("y", &[0.0], false),
            names: ["first", "second", "third"].map(str::to_owned).to_vec(),
            maps: vec![WinnerMap {
                title: String::new(),
                cells: vec![winner(2, "2,0,0"), winner(0, "0,1,0")],
            }],
        };
        let svg = maps.svg();
        assert!(svg.contains(">first<") && svg.contains(">third<") && !svg.contains(">second<"));
        assert!(svg.contains(r#"data-at="2,0,0""#) && svg.contains(r#"data-at="0,1,0""#));
        assert_eq!(svg.matches(">1.5<").count(), 2);
    }
}
