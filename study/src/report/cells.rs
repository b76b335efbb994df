//! Results by cell: all seeds of one combination of the other positions together.

use std::collections::BTreeMap;

use super::layout::Layout;
use crate::sweep::{
    plan::Plan,
    results::{MEASURES, Row},
};

/// What came of one cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cell {
    /// Number of its first point.
    pub point: usize,
    /// Its position on each axis of the plan; 0 on those averaged over.
    pub at: Vec<usize>,
    /// For each measure the median, least and greatest number.
    pub measures: Vec<Option<[f64; 3]>>,
    /// How many points there are.
    pub points: usize,
    /// How many of them diverged.
    pub diverged: usize,
    /// Why a point could not be run.
    pub error: String,
}

/// The measures that are numbers, in the order of [`Cell::measures`].
pub fn measures() -> impl Iterator<Item = &'static str> {
    MEASURES.into_iter().filter(|name| !matches!(*name, "diverged" | "error"))
}

/// Gathers rows into cells, in the order of points.
pub fn gather(plan: &Plan, layout: &Layout, rows: &[Row]) -> Vec<Cell> {
    let mut groups: BTreeMap<Vec<usize>, Vec<&Row>> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.point < plan.len()) {
        let mut at = indices(plan, row.point);
        for seed in &layout.seeds {
            at[*seed] = 0;
        }
        groups.entry(at).or_default().push(row);
    }
    groups.into_iter().map(|(at, rows)| cell(plan, at, &rows)).collect()
}

fn cell(plan: &Plan, at: Vec<usize>, rows: &[&Row]) -> Cell {
    let column = |row: &Row, name: &str| {
        let index = MEASURES.iter().position(|known| *known == name)?;
        row.fields.get(1 + plan.axes.len() + index).cloned()
    };
    let measure = |name| {
        let numbers = rows.iter().filter_map(|row| column(row, name)?.parse::<f64>().ok());
        let mut numbers: Vec<f64> = numbers.filter(|x| x.is_finite()).collect();
        numbers.sort_by(f64::total_cmp);
        let (least, most) = (*numbers.first()?, *numbers.last()?);
        let middle = numbers.len() / 2;
        let median = match numbers.len() % 2 {
            0 => (numbers[middle - 1] + numbers[middle]) / 2.0,
            _ => numbers[middle],
        };
        Some([median, least, most])
    };
    let is_diverged = |row: &&&Row| column(row, "diverged").as_deref() == Some("true");
    let errors = rows.iter().filter_map(|row| column(row, "error"));
    Cell {
        point: rows.first().map_or(0, |row| row.point),
        at,
        measures: measures().map(measure).collect(),
        points: rows.len(),
        diverged: rows.iter().filter(is_diverged).count(),
        error: errors.into_iter().find(|error| !error.is_empty()).unwrap_or_default(),
    }
}

/// The position on each axis of a point, as numbers.
pub fn indices(plan: &Plan, point: usize) -> Vec<usize> {
    let mut rest = point;
    let mut at = vec![0; plan.axes.len()];
    for (index, axis) in at.iter_mut().zip(&plan.axes).rev() {
        *index = rest % axis.positions.len();
        rest /= axis.positions.len();
    }
    at
}

/// The number of the point at a position on each axis.
pub fn point(plan: &Plan, at: &[usize]) -> usize {
    plan.axes.iter().zip(at).fold(0, |point, (axis, at)| point * axis.positions.len() + at)
}
