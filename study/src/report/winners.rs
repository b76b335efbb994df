//! Which law has the least error in each cell.

use std::collections::BTreeMap;

use mtj_figure::{
    short,
    winners::{Winner, WinnerMap, WinnerMaps},
};

use super::{
    aggregate::{Aggregate, measures},
    layout::{self, Layout},
};
use crate::sweep::plan::Plan;

/// The axis of the laws where gains are searched.
const LAWS: usize = 0;

/// Whether there is a map: gains were searched over two axes of numbers, with a panel for each law.
pub(crate) fn can_show(plan: &Plan, layout: &Layout) -> bool {
    plan.best.is_some() && layout.y.is_some() && layout.panels.contains(&LAWS)
}

/// The maps; a panel for each combination of positions of the other axes.
pub(crate) fn maps(
    plan: &Plan,
    layout: &Layout,
    aggregates: &[Aggregate],
    note: &str,
) -> WinnerMaps {
    let (x, y) = (layout.x, layout.y.unwrap_or(layout.x));
    let others: Vec<usize> = layout.panels.iter().copied().filter(|axis| *axis != LAWS).collect();
    let panels = Layout { panels: others, ..layout.clone() };
    let rms = measures().position(|name| name == "rms_error_m").unwrap_or(0);
    let error = |aggregate: &Aggregate| {
        let spread = aggregate.measures[rms].filter(|_| !aggregate.has_diverged());
        spread.map(|spread| spread.median)
    };
    let mut best = BTreeMap::<(usize, usize, usize), (f64, &Aggregate)>::new();
    for aggregate in aggregates {
        let Some(error) = error(aggregate) else { continue };
        let cell = (panels.panel(plan, &aggregate.at), aggregate.at[x], aggregate.at[y]);
        let known = best.entry(cell).or_insert((error, aggregate));
        if error < known.0 {
            *known = (error, aggregate);
        }
    }
    let axis = |axis: usize| layout::cell_axis(&plan.axes[axis]);
    let (columns, rows) = (axis(x).len(), axis(y).len());
    let mut maps: Vec<WinnerMap> = panels
        .combinations(plan)
        .into_iter()
        .map(|(_, title)| WinnerMap { title, cells: vec![None; columns * rows] })
        .collect();
    for ((panel, column, row), (error, aggregate)) in best {
        let at = format!("{},{column},{row}", layout.panel(plan, &aggregate.at));
        maps[panel].cells[column * rows + row] =
            Some(Winner { name: aggregate.at[LAWS], text: written(error), at });
    }
    WinnerMaps {
        title: plan.title.clone(),
        note: format!("numbers are the rms error (mm) {note}"),
        x: axis(x),
        y: axis(y),
        names: layout::cell_axis(&plan.axes[LAWS]).labels,
        maps,
    }
}

/// An error in mm with two digits.
fn written(error: f64) -> String {
    let digits = format!("{:.1e}", 1e3 * error);
    digits.parse().map_or(digits, short)
}
