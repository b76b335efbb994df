//! The page: a template, styles and a script of ours, and the data as JSON.

use mtj_figure::{colormap::viridis, trend::COLORS};
use serde_json::{Value, json};

use super::{
    cells::{Cell, measures},
    figures::{LIMIT, SHOWN},
    layout::{self, Layout},
    limits::Limits,
};
use crate::sweep::plan::{Plan, flags};

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The whole page.
pub fn html(plan: &Plan, layout: &Layout, cells: &[Cell], limits: &Limits) -> String {
    // The data comes last: it may contain anything.
    TEMPLATE
        .replace("{{style}}", STYLE)
        .replace("{{script}}", SCRIPT)
        .replace("{{data}}", &data(plan, layout, cells, limits).to_string().replace("</", "<\\/"))
}

/// Everything the script draws and says.
pub fn data(plan: &Plan, layout: &Layout, cells: &[Cell], limits: &Limits) -> Value {
    let axes: Vec<Value> = plan.axes.iter().map(axis_data).collect();
    let panels: Vec<Value> = layout
        .combinations(plan)
        .into_iter()
        .map(|(at, title)| json!({"at": at, "title": title}))
        .collect();
    let shown: Vec<Value> = SHOWN
        .iter()
        .map(|(name, title, factor)| json!({"name": name, "title": title, "factor": factor}))
        .collect();
    let cells: Vec<Value> = cells.iter().map(cell_data).collect();
    let limits: Vec<Vec<Option<f64>>> =
        limits.iter().map(|row| row.iter().map(|x| x.map(|x| x * 1e3)).collect()).collect();
    let scenario = plan.scenario(0).map(|scenario| scenario.text().to_owned());
    json!({
        "title": plan.title,
        "study": plan.identity(),
        "scenarioName": plan.scenario,
        "scenario": scenario.unwrap_or_else(|error| error.to_string()),
        "command": plan.command_start(),
        "points": plan.len(),
        "layout": layout,
        "axes": axes,
        "panels": panels,
        "measures": measures().collect::<Vec<_>>(),
        "shown": shown,
        "cells": cells,
        "limits": limits,
        "limitCaption": format!(
            "{} ('mtj study predict' measures the limit too, and says where the loop is not linear \
             enough for it)",
            LIMIT.replace('\n', " ")
        ),
        "viridis": (0..=40).map(|i| viridis(f64::from(i) / 40.0)).collect::<Vec<_>>(),
        "colors": COLORS,
    })
}

fn axis_data(axis: &crate::sweep::axis::Axis) -> Value {
    let scale = layout::scale(axis);
    json!({
        "name": axis.name.replace('_', " "),
        "title": scale.title,
        "unit": if axis.unit == "s" { "ms" } else { axis.unit },
        "isLog": scale.is_logarithmic,
        "isApart": scale.is_first_apart(),
        "labels": scale.labels,
        "ticks": scale.ticks(),
        "numbers": scale.numbers,
        "flags": axis.positions.iter().map(|position| flags(&position.set)).collect::<Vec<_>>(),
    })
}

/// `[point, positions, medians, least and greatest, points, diverged, error]`; least and greatest
/// only where there are several points.
fn cell_data(cell: &Cell) -> Value {
    let column = |i: usize| -> Vec<Option<f64>> {
        cell.measures.iter().map(|measure| measure.map(|at| six_digits(at[i]))).collect()
    };
    let spread = (cell.points > 1).then(|| [column(1), column(2)]);
    json!([cell.point, cell.at, column(0), spread, cell.points, cell.diverged, cell.error])
}

/// What a reader wants to know of a number; all digits are in the results.
fn six_digits(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}
