//! The part that each axis of a study has in a figure.

use mtj_figure::{cells::CellAxis, short};
use serde::Serialize;

use crate::{
    predict::LATENCY_KEYS,
    sweep::{axis::Axis, plan::Plan},
};

/// The part of each axis, by its number in the plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Layout {
    /// The horizontal axis.
    pub(crate) x: usize,
    /// The vertical axis of maps; without it there are curves.
    pub(crate) y: Option<usize>,
    /// One curve for each position of this axis.
    pub(crate) series: Option<usize>,
    /// A panel for each combination of positions of these.
    pub(crate) panels: Vec<usize>,
    /// Averaged over.
    pub(crate) seeds: Vec<usize>,
}

impl Layout {
    /// Maps over the two longest axes of numbers, latency upwards; curves if there is only one.
    pub(crate) fn of(plan: &Plan) -> Self {
        let axes = &plan.axes;
        let seeds: Vec<usize> = (0..axes.len()).filter(|i| is_set(&axes[*i], &["seed"])).collect();
        let mut rest: Vec<usize> = (0..axes.len()).filter(|i| !seeds.contains(i)).collect();
        let mut numbers: Vec<usize> =
            rest.iter().copied().filter(|i| is_ordered(&axes[*i])).collect();
        numbers.sort_by_key(|i| std::cmp::Reverse(axes[*i].positions.len()));
        numbers.truncate(2);
        numbers.sort_by_key(|i| (is_set(&axes[*i], &LATENCY_KEYS), *i));
        let longest = |of: &[usize]| of.iter().copied().max_by_key(|i| axes[*i].positions.len());
        let (x, y) = match numbers[..] {
            [x, y] => (x, Some(y)),
            [x] => (x, None),
            _ => (longest(&rest).unwrap_or(0), None),
        };
        rest.retain(|i| *i != x && Some(*i) != y);
        let fewest = rest.iter().copied().min_by_key(|i| axes[*i].positions.len());
        let series = fewest.filter(|_| y.is_none());
        rest.retain(|i| Some(*i) != series);
        Self { x, y, series, panels: rest, seeds }
    }

    /// Whether latency is drawn over the sample period.
    pub(crate) fn has_limits(&self, plan: &Plan) -> bool {
        // The limit of which gains?
        if plan.best.is_some() {
            return false;
        }
        let is_latency = |y| is_set(&plan.axes[y], &LATENCY_KEYS);
        is_set(&plan.axes[self.x], &["timing.sample_period"]) && self.y.is_some_and(is_latency)
    }

    /// The number of the panel that shows a place.
    pub(crate) fn panel(&self, plan: &Plan, at: &[usize]) -> usize {
        let size = |axis: &usize| plan.axes[*axis].positions.len();
        self.panels.iter().fold(0, |panel, axis| panel * size(axis) + at[*axis])
    }

    /// All combinations of positions of the panels' axes, each with its title.
    pub(crate) fn combinations(&self, plan: &Plan) -> Vec<(Vec<usize>, String)> {
        let mut all = vec![(Vec::new(), Vec::new())];
        for axis in self.panels.iter().map(|i| &plan.axes[*i]) {
            let shown = labels(axis);
            all = all
                .into_iter()
                .flat_map(|(at, words): (Vec<usize>, Vec<String>)| {
                    let shown = &shown;
                    (0..shown.len()).map(move |i| {
                        let extend = |mut list: Vec<usize>| {
                            list.push(i);
                            list
                        };
                        let mut words = words.clone();
                        words.push(in_words(axis, &shown[i]));
                        (extend(at.clone()), words)
                    })
                })
                .collect();
        }
        all.into_iter().map(|(at, words)| (at, words.join(", "))).collect()
    }
}

/// The axis of a figure; durations in ms.
pub(crate) fn cell_axis(axis: &Axis) -> CellAxis {
    let (factor, unit) = if axis.has_durations() { (1e3, " (ms)") } else { (1.0, "") };
    let numbers: Vec<Option<f64>> =
        axis.positions.iter().map(|position| position.number.map(|x| x * factor)).collect();
    let names = axis.positions.iter().map(|position| &position.label);
    let label = |(number, name): (&Option<f64>, &String)| number.map_or(name.clone(), short);
    CellAxis {
        title: format!("{}{unit}", axis.name.replace('_', " ")),
        labels: numbers.iter().zip(names).map(label).collect(),
        numbers,
        is_logarithmic: axis.is_logarithmic,
    }
}

/// The labels of an axis, numbers with their unit.
pub(crate) fn labels(axis: &Axis) -> Vec<String> {
    let unit = if axis.has_durations() { " ms" } else { "" };
    let CellAxis { labels, numbers, .. } = cell_axis(axis);
    let label = |(label, number): (String, Option<f64>)| match number {
        Some(_) => label + unit,
        None => label,
    };
    labels.into_iter().zip(numbers).map(label).collect()
}

/// A position as part of a title: a number needs the axis' name before it.
fn in_words(axis: &Axis, label: &str) -> String {
    if is_ordered(axis) {
        format!("{} {label}", axis.name.replace('_', " "))
    } else {
        label.to_owned()
    }
}

/// Whether the positions are numbers, for the most part.
fn is_ordered(axis: &Axis) -> bool {
    let numbers = axis.positions.iter().filter(|position| position.number.is_some()).count();
    numbers >= 2 && 3 * numbers >= 2 * axis.positions.len()
}

/// Whether an axis sets nothing but one of `keys`.
fn is_set(axis: &Axis, keys: &[&str]) -> bool {
    axis.positions.iter().all(|position| {
        !position.set.is_empty() && position.set.iter().all(|set| keys.contains(&set.path()))
    })
}
