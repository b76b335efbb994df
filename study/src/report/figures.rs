//! A study's figures.

use mtj_figure::{
    cells::CellValue,
    heatmap::{HeatMap, HeatMaps},
    trend::{TrendPanel, Trends},
};

use super::{
    aggregate::{Aggregate, measures},
    layout::{self, Layout},
    limits::Limits,
    winners,
};
use crate::sweep::plan::Plan;

/// A measure that has a figure.
pub(crate) struct Shown {
    /// The column of the results.
    column: &'static str,
    /// Name and unit.
    pub(crate) quantity: &'static str,
    /// From the column's unit to that one.
    factor: f64,
    /// The part of a run that it is over.
    span: &'static str,
}

/// The span of the errors.
pub(crate) const HALF: &str = "over the second half of each run";
/// The span of everything else.
pub(crate) const WHOLE: &str = "over the whole of each run";

/// The measures that have a figure.
pub(crate) const SHOWN: [Shown; 5] = [
    Shown { column: "rms_error_m", quantity: "rms error (mm)", factor: 1e3, span: HALF },
    Shown { column: "peak_error_m", quantity: "peak error (mm)", factor: 1e3, span: HALF },
    Shown { column: "energy_j", quantity: "energy (J)", factor: 1.0, span: WHOLE },
    Shown { column: "peak_torque_nm", quantity: "peak torque (N m)", factor: 1.0, span: WHOLE },
    Shown {
        column: "torque_step_rms_nm",
        quantity: "rms torque step (N m)",
        factor: 1.0,
        span: WHOLE,
    },
];

/// The meaning of the line in maps of latency over the sample period.
const LIMIT: &str = "predicted limit, for k = 0.99 where k varies: beyond it errors grow";

/// The title of the map of the best laws.
const WINNERS: &str = "law with the least error";

/// The figures of a study, as the page lists them: where gains were searched over two axes, first
/// the law that is best.
pub(crate) fn names(plan: &Plan, layout: &Layout) -> Vec<&'static str> {
    let winners = winners::can_show(plan, layout).then_some(WINNERS);
    winners.into_iter().chain(SHOWN.map(|shown| shown.quantity)).collect()
}

/// The names of the files and the SVG documents, in the order of [`names`]; `failed` says which
/// points could not be run.
pub(crate) fn all(
    plan: &Plan,
    layout: &Layout,
    aggregates: &[Aggregate],
    limits: &Limits,
    failed: Option<&str>,
) -> Vec<(String, String)> {
    let winners = winners::can_show(plan, layout).then(|| {
        let note = note(plan, HALF, failed);
        let maps = winners::maps(plan, layout, aggregates, &note);
        ("best-law".to_owned(), maps.svg())
    });
    let shown = SHOWN.iter().map(|Shown { column, quantity, factor, span }| {
        let index = measures().position(|name| name == *column).unwrap_or(0);
        let note = &note(plan, span, failed);
        let draw =
            Draw { plan, layout, aggregates, limits, note, quantity, factor: *factor, index };
        let name = quantity.split(" (").next().unwrap_or(column).replace(' ', "-");
        (name, if layout.y.is_some() { draw.maps().svg() } else { draw.trends().svg() })
    });
    winners.into_iter().chain(shown).collect()
}

/// The line below the title: the part of a run that is shown, the keys that `--set` has changed, and
/// what failed.
fn note(plan: &Plan, span: &str, failed: Option<&str>) -> String {
    let changes: Vec<String> = plan.changes().iter().map(ToString::to_string).collect();
    let changes = (!changes.is_empty()).then(|| format!("with {}", changes.join(", ")));
    let failed = failed.map(str::to_owned);
    let parts: Vec<_> = [span.to_owned()].into_iter().chain(changes).chain(failed).collect();
    parts.join("; ")
}

struct Draw<'a> {
    plan: &'a Plan,
    layout: &'a Layout,
    aggregates: &'a [Aggregate],
    limits: &'a Limits,
    note: &'a str,
    quantity: &'a str,
    factor: f64,
    index: usize,
}

impl Draw<'_> {
    fn maps(&self) -> HeatMaps {
        let axis = |axis: usize| layout::cell_axis(&self.plan.axes[axis]);
        let (x, y) = (self.layout.x, self.layout.y.unwrap_or(self.layout.x));
        let (columns, rows) = (axis(x).len(), axis(y).len());
        let mut maps: Vec<HeatMap> = self.panels(|title| HeatMap {
            title,
            cells: vec![CellValue::Empty; columns * rows],
            line: Vec::new(),
        });
        for aggregate in self.aggregates {
            let cell = aggregate.at[x] * rows + aggregate.at[y];
            maps[self.layout.panel(self.plan, &aggregate.at)].cells[cell] = self.value(aggregate);
        }
        for (map, limits) in maps.iter_mut().zip(self.limits) {
            map.line = limits.iter().map(|limit| limit.map(|seconds| seconds * 1e3)).collect();
        }
        HeatMaps {
            title: self.plan.title.clone(),
            note: self.note.to_owned(),
            quantity: self.quantity.to_owned(),
            x: axis(x),
            y: axis(y),
            maps,
            line: if self.limits.is_empty() { "" } else { LIMIT }.to_owned(),
        }
    }

    fn trends(&self) -> Trends {
        let x = layout::cell_axis(&self.plan.axes[self.layout.x]);
        let names = match self.layout.series {
            Some(series) => layout::cell_axis(&self.plan.axes[series]).labels,
            None => vec![self.quantity.to_owned()],
        };
        let curves = vec![vec![CellValue::Empty; x.len()]; names.len()];
        let mut panels = self.panels(|title| TrendPanel { title, curves: curves.clone() });
        for aggregate in self.aggregates {
            let series = self.layout.series.map_or(0, |series| aggregate.at[series]);
            panels[self.layout.panel(self.plan, &aggregate.at)].curves[series]
                [aggregate.at[self.layout.x]] = self.value(aggregate);
        }
        let (title, quantity) = (self.plan.title.clone(), self.quantity.to_owned());
        Trends { title, note: self.note.to_owned(), quantity, x, names, panels }
    }

    fn value(&self, aggregate: &Aggregate) -> CellValue {
        match aggregate.measures[self.index] {
            _ if aggregate.has_diverged() => CellValue::Diverged,
            Some(spread) => CellValue::Known(spread.times(self.factor)),
            None => CellValue::Empty,
        }
    }

    fn panels<P>(&self, make: impl Fn(String) -> P) -> Vec<P> {
        self.layout.combinations(self.plan).into_iter().map(|(_, title)| make(title)).collect()
    }
}
