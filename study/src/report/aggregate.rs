//! Results of all seeds of one combination of the other positions, taken together.

use std::collections::BTreeMap;

use mtj_figure::cells::Spread;

use super::layout::Layout;
use crate::sweep::{
    plan::Plan,
    results::{self, MEASURES, ResultRow},
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
    /// Of the first point, where gains were searched.
    pub(crate) best: Option<BestGains>,
}

/// The best gains of a point.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BestGains {
    /// What stands in the way of a lower error.
    pub(crate) limit: String,
    /// The command that repeats the run; empty if no gains keep all limits.
    pub(crate) command: String,
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

/// Rows that differ in their seeds only, taken together as they are read.
pub(crate) struct Groups<'a> {
    plan: &'a Plan,
    layout: &'a Layout,
    /// By the point at the first position of the seeds' axes.
    groups: BTreeMap<usize, Group>,
    /// The columns of [`measures`].
    columns: Vec<usize>,
    diverged: usize,
    /// The columns of [`BestGains`].
    best: Option<[usize; 2]>,
    count: usize,
}

/// The rows of one combination of positions.
#[derive(Default)]
struct Group {
    point: usize,
    points: usize,
    diverged: usize,
    error: String,
    best: Option<BestGains>,
    /// The numbers of all rows, in the order of [`measures`]; NaN where there is none.
    numbers: Vec<f64>,
}

impl<'a> Groups<'a> {
    /// No rows yet.
    pub(crate) fn new(plan: &'a Plan, layout: &'a Layout) -> Self {
        let known = results::columns(plan);
        let column = |name| known.iter().position(|known| known == name);
        let columns = measures().filter_map(column).collect();
        let diverged = column("diverged").unwrap_or(0);
        let best = plan.best.as_ref().and(column("limit").zip(column("command")));
        let best = best.map(<[usize; 2]>::from);
        Self { plan, layout, groups: BTreeMap::new(), columns, diverged, best, count: 0 }
    }

    /// How many rows there are.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Adds a row.
    pub(crate) fn add(&mut self, row: &ResultRow) {
        let mut at = indices(self.plan, row.point);
        for seed in &self.layout.seeds {
            at[*seed] = 0;
        }
        let group = self.groups.entry(point(self.plan, &at)).or_default();
        if group.points == 0 || row.point < group.point {
            group.point = row.point;
            group.best = self.best.map(|[limit, command]| BestGains {
                limit: row.fields[limit].clone(),
                command: row.fields[command].clone(),
            });
        }
        group.points += 1;
        group.diverged += usize::from(row.fields[self.diverged] == "true");
        if let (true, Some(error)) = (group.error.is_empty(), row.error()) {
            group.error = error.to_owned();
        }
        let number = |column: &usize| row.fields[*column].parse().unwrap_or(f64::NAN);
        group.numbers.extend(self.columns.iter().map(number));
        self.count += 1;
    }

    /// The groups, in the order of points.
    pub(crate) fn aggregates(self) -> Vec<Aggregate> {
        let Self { plan, groups, columns, .. } = self;
        let aggregate = |(first, group): (usize, Group)| {
            let Group { point, points, diverged, error, best, numbers } = group;
            let measure = |i| spread(numbers.iter().skip(i).step_by(columns.len()).copied());
            let measures = (0..columns.len()).map(measure).collect();
            Aggregate { point, at: indices(plan, first), measures, points, diverged, error, best }
        };
        groups.into_iter().map(aggregate).collect()
    }
}

/// Median, least and greatest of the numbers that are finite; `None` if none is.
fn spread(numbers: impl Iterator<Item = f64>) -> Option<Spread> {
    let mut numbers: Vec<f64> = numbers.filter(|x| x.is_finite()).collect();
    numbers.sort_by(f64::total_cmp);
    let (least, greatest) = (*numbers.first()?, *numbers.last()?);
    let middle = numbers.len() / 2;
    let median = match numbers.len() % 2 {
        0 => (numbers[middle - 1] + numbers[middle]) / 2.0,
        _ => numbers[middle],
    };
    Some(Spread { median, least, greatest })
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
