//! The description of a law: its name, its parameters and its signals.
//!
//! Displays, recordings and exports draw from this description; none of them knows a law by name.

pub use crate::scenario::key::{Default, Form, Parameter};

/// The description of a law.
#[derive(Debug, PartialEq)]
pub struct Description {
    /// The name in scenarios, on the wire and in print.
    pub name: &'static str,
    /// The name in words.
    pub title: &'static str,
    /// The equation with its number.
    pub equation: &'static str,
    /// The keys of the scenario that this law reads, apart from memory and prediction.
    pub parameters: &'static [Parameter],
    /// The numbers that the plant holds with the torque and returns as `applied` and `delivered`.
    pub echo: Signal,
    /// Whether the law uses the echo as its memory.
    pub has_memory: bool,
    /// Whether the law keeps a state of its own.
    pub has_state: bool,
    /// What displays show beside the tracking error, in the order of the wire.
    pub signals: &'static [Signal],
}

/// A quantity for displays: a list of numbers.
#[derive(Debug, PartialEq)]
pub struct Signal {
    /// The name in recordings and exports.
    pub key: &'static str,
    /// The symbol in plots.
    pub symbol: &'static str,
    /// The title of a plot.
    pub title: &'static str,
    /// The unit; empty for a pure number.
    pub unit: &'static str,
    /// How many numbers it has.
    pub per: Per,
    /// The range in which all values lie, if that is known.
    pub range: Option<[f64; 2]>,
}

/// What a signal has one number for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Per {
    /// Each task axis.
    Axis,
    /// Each joint.
    Joint,
    /// The whole arm.
    Arm,
}

impl Per {
    /// How many numbers that is for an arm of so many joints with so many task axes.
    pub fn count(self, joints: usize, axes: usize) -> usize {
        match self {
            Self::Axis => axes,
            Self::Joint => joints,
            Self::Arm => 1,
        }
    }
}

impl Description {
    /// The signals with their numbers, cut out of what a sample carries, for an arm of so many
    /// joints with so many task axes.
    pub fn cut<'a>(
        &self,
        numbers: &'a [f64],
        joints: usize,
        axes: usize,
    ) -> impl Iterator<Item = (&'static Signal, &'a [f64])> {
        let mut rest = numbers;
        self.signals.iter().map(move |signal| {
            let count = signal.per.count(joints, axes).min(rest.len());
            let (head, tail) = rest.split_at(count);
            rest = tail;
            (signal, head)
        })
    }
}
