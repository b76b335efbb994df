//! Results of all seeds of one combination of the other positions, taken together.

use std::collections::BTreeMap;

use mtj_figure::cells::Spread;

use super::layout::Layout;
use crate::sweep::{
    plan::Plan,
    results::{MEASURES, ResultRow},
};

/// The results of one combination of positions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Aggregate {
    /// Number of its first point.
    pub(crate) point: usize,
    /// Its position on each axis of the plan; 0 on those averaged over.
    pub(crate) at: Vec<usize>,
    /// For each measure its numbers.
    pub(crate) measures: Vec<Option<Spread>>,
    /// How many points there are.
    pub(crate) points: usize,
    /// How many of them diverged.
    pub(crate) diverged: usize,
    /// Why a point could not be run; empty if all could.
    pub(crate) error: String,
}

impl Aggregate {
    /// Whether most of its points diverged.
    pub(crate) fn has_diverged(&self) -> bool {
        2 * self.diverged > self.points
    }
}

/// The measures that are numbers, in the order of [`Aggregate::measures`].
pub(crate) fn measures() -> impl Iterator<Item = &'static str> {
    MEASURES.into_iter().filter(|name| !matches!(*name, "diverged" | "error"))
}

/// Takes rows together that differ in their seeds only, in the order of points.
pub(crate) fn aggregate(plan: &Plan, layout: &Layout, rows: &[ResultRow]) -> Vec<Aggregate> {
    let mut groups: BTreeMap<Vec<usize>, Vec<&ResultRow>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.point < plan.len()) {
        let mut at = indices(plan, row.point);
        for seed in &layout.seeds {
            at[*seed] = 0;
        }
        groups.entry(at).or_default().push(row);
    }
    groups.into_iter().map(|(at, rows)| of_group(plan, at, &rows)).collect()
}

fn of_group(plan: &Plan, at: Vec<usize>, rows: &[&ResultRow]) -> Aggregate {
    let column = |row: &ResultRow, name: &str| {
        let index = MEASURES.iter().position(|known| *known == name)?;
        row.fields.get(1 + plan.axes.len() + index).cloned()
    };
    let measure = |name| {
        let numbers = rows.iter().filter_map(|row| column(row, name)?.parse::<f64>().ok());
        let mut numbers: Vec<f64> = numbers.filter(|x| x.is_finite()).collect();
        numbers.sort_by(f64::total_cmp);
        let (least, greatest) = (*numbers.first()?, *numbers.last()?);
        let middle = numbers.len() / 2;
        let median = match numbers.len() % 2 {
            0 => (numbers[middle - 1] + numbers[middle]) / 2.0,
            _ => numbers[middle],
        };
        Some(Spread { median, least, greatest })
    };
    let is_diverged = |row: &&&ResultRow| column(row, "diverged").as_deref() == Some("true");
    let errors = rows.iter().filter_map(|row| column(row, "error"));
    Aggregate {
        point: rows.first().map_or(0, |row| row.point),
        at,
        measures: measures().map(measure).collect(),
        points: rows.len(),
        diverged: rows.iter().filter(is_diverged).count(),
        error: errors.into_iter().find(|error| !error.is_empty()).unwrap_or_default(),
    }
}

/// The position on each axis of a point, as numbers.
pub(crate) fn indices(plan: &Plan, point: usize) -> Vec<usize> {
    let mut rest = point;
    let mut at = vec![0; plan.axes.len()];
    for (index, axis) in at.iter_mut().zip(&plan.axes).rev() {
        *index = rest % axis.positions.len();
        rest /= axis.positions.len();
    }
    at
}

/// The number of the point at a position on each axis.
pub(crate) fn point(plan: &Plan, at: &[usize]) -> usize {
    plan.axes.iter().zip(at).fold(0, |point, (axis, at)| point * axis.positions.len() + at)
}
