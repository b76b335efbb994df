//! Which axis of a study is drawn how.

use mtj_figure::scale::{Scale, short};
use serde::Serialize;

use crate::{
    predict::LATENCY_KEYS,
    sweep::{axis::Axis, plan::Plan},
};

/// The part of each axis, by its number in the plan.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Layout {
    /// The horizontal axis.
    pub x: usize,
    /// The vertical axis of maps; without it there are curves.
    pub y: Option<usize>,
    /// One curve for each position of this axis.
    pub series: Option<usize>,
    /// A panel for each combination of positions of these.
    pub panels: Vec<usize>,
    /// Averaged over.
    pub seeds: Vec<usize>,
}

impl Layout {
    /// Maps over the two longest axes of numbers, latency upwards; curves if there is only one.
    pub fn of(plan: &Plan) -> Self {
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
    pub fn has_limits(&self, plan: &Plan) -> bool {
        let is_latency = |y| is_set(&plan.axes[y], &LATENCY_KEYS);
        is_set(&plan.axes[self.x], &["timing.sample_period"]) && self.y.is_some_and(is_latency)
    }

    /// All combinations of positions of the panels' axes, each with its title.
    pub fn combinations(&self, plan: &Plan) -> Vec<(Vec<usize>, String)> {
        let mut all = vec![(Vec::new(), Vec::new())];
        for axis in self.panels.iter().map(|i| &plan.axes[*i]) {
            let scale = scale(axis);
            all = all
                .into_iter()
                .flat_map(|(at, words): (Vec<usize>, Vec<String>)| {
                    let scale = &scale;
                    (0..scale.len()).map(move |i| {
                        let extend = |mut list: Vec<usize>| {
                            list.push(i);
                            list
                        };
                        let mut words = words.clone();
                        words.push(in_words(axis, &scale.labels[i]));
                        (extend(at.clone()), words)
                    })
                })
                .collect();
        }
        all.into_iter().map(|(at, words)| (at, words.join(", "))).collect()
    }
}

/// An axis as it is drawn; durations in ms.
pub fn scale(axis: &Axis) -> Scale {
    let factor = if axis.unit == "s" { 1e3 } else { 1.0 };
    let numbers: Vec<Option<f64>> =
        axis.positions.iter().map(|position| position.number.map(|x| x * factor)).collect();
    let label = |(number, name): (&Option<f64>, &String)| number.map_or(name.clone(), short);
    let names: Vec<String> = axis.positions.iter().map(|p| p.label.clone()).collect();
    Scale {
        title: format!("{}{}", axis.name.replace('_', " "), unit(axis)),
        labels: numbers.iter().zip(&names).map(label).collect(),
        numbers,
        is_logarithmic: axis.is_logarithmic,
    }
}

fn unit(axis: &Axis) -> &'static str {
    if axis.unit == "s" { " (ms)" } else { "" }
}

/// A position as part of a title: a name says what it is, a number does not.
fn in_words(axis: &Axis, label: &str) -> String {
    if !is_ordered(axis) {
        return label.to_owned();
    }
    let unit = if axis.unit == "s" { " ms" } else { "" };
    format!("{} {label}{unit}", axis.name.replace('_', " "))
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
