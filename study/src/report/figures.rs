//! A study's figures.

use mtj_figure::{
    heatmap::{HeatCell, HeatMap, HeatMaps},
    trend::{TrendPanel, Trends},
};

use super::{
    cells::{Cell, measures},
    layout::{self, Layout},
    limits::Limits,
};
use crate::sweep::plan::Plan;

/// What the measures are called and how they are shown: column, name with unit, factor.
pub const SHOWN: [(&str, &str, f64); 5] = [
    ("rms_error_m", "rms error (mm)", 1e3),
    ("peak_error_m", "peak error (mm)", 1e3),
    ("energy_j", "energy (J)", 1.0),
    ("peak_torque_nm", "peak torque (N m)", 1.0),
    ("torque_step_rms_nm", "rms torque step (N m)", 1.0),
];

/// What the line in maps of latency over the sample period means.
pub const LIMIT: &str = "predicted limit, for\n\
                         k = 0.99 where k varies:\n\
                         beyond it errors grow";

/// The name of each figure's files with its SVG document.
pub fn all(plan: &Plan, layout: &Layout, cells: &[Cell], limits: &Limits) -> Vec<(String, String)> {
    SHOWN
        .iter()
        .map(|(column, quantity, factor)| {
            let index = measures().position(|name| name == *column).unwrap_or(0);
            let draw = Draw { plan, layout, cells, limits, quantity, factor: *factor, index };
            let name = quantity.split(" (").next().unwrap_or(column).replace(' ', "-");
            (name, if layout.y.is_some() { draw.maps().svg() } else { draw.trends().svg() })
        })
        .collect()
}

struct Draw<'a> {
    plan: &'a Plan,
    layout: &'a Layout,
    cells: &'a [Cell],
    limits: &'a Limits,
    quantity: &'a str,
    factor: f64,
    index: usize,
}

impl Draw<'_> {
    fn maps(&self) -> HeatMaps {
        let axis = |axis: usize| layout::scale(&self.plan.axes[axis]);
        let (x, y) = (self.layout.x, self.layout.y.unwrap_or(self.layout.x));
        let (columns, rows) = (axis(x).len(), axis(y).len());
        let mut maps: Vec<HeatMap> = self.panels(|title| HeatMap {
            title,
            cells: vec![HeatCell::Empty; columns * rows],
            line: Vec::new(),
        });
        for cell in self.cells {
            let number = cell.measures[self.index].map(|[median, ..]| median * self.factor);
            maps[self.panel(cell)].cells[cell.at[x] * rows + cell.at[y]] = match number {
                _ if 2 * cell.diverged > cell.points => HeatCell::Diverged,
                Some(number) if number > 0.0 => HeatCell::Number(number),
                _ => HeatCell::Empty,
            };
        }
        for (map, limits) in maps.iter_mut().zip(self.limits) {
            map.line = limits.iter().map(|limit| limit.map(|seconds| seconds * 1e3)).collect();
        }
        let line = if self.limits.is_empty() { "" } else { LIMIT };
        HeatMaps {
            title: self.plan.title.clone(),
            quantity: self.quantity.to_owned(),
            x: axis(x),
            y: axis(y),
            maps,
            line: line.to_owned(),
        }
    }

    fn trends(&self) -> Trends {
        let x = layout::scale(&self.plan.axes[self.layout.x]);
        let names = match self.layout.series {
            Some(series) => layout::scale(&self.plan.axes[series]).labels,
            None => vec![self.quantity.to_owned()],
        };
        let curves: Vec<_> = names.into_iter().map(|name| (name, vec![None; x.len()])).collect();
        let mut panels = self.panels(|title| TrendPanel { title, curves: curves.clone() });
        for cell in self.cells.iter().filter(|cell| 2 * cell.diverged <= cell.points) {
            let series = self.layout.series.map_or(0, |series| cell.at[series]);
            panels[self.panel(cell)].curves[series].1[cell.at[self.layout.x]] =
                cell.measures[self.index].map(|at| at.map(|number| number * self.factor));
        }
        let (title, quantity) = (self.plan.title.clone(), self.quantity.to_owned());
        Trends { title, quantity, x, panels }
    }

    fn panels<P>(&self, make: impl Fn(String) -> P) -> Vec<P> {
        self.layout.combinations(self.plan).into_iter().map(|(_, title)| make(title)).collect()
    }

    /// The number of a cell's panel.
    fn panel(&self, cell: &Cell) -> usize {
        self.layout
            .panels
            .iter()
            .fold(0, |panel, axis| panel * self.plan.axes[*axis].positions.len() + cell.at[*axis])
    }
}
