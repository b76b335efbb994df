//! Drawing a figure as SVG.

use plotters::{
    coord::Shift,
    prelude::{
        ChartBuilder, Color, DrawingArea, IntoDrawingArea, LineSeries, PathElement, RGBColor,
        SVGBackend, Text, WHITE,
    },
    style::{
        FontStyle, IntoFont, TextStyle,
        text_anchor::{HPos, Pos, VPos},
    },
};

use super::{Figure, FigureError, Panel, thin::thin};

/// The backend draws on whole numbers; this many of them make a pixel, so that flat curves have no
/// steps.
const UNITS: u32 = 8;
const TITLE: u32 = 24;
const HEADER: u32 = 26;
/// Of the plot itself: margin, axis title and tick labels.
const LEFT: u32 = MARGIN + AXIS;
const MARGIN: u32 = 8;
const AXIS: u32 = 54;
const RIGHT: u32 = 16;
const BOTTOM: u32 = 40;
/// Between a panel and the one below.
const GAP: u32 = 10;
const OUTER: u32 = 6;

const INK: RGBColor = RGBColor(40, 40, 40);
const FRAME: RGBColor = RGBColor(140, 140, 140);
const GRID: RGBColor = RGBColor(228, 228, 228);

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The document.
pub fn svg(figure: &Figure) -> Result<String, FigureError> {
    let columns = figure.columns.max(1);
    let rows = figure.panels.len().div_ceil(columns);
    let title = if figure.title.is_empty() { 0 } else { TITLE };
    let width = figure.panel_size.0 * columns as u32 + 2 * OUTER;
    let height = figure.panel_size.1 * rows as u32 + title + 2 * OUTER;
    let mut text = String::new();
    {
        let root =
            SVGBackend::with_string(&mut text, (width * UNITS, height * UNITS)).into_drawing_area();
        root.fill(&WHITE).map_err(failed)?;
        let (head, body) = root.split_vertically(units(title + OUTER));
        let middle = (units(width / 2), units(OUTER));
        let centered = style(16, INK, HPos::Center, VPos::Top);
        head.draw(&Text::new(figure.title.clone(), middle, centered)).map_err(failed)?;
        let body = body.margin(0, units(OUTER), units(OUTER), units(OUTER));
        for (panel, area) in figure.panels.iter().zip(body.split_evenly((rows, columns))) {
            draw_panel(panel, &area, figure.panel_size)?;
        }
        root.present().map_err(failed)?;
    }
    // The size it is shown at; the view box keeps the fine units.
    let fine = format!("width=\"{}\" height=\"{}\"", width * UNITS, height * UNITS);
    Ok(text.replacen(&fine, &format!("width=\"{width}\" height=\"{height}\""), 1))
}

fn draw_panel(panel: &Panel, area: &Area<'_>, size: (u32, u32)) -> Result<(), FigureError> {
    let title = style(14, INK, HPos::Left, VPos::Center);
    let header_middle = units(HEADER / 2);
    area.draw(&Text::new(panel.title.clone(), (units(LEFT), header_middle), title))
        .map_err(failed)?;
    draw_legend(panel, area, units(size.0 - RIGHT), header_middle)?;

    let (x, y) = (&panel.x.range, &panel.y.range);
    let mut chart = ChartBuilder::on(area)
        .margin_top(units(HEADER))
        .margin_right(units(RIGHT))
        .margin_bottom(units(GAP))
        .margin_left(units(MARGIN))
        .x_label_area_size(units(BOTTOM))
        .y_label_area_size(units(AXIS))
        .build_cartesian_2d(x.clone(), y.clone())
        .map_err(failed)?;
    let small = |size| style(size, INK, HPos::Left, VPos::Top);
    let inner = (size.0 - LEFT - RIGHT, size.1 - HEADER - BOTTOM - GAP);
    chart
        .configure_mesh()
        .max_light_lines(0)
        .x_labels((inner.0 / 60).max(2) as usize)
        .y_labels((inner.1 / 28).max(2) as usize)
        .x_label_formatter(&|x| tick(*x))
        .y_label_formatter(&|y| tick(*y))
        .x_desc(panel.x.label.clone())
        .y_desc(panel.y.label.clone())
        .label_style(small(12))
        .axis_desc_style(small(13))
        .axis_style(FRAME.stroke_width(UNITS))
        .set_all_tick_mark_size(units(4))
        .bold_line_style(GRID.stroke_width(UNITS))
        .draw()
        .map_err(failed)?;
    for curve in &panel.curves {
        let points = thin(&curve.points, x.start, x.end, inner.0 as usize);
        chart.draw_series(LineSeries::new(points, line(curve.color))).map_err(failed)?;
    }
    Ok(())
}

/// A stroke and a label for each curve that has one, ending at about `right`.
fn draw_legend(panel: &Panel, area: &Area<'_>, right: i32, middle: i32) -> Result<(), FigureError> {
    const STROKE: i32 = units(20);
    const SPACE: i32 = units(6);
    const BETWEEN: i32 = units(14);
    let named = || panel.curves.iter().filter(|curve| !curve.label.is_empty());
    let width = |label: &str| STROKE + SPACE + units(6) * label.chars().count() as i32;
    let total: i32 = named().map(|curve| width(&curve.label) + BETWEEN).sum();
    let mut start = right + BETWEEN - total;
    for curve in named() {
        let stroke = vec![(start, middle), (start + STROKE, middle)];
        area.draw(&PathElement::new(stroke, line(curve.color).stroke_width(2 * UNITS)))
            .map_err(failed)?;
        let text = style(13, INK, HPos::Left, VPos::Center);
        let place = (start + STROKE + SPACE, middle);
        area.draw(&Text::new(curve.label.clone(), place, text)).map_err(failed)?;
        start += width(&curve.label) + BETWEEN;
    }
    Ok(())
}

fn line((red, green, blue): (u8, u8, u8)) -> plotters::style::ShapeStyle {
    RGBColor(red, green, blue).stroke_width(UNITS * 5 / 4)
}

fn style(size: u32, color: RGBColor, horizontal: HPos, vertical: VPos) -> TextStyle<'static> {
    ("sans-serif", units(size), FontStyle::Normal)
        .into_font()
        .color(&color)
        .pos(Pos::new(horizontal, vertical))
}

const fn units(pixels: u32) -> i32 {
    (pixels * UNITS) as i32
}

/// A number without rounding noise and trailing zeros, with a true minus sign.
fn tick(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text.strip_prefix('-') {
        Some("0") => "0".to_owned(),
        Some(magnitude) => format!("−{magnitude}"),
        None => text.to_owned(),
    }
}

fn failed(error: impl std::fmt::Display) -> FigureError {
    FigureError::Drawing(error.to_string())
}
