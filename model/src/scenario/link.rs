//! The two directions between plant and controller.

use std::{path::PathBuf, time::Duration};

use super::{
    error::ScenarioError,
    key::{
        Default::{Required, Value, Words},
        Form, Parameter, Range,
    },
    section::{self, Section},
};

const LATENCY: Parameter = Parameter::new(
    "link.*.latency",
    Form::Duration(Duration::ZERO),
    "",
    Value("\"0 s\""),
    "From entering to leaving the link: the mean, or what is added to every replayed latency.",
);
const DROPOUT: Parameter = Parameter::new(
    "link.*.dropout",
    Form::Text("a probability from 0 to 1, or a table {enter, leave} for bursts"),
    "",
    Words("nothing is lost"),
    "What is lost: each message with this probability, or bursts of them.",
);
/// The keys of either direction of a link.
pub(super) const KEYS: &[&Parameter] = &[&LATENCY, &DROPOUT];

const KIND: Parameter = Parameter::new(
    "link.*.jitter.kind",
    Form::Choice(&["uniform", "normal", "gamma", "replay"]),
    "",
    Required,
    "How the latency varies about its mean; without a table `jitter` it does not.",
);
const SPREAD: Parameter = Parameter::new(
    "link.*.jitter.spread",
    Form::Duration(Duration::ZERO),
    "",
    Words("required for uniform"),
    "Uniform: half the width of the interval; no more than the latency.",
);
const DEVIATION: Parameter = Parameter::new(
    "link.*.jitter.deviation",
    Form::Duration(Duration::ZERO),
    "",
    Words("required for normal and gamma"),
    "Standard deviation of a normal distribution cut off at 0, or of a gamma distribution.",
);
const FILE: Parameter = Parameter::new(
    "link.*.jitter.file",
    Form::Text("the path of a CSV file"),
    "",
    Words("required for replay"),
    "Replay: latencies as measured, one after the other and round again.",
);
/// The keys of `jitter`.
pub(super) const JITTER_KEYS: &[&Parameter] = &[&KIND, &SPREAD, &DEVIATION, &FILE];

const ENTER: Parameter = Parameter::new(
    "link.*.dropout.enter",
    Form::Number(Range::Fraction),
    "",
    Required,
    "Probability, at each message, of going from the good state to the bad.",
);
const LEAVE: Parameter = Parameter::new(
    "link.*.dropout.leave",
    Form::Number(Range::Fraction),
    "",
    Required,
    "Probability, at each message, of going from the bad state to the good.",
);
const GOOD: Parameter = Parameter::new(
    "link.*.dropout.good",
    Form::Number(Range::Fraction),
    "",
    Value("0.0"),
    "Probability of losing a message in the good state.",
);
const BAD: Parameter = Parameter::new(
    "link.*.dropout.bad",
    Form::Number(Range::Fraction),
    "",
    Value("1.0"),
    "Probability of losing a message in the bad state.",
);
/// The keys of bursts: the chain of Gilbert and Elliott.
pub(super) const BURST_KEYS: &[&Parameter] = &[&ENTER, &LEAVE, &GOOD, &BAD];

/// The format of a replay's file, for the reference of keys.
pub const REPLAY_FORMAT: &str = "\
A replay reads a CSV file, as a spreadsheet writes it (quotes and a byte-order mark may be there):

```csv
hop,latency_ms
router,1.5
router,lost
router,20
```

- The first line names the columns. Latencies are in the column `latency_s`, `latency_ms`,
  `latency_us` or `latency_ns`; all other columns are ignored.
- Each further line is one message: its latency, 0 or greater, or `lost`. The first message takes
  the first line; after the last line the replay begins again.
- A line whose cells are all empty is skipped, however many columns there are.
- The latency is *added* to `link.*.latency`. Losses by `link.*.dropout` come on top.
- A relative path starts at the folder of the scenario's file, also when `--set` gives it; that of a
  built-in scenario starts at the working directory.
";

/// Both directions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Links {
    /// Sensor to controller.
    pub state: LinkSettings,
    /// Controller to actuator.
    pub torque: LinkSettings,
}

/// How one direction delays and loses what it carries.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LinkSettings {
    /// From entering to leaving the link: the mean, or with a replay what is added to it.
    pub latency: Duration,
    /// How the latency varies.
    pub jitter: Jitter,
    /// What is lost.
    pub dropout: Dropout,
}

/// How a latency varies about its mean.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Jitter {
    /// Not at all.
    #[default]
    None,
    /// Evenly within the mean ± `spread`.
    Uniform {
        /// Half the width; no more than the mean.
        spread: Duration,
    },
    /// Normally, cut off at zero.
    Normal {
        /// Standard deviation.
        deviation: Duration,
    },
    /// By a gamma distribution: never negative, with a long tail, as queues make it.
    Gamma {
        /// Standard deviation.
        deviation: Duration,
    },
    /// As measured: the latencies in a CSV file, one after the other and round again.
    Replay {
        /// A file of the [`REPLAY_FORMAT`].
        file: PathBuf,
    },
}

/// What a link loses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Dropout {
    /// Nothing.
    #[default]
    None,
    /// Each message with the same probability.
    Independent(f64),
    /// In bursts (Gilbert and Elliott): a two-state Markov chain that moves before each message.
    Burst {
        /// Probability of going from the good state to the bad.
        enter: f64,
        /// Probability of going from the bad state to the good.
        leave: f64,
        /// Probability of losing a message in the good state.
        good: f64,
        /// Probability of losing a message in the bad state.
        bad: f64,
    },
}

#[derive(Clone, Copy)]
enum JitterKind {
    Uniform,
    Normal,
    Gamma,
    Replay,
}

impl Links {
    pub(super) fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let links = Self {
            state: LinkSettings::read(section.section_or_empty("state")?)?,
            torque: LinkSettings::read(section.section_or_empty("torque")?)?,
        };
        section.finish()?;
        Ok(links)
    }
}

impl LinkSettings {
    /// The shortest time for which a message travels, apart from one in a million and from what a
    /// replay adds.
    pub fn shortest(&self) -> Duration {
        let below = match &self.jitter {
            Jitter::None | Jitter::Replay { .. } => Duration::ZERO,
            Jitter::Uniform { spread } => *spread,
            Jitter::Normal { deviation } | Jitter::Gamma { deviation } => 5 * *deviation,
        };
        self.latency.saturating_sub(below)
    }

    fn read(section: Section<'_>) -> Result<Self, ScenarioError> {
        let latency = section.duration(&LATENCY)?;
        let jitter = match section.optional_section("jitter")? {
            None => Jitter::None,
            Some(jitter) => Jitter::read(jitter, latency)?,
        };
        let dropout = Dropout::read(&section)?;
        section.finish()?;
        Ok(Self { latency, jitter, dropout })
    }
}

impl Jitter {
    fn read(section: Section<'_>, latency: Duration) -> Result<Self, ScenarioError> {
        let kinds = {
            use JitterKind::{Gamma, Normal, Replay, Uniform};
            [Uniform, Normal, Gamma, Replay]
        };
        let jitter = match section.word(&KIND, &kinds)? {
            JitterKind::Uniform => {
                let spread = section.duration(&SPREAD)?;
                if spread > latency {
                    return Err(section.refuse("spread", "no more than the link's latency"));
                }
                Self::Uniform { spread }
            }
            JitterKind::Normal => Self::Normal { deviation: section.duration(&DEVIATION)? },
            JitterKind::Gamma => {
                let deviation = section.duration(&DEVIATION)?;
                if latency.is_zero() && !deviation.is_zero() {
                    return Err(section.refuse("deviation", "0 s, because the link's latency is 0"));
                }
                Self::Gamma { deviation }
            }
            JitterKind::Replay => {
                let file = section.get(&FILE, 1, |value| value.as_str().map(PathBuf::from))?;
                Self::Replay { file: section.folder().join(file) }
            }
        };
        section.finish()?;
        Ok(jitter)
    }
}

impl Dropout {
    fn read(link: &Section<'_>) -> Result<Self, ScenarioError> {
        let Some(burst) = link.optional_section("dropout").unwrap_or_default() else {
            let independent = link.find(&DROPOUT, 1, |value| {
                section::number(value).filter(|p| Range::Fraction.accepts(*p))
            })?;
            return Ok(independent.map_or(Self::None, Self::Independent));
        };
        let dropout = Self::Burst {
            enter: burst.number(&ENTER)?,
            leave: burst.number(&LEAVE)?,
            good: burst.number(&GOOD)?,
            bad: burst.number(&BAD)?,
        };
        burst.finish()?;
        Ok(dropout)
    }
}
