//! What a law says about itself: its name, its parameters and its signals.
//!
//! Displays, recordings and exports draw from this description; none of them knows a law by name.

/// A law, described.
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
    /// What the plant holds beside the torque and returns as `applied` and `delivered`.
    pub echo: Signal,
    /// Whether the law uses the echo as its memory.
    pub has_memory: bool,
    /// What the law shows beside the tracking error, in the order of the wire.
    pub signals: &'static [Signal],
}

/// A quantity that a law shows: a list of numbers.
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

/// A key of a scenario's `law` table.
#[derive(Debug, PartialEq)]
pub struct Parameter {
    /// The whole key, like `law.factor.error`.
    pub key: &'static str,
    /// The label of a control.
    pub label: &'static str,
    /// What values look like.
    pub form: Form,
    /// The unit; empty for a pure number.
    pub unit: &'static str,
    /// The value where the key is absent.
    pub default: Default,
    /// What it does, in one sentence.
    pub help: &'static str,
}

/// What the values of a parameter look like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// One of a few words.
    Choice(&'static [&'static str]),
    /// One number.
    Number,
    /// One number for all task axes, or a list with one for each.
    List,
    /// One number, a list for a diagonal, or rows.
    Matrix,
    /// The same, or one of a few words.
    MatrixOr(&'static [&'static str]),
    /// True or false.
    Flag,
    /// A duration, like "10 ms".
    Duration,
    /// The same, or one of a few words.
    DurationOr(&'static [&'static str]),
}

/// The value of a parameter whose key is absent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Default {
    /// There is none: the key is required.
    Required,
    /// This TOML value.
    Value(&'static str),
    /// The value of another key.
    SameAs(&'static str),
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
