//! The page: a template, styles, a script, the figures, and the data behind them as JSON.

use serde_json::{Value, json};

use super::{
    aggregate::{Aggregate, measures},
    figures::{self, HALF, WHOLE},
    layout::{self, Layout},
};
use crate::{
    shell::{flags, run_command},
    sweep::{axis::Axis, plan::Plan},
};

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// The whole page; `figures` are SVG documents in the order of [`figures::names`].
pub(crate) fn html<'a>(
    plan: &Plan,
    layout: &Layout,
    aggregates: &[Aggregate],
    failed: Option<&str>,
    figures: impl Iterator<Item = &'a str>,
) -> String {
    let figures: String =
        figures.map(|svg| format!("<template class=\"figure\">{svg}</template>\n")).collect();
    let data = data(plan, layout, aggregates, failed).to_string().replace("</", "<\\/");
    // The data comes last: it may contain anything.
    TEMPLATE
        .replace("{{style}}", STYLE)
        .replace("{{script}}", SCRIPT)
        .replace("{{figures}}", &figures)
        .replace("{{data}}", &data)
}

/// Everything that the script says.
fn data(plan: &Plan, layout: &Layout, aggregates: &[Aggregate], failed: Option<&str>) -> Value {
    let scenario = plan.scenario(0).map(|scenario| scenario.text().to_owned());
    json!({
        "title": plan.title,
        "study": plan.shown(),
        "scenarioName": plan.scenario,
        "scenario": scenario.unwrap_or_else(|error| error.to_string()),
        "command": run_command(&plan.scenario, &plan.set),
        "points": plan.len(),
        "failed": failed,
        "layout": layout,
        "axes": plan.axes.iter().map(axis_data).collect::<Vec<_>>(),
        "measures": measures().collect::<Vec<_>>(),
        "shown": figures::names(plan, layout),
        "spans": format!("Errors are {HALF}, torques and energy {WHOLE}."),
        "cells": aggregates.iter().map(aggregate_data).collect::<Vec<_>>(),
    })
}

fn axis_data(axis: &Axis) -> Value {
    json!({
        "name": axis.name.replace('_', " "),
        "labels": layout::labels(axis),
        "flags": axis.positions.iter().map(|position| flags(&position.set)).collect::<Vec<_>>(),
    })
}

/// `[positions, medians, least and greatest, points, diverged, error, limit, command]`; least and
/// greatest only where there are several points, limit and command only where gains were searched.
fn aggregate_data(aggregate: &Aggregate) -> Value {
    let column = |of: fn(&mtj_figure::cells::Spread) -> f64| -> Vec<Option<f64>> {
        aggregate.measures.iter().map(|spread| spread.map(|at| six_digits(of(&at)))).collect()
    };
    let spread = (aggregate.points > 1).then(|| [column(|at| at.least), column(|at| at.greatest)]);
    let Aggregate { at, points, diverged, error, best, .. } = aggregate;
    let (limit, command) = best.as_ref().map(|best| (&best.limit, &best.command)).unzip();
    json!([at, column(|at| at.median), spread, points, diverged, error, limit, command])
}

/// Enough digits for a reader; the results have all.
fn six_digits(number: f64) -> f64 {
    format!("{number:.5e}").parse().unwrap_or(number)
}
