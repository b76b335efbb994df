//! Trends: panels of curves over cells, with one logarithmic vertical axis.

use super::{
    axis,
    cells::{CellAxis, CellValue, Spread},
    layout::{self, Grid, LEFT, LegendEntry, Symbol, WIDTH, cross},
    sheet::{self, Rect, Sheet},
    style::Style,
};

/// Curves over the same two axes.
#[derive(Clone, Debug)]
pub struct Trends {
    /// Above all panels.
    pub title: String,
    /// Below the title, smaller; empty for nothing.
    pub note: String,
    /// The vertical axis, with unit.
    pub quantity: String,
    /// The horizontal axis.
    pub x: CellAxis,
    /// The name of each curve in the legend.
    pub names: Vec<String>,
    /// The panels.
    pub panels: Vec<TrendPanel>,
}

/// One panel.
///
/// The mark of a cell has the attribute `data-at="PANEL,COLUMN,CURVE"`, by which a page finds it.
#[derive(Clone, Debug)]
pub struct TrendPanel {
    /// Above the panel, on the left.
    pub title: String,
    /// For each curve its value at each position of the horizontal axis.
    pub curves: Vec<Vec<CellValue>>,
}

/// The height of a cross with its margin, pixels.
const CROSS: f64 = 12.0;

/// A curve between two gaps: places and values, in pixels.
type Run = Vec<(f64, Spread)>;

impl Trends {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let mut sheet = Sheet::default();
        let top = layout::heading(&mut sheet, &self.title, &self.note);
        let has_titles = self.panels.iter().any(|panel| !panel.title.is_empty());
        let count = self.panels.len();
        let grid = Grid::filling(count, count.clamp(1, 3), top, has_titles, 0.7);
        let range = self.range();
        let scale = (grid.panel.1 - self.crosses_height()) / (range.1 / range.0).ln();
        let height = |x: f64| scale * (x.max(range.0) / range.0).ln();
        let below = self.x.ticks(grid.panel.0, sheet::room_below(self.x.labels.iter()));
        let left = axis::logarithmic(&(range.0..range.1), |x| Some(height(x)), |_| 26.0);
        for (i, panel) in self.panels.iter().enumerate() {
            let frame = grid.frame(i);
            sheet.grid_across(frame, &left);
            sheet.panel(i, frame, &panel.title);
            self.draw(&mut sheet, i, frame, height);
            if grid.is_first(i) {
                sheet.axis_left(frame, &left, &self.quantity);
            }
            if grid.is_lowest(i) {
                sheet.axis_below(frame, &below, &self.x.title);
            }
        }
        let end = grid.bottom() + sheet::axis_height(below.iter().map(|tick| &tick.label));
        let bottom = layout::legend(&mut sheet, &self.entries(), (LEFT, WIDTH - 8.0), end);
        sheet.finish(WIDTH, bottom + 8.0)
    }

    /// All values of all curves.
    fn values(&self) -> impl Iterator<Item = CellValue> {
        self.panels.iter().flat_map(|panel| &panel.curves).flatten().copied()
    }

    fn entries(&self) -> Vec<LegendEntry> {
        let curves = self.names.iter().enumerate().map(|(i, name)| LegendEntry {
            symbol: Symbol::Curve(Style::of(i), true),
            text: name.clone(),
        });
        let has_diverged = self.values().any(|value| value == CellValue::Diverged);
        let text = "diverges from here".to_owned();
        let cross = has_diverged.then_some(LegendEntry { symbol: Symbol::Cross, text });
        curves.chain(cross).collect()
    }

    /// The height above the curves where their crosses stand, one below the other.
    fn crosses_height(&self) -> f64 {
        let crosses = |panel: &TrendPanel, i: usize| {
            panel.curves.iter().filter(|values| diverges_at(values, i)).count()
        };
        let columns = 0..self.x.len();
        let at = |panel| columns.clone().map(|i| crosses(panel, i)).max().unwrap_or(0);
        CROSS * self.panels.iter().map(at).max().unwrap_or(0) as f64
    }

    fn range(&self) -> (f64, f64) {
        let all = self.values().filter_map(CellValue::spread);
        let positive = all.flat_map(|at| [at.median, at.least, at.greatest]).filter(|x| *x > 0.0);
        let (least, most) =
            positive.fold((f64::MAX, 0.0), |(least, most), x| (x.min(least), x.max(most)));
        if least < most { (least / 1.15, most * 1.15) } else { (0.5, 2.0) }
    }

    fn draw(&self, sheet: &mut Sheet, id: usize, panel: Rect, height: impl Fn(f64) -> f64) {
        let place = |i: usize| panel.left + self.x.offset(panel.width, i as f64);
        let mut crosses = vec![0_u32; self.x.len()];
        for (curve, values) in self.panels[id].curves.iter().enumerate() {
            let style = Style::of(curve);
            let mut run = Run::new();
            for (i, value) in values.iter().enumerate() {
                match value {
                    CellValue::Known(spread) => {
                        run.push((place(i), spread.map(|x| panel.bottom() - height(x))));
                        let (x, y) = (place(i), panel.bottom() - height(spread.median));
                        let Style { color, marker, .. } = style;
                        sheet.add(format_args!(
                            r#"<path d="M{x:.1} {y:.1}{marker}" fill="{color}" data-at="{id},{i},{curve}"/>"#
                        ));
                        continue;
                    }
                    CellValue::Diverged if diverges_at(values, i) => {
                        let y = panel.top + CROSS * (0.5 + f64::from(crosses[i]));
                        crosses[i] += 1;
                        if let Some((x, last)) = run.last() {
                            let path = format!("M{x:.1} {:.1}L{:.1} {y:.1}", last.median, place(i));
                            let color = style.color;
                            sheet.path(
                                id,
                                &path,
                                format_args!(
                                    r#"stroke="{color}" stroke-width="1" stroke-dasharray="1 3""#
                                ),
                            );
                        }
                        let at = format!(r#" data-at="{id},{i},{curve}""#);
                        cross(sheet, (place(i), y), style.color, &at);
                    }
                    CellValue::Diverged | CellValue::Empty => {}
                }
                draw_run(sheet, id, &std::mem::take(&mut run), style);
            }
            draw_run(sheet, id, &run, style);
        }
    }
}

/// Whether a curve begins to diverge at a position.
fn diverges_at(values: &[CellValue], i: usize) -> bool {
    values[i] == CellValue::Diverged && (i == 0 || values[i - 1] != CellValue::Diverged)
}

/// A band from least to greatest, and the line of the medians.
fn draw_run(sheet: &mut Sheet, id: usize, run: &Run, Style { color, dash, .. }: Style) {
    let line = |points: &mut dyn Iterator<Item = (f64, f64)>| {
        points.map(|(x, y)| format!("{x:.1} {y:.1}")).collect::<Vec<_>>().join("L")
    };
    if run.iter().any(|(_, at)| (at.least - at.greatest).abs() > 0.1) {
        let up = line(&mut run.iter().map(|(x, at)| (*x, at.least)));
        let back = line(&mut run.iter().rev().map(|(x, at)| (*x, at.greatest)));
        sheet.add(format_args!(
            r#"<path d="M{up}L{back}Z" fill="{color}" fill-opacity="0.16" pointer-events="none"/>"#
        ));
    }
    if run.len() > 1 {
        let median = format!("M{}", line(&mut run.iter().map(|(x, at)| (*x, at.median))));
        sheet.path(
            id,
            &median,
            format_args!(r#"stroke="{color}" stroke-width="1.8" stroke-dasharray="{dash}""#),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trends(curves: Vec<Vec<CellValue>>) -> Trends {
        Trends {
            title: String::new(),
            note: String::new(),
            quantity: "error (mm)".to_owned(),
            x: CellAxis::of_numbers("x", &[1.0, 2.0, 3.0, 4.0], false),
            names: (0..curves.len()).map(|i| format!("curve {i}")).collect(),
            panels: vec![TrendPanel { title: "panel".to_owned(), curves }],
        }
    }

    const KNOWN: CellValue = CellValue::Known(Spread { median: 1.0, least: 0.5, greatest: 2.0 });

    #[test]
    fn a_ninth_curve_differs_from_the_first_and_so_does_its_legend() {
        let svg = trends(vec![vec![KNOWN; 4]; 9]).svg();
        let strokes = |color: &str, dash: &str| {
            let stroke = format!(r#"stroke="{color}" "#);
            let dash = format!(r#"stroke-dasharray="{dash}""#);
            svg.lines().filter(|line| line.contains(&stroke) && line.contains(&dash)).count()
        };
        // One in the panel and one in the legend of each.
        assert_eq!((strokes("#0072b2", "none"), strokes("#0072b2", "7 3")), (2, 2));
        assert_eq!(strokes("#d55e00", "none"), 2);
    }

    #[test]
    fn a_curve_has_a_cross_where_it_begins_to_diverge_and_the_legend_says_so() {
        let ends = vec![KNOWN, KNOWN, CellValue::Diverged, CellValue::Diverged];
        let svg = trends(vec![ends.clone(), ends]).svg();
        let crosses: Vec<_> =
            svg.lines().filter(|line| line.contains("m-4-4l8 8m0-8l-8 8")).collect();
        assert_eq!(crosses.len(), 3, "two curves and the legend: {crosses:?}");
        assert!(crosses[0].contains(r#"data-at="0,2,0""#), "{}", crosses[0]);
        let place = |line: &str| line.split('m').next().map(str::to_owned);
        assert_ne!(place(crosses[0]), place(crosses[1]), "one hides the other");
        assert!(svg.contains("diverges from here"));
        assert!(!trends(vec![vec![KNOWN; 4]]).svg().contains("diverges"));
    }
}
